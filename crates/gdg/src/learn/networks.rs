//! Networks: their inputs and weights, what they compute together, and policies.

pub mod encoder;
pub mod export;
pub mod grid;
pub mod lookahead;
pub mod mlp;
pub mod network;
pub mod policy;
pub mod returns;
pub mod shapes;
