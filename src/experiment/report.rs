//! The results of a suite as a table, and its report in Markdown: the table, the learning curves,
//! and a picture of every job.

use std::collections::BTreeSet;
use std::path::PathBuf;

use miette::{Report, miette};

use super::folder::{Folder, picture_name};
use super::plot::Grouping;
use super::saved_runs::SavedRun;
use super::spec::{JobResult, JobSpec};
use gdg::text::{aligned, counted, grouped, markdown};

/// File of the learning curves, beside their table.
pub const CURVES: &str = "success.svg";

const BRACKETS: &str = "the worst seed; in square ones: of how many seeds or maps, if not of all";

struct ReportColumn {
    title: &'static str,
    format: fn(f64) -> String,
    /// Whether it is shown on a terminal, too.
    matters: bool,
    of: fn(&JobResult) -> Option<f64>,
}

const fn column(
    title: &'static str,
    format: fn(f64) -> String,
    matters: bool,
    of: fn(&JobResult) -> Option<f64>,
) -> ReportColumn {
    ReportColumn { title, format, matters, of }
}

const RATE: fn(f64) -> String = |value| format!("{value:.2}");
const SHARE: fn(f64) -> String = |value| format!("{:.0} %", 100.0 * value);
const COUNT: fn(f64) -> String = |value| grouped(value.round() as u64);

const COLUMNS: [ReportColumn; 10] = [
    column("planned", RATE, true, |r| r.last()?.planned.as_ref()?.success),
    column("SPL", RATE, false, |r| r.last()?.planned.as_ref()?.spl),
    column("alone", RATE, true, |r| r.last()?.alone.success),
    column("straight", RATE, false, |r| r.last()?.straight.as_ref()?.success),
    column("error of D", SHARE, true, |r| Some(r.last()?.error?.mape)),
    column("error near", SHARE, false, |r| Some(r.last()?.error?.near_mape)),
    column("error of graph", SHARE, false, |r| Some(r.last()?.error?.graph?.mape)),
    column("false edges", COUNT, false, |r| Some(r.last()?.bridges.as_ref()?.false_edges? as f64)),
    column("explored", SHARE, true, |r| r.last()?.explored),
    column("updates/s", COUNT, true, |r| (r.seconds > 0.0).then(|| r.updates as f64 / r.seconds)),
];

/// One line: a map, a method with its settings, and the results of its seeds.
pub struct JobRow {
    /// The map's name, with what tells it apart from others of that name.
    map: String,
    /// The method, with what tells it apart from its others.
    label: String,
    about: JobResult,
    /// Names of the jobs that have no result yet.
    missing: Vec<String>,
    /// One per seed.
    pub results: Vec<JobResult>,
}

/// Returns the rows of `jobs`, with the results there are, further seeds among them, and those of
/// other runs in the folder; and what cannot be used there.
pub fn rows(jobs: &[JobSpec], folder: &Folder) -> (Vec<JobRow>, Vec<Report>) {
    let (mut others, mut problems) = folder.results();
    others.retain(|result| jobs.iter().all(|job| job.name != result.name));
    let own = jobs.iter().map(|job| folder.result_of(job).unwrap_or_else(|| job.open_result()));
    let own: Vec<JobResult> = own.collect();
    let mut left_out = |result: &JobResult, why: &str| {
        let file = folder.path(&format!("jobs/{}.json", result.name));
        problems.push(miette!("{}: {why}", file.display()));
    };
    others.retain(|result| {
        let of = own.iter().position(|own| own.thing() == result.thing());
        let is_seed = of.is_none_or(|i| jobs[i].is_seed(result));
        if !is_seed {
            left_out(result, "is of another version, or was evaluated on other tasks");
        }
        is_seed
    });
    let all: Vec<JobResult> = own.into_iter().chain(others).collect();
    let runs = all.iter().map(|result| SavedRun::of_result(result.clone(), PathBuf::new()));
    let grouping = Grouping::new(&runs.collect::<Vec<_>>(), &[]);
    let mut rows: Vec<JobRow> = Vec::new();
    for (i, result) in all.into_iter().enumerate() {
        let [method, map, setting] = &grouping.parts[i];
        let label = format!("{method}, {setting}").trim_end_matches(", ").to_owned();
        let is_of = |row: &JobRow| {
            (&row.map, &row.label, row.about.updates) == (map, &label, result.updates)
        };
        let at = rows.iter().position(is_of).unwrap_or_else(|| {
            let last = rows.iter().rposition(|row| row.map == *map);
            let at = last.map_or(rows.len(), |last| last + 1);
            let (map, label, about) = (map.clone(), label.clone(), result.clone());
            rows.insert(at, JobRow { map, label, about, missing: Vec::new(), results: Vec::new() });
            at
        });
        let row = &mut rows[at];
        if result.evaluations.is_empty() {
            row.missing.push(result.name);
        } else if row.results.iter().any(|known| known.seed == result.seed) {
            left_out(&result, "another one has the same method, map, settings and seed");
        } else {
            row.results.push(result);
        }
    }
    rows.iter_mut().for_each(|row| row.results.sort_by_key(|result| result.seed));
    (rows, problems)
}

