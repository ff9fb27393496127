//! The parts of an update: losses, gradients, optimiser steps, and the thread pool.

#[cfg(test)]
pub mod autograd;
pub mod gradient;
pub mod losses;
pub mod objective;
pub mod pool;
pub mod profile;
pub mod reference;
pub mod rows;
pub mod straight;
pub mod threads;
pub mod training;
