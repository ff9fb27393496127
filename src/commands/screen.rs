//! Commands that open the interface: `gdg-tui tour`, `gdg-tui compare`, and what is common to them.

use std::io::IsTerminal;
use std::sync::Arc;

use miette::{Report, miette};

use super::output::{OrFail, Outcome};
use crate::cli::{CompareArgs, ScreenArgs, TourArgs};
use crate::host::logging;
use crate::host::waiting::Waiting;
use crate::tui::{self, PreparedInterface};
use gdg::text::{sanitized_lines, terminal_obeys_escapes};
use gdg::train::Registry;

/// The error without a terminal.
struct Refusal {
    /// What is wrong.
    problem: &'static str,
    /// What works without a terminal.
    help: &'static str,
}

/// Prepares and runs a view that needs a terminal.
fn watch<T>(
    args: &ScreenArgs,
    refusal: &Refusal,
    prepare: impl FnOnce() -> Result<T, Report>,
    show: impl FnOnce(T, &mut PreparedInterface) -> Result<(u8, String), Report>,
) -> Outcome {
    logging::start(args.log_level);
    let prepared = prepare().or_bad_input()?;
    if let Some(obstacle) = obstacle() {
        let error = miette!(help = refusal.help, "{}, but {obstacle}", refusal.problem);
        return Err(error).or_bad_input();
    }
    let mut interface = tui::prepare(&args.interface.options()).or_bad_input()?;
    Ok(show(prepared, &mut interface).or_failure()?.0)
}

/// Returns why the interface cannot be shown, if it cannot.
pub fn obstacle() -> Option<String> {
    if !std::io::stdout().is_terminal() {
        return Some("the output is not a terminal".to_owned());
    }
    let of_kind = || match std::env::var("TERM").unwrap_or_default().as_str() {
        "" => "TERM is not set".to_owned(),
        term => format!("TERM={}", sanitized_lines(term)),
    };
    (!terminal_obeys_escapes()).then(|| format!("the terminal cannot draw it ({})", of_kind()))
}

/// Shows the guided tour.
pub fn tour(args: &TourArgs, registry: &Arc<Registry>) -> Outcome {
    let refusal = Refusal {
        problem: "a tour is something to watch: it needs a terminal",
        help: "gdg-tui --no-ui trains without one",
    };
    watch(&args.screen, &refusal, || tui::prepare_tour(args.threads, registry), tui::take_tour)
}

/// Shows two methods side by side.
pub fn compare(args: &CompareArgs, registry: &Arc<Registry>) -> Outcome {
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
