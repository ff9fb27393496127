//! The report: every figure with the paper's results beside ours, in Markdown.

use super::MethodResults;
use super::curves::{Curve, Panel, Point, least, stays_at};
use super::datasets::{PUBLISHED_METHODS, published_on};
use super::figures::{Figure, Shows};
use super::output::{Drawn, paths_file};
use crate::experiment::measure::{Measured, RandomTasks};
use crate::experiment::plan::Length;
use gdg::text::counted;

/// How the bridge point of Figure 2 is found.
const BRIDGE_SEARCH: &str = "The published search, on one far task after another until there is a \
                             bridge point: b with D(s,b) + D(b,g) < D(s,g), among candidates that \
                             are at least a quarter of D(s,g) from either end.";

/// What the numbers of figures over training are.
const AT_THE_END: &str = "success rate at the end, all distances";

/// What Figure 1 compares.
const ARM: &str = "The paper's claim: with the distance |s - g| given, GDG (which learns f and \
                   mu) and DDPG (which regresses Q on -|s' - g|) converge alike. DDPG + HER with \
                   sparse rewards and GDG with a learned D are our additions.";

/// What is seen in the picture of the arm's grip.
const GRIP: &str = "The arm starts on one side of the wall, the goal is on the other. Below, the \
                    grip's path (dark blue) in one evaluation task, the same for both methods, \
                    from the start (light blue) to within 5 cm of the goal (orange circle), after \
                    training with the first seed: from behind the robot with the table below, and \
                    from above. Red: the plan, with its waypoints.";

/// What the columns of Figure 3 are.
const RANDOM: &str = " Anywhere: from anywhere to anywhere; as in training: to goals drawn as in \
                      training (`near_goals`), like the 200 tasks of the paper's figure.";

/// How datasets are learned from, and where the numbers of others come from.
const DATASETS: &str = "in the built-in maze, after learning from a million recorded transitions \
                        alone, on one core. Others: a million updates; GCIVL, QRL, CRL and HIQL \
                        as in OGBench (Park et al., \
                        [2410.20092](https://arxiv.org/abs/2410.20092)), TTGS as in \
                        [2510.07257](https://arxiv.org/abs/2510.07257), ALPS as in \
                        [2602.05031](https://arxiv.org/abs/2602.05031).";

/// How the paper's figures were made.
const OF_PAPER: &str = " Success: the goal reached within 500 steps, with the arm within its episode \
                        of 50; methods that plan are evaluated with planning. Our maps are not the \
                        paper's, whose arrays are not published: the city's diameter is 240 \
                        steps from cell to cell, as the paper's; a point takes 226. \"-\": the paper gives no number.";

/// Returns the report, with the sections of all figures, any of which is `of_paper`.
pub fn report(
    arguments: &str,
    of_paper: bool,
    sections: &[String],
    missing: &[String],
    unavailable: &[&str],
) -> String {
    let (title, more) = if of_paper {
        ("\"Reinforcement Learning with Goal-Distance Gradient\", reproduced", OF_PAPER)
    } else {
        ("OGBench's point mazes", "")
    };
    let mut out = format!(
        "# {title}\n\nMade by gdg-tui {} with\n\n```sh\ngdg-tui {arguments}\n```\n\nLines are means \
         over seeds, bands reach from the worst to the best seed.{more}\n",
        env!("CARGO_PKG_VERSION")
    );
    if !unavailable.is_empty() {
        let names = unavailable.join(", ");
        out += &format!("\nLeft out, as this build has no such learner: {names}.\n");
    }
    if !missing.is_empty() {
        let missing: Vec<String> = missing.iter().map(|name| format!("`{name}`")).collect();
        out += &format!(
            "\n**Not complete**: {} missing: {}.\n",
            counted(missing.len() as u64, "job"),
            missing.join(", ")
        );
    }
    sections.iter().for_each(|section| out += section);
    out
}

/// Returns a figure's section.
pub fn section(figure: &Figure, methods: &[MethodResults], drawn: &Drawn) -> String {
    let (name, title) = (figure.name, figure.title);
    let mut out = format!(
        "\n## {name}: {title}\n\n![{title}](figures/{name}.png)\n\n[SVG](figures/{name}.svg), \
         [JSON](data/{name}.json), [CSV](data/{name}.csv)\n\n"
    );
    out += &match figure.shows {
        Shows::Success => training_table(figure, methods, &drawn.panels, AT_THE_END),
        Shows::CompleteSuccess => {
            format!("{ARM}\n\n{}", training_table(figure, methods, &drawn.panels, AT_THE_END))
        }
        Shows::CompleteSuccessAndGripPath => {
            let table = training_table(figure, methods, &drawn.panels, AT_THE_END);
            format!("Paths: [CSV](data/{}).\n\n{GRIP}\n\n{table}", paths_file(name))
        }
        Shows::DistanceLeft => training_table(figure, methods, &drawn.panels, "left at the end"),
        Shows::SuccessByDistance => distance_table(methods, &drawn.panels),
        Shows::Bridge => format!("{BRIDGE_SEARCH}\n\n{}", maps_table(drawn)),
        Shows::Paths => maps_table(drawn),
        Shows::Datasets => datasets_table(methods, &drawn.panels),
    };
    out
}

