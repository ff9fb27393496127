//! `gdg-tui export-policy`: a checkpoint's actor for other programs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use crate::cli::ExportPolicyArgs;
use crate::host::report::from_checkpoint_error;
use crate::host::setup::refuse_existing;
use gdg::files;
use gdg::train::{self, Registry, policy_file};

/// Writes the actor of a checkpoint and returns a line that says where.
///
/// # Errors
/// The checkpoint cannot be read, has no actor, or the file exists or cannot be written.
pub fn run(args: &ExportPolicyArgs, registry: &Arc<Registry>) -> Result<String, Report> {
    let path = args.out.clone().unwrap_or_else(|| default_path(args));
    refuse_existing(&path, args.overwrite)?;
    let loaded = train::load(&args.checkpoint, registry, 1).map_err(from_checkpoint_error)?;
    let bytes = policy_file(&loaded.trainer).into_diagnostic()?;
    files::write_atomically(&path, &bytes).map_err(|error| {
        miette!(
            help = "give --out a file in a writable folder",
            "{}: cannot be written: {error}",
            path.display()
        )
    })?;
    Ok(format!("{}\n", path.display()))
}

/// Returns `NAME.policy.safetensors` beside the checkpoint `NAME.safetensors`.
fn default_path(args: &ExportPolicyArgs) -> PathBuf {
    let folder = args.checkpoint.parent().unwrap_or(Path::new(""));
    files::named(folder, args.checkpoint.file_stem().unwrap_or_default(), ".policy.safetensors")
}
