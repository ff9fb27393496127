//! The agents in checkpoints.

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{Agent, Pending, Plan, Rollout};
use crate::bridge::{BridgeGraph, Candidates, Walker, WalkerState};
use crate::env::MAX_MAGNITUDE;
use crate::learn::Replay;
use crate::store::StoreError;
use crate::train::error::TrainError;
use crate::train::leaps::Leaps;

/// Checkpointed state of a [`Plan`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlanState {
    walker: WalkerState,
    goal: Vec<f32>,
    disturbed: bool,
}

/// Checkpointed episodes of the agents and RNG state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RolloutState {
    /// The agents.
    pub agents: Vec<Agent>,
    /// Their plans.
    pub plans: Vec<Option<PlanState>>,
    /// Their full states, concatenated.
    pub states: Vec<f64>,
    /// RNG state.
    pub rng: ChaCha8Rng,
    /// The leaps seen.
    #[serde(default, skip_serializing_if = "Leaps::is_empty")]
    leaps: Leaps,
    /// A round of steps that the agents have taken, and which is not stored yet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    round: Option<RoundState>,
}

/// Checkpointed outcome of a round of steps.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct RoundState {
    /// `(agents, state_dim)`.
    before: Vec<f32>,
    /// `(agents, action_dim)`.
    actions: Vec<f32>,
    /// Whether the world has ended each agent's episode.
    ended: Vec<bool>,
}

impl Rollout {
    /// Returns everything that the next steps depend on, for a checkpoint.
    pub fn state(&self) -> RolloutState {
        let plans = self.plans.iter().map(|plan| {
            plan.as_ref().map(|Plan { walker, goal, disturbed }| PlanState {
                walker: walker.state(),
                goal: goal.clone(),
                disturbed: *disturbed,
            })
        });
        let round = match &self.pending {
            Some(Pending::Done(ended)) => Some(RoundState {
                before: self.before.clone(),
                actions: self.actions.clone(),
                ended: ended.clone(),
            }),
            _ => None,
        };
        RolloutState {
            round,
            leaps: self.leaps.clone(),
            agents: self.agents.clone(),
            plans: plans.collect(),
            states: (0..self.agents.len()).flat_map(|i| self.env.full_state(i)).collect(),
            rng: self.rng.clone(),
        }
    }

    /// Restores the state that [`Self::state`] returned. In a world that cannot set full states,
    /// or failed before they were saved, the agents begin new episodes, and those in `replay` and
    /// `candidates` end where they were.
    ///
    /// # Errors
    /// The state does not match the number of agents or the environment, or the world fails.
    pub fn restore(
        &mut self,
        state: RolloutState,
        graph: Option<&BridgeGraph>,
        replay: &mut Replay,
        candidates: &mut Candidates,
    ) -> Result<(), TrainError> {
        let (s, g) = (self.env.spec().state_dim(), self.env.spec().goal_dim());
        let a = self.env.spec().action_dim;
        let size = state.states.len() / self.agents.len().max(1);
        // Only the states of a world that failed.
        let takes_size = size == s || self.env.takes_full_state(size);
        let within = |numbers: &[f32]| numbers.iter().all(|v| v.abs() <= MAX_MAGNITUDE);
        let sound = |numbers: &[f32], length: usize| numbers.len() == length && within(numbers);
        let agents = state.agents.iter().all(|agent| {
            sound(&agent.goal, g)
                && agent.after_bridge.as_ref().is_none_or(|goal| sound(goal, g))
                && agent.held.as_ref().is_none_or(|(action, steps)| sound(action, a) && *steps > 0)
        });
        let plans = state.plans.iter().flatten().all(|plan| sound(&plan.goal, g));
        let states = takes_size
            && state.states.len() == self.agents.len() * size
            && state.states.iter().all(|v| v.is_finite());
        let round = state.round.as_ref().is_none_or(|round| {
            let count = self.agents.len();
            sound(&round.before, count * s)
                && sound(&round.actions, count * a)
                && round.ended.len() == count
        });
        let leaps = state.leaps.fit(self.env.spec());
        if state.agents.len() != self.agents.len()
            || !states
            || !agents
            || !plans
            || !round
            || !leaps
        {
            let problem = "the stored agents do not fit these settings";
            return Err(StoreError::inconsistent(problem).into());
        }
        if state.plans.len() != self.agents.len() {
            return Err(StoreError::inconsistent("the stored plans do not fit the agents").into());
        }
        let plans = state.plans.into_iter().map(|plan| {
            let Some(PlanState { walker, goal, disturbed }) = plan else { return Ok(None) };
            let graph = graph
                .ok_or_else(|| StoreError::inconsistent("a stored plan has no bridge graph"))?;
            Ok(Some(Plan { walker: Walker::from_state(graph, walker)?, goal, disturbed }))
        });
        self.plans = plans.collect::<Result<_, StoreError>>()?;
        self.agents = state.agents;
        self.rng = state.rng;
        self.leaps = state.leaps;
        self.pending = state.round.map(|round| {
            (self.before, self.actions) = (round.before, round.actions);
            Pending::Done(round.ended)
        });
        for (i, full_state) in state.states.chunks_exact(size).enumerate() {
            if !self.env.set_full_state(i, full_state)? {
                // Then the full state begins with the state.
                let state: Vec<f32> = full_state[..s].iter().map(|v| *v as f32).collect();
                if self.agents[i].steps > 0 {
                    replay.end_episode(i, &state);
                }
                candidates.visit(i, &state, &state);
                candidates.end_episode(i);
                self.env.restart(i, &mut self.rng)?;
                self.begin_episode(i);
                self.pending = None;
            }
        }
        Ok(())
    }
}
