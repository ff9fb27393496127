//! The search for a bridge that is clear to see: a place b with D(s,b) + D(b,g) far below D(s,g),
//! by the learned D alone.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use gdg::bridge::{BridgePoint, SearchOutcome};
use gdg::engine::Networks;
use gdg::learn::{Policy, Scratch};

/// Candidates of one look, which asks for D from each to each.
const SAMPLE: usize = 96;

/// How far apart the samples of two looks are, in candidates.
const NEXT_SAMPLE: usize = 41;

/// The least that a bridge saves: steps, and a share of D(s,g).
const LEAST_GAIN_STEPS: f32 = 6.0;
const LEAST_GAIN: f32 = 0.15;

/// The least D(s,g), in steps, of what is called a hard task.
const LEAST_DIRECT_STEPS: f32 = 30.0;

/// The least share of D(s,g) that either part of the way has, so that the bridge is between start
/// and goal.
const LEAST_PART: f32 = 0.2;

/// A find replaces a better one that is older, and D has changed since, if it saves this share of
/// what that saved.
const NEARLY_AS_CLEAR: f32 = 0.8;

/// Time between two looks, which take a core for some tenths of a second.
const REST: Duration = Duration::from_secs(1);

/// A bridge that is clear to see.
#[derive(Clone)]
pub struct FoundBridge {
    /// The same as an agent's search, for drawing.
    pub search: Arc<SearchOutcome>,
    /// Start, bridge and goal.
    pub stops: [[f32; 2]; 3],
    /// D(s,b), D(b,g) and D(s,g), rounded to steps.
    pub distances: [f32; 3],
}

impl FoundBridge {
    /// Returns the bridge if it is clear to see by `policy`. Positions are those of cells' centres,
    /// where goal and agent are put.
    fn new(places: [[f32; 2]; 3], policy: &dyn Policy, scratch: &mut Scratch) -> Option<Self> {
        let stops = places.map(|place| place.map(|v| v.floor() + 0.5));
        let distances = [(0, 1), (1, 2), (0, 2)]
            .map(|(from, to)| policy.distance(&stops[from], &stops[to], scratch).round());
        let [first, second, direct] = distances;
        let gain = direct - first - second;
        let is_clear = is_clear(gain, direct) && is_between(first, second, direct);
        let [state, point, goal] = stops.map(|at| at.to_vec());
        let found = Some(BridgePoint { point, gain });
        let search = SearchOutcome { state, goal, found, ..SearchOutcome::default() };
        is_clear.then(|| Self { search: Arc::new(search), stops, distances })
    }

    fn gain(&self) -> f32 {
        let [first, second, direct] = self.distances;
        direct - first - second
    }
}

fn is_clear(gain: f32, direct: f32) -> bool {
    direct >= LEAST_DIRECT_STEPS && gain >= LEAST_GAIN_STEPS && gain >= LEAST_GAIN * direct
}

fn is_between(first: f32, second: f32, direct: f32) -> bool {
    first.min(second) >= LEAST_PART * direct
}

/// Looks for bridges on its own thread, again and again while networks learn.
#[derive(Default)]
pub struct BridgeHunt {
    look: Option<JoinHandle<Option<FoundBridge>>>,
    looks: usize,
    rests_since: Option<Instant>,
    /// The clearest find so far, or nearly.
    pub best: Option<FoundBridge>,
}

impl BridgeHunt {
    /// Takes what a look has found, and begins the next one.
    pub fn go_on(&mut self, networks: &Arc<Networks>) {
        if let Some(look) = self.look.take_if(|look| look.is_finished()) {
            self.rests_since = Some(Instant::now());
            let found = look.join().ok().flatten();
            let least = self.best.as_ref().map_or(0.0, |best| NEARLY_AS_CLEAR * best.gain());
            self.best = found.filter(|found| found.gain() >= least).or(self.best.take());
        }
        let rests = self.rests_since.is_some_and(|since| since.elapsed() < REST);
        if self.look.is_none() && !rests {
            let (networks, first) = (networks.clone(), self.looks * NEXT_SAMPLE);
            self.looks += 1;
            let look = move || clearest(&networks, first);
            // Without a thread there is nothing to show, as without a find.
            self.look = std::thread::Builder::new().name("bridges".to_owned()).spawn(look).ok();
        }
    }
}

/// Returns the bridge that saves most between candidates of a sample that begins with number
/// `first`.
fn clearest(networks: &Networks, first: usize) -> Option<FoundBridge> {
    let (places, _) = networks.candidates.points().as_chunks::<2>();
    let n = places.len().min(SAMPLE);
    let sample: Vec<[f32; 2]> =
        (0..n).map(|i| places[(first + i * places.len() / n) % places.len()]).collect();
    let (policy, mut scratch) = (&*networks.policy, Scratch::default());
    let mut distances = vec![0.0; n * n];
    let from: Vec<f32> = sample.iter().flat_map(|at| at.repeat(n)).collect();
    let to = sample.as_flattened().repeat(n);
    policy.distances(&from, &to, &mut distances, &mut scratch);
    let d = |from: usize, to: usize| distances[from * n + to];
    let mut best = (0.0, [0; 3]);
    for start in 0..n {
        for goal in 0..n {
            let direct = d(start, goal);
            for bridge in 0..n {
                let (to_it, from_it) = (d(start, bridge), d(bridge, goal));
                let gain = direct - to_it - from_it;
                if gain > best.0 && is_clear(gain, direct) && is_between(to_it, from_it, direct) {
                    best = (gain, [start, bridge, goal]);
                }
            }
        }
    }
    let (gain, triple) = best;
    (gain > 0.0)
        .then(|| FoundBridge::new(triple.map(|i| sample[i]), policy, &mut scratch))
        .flatten()
}

#[cfg(test)]
mod tests {
    use super::super::{MAP, run};
    use super::*;
    use gdg::engine::Snapshot;
    use gdg::env::PointMaze;
    use gdg::map::builtin;
    use gdg::train::{Registry, Trainer};

    /// The tour has shown a bridge by then, at the speed of two cores.
    const UPDATES: u64 = 2_500;

    #[test]
    fn the_tours_own_run_has_clear_bridges_early_in_training() {
        let map = Arc::new(builtin(MAP).expect("a map"));
        let mut trainer =
            Trainer::new(run(), &PointMaze::new(map, 0), &Registry::builtin(), 2).expect("a run");
        while trainer.counters().updates < UPDATES {
            trainer.tick().expect("a tick");
        }
        let networks = Snapshot::capture(&trainer).expect("a snapshot").networks.clone();
        let looks = (0..4).filter_map(|look| clearest(&networks, look * NEXT_SAMPLE));
        let best = looks.max_by(|a, b| a.gain().total_cmp(&b.gain())).expect("a bridge");
        let [first, second, direct] = best.distances;
        assert!(first + second <= 0.85 * direct && direct >= 30.0, "{:?}", best.distances);
    }
}
