//! `gdg-tui export-data`: the transitions that a checkpoint's run has seen, for other programs.

use std::sync::Arc;

use miette::{IntoDiagnostic, Report};

use super::output::{beside, look_into, write_file};
use crate::cli::ExportDataArgs;
use crate::host::outputs::refuse_existing;
use crate::host::waiting::Working;
use gdg::train::{Registry, data_file};

/// Writes the transitions of a checkpoint's replay buffer and returns a line that says where: by
/// default, `NAME.npz` beside `NAME.safetensors`.
///
/// # Errors
/// The checkpoint cannot be read, has no transitions, or the file exists or cannot be written.
pub fn run(args: &ExportDataArgs, registry: &Arc<Registry>) -> Result<String, Report> {
    let path = args.out.clone().unwrap_or_else(|| beside(&args.checkpoint, ".npz"));
    refuse_existing(&path, args.overwrite)?;
    let trainer = look_into(&args.checkpoint, registry)?;
    trainer.check_data().into_diagnostic()?;
    let writing = Working::begin("the transitions to be written");
    let progress = writing.progress();
    progress.begin(0, 2);
    let bytes = data_file(trainer.replay(), trainer.world(), progress).into_diagnostic()?;
    progress.begin(1, 2);
    write_file(&path, &bytes)
}
