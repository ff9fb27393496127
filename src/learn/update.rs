//! What an update is made of: losses, gradients, optimiser steps, and the threads that share them.

#[forbid(unsafe_code)]
pub mod adam;
#[forbid(unsafe_code)]
pub mod gradient;
#[forbid(unsafe_code)]
pub mod losses;
#[forbid(unsafe_code)]
pub mod pool;
#[forbid(unsafe_code)]
pub mod profile;
#[forbid(unsafe_code)]
pub mod reference;
#[forbid(unsafe_code)]
pub mod tape;
