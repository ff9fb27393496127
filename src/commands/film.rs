//! `gdg-tui film`: how a checkpoint's run learned distance, as an animation.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use crate::cli::FilmArgs;
use crate::host::report::from_checkpoint_error;
use crate::host::setup::refuse_existing;
use gdg::engine::Snapshot;
use gdg::files;
use gdg::train::{self, Registry};
use gdg::viewer::{FilmError, animate};

/// Writes the film in a checkpoint and returns a line that says where.
///
/// # Errors
/// The checkpoint cannot be read or has no film, or the file exists or cannot be written.
pub fn run(args: &FilmArgs, registry: &Arc<Registry>) -> Result<String, Report> {
    let path = args.out.clone().unwrap_or_else(|| default_path(args));
    refuse_existing(&path, args.overwrite)?;
    let loaded = train::load(&args.checkpoint, registry, 1).map_err(from_checkpoint_error)?;
    let run = Snapshot::capture(&loaded.trainer).into_diagnostic()?;
    let bytes = animate(&run).map_err(|error| {
        let help = match error {
            FilmError::NoFrames => "train on: gdg-tui --resume FILE films the rest",
            FilmError::NoScene => "films show maps and the arm",
            FilmError::Png(_) => "please report this",
        };
        miette!(help = help, "{}: {error}", args.checkpoint.display())
    })?;
    files::write_atomically(&path, &bytes).map_err(|error| {
        miette!(
            help = "give --out a file in a writable folder",
            "{}: cannot be written: {error}",
            path.display()
        )
    })?;
    Ok(format!("{}\n", path.display()))
}

/// Returns `NAME.film.png` beside the checkpoint `NAME.safetensors`.
fn default_path(args: &FilmArgs) -> PathBuf {
    let folder = args.checkpoint.parent().unwrap_or(Path::new(""));
    files::named(folder, args.checkpoint.file_stem().unwrap_or_default(), ".film.png")
}