/// Returns the table: a line per map and method and, for several maps, lines with the mean and the
/// worst of each column. In Markdown with all columns, or aligned with those that matter.
pub fn table(rows: &[JobRow], as_markdown: bool) -> String {
    let columns = || COLUMNS.iter().filter(|column| as_markdown || column.matters);
    let plain = |text: &str| if as_markdown { markdown(text) } else { text.to_owned() };
    let heads = ["map", "method", "updates"].into_iter().chain(columns().map(|own| own.title));
    let mut lines: Vec<Vec<String>> = vec![heads.map(str::to_owned).collect()];
    let labels: Vec<String> = rows.iter().map(|row| plain(&row.label)).collect();
    for (row, label) in rows.iter().zip(&labels) {
        let missing = match (row.results.len(), row.seeds()) {
            (found, all) if found < all && all > 1 => format!(" ({found} of {all} seeds)"),
            _ => String::new(),
        };
        let about = [plain(&row.map) + &missing, label.clone(), grouped(row.about.updates)];
        let cells = columns().map(|column| column.cell(&row.results));
        lines.push(about.into_iter().chain(cells).collect());
    }
    let kind = |row: &JobRow| (row.label.clone(), row.about.updates);
    let mut known = BTreeSet::new();
    for (first, label) in rows.iter().zip(&labels).filter(|(row, _)| known.insert(kind(row))) {
        let own = rows.iter().filter(|row| kind(row) == kind(first) && !row.results.is_empty());
        let own: Vec<&JobRow> = own.collect();
        if own.len() < 2 {
            continue;
        }
        // Each map counts once, whatever its seeds.
        for (name, of) in [
            ("mean", (|_, v| mean(v)) as fn(&ReportColumn, &[f64]) -> f64),
            ("worst", ReportColumn::worst),
        ] {
            let name = if as_markdown { format!("**{name}**") } else { name.to_owned() };
            let total = columns().map(|column| {
                let of_map = |row: &&JobRow| {
                    let values = column.values(&row.results);
                    (!values.is_empty()).then(|| of(column, &values))
                };
                let values: Vec<f64> = own.iter().filter_map(of_map).collect();
                let text = (column.format)(of(column, &values));
                of_some(text, values.len(), own.len())
            });
            let updates = grouped(first.about.updates);
            let about = [format!("{name} of {}", own.len()), label.clone(), updates];
            lines.push(about.into_iter().chain(total).collect());
        }
    }
    if !as_markdown {
        let (table, note) = (aligned(&lines), format!("In brackets: {BRACKETS}.\n"));
        return if table.contains(") ") { table + &note } else { table };
    }
    markdown_table(&format!("ll{}", "r".repeat(lines[0].len() - 2)), &lines)
}

/// Returns a table in Markdown: its head, then rows; the columns are aligned to the left (`l`) or
/// to the right (`r`).
pub fn markdown_table(alignment: &str, rows: &[Vec<String>]) -> String {
    let line = |row: &Vec<String>| format!("| {} |\n", row.join(" | ")).replace("|  |", "| |");
    let rule: String = alignment.chars().map(|c| if c == 'r' { "---:|" } else { "---|" }).collect();
    let (head, rows) = rows.split_at(rows.len().min(1));
    let lines = |rows: &[Vec<String>]| rows.iter().map(line).collect::<String>();
    format!("{}|{rule}\n{}", lines(head), lines(rows))
}

