//! `gdg-tui export-policy`: a checkpoint's policy for other programs.

use std::sync::Arc;

use miette::{IntoDiagnostic, Report};

use super::output::{beside, look_into, write_file};
use crate::cli::ExportPolicyArgs;
use crate::host::outputs::refuse_existing;
use crate::host::waiting::Working;
use gdg::train::{Registry, policy_file};

/// Writes the policy of a checkpoint and returns a line that says where: by default,
/// `NAME.policy.safetensors` beside `NAME.safetensors`.
///
/// # Errors
/// The checkpoint cannot be read, has no actor or no plans, or the file exists or cannot be written.
pub fn run(args: &ExportPolicyArgs, registry: &Arc<Registry>) -> Result<String, Report> {
    let path = args.out.clone().unwrap_or_else(|| beside(&args.checkpoint, ".policy.safetensors"));
    refuse_existing(&path, args.overwrite)?;
    let trainer = look_into(&args.checkpoint, registry)?;
    let writing = Working::begin("the policy to be written");
    writing.progress().begin(0, 1);
    let bytes = policy_file(&trainer, args.plans, writing.progress()).into_diagnostic()?;
    write_file(&path, &bytes)
}
