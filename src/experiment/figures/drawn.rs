//! What a figure shows: charts of methods over seeds (Figures 1, 3, 4 and 6), or rows of maps with
//! distances, plans and paths (Figures 2 and 5); as data, as drawings, and in the report, with the
//! paper's results beside ours.

use clap::ValueEnum;
use miette::Report;

use super::MethodRuns;
use super::catalogue::{Budget, Figure, PUBLISHED_METHODS, Shows, published_on};
use crate::experiment::folder::Folder;
use crate::experiment::measure::{BridgeTrial, RandomTasks, Walked, draw_walk, field};
use crate::experiment::plot::{
    Drawable, PAGE, Points, SeedCurves, XAxis, csv_of, table, write_unless_edited,
};
use crate::experiment::report::markdown_table;
use crate::experiment::spec::JobResult;
use crate::figure::{Anchor, Chart, ChartPage, MILLIMETRE, Mark, Sheet, fitted, round_top};
use gdg::draw::{Picture, Raster, Rgb, WALL};
use gdg::map::{Cell, Grid, builtin};
use gdg::text::counted;
use gdg::train::{DistanceScore, Evaluation, TaskOutcome};

fn walks_csv(methods: &[MethodRuns]) -> Result<Vec<u8>, Report> {
    let mut lines = Vec::new();
    for method in methods {
        let Some(result) = method.results.first() else { continue };
        let Some(measured) = &result.measured else { continue };
        let walks = measured.walks.iter().chain(measured.bridge.iter().map(|bridge| &bridge.walk));
        for Walked { distance, reached, path, .. } in walks {
            let line = |(step, [x, y]): (usize, &[f32; 2])| {
                (method.entry.name, result.seed, *distance, *reached, step, *x, *y)
            };
            lines.extend(path.iter().enumerate().map(line));
        }
    }
    csv_of(&["method", "seed", "distance", "reached", "step", "x", "y"], lines)
}

