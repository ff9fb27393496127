//! The table of results, in Markdown.

use std::collections::BTreeSet;

use super::job::{Job, JobResult};
use gdg::map::fingerprint;
use gdg::text::markdown;
use gdg::train::{Method, Preset};

/// A column of numbers.
struct Column {
    title: &'static str,
    /// Digits after the point.
    digits: usize,
    /// Whether smaller is better, which decides what the worst value is.
    smaller_is_better: bool,
    of: fn(&JobResult) -> Option<f64>,
}

const fn high(title: &'static str, digits: usize, of: fn(&JobResult) -> Option<f64>) -> Column {
    Column { title, digits, smaller_is_better: false, of }
}

const fn low(title: &'static str, digits: usize, of: fn(&JobResult) -> Option<f64>) -> Column {
    Column { title, digits, smaller_is_better: true, of }
}

const COLUMNS: [Column; 10] = [
    high("planned", 3, |r| r.last()?.planned.as_ref()?.success),
    high("SPL", 2, |r| r.last()?.planned.as_ref()?.spl),
    high("greedy", 3, |r| r.last()?.greedy.success),
    high("straight", 3, |r| r.last()?.straight.as_ref()?.success),
    low("error of D", 2, |r| Some(r.last()?.distance_error?.mape)),
    low("error near", 2, |r| Some(r.last()?.distance_error?.near_mape)),
    low("error of graph", 2, |r| Some(r.last()?.distance_error?.graph?.mape)),
    low("false edges", 0, |r| Some(r.last()?.bridges.as_ref()?.false_edges? as f64)),
    high("coverage", 3, |r| r.last()?.coverage),
    high("updates/s", 0, |r| (r.seconds > 0.0).then(|| r.updates as f64 / r.seconds)),
];

/// One line: a map, a method with its settings, and the results of its seeds.
#[derive(Debug)]
pub struct Row {
    /// The map's name.
    pub map: String,
    /// What tells the map apart from others of its name, if it is known.
    pub fingerprint: Option<String>,
    /// Its width and height; `None` if only results are known.
    pub size: Option<(usize, usize)>,
    /// Number of free cells.
    pub free_cells: usize,
    /// The method.
    pub method: Method,
    /// Name of the variant, if its settings have one.
    pub variant: Option<String>,
    /// The preset.
    pub preset: Preset,
    /// Settings that differ from the preset's.
    pub settings: Vec<String>,
    /// Updates per seed.
    pub updates: u64,
    /// Names of the jobs, one per seed; none if only results are known.
    pub jobs: Vec<String>,
    /// The results there are.
    pub results: Vec<JobResult>,
}

impl Row {
    /// Returns the row of `jobs` on one map, which have these results.
    pub fn of(jobs: &[Job], results: Vec<JobResult>) -> Option<Self> {
        let first = jobs.first()?;
        let map = first.world.map()?;
        Some(Self {
            map: map.name().to_owned(),
            fingerprint: Some(fingerprint(map)),
            size: Some((map.width(), map.height())),
            free_cells: map.free_count(),
            method: first.run.method.clone(),
            variant: first.variant.clone(),
            preset: first.run.preset,
            settings: first.changed_settings(),
            updates: first.plan.length.amount(),
            jobs: jobs.iter().map(|job| job.name.clone()).collect(),
            results,
        })
    }

    /// Returns the row of a result whose job is not known.
    pub fn other(result: JobResult) -> Self {
        Self {
            map: result.world.clone(),
            fingerprint: result.fingerprint().map(str::to_owned),
            size: None,
            free_cells: result.map.as_ref().map_or(0, |map| map.free_cells),
            method: result.method.clone(),
            variant: result.variant.clone(),
            preset: result.preset,
            settings: result.settings.clone(),
            updates: result.updates,
            jobs: Vec::new(),
            results: vec![result],
        }
    }

    /// Whether a result is of the same map, method, settings and length.
    pub fn is_of(&self, result: &JobResult) -> bool {
        let fingerprints = self.fingerprint.as_deref().zip(result.fingerprint());
        self.map == result.world
            && fingerprints.is_none_or(|(own, other)| own == other)
            && self.method == result.method
            && self.variant == result.variant
            && self.preset == result.preset
            && self.settings == result.settings
            && self.updates == result.updates
    }

