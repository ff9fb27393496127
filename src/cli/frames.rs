//! Options of `gdg-tui frames`.

use std::path::PathBuf;

use clap::Args;

use super::values::{counts, output, parse_seconds, parse_speed};

/// Options of `gdg-tui frames`.
#[derive(Debug, Args)]
pub struct FramesArgs {
    /// Recording made with --record
    pub cast: PathBuf,
    /// Times to render, in seconds from the start of the recording
    #[arg(
        long,
        value_name = "S",
        value_delimiter = ',',
        required_unless_present = "animate",
        value_parser = parse_seconds
    )]
    pub at: Vec<f64>,
    /// Render an animated PNG into this file instead
    #[arg(long, value_name = "FILE", conflicts_with = "at", value_parser = output())]
    pub animate: Option<PathBuf>,
    /// Begin the animation at this time, in seconds
    #[arg(long, value_name = "S", requires = "animate", default_value_t = 0.0, value_parser = parse_seconds)]
    pub from: f64,
    /// End the animation at this time, in seconds [default: the recording's end]
    #[arg(long, value_name = "S", requires = "animate", value_parser = parse_seconds)]
    pub to: Option<f64>,
    /// Frames per second of the animation
    #[arg(long, value_name = "N", requires = "animate", default_value_t = 5, value_parser = counts::<u16>(1..=50))]
    pub fps: u16,
    /// Play the animation this many times as fast
    #[arg(long, value_name = "X", requires = "animate", default_value_t = 1.0, value_parser = parse_speed)]
    pub speed: f64,
    /// Output folder: one FILE-SECONDS.png per time
    #[arg(long, value_name = "FOLDER", default_value = ".", value_parser = output())]
    pub out: PathBuf,
    /// Replace existing pictures
    #[arg(long)]
    pub overwrite: bool,
}
