//! What an update reports: its losses, and the time spent in each phase of training.

use std::iter::Sum;
use std::sync::OnceLock;
use std::time::Duration;

use crate::job::Stopwatch;

/// Losses of one update, each a mean over the batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Losses {
    /// Weighted squared error on the chosen scale, averaged over the critics.
    pub critic: f32,
    /// |f(s, a) - s'|^2, with each component in units of its change scale.
    pub model: f32,
    /// |D(f(s, a), g) - D(s', g)| in steps, where the goal is but a part of the state.
    pub model_steps: f32,
    /// D(f(s, mu(s, g)), w) in steps, with w either g or a waypoint on the way there; 0 in rows
    /// from which the actor does not learn.
    pub actor: f32,
}

impl Losses {
    /// Returns a loss, unless it is 0: the learner has no such network, or has not updated it yet.
    pub fn known(loss: f32) -> Option<f32> {
        (loss != 0.0).then_some(loss)
    }
}

impl Sum for Losses {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        parts.fold(Self::default(), |sum, part| Self {
            critic: sum.critic + part.critic,
            model: sum.model + part.model,
            model_steps: sum.model_steps + part.model_steps,
            actor: sum.actor + part.actor,
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrainingPhase {
    /// Acting, the environment, candidates and bridge searches.
    Explore,
    /// Agents' plans: paths to their goals, and waypoints.
    Plans,
    /// Drawing batches from the replay.
    Sample,
    /// Choosing pairs where D falls short of the graph.
    ShortPairs,
    /// The actor's walks as the model imagines them.
    ImaginedWalks,
    /// Bounds and waypoints of pairs, from paths through the graph.
    Paths,
    /// Losses and gradients of critics and model.
    CriticModelGradients,
    /// Optimiser steps and averages of critics and model.
    CriticModelSteps,
    /// The actor's loss and gradient, through model and critic.
    ActorGradient,
    /// The actor's optimiser step and average.
    ActorStep,
    /// Waiting for the bridge graph, and putting it to use.
    Graph,
    /// Building the bridge graph and its distances for distillation, on a thread of its own.
    GraphThread,
}

impl TrainingPhase {
    /// All phases, in order.
    pub const ALL: [Self; 12] = [
        Self::Explore,
        Self::Plans,
        Self::Sample,
        Self::ShortPairs,
        Self::ImaginedWalks,
        Self::Paths,
        Self::CriticModelGradients,
        Self::CriticModelSteps,
        Self::ActorGradient,
        Self::ActorStep,
        Self::Graph,
        Self::GraphThread,
    ];

    /// Returns those of the trainer's own thread.
    pub fn of_trainer() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|phase| *phase != Self::GraphThread)
    }
}

/// The clock that times phases, if not the wall clock: a benchmark may count the processor time of
/// each thread.
pub static PHASE_CLOCK: OnceLock<fn() -> Duration> = OnceLock::new();

/// Returns the current time on that clock.
pub fn phase_time() -> Duration {
    PHASE_CLOCK.get().map_or_else(|| Stopwatch::start().0, |clock| clock())
}

/// Time spent in each phase.
#[derive(Clone, Copy, Debug, Default)]
pub struct Profile([Duration; TrainingPhase::ALL.len()]);

impl Profile {
    /// Adds the time since `began` to `phase`; returns the current [`phase_time`].
    pub fn lap(&mut self, phase: TrainingPhase, began: Duration) -> Duration {
        let now = phase_time();
        self.add(phase, now.saturating_sub(began));
        now
    }

    pub fn add(&mut self, phase: TrainingPhase, spent: Duration) {
        self.0[phase as usize] += spent;
    }

    pub fn spent(&self, phase: TrainingPhase) -> Duration {
        self.0[phase as usize]
    }
}
