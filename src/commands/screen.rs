//! Shared code of commands that open the interface.

use std::io::IsTerminal;

use miette::{Report, miette};

use super::output::{OrFail, Outcome};
use crate::cli::ScreenArgs;
use crate::host::logging;
use crate::tui::{self, PreparedInterface};
use gdg::text::{sanitized_lines, terminal_obeys_escapes};

/// The error without a terminal.
pub struct Refusal {
    /// What is wrong.
    pub problem: &'static str,
    /// What works without a terminal.
    pub help: &'static str,
}

/// Prepares and runs a view that needs a terminal.
///
/// # Errors
/// There is no terminal, or preparing or running the view fails.
pub fn watch<T>(
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
