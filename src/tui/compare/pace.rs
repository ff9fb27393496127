//! How far training had come at each update, in environment steps and seconds.

use crate::experiment::plot::Axis;
use gdg::engine::Snapshot;
use gdg::train::History;

/// Maximum number of moments kept; beyond it, every other one is dropped.
const MAX_MOMENTS: usize = 4096;

/// Progress at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    pub updates: f64,
    pub env_steps: f64,
    /// Training time, in seconds.
    pub seconds: f64,
}

impl Moment {
    pub fn along(self, axis: Axis) -> f64 {
        match axis {
            Axis::Updates => self.updates,
            Axis::Steps => self.env_steps,
            Axis::Seconds => self.seconds,
        }
    }
}

impl From<&Snapshot> for Moment {
    fn from(snapshot: &Snapshot) -> Self {
        let counters = snapshot.counters;
        Self {
            updates: counters.updates as f64,
            env_steps: counters.env_steps as f64,
            seconds: snapshot.seconds,
        }
    }
}

/// The moments of a run, from its start.
#[derive(Default)]
pub struct Pace(Vec<Moment>);

impl Pace {
    pub fn of(history: &History) -> Self {
        let mut pace = Self::default();
        for made in history.evaluations().iter().filter_map(|(at, _)| history.moment(*at)) {
            pace.add_moment(Moment {
                updates: made.updates as f64,
                env_steps: made.env_steps as f64,
                seconds: made.seconds,
            });
        }
        pace
    }

    pub fn add(&mut self, snapshot: &Snapshot) {
        self.add_moment(snapshot.into());
    }

    fn add_moment(&mut self, moment: Moment) {
        if self.0.last().is_some_and(|last| last.updates >= moment.updates) {
            return;
        }
        self.0.push(moment);
        if self.0.len() > MAX_MOMENTS {
            let mut i = 0;
            self.0.retain(|_| {
                i += 1;
                i % 2 == 0
            });
        }
    }

    /// Returns the moment of an update, between the known ones.
    pub fn at(&self, updates: f64) -> Moment {
        let next = self.0.partition_point(|moment| moment.updates < updates);
        let before = next.checked_sub(1).map_or(Moment::default(), |i| self.0[i]);
        let Some(after) = self.0.get(next) else { return Moment { updates, ..before } };
        let share = (updates - before.updates) / (after.updates - before.updates).max(1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        Moment {
            updates,
            env_steps: between(before.env_steps, after.env_steps),
            seconds: between(before.seconds, after.seconds),
        }
    }
}
