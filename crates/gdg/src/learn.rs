//! Learners: distance critics, a dynamics model and an actor, trained on replayed transitions
//! without rewards; and rivals that learn from rewards.
//!
//! The built-in ones ([`LEARNERS`]) are one [`NetworkLearner`] with other critics, rewards and goals;
//! any type that implements [`Learner`] can be registered beside them. A learner sees states, goals
//! and actions only through their [`crate::env::Spec`]. It trains on the [`Replay`] and exposes the
//! result as a [`Policy`] for exploration, planning, evaluation and display: D, the distance in
//! steps, and mu, the actor.

mod data;
mod error;
mod kernels;
mod learner;
mod network_learner;
mod networks;
#[cfg(test)]
mod reference;
mod settings;
#[cfg(test)]
mod tests;
mod update;

pub use data::batch::Batch;
pub use data::goal_index::{Axis, GoalIndex};
pub use data::known::{ChangedDistances, DistancesByGoal, KnownDistances, Relearning};
pub(crate) use data::known::{NEAR_STEPS, WAYPOINT_STEPS};
pub(crate) use data::replay::ReplaySizes;
pub use data::replay::{Replay, StoredStep};
pub use error::LearnError;
pub use learner::{Acting, CreateLearner, Learner, LearnerKind, TrainingData};
pub use network_learner::{GDG, NetworkLearner};
use network_learner::{VARIANTS, kind};
pub use networks::named_arrays::{
    ActorExport, ActorInputs, CriticOutputs, CriticsExport, NamedTensor,
};
pub use networks::policy::{Policy, Scratch, look_ahead};
pub(crate) use networks::shapes::axis_actions;
pub use settings::{LearnSettings, LossScale};
pub use update::profile::{Losses, PHASE_CLOCK, Profile, TrainingPhase, phase_time};
pub use update::threads::Threads;

pub const LEARNERS: [LearnerKind; VARIANTS.len()] =
    [kind::<0>(), kind::<1>(), kind::<2>(), kind::<3>(), kind::<4>(), kind::<5>()];
