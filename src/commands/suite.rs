//! `gdg-tui suite`.

use std::sync::Arc;

use super::output::{OrFail, Outcome};
use crate::cli::SuiteArgs;
use crate::experiment::suite;
use crate::host::logging::{self, LogLevel};
use gdg::train::Registry;

/// Trains on every map, and reports.
///
/// # Errors
/// The arguments are invalid, or results cannot be written.
pub fn run(args: SuiteArgs, registry: &Arc<Registry>) -> Outcome {
    logging::start(LogLevel::Info);
    suite::prepare(&args.into(), registry).or_bad_input()?.run().or_failure()
}
