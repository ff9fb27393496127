//! Success rate, SPL and rank correlation.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::env::TaskSet;

/// Summary of a run's latest evaluation, as shown in checkpoint lists.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Success {
    /// The update at which it was evaluated.
    pub updates: u64,
    /// Success rate of the actor alone.
    pub greedy: f64,
    /// Success rate with planning, if the method plans.
    pub planned: Option<f64>,
}

impl fmt::Display for Success {
    /// Formats as `planned 0.98, greedy 0.91`.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if let Some(planned) = self.planned {
            write!(f, "planned {planned:.2}, ")?;
        }
        write!(f, "greedy {:.2}", self.greedy)
    }
}

/// Scores on a set of tasks.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Fraction of all tasks whose goal was reached in time.
    pub success: f64,
    /// Mean of success * shortest / max(steps, shortest) (Anderson et al. 2018), if the shortest paths are known.
    pub spl: Option<f64>,
    /// Mean of steps / shortest over the successful tasks; 0 if there are none.
    pub steps_ratio: Option<f64>,
    /// Scores at each distance.
    pub by_distance: Vec<DistanceScore>,
}

/// Scores on the tasks at one distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DistanceScore {
    /// Shortest-path length of these tasks in steps (for a range: the mean).
    pub distance_steps: f64,
    /// Number of tasks.
    pub tasks: usize,
    /// Fraction reached in time.
    pub success: f64,
    /// Success weighted by path length, if the shortest paths are known.
    pub spl: Option<f64>,
}

impl Score {
    /// Scores the tasks of `set` by their `steps`, which are `None` if the goal was not reached in time.
    pub fn new(set: &TaskSet, steps: &[Option<u32>]) -> Self {
        let known = set.tasks.iter().all(|task| task.shortest.is_some());
        let group = |distance_steps: &f64| DistanceScore {
            distance_steps: *distance_steps,
            spl: known.then_some(0.0),
            ..DistanceScore::default()
        };
        let mut by_distance: Vec<DistanceScore> = set.distances.iter().map(group).collect();
        let (mut success, mut spl, mut ratios) = (0.0, 0.0, 0.0);
        for (task, steps) in set.tasks.iter().zip(steps) {
            let group = &mut by_distance[task.group];
            group.tasks += 1;
            let Some(steps) = steps else { continue };
            group.success += 1.0;
            success += 1.0;
            // A goal at the start takes 0 steps, which is optimal.
            let shortest = task.shortest.unwrap_or_default().max(1);
            let weight = f64::from(shortest) / f64::from((*steps).max(shortest));
            group.spl = group.spl.map(|spl| spl + weight);
            spl += weight;
            ratios += f64::from((*steps).max(1)) / f64::from(shortest);
        }
        for group in &mut by_distance {
            let tasks = group.tasks.max(1) as f64;
            group.success /= tasks;
            group.spl = group.spl.map(|spl| spl / tasks);
        }
        let tasks = set.tasks.len().max(1) as f64;
        let steps_ratio = if success > 0.0 { ratios / success } else { 0.0 };
        Self {
            success: success / tasks,
            spl: known.then_some(spl / tasks),
            steps_ratio: known.then_some(steps_ratio),
            by_distance,
        }
    }
}

/// Returns Spearman's rank correlation; ties share their mean rank. 0 if either input is constant.
pub fn spearman(a: &[f64], b: &[f64]) -> f64 {
    let (ra, rb) = (ranks(a), ranks(b));
    let mean = (a.len() as f64 - 1.0) / 2.0;
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in ra.iter().zip(&rb) {
        ab += (x - mean) * (y - mean);
        aa += (x - mean) * (x - mean);
        bb += (y - mean) * (y - mean);
    }
    if aa * bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|i, j| values[*i].total_cmp(&values[*j]));
    let mut ranks = vec![0.0; values.len()];
    let mut from = 0;
    while from < order.len() {
        // Uses the same order as above: NaN equals itself there, so every round takes at least one.
        let tied = order[from..].iter().take_while(|i| values[**i].total_cmp(&values[order[from]]).is_eq()).count();
        for i in &order[from..from + tied] {
            ranks[*i] = from as f64 + (tied as f64 - 1.0) / 2.0;
        }
        from += tied;
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spearman_depends_only_on_order_and_averages_tied_ranks() {
        assert!((spearman(&[1.0, 2.0, 3.0], &[1.0, 10.0, 1000.0]) - 1.0).abs() < 1e-12);
        assert!((spearman(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]) + 1.0).abs() < 1e-12);
        // Ranks (0, 1.5, 1.5, 3) against (0, 1, 2, 3): covariance 4.5, variances 4.5 and 5.
        let tied = spearman(&[1.0, 2.0, 2.0, 3.0], &[1.0, 2.0, 3.0, 4.0]);
        assert!((tied - 4.5 / (4.5f64 * 5.0).sqrt()).abs() < 1e-12, "{tied}");
        assert_eq!(spearman(&[1.0, 1.0], &[1.0, 2.0]), 0.0);
    }

    #[test]
    fn ranks_of_nan_terminate() {
        assert!(spearman(&[f64::NAN, 1.0, f64::NAN], &[1.0, 2.0, 3.0]).is_finite());
    }
}
