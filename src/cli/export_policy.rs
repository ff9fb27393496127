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
    /// Also write what plans need: critics, dynamics model, bridge candidates and edges. The Python
    /// module gdg_tui then follows bridges as this program does
    #[arg(long)]
    pub plans: bool,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}
