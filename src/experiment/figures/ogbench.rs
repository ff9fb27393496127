//! The datasets of OGBench that jobs learn from: found in a folder, or collected there by OGBench.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;
use miette::{IntoDiagnostic, Report, miette};

use crate::experiment::plan::JobData;
use crate::host::values::output;
use gdg::env::GymOptions;
use gdg::job::Job;
use gdg::printing::eprint_line;
use gdg::text::sanitized;
use gdg::train::Dataset;

/// Collects a dataset by the published recipe.
const COLLECTOR: &str = include_str!("../../../python/collect_ogbench.py");

/// Success in per cent, in the order of [`PUBLISHED_METHODS`]; `None` where there is no number.
type Success = [Option<u8>; PUBLISHED_METHODS.len()];

/// Methods with published results: the first four as measured by Park et al. (OGBench,
/// arXiv:2410.20092), the others by their authors (arXiv:2510.07257, arXiv:2602.05031).
pub const PUBLISHED_METHODS: [&str; 6] = ["GCIVL", "QRL", "CRL", "HIQL", "GCIQL + TTGS", "ALPS"];

/// The success of methods on each dataset, by the name of its entry, as published.
const PUBLISHED: [(&str, Success); 8] = [
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
) -> (&'static str, Success) {
    (dataset, [Some(gcivl), Some(qrl), Some(crl), Some(hiql), ttgs, alps])
}

pub fn published_on(dataset: &str) -> Option<Success> {
    PUBLISHED.iter().find(|(name, _)| *name == dataset).map(|(_, success)| *success)
}

/// Where datasets are.
#[derive(Clone, Debug, Args)]
pub struct DataFolder {
    /// Folder of OGBench's datasets, for the figure ogbench; those that are not there are collected
    #[arg(long, value_name = "FOLDER", default_value = "saves/ogbench", value_parser = output())]
    pub data_dir: PathBuf,

    /// Python interpreter with the package ogbench, to collect them [default: that of the active
    /// virtual environment, else python3]
    #[arg(long, value_name = "PATH")]
    pub python: Option<PathBuf>,
}

impl DataFolder {
    fn file(&self, dataset: &str) -> PathBuf {
        self.data_dir.join(format!("pointmaze-{dataset}-v0.npz"))
    }

    pub fn find(&self, dataset: &str) -> Result<JobData, Report> {
        let file = self.file(dataset);
        let checksum = Dataset::check_file(&file, &Job::default()).map_err(|error| {
            miette!(help = self.help(&file), "{}", sanitized(&error.to_string()))
        })?;
        Ok(JobData { file, checksum })
    }

    /// Collects those of `datasets` that are not there, one after the other.
    pub fn collect(&self, datasets: &[&str]) -> Result<(), Report> {
        let python = GymOptions { python: self.python.clone(), ..GymOptions::default() };
        let python = python.interpreter();
        for dataset in datasets {
            let file = self.file(dataset);
            if file.exists() {
                continue;
            }
            std::fs::create_dir_all(&self.data_dir).into_diagnostic()?;
            eprint_line(&format!("{dataset}: collected with OGBench in Python, in minutes"));
            let mut command = Command::new(&python);
            command.args(["-c", COLLECTOR, &format!("pointmaze-{dataset}-v0")]).arg(&file);
            let why = match command.stdin(Stdio::null()).output() {
                Ok(output) if output.status.success() && file.exists() => continue,
                Ok(output) => {
                    let errors = String::from_utf8_lossy(&output.stderr);
                    let last = errors.lines().map(str::trim).rfind(|line| !line.is_empty());
                    last.map_or("it ended early".to_owned(), sanitized)
                }
                Err(error) if error.kind() == ErrorKind::NotFound => "not found".to_owned(),
                Err(error) => error.to_string(),
            };
            let (help, python) = (self.help(&file), sanitized(&python.to_string_lossy()));
            return Err(miette!(help = help, "{dataset}: not collected: {python}: {why}"));
        }
        Ok(())
    }

    fn help(&self, file: &Path) -> String {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        format!(
            "put OGBench's {name} into {}, or give --python an interpreter with the package ogbench",
            self.data_dir.display()
        )
    }
}
