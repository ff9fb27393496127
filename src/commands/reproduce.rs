//! `gdg-tui reproduce`.

use std::sync::Arc;

use super::output::{OrFail, Outcome};
use crate::cli::ReproduceArgs;
use crate::experiment::reproduce;
use crate::host::logging::{self, LogLevel};
use gdg::train::Registry;

/// Trains what the figures need, and draws them.
///
/// # Errors
/// The arguments are invalid, or results cannot be written.
pub fn run(args: ReproduceArgs, registry: &Arc<Registry>) -> Outcome {
    logging::start(LogLevel::Info);
    reproduce::prepare(&args.into(), registry).or_bad_input()?.run().or_failure()
}
