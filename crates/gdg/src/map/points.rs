//! Shortest paths of a point, and the longest of them, which cuts corners: what *steps* means throughout.
//!
//! A path from cell to cell leads through the cells' middles. A point moves along the inner corner
//! of every turn instead: in corridors one cell wide it needs a third fewer steps. Steps are at
//! most one cell long along each axis, and obstacles consist of cells, so that a shortest path
//! leads from corner to corner, and its length is that of a king's path over the corners, middles
//! and sides' middles of the cells. It ends at the first point within the goal radius.

use std::ops::RangeInclusive;

use super::components::Components;
use super::flood::{Flood, UNREACHABLE};
use super::grid::{Cell, Grid};
use crate::job::Job;

/// The largest map, in cells, whose half cells are searched: those of a larger one would take
/// hundreds of megabytes.
const MAX_HALVED_CELLS: usize = 1 << 20;

/// The points of a map at every half cell, as a map of its own: its free cells are the points that
/// touch a free cell. Of a map with more than 1024 x 1024 cells, the cells' middles.
struct HalfCells {
    points: Grid,
    /// Points per cell along each axis.
    per_cell: usize,
    /// Goals closer than this are reached, in cells.
    goal_radius: f32,
}

impl HalfCells {
    fn new(map: &Grid) -> Self {
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

    fn middle(&self, cell: Cell) -> Cell {
        let at = |i: usize| i * self.per_cell + self.per_cell / 2;
        Cell::new(at(cell.x), at(cell.y))
    }

    /// A cell that a point touches: the one whose middle it is, if any.
    fn cell(&self, point: Cell) -> Cell {
        let at = |i: usize| i / self.per_cell;
        Cell::new(at(point.x), at(point.y))
    }

    /// The point nearest to a position in a free cell.
    fn nearest(&self, at: [f32; 2]) -> Cell {
        let [x, y] = at.map(|at| match self.per_cell {
            1 => at as usize,
            _ => (2.0 * at).round() as usize,
        });
        let nearest = Cell::new(x, y);
        // Where two walls touch at a corner, the middle of the cell.
        let middle = || self.middle(Cell::new(at[0] as usize, at[1] as usize));
        if self.points.is_free(nearest) { nearest } else { middle() }
    }

    /// The points at which a goal counts as reached: also those behind a corner. If the
    /// goal radius is too small for any, the nearest.
    fn reaching(&self, goal: [f32; 2]) -> Vec<Cell> {
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
    fn steps(&self, moves: u32) -> u32 {
        if moves == UNREACHABLE { UNREACHABLE } else { moves.div_ceil(self.per_cell as u32) }
    }

    /// The moves that take these steps.
    fn moves(&self, steps: RangeInclusive<u32>) -> RangeInclusive<u32> {
        let per_cell = self.per_cell as u32;
        let most = |steps: u32| steps.saturating_mul(per_cell);
        let least = |steps: u32| steps.checked_sub(1).map_or(0, |less| most(less) + 1);
        least(*steps.start())..=most(*steps.end())
    }

    /// Converts moves between the middles of two cells to the steps until one is reached from the
    /// other, if only the path leads within the goal radius.
    fn steps_apart(&self, moves: u32) -> u32 {
        let beyond = moves as f32 / self.per_cell as f32 - self.goal_radius;
        if beyond < 0.0 { 0 } else { beyond as u32 + 1 }
    }
}

/// Searches for a point's shortest paths on one map, no farther than necessary; reuses its buffers.
pub struct PointSearch {
    half_cells: HalfCells,
    flood: Flood,
    /// Moves to every point, of the latest search from all places.
    moves: Vec<u32>,
}

impl PointSearch {
    /// Prepares searches over `map`.
    pub fn new(map: &Grid) -> Self {
        let half_cells = HalfCells::new(map);
        let flood = Flood::new(&half_cells.points, half_cells.per_cell);
        Self { half_cells, flood, moves: Vec::new() }
    }

    /// Returns the steps from places in free cells until `goal` counts as reached, by place (x, y)
    /// in cells; [`UNREACHABLE`] where there is no path.
    pub fn steps_to(&mut self, goal: [f32; 2]) -> impl Fn([f32; 2]) -> u32 {
        let Self { half_cells, flood, moves } = self;
        let points = &half_cells.points;
        moves.resize(points.free().len(), UNREACHABLE);
        flood.steps_everywhere(&half_cells.reaching(goal), points.width(), moves);
        |place| half_cells.steps(moves[points.index(half_cells.nearest(place))])
    }

    /// Returns the cells from whose middle it takes `steps` until the middle of `goal` counts as
    /// reached, with their steps, in row order.
    pub(crate) fn rings(&mut self, goal: Cell, steps: RangeInclusive<u32>) -> Vec<(Cell, u32)> {
        let Self { half_cells, flood, .. } = self;
        let found = flood.rings(&half_cells.reaching(goal.centre()), half_cells.moves(steps));
        let cell = |(point, moves)| (half_cells.cell(point), half_cells.steps(moves));
        found.into_iter().map(cell).collect()
    }

    /// Returns the steps from each of `places`, in free cells, until `goal` counts as reached;
    /// [`UNREACHABLE`] where there is no path.
    pub(crate) fn steps_of(&mut self, places: &[[f32; 2]], goal: [f32; 2]) -> Vec<u32> {
        let Self { half_cells, flood, .. } = self;
        let places: Vec<Vec<Cell>> =
            places.iter().map(|at| vec![half_cells.nearest(*at)]).collect();
        let moves = flood.steps_to(&half_cells.reaching(goal), &places, UNREACHABLE);
        moves.into_iter().map(|moves| half_cells.steps(moves)).collect()
    }

    /// Returns the steps from `place`, in a free cell, until each of `goals` counts as reached;
    /// [`UNREACHABLE`] where there is no path, or only one longer than `longest`.
    pub(crate) fn steps_from(
        &mut self,
        place: [f32; 2],
        goals: &[[f32; 2]],
        longest: u32,
    ) -> Vec<u32> {
        let Self { half_cells, flood, .. } = self;
        let goals: Vec<Vec<Cell>> = goals.iter().map(|goal| half_cells.reaching(*goal)).collect();
        let most = *half_cells.moves(longest..=longest).end();
        let moves = flood.steps_to(&[half_cells.nearest(place)], &goals, most);
        moves.into_iter().map(|moves| half_cells.steps(moves)).collect()
    }

    /// Returns the cell whose middle is farthest from that of `cell`, which is free.
    pub(crate) fn farthest(&mut self, cell: Cell) -> Cell {
        let (point, _) = self.flood.farthest(self.half_cells.middle(cell));
        self.half_cells.cell(point)
    }
}

/// The most steps from any cell of a map's largest component to any other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Diameter {
    /// Steps of the pair found that are farthest apart.
    pub steps: u32,
    /// Whether no pair can be farther apart; if not, `steps` is the largest distance found before
    /// the search gave up.
    pub exact: bool,
    /// A central cell, and steps that lead from its middle to that of any cell connected to it;
    /// `None` on a map without free cells.
    pub middle: Option<(Cell, u32)>,
}

/// Cell visits allowed for a diameter: enough to be exact on the built-in maps, and seconds on the
/// largest ones.
const CELL_BUDGET: usize = 60_000_000;

/// Candidate middles to try; fewer on large maps, where their searches would dominate.
const MAX_MIDDLES: usize = 8;
const SEARCHES_PER_MIDDLE: usize = 25;

impl Diameter {
    /// Computes the diameter of `grid` in bounded time.
    pub fn compute(grid: &Grid) -> Self {
        Self::compute_from(grid, &Components::of(grid), &Job::default())
    }

