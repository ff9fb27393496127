//! The report of a suite, in Markdown: the table, the learning curves, and a picture of every job.

use std::collections::BTreeSet;

use super::folder::{Folder, picture_name};
use super::job::JobResult;
use super::table::{self, Row};
use gdg::env::Restart;
use gdg::text::{counted, markdown};

/// File of the learning curves, beside their table.
pub const CURVES: &str = "success.svg";

/// Returns the report on `rows`, whose pictures are in `folder`; `caption` is that of the learning
/// curves, if there are any.
pub fn report(rows: &[Row], folder: &Folder, caption: Option<&str>) -> String {
    let mut out = format!("# Suite\n\n{}\n\n{}", about(rows), table::table(rows));
    out += "\nIn the pictures, colours show the learned distance D to the goal (orange), light \
            near and dark far, with contour lines; from the start (blue), the plan is red and the \
            path walked white.\n\nPlanned and greedy are success rates with plans and of the actor \
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
        out += &format!("\n### {}\n\n{}.\n", markdown(&row.label(rows)), size(row));
        let missing = |name: &&String| row.results.iter().all(|result| result.name != **name);
        for result in &row.results {
            out += &format!("\n{}\n", section(result, folder));
        }
        for name in row.jobs.iter().filter(missing) {
            out += &format!("\n{}: no result yet.\n", markdown(name));
        }
    }
    out
}

/// Describes what was run and where agents start.
fn about(rows: &[Row]) -> String {
    let names = |name: &dyn Fn(&Row) -> String| {
        let names: BTreeSet<String> = rows.iter().map(name).collect();
        names.into_iter().collect::<Vec<_>>().join(", ")
    };
    let common = |set: &&String| rows.iter().all(|row| row.settings.contains(set));
    let set: Vec<&str> = rows
        .first()
        .map_or(&[][..], |row| &row.settings)
        .iter()
        .filter(common)
        .map(String::as_str)
        .collect();
    let changed = if set.is_empty() { String::new() } else { format!(" with {}", set.join(" ")) };
    let seeds = rows.iter().map(|row| row.jobs.len().max(row.results.len())).max().unwrap_or(0);
    let mut starts = "Agents start at the map's `S`; on a map without one, at one cell of its \
                      largest component that the seed draws, and nowhere else"
        .to_owned();
    if rows.iter().any(starts_anywhere) {
        starts += "; with restart=anywhere, anywhere";
    }
    format!(
        "gdg-tui {}; methods: {}; presets: {}{changed}; {} each, on tasks at six distances. \
         {starts}. In brackets: the worst seed.",
        env!("CARGO_PKG_VERSION"),
        names(&|row| row.method.name()),
        names(&|row| row.preset.name().to_owned()),
        counted(seeds as u64, "seed"),
    )
}

fn starts_anywhere(row: &Row) -> bool {
    match row.settings.iter().find_map(|set| set.strip_prefix("restart=")) {
        Some(restart) => restart == "anywhere",
        None => row.preset.settings().train.restart == Restart::Anywhere,
    }
}

fn size(row: &Row) -> String {
    let size = row.size.map_or(String::new(), |(width, height)| format!("{width} x {height}, "));
    format!("{size}{} free cells, {} updates", row.free_cells, row.updates)
}

/// Returns a job's picture and numbers.
fn section(result: &JobResult, folder: &Folder) -> String {
    let (picture, numbers) = (picture_name(&result.name), table::numbers(result));
    let shown = if folder.path(&picture).is_file() {
        format!("![{}]({picture})\n\n", markdown(&result.name))
    } else {
        let again = "delete the file of its result and run this again to draw it";
        format!("({} is missing: {again}.)\n\n", markdown(&picture))
    };
    let starts = result.map.iter().flat_map(|map| &map.starts);
    let starts: Vec<String> = starts.map(|[x, y]| format!("({x}, {y})")).collect();
    let drawn =
        if result.map.as_ref().is_some_and(|map| map.start_drawn) { " (drawn)" } else { "" };
    format!(
        "{shown}Seed {}, start {}{drawn}: {numbers}; {:.0} s.",
        result.seed,
        starts.join(" "),
        result.seconds
    )
}
