//! Learners: distance critics, a dynamics model and an actor, trained on replayed transitions without rewards; and
//! rivals that learn from rewards.
//!
//! Each learner is a module that implements [`Learner`]; [`LEARNERS`] lists the built-in ones. A learner sees states,
//! goals and actions only through their [`crate::env::Spec`]. It trains on the [`Replay`] and exposes the result as a
//! [`Policy`] for exploration, planning, evaluation and display: D, the distance in steps, and mu, the actor.

#[forbid(unsafe_code)]
mod data;
#[forbid(unsafe_code)]
mod ddpg;
#[forbid(unsafe_code)]
mod error;
#[forbid(unsafe_code)]
mod gdg;
#[forbid(unsafe_code)]
mod gdg_distance;
mod kernels;
#[forbid(unsafe_code)]
mod learner;
#[forbid(unsafe_code)]
mod networks;
#[forbid(unsafe_code)]
mod random;
#[forbid(unsafe_code)]
mod settings;
#[forbid(unsafe_code)]
mod update;

pub use data::batch::{Batch, BatchSampler};
pub(crate) use data::batch::{
    GRAPH_LOWER_FACTOR, GRAPH_LOWER_SLACK_STEPS, RELEARN_N_STEP, RELEARN_RECENT, STUCK_BOUND, STUCK_PROGRESS_STEPS,
};
pub use data::goal_index::GoalIndex;
pub(crate) use data::known::WAYPOINT_STEPS;
pub use data::known::{ChangedDistances, DistancesByGoal, KnownDistances, KnownPair, Relearning};
pub(crate) use data::replay::MAX_MAGNITUDE;
pub use data::replay::{Moment, Replay, ReplaySizes, ReplayState};
pub(crate) use ddpg::{MAX_NOISE_DEVIATIONS, MIN_REMAINING};
pub use error::LearnError;
pub use gdg::Gdg;
pub(crate) use gdg::graph_paths::{
    LEAST_BOUND_STEPS, LEAST_LED_STEPS, MAX_SHARE_AFTER, MAX_STEPS_AFTER, MAX_STEPS_BEFORE,
};
pub use kernels::{kernel, product};
pub use learner::{Acting, CreateLearner, Learner, LearnerKind, TrainingData};
pub(crate) use networks::adam::EPSILON;
pub use networks::dense::NetworkState;
pub use networks::encoder::Encoder;
pub use networks::export::{ActorExport, ActorInputs, NamedTensor};
pub(crate) use networks::lookahead::{BLOCKED_CHANGE, MIN_GAIN_STEPS};
pub use networks::network::Network;
pub use networks::policy::{FrozenNets, Nets, Policy, Scratch, look_ahead};
pub(crate) use networks::shapes::axis_actions;
pub use settings::{Auto, Backend, LearnSettings, LossScale, OutOfRange};
pub use update::gradient::FullGradient;
pub use update::losses::Losses;
pub(crate) use update::losses::{EXCESS_WEIGHT, WAY_OUT_OUTPUT, WAY_OUT_WEIGHT};
pub use update::profile::{Profile, Stage};
pub use update::reference::{Layers, Reference};
pub(crate) use update::rows::{MISPREDICTED_ERROR, MISPREDICTED_FACTOR};

/// The built-in learners.
pub const LEARNERS: [LearnerKind; 6] =
    [gdg::KIND, gdg_distance::KIND, ddpg::DDPG, ddpg::HER, ddpg::DDPG_DISTANCE, random::KIND];
