//! The datasets of OGBench that jobs learn from, and published results.

use std::path::Path;

use miette::{Report, miette};

use crate::experiment::plan::JobData;
use gdg::job::Job;
use gdg::text::sanitized;
use gdg::train::Dataset;

/// Success in per cent, in the order of [`PUBLISHED_METHODS`]; `None` where there is no number.
type Success = [Option<u8>; PUBLISHED_METHODS.len()];

/// Methods with published results: the first four as measured by Park et al. (OGBench,
/// arXiv:2410.20092), the others by their authors (arXiv:2510.07257, arXiv:2602.05031).
pub const PUBLISHED_METHODS: [&str; 6] = ["GCIVL", "QRL", "CRL", "HIQL", "GCIQL + TTGS", "ALPS"];

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

pub fn find(dataset: &str, folder: &Path) -> Result<JobData, Report> {
    let name = format!("pointmaze-{dataset}-v0.npz");
    let file = folder.join(&name);
    let checksum = Dataset::check_file(&file, &Job::default()).map_err(|error| {
        let help = format!(
            "put OGBench's {name} into {}: python/collect_ogbench.py writes it, and \
             ogbench.download_datasets, in Python, fetches it",
            folder.display()
        );
        miette!(help = help, "{}", sanitized(&error.to_string()))
    })?;
    Ok(JobData { file, checksum })
}
