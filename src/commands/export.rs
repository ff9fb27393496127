//! `gdg-tui export-data` and `export-policy`: write the data or the policy of a
//! checkpoint for other programs.

use std::path::Path;
use std::sync::Arc;

use miette::{IntoDiagnostic, Report};

use crate::cli::{ExportArgs, ExportPolicyArgs};
use crate::process::errors::from_checkpoint_error;
use crate::process::waiting::Waiting;
use crate::setup::outputs::{prepare_file, refuse_existing, refuse_input, refuse_other_kind};
use crate::setup::saves::EXPORTS;
use gdg::files;
use gdg::printing::eprint_line;
use gdg::text::counted;
use gdg::train::{Registry, Trainer, data_file, load_with, policy_file};

/// Writes what `encode` makes of the run in a checkpoint, which is read without opening its world
/// where that is possible, and returns a line that says where: by default, to `exports/`, under the
/// checkpoint's name with `end` instead of its extension.
fn export(
    ExportArgs { checkpoint, out, overwrite }: &ExportArgs,
    end: &str,
    registry: &Arc<Registry>,
    encode: impl FnOnce(&Trainer) -> Result<Vec<u8>, Report>,
) -> Result<String, Report> {
    let path = out.clone().unwrap_or_else(|| {
        files::named(Path::new(EXPORTS), checkpoint.file_stem().unwrap_or_default(), end)
    });
    refuse_existing(&path, *overwrite)?;
    match end {
        ".npz" => refuse_other_kind(&path, "recorded transitions", |at| at.starts_with(b"PK"))?,
        _ => refuse_other_kind(&path, "a policy", |start| start.get(8) == Some(&b'{'))?,
    }
    let registry = registry.clone().with(|own| own.options.reads_only = true);
    let loaded = load_with(checkpoint, &registry, 1, &Waiting::on("reading the checkpoint"));
    let trainer = loaded.map_err(from_checkpoint_error)?;
    refuse_input("--out", &path, trainer.data().map(|data| data.file.as_path()).into_iter())?;
    prepare_file(&path, &encode(&trainer)?)?()
}

/// Writes the transitions of a checkpoint's replay buffer; says how many these are.
pub fn data(args: &ExportArgs, registry: &Arc<Registry>) -> Result<String, Report> {
    let mut counts = [0; 2];
    let line = export(args, ".npz", registry, |trainer| {
        trainer.check_data().into_diagnostic()?;
        let progress = &Waiting::on("writing the transitions");
        progress.begin(0, 2);
        let bytes = data_file(trainer.replay(), trainer.world(), progress).into_diagnostic()?;
        progress.begin(1, 2);
        trainer.replay().visit_rows(|_, _, is_last| counts[usize::from(is_last)] += 1);
        Ok(bytes)
    })?;
    let [transitions, episodes] = counts;
    eprint_line(&[counted(transitions, "transition"), counted(episodes, "episode")].join(", "));
    Ok(line)
}

pub fn policy(args: &ExportPolicyArgs, registry: &Arc<Registry>) -> Result<String, Report> {
    export(&args.export, ".policy.safetensors", registry, |trainer| {
        let (made, method) = (counted(trainer.counters().updates, "update"), &trainer.run().method);
        eprint_line(&format!("{made} of {method}"));
        let writing = Waiting::on("writing the policy");
        writing.begin(0, 1);
        policy_file(trainer, args.plans, &writing).into_diagnostic()
    })
}
