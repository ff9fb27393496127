//! `gdg-tui tour`.

use std::sync::Arc;

use super::output::Outcome;
use super::screen::{Refusal, watch};
use crate::cli::TourArgs;
use crate::tui;
use gdg::train::Registry;

/// Shows the guided tour.
///
/// # Errors
/// See [`watch`].
pub fn run(args: &TourArgs, registry: &Arc<Registry>) -> Outcome {
    let refusal = Refusal {
        problem: "a tour is something to watch: it needs a terminal",
        help: "gdg-tui --no-ui trains without one",
    };
    watch(&args.screen, &refusal, || tui::prepare_tour(args.threads, registry), tui::take_tour)
}
