//! Shortest paths of a point, which cuts corners: what *steps* means throughout.
//!
//! A path from cell to cell leads through the cells' middles. A point moves along the inner corner
//! of every turn instead: in corridors one cell wide it needs a third fewer steps. Steps are at
//! most one cell long along each axis, and obstacles consist of cells, so that a shortest path
//! leads from corner to corner, and its length is that of a king's path over the corners, middles
//! and sides' middles of the cells. It ends at the first point within the goal radius.

use std::ops::RangeInclusive;

use super::distance::StepSearch;
use super::flood::{Flood, UNREACHABLE};
use super::grid::{Cell, Grid};

/// The largest map, in cells, whose half cells are searched: those of a larger one would take
/// hundreds of megabytes.
const MAX_HALVED_CELLS: usize = 1 << 20;

/// The points of a map at every half cell, as a map of its own: its free cells are the points that
/// touch a free cell. Of a map with more than 1024 x 1024 cells, the cells' middles.
pub(crate) struct HalfCells {
    points: Grid,
    /// Points per cell along each axis.
    per_cell: usize,
    /// Goals closer than this are reached, in cells.
    goal_radius: f32,
}

impl HalfCells {
    /// Returns the points of `map`.
    pub fn new(map: &Grid) -> Self {
        let goal_radius = map.scale().goal_radius;
        if map.free().len() > MAX_HALVED_CELLS {
            return Self { points: map.clone(), per_cell: 1, goal_radius };
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
        let points = Grid::new(map.name(), width, free, Vec::new(), Vec::new());
        Self { points, per_cell: 2, goal_radius }
    }

    /// Returns the points.
    pub fn points(&self) -> &Grid {
        &self.points
    }

    /// Returns a search that finds the points in the middle of cells.
    pub fn flood(&self) -> Flood {
        Flood::new(&self.points, self.per_cell)
    }

    /// Returns the point in the middle of a cell.
    pub fn middle(&self, cell: Cell) -> Cell {
        let at = |i: usize| i * self.per_cell + self.per_cell / 2;
        Cell::new(at(cell.x), at(cell.y))
    }

    /// Returns a cell that a point touches: the one whose middle it is, if any.
    pub fn cell(&self, point: Cell) -> Cell {
        let at = |i: usize| i / self.per_cell;
        Cell::new(at(point.x), at(point.y))
    }

    /// Returns the point nearest to a position in a free cell.
    pub fn nearest(&self, at: [f32; 2]) -> Cell {
        let [x, y] = at.map(|at| match self.per_cell {
            1 => at as usize,
            _ => (2.0 * at).round() as usize,
        });
        let nearest = Cell::new(x, y);
        // Where two walls touch at a corner, the middle of the cell.
        let middle = || self.middle(Cell::new(at[0] as usize, at[1] as usize));
        if self.points.is_free(nearest) { nearest } else { middle() }
    }

    /// Returns the points at which a goal counts as reached: also those behind a corner. If the
    /// goal radius is too small for any, the nearest.
    pub fn reaching(&self, goal: [f32; 2]) -> Vec<Cell> {
        let per_cell = self.per_cell as f32;
        let first = if self.per_cell == 1 { 0.5 } else { 0.0 };
        let [columns, rows] = goal.map(|at| {
            let low = (at - self.goal_radius) * per_cell - first;
            let high = (at + self.goal_radius) * per_cell - first;
            low.max(0.0).ceil() as usize..=high.max(0.0) as usize
        });
        let near = |point: &Cell| {
            let [x, y] = [point.x, point.y].map(|at| (at as f32 + first) / per_cell);
            (x - goal[0]).hypot(y - goal[1]) < self.goal_radius && self.points.is_free(*point)
        };
        let points = rows.flat_map(|y| columns.clone().map(move |x| Cell::new(x, y)));
        let points: Vec<Cell> = points.filter(near).collect();
        if points.is_empty() {
            let nearest = self.nearest(goal);
            return Vec::from_iter(self.points.is_free(nearest).then_some(nearest));
        }
        points
    }

    /// Converts moves between points to steps.
    pub fn steps(&self, moves: u32) -> u32 {
        if moves == UNREACHABLE { UNREACHABLE } else { moves.div_ceil(self.per_cell as u32) }
    }

    /// Returns the moves that take these steps.
    pub fn moves(&self, steps: RangeInclusive<u32>) -> RangeInclusive<u32> {
        let per_cell = self.per_cell as u32;
        let most = |steps: u32| steps.saturating_mul(per_cell);
        let least = |steps: u32| steps.checked_sub(1).map_or(0, |less| most(less) + 1);
        least(*steps.start())..=most(*steps.end())
    }

    /// Converts moves between the middles of two cells to the steps until one is reached from the
    /// other, if only the path leads within the goal radius.
    pub fn steps_apart(&self, moves: u32) -> u32 {
        let beyond = moves as f32 / self.per_cell as f32 - self.goal_radius;
        if beyond < 0.0 { 0 } else { beyond as u32 + 1 }
    }
}

/// Finds the cells from which a goal takes a given number of steps, and the steps from given
/// places; reuses its buffers. Searches no farther than necessary.
pub(crate) struct PointFlood {
    half_cells: HalfCells,
    flood: Flood,
}

impl PointFlood {
    /// Prepares searches over `map`.
    pub fn new(map: &Grid) -> Self {
        let half_cells = HalfCells::new(map);
        let flood = half_cells.flood();
        Self { half_cells, flood }
    }

