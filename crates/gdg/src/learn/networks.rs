//! Networks: inputs, weights, running averages, and policies for inference.

pub mod dense;
pub mod encoder;
pub mod export;
pub mod features;
pub mod grid;
pub mod lookahead;
pub mod mlp;
pub mod network;
pub mod policy;
pub mod shapes;
pub mod table;
