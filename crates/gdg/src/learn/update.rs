//! Updates: losses and their gradients, optimiser steps, threads.

pub mod actor;
pub mod losses;
pub mod parts;
pub mod profile;
pub mod thread_pool;
pub mod threads;
pub mod trained_networks;
