//! The learner: distance critics, dynamics model and actor, trained from replayed transitions without any reward.
//!
//! It knows states, goals and actions by their [`crate::env::Spec`] and nothing else. A [`Batch`] drawn from the
//! [`Replay`] goes into [`Learner::update`]; a [`Policy`] is a frozen copy of the networks for planning, evaluation
//! and display.

mod adam;
mod batch;
mod dense;
mod encoder;
mod fused;
mod gradient;
mod grid;
pub mod kernel;
mod learner;
mod losses;
mod mlp;
mod network;
mod policy;
pub mod product;
mod profile;
mod reference;
mod replay;
mod settings;
mod state;
mod table;
mod tape;
mod team;
mod touched;

pub use batch::{Batch, BatchSampler};
pub use encoder::Encoder;
pub use fused::fused_mlp;
pub use learner::{Learner, LearnerState, WholeGradient};
pub use losses::Losses;
pub use network::Network;
pub use policy::{Nets, Policy, Scratch};
pub use profile::{Phase, Profile};
pub use reference::{Layers, Reference};
pub use replay::{Moment, Replay, ReplayState, Sizes};
pub use settings::{Backend, LearnSettings, LossScale};
pub use state::NetworkState;
