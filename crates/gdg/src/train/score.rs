//! Results of an evaluation: success rate, SPL, errors of D and rank correlation.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::env::{DistanceUnit, Task, TaskSet};

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    #[serde(alias = "greedy")]
    pub alone: Score,
    /// Score with planning over bridge points, if the method plans.
    pub planned: Option<Score>,
    /// Score of walking straight at the goal, if the world knows how: the floor for what is learned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub straight: Option<Score>,
    /// Error of D against ground truth, if that is known for any pair of states.
    #[serde(alias = "distance_error")]
    pub error: Option<DistanceError>,
    /// The bridge graph against ground truth, if there is a graph.
    pub bridges: Option<BridgeFacts>,
    /// Share of the world that agents have explored, if defined (in a maze: of the cells in reach).
    #[serde(alias = "coverage")]
    pub explored: Option<f64>,
    /// The world's default task, if it has one (on a map: from its first start to its first goal).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub marked: Option<MarkedTask>,
    /// Identifies the given tasks, of a scenario; `None` for random ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scenario: Option<String>,
}

impl Evaluation {
    pub fn success(&self, updates: u64) -> SuccessSummary {
        SuccessSummary {
            updates,
            alone: self.alone.success,
            planned: self.planned.as_ref().and_then(|score| score.success),
        }
    }

    /// Returns the success rate with planning, or of the actor alone if the method does not plan;
    /// `None` without tasks.
    pub fn success_rate(&self) -> Option<f64> {
        self.planned.as_ref().unwrap_or(&self.alone).success
    }

