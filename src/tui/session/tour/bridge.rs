//! Finds the bridge that the tour explains: one that D sees clearly, and that a walk bears out.

use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use gdg::engine::Networks;
use gdg::env::{Environment, PointMaze};
use gdg::learn::Scratch;
use gdg::map::{Cell, Grid, StepSearch};

/// Candidates in a look for a bridge, and how far apart the samples of two looks are.
const SAMPLE: usize = 64;
const NEXT_SAMPLE: usize = 41;

/// What a bridge must be to be clear to see: the least D(s,g) in steps, the least that it saves of
/// that in steps and as a share, and the least share of either part of the way, so that the bridge
/// is between start and goal.
const LEAST_DIRECT_STEPS: f32 = 30.0;
const LEAST_GAIN_STEPS: f32 = 6.0;
const LEAST_GAIN: f32 = 0.15;
const LEAST_PART: f32 = 0.2;

/// How much longer or shorter a walk may be, as a share of what the bridge saves.
const WALK_SHARE: f32 = 0.4;

/// A place B with D(S,B) + D(B,G) far below D(S,G).
#[derive(Clone, Copy)]
pub struct TourBridge {
    /// S, B and G: centres of cells, where goal and agent are put.
    pub stops: [[f32; 2]; 3],
    /// D(S,B), D(B,G) and D(S,G).
    pub distances: [f32; 3],
}

impl TourBridge {
    pub fn gain(&self) -> f32 {
        let [first, second, direct] = self.distances;
        direct - first - second
    }

    fn is_clear(&self) -> bool {
        let [first, second, direct] = self.distances;
        direct >= LEAST_DIRECT_STEPS
            && self.gain() >= LEAST_GAIN_STEPS.max(LEAST_GAIN * direct)
            && first.min(second) >= LEAST_PART * direct
    }
}

/// Finds a bridge in a sample of candidates: of those between any two of them, the best by the learned
/// D that a walk bears out.
pub fn find(networks: &Networks, map: &Arc<Grid>, sample: usize) -> Option<TourBridge> {
    clearest(networks, sample).into_iter().find(|bridge| is_borne_out(bridge, networks, map))
}

/// Returns the best bridge between any two of a sample of candidates; the best first.
fn clearest(networks: &Networks, sample: usize) -> Vec<TourBridge> {
    let (places, _) = networks.candidates.points().as_chunks::<2>();
    let n = places.len().min(SAMPLE);
    let place = |i: usize| places[(sample * NEXT_SAMPLE + i * places.len() / n) % places.len()];
    let sample: Vec<[f32; 2]> = (0..n).map(|i| place(i).map(|v| v.floor() + 0.5)).collect();
    let mut distances = vec![0.0; n * n];
    let from: Vec<f32> = sample.iter().flat_map(|at| at.repeat(n)).collect();
    let to = sample.as_flattened().repeat(n);
    networks.policy.distances(&from, &to, &mut distances, &mut Scratch::default());
    let d = |from: usize, to: usize| distances[from * n + to].round();
    let best = |ends: usize| {
        let (start, goal) = (ends / n, ends % n);
        let over = |bridge| TourBridge {
            stops: [start, bridge, goal].map(|i| sample[i]),
            distances: [d(start, bridge), d(bridge, goal), d(start, goal)],
        };
        let clear = (0..n).map(over).filter(TourBridge::is_clear);
        clear.max_by(|a, b| a.gain().total_cmp(&b.gain()))
    };
    let mut bridges: Vec<TourBridge> = (0..n * n).filter_map(best).collect();
    bridges.sort_by(|a, b| b.gain().total_cmp(&a.gain()));
    bridges
}

/// Whether the actor takes about as many steps over a bridge as D says, and none can take far fewer.
fn is_borne_out(bridge: &TourBridge, networks: &Networks, map: &Arc<Grid>) -> bool {
    let ([start, over, goal], [first, second, _]) = (bridge.stops, bridge.distances);
    let (says, off) = (first + second, WALK_SHARE * bridge.gain());
    let cell = |at: [f32; 2]| Cell::new(at[0] as usize, at[1] as usize);
    let shortest = StepSearch::new(map).steps_from(cell(goal))[map.index(cell(start))];
    let (mut rng, mut scratch) = (ChaCha8Rng::seed_from_u64(0), Scratch::default());
    let mut maze = PointMaze::new(map.clone(), 1);
    maze.put(0, start);
    let (mut ahead, mut action) = ([goal, over].to_vec(), [0.0; 2]);
    let mut arrives = |_| {
        let Some(aim) = ahead.last() else { return true };
        networks.policy.actions(maze.states(), aim, &mut action, &mut scratch);
        let _ = maze.step(&action, &mut rng);
        ahead.pop_if(|aim| maze.spec().reached(maze.states(), aim));
        ahead.is_empty()
    };
    shortest as f32 >= says - off && (0..(says + off) as u32).any(&mut arrives)
}

#[cfg(test)]
mod tests {
    use super::super::{MAP, run};
    use super::*;
    use gdg::engine::Snapshot;
    use gdg::map::builtin;
    use gdg::train::{Registry, Trainer};

    #[test]
    fn the_tours_own_run_has_clear_bridges_early_in_training() {
        let world = PointMaze::new(Arc::new(builtin(MAP).expect("a map")), 0);
        let mut trainer = Trainer::new(run(), &world, &Registry::builtin(), 2).expect("a run");
        // On two cores, that is before the tour has waited long for one.
        while trainer.counters().updates < 4_000 {
            trainer.tick().expect("a tick");
        }
        let networks = Snapshot::capture(&trainer).expect("a snapshot").networks.clone();
        let found = (0..40).filter(|i| find(&networks, world.map(), *i).is_some()).count();
        assert!(found > 2, "in {found} of 40 samples");
    }
}
