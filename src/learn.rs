//! The learner: distance critics, dynamics model and actor, trained from replayed transitions without any reward.
//!
//! A learner is one file here that implements [`Learner`]; [`LEARNERS`] lists the built-in ones. It knows states, goals
//! and actions by their [`crate::env::Spec`] and nothing else, learns from the [`Replay`], and offers what it has
//! learned as a [`Policy`]: D and mu, for exploration, planning, evaluation and display.

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
pub use settings::{Backend, LearnSettings, LossScale};
pub use state::NetworkState;

/// The built-in learners.
pub const LEARNERS: [LearnerKind; 2] = [gdg::KIND, random::KIND];
