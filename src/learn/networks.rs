//! Networks: their inputs, weights, averages, and what has been learned, ready to use.

#[forbid(unsafe_code)]
pub mod dense;
#[forbid(unsafe_code)]
pub mod encoder;
#[forbid(unsafe_code)]
pub mod grid;
#[forbid(unsafe_code)]
pub mod mlp;
#[forbid(unsafe_code)]
pub mod network;
#[forbid(unsafe_code)]
pub mod policy;
#[forbid(unsafe_code)]
pub mod state;
#[forbid(unsafe_code)]
pub mod table;
#[forbid(unsafe_code)]
pub mod touched;
