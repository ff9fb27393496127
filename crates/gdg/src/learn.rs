//! Learners: distance critics, a dynamics model and an actor, trained on replayed transitions
//! without rewards; and rivals that learn from rewards.
//!
//! Each learner is a module that implements [`Learner`]; [`LEARNERS`] lists the built-in ones. A
//! learner sees states, goals and actions only through their [`crate::env::Spec`]. It trains on the
//! [`Replay`] and exposes the result as a [`Policy`] for exploration, planning, evaluation and
//! display: D, the distance in steps, and mu, the actor.

mod data;
mod ddpg;
mod error;
mod gdg;
mod gdg_distance;
mod kernels;
mod learner;
mod networks;
mod phased;
mod random;
mod settings;
mod update;

pub use data::batch::{Batch, BatchSampler};
pub use data::goal_index::GoalIndex;
pub use data::known::{ChangedDistances, DistancesByGoal, KnownDistances, KnownPair, Relearning};
pub(crate) use data::known::{NEAR_STEPS, WAYPOINT_STEPS};
pub use data::replay::{Moment, Replay, ReplaySizes, StoredReplay};
pub use error::LearnError;
pub use gdg::Gdg;
pub use kernels::{kernel, product};
pub use learner::{Acting, CreateLearner, Learner, LearnerKind, TrainingData};
pub use networks::dense::NetworkState;
pub use networks::encoder::Encoder;
pub use networks::export::{ActorExport, ActorInputs, CriticOutputs, CriticsExport, NamedTensor};
pub use networks::network::Network;
pub use networks::policy::{Nets, Policy, Scratch, look_ahead};
pub(crate) use networks::shapes::axis_actions;
pub use settings::{LearnSettings, LossScale};
pub use update::gradient::FullGradient;
pub use update::losses::Losses;
pub use update::profile::{Profile, Stage};
pub use update::reference::Reference;
pub use update::threads::Threads;

/// The built-in learners.
pub const LEARNERS: [LearnerKind; 6] =
    [gdg::KIND, gdg_distance::KIND, ddpg::DDPG, ddpg::HER, ddpg::DDPG_DISTANCE, random::KIND];