impl JobRow {
    fn seeds(&self) -> usize {
        self.results.len() + self.missing.len()
    }
}

impl ReportColumn {
    fn values(&self, results: &[JobResult]) -> Vec<f64> {
        results.iter().filter_map(self.of).collect()
    }

    fn worst(&self, values: &[f64]) -> f64 {
        let is_error = self.title.starts_with("error") || self.title.starts_with("false");
        let worse = if is_error { f64::max } else { f64::min };
        values.iter().copied().reduce(worse).unwrap_or(f64::NAN)
    }

    fn cell(&self, results: &[JobResult]) -> String {
        let values = self.values(results);
        let text = match &values[..] {
            [value] => (self.format)(*value),
            all => format!("{} ({})", (self.format)(mean(all)), (self.format)(self.worst(all))),
        };
        of_some(text, values.len(), results.len())
    }
}

/// Adds how many seeds or maps a number is of, if not of all.
fn of_some(text: String, found: usize, all: usize) -> String {
    match found {
        0 => "-".to_owned(),
        _ if found < all => format!("{text} [{found}]"),
        _ => text,
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Returns the report on `rows`, whose pictures are in `folder`; `caption` is that of the learning
/// curves, if there are any.
pub fn report(rows: &[JobRow], folder: &Folder, caption: Option<&str>) -> String {
    let mut out = format!("# Suite\n\n{}\n\n{}", about(rows), table(rows, true));
    out += "\nIn the pictures, colours show the learned distance D to the goal (red), light \
            near and dark far, with contour lines; from the start (orange), the plan is light red and \
            the path walked orange.\n\nPlanned and alone are success rates along plans and by the actor \
            alone, straight that of walking straight at the goal; SPL is that of plans, weighted \
            by path length (Anderson et al. 2018). Errors are mean absolute relative errors of D, \
            of D up to 10 steps, and of the distance along the graph. False edges join places that \
            no path of about their length does.\n";
    if let Some(caption) = caption {
        out += &format!("\n![Learning curves]({CURVES})\n\nLearning curves: {caption}.\n");
    }
    let mut last = None;
    for row in rows {
        if last != Some(&row.map) {
            out += &format!("\n## {}\n", markdown(&row.map));
        }
        last = Some(&row.map);
        let size = row.about.fingerprint.as_ref().and_then(|facts| facts.split(", ").next());
        let size = size.map_or(String::new(), |size| format!("{size}, "));
        let updates = grouped(row.about.updates);
        let label = markdown(&row.label);
        let set: String = row.about.settings.iter().map(|set| format!(" {set}")).collect();
        let (preset, set) = (row.about.preset.name(), markdown(&set));
        out += &format!("\n### {label}\n\n{size}{updates} updates; preset {preset}{set}.\n");
        for result in &row.results {
            out += &format!("\n{}\n", section(result, folder));
        }
        for name in &row.missing {
            out += &format!("\n{}: no result yet.\n", markdown(name));
        }
    }
    out
}

fn about(rows: &[JobRow]) -> String {
    let seeds = || rows.iter().map(|row| row.seeds() as u64);
    let (least, most) = (seeds().min().unwrap_or(0), seeds().max().unwrap_or(0));
    let least = if least < most { format!("{least} to ") } else { String::new() };
    format!(
        "gdg-tui {}; {least}{} each, on tasks at six distances. Agents start at the map's `S`; on a map \
         without one, at one cell of its largest component that the seed draws; with \
         restart=anywhere, anywhere. In brackets: {BRACKETS}.",
        env!("CARGO_PKG_VERSION"),
        counted(most, "seed"),
    )
}

fn section(result: &JobResult, folder: &Folder) -> String {
    let number = |column: &ReportColumn| {
        Some(format!("{} {}", column.title, (column.format)((column.of)(result)?)))
    };
    let numbers = COLUMNS.iter().filter_map(number).collect::<Vec<_>>().join(", ");
    let text = format!("Seed {}: {numbers}; {:.0} s.", result.seed, result.seconds);
    let (name, picture) = (markdown(&result.name), picture_name(&result.name));
    if folder.path(&picture).is_file() { format!("![{name}]({picture})\n\n{text}") } else { text }
}
