//! Networks: their inputs, weights, averages, and what has been learned, ready to use.

pub mod dense;
pub mod encoder;
pub mod grid;
pub mod mlp;
pub mod network;
pub mod policy;
pub mod state;
pub mod table;
pub mod touched;
