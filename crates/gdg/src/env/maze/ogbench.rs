//! The point mazes of OGBench: their tasks, their teleports and their unit of length.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::full_state_at;
use crate::env::{Task, TaskSet};
use crate::map::{Grid, Ogbench, PointFlood, UNREACHABLE};

impl Ogbench {
    /// Draws `per_task` starts and goals of each of its tasks, every task a group.
    pub(super) fn draw_tasks(self, map: &Grid, per_task: usize, rng: &mut ChaCha8Rng) -> TaskSet {
        let mut set = TaskSet::default();
        let mut flood = PointFlood::new(map);
        for (group, ends) in self.tasks().into_iter().enumerate() {
            let tasks: Vec<Task> = (0..per_task)
                .map(|_| {
                    let [start, goal] = ends.map(|block| {
                        let noise = -Self::NOISE_CELLS..=Self::NOISE_CELLS;
                        Self::middle(block).map(|middle| middle + rng.random_range(noise.clone()))
                    });
                    // Of paths through teleports, no length is known.
                    let shortest =
                        self.entries().is_empty().then(|| flood.steps_to(goal, &[start])[0]);
                    let shortest = shortest.filter(|steps| *steps != UNREACHABLE);
                    Task {
                        start: full_state_at(start).to_vec(),
                        goal: goal.to_vec(),
                        shortest,
                        group,
                    }
                })
                .collect();
            let steps: Option<Vec<f64>> =
                tasks.iter().map(|task| task.shortest.map(f64::from)).collect();
            let mean = steps.map(|steps| steps.iter().sum::<f64>() / steps.len().max(1) as f64);
            set.distances.push(mean);
            set.tasks.extend(tasks);
        }
        set
    }

    /// Returns where a step from `position` may begin: at each of the exits, if an entry is there.
    /// OGBench moves the ball at the end of the step before, but after it was observed.
    pub(super) fn exits_from(self, position: [f32; 2]) -> &'static [[usize; 2]] {
        let is_near = |entry: &[usize; 2]| {
            let [x, y] = Self::middle(*entry);
            (position[0] - x).hypot(position[1] - y) <= Self::ENTRY_CELLS
        };
        if self.entries().iter().any(is_near) { self.exits() } else { &[] }
    }

    /// Returns where a step from `position` begins.
    pub(super) fn begin_step(self, position: [f32; 2], rng: &mut ChaCha8Rng) -> [f32; 2] {
        match self.exits_from(position) {
            [] => position,
            exits => Self::middle(exits[rng.random_range(0..exits.len())]),
        }
    }
}
