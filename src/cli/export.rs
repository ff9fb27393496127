//! Options of `gdg-tui film`, `export-data` and `export-policy`.

use std::path::PathBuf;

use clap::Args;

use super::values::{counts, output};

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

/// Options of `gdg-tui film`.
#[derive(Debug, Args)]
pub struct FilmArgs {
    #[command(flatten)]
    pub export: ExportArgs,
    /// Write only the last frame, as a picture of the map that says what colours and lines mean
    #[arg(long)]
    pub still: bool,
    /// Width in pixels [default: up to 400, with whole pixels for each cell]
    #[arg(long, value_name = "PIXELS", value_parser = counts::<usize>(100..=8_192))]
    pub width: Option<usize>,
}
