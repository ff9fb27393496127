//! The scale of a map read from a maze of blocks: blocks become cells, and bodies points.

use super::grid::{Cell, Grid, MapScale, is_size, size_limits};
use super::text_file::{MapError, MapResult};

impl MapScale {
    /// Returns the map of a `maze` whose cells are blocks; errors refer to it as `file`. Starts and goals are in the middle of their
    /// blocks.
    pub fn of(self, file: &str, maze: &Grid) -> MapResult<Grid> {
        let Self { cell, margin, .. } = self;
        self.checked(file)?;
        if maze.scale() != Self::default() {
            if self == Self::default() {
                return Ok(maze.clone());
            }
            let help = "leave --cell and --margin out, and --goal-radius with a benchmark's maze";
            return Err(MapError::whole_file(file, "the map has a scale of its own", help));
        }
        if cell == 1 && margin == 0.0 {
            return Ok(maze.clone().with_scale(self));
        }
        let (width, height) = (cell * maze.width(), cell * maze.height());
        if !is_size(width, height) {
            let problem = format!("with {cell} cells a block, the map is {width} x {height} cells");
            return Err(MapError::whole_file(file, problem, size_limits()));
        }
        let block = |x: usize, y: usize| maze.is_free(Cell::new(x / cell, y / cell));
        let free = (0..width * height).map(|i| block(i % width, i / width)).collect();
        let free = widened(free, width, margin);
        let middle = |cells: &[Cell]| -> Vec<Cell> {
            let at = |block: usize| block * cell + cell / 2;
            cells.iter().map(|block| Cell::new(at(block.x), at(block.y))).collect()
        };
        let (starts, goals) = (middle(maze.starts()), middle(maze.goals()));
        let is_wall = |at: &&Cell| !free[at.y * width + at.x];
        let help = "give a smaller --margin, or a larger --cell";
        if let Some(Cell { x, y }) = starts.iter().chain(&goals).find(is_wall) {
            let block = format!("column {}, row {}", x / cell + 1, y / cell + 1);
            let problem =
                format!("a margin of {margin} cells makes the start or goal in {block} a wall");
            return Err(MapError::whole_file(file, problem, help));
        }
        if !free.contains(&true) {
            let problem = format!("a margin of {margin} cells leaves no free cell");
            return Err(MapError::whole_file(file, problem, help));
        }
        let map = Grid::new(maze.name(), width, free, starts, goals);
        Ok(map.with_scale(self))
    }

    /// Returns the scale; errors refer to the map as `file`.
    pub fn checked(self, file: &str) -> MapResult<Self> {
        if self.is_valid() {
            return Ok(self);
        }
        let (least, most) = Self::GOAL_RADII.into_inner();
        let problem = format!("a goal radius of {} cells is not possible", self.goal_radius);
        let help = format!("a goal radius is from {least} to {most} cells");
        Err(MapError::whole_file(file, problem, help))
    }
}

/// Returns the cells, `true` where free, whose middles are at least `margin` cells away from all
/// walls; outside is wall.
fn widened(free: Vec<bool>, width: usize, margin: f32) -> Vec<bool> {
    // Middles are half a cell away from the next cell.
    if margin <= 0.5 {
        return free;
    }
    let height = free.len() / width;
    let reach = (margin + 0.5).ceil() as usize;
    // Cells to the nearest wall in the same row: 0 at a wall, at most `reach`.
    let mut gaps = vec![0; free.len()];
    for (free, gaps) in free.chunks_exact(width).zip(gaps.chunks_exact_mut(width)) {
        let mut gap = 0;
        for (free, own) in free.iter().zip(&mut *gaps) {
            gap = if *free { (gap + 1).min(reach) } else { 0 };
            *own = gap;
        }
        gap = 0;
        for (free, own) in free.iter().zip(gaps).rev() {
            gap = if *free { (gap + 1).min(reach) } else { 0 };
            *own = gap.min(*own);
        }
    }
    let far = |cells: usize| if cells == 0 { 0.0 } else { cells as f32 - 0.5 };
    let is_far = |x: usize, y: usize| {
        (0..=reach).all(|rows| {
            let beyond = |row: Option<usize>| match row {
                Some(row) if row < height => far(gaps[row * width + x]),
                _ => 0.0,
            };
            let nearest = beyond(y.checked_sub(rows)).min(beyond(Some(y + rows)));
            far(rows).hypot(nearest) >= margin
        })
    };
    (0..free.len()).map(|i| free[i] && is_far(i % width, i / width)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{parse_map, print_ascii};

    fn scaled(text: &str, cell: usize, margin: f32) -> MapResult<String> {
        let maze = parse_map("maze", text.as_bytes()).expect("a map");
        let scale = MapScale { cell, margin, goal_radius: 2.0, ..MapScale::default() };
        let map = scale.of("maze", &maze)?;
        assert_eq!(map.scale(), scale);
        Ok(print_ascii(&map))
    }

    #[test]
    fn blocks_become_cells_and_marks_stay_in_the_middle() {
        let map = scaled("S#\n.G\n", 3, 0.0).expect("a map");
        assert_eq!(map, "...###\n.S.###\n...###\n......\n....G.\n......\n");
    }

    /// Compares with distances to all walls.
    #[test]
    fn widened_walls_are_all_cells_within_the_margin() {
        let maze = crate::map::random(crate::map::RandomMapKind::City, Some(30), 5);
        for margin in [0.6, 1.0, 1.5, 2.2, 3.5] {
            let map = MapScale { margin, ..MapScale::default() }
                .of("maze", &maze.with_marks(Vec::new(), Vec::new()));
            let Ok(map) = map else { continue };
            let off = |a: usize, b: isize| (a as f32 - b as f32).abs() - 0.5;
            let near = |cell: Cell| {
                (-1..=30).flat_map(|y| (-1..=30).map(move |x| (x, y))).any(|(x, y)| {
                    let inside = x >= 0 && y >= 0;
                    let free = inside && maze.is_free(Cell::new(x as usize, y as usize));
                    !free && off(cell.x, x).max(0.0).hypot(off(cell.y, y).max(0.0)) < margin
                })
            };
            for cell in maze.free_cells() {
                assert_eq!(map.is_free(cell), !near(cell), "{margin} at {cell:?}");
            }
        }
    }

    #[test]
    fn maps_that_are_too_large_or_without_room_are_refused() {
        let refused = |text: &str, cell, margin| scaled(text, cell, margin).expect_err("refused");
        assert!(refused("S..\n", 2, 1.6).problem.contains("in column 1, row 1 a wall"));
        assert!(refused("...\n", 1, 1.0).problem.contains("leaves no free cell"));
        let wide = ".".repeat(200) + "\n";
        assert!(refused(&wide, 200, 0.0).problem.contains("40000 x 200 cells"));
    }
}
