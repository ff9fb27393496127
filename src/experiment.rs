//! Experiments: many runs at once, each a job whose result is kept in a folder.
//!
//! A [`job::Job`] is everything that a result depends on; a [`folder::Folder`] keeps results,
//! checkpoints and pictures; a [`runner::Runner`] runs the jobs without a result, in parallel.
//! Interrupted jobs resume where they stopped. [`suite`] and [`reproduce`] are lists of jobs with a
//! report.

pub mod ablate;
pub mod folder;
pub mod job;
pub mod measure;
pub mod picture;
pub mod plan;
pub mod plot;
pub mod progress;
pub mod report;
pub mod reproduce;
pub mod runner;
pub mod runs;
pub mod suite;
pub mod table;
pub mod world;
