//! What agents did, and the batches drawn from it.

#[forbid(unsafe_code)]
pub mod batch;
#[forbid(unsafe_code)]
pub mod replay;
