//! Options of `gdg-tui tour`.

use clap::Args;

use super::ScreenArgs;
use super::values::parse_threads;
use gdg::learn::Threads;

const EXAMPLES: &str = "\
Examples:
  gdg-tui tour                               a minute and a half, with captions

Enter, the right arrow or a click goes to the next step, p pauses, Esc ends the tour. Then \
training goes on as usual: it is the run of gdg-tui fourrooms --seed 0.

Exit status: 0 success; 1 failure while running; 2 bad usage or input; 128 + its number after a \
signal.";

/// Options of `gdg-tui tour`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct TourArgs {
    /// Threads that share each update: a number, or auto for as many as make it faster at the moment,
    /// up to this machine's cores; results do not depend on it
    #[arg(long, value_name = "N", default_value = "auto", value_parser = parse_threads)]
    pub threads: Threads,

    /// Options of what is shown.
    #[command(flatten)]
    pub screen: ScreenArgs,
}
