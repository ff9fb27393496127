//! What agents did, and the batches drawn from it.

pub mod batch;
pub mod replay;
