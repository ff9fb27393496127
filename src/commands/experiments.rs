//! Many runs: `gdg-tui suite`, `gdg-tui reproduce` and `gdg-tui plot`.

use std::sync::Arc;

use super::output::{OrFail, Outcome, print_safely};
use crate::cli::{ReproduceArgs, SuiteArgs};
use crate::experiment::{figures, plot, suite};
use crate::host::logging::{self, LogLevel};
use gdg::train::Registry;

/// Trains on every map, and reports.
pub fn suite(args: SuiteArgs, registry: &Arc<Registry>) -> Outcome {
    logging::start(LogLevel::Info);
    suite::prepare(&args.into(), registry).or_bad_input()?.run().or_failure()
}

/// Trains what the figures need, and draws them.
pub fn reproduce(args: ReproduceArgs, registry: &Arc<Registry>) -> Outcome {
    logging::start(LogLevel::Info);
    figures::prepare(&args.into(), registry).or_bad_input()?.run().or_failure()
}

/// Draws the curves of runs, and says which files it has written.
pub fn plot(options: &plot::Options) -> Outcome {
    print_safely(&plot::run(options).or_bad_input()?)
}