/// Formats the mean, and the range if there are several seeds.
fn numbers(point: Option<&Point>, digits: usize) -> String {
    let Some(point) = point else { return "-".to_owned() };
    let (least, most) = point.range();
    let mean = format!("{:.digits$}", point.mean());
    if point.values.len() == 1 {
        mean
    } else {
        format!("{mean} ({least:.digits$} to {most:.digits$})")
    }
}

/// Returns how a method was run: learner and planner, preset, changed settings, length, seeds.
fn run(method: &MethodResults) -> String {
    let settings = method.results.first().map_or(String::new(), |result| {
        result.settings.iter().map(|setting| format!(" `{setting}`")).collect::<String>()
    });
    let length = match method.plan.length {
        Length::Updates(updates) => counted(updates, "update"),
        Length::Episodes(episodes) => counted(episodes, "episode"),
        Length::Steps(steps) => counted(steps, "environment step"),
    };
    let (name, preset, seeds) = (method.entry.method(), method.entry.preset, method.results.len());
    format!("{name}, preset {preset}{settings}; {length}, {}", counted(seeds as u64, "seed"))
}

/// A column besides the last values.
struct Column {
    head: String,
    of: ColumnOf,
}

/// What a column shows of a method.
enum ColumnOf {
    /// A summary of the whole curve of its first measure.
    Curve(fn(&Curve) -> String),
    /// Success on tasks drawn at random at the end.
    Random(fn(&RandomTasks) -> f64),
}

/// Returns the seeds of a method's jobs, and what was measured at their ends.
fn measured(method: &MethodResults) -> impl Iterator<Item = (u64, &Measured)> {
    method.results.iter().filter_map(|result| Some((result.seed, result.measured.as_ref()?)))
}

/// Returns the columns that a figure has besides the last values, and what they need to be said.
fn columns(figure: &Figure, panels: &[Panel]) -> (Vec<Column>, &'static str) {
    let axis = panels.first().map_or("", |panel| panel.labels[0]);
    match figure.shows {
        Shows::CompleteSuccess | Shows::CompleteSuccessAndGripPath => (
            vec![Column {
                head: format!("1.00 from ({axis})"),
                of: ColumnOf::Curve(complete_from),
            }],
            " 1.00 from: the first evaluation from which on all are 1.00.",
        ),
        Shows::DistanceLeft => (
            vec![
                Column {
                    head: "reached at the end".to_owned(),
                    of: ColumnOf::Curve(reached_at_the_end),
                },
                Column { head: "least steps left".to_owned(), of: ColumnOf::Curve(least_left) },
            ],
            " Least: of all evaluations, a walk each; 0 if one reaches the goal.",
        ),
        Shows::Success => (
            vec![
                Column { head: "anywhere".to_owned(), of: ColumnOf::Random(|r| r.anywhere) },
                Column {
                    head: "as in training".to_owned(),
                    of: ColumnOf::Random(|r| r.as_in_training),
                },
            ],
            RANDOM,
        ),
        _ => (Vec::new(), ""),
    }
}

/// Returns the last values of every method, beside the paper's.
fn training_table(
    figure: &Figure,
    methods: &[MethodResults],
    panels: &[Panel],
    what: &str,
) -> String {
    let digits = |panel: &Panel| if panel.top.is_some() { 3 } else { 1 };
    let titles: Vec<&str> = panels.iter().map(|panel| panel.labels[1]).collect();
    let (columns, note) = columns(figure, panels);
    let heads: String = columns.iter().map(|column| format!("{} | ", column.head)).collect();
    let mut out = format!(
        "| method | paper | ours: {} | {heads}environment steps | run |\n|---|---|{}---:|---|\n",
        titles.join(" | ours: "),
        "---:|".repeat(panels.len() + columns.len())
    );
    for method in methods {
        let paper = figure
            .paper
            .iter()
            .find(|(name, _)| *name == method.entry.name)
            .map_or("-", |(_, text)| text);
        let last =
            |panel| numbers(curve_of(method, panel).and_then(|c| c.points.last()), digits(panel));
        let values: Vec<String> = panels.iter().map(last).collect();
        let steps = measured(method).map(|(_, measured)| measured.env_steps).max().unwrap_or(0);
        let (title, run) = (method.entry.title, run(method));
        let curve = panels.first().and_then(|panel| curve_of(method, panel));
        let of = |column: &Column| match column.of {
            ColumnOf::Curve(of) => curve.map_or("-".to_owned(), of),
            ColumnOf::Random(of) => {
                let value = |(seed, m): (u64, &Measured)| Some((seed, of(&m.random?)));
                let values: Vec<_> = measured(method).filter_map(value).collect();
                numbers(Some(&Point { x: 0, values }).filter(|point| !point.values.is_empty()), 3)
            }
        };
        let sums: String = columns.iter().map(|column| format!("{} | ", of(column))).collect();
        out += &format!("| {title} | {paper} | {} | {sums}{steps} | {run} |\n", values.join(" | "));
    }
    format!("Ours: {what}.{note}\n\n{out}")
}

