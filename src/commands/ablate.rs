//! `gdg-tui ablate`.

use std::sync::Arc;

use super::output::{OrFail, Outcome};
use crate::cli::AblateArgs;
use crate::experiment::ablate;
use gdg::train::Registry;

/// Trains with and without each component, and prints the table.
///
/// # Errors
/// The arguments are invalid, or results cannot be written.
pub fn run(args: AblateArgs, registry: &Arc<Registry>) -> Outcome {
    ablate::run(&args.into(), registry).or_bad_input()
}
