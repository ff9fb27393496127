//! Options of `gdg-tui film`.

use std::path::PathBuf;

use clap::Args;

use super::values::{counts, output};

/// Options of `gdg-tui film`.
#[derive(Debug, Args)]
pub struct FilmArgs {
    /// Checkpoint to read
    pub checkpoint: PathBuf,
    /// Write only the last frame, as a picture of the map that says what colours and lines mean
    #[arg(long)]
    pub still: bool,
    /// Width in pixels [default: up to 400, with whole pixels for each cell]
    #[arg(long, value_name = "PIXELS", value_parser = counts::<usize>(100..=8_192))]
    pub width: Option<usize>,
    /// Output file [default: CHECKPOINT with the extension .film.png, or .still.png]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long)]
    pub overwrite: bool,
}
