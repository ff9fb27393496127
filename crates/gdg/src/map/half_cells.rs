//! Shortest paths of a point, which cuts corners.
//!
//! A path from cell to cell leads through the cells' middles. A point moves along the inner corner
//! of every turn instead: in corridors one cell wide it needs a third fewer steps. Steps are at
//! most one cell long along each axis, and obstacles consist of cells, so that a shortest path
//! leads from corner to corner, and its length is that of a king's path over the corners, middles
//! and sides' middles of the cells.

use super::distance::StepSearch;
use super::flood::UNREACHABLE;
use super::grid::{Cell, Grid};

/// The largest map, in cells, whose half cells are searched: those of a larger one would take
/// hundreds of megabytes.
const MAX_HALVED_CELLS: usize = 1 << 20;

/// The points of a map at every half cell, as a map of its own: its free cells are the points that
/// touch a free cell. Of a map with more than 1024 x 1024 cells, the cells themselves.
pub(crate) struct HalfCells {
    points: Grid,
    /// Points per cell along each axis.
    per_cell: usize,
}

impl HalfCells {
    /// Returns the points of `map`.
    pub fn new(map: &Grid) -> Self {
        if map.free().len() > MAX_HALVED_CELLS {
            return Self { points: map.clone(), per_cell: 1 };
        }
        let (width, height) = (2 * map.width() + 1, 2 * map.height() + 1);
        let mut free = vec![false; width * height];
        for Cell { x, y } in map.free_cells() {
            for row in 2 * y..=2 * y + 2 {
                free[row * width + 2 * x..=row * width + 2 * x + 2].fill(true);
            }
        }
        // No point fits between two walls that touch at a corner.
        for (x, y) in (1..map.height()).flat_map(|y| (1..map.width()).map(move |x| (x, y))) {
            let [a, b, c, d] = [(x - 1, y - 1), (x, y - 1), (x - 1, y), (x, y)]
                .map(|(x, y)| map.is_free(Cell::new(x, y)));
            if a == d && b == c && a != b {
                free[2 * y * width + 2 * x] = false;
            }
        }
        Self { points: Grid::new(map.name(), width, free, Vec::new(), Vec::new()), per_cell: 2 }
    }

    /// Returns the points.
    pub fn points(&self) -> &Grid {
        &self.points
    }

    /// Returns the point in the middle of a cell.
    pub fn middle(&self, cell: Cell) -> Cell {
        let at = |i: usize| i * self.per_cell + self.per_cell / 2;
        Cell::new(at(cell.x), at(cell.y))
    }

    /// Converts moves between points to steps; a leftover half step ends within the goal radius.
    pub fn steps(&self, moves: u32) -> u32 {
        if moves == UNREACHABLE { UNREACHABLE } else { moves / self.per_cell as u32 }
    }
}

/// Searches for a point's shortest paths over one map; reuses its buffers.
pub(crate) struct PointSearch {
    half_cells: HalfCells,
    search: StepSearch,
}

impl PointSearch {
    /// Prepares searches over `map`.
    pub fn new(map: &Grid) -> Self {
        let half_cells = HalfCells::new(map);
        let search = StepSearch::new(half_cells.points());
        Self { half_cells, search }
    }

    /// Returns the steps between the middle of `cell` and those of others, [`UNREACHABLE`] where
    /// there is no path.
    pub fn steps_from(&mut self, cell: Cell) -> impl Fn(Cell) -> u32 {
        let Self { half_cells, search } = self;
        let moves = search.steps_from(half_cells.middle(cell));
        |other| half_cells.steps(moves[half_cells.points().index(half_cells.middle(other))])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{RandomMapKind, parse_map, random};

    fn steps(map: &Grid, from: (usize, usize), to: (usize, usize)) -> u32 {
        PointSearch::new(map).steps_from(Cell::new(from.0, from.1))(Cell::new(to.0, to.1))
    }

    #[test]
    fn corners_are_cut_and_straight_ways_are_as_long_as_from_cell_to_cell() {
        let map = parse_map("map", b"......\n.#####\n......\n").expect("a map");
        assert_eq!(steps(&map, (0, 0), (5, 0)), 5);
        assert_eq!(steps(&map, (0, 0), (0, 0)), 0);
        // To the corner (1, 1), down to (1, 2) and on: 4.5 + 1 + 4.5, and not 5 + 2 + 5.
        assert_eq!(steps(&map, (5, 0), (5, 2)), 10);
        assert_eq!(steps(&map, (1, 0), (1, 2)), 2);
    }

    #[test]
    fn a_point_does_not_pass_between_walls_that_touch() {
        let map = parse_map("map", b".#.\n#..\n...\n").expect("a map");
        assert_eq!(steps(&map, (0, 0), (1, 1)), UNREACHABLE);
        assert_eq!(steps(&map, (2, 0), (0, 2)), 2, "round the corner of the wall");
    }

    #[test]
    fn paths_are_no_longer_than_from_cell_to_cell_and_shorter_in_corridors() {
        for (kind, size, least) in
            [(RandomMapKind::Perfect, 33, 0.55..0.8), (RandomMapKind::City, 60, 0.85..1.0)]
        {
            let map = random(kind, Some(size), 2);
            let (mut cells, mut points) = (StepSearch::new(&map), PointSearch::new(&map));
            let start = map.free_cells().next().expect("a free cell");
            let (steps, of_point) = (cells.steps_from(start), points.steps_from(start));
            let all = map.free_cells().map(|cell| (steps[map.index(cell)], of_point(cell)));
            let (mut of_cells, mut of_points) = (0.0, 0.0);
            for (cells, points) in all {
                assert!(points <= cells && (points == UNREACHABLE) == (cells == UNREACHABLE));
                if cells != UNREACHABLE {
                    of_cells += f64::from(cells);
                    of_points += f64::from(points);
                }
            }
            assert!(least.contains(&(of_points / of_cells)), "{kind:?}: {}", of_points / of_cells);
        }
    }

    #[test]
    fn large_maps_are_searched_from_cell_to_cell() {
        let map = Grid::new("map", 2048, vec![true; 2048 * 513], Vec::new(), Vec::new());
        let half_cells = HalfCells::new(&map);
        assert_eq!(
            (half_cells.points().width(), half_cells.middle(Cell::new(7, 5))),
            (2048, Cell::new(7, 5))
        );
        assert_eq!((half_cells.steps(9), half_cells.steps(UNREACHABLE)), (9, UNREACHABLE));
    }
}
