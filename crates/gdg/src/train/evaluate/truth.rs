//! D and the bridge graph against true distances.

use super::results::{BridgeFacts, ComposedError, DistanceError};
use crate::bridge::{BridgeGraph, Edge, LINK_CANDIDATES};
use crate::env::{GroundTruth, NEAR_STEPS, TruePairs};
use crate::learn::{Policy, Scratch};
use crate::train::score::spearman;

/// Compares D, and D along `graph`, with ground truth, which is `in_steps` or proportional to
/// them; returns `None` if there are no pairs.
pub fn distance_error(
    groups: &[TruePairs],
    policy: &dyn Policy,
    graph: Option<&BridgeGraph>,
) -> Option<DistanceError> {
    if groups.iter().all(|group| group.steps.is_empty()) {
        return None;
    }
    let (mut composed, mut scratch) = (Vec::new(), Scratch::default());
    for TruePairs { goal, states, .. } in groups {
        if let Some(graph) = graph {
            let route = graph.route(goal, policy, &mut scratch);
            composed.extend(graph.composed_distances(
                states,
                &route,
                LINK_CANDIDATES,
                policy,
                &mut scratch,
            ));
        }
    }
    let truth: Vec<f64> =
        groups.iter().flat_map(|group| &group.steps).map(|steps| f64::from(*steps)).collect();
    let states: Vec<f32> = groups.iter().flat_map(|group| &group.states).copied().collect();
    let goals: Vec<f32> =
        groups.iter().flat_map(|group| group.goal.repeat(group.steps.len())).collect();
    let mut learned = vec![0.0; truth.len()];
    policy.distances(&states, &goals, &mut learned, &mut scratch);
    let near: Vec<bool> = groups.iter().flat_map(|group| &group.near).copied().collect();
    let mean = |values: Vec<f64>| values.iter().sum::<f64>() / values.len().max(1) as f64;
    // Relative errors of `distances`: over pairs drawn at random, and over pairs within
    // `NEAR_STEPS`.
    let errors = |distances: &[f32]| {
        let pairs = distances
            .iter()
            .zip(&truth)
            .zip(&near)
            .map(|((d, t), near)| ((f64::from(*d) - t) / t, *t, *near));
        let pairs: Vec<_> = pairs.collect();
        let all =
            |of: fn(f64) -> f64| mean(pairs.iter().filter(|p| !p.2).map(|p| of(p.0)).collect());
        ComposedError {
            mape: all(f64::abs),
            near_mape: mean(
                pairs.iter().filter(|p| p.1 <= f64::from(NEAR_STEPS)).map(|p| p.0.abs()).collect(),
            ),
            bias: all(|e| e),
        }
    };
    let kept: Vec<usize> = (0..near.len()).filter(|i| !near[*i]).collect();
    let (drawn, true_steps): (Vec<f64>, Vec<f64>) =
        kept.iter().map(|i| (f64::from(learned[*i]), truth[*i])).unzip();
    let ComposedError { mape, near_mape, bias } = errors(&learned);
    let graph = graph.map(|_| errors(&composed));
    Some(DistanceError { mape, near_mape, bias, spearman: spearman(&drawn, &true_steps), graph })
}

/// Returns the true distance in steps above which an edge of this length is false.
fn max_true_distance(length: f32) -> f32 {
    2.0 * length + 4.0
}

/// Counts candidates, edges and, by true distance, false edges.
pub fn bridge_facts(
    graph: &BridgeGraph,
    truth: Option<&mut (dyn GroundTruth + '_)>,
) -> BridgeFacts {
    let false_edges = truth.map(|truth| {
        let of_candidate = |edges: &[Edge]| {
            let goals: Vec<f32> = edges.iter().flat_map(|e| graph.point(e.to)).copied().collect();
            let longest = edges.iter().map(|e| max_true_distance(e.length)).fold(0.0, f32::max);
            // No agent can stand where an edit has put a wall.
            let Some(steps) = truth.steps(graph.point(edges[0].from), &goals, longest as u32)
            else {
                return 0;
            };
            let is_false = |(steps, edge): (Option<u32>, &Edge)| {
                steps.is_none_or(|steps| steps as f32 > max_true_distance(edge.length))
            };
            steps.into_iter().zip(edges).filter(|pair| is_false(*pair)).count()
        };
        graph.edges().chunk_by(|a, b| a.from == b.from).map(of_candidate).sum()
    });
    BridgeFacts { candidates: graph.candidates().len(), edges: graph.edges().len(), false_edges }
}
