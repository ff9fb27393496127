//! What a figure shows: charts of methods over seeds (Figures 1, 3, 4 and 6), or rows of maps with
//! distances, plans and paths (Figures 2 and 5); as data, as drawings, and for the terminal.

use std::io::IsTerminal;

use anstyle::RgbColor;
use anstyle_lossy::rgb_to_xterm;
use miette::Report;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::widgets::{self, Dataset, GraphType, Widget};

use super::MethodRuns;
use super::catalogue::{Figure, Shows};
use crate::experiment::folder::Folder;
use crate::experiment::measure::{Bridge, Walked, draw_walk, field};
use crate::experiment::plot::{Axis, Line, Points, csv_of, table};
use crate::experiment::spec::JobResult;
use crate::figure::{Anchor, Chart, Format, MILLIMETRE, Mark, Page, Range, Sheet, fitted, tick};
use gdg::draw::{Picture, Raster, Rgb, WALL};
use gdg::map::{Cell, Grid, builtin};
use gdg::text::{counted, terminal_obeys_escapes};
use gdg::train::{DistanceScore, Evaluation, TaskOutcome};

pub struct Drawn {
    pub panels: Vec<Panel>,
    pub text: String,
}

impl Drawn {
    pub fn write(figure: &Figure, methods: &[MethodRuns], folder: &Folder) -> Result<Self, Report> {
        let name = figure.name;
        let (panels, maps) = (panels(figure, methods), rows(figure, methods));
        let csv = if let [Panel { labels, .. }, ..] = &panels[..] {
            let lines = panels.iter().flat_map(|panel| &panel.lines);
            table(lines, [labels[0], "value"], [0.0, f64::INFINITY])?
        } else {
            walks_csv(methods)?
        };
        folder.write(&format!("data/{name}.csv"), &csv)?;
        let charts: Vec<Chart> = panels.iter().map(Panel::chart).collect();
        let sheet = draw(figure.title, &charts, &maps);
        for format in [Format::Svg, Format::Png] {
            let file = format!("figures/{name}.{}", format.extension());
            folder.write(&file, &format.encode(&sheet)?)?;
        }
        let wanted = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
        let coloured = wanted && std::io::stdout().is_terminal() && terminal_obeys_escapes();
        let text = charts.iter().map(|chart| text_of(chart, coloured));
        let text = format!("\n{name}: {}\n{}", figure.title, text.collect::<String>());
        Ok(Self { panels, text })
    }
}

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

/// Columns and rows of a chart in characters.
const SIZE: (u16, u16) = (80, 20);

/// Returns a chart in characters, with the names of its curves and their last values below, and with
/// escape sequences for their colours if `coloured`.
fn text_of(chart: &Chart, coloured: bool) -> String {
    let Chart { labels, x, y, curves, .. } = chart;
    // The nearest of the 256 colours, which every terminal with colours has.
    let of = |(r, g, b): Rgb| rgb_to_xterm(RgbColor(r, g, b)).0;
    let painted = |text: &str, colour: u8| match text {
        text if coloured && text != " " => format!("\x1b[38;5;{colour}m{text}\x1b[39m"),
        text => text.to_owned(),
    };
    let points = curves.iter().map(|curve| curve.points.iter().map(|at| (at.x, at.mean)).collect());
    let points: Vec<Vec<(f64, f64)>> = points.collect();
    let data = curves.iter().zip(&points).map(|(curve, points)| {
        let line = Dataset::default().marker(Marker::Braille).graph_type(GraphType::Line);
        line.style(Style::new().fg(Color::Indexed(of(curve.colour)))).data(points)
    });
    let axis = |top: f64| {
        widgets::Axis::default()
            .bounds([0.0, 1.02 * top])
            .labels([0.0, 0.5, 1.0].map(|share| tick(share * top)))
    };
    let mut screen = Buffer::empty(Rect::new(0, 0, SIZE.0, SIZE.1));
    widgets::Chart::new(data.collect())
        .x_axis(axis(x[1]))
        .y_axis(axis(y.high))
        .legend_position(None)
        .render(screen.area, &mut screen);
    let mut out = format!("\n{} over {}\n", labels[1], labels[0]);
    for row in screen.area.rows() {
        let cells = row.positions().map(|at| match screen[at].fg {
            Color::Indexed(colour) => painted(screen[at].symbol(), colour),
            _ => screen[at].symbol().to_owned(),
        });
        out = out + cells.collect::<String>().trim_end() + "\n";
    }
    for curve in curves {
        // Without colours, the last values tell the lines apart.
        let last = curve.points.last().map_or(String::new(), |at| format!("{:.2}", at.mean));
        let line = format!("  \u{2500}\u{2500} {:<27}{last}", curve.name);
        out = out + &painted(&line, of(curve.colour)) + "\n";
    }
    out
}

