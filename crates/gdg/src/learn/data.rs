//! The replay buffer, the batches sampled from it, and an index of goals by position.

pub mod batch;
pub mod goal_index;
pub mod known;
pub mod replay;
