//! The longest of a map's shortest paths.

use super::distance::{Components, StepSearch};
use super::grid::{Cell, Grid};
use super::half_cells::HalfCells;
use crate::job::Job;

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
        let components = StepSearch::new(grid).components(grid);
        Self::compute_from(grid, &components, &Job::default())
    }

    /// Like [`Self::compute`], for a map whose components are known; says how far it is.
    pub fn compute_from(grid: &Grid, components: &Components, progress: &Job) -> Self {
        let searches = CELL_BUDGET / grid.free_count().max(1);
        Self::bounded(searches, grid, components, &HalfCells::new(grid), progress)
    }

    /// Computes the diameter of `grid` by at most `searches` searches after the few that find the
    /// middle.
    pub fn within(searches: usize, grid: &Grid) -> Self {
        let components = StepSearch::new(grid).components(grid);
        let progress = Job::default();
        Self::bounded(searches, grid, &components, &HalfCells::new(grid), &progress)
    }

    /// Runs iFUB (Crescenzi et al. 2013, "On computing the diameter of real-world undirected
    /// graphs"): searches from the cells farthest from the middle of a long path, working inwards;
    /// cells within i moves of the middle are at most 2 i apart.
    fn bounded(
        searches: usize,
        grid: &Grid,
        components: &Components,
        half_cells: &HalfCells,
        progress: &Job,
    ) -> Self {
        let Some(first) = components.largest_cells(grid).next() else {
            return Self { steps: 0, exact: true, middle: None };
        };
        let mut flood = half_cells.flood();
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
