//! Experiments: many runs at once, each a job whose result is kept in a folder.
//!
//! A [`job::Job`] is everything that a result depends on; a [`folder::Folder`] keeps results, checkpoints and pictures; a
//! [`runner::Runner`] runs the jobs without a result, in parallel. Interrupted jobs resume where they stopped.

pub mod ablate;
pub mod folder;
pub mod job;
pub mod picture;
pub mod report;
pub mod runner;
pub mod suite;
pub mod table;
