//! Options of `gdg-tui export-policy`.

use std::path::PathBuf;

use clap::Args;

use super::values::output;

/// Options of `gdg-tui export-policy`.
#[derive(Debug, Args)]
pub struct ExportPolicyArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Output file [default: CHECKPOINT with the extension .policy.safetensors]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}
