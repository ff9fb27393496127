//! The report of a suite, in Markdown: the table, and a picture and the learning curves of every
//! job.

use super::folder::{Folder, picture_name};
use super::job::{Job, JobResult};
use super::table::{self, Row};
use gdg::env::Restart;
use gdg::text::{counted, markdown};
use gdg::train::Evaluation;

/// Heights of a sparkline, from 0 to 1.
const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Returns the report on `groups`, the jobs of each map, whose results make up `rows`.
pub fn report(groups: &[Vec<Job>], rows: &[Row], folder: &Folder) -> String {
    let mut out = format!("# Suite\n\n{}\n\n{}", about(groups), table::table(rows));
    out += "\nIn the pictures, colours show the learned distance D to the goal (orange), light \
            near and dark far, with contour lines; from the start (blue), the plan is red and the \
            path walked white.\n\nPlanned and greedy are success rates with plans and of the actor \
            alone, straight that of walking straight at the goal; SPL is that of plans, weighted \
            by path length (Anderson et al. 2018). Errors are mean absolute relative errors of D, \
            of D up to 10 steps, and of the distance along the graph. False edges join places that \
            no path of about their length does.\n";
    for (group, row) in groups.iter().zip(rows) {
        out += &format!("\n## {}\n\n{}.\n", markdown(&row.map), size(group));
        for job in group {
            let result = row.results.iter().find(|result| result.key == job.key);
            out += &format!(
                "\n{}\n",
                result.map_or(format!("{}: no result yet.", markdown(&job.name)), |r| section(
                    job, r, folder
                ))
            );
        }
    }
    out
}

/// Describes what was run and where agents start.
fn about(groups: &[Vec<Job>]) -> String {
    let Some(first) = groups.iter().flatten().next() else { return String::new() };
    let seeds = groups.iter().map(Vec::len).max().unwrap_or(0);
    let set = first.changed_settings();
    let changed = if set.is_empty() { String::new() } else { format!(" with {}", set.join(" ")) };
    let tasks = counted(first.plan.eval_tasks.into(), "task");
    let starts = match first.run.settings.train.restart {
        Restart::Anywhere => "Agents start anywhere (restart=anywhere).",
        Restart::Auto | Restart::StartCell | Restart::Never => {
            "Agents start at the map's `S`; on a map without one, at one cell of its largest \
             component that the seed draws, and nowhere else."
        }
    };
    format!(
        "gdg-tui {}, method {}, preset {}{changed}; {}, {tasks} at each of six distances. \
         {starts} In brackets: the worst seed.",
        env!("CARGO_PKG_VERSION"),
        first.run.method,
        first.run.preset.name(),
        counted(seeds as u64, "seed"),
    )
}

fn size(group: &[Job]) -> String {
    let Some((job, map)) = group.first().and_then(|job| Some((job, job.world.map()?))) else {
        return String::new();
    };
    format!(
        "{} x {}, {} free cells, {} updates",
        map.width(),
        map.height(),
        map.free_count(),
        job.plan.length.amount()
    )
}

/// Returns a job's picture, numbers and learning curves.
fn section(job: &Job, result: &JobResult, folder: &Folder) -> String {
    let (picture, numbers) = (picture_name(job), table::numbers(result));
    let shown = if folder.path(&picture).is_file() {
        format!("![{}]({picture})\n\n", markdown(&job.name))
    } else {
        let again = "delete the file of its result and run this again to draw it";
        format!("({} is missing: {again}.)\n\n", markdown(&picture))
    };
    let starts = result.map.iter().flat_map(|map| &map.starts);
    let starts: Vec<String> = starts.map(|[x, y]| format!("({x}, {y})")).collect();
    let drawn =
        if result.map.as_ref().is_some_and(|map| map.start_drawn) { " (drawn)" } else { "" };
    let curve = |name: &str, of: &dyn Fn(&Evaluation) -> Option<f64>| {
        let values: Vec<Option<f64>> =
            result.evaluations.iter().map(|at| of(&at.evaluation)).collect();
        let known = values.iter().any(Option::is_some);
        known.then(|| format!("{name} `{}`", values.into_iter().map(spark).collect::<String>()))
    };
    let curves = [
        curve("coverage", &|e| e.coverage),
        curve("planned", &|e| e.planned.as_ref()?.success),
        curve("greedy", &|e| e.greedy.success),
    ];
    let curves: Vec<String> = curves.into_iter().flatten().collect();
    format!(
        "{shown}Seed {}, start {}{drawn}: {numbers}; {:.0} s.\n\n{}",
        job.run.seed,
        starts.join(" "),
        result.seconds,
        curves.join(", ")
    )
}

/// Returns a share as a bar.
fn spark(share: Option<f64>) -> char {
    share.map_or(' ', |share| LEVELS[((share.clamp(0.0, 1.0) * 8.0) as usize).min(7)])
}
