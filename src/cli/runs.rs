//! Options of `gdg-tui runs`.

use std::path::PathBuf;

use clap::Args;

use super::ScreenArgs;
use crate::host::runs::SAVES;

const EXAMPLES: &str = "\
Examples:
  gdg-tui runs                               all in saves/, experiments too
  gdg-tui runs saves/suite records/          of an experiment, and records
  gdg-tui runs --json | jq -r 'select(.success >= 0.9) | .file'

On a terminal, a screen: / filters by words, s sorts, Space marks runs, whose curves and \
settings are then shown together, also while they grow; Enter resumes, c compares (q leads back \
to the list), Delete deletes; ? lists all keys. Elsewhere, a table. --json writes one \
JSON object per run and line, of checkpoints, results and records alike.

Exit status: 0 success; 2 bad usage or input; 128 + its number after a signal.";

/// Options of `gdg-tui runs`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct RunsArgs {
    /// Folders of checkpoints, of records, or of gdg-tui suite or reproduce
    #[arg(default_value = SAVES, value_name = "FOLDER")]
    pub folders: Vec<PathBuf>,

    /// Print one JSON object per run
    #[arg(long)]
    pub json: bool,

    /// Options of what is shown.
    #[command(flatten)]
    pub screen: ScreenArgs,
}
