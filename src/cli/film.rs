//! Options of `gdg-tui film`.

use std::path::PathBuf;

use clap::Args;

use super::values::output;

/// Options of `gdg-tui film`.
#[derive(Debug, Args)]
pub struct FilmArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Output file [default: CHECKPOINT with the extension .film.png]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}
