//! The film of a run: D and the agents at some of the updates so far, for looking back. Checkpoints
//! contain it; training does not depend on it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::env::{Environment, MAX_PROBES, Probes, Spec};
use crate::store::StoreError;

const FRAME_EVERY_UPDATES: u64 = 250;

const MAX_FRAMES: usize = 64;

const MAX_FILM_AGENTS: usize = 64;

/// Positions in a file may lie this many times the range of states from its middle.
const MAX_RANGES: f32 = 100.0;

const UNKNOWN: u16 = u16::MAX;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FilmFrame {
    pub updates: u64,
    /// Environment steps, summed over all agents.
    pub env_steps: u64,
    /// The goal of the distances, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// The places of the first agents, as goals, `(agents, goal_dim)`.
    pub agents: Vec<f32>,
    scale: f32,
    /// D of each place of [`Probes`], in units of `scale`.
    values: Vec<u16>,
}

impl FilmFrame {
    pub fn places(&self) -> usize {
        self.values.len()
    }

    /// Returns D from a place to the goal; NaN if it is not known.
    pub fn distance(&self, place: usize) -> f32 {
        match self.values.get(place) {
            None | Some(&UNKNOWN) => f32::NAN,
            Some(value) => f32::from(*value) * self.scale,
        }
    }

    pub fn farthest(&self) -> f32 {
        let known = self.values.iter().filter(|value| **value != UNKNOWN);
        known.max().map_or(1.0, |most| (f32::from(*most) * self.scale).max(1.0))
    }
}

/// The frames of a run. They are evenly spaced while they are few. When there are too many, every
/// other one is dropped, the oldest first; once all are twice as far apart, new ones are taken half
/// as often.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Film {
    every: u64,
    frames: Arc<Vec<Arc<FilmFrame>>>,
}

impl Default for Film {
    fn default() -> Self {
        Self { every: FRAME_EVERY_UPDATES, frames: Arc::default() }
    }
}

impl Film {
    pub fn frames(&self) -> &Arc<Vec<Arc<FilmFrame>>> {
        &self.frames
    }

    /// Returns where the next frame shows D in `world`, if there are films of it.
    pub fn points(&self, world: &dyn Environment) -> Option<Probes> {
        let goal = self.frames.last().map(|frame| &*frame.goal);
        world.abilities().drawn?.probes(goal)
    }

    /// Whether a frame is due after this update: the first one, which shows what has not been
    /// learned yet, and then at multiples, so that it does not depend on when training was paused
    /// or resumed.
    pub fn is_due(&self, updates: u64) -> bool {
        updates == 1 || updates.is_multiple_of(self.every)
    }

    /// Adds a frame after a number of updates and environment steps: `distances` at `points`, and
    /// the agents of `world`.
    pub fn add(
        &mut self,
        at: [u64; 2],
        world: &dyn Environment,
        points: &Probes,
        distances: &[f32],
    ) {
        let spec = world.spec();
        let states = world.states().chunks_exact(spec.state_dim()).take(MAX_FILM_AGENTS);
        let agents = states.flat_map(|state| spec.achieved(state)).collect();
        self.push(frame(at, points, distances, agents));
    }

    fn push(&mut self, frame: FilmFrame) {
        let frames = Arc::make_mut(&mut self.frames);
        // After a change to a world that is filmed elsewhere, the former frames could not be shown.
        if frames.last().is_some_and(|last| {
            last.places() != frame.places() || last.goal.len() != frame.goal.len()
        }) {
            frames.clear();
        }
        frames.push(Arc::new(frame));
        while frames.len() > MAX_FRAMES {
            // The first frame stays.
            match frames[1..].iter().position(|frame| !frame.updates.is_multiple_of(2 * self.every))
            {
                Some(oldest) => drop(frames.remove(oldest + 1)),
                None => self.every *= 2,
            }
        }
    }

    pub(super) fn check(&self, spec: &Spec) -> Result<(), StoreError> {
        let (every, frames) = (self.every, &self.frames);
        let places = frames.first().map_or(0, |frame| frame.places());
        let sound = |frame: &Arc<FilmFrame>| {
            let g = spec.goal_dim();
            (1..1 << 53).contains(&frame.updates)
                && (0.0..f32::INFINITY).contains(&frame.scale)
                && frame.places() == places
                && frame.goal.len() == g
                && frame.agents.len().is_multiple_of(g)
                && frame.agents.len() <= g * MAX_FILM_AGENTS
                && frame.goal.chunks(g).chain(frame.agents.chunks(g)).all(|at| is_near(spec, at))
        };
        let sound = (1..1 << 50).contains(&every)
            && places <= MAX_PROBES
            && frames.len() <= MAX_FRAMES
            && frames.iter().all(sound)
            && frames.is_sorted_by(|a, b| a.updates < b.updates);
        StoreError::unless(sound, "its film is out of range")
    }
}

