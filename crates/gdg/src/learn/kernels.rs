//! Dense loops and matrix products. The only unsafe code of the crate is in `kernel`.

pub mod kernel;
pub mod product;
