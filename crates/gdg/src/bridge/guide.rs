//! One step of an agent that follows a plan: the same in exploration, evaluation and display.

use super::graph::BridgeGraph;
use super::planner::Walker;
use crate::learn::{Policy, Scratch, look_ahead};

/// What agents choose their actions by. In each step, an agent takes an [aim](Self::aim) and
/// [acts](Self::act) towards it.
#[derive(Clone, Copy)]
pub struct Guide<'a> {
    /// The learned D and mu.
    pub policy: &'a dyn Policy,
    /// The graph to plan on; without one, agents head straight for their goals.
    pub graph: Option<&'a BridgeGraph>,
}

impl<'a> Guide<'a> {
    /// Begins a walk to `goal` `(goal_dim)`; `None` without a graph.
    pub fn plan(&self, goal: &[f32], scratch: &mut Scratch) -> Option<Walker> {
        Some(Walker::new(self.graph?.route(goal, self.policy, scratch)))
    }

    /// Advances the walk of an agent in `state` `(state_dim)`; returns what to give the actor as
    /// goal: the next waypoint, or `goal` without a plan, `(goal_dim)`.
    pub fn aim<'b>(
        &self,
        walker: Option<&'b mut Walker>,
        state: &[f32],
        goal: &'b [f32],
        scratch: &mut Scratch,
    ) -> &'b [f32]
    where
        'a: 'b,
    {
        match (walker, self.graph) {
            (Some(walker), Some(graph)) => walker.step(state, graph, self.policy, scratch),
            _ => goal,
        }
    }

    /// Chooses the agents' `actions` `(agents, action_dim)` in `states` `(agents, state_dim)`
    /// towards `aims` `(agents, goal_dim)`: the actor's, or those of one step of lookahead where an
    /// agent's plan asks for it. `walkers` has the plan, if any, of each agent.
    pub fn act<'b>(
        &self,
        walkers: impl Iterator<Item = Option<&'b Walker>>,
        states: &[f32],
        aims: &[f32],
        actions: &mut [f32],
        scratch: &mut Scratch,
    ) {
        self.policy.actions(states, aims, actions, scratch);
        if let Some(graph) = self.graph {
            let looks_ahead =
                |walker: Option<&Walker>| walker.is_some_and(|w| w.looks_ahead(graph));
            let ahead: Vec<bool> = walkers.map(looks_ahead).collect();
            look_ahead(self.policy, &ahead, states, aims, actions, scratch);
        }
    }
}
