//! `gdg-tui compare`.

use std::sync::Arc;

use super::output::Outcome;
use super::screen::{Refusal, watch};
use crate::cli::CompareArgs;
use crate::host::waiting::Waiting;
use crate::tui;
use gdg::train::Registry;

/// Shows two methods side by side.
///
/// # Errors
/// See [`watch`].
pub fn run(args: &CompareArgs, registry: &Arc<Registry>) -> Outcome {
    let refusal = Refusal {
        problem: "a comparison is something to watch: it needs a terminal",
        help: "gdg-tui reproduce and gdg-tui suite --method METHOD compare methods without one",
    };
    let options = args.options();
    let prepare = || {
        let opening = Waiting::on("opening both runs");
        tui::prepare_comparison(&options, registry, &opening)
    };
    watch(&args.screen, &refusal, prepare, tui::compare)
}