struct FigurePanel {
    labels: [&'static str; 2],
    /// Upper end of the vertical axis, if it is fixed.
    top: Option<f64>,
    lines: Vec<SeedCurves>,
}

impl FigurePanel {
    fn chart(&self) -> Chart {
        let points = || self.lines.iter().flat_map(|line| line.seeds.values().flatten());
        let x = [0.0, points().map(|point| point.0).fold(1.0, f64::max)];
        Chart {
            title: String::new(),
            labels: self.labels.map(str::to_owned),
            x,
            top: self.top.unwrap_or_else(|| round_top(points().map(|point| point.1))),
            curves: self.lines.iter().map(|line| line.curve(x)).collect(),
        }
    }
}

fn last(line: &SeedCurves) -> Vec<f64> {
    line.seeds.values().filter_map(|points| Some(points.last()?.1)).collect()
}

/// Returns the charts of a figure, if it shows curves. Methods are compared over what they were
/// allowed to experience, or, where that is the same recorded data, over updates.
fn panels(figure: &Figure, methods: &[MethodRuns]) -> Vec<FigurePanel> {
    let over = if figure.shows == Shows::Datasets { XAxis::Updates } else { XAxis::Steps };
    let panel = |chart: &str, labels, top, points: &dyn Fn(&JobResult) -> Points| {
        let line = |(marker, method): (usize, &MethodRuns)| SeedCurves {
            chart: chart.to_owned(),
            name: method.entry.title.to_owned(),
            colour: method.entry.colour,
            marker,
            seeds: method.results.iter().map(|result| (result.seed, points(result))).collect(),
        };
        FigurePanel { labels, top, lines: methods.iter().enumerate().map(line).collect() }
    };
    let training = |chart, label, top, of: fn(&Evaluation) -> Option<f64>| {
        let points = |result: &JobResult| -> Points {
            let all = result.evaluations.iter();
            all.filter_map(|at| Some((over.of(at), of(&at.evaluation)?))).collect()
        };
        panel(chart, [over.label(), label], top, &points)
    };
    match figure.shows {
        Shows::Success => {
            vec![training("success", "success rate", Some(1.0), Evaluation::success_rate)]
        }
        Shows::SuccessByDistance => {
            let labels = ["steps from start to goal", "success rate"];
            vec![panel("success", labels, Some(1.0), &by_distance)]
        }
        Shows::DistanceLeft => vec![
            training("steps left", "steps left to the goal", None, |e| {
                marked(e)?.left_steps.map(f64::from)
            }),
            training("straight line left", "straight line left (cells)", None, |e| {
                marked(e)?.left_straight.map(f64::from)
            }),
        ],
        Shows::Datasets => vec![
            training("planned", "success rate, planned", Some(1.0), |e| {
                e.planned.as_ref()?.success
            }),
            training("alone", "success rate, alone", Some(1.0), |e| e.alone.success),
        ],
        Shows::Bridge | Shows::Paths => Vec::new(),
    }
}

fn marked(evaluation: &Evaluation) -> Option<TaskOutcome> {
    let marked = evaluation.marked?;
    Some(marked.planned.unwrap_or(marked.alone))
}

fn by_distance(result: &JobResult) -> Points {
    let Some(last) = result.last() else { return Vec::new() };
    let score = last.planned.as_ref().unwrap_or(&last.alone);
    let of = |d: &DistanceScore| Some((d.distance()?.0.round(), d.success?));
    score.by_distance.iter().filter_map(of).collect()
}

/// Pixels along the longer side of a map, at most.
const MAP_PIXELS: usize = 660;

const FLOOR: Rgb = (150, 154, 160);

const CHART: f32 = 130.0 * MILLIMETRE;

/// Between maps, and size of the letters around them.
const MARGIN: f32 = 6.0;
const LETTERS: f32 = 7.0;

/// The longest side of a map, in points.
const MAP: f32 = 160.0;

struct MapPanel {
    title: String,
    caption: String,
    picture: Picture,
}

fn rows(figure: &Figure, methods: &[MethodRuns]) -> Vec<Vec<MapPanel>> {
    let Some(map) = builtin(figure.world) else { return Vec::new() };
    let row = |method: &MethodRuns| {
        let measured = method.results.first()?.measured.as_ref()?;
        let title = method.entry.title;
        match figure.shows {
            Shows::Bridge => Some(bridge_row(&map, title, measured.bridge.as_ref()?)),
            Shows::Paths => {
                Some(measured.walks.iter().map(|walk| path_panel(&map, title, walk)).collect())
            }
            _ => None,
        }
    };
    methods.iter().filter_map(row).collect()
}

fn walk_caption(walk: &Walked) -> String {
    let end = if walk.reached { "reached in" } else { "not reached within" };
    format!("shortest {}; {end} {}", walk.shortest, walk.path.len().saturating_sub(1))
}

/// Returns the four panels of Figure 2: D(s,.), D(.,g), their sum with the bridge point, and the
/// plan with the walk.
fn bridge_row(map: &Grid, title: &str, bridge: &BridgeTrial) -> Vec<MapPanel> {
    let BridgeTrial { direct, found, searches, tried, from_start, to_goal, walk } = bridge;
    let sum = from_start.iter().zip(to_goal).map(|(from, to)| Some((*from)? + (*to)?));
    let sum: Vec<Option<f32>> = sum.collect();
    let raster = Raster::of_map(map, MAP_PIXELS);
    let point = found.map(|found| found.point);
    let path = walk.path.iter().take(1).copied().collect();
    let ends = Walked { plan: Vec::new(), path, ..walk.clone() };
    let panel = |what: &str, caption: String, values: &[Option<f32>], walk, point| {
        let value = |[x, y]: &[f32; 2]| {
            let cell = map.index(Cell::new(*x as usize, *y as usize));
            values.get(cell).copied().flatten().unwrap_or(f32::NAN)
        };
        let mut picture = field(map, raster, |positions| positions.iter().map(value).collect());
        draw_walk(&mut picture, raster, walk, point);
        MapPanel { title: format!("{title}: {what}"), caption, picture }
    };
    let numbers = match found {
        Some(found) => {
            let (there, on) = (found.from_start, found.to_goal);
            format!("b: {there:.2} + {on:.2} = {:.2} < {direct:.2}", there + on)
        }
        None => format!("none in {searches} tasks, {tried} candidates"),
    };
    let searched = format!("D(s,g) {direct:.2}; searched {}", counted(*searches as u64, "task"));
    let steps = format!("true steps {}", walk.shortest);
    vec![
        panel("D(s, .)", searched, from_start, &ends, None),
        panel("D(., g)", steps, to_goal, &ends, None),
        panel("D(s, .) + D(., g)", numbers, &sum, &ends, point),
        panel("the plan and the walk", walk_caption(walk), to_goal, walk, point),
    ]
}

fn path_panel(map: &Grid, title: &str, walk: &Walked) -> MapPanel {
    let raster = Raster::of_map(map, MAP_PIXELS);
    let mut picture = Picture::new(raster.pixels, WALL);
    for i in raster.free_ground(map).0 {
        picture.pixels_mut()[i] = FLOOR;
    }
    draw_walk(&mut picture, raster, walk, None);
    let title = format!("{title}: {} steps", walk.distance);
    MapPanel { title, caption: walk_caption(walk), picture }
}

/// Draws charts side by side, and below them the maps, row by row, each map with its title above
/// and its caption below.
fn draw(title: &str, charts: &[Chart], maps: &[Vec<MapPanel>]) -> Sheet {
    let columns = charts.len().max(1);
    let width = if maps.is_empty() && columns == 1 { CHART } else { PAGE };
    let mut sheet = ChartPage { title, has_heading: true, charts, width, columns }.draw();
    let columns = maps.iter().map(Vec::len).max().unwrap_or(0) as f32;
    let room = (sheet.size[0] - MARGIN) / columns.max(1.0) - MARGIN;
    let widest = maps.iter().flatten().map(|panel| panel.picture.size().0).max().unwrap_or(1);
    let scale = room.min(MAP) / widest as f32;
    let ink = (40, 40, 40);
    for row in maps {
        let top = sheet.size[1] + 1.5 * LETTERS;
        let mut end = top;
        for (i, MapPanel { title, caption, picture }) in row.iter().enumerate() {
            let left = MARGIN + i as f32 * (room + MARGIN);
            let (columns, rows) = picture.size();
            let (at, size) = ([left, top], [scale * columns as f32, scale * rows as f32]);
            end = end.max(top + size[1]);
            sheet.marks.push(Mark::Picture { at, size, picture: picture.clone() });
            let texts = [(title, top - 0.4 * LETTERS), (caption, top + size[1] + 1.2 * LETTERS)];
            for (text, y) in texts {
                sheet.text([left, y], text, fitted(text, LETTERS, room), Anchor::Start, ink);
            }
        }
        sheet.size[1] = end + 2.0 * LETTERS;
    }
    sheet
}

const BRIDGE_SEARCH: &str = "The published search, on one far task after another until there is a \
                             bridge point: b with D(s,b) + D(b,g) < D(s,g), among candidates that \
                             are at least a quarter of D(s,g) from either end.";

const MAPS: &str = "Orange: the start s and the walk; red: the goal g; light red: the bridge point b \
                    and the plan.\n";

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
    let budget = budget.to_possible_value().unwrap_or_default();
    let (version, names, budget) = (env!("CARGO_PKG_VERSION"), names.join(" "), budget.get_name());
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

/// Writes a figure as data and as drawings; returns its section of the report.
pub fn section(figure: &Figure, methods: &[MethodRuns], folder: &Folder) -> Result<String, Report> {
    let (name, title) = (figure.name, figure.title);
    let (panels, maps) = (panels(figure, methods), rows(figure, methods));
    let csv = if let [FigurePanel { labels, .. }, ..] = &panels[..] {
        let lines = panels.iter().flat_map(|panel| &panel.lines);
        table(lines, [labels[0], "value"], [0.0, f64::INFINITY])?
    } else {
        walks_csv(methods)?
    };
    let sheet = draw(title, &panels.iter().map(FigurePanel::chart).collect::<Vec<_>>(), &maps);
    let files = ["svg", "png"].map(|end| format!("figures/{name}.{end}"));
    write_unless_edited(folder, &files, (&format!("data/{name}.csv"), &csv), &sheet)?;
    let shown = match figure.shows {
        Shows::Bridge => format!("{BRIDGE_SEARCH} {MAPS}"),
        Shows::Paths => MAPS.to_owned(),
        _ => last_values(figure, methods, &panels),
    };
    Ok(format!(
        "\n## {name}: {title}\n\n![{title}](figures/{name}.png)\n\n[SVG](figures/{name}.svg), \
         [CSV](data/{name}.csv)\n\n{shown}"
    ))
}

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
type MethodCell = fn(&MethodRuns, &SeedCurves) -> String;

fn columns(figure: &Figure) -> &'static [(&'static str, MethodCell)] {
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
fn last_values(figure: &Figure, methods: &[MethodRuns], panels: &[FigurePanel]) -> String {
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

fn steps(method: &MethodRuns, _: &SeedCurves) -> String {
    let last = method.results.iter().filter_map(|result| result.evaluations.last());
    last.map(|at| at.env_steps).max().unwrap_or(0).to_string()
}

fn random(method: &MethodRuns, of: fn(&RandomTasks) -> f64) -> String {
    let measured = method.results.iter().filter_map(|result| result.measured.as_ref());
    let values = measured.filter_map(|measured| measured.random.as_ref().map(of));
    numbers(&values.collect::<Vec<f64>>(), 3)
}

fn reached_at_the_end(_: &MethodRuns, line: &SeedCurves) -> String {
    let left = last(line);
    let reached = left.iter().filter(|left| **left == 0.0).count();
    format!("{reached} of {}", counted(left.len() as u64, "seed"))
}
