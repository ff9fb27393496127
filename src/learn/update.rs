//! The parts of an update: losses, gradients, optimiser steps, and the thread pool.

pub mod adam;
#[cfg(test)]
pub mod autograd;
pub mod features;
pub mod gradient;
pub mod losses;
pub mod pool;
pub mod profile;
pub mod reference;
pub mod rows;
pub mod step;
pub mod straight;
pub mod tape;
