//! What an update is made of: losses, gradients, optimiser steps, and the threads that share them.

pub mod adam;
pub mod gradient;
pub mod losses;
pub mod pool;
pub mod profile;
pub mod reference;
pub mod tape;