    /// Returns the cells from whose middle it takes `steps` until the middle of `goal` counts as
    /// reached, with their steps, in row order.
    pub fn rings(&mut self, goal: Cell, steps: RangeInclusive<u32>) -> Vec<(Cell, u32)> {
        let Self { half_cells, flood } = self;
        let found = flood.rings(&half_cells.reaching(goal.centre()), half_cells.moves(steps));
        let cell = |(point, moves)| (half_cells.cell(point), half_cells.steps(moves));
        found.into_iter().map(cell).collect()
    }

    /// Returns the steps from each of `places`, in free cells, until `goal` counts as reached;
    /// [`UNREACHABLE`] where there is no path.
    pub fn steps_to(&mut self, goal: [f32; 2], places: &[[f32; 2]]) -> Vec<u32> {
        let Self { half_cells, flood } = self;
        let places: Vec<Vec<Cell>> =
            places.iter().map(|at| vec![half_cells.nearest(*at)]).collect();
        let moves = flood.steps_to(&half_cells.reaching(goal), &places, UNREACHABLE);
        moves.into_iter().map(|moves| half_cells.steps(moves)).collect()
    }

    /// Returns the steps from `place`, in a free cell, until each of `goals` counts as reached;
    /// [`UNREACHABLE`] where there is no path, or only one longer than `longest`.
    pub fn steps_from(&mut self, place: [f32; 2], goals: &[[f32; 2]], longest: u32) -> Vec<u32> {
        let Self { half_cells, flood } = self;
        let goals: Vec<Vec<Cell>> = goals.iter().map(|goal| half_cells.reaching(*goal)).collect();
        let most = *half_cells.moves(longest..=longest).end();
        let moves = flood.steps_to(&[half_cells.nearest(place)], &goals, most);
        moves.into_iter().map(|moves| half_cells.steps(moves)).collect()
    }

    /// Returns the cell whose middle is farthest from that of `cell`, which is free.
    pub fn farthest(&mut self, cell: Cell) -> Cell {
        let (point, _) = self.flood.farthest(self.half_cells.middle(cell));
        self.half_cells.cell(point)
    }
}

/// Searches for a point's shortest paths from all places on one map; reuses its buffers.
pub struct PointSearch {
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

    /// Returns the steps from places in free cells until `goal` counts as reached, by place (x, y)
    /// in cells; [`UNREACHABLE`] where there is no path.
    pub fn steps_to(&mut self, goal: [f32; 2]) -> impl Fn([f32; 2]) -> u32 {
        let Self { half_cells, search } = self;
        let moves = search.steps_from_any(&half_cells.reaching(goal), UNREACHABLE);
        |place| half_cells.steps(moves[half_cells.points().index(half_cells.nearest(place))])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{MapScale, RandomMapKind, parse_map, random};

    fn steps(map: &Grid, from: (usize, usize), to: (usize, usize)) -> u32 {
        let [from, to] = [from, to].map(|(x, y)| Cell::new(x, y).centre());
        let to_goal = PointSearch::new(map).steps_to(to)(from);
        let mut flood = PointFlood::new(map);
        assert_eq!(flood.steps_to(to, &[from]), [to_goal]);
        assert_eq!(flood.steps_from(from, &[to], UNREACHABLE), [to_goal]);
        to_goal
    }

    #[test]
    fn corners_are_cut_but_a_point_does_not_pass_between_walls_that_touch() {
        let map = parse_map("map", b"......\n.#####\n......\n").expect("a map");
        // To the corner (1, 1), down to (1, 2) and on: 4.5 + 1 + 4.5, and not 5 + 2 + 5.
        for (from, to, expected) in
            [((0, 0), (5, 0), 5), ((0, 0), (0, 0), 0), ((5, 0), (5, 2), 10), ((1, 0), (1, 2), 2)]
        {
            assert_eq!(steps(&map, from, to), expected);
        }
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
            let (steps, of_point) = (cells.steps_from(start), points.steps_to(start.centre()));
            let all =
                map.free_cells().map(|cell| (steps[map.index(cell)], of_point(cell.centre())));
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
    fn a_goal_counts_as_reached_within_its_radius_also_through_a_wall() {
        let map = parse_map("map", b"......\n.#####\n......\n").expect("a map");
        let of = |goal_radius: f32| {
            let map = map.clone().with_scale(MapScale { goal_radius, ..MapScale::default() });
            [(0, 0), (4, 2)].map(|goal| steps(&map, (5, 0), goal))
        };
        // From (5.5, 0.5) to (0.5, 0.5), and round the corner (1, 1) to (4.5, 2.5); with the largest,
        // at (4.5, 1), on the other side of the wall.
        assert_eq!([0.1, 1.0, 1.4, 1.6].map(of), [[5, 9], [5, 9], [4, 8], [4, 1]]);
    }
}
