//! The replay buffer, the batches sampled from it, and places among goals.

pub mod batch;
pub mod places;
pub mod replay;
