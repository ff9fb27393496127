//! The report: every figure with the paper's results beside ours, in Markdown.

use super::MethodRuns;
use super::catalogue::{Figure, Shows};
use super::curves::{Curve, Panel};

use super::maps::MapPanel;
use super::ogbench::{PUBLISHED_METHODS, published_on};
use super::output::Drawn;
use crate::experiment::measure::RandomTasks;
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

/// Returns the beginning of the report on figures, any of which is `of_paper`.
pub fn head(arguments: &str, of_paper: bool, missing: &[&str], unavailable: &[&str]) -> String {
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
        let (count, names) = (counted(missing.len() as u64, "job"), missing.join("`, `"));
        out += &format!("\n**Not complete**: {count} missing: `{names}`.\n");
    }
    out
}

pub fn section(figure: &Figure, methods: &[MethodRuns], drawn: &Drawn) -> String {
    let (name, title) = (figure.name, figure.title);
    let training = |what| training_table(figure, methods, &drawn.panels, what);
    let shown = match figure.shows {
        Shows::Success => training(AT_THE_END),
        Shows::CompleteSuccess => format!("{ARM}\n\n{}", training(AT_THE_END)),
        Shows::DistanceLeft => training("left at the end"),
        Shows::SuccessByDistance => distance_table(methods, &drawn.panels[0]),
        Shows::Bridge => format!("{BRIDGE_SEARCH}\n\n{}", maps_table(drawn)),
        Shows::Paths => maps_table(drawn),
        Shows::Datasets => datasets_table(methods, &drawn.panels),
    };
    format!(
        "\n## {name}: {title}\n\n![{title}](figures/{name}.png)\n\n[SVG](figures/{name}.svg), \
         [CSV](data/{name}.csv)\n\n{shown}"
    )
}

/// Formats the mean, and the range if there are several seeds.
fn numbers(values: &[f64], digits: usize) -> String {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    match values {
        [] => "-".to_owned(),
        [value] => format!("{value:.digits$}"),
        _ => format!("{mean:.digits$} ({least:.digits$} to {most:.digits$})"),
    }
}

/// Returns how a method was run: learner and planner, preset, changed settings, length, seeds.
fn run(method: &MethodRuns) -> String {
    let settings = method.results.first().map_or(String::new(), |result| {
        result.settings.iter().map(|setting| format!(" `{setting}`")).collect::<String>()
    });
    let length = method.plan().length;
    let length = counted(length.amount(), length.unit().trim_end_matches('s'));
    let (name, preset, seeds) = (method.entry.method(), method.entry.preset, method.results.len());
    format!("{name}, preset {preset}{settings}; {length}, {}", counted(seeds as u64, "seed"))
}

/// A column besides the last values: its head, and what it shows of a method.
type Column = (String, Show);

enum Show {
    /// A summary of the whole curve of the first measure.
    Curve(fn(&Curve) -> String),
    /// Success on tasks drawn at random at the end.
    Random(fn(&RandomTasks) -> f64),
}

/// Returns the columns that a figure has besides the last values, and what they need to be said.
fn columns(figure: &Figure, axis: &str) -> (Vec<Column>, &'static str) {
    match figure.shows {
        Shows::CompleteSuccess => (
            vec![(format!("1.00 from ({axis})"), Show::Curve(complete_from))],
            " 1.00 from: the first evaluation from which on all are 1.00.",
        ),
        Shows::DistanceLeft => (
            vec![
                ("reached at the end".to_owned(), Show::Curve(reached_at_the_end)),
                ("least steps left".to_owned(), Show::Curve(|curve| numbers(&curve.least(), 1))),
            ],
            " Least: of all evaluations, a walk each; 0 if one reaches the goal.",
        ),
        Shows::Success => (
            vec![
                ("anywhere".to_owned(), Show::Random(|random| random.anywhere)),
                ("as in training".to_owned(), Show::Random(|random| random.as_in_training)),
            ],
            RANDOM,
        ),
        _ => (Vec::new(), ""),
    }
}

