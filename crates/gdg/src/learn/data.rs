//! The replay buffer, the batches sampled from it, what the bridge graph adds to them, and an index of
//! goals by position.

pub mod batch;
pub mod goal_index;
pub mod graph_paths;
pub mod hard_pairs;
pub mod known;
pub mod replay;
