//! Results of an evaluation.

use serde::{Deserialize, Serialize};

use crate::train::score::{DistanceScore, Score, Success};

/// Results of one evaluation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Score of the actor alone.
    pub greedy: Score,
    /// Score with planning over bridge points, if the method plans.
    pub planned: Option<Score>,
    /// Score of walking straight at the goal, if the world knows how: the floor for everything
    /// learned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub straight: Option<Score>,
    /// Error of D against ground truth, if that is known for any pair of states.
    pub distance_error: Option<DistanceError>,
    /// The bridge graph against ground truth, if there is a graph.
    pub bridges: Option<BridgeFacts>,
    /// Fraction of the world explored by the agents, if defined (in a maze: of the cells within
    /// reach).
    pub coverage: Option<f64>,
    /// The world's default task, if it has one (on a map: from its first start to its first goal).
    pub marked: Option<MarkedTask>,
}

impl Evaluation {
    /// Returns the summary for checkpoint lists of an evaluation made after `updates`.
    pub fn success(&self, updates: u64) -> Success {
        Success {
            updates,
            greedy: self.greedy.success,
            planned: self.planned.as_ref().and_then(|score| score.success),
        }
    }

    /// Returns the success rate with planning, or of the actor alone if the method does not plan;
    /// `None` without tasks.
    pub fn success_rate(&self) -> Option<f64> {
        self.planned.as_ref().unwrap_or(&self.greedy).success
    }

    /// Whether every number is finite: D may have diverged.
    pub fn is_finite(&self) -> bool {
        let scores = std::iter::once(&self.greedy).chain(&self.planned).chain(&self.straight);
        let of_score = |score: &Score| {
            let Score { success, spl, steps_ratio, by_distance } = score;
            let of_distance =
                |d: &DistanceScore| [d.distance_steps, d.distance_cm, d.success, d.spl];
            let ratios = [*success, *spl, *steps_ratio];
            by_distance.iter().flat_map(of_distance).chain(ratios).flatten().collect::<Vec<_>>()
        };
        let errors = self.distance_error.iter().flat_map(|error| {
            let DistanceError { mape, near_mape, bias, spearman, graph } = error;
            let graph = graph.iter().flat_map(|graph| [graph.mape, graph.near_mape, graph.bias]);
            graph.chain([*mape, *near_mape, *bias, *spearman]).collect::<Vec<_>>()
        });
        scores.flat_map(of_score).chain(errors).chain(self.coverage).all(f64::is_finite)
    }
}

/// Results on the world's default task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MarkedTask {
    /// Result of the actor alone.
    pub greedy: TaskOutcome,
    /// Result with planning over bridge points, if the method plans.
    pub planned: Option<TaskOutcome>,
}

/// Outcome of one task.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskOutcome {
    /// Whether the goal was reached in time.
    pub reached: bool,
    /// Steps taken.
    pub steps: u32,
    /// True steps from the final state to the goal, if known.
    pub left_steps: Option<u32>,
    /// Straight-line distance from the final state to the goal, in the world's unit of length;
    /// older files do not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_straight: Option<f32>,
}

/// Error of the learned distance over pairs with a known true distance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DistanceError {
    /// Mean absolute relative error.
    pub mape: f64,
    /// The same for pairs within 10 steps.
    pub near_mape: f64,
    /// Mean signed relative error.
    pub bias: f64,
    /// Spearman's rank correlation.
    pub spearman: f64,
    /// Error of D along the bridge graph on the same pairs, if there is a graph.
    pub graph: Option<ComposedError>,
}

/// Error of D along the bridge graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComposedError {
    /// Mean absolute relative error.
    pub mape: f64,
    /// The same for pairs within 10 steps.
    pub near_mape: f64,
    /// Mean signed relative error.
    pub bias: f64,
}

/// Size of the bridge graph and number of false edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BridgeFacts {
    /// Bridge candidates.
    pub candidates: usize,
    /// Edges between them.
    pub edges: usize,
    /// Edges whose true distance exceeds 2 D + 4, if that is known.
    pub false_edges: Option<usize>,
}
