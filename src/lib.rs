pub mod map;
pub mod env;
pub mod learn;
pub mod bridge;
pub mod train;
