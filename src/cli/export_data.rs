//! Options of `gdg-tui export-data`.

use std::path::PathBuf;

use clap::Args;

use super::values::output;

/// Options of `gdg-tui export-data`.
#[derive(Debug, Args)]
pub struct ExportDataArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Output file [default: CHECKPOINT with the extension .npz]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}
