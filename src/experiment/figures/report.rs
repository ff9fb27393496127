//! The report: every figure with the paper's results beside ours, in Markdown.

use super::MethodRuns;
use super::catalogue::{Budget, Figure, PUBLISHED_METHODS, Shows, published_on};
use super::drawn::{Drawn, Panel, last};
use crate::experiment::measure::RandomTasks;
use crate::experiment::plot::Line;
use crate::experiment::report::markdown_table;
use gdg::text::counted;

const BRIDGE_SEARCH: &str = "The published search, on one far task after another until there is a \
                             bridge point: b with D(s,b) + D(b,g) < D(s,g), among candidates that \
                             are at least a quarter of D(s,g) from either end.";

const MAPS: &str = "Blue: the start s; orange: the goal g; red: the bridge point b and the plan; \
                    white: the walk.\n";

const AT_THE_END: &str = "Ours: success rate at the end, all distances.";

const ARM: &str = "The paper's claim: with the distance |s - g| given, GDG (which learns f and \
                   mu) and DDPG (which regresses Q on -|s' - g|) converge alike. DDPG + HER with \
                   sparse rewards and GDG with a learned D are our additions.";

const RANDOM: &str = " Anywhere: from anywhere to anywhere; as in training: to goals drawn as in \
                      training (`near_goals`), like the 200 tasks of the paper's figure.";

const DATASETS: &str = "in the built-in maze, after learning from a million recorded transitions \
                        alone, on one core. Others: a million updates; GCIVL, QRL, CRL and HIQL \
                        as in OGBench (Park et al., \
                        [2410.20092](https://arxiv.org/abs/2410.20092)), TTGS as in \
                        [2510.07257](https://arxiv.org/abs/2510.07257), ALPS as in \
                        [2602.05031](https://arxiv.org/abs/2602.05031).";

const OF_PAPER: &str = " Success: the goal reached within 500 steps, with the arm within its episode \
                        of 50; methods that plan are evaluated with planning. Our maps are not the \
                        paper's, whose arrays are not published: the city's diameter is 240 \
                        steps from cell to cell, as the paper's; a point takes 226. \"-\": the paper gives no number.";

/// Returns the beginning of the report on figures called `names`, any of which is `of_paper`.
pub fn head(names: &[String], budget: Budget, of_paper: bool, missing: &[&str]) -> String {
    let (title, more) = if of_paper {
        ("\"Reinforcement Learning with Goal-Distance Gradient\", reproduced", OF_PAPER)
    } else {
        ("OGBench's point mazes", "")
    };
    let (version, names, budget) = (env!("CARGO_PKG_VERSION"), names.join(" "), budget.name());
    let mut out = format!(
        "# {title}\n\nMade by gdg-tui {version} with `gdg-tui reproduce {names} --budget {budget}`, \
         and what else the tables say of each run. Lines are means over seeds, bands reach from the \
         worst to the best seed.{more}\n"
    );
    if !missing.is_empty() {
        let (count, names) = (counted(missing.len() as u64, "job"), missing.join("`, `"));
        out += &format!("\n**Not complete**: {count} missing: `{names}`.\n");
    }
    out
}

pub fn section(figure: &Figure, methods: &[MethodRuns], drawn: &Drawn) -> String {
    let (name, title) = (figure.name, figure.title);
    let shown = match figure.shows {
        Shows::Bridge => format!("{BRIDGE_SEARCH} {MAPS}"),
        Shows::Paths => MAPS.to_owned(),
        _ => table(figure, methods, &drawn.panels),
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

/// What a column shows of a method, given its line in the first chart.
type Show = fn(&MethodRuns, &Line) -> String;

fn columns(figure: &Figure) -> &'static [(&'static str, Show)] {
    match figure.shows {
        Shows::DistanceLeft => {
            &[("reached at the end", reached_at_the_end), ("environment steps", steps)]
        }
        Shows::Success if figure.world != "fetch-reach" => &[
            ("anywhere", |method, _| random(method, |random| random.anywhere)),
            ("as in training", |method, _| random(method, |random| random.as_in_training)),
            ("environment steps", steps),
        ],
        Shows::Datasets => &[("seconds", |method, _| {
            numbers(&method.results.iter().map(|result| result.seconds).collect::<Vec<f64>>(), 0)
        })],
        _ => &[("environment steps", steps)],
    }
}

/// Returns the last values of a figure, beside the published ones.
fn table(figure: &Figure, methods: &[MethodRuns], panels: &[Panel]) -> String {
    let columns = columns(figure);
    let is_ogbench = figure.shows == Shows::Datasets;
    let about = match figure.shows {
        Shows::DistanceLeft => "Ours: left at the end.".to_owned(),
        Shows::SuccessByDistance => "Ours: at the largest distance.".to_owned(),
        Shows::Datasets => {
            let episodes = counted(methods[0].plan().last_tasks.into(), "episode");
            format!("Success in per cent, {episodes} of each of the five tasks, {DATASETS}")
        }
        _ if figure.world == "fetch-reach" => format!("{ARM}\n\n{AT_THE_END}"),
        _ => format!("{AT_THE_END}{RANDOM}"),
    };
    let published = if is_ogbench { &PUBLISHED_METHODS[..] } else { &["paper"] };
    let ours = panels.iter().map(|panel| format!("ours: {}", panel.labels[1]));
    let texts = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>();
    let mut head = texts(&["method"]);
    head.extend(texts(published).into_iter().chain(ours));
    head.extend(columns.iter().map(|(head, _)| (*head).to_owned()).chain(["run".to_owned()]));
    let mut rows = vec![head];
    for (i, method) in methods.iter().enumerate() {
        let mut row = texts(&[method.entry.title]);
        if is_ogbench {
            let success = published_on(method.entry.name).unwrap_or([None; _]);
            row.extend(success.map(|own| own.map_or("-".to_owned(), |own| own.to_string())));
        } else {
            let paper = figure.paper.iter().find(|(name, _)| *name == method.entry.name);
            row.push(paper.map_or("-", |(_, text)| text).to_owned());
        }
        row.extend(panels.iter().map(|panel| {
            let (times, digits) = match panel.top {
                Some(_) if is_ogbench => (100.0, 0),
                Some(_) => (1.0, 3),
                None => (1.0, 1),
            };
            let last = last(&panel.lines[i]).into_iter().map(|value| times * value);
            numbers(&last.collect::<Vec<f64>>(), digits)
        }));
        row.extend(columns.iter().map(|(_, show)| show(method, &panels[0].lines[i])));
        row.push(run(method));
        rows.push(row);
    }
    let alignment = format!("l{}l", "r".repeat(rows[0].len() - 2));
    format!("{about}\n\n{}", markdown_table(&alignment, &rows))
}

fn steps(method: &MethodRuns, _: &Line) -> String {
    let last = method.results.iter().filter_map(|result| result.evaluations.last());
    last.map(|at| at.env_steps).max().unwrap_or(0).to_string()
}

fn random(method: &MethodRuns, of: fn(&RandomTasks) -> f64) -> String {
    let measured = method.results.iter().filter_map(|result| result.measured.as_ref());
    let values = measured.filter_map(|measured| measured.random.as_ref().map(of));
    numbers(&values.collect::<Vec<f64>>(), 3)
}

fn reached_at_the_end(_: &MethodRuns, line: &Line) -> String {
    let left = last(line);
    let reached = left.iter().filter(|left| **left == 0.0).count();
    format!("{reached} of {}", counted(left.len() as u64, "seed"))
}
