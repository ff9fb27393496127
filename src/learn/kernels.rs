//! Dense loops and matrix products. The only unsafe code of the crate is in `kernel`.

#[forbid(unsafe_code)]
pub mod fused;
pub mod kernel;
#[forbid(unsafe_code)]
pub mod product;
