//! Experiments: many runs at once, each a job whose result is kept in a folder.
//!
//! A [`spec::JobSpec`] is everything that a result depends on: a world, a method with its settings, a
//! seed and a plan. [`jobs::Jobs`] is the list of them that a command trains, lists and reports;
//! [`suite`] and [`figures`] make such lists. Interrupted jobs resume where they stopped.
//! [`saved_runs`] reads results, checkpoints and records again; [`plot`] draws their curves.

pub mod figures;
pub mod folder;
pub mod jobs;
pub mod measure;
pub mod plan;
pub mod plot;
pub mod report;
pub mod saved_runs;
pub mod spec;
pub mod suite;
pub mod variants;