pub struct Panel {
    pub labels: [&'static str; 2],
    /// Upper end of the vertical axis, if it is fixed.
    pub top: Option<f64>,
    pub lines: Vec<Line>,
}

impl Panel {
    fn chart(&self) -> Chart {
        let points = || self.lines.iter().flat_map(|line| line.seeds.values().flatten());
        let x = [0.0, points().map(|point| point.0).fold(1.0, f64::max)];
        Chart {
            title: String::new(),
            labels: self.labels.map(str::to_owned),
            x,
            y: match self.top {
                Some(high) => Range { high, ..Range::SHARE },
                None => Range::from_zero(points().map(|point| point.1)),
            },
            curves: self.lines.iter().map(|line| line.curve(x)).collect(),
        }
    }
}

pub fn last(line: &Line) -> Vec<f64> {
    line.seeds.values().filter_map(|points| Some(points.last()?.1)).collect()
}

/// Returns the charts of a figure, if it shows curves. Methods are compared over what they were
/// allowed to experience, or, where that is the same recorded data, over updates.
fn panels(figure: &Figure, methods: &[MethodRuns]) -> Vec<Panel> {
    let over = if figure.shows == Shows::Datasets { Axis::Updates } else { Axis::Steps };
    let panel = |chart: &str, labels, top, points: &dyn Fn(&JobResult) -> Points| {
        let line = |(marker, method): (usize, &MethodRuns)| Line {
            chart: chart.to_owned(),
            name: method.entry.title.to_owned(),
            colour: method.entry.colour,
            marker,
            seeds: method.results.iter().map(|result| (result.seed, points(result))).collect(),
        };
        Panel { labels, top, lines: methods.iter().enumerate().map(line).collect() }
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
            training("actor alone", "success rate, actor alone", Some(1.0), |e| e.greedy.success),
        ],
        Shows::Bridge | Shows::Paths => Vec::new(),
    }
}

fn marked(evaluation: &Evaluation) -> Option<TaskOutcome> {
    let marked = evaluation.marked?;
    Some(marked.planned.unwrap_or(marked.greedy))
}

fn by_distance(result: &JobResult) -> Points {
    let Some(last) = result.last() else { return Vec::new() };
    let score = last.planned.as_ref().unwrap_or(&last.greedy);
    let of = |d: &DistanceScore| Some((d.distance()?.0.round(), d.success?));
    score.by_distance.iter().filter_map(of).collect()
}

/// Pixels along the longer side of a map, at most.
const MAP_PIXELS: usize = 660;

const FLOOR: Rgb = (150, 154, 160);

const PAGE: f32 = 174.0 * MILLIMETRE;
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

fn raster(map: &Grid) -> Raster {
    Raster::of_map(map, MAP_PIXELS, MAP_PIXELS)
}

fn walk_caption(walk: &Walked) -> String {
    let end = if walk.reached { "reached in" } else { "not reached within" };
    format!("shortest {}; {end} {}", walk.shortest, walk.path.len().saturating_sub(1))
}

/// Returns the four panels of Figure 2: D(s,.), D(.,g), their sum with the bridge point, and the
/// plan with the walk.
fn bridge_row(map: &Grid, title: &str, bridge: &Bridge) -> Vec<MapPanel> {
    let Bridge { direct, found, searches, tried, from_start, to_goal, walk } = bridge;
    let sum = from_start.iter().zip(to_goal).map(|(from, to)| Some((*from)? + (*to)?));
    let sum: Vec<Option<f32>> = sum.collect();
    let (raster, point) = (raster(map), found.map(|found| found.point));
    let ends = Walked {
        plan: Vec::new(),
        path: walk.path[..1.min(walk.path.len())].to_vec(),
        ..walk.clone()
    };
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
    let raster = raster(map);
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
    let mut sheet = Page { title, has_heading: true, charts, width, columns }.draw();
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