fn frame(at: [u64; 2], points: &Probes, distances: &[f32], agents: Vec<f32>) -> FilmFrame {
    let [updates, env_steps] = at;
    let known = |distance: &f32| distance.is_finite() && *distance >= 0.0;
    let farthest = distances.iter().copied().filter(known).fold(0.0, f32::max);
    let scale = farthest / f32::from(UNKNOWN - 1);
    let mut values = vec![UNKNOWN; points.places];
    for (place, distance) in
        points.place_of.iter().zip(distances).filter(|(_, distance)| known(distance))
    {
        // All are 0 if the farthest is.
        let value = if scale > 0.0 { (distance / scale).round() } else { 0.0 };
        values[*place as usize] = (value as u16).min(UNKNOWN - 1);
    }
    FilmFrame { updates, env_steps, goal: points.goal.clone(), agents, scale, values }
}

/// Returns whether a position read from a file is about where states are, so that it can be drawn.
fn is_near(spec: &Spec, at: &[f32]) -> bool {
    let off = |(number, i): (&f32, &usize)| (number - spec.state_centre[*i]).abs();
    at.iter()
        .zip(&spec.achieved)
        .all(|pair| off(pair) <= MAX_RANGES * spec.state_half_range[*pair.1].max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACING: u64 = FRAME_EVERY_UPDATES;

    fn points() -> Probes {
        Probes { places: 4, place_of: vec![0, 2, 3], states: Vec::new(), goal: vec![1.5, 2.5] }
    }

    fn film_after(last: u64) -> Film {
        let mut film = Film::default();
        for updates in std::iter::once(1).chain((SPACING..=last).step_by(SPACING as usize)) {
            if film.is_due(updates) {
                let distances = [0.0, 1.0, updates as f32];
                film.push(frame([updates, 7 * updates], &points(), &distances, vec![0.5, 1.5]));
            }
        }
        film
    }

    fn updates(film: &Film) -> Vec<u64> {
        film.frames().iter().map(|frame| frame.updates).collect()
    }

    #[test]
    fn few_frames_are_evenly_spaced_and_many_thinned_towards_the_past() {
        assert_eq!(updates(&film_after(3 * SPACING + 5)), [1, SPACING, 2 * SPACING, 3 * SPACING]);
        for last in [100, 1_000, 12_345, 100_000] {
            let film = film_after(last * SPACING);
            let updates = updates(&film);
            assert!((MAX_FRAMES - 1..=MAX_FRAMES).contains(&updates.len()), "{last}: {updates:?}");
            assert_eq!(updates[0], 1, "the beginning stays");
            let gaps: Vec<u64> = updates[1..].windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(
                gaps.is_sorted_by(|a, b| a >= b),
                "{last}: denser towards the present: {gaps:?}"
            );
            assert!(gaps[0] <= 2 * gaps[gaps.len() - 1], "{last}: at most twice: {gaps:?}");
            assert!(last * SPACING - updates[updates.len() - 1] < 2 * film.every, "{last}");
        }
    }

    #[test]
    fn distances_are_kept_to_a_fraction_of_the_farthest() {
        let frame = frame([1, 2], &points(), &[0.0, 33.3, 120.0], Vec::new());
        let found: Vec<f32> = (0..5).map(|place| frame.distance(place)).collect();
        assert!(found[1].is_nan() && found[4].is_nan(), "{found:?}");
        for (found, expected) in [(found[0], 0.0), (found[2], 33.3), (found[3], 120.0)] {
            assert!((found - expected).abs() < 0.002, "{found} instead of {expected}");
        }
        assert!((frame.farthest() - 120.0).abs() < 0.002);
        let unknown = super::frame([1, 2], &points(), &[f32::NAN, f32::INFINITY, -1.0], Vec::new());
        assert!((0..4).all(|place| unknown.distance(place).is_nan()) && unknown.farthest() == 1.0);
        let zero = super::frame([1, 2], &points(), &[0.0; 3], Vec::new());
        assert_eq!((zero.distance(0), zero.farthest()), (0.0, 1.0));
    }
}
