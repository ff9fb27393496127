//! `gdg-tui film`: how a checkpoint's run learned distance, as an animation.

use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use super::output::{beside, look_into, write_file};
use crate::cli::FilmArgs;
use crate::host::outputs::refuse_existing;
use crate::host::waiting::Working;
use gdg::engine::Snapshot;
use gdg::env::Scene;
use gdg::train::Registry;
use gdg::viewer::{FilmError, animate, still};

/// Writes the film in a checkpoint, or its last frame, and returns a line that says where: by
/// default, `NAME.film.png` or `NAME.still.png` beside `NAME.safetensors`.
///
/// # Errors
/// The checkpoint cannot be read or has no film, or the file exists or cannot be written.
pub fn run(args: &FilmArgs, registry: &Arc<Registry>) -> Result<String, Report> {
    let end = if args.still { ".still.png" } else { ".film.png" };
    let path = args.out.clone().unwrap_or_else(|| beside(&args.checkpoint, end));
    refuse_existing(&path, args.overwrite)?;
    let trainer = look_into(&args.checkpoint, registry)?;
    let run = Snapshot::capture(&trainer).into_diagnostic()?;
    let drawing = Working::begin("the film to be drawn");
    let drawn = if args.still {
        still(&run, args.width)
    } else {
        animate(&run, args.width, drawing.progress())
    };
    drop(drawing);
    let bytes = drawn.map_err(|error| {
        let help = match error {
            FilmError::NoFrames if !matches!(run.scene, Scene::Goals(_)) => {
                "train on: gdg-tui --resume FILE films the rest"
            }
            FilmError::NoFrames | FilmError::NoScene => "films show maps and the arm",
            FilmError::Png(_) => "please report this",
        };
        miette!(help = help, "{}: {error}", args.checkpoint.display())
    })?;
    write_file(&path, &bytes)
}
