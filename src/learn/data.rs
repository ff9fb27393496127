//! The replay buffer, and the batches sampled from it.

pub mod batch;
pub mod replay;
