//! Learners: distance critics, a dynamics model and an actor, trained on replayed transitions without rewards.
//!
//! Each learner is a module that implements [`Learner`]; [`LEARNERS`] lists the built-in ones. A learner sees states,
//! goals and actions only through their [`crate::env::Spec`]. It trains on the [`Replay`] and exposes the result as a
//! [`Policy`] for exploration, planning, evaluation and display: D, the distance in steps, and mu, the actor.

#[forbid(unsafe_code)]
mod adam;
#[forbid(unsafe_code)]
mod batch;
#[forbid(unsafe_code)]
mod dense;
#[forbid(unsafe_code)]
mod encoder;
#[forbid(unsafe_code)]
mod fused;
#[forbid(unsafe_code)]
mod gdg;
#[forbid(unsafe_code)]
mod gradient;
#[forbid(unsafe_code)]
mod grid;
pub mod kernel;
#[forbid(unsafe_code)]
mod learner;
#[forbid(unsafe_code)]
mod losses;
#[forbid(unsafe_code)]
mod mlp;
#[forbid(unsafe_code)]
mod network;
#[forbid(unsafe_code)]
mod policy;
#[forbid(unsafe_code)]
pub mod product;
#[forbid(unsafe_code)]
mod profile;
#[forbid(unsafe_code)]
mod random;
#[forbid(unsafe_code)]
mod reference;
#[forbid(unsafe_code)]
mod replay;
#[forbid(unsafe_code)]
mod settings;
#[forbid(unsafe_code)]
mod state;
#[forbid(unsafe_code)]
mod table;
#[forbid(unsafe_code)]
mod tape;
#[forbid(unsafe_code)]
mod team;
#[forbid(unsafe_code)]
mod touched;

pub use batch::{Batch, BatchSampler};
pub use encoder::Encoder;
pub use fused::fused_mlp;
pub use gdg::{Gdg, WholeGradient};
pub use learner::{Acting, CreateLearner, KnownDistances, LearnError, Learner, LearnerKind, TrainingData};
pub use losses::Losses;
pub use network::Network;
pub use policy::{FrozenNets, Nets, Policy, Scratch};
pub use profile::{Phase, Profile};
pub use reference::{Layers, Reference};
pub use replay::{Moment, Replay, ReplayState, Sizes};
pub use settings::{Backend, LearnSettings, LossScale, OutOfRange};
pub use state::NetworkState;

/// The built-in learners.
pub const LEARNERS: [LearnerKind; 2] = [gdg::KIND, random::KIND];