/// Returns the curve of a method.
fn curve_of<'a>(method: &MethodResults, panel: &'a Panel) -> Option<&'a Curve> {
    panel.curves.iter().find(|curve| curve.entry.name == method.entry.name)
}

/// Returns how many seeds have no steps left at the end.
fn reached_at_the_end(curve: &Curve) -> String {
    let left = curve.points.last().map_or(&[][..], |point| &point.values);
    let reached = left.iter().filter(|(_, left)| *left == 0.0).count();
    format!("{reached} of {}", counted(left.len() as u64, "seed"))
}

/// Returns the fewest steps left at any evaluation.
fn least_left(curve: &Curve) -> String {
    numbers(Some(&least(curve)).filter(|point| !point.values.is_empty()), 1)
}

/// Returns from where on success stays at 1, for the earliest and the latest seed.
fn complete_from(curve: &Curve) -> String {
    let from = stays_at(curve, 1.0);
    let places: Vec<u64> = from.values().flatten().copied().collect();
    let (Some(first), Some(last)) = (places.iter().min(), places.iter().max()) else {
        return "-".to_owned();
    };
    let range = if first == last { first.to_string() } else { format!("{first} to {last}") };
    if places.len() == from.len() {
        range
    } else {
        format!("{range} ({} of {} seeds)", places.len(), from.len())
    }
}

/// Returns success in per cent on every dataset, beside the published one.
fn datasets_table(methods: &[MethodResults], panels: &[Panel]) -> String {
    let episodes = methods.first().map_or(0, |method| method.plan.last_tasks);
    let mut out = format!(
        "Success in per cent, {} of each of the five tasks, {DATASETS}\n\n| dataset | {} | **ours, planned** | ours, actor alone | seconds | run \
         |\n|---|{}---|\n",
        counted(episodes.into(), "episode"),
        PUBLISHED_METHODS.join(" | "),
        "---:|".repeat(PUBLISHED_METHODS.len() + 3)
    );
    for method in methods {
        let name = method.entry.name;
        let success = published_on(name).map_or([None; _], |published| published.success);
        let published = success.map(|success| success.map_or("-".to_owned(), |s| s.to_string()));
        let ours = panels.iter().map(|panel| {
            let curve = panel.curves.iter().find(|curve| curve.entry.name == name);
            numbers(curve.and_then(|curve| curve.points.last()).map(Point::in_percent).as_ref(), 0)
        });
        let seconds = method.results.iter().map(|result| (result.seed, result.seconds)).collect();
        out += &format!(
            "| {name} | {} | {} | {} | {} |\n",
            published.join(" | "),
            ours.collect::<Vec<_>>().join(" | "),
            numbers(Some(&Point { x: 0, values: seconds }), 0),
            run(method)
        );
    }
    out
}

/// Returns success at every distance.
fn distance_table(methods: &[MethodResults], panels: &[Panel]) -> String {
    let Some(panel) = panels.first() else { return String::new() };
    let mut distances: Vec<u64> =
        panel.curves.iter().flat_map(|c| &c.points).map(|point| point.x).collect();
    distances.sort_unstable();
    distances.dedup();
    let head: String = distances.iter().map(|steps| format!(" {steps} steps |")).collect();
    let tasks = methods.first().map_or(0, |method| method.plan.last_tasks);
    let mut out = format!(
        "Ours, {} at each distance:\n\n| method |{head}\n|---|",
        counted(tasks.into(), "task")
    );
    out += &("---:|".repeat(distances.len()) + "\n");
    for curve in &panel.curves {
        let at = |x: &u64| numbers(curve.points.iter().find(|point| point.x == *x), 2);
        let values: Vec<String> = distances.iter().map(at).collect();
        out += &format!("| {} | {} |\n", curve.entry.title, values.join(" | "));
    }
    out
}

/// Returns the numbers below every map.
fn maps_table(drawn: &Drawn) -> String {
    let mut out =
        "Blue: the start s; orange: the goal g; red: the bridge point b and the plan.\n\n| map | \
         |\n|---|---|\n"
            .to_owned();
    for panel in drawn.maps.iter().flatten() {
        out += &format!("| {} | {} |\n", panel.title, panel.caption);
    }
    out
}