    /// Like [`Self::compute`], for a map whose components are known; says how far it is.
    pub fn compute_from(grid: &Grid, components: &Components, progress: &Job) -> Self {
        let searches = CELL_BUDGET / grid.free_count().max(1);
        Self::within(searches, grid, components, progress)
    }

    /// Computes the diameter by at most `searches` searches after the few that find the middle.
    ///
    /// Runs iFUB (Crescenzi et al. 2013, "On computing the diameter of real-world undirected
    /// graphs"): searches from the cells farthest from the middle of a long path, working inwards;
    /// cells within i moves of the middle are at most 2 i apart.
    pub fn within(searches: usize, grid: &Grid, components: &Components, progress: &Job) -> Self {
        let Some(first) = components.largest_cells(grid).next() else {
            return Self { steps: 0, exact: true, middle: None };
        };
        let PointSearch { half_cells, mut flood, .. } = PointSearch::new(grid);
        let (a, _) = flood.farthest(half_cells.middle(first));
        let (b, across) = flood.farthest(a);
        // Of all cells halfway between a and b, the most central one makes the best middle; trying
        // a few is cheaper than searching from more rings. Paths may pass between two cells'
        // middles, hence two moves more.
        let mut ring = |from, moves| {
            let found = flood.rings(&[from], moves..=moves + 2);
            found.into_iter().map(|(point, _)| point).collect::<Vec<_>>()
        };
        let (mut halfway, to_b) = (ring(a, across / 2), ring(b, across - across / 2));
        halfway.retain(|cell| to_b.binary_search_by_key(&(cell.y, cell.x), |c| (c.y, c.x)).is_ok());
        let middles = (searches / SEARCHES_PER_MIDDLE).clamp(1, MAX_MIDDLES);
        let tried: Vec<Cell> =
            halfway.iter().step_by(halfway.len().div_ceil(middles).max(1)).copied().collect();
        let middle = match tried[..] {
            [only] => only,
            _ => tried.into_iter().min_by_key(|cell| flood.farthest(*cell).1).unwrap_or(a),
        };
        let outermost = flood.outermost(middle, across / 2, searches);
        let radius = outermost.first().map_or(across / 2, |(ring, _)| *ring);
        let (mut moves, mut exact) = (across, true);
        let most = outermost.len().min(searches);
        progress.begin(0, 1);
        for (count, (ring, cell)) in outermost.into_iter().enumerate() {
            if moves >= 2 * ring {
                break;
            }
            if count >= searches {
                exact = false;
                break;
            }
            progress.set(count, most);
            moves = moves.max(flood.farthest(cell).1);
        }
        let middle = Some((half_cells.cell(middle), half_cells.steps(radius)));
        Self { steps: half_cells.steps_apart(moves), exact, middle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{MapScale, RandomMapKind, StepSearch, parse_map, random};

    fn steps(map: &Grid, from: (usize, usize), to: (usize, usize)) -> u32 {
        let [from, to] = [from, to].map(|(x, y)| Cell::new(x, y).centre());
        let to_goal = PointSearch::new(map).steps_to(to)(from);
        let mut search = PointSearch::new(map);
        assert_eq!(search.steps_of(&[from], to), [to_goal]);
        assert_eq!(search.steps_from(from, &[to], UNREACHABLE), [to_goal]);
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
