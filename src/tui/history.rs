//! Curves: losses since the beginning, thinned evenly where there are many.

use crate::train::{Counters, Snapshot};

/// Most points kept; where there would be more, every other one goes.
const MOST: usize = 2048;

/// Losses at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Updates done.
    pub updates: u64,
    /// Losses of critic, model and actor.
    pub losses: [f32; 3],
}

/// Losses over time.
#[derive(Clone, Debug)]
pub struct History {
    points: Vec<Point>,
    /// Snapshots for each point, and those since the last.
    every: (usize, usize),
}

impl Default for History {
    fn default() -> Self {
        Self { points: Vec::new(), every: (1, 0) }
    }
}

impl History {
    /// Takes note of a snapshot that has gone on from `before`.
    pub fn add(&mut self, snapshot: &Snapshot, before: Counters) {
        if snapshot.counters.updates <= before.updates {
            return;
        }
        self.every.1 += 1;
        if self.every.1 < self.every.0 {
            return;
        }
        self.every.1 = 0;
        let losses = &snapshot.losses;
        let losses = [losses.critic, losses.model, losses.actor];
        self.points.push(Point { updates: snapshot.counters.updates, losses });
        if self.points.len() > MOST {
            let mut keep = false;
            self.points.retain(|_| {
                keep = !keep;
                keep
            });
            self.every.0 *= 2;
        }
    }

    /// The points, oldest first.
    pub fn points(&self) -> &[Point] {
        &self.points
    }
}