    /// Whether every number is finite: D may have diverged.
    pub fn is_finite(&self) -> bool {
        let scores = std::iter::once(&self.alone).chain(&self.planned).chain(&self.straight);
        let of_score = |score: &Score| {
            let Score { success, spl, steps_ratio, by_distance } = score;
            let of_distance =
                |d: &DistanceScore| [d.distance_steps, d.distance_cm, d.success, d.spl];
            let ratios = [*success, *spl, *steps_ratio];
            by_distance.iter().flat_map(of_distance).chain(ratios).flatten().collect::<Vec<_>>()
        };
        let errors = self.error.iter().flat_map(|error| {
            let DistanceError { mape, near_mape, bias, spearman, graph } = error;
            let graph = graph.iter().flat_map(|graph| [graph.mape, graph.near_mape, graph.bias]);
            graph.chain([*mape, *near_mape, *bias, *spearman]).collect::<Vec<_>>()
        });
        scores.flat_map(of_score).chain(errors).chain(self.explored).all(f64::is_finite)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarkedTask {
    #[serde(alias = "greedy")]
    pub alone: TaskOutcome,
    /// Result with planning over bridge points, if the method plans.
    pub planned: Option<TaskOutcome>,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskOutcome {
    pub reached: bool,
    pub steps: u32,
    /// True steps from the final state to the goal, if known.
    pub left_steps: Option<u32>,
    /// Straight-line distance from the final state to the goal, in the world's unit, in newer files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_straight: Option<f32>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DistanceError {
    /// Mean absolute relative error.
    pub mape: f64,
    /// The same for pairs within 10 steps.
    pub near_mape: f64,
    /// Mean signed relative error.
    pub bias: f64,
    pub spearman: f64,
    /// Error of D along the bridge graph on the same pairs, if there is a graph.
    pub graph: Option<ComposedError>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComposedError {
    pub mape: f64,
    pub near_mape: f64,
    pub bias: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BridgeFacts {
    pub candidates: usize,
    pub edges: usize,
    /// Edges whose true distance exceeds 2 D + 4, if that is known.
    pub false_edges: Option<usize>,
}

/// Summary of a run's latest evaluation, as shown in checkpoint lists.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SuccessSummary {
    pub updates: u64,
    /// Success rate of the actor alone; `None` if there were no tasks.
    #[serde(alias = "greedy")]
    pub alone: Option<f64>,
    /// Success rate with planning, if the method plans and there were tasks.
    pub planned: Option<f64>,
}

impl fmt::Display for SuccessSummary {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if let Some(planned) = self.planned {
            write!(f, "planned {planned:.2}, ")?;
        }
        match self.alone {
            Some(alone) => write!(f, "alone {alone:.2}"),
            None => f.write_str("no tasks"),
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// Fraction of all tasks whose goal was reached in time; `None` if there are no tasks.
    pub success: Option<f64>,
    /// Mean of success * shortest / max(steps, shortest) (Anderson et al. 2018), if known for all.
    pub spl: Option<f64>,
    /// Mean of steps / shortest over the successful tasks, if there are any, and it is known for all.
    pub steps_ratio: Option<f64>,
    pub by_distance: Vec<DistanceScore>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DistanceScore {
    /// Shortest-path length of these tasks in steps (for a range: the mean), if known.
    pub distance_steps: Option<f64>,
    /// Length of the straight line from start to goal in centimetres (the mean), in worlds that
    /// measure that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_cm: Option<f64>,
    pub tasks: usize,
    pub success: Option<f64>,
    /// Success weighted by path length, if there are tasks and their shortest paths are known.
    pub spl: Option<f64>,
}

impl DistanceScore {
    pub fn distance(&self) -> Option<(f64, DistanceUnit)> {
        let cm = self.distance_cm.map(|cm| (cm, DistanceUnit::Centimetres));
        self.distance_steps.map(|steps| (steps, DistanceUnit::Steps)).or(cm)
    }
}

#[derive(Clone, Copy, Default)]
struct Sums {
    tasks: usize,
    reached: usize,
    /// Sum of shortest / max(steps, shortest) over the tasks reached.
    weights: f64,
    /// Sum of steps / shortest over the tasks reached.
    ratios: f64,
}

impl Sums {
    fn add(&mut self, task: &Task, steps: Option<u32>) {
        self.tasks += 1;
        let Some(steps) = steps else { return };
        // A goal at the start takes 0 steps, which is optimal.
        let shortest = task.shortest.unwrap_or_default().max(1);
        self.reached += 1;
        self.weights += f64::from(shortest) / f64::from(steps.max(shortest));
        self.ratios += f64::from(steps.max(1)) / f64::from(shortest);
    }
}

impl Score {
    /// Returns the most tasks at one distance, if there are any.
    pub fn tasks_per_distance(&self) -> Option<u32> {
        let tasks = self.by_distance.iter().map(|group| group.tasks as u32);
        tasks.max().filter(|tasks| *tasks > 0)
    }

    /// Scores the tasks of `set` by their `steps`, which are `None` if the goal was not reached in
    /// time.
    pub fn new(set: &TaskSet, steps: &[Option<u32>]) -> Self {
        let known = set.tasks.iter().all(|task| task.shortest.is_some());
        let (mut all, mut groups) = (Sums::default(), vec![Sums::default(); set.distances.len()]);
        for (task, steps) in set.tasks.iter().zip(steps) {
            all.add(task, *steps);
            groups[task.group].add(task, *steps);
        }
        let mean = |sum: f64, count: usize| (count > 0).then(|| sum / count as f64);
        let by_distance =
            set.distances.iter().zip(&groups).map(|(distance, group)| DistanceScore {
                distance_steps: distance.filter(|_| set.unit == DistanceUnit::Steps),
                distance_cm: distance.filter(|_| set.unit == DistanceUnit::Centimetres),
                tasks: group.tasks,
                success: mean(group.reached as f64, group.tasks),
                spl: mean(group.weights, group.tasks).filter(|_| known),
            });
        Self {
            success: mean(all.reached as f64, all.tasks),
            spl: mean(all.weights, all.tasks).filter(|_| known),
            steps_ratio: mean(all.ratios, all.reached).filter(|_| known),
            by_distance: by_distance.collect(),
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
        let tied = order[from..]
            .iter()
            .take_while(|i| values[**i].total_cmp(&values[order[from]]).is_eq())
            .count();
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
    fn scores_without_tasks_or_successes_are_unknown() {
        let task = |group| Task { start: vec![0.0], goal: vec![0.0], shortest: Some(4), group };
        let tasks = vec![task(0), task(0)];
        let set = TaskSet { distances: vec![Some(4.0), None], tasks, ..TaskSet::default() };
        let score = Score::new(&set, &[Some(8), None]);
        let found = (score.success, score.spl, score.steps_ratio);
        assert_eq!(found, (Some(0.5), Some(0.25), Some(2.0)));
        let [near, unknown] = score.by_distance[..] else { panic!("two groups") };
        assert_eq!((near.tasks, near.success, near.spl), (2, Some(0.5), Some(0.25)));
        assert_eq!((unknown.tasks, unknown.success, unknown.spl), (0, None, None));
        let lost = Score::new(&set, &[None, None]);
        assert_eq!((lost.success, lost.spl, lost.steps_ratio), (Some(0.0), Some(0.0), None));
        assert_eq!(Score::new(&TaskSet::default(), &[]), Score::default());
    }

    #[test]
    fn spearman_depends_on_order_alone_and_ties_share_their_mean_rank() {
        assert!((spearman(&[1.0, 2.0, 3.0], &[1.0, 10.0, 1000.0]) - 1.0).abs() < 1e-12);
        assert!((spearman(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]) + 1.0).abs() < 1e-12);
        // Ranks (0, 1.5, 1.5, 3) against (0, 1, 2, 3): covariance 4.5, variances 4.5 and 5.
        let tied = spearman(&[1.0, 2.0, 2.0, 3.0], &[1.0, 2.0, 3.0, 4.0]);
        assert!((tied - 4.5 / (4.5f64 * 5.0).sqrt()).abs() < 1e-12, "{tied}");
        assert_eq!(spearman(&[1.0, 1.0], &[1.0, 2.0]), 0.0);
        assert!(spearman(&[f64::NAN, 1.0, f64::NAN], &[1.0, 2.0, 3.0]).is_finite());
    }
}
