//! `gdg-tui plot`.

use super::output::{OrFail, Outcome, print_safely};
use crate::cli::PlotArgs;
use crate::experiment::plot;

/// Draws the curves of runs, and says which files it has written.
///
/// # Errors
/// A run cannot be read, nothing is known of what is asked for, or a file cannot be written.
pub fn run(args: PlotArgs) -> Outcome {
    print_safely(&plot::run(&args.into()).or_bad_input()?)
}
