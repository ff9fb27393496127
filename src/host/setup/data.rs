//! Recorded transitions to learn from.

use std::path::Path;

use miette::{Report, miette};

use crate::host::report::from_data_error;
use gdg::job::Job;
use gdg::text::sanitized;
use gdg::train::{Dataset, LeftOut, Trainer};

/// Stages of beginning a run with data: the file is checked, the world opened, the data read and
/// learned from.
const BEGIN_STAGES: usize = 4;

/// Share of recorded transitions that are impossible on the map from which on they may be of
/// another one.
const OF_ANOTHER_MAP: f64 = 0.05;

/// Checks the file with the recorded transitions, before the world is opened, which may take a
/// minute.
pub fn check(file: &Path, progress: &Job) -> Result<(), Report> {
    progress.begin(0, BEGIN_STAGES);
    Dataset::check_file(file, progress).map_err(from_data_error)?;
    progress.begin(1, BEGIN_STAGES);
    Ok(())
}

/// Has `trainer` learn from the recorded transitions in `file`; returns a warning if some of them
/// are left out, and says how far it is to `progress`.
pub fn learn_from(
    trainer: &mut Trainer,
    file: &Path,
    progress: &Job,
) -> Result<Option<String>, Report> {
    progress.begin(2, BEGIN_STAGES);
    let data = Dataset::read(file, trainer.world(), progress).map_err(from_data_error)?;
    progress.begin(3, BEGIN_STAGES);
    let LeftOut { impossible, by_chance } = trainer.learn_from(&data, progress);
    let (all, file) = (data.source().transitions, sanitized(&file.to_string_lossy()));
    if 2 * impossible > all {
        let help = "give the data of this world: positions in its unit, on this map";
        return Err(miette!(
            help = help,
            "{file}: {impossible} of {all} transitions are impossible on this map"
        ));
    }
    let of_another = OF_ANOTHER_MAP * all as f64;
    let impossible_as = if impossible as f64 > of_another {
        "impossible on this map: the data may be of another map, or of another version of it"
    } else {
        "impossible on this map"
    };
    let reasons = [
        (impossible, impossible_as),
        (by_chance, "they lead far, and not always to the same place"),
    ];
    let left_out: Vec<String> = reasons
        .iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, why)| format!("{count} of {all} transitions are left out: {why}"))
        .collect();
    Ok((!left_out.is_empty()).then(|| format!("warning: {file}: {}", left_out.join("; "))))
}
