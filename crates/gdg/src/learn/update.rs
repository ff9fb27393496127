//! Updates: losses and their gradients, optimiser steps, threads.

pub mod actor;
pub mod losses;
pub mod parts;
pub mod pool;
pub mod report;
pub mod threads;
pub mod training;
