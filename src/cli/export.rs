//! Options of `gdg-tui export-data` and `export-policy`.

use std::path::PathBuf;

use clap::Args;

use super::values::output;

/// What is exported, and where to.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Output file [default: CHECKPOINT with another extension]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}

/// Options of `gdg-tui export-policy`.
#[derive(Debug, Args)]
pub struct ExportPolicyArgs {
    #[command(flatten)]
    pub export: ExportArgs,
    /// Also write what plans need: critics, dynamics model, bridge candidates and edges. The Python
    /// module gdg_tui then follows bridges as this program does
    #[arg(long)]
    pub plans: bool,
}
