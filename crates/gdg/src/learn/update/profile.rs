//! Time spent in each phase of training.

use std::time::{Duration, Instant};

/// A phase of training that is timed on its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Acting, the environment, candidates and bridge searches.
    Explore,
    /// Drawing batches from the replay.
    Sample,
    /// Losses and gradients of critics and model.
    CriticModelGradients,
    /// Optimiser steps and averages of critics and model.
    CriticModelSteps,
    /// The actor's loss and gradient, through model and critic.
    ActorGradient,
    /// The actor's optimiser step and average.
    ActorStep,
    /// Building the bridge graph and its distances for distillation.
    Graph,
}

impl Stage {
    /// All phases, in order.
    pub const ALL: [Self; 7] = [
        Self::Explore,
        Self::Sample,
        Self::CriticModelGradients,
        Self::CriticModelSteps,
        Self::ActorGradient,
        Self::ActorStep,
        Self::Graph,
    ];

    /// Returns its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Explore => "explore: act, step, store",
            Self::Sample => "sample the batch",
            Self::CriticModelGradients => "gradients of critics and model",
            Self::CriticModelSteps => "steps of critics and model",
            Self::ActorGradient => "gradient of the actor",
            Self::ActorStep => "step of the actor",
            Self::Graph => "bridge graph",
        }
    }
}

/// Time spent in each phase.
#[derive(Clone, Copy, Debug, Default)]
pub struct Profile([Duration; Stage::ALL.len()]);

impl Profile {
    /// Adds the time since `began` to `phase`; returns the current time.
    pub fn lap(&mut self, phase: Stage, began: Instant) -> Instant {
        let now = Instant::now();
        self.0[phase as usize] += now - began;
        now
    }

    /// Returns the time spent in `phase`.
    pub fn spent(&self, phase: Stage) -> Duration {
        self.0[phase as usize]
    }
}
