//! The walks of the two agents: from the same start to the same goal, at the same time.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use gdg::map::{Cell, Grid, StepSearch, UNREACHABLE};
use gdg::viewer::{OnArrival, View};

const REST: Duration = Duration::from_secs(2);

/// Step limit of a race, as a multiple of the shortest path, and its minimum.
const MAX_DETOUR: u32 = 4;
const MIN_STEPS: u32 = 60;

pub struct Race {
    pub map: Arc<Grid>,
    pub start: Cell,
    pub goal: Cell,
    /// What to do once both have arrived or lost.
    pub on_arrival: OnArrival,
    /// The goal request that began the race on each side: earlier views belong to earlier races.
    requests: [u64; 2],
    /// Whether each side has arrived, once that is decided.
    arrived: [Option<bool>; 2],
    over: Option<Instant>,
    /// Whether either side has had a plan: races restart at the first one.
    pub is_planned: bool,
    /// Races that each side has finished at the goal, and all that are over.
    pub results: ([u32; 2], u32),
    /// Separate, so that training does not depend on the display.
    rng: ChaCha8Rng,
}

impl Race {
    pub fn new(map: Arc<Grid>, seed: u64) -> Self {
        Self {
            map,
            start: Cell::new(0, 0),
            goal: Cell::new(0, 0),
            on_arrival: OnArrival::default(),
            requests: [0; 2],
            arrived: [None; 2],
            over: None,
            is_planned: false,
            results: ([0; 2], 0),
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    pub fn change_map(&mut self, map: Arc<Grid>) {
        self.start = map.nearest_free(self.start).unwrap_or(self.start);
        self.map = map;
    }

    pub fn begin(&mut self, start: Cell, goal: Cell, requests: [u64; 2]) {
        (self.start, self.goal, self.requests) = (start, goal, requests);
        (self.arrived, self.over) = ([None; 2], None);
    }

    /// Takes note of a walk; of one that `stands`, no more is expected once the other has arrived.
    pub fn observe(&mut self, side: usize, view: &View, stands: bool) {
        let walk = &view.reach;
        if view.goal.1 != self.requests[side] || self.arrived[side].is_some() {
            return;
        }
        let most = walk.shortest.map_or(u32::MAX, |shortest| MAX_DETOUR * shortest).max(MIN_STEPS);
        let is_lost = stands && self.arrived[1 - side] == Some(true);
        if walk.arrived || walk.gave_up || walk.steps >= most || is_lost {
            self.arrived[side] = Some(walk.arrived);
        }
        if let [Some(a), Some(b)] = self.arrived {
            self.results.0[0] += u32::from(a);
            self.results.0[1] += u32::from(b);
            self.results.1 += 1;
            self.over = Some(Instant::now());
        }
    }

    pub fn next_round(&mut self) -> Option<(Cell, Cell)> {
        self.over.filter(|over| over.elapsed() >= REST)?;
        match self.on_arrival {
            OnArrival::Again => Some((self.random_start(self.goal), self.goal)),
            OnArrival::Visit => Some((self.goal, self.connected_cell(self.goal))),
            OnArrival::Stay | OnArrival::Wait => None,
        }
    }

    /// Returns a start of the map, or else a random cell, from which a path leads to `goal`.
    pub fn random_start(&mut self, goal: Cell) -> Cell {
        let starts = self.map.starts().to_vec();
        self.draw_connected(starts, goal).unwrap_or_else(|| self.connected_cell(goal))
    }

    fn connected_cell(&mut self, cell: Cell) -> Cell {
        self.draw_connected(self.map.free_cells().collect(), cell).unwrap_or(cell)
    }

    fn draw_connected(&mut self, mut cells: Vec<Cell>, cell: Cell) -> Option<Cell> {
        let mut search = StepSearch::new(&self.map);
        let steps = search.steps_from(cell);
        cells.retain(|cell| steps[self.map.index(*cell)] != UNREACHABLE);
        (!cells.is_empty()).then(|| cells[self.rng.random_range(0..cells.len())])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::map::parse_map;
    use gdg::viewer::Reach;

    fn view(number: u64, reach: &Reach) -> View {
        View { goal: (None, number), reach: reach.clone(), ..View::default() }
    }

    #[test]
    fn a_race_is_over_once_both_have_arrived_or_lost() {
        let map = Arc::new(parse_map("two", b"....#..\n....#..\n").expect("a map"));
        let mut race = Race::new(map.clone(), 1);
        let goal = Cell::new(3, 1);
        let start = race.random_start(goal);
        assert!(start.x < 4, "a path leads to the goal");
        race.begin(start, goal, [7, 8]);
        let arrived = Reach { arrived: true, shortest: Some(3), ..Reach::default() };
        race.observe(0, &view(6, &arrived), false);
        assert_eq!(race.arrived, [None; 2], "an earlier race");
        race.observe(0, &view(7, &arrived), false);
        assert_eq!((race.results, race.over), (([0, 0], 0), None), "the other one still walks");
        let walks = Reach { steps: MIN_STEPS - 1, arrived: false, ..arrived };
        race.observe(1, &view(8, &walks), false);
        assert_eq!(race.results.1, 0, "it may still arrive");
        race.observe(1, &view(8, &walks), true);
        assert_eq!(race.results, ([1, 0], 1));
        assert!(race.next_round().is_none(), "they rest");
        race.over = race.over.and_then(|at| at.checked_sub(REST));
        let (start, same) = race.next_round().expect("the next race");
        assert!(start.x < 4 && same == goal);
        race.on_arrival = OnArrival::Visit;
        let (start, other) = race.next_round().expect("the next race");
        assert!(start == goal && other.x < 4);
        race.on_arrival = OnArrival::Stay;
        assert!(race.next_round().is_none());
    }
}