fn training_table(figure: &Figure, methods: &[MethodRuns], panels: &[Panel], what: &str) -> String {
    let titles: Vec<&str> = panels.iter().map(|panel| panel.labels[1]).collect();
    let (columns, note) = columns(figure, panels[0].labels[0]);
    let heads: String = columns.iter().map(|(head, _)| format!("{head} | ")).collect();
    let mut out = format!(
        "Ours: {what}.{note}\n\n| method | paper | ours: {} | {heads}environment steps | run |\n\
         |---|---|{}---:|---|\n",
        titles.join(" | ours: "),
        "---:|".repeat(panels.len() + columns.len())
    );
    for method in methods {
        let paper = figure.paper.iter().find(|(name, _)| *name == method.entry.name);
        let paper = paper.map_or("-", |(_, text)| text);
        let last = |panel: &Panel| {
            let digits = if panel.top.is_some() { 3 } else { 1 };
            panel.curve_of(method).map_or("-".to_owned(), |curve| numbers(&curve.last(), digits))
        };
        let values: Vec<String> = panels.iter().map(last).collect();
        let measured = || method.results.iter().filter_map(|result| result.measured.as_ref());
        let steps = measured().map(|measured| measured.env_steps).max().unwrap_or(0);
        let of = |(_, show): &Column| match show {
            Show::Curve(of) => panels[0].curve_of(method).map_or("-".to_owned(), of),
            Show::Random(of) => {
                let values = measured().filter_map(|measured| measured.random.as_ref().map(of));
                numbers(&values.collect::<Vec<f64>>(), 3)
            }
        };
        let sums: String = columns.iter().map(|column| format!("{} | ", of(column))).collect();
        let (title, run) = (method.entry.title, run(method));
        out += &format!("| {title} | {paper} | {} | {sums}{steps} | {run} |\n", values.join(" | "));
    }
    out
}

fn reached_at_the_end(curve: &Curve) -> String {
    let left = curve.last();
    let reached = left.iter().filter(|left| **left == 0.0).count();
    format!("{reached} of {}", counted(left.len() as u64, "seed"))
}

/// Returns from where on success stays at 1, for the earliest and the latest seed.
fn complete_from(curve: &Curve) -> String {
    let from = curve.stays_at(1.0);
    let mut places: Vec<f64> = from.iter().flatten().copied().collect();
    places.sort_by(f64::total_cmp);
    let range = match places[..] {
        [] => return "-".to_owned(),
        [first, .., last] if first < last => format!("{first} to {last}"),
        [first, ..] => first.to_string(),
    };
    match (places.len(), from.len()) {
        (some, all) if some < all => format!("{range} ({some} of {all} seeds)"),
        _ => range,
    }
}

/// Returns success in per cent on every dataset, beside the published one.
fn datasets_table(methods: &[MethodRuns], panels: &[Panel]) -> String {
    let mut out = format!(
        "Success in per cent, {} of each of the five tasks, {DATASETS}\n\n| dataset | {} | **ours, planned** | ours, actor alone | seconds | run \
         |\n|---|{}---|\n",
        counted(methods[0].plan().last_tasks.into(), "episode"),
        PUBLISHED_METHODS.join(" | "),
        "---:|".repeat(PUBLISHED_METHODS.len() + 3)
    );
    for method in methods {
        let name = method.entry.name;
        let published = published_on(name).unwrap_or([None; _]);
        let published = published.map(|success| success.map_or("-".to_owned(), |s| s.to_string()));
        let ours = panels.iter().map(|panel| {
            let last = panel.curve_of(method).map_or(Vec::new(), Curve::last);
            numbers(&last.iter().map(|share| 100.0 * share).collect::<Vec<f64>>(), 0)
        });
        let ours = ours.collect::<Vec<_>>().join(" | ");
        let seconds: Vec<f64> = method.results.iter().map(|result| result.seconds).collect();
        let seconds = numbers(&seconds, 0);
        let (published, run) = (published.join(" | "), run(method));
        out += &format!("| {name} | {published} | {ours} | {seconds} | {run} |\n");
    }
    out
}

fn distance_table(methods: &[MethodRuns], panel: &Panel) -> String {
    let points = panel.curves.iter().flat_map(|curve| curve.seeds.values().flatten());
    let mut distances: Vec<f64> = points.map(|point| point.0).collect();
    distances.sort_by(f64::total_cmp);
    distances.dedup();
    let head: String = distances.iter().map(|steps| format!(" {steps} steps |")).collect();
    let tasks = counted(methods[0].plan().last_tasks.into(), "task");
    let mut out = format!("Ours, {tasks} at each distance:\n\n| method |{head}\n|---|");
    out += &("---:|".repeat(distances.len()) + "\n");
    for curve in &panel.curves {
        let at = |x: &f64| {
            let points = curve.seeds.values().flatten().filter(|point| point.0 == *x);
            numbers(&points.map(|point| point.1).collect::<Vec<f64>>(), 2)
        };
        let values: Vec<String> = distances.iter().map(at).collect();
        out += &format!("| {} | {} |\n", curve.entry.title, values.join(" | "));
    }
    out
}

fn maps_table(drawn: &Drawn) -> String {
    let line = |panel: &MapPanel| format!("| {} | {} |\n", panel.title, panel.caption);
    let lines: String = drawn.maps.iter().flatten().map(line).collect();
    "Blue: the start s; orange: the goal g; red: the bridge point b and the plan.\n\n| map | \
     |\n|---|---|\n"
        .to_owned()
        + &lines
}
