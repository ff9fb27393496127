//! The datasets of OGBench that jobs learn from: found in a folder, or collected there by OGBench.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use miette::{IntoDiagnostic, Report, miette};

use crate::experiment::plan::JobData;
use gdg::env::GymOptions;
use gdg::job::Job;
use gdg::printing::eprint_line;
use gdg::text::sanitized;
use gdg::train::Dataset;

/// Collects a dataset by the published recipe.
const COLLECTOR: &str = include_str!("../../../python/collect_ogbench.py");

/// The success of methods on a dataset in per cent, as published.
pub struct Published {
    /// The dataset, by the name of its entry.
    pub dataset: &'static str,
    /// In the order of [`PUBLISHED_METHODS`]; `None` where there is no number.
    pub success: [Option<u8>; PUBLISHED_METHODS.len()],
}

/// Methods with published results: the first four as measured by Park et al. (OGBench,
/// arXiv:2410.20092), the others by their authors (arXiv:2510.07257, arXiv:2602.05031).
pub const PUBLISHED_METHODS: [&str; 6] = ["GCIVL", "QRL", "CRL", "HIQL", "GCIQL + TTGS", "ALPS"];

/// The published results.
pub const PUBLISHED: [Published; 8] = [
    published("medium-navigate", [63, 82, 29, 79], Some(91), None),
    published("large-navigate", [45, 86, 39, 58], Some(88), None),
    published("giant-navigate", [0, 68, 27, 46], Some(92), Some(67)),
    published("teleport-navigate", [45, 4, 24, 18], None, None),
    published("medium-stitch", [70, 80, 0, 74], Some(44), None),
    published("large-stitch", [12, 84, 0, 13], Some(29), Some(96)),
    published("giant-stitch", [0, 50, 0, 0], Some(98), Some(98)),
    published("teleport-stitch", [44, 9, 4, 34], None, Some(13)),
];

const fn published(
    dataset: &'static str,
    [gcivl, qrl, crl, hiql]: [u8; 4],
    ttgs: Option<u8>,
    alps: Option<u8>,
) -> Published {
    let success = [Some(gcivl), Some(qrl), Some(crl), Some(hiql), ttgs, alps];
    Published { dataset, success }
}

/// Returns the published results on a dataset.
pub fn published_on(dataset: &str) -> Option<&'static Published> {
    PUBLISHED.iter().find(|published| published.dataset == dataset)
}

/// Where datasets are.
#[derive(Clone, Debug)]
pub struct DataFolder {
    /// The folder.
    pub folder: PathBuf,
    /// The interpreter that has OGBench; otherwise the default one.
    pub python: Option<PathBuf>,
}

impl DataFolder {
    /// Returns the file of a dataset, which may not be there.
    fn file(&self, dataset: &str) -> PathBuf {
        self.folder.join(format!("pointmaze-{dataset}-v0.npz"))
    }

    /// Returns a dataset.
    ///
    /// # Errors
    /// It is not there, or cannot be read.
    pub fn find(&self, dataset: &str) -> Result<JobData, Report> {
        let file = self.file(dataset);
        let checksum = Dataset::check_file(&file, &Job::default()).map_err(|error| {
            miette!(help = self.help(&file), "{}", sanitized(&error.to_string()))
        })?;
        Ok(JobData { file, checksum })
    }

    /// Collects those of `datasets` that are not there, `parallel` at a time.
    ///
    /// # Errors
    /// There is no Python with OGBench, or the folder cannot be written.
    pub fn collect(&self, datasets: &[&str], parallel: usize) -> Result<(), Report> {
        let missing: Vec<&str> =
            datasets.iter().copied().filter(|dataset| !self.file(dataset).exists()).collect();
        if missing.is_empty() {
            return Ok(());
        }
        std::fs::create_dir_all(&self.folder).into_diagnostic()?;
        let python = GymOptions { python: self.python.clone(), ..GymOptions::default() };
        for together in missing.chunks(parallel.max(1)) {
            eprint_line(&format!(
                "{}: collected with OGBench in Python, minutes each",
                together.join(", ")
            ));
            let begin = |dataset: &&str| {
                let mut command = Command::new(python.interpreter());
                command.args(["-c", COLLECTOR, &format!("pointmaze-{dataset}-v0")]);
                command.arg(self.file(dataset)).stdin(Stdio::null());
                command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn()
            };
            let begun: Vec<_> = together.iter().map(begin).collect();
            // All end before the first error is reported.
            let ended = begun.into_iter().map(|child| child.and_then(Child::wait_with_output));
            let ended: Vec<_> = ended.collect();
            for (dataset, ended) in together.iter().zip(ended) {
                let (file, python) = (self.file(dataset), python.interpreter());
                let why = match ended {
                    Ok(output) if output.status.success() && file.exists() => continue,
                    Ok(output) => last_line(&output.stderr),
                    Err(error) if error.kind() == ErrorKind::NotFound => "not found".to_owned(),
                    Err(error) => error.to_string(),
                };
                return Err(miette!(
                    help = self.help(&file),
                    "{dataset}: not collected: {}: {why}",
                    sanitized(&python.to_string_lossy())
                ));
            }
        }
        Ok(())
    }

    /// Returns what to do about a missing file.
    fn help(&self, file: &Path) -> String {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        format!(
            "put OGBench's {name} into {}, or give --python an interpreter with the package ogbench",
            self.folder.display()
        )
    }
}

/// Returns the last line of a program's errors.
fn last_line(errors: &[u8]) -> String {
    let text = String::from_utf8_lossy(errors);
    let line = text.lines().map(str::trim).rfind(|line| !line.is_empty());
    line.map_or("it ended early".to_owned(), sanitized)
}
