//! Networks: their inputs and weights, what they compute together, and policies.

pub mod encoder;
pub mod grid_encoding;
pub mod lookahead;
pub mod mlp;
pub mod named_arrays;
pub mod network;
pub mod policy;
pub mod rescale;
pub mod returns;
pub mod shapes;