    /// Adds a result, unless the jobs are known: they replace those of other versions.
    pub fn add(&mut self, result: JobResult) {
        if self.jobs.is_empty() {
            self.results.push(result);
        }
    }

    /// Returns method, variant and those settings that not all of `rows` have.
    pub fn label(&self, rows: &[Self]) -> String {
        let variant = self.variant.as_ref().map_or(String::new(), |name| format!(", {name}"));
        let is_common = |set: &&String| rows.iter().all(|row| row.settings.contains(set));
        let own: Vec<&str> =
            self.settings.iter().filter(|set| !is_common(set)).map(String::as_str).collect();
        let own = if own.is_empty() { String::new() } else { format!(" ({})", own.join(" ")) };
        format!("{}{variant}{own}", self.method)
    }
}

/// Returns the table: a line per map and method and, for several maps, lines with the mean and the
/// worst of each column.
pub fn table(rows: &[Row]) -> String {
    let titles = COLUMNS.map(|column| column.title).join(" | ");
    let mut out = format!(
        "| map | method | free cells | updates | {titles} |\n|---|---|{}\n",
        "---:|".repeat(2 + COLUMNS.len())
    );
    let labels: Vec<String> = rows.iter().map(|row| markdown(&row.label(rows))).collect();
    for (row, label) in rows.iter().zip(&labels) {
        let cells = COLUMNS.map(|column| column.cell(&row.results)).join(" | ");
        let missing = match (row.results.len(), row.jobs.len()) {
            (found, all) if found < all && all > 1 => format!(" ({found} of {all} seeds)"),
            _ => String::new(),
        };
        let (map, cells_free, updates) = (markdown(&row.map), row.free_cells, row.updates);
        out += &format!("| {map}{missing} | {label} | {cells_free} | {updates} | {cells} |\n");
    }
    let mut known = BTreeSet::new();
    for label in labels.iter().filter(|label| known.insert(*label)) {
        let own: Vec<&Row> =
            rows.iter().zip(&labels).filter(|(_, of)| *of == label).map(|(row, _)| row).collect();
        if own.len() > 1 {
            out += &total("mean", label, &own, &|_, values| mean(values));
            out += &total("worst", label, &own, &Column::worst);
        }
    }
    out
}

/// Returns the line with one number of each column over several maps.
fn total(name: &str, label: &str, rows: &[&Row], of: &dyn Fn(&Column, &[f64]) -> f64) -> String {
    let cells = COLUMNS.map(|column| {
        let values: Vec<f64> = rows.iter().flat_map(|row| column.values(&row.results)).collect();
        if values.is_empty() { "-".to_owned() } else { column.format(of(&column, &values)) }
    });
    format!("| **{name}** | {label} | | | {} |\n", cells.join(" | "))
}

/// Returns the numbers of one result, by column.
pub fn numbers(result: &JobResult) -> String {
    let number =
        |column: &Column| Some(format!("{} {}", column.title, column.format((column.of)(result)?)));
    COLUMNS.iter().filter_map(number).collect::<Vec<_>>().join(", ")
}

impl Column {
    fn values(&self, results: &[JobResult]) -> Vec<f64> {
        results.iter().filter_map(self.of).collect()
    }

    fn worst(&self, values: &[f64]) -> f64 {
        let worse = if self.smaller_is_better { f64::max } else { f64::min };
        values.iter().copied().reduce(worse).unwrap_or(f64::NAN)
    }

    fn format(&self, value: f64) -> String {
        format!("{value:.*}", self.digits)
    }

    /// Returns the value, or the mean and the worst of several; `-` if there is none.
    fn cell(&self, results: &[JobResult]) -> String {
        match &self.values(results)[..] {
            [] => "-".to_owned(),
            [value] => self.format(*value),
            values => {
                format!("{} ({})", self.format(mean(values)), self.format(self.worst(values)))
            }
        }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
