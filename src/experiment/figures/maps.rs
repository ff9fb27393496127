//! Draws a figure: charts side by side, and rows of maps with distances, plans and paths (Figures 2
//! and 5).

use super::MethodRuns;
use super::catalogue::{Figure, Shows};
use super::curves::Panel;
use crate::experiment::measure::{Bridge, LINE_SPACING, Walked};
use crate::figure::{Anchor, Chart, Curve, MILLIMETRE, Mark, Page, Range, Sheet, circle, fitted};
pub use gdg::draw::WALL;
use gdg::draw::{Picture, Rgb, contour_interval, distance_colour};
use gdg::map::{Grid, builtin};
use gdg::text::counted;

const WALKED: Rgb = (255, 255, 255);
const BRIDGE: Rgb = (255, 70, 50);

pub fn rows(figure: &Figure, methods: &[MethodRuns]) -> Vec<Vec<MapPanel>> {
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

fn scale(map: &Grid) -> usize {
    (PANEL_PIXELS / map.width().max(map.height())).max(1)
}

fn cell_at(map: &Grid, pixel: usize) -> usize {
    let (scale, columns) = (scale(map), map.width() * scale(map));
    (pixel / columns / scale) * map.width() + pixel % columns / scale
}

/// Returns a picture of the map whose free cells have these colours, by index.
fn picture(map: &Grid, colour: impl Fn(usize) -> Rgb) -> Picture {
    let scale = scale(map);
    let mut picture = Picture::new((map.width() * scale, map.height() * scale), WALL);
    for (i, pixel) in picture.pixels_mut().iter_mut().enumerate() {
        let cell = cell_at(map, i);
        if map.free()[cell] {
            *pixel = colour(cell);
        }
    }
    picture
}

fn line(map: &Grid, stops: &[[f32; 2]], colour: Rgb, width: u32) -> PolyLine {
    let scale = scale(map) as f32;
    PolyLine { stops: stops.iter().map(|at| at.map(|v| v * scale)).collect(), colour, width }
}

fn dot(map: &Grid, at: [f32; 2], colour: Rgb) -> Dot {
    Dot::new(at.map(|v| v * scale(map) as f32), colour)
}

fn ends(map: &Grid, walk: &Walked) -> Vec<Dot> {
    let start = walk.path.first().map(|at| dot(map, *at, START));
    start.into_iter().chain([dot(map, walk.goal, GOAL)]).collect()
}

fn walk_caption(walk: &Walked) -> String {
    let end = if walk.reached { "reached in" } else { "not reached within" };
    format!("shortest {}; {end} {}", walk.shortest, walk.path.len().saturating_sub(1))
}

/// Returns the four panels of Figure 2: D(s,.), D(.,g), their sum with the bridge point, and the
/// walk.
fn bridge_row(map: &Grid, title: &str, bridge: &Bridge) -> Vec<MapPanel> {
    let Bridge { direct, found, searches, tried, from_start, to_goal, walk: walked } = bridge;
    let sum: Vec<Option<f32>> = from_start
        .iter()
        .zip(to_goal)
        .map(|(from, to)| Some(from.as_ref()? + to.as_ref()?))
        .collect();
    let panel = |what: &str, caption: String, values: &[Option<f32>]| MapPanel {
        dots: ends(map, walked),
        ..MapPanel::new(format!("{title}: {what}"), caption, field(map, values))
    };
    let numbers = match found {
        Some(found) => {
            let (there, on) = (found.from_start, found.to_goal);
            format!("b: {there:.2} + {on:.2} = {:.2} < {direct:.2}", there + on)
        }
        None => format!("none in {searches} tasks, {tried} candidates"),
    };
    let searched = format!("D(s,g) {direct:.2}; searched {}", counted(*searches as u64, "task"));
    let from = panel("D(s, .)", searched, from_start);
    let to = panel("D(., g)", format!("true steps {}", walked.shortest), to_goal);
    let mut both = panel("D(s, .) + D(., g)", numbers, &sum);
    let mut walk = panel("the plan and the walk", walk_caption(walked), to_goal);
    let start: Vec<[f32; 2]> = walked.path.first().copied().into_iter().collect();
    let plan = [start, walked.plan.clone()].concat();
    walk.lines = vec![line(map, &plan, PLAN, 5), line(map, &walked.path, WALKED, 2)];
    let point = found.map(|found| found.point);
    both.dots.extend(point.map(|at| dot(map, at, BRIDGE)));
    walk.dots.extend(point.map(|at| dot(map, at, BRIDGE)));
    walk.text = text(map, walked, point);
    vec![from, to, both, walk]
}

/// Colours free cells by distance, light near and dark far, with contour lines.
fn field(map: &Grid, values: &[Option<f32>]) -> Picture {
    let finite = || values.iter().flatten().copied();
    let (nearest, farthest) =
        (finite().fold(f32::INFINITY, f32::min), finite().fold(1.0, f32::max));
    let share = |value: f32| (value - nearest) / (farthest - nearest).max(1e-3);
    let mut picture = picture(map, |cell| {
        let value = values.get(cell).copied().flatten();
        value.map_or(WALL, |value| distance_colour(colorous::VIRIDIS, share(value)))
    });
    let (columns, rows) = picture.size();
    let of_pixel = |i: usize| values[cell_at(map, i)].unwrap_or(f32::NAN);
    let pixels: Vec<f32> = (0..columns * rows).map(of_pixel).collect();
    picture.contours(&pixels, contour_interval(&pixels, columns, LINE_SPACING));
    picture
}

fn path_panel(map: &Grid, title: &str, walk: &Walked) -> MapPanel {
    let (title, ground) = (format!("{title}: {} steps", walk.distance), picture(map, |_| FLOOR));
    MapPanel {
        lines: vec![line(map, &walk.path, PATH, 3)],
        dots: ends(map, walk),
        text: text(map, walk, None),
        ..MapPanel::new(title, walk_caption(walk), ground)
    }
}

/// Draws the map and the path as characters, each as wide as two cells and as high as four.
fn text(map: &Grid, walk: &Walked, bridge: Option<[f32; 2]>) -> String {
    const CELLS: (usize, usize) = (2, 4);
    let (columns, rows) = (map.width().div_ceil(CELLS.0), map.height().div_ceil(CELLS.1));
    let mut characters = vec![' '; columns * rows];
    for (i, character) in characters.iter_mut().enumerate() {
        let (left, top) = (i % columns * CELLS.0, i / columns * CELLS.1);
        let cells = (top..(top + CELLS.1).min(map.height())).flat_map(|y| {
            (left..(left + CELLS.0).min(map.width())).map(move |x| y * map.width() + x)
        });
        let (free, all) =
            cells.fold((0, 0), |(free, all), cell| (free + usize::from(map.free()[cell]), all + 1));
        if 2 * free < all {
            *character = '#';
        }
    }
    let mut put = |at: [f32; 2], character| {
        let (column, row) = (at[0].max(0.0) as usize / CELLS.0, at[1].max(0.0) as usize / CELLS.1);
        characters[row.min(rows - 1) * columns + column.min(columns - 1)] = character;
    };
    walk.path.iter().for_each(|at| put(*at, '*'));
    bridge.into_iter().for_each(|at| put(at, 'b'));
    walk.path.first().into_iter().for_each(|at| put(*at, 'S'));
    put(walk.goal, 'G');
    let lines = characters.chunks(columns).map(|row| row.iter().collect::<String>());
    lines.map(|line| line.trim_end().to_owned() + "\n").collect()
}

/// Pixels along the longer side of a map's panel, about.
pub const PANEL_PIXELS: usize = 330;

pub const FLOOR: Rgb = (244, 244, 240);
pub const PLAN: Rgb = (255, 70, 50);
pub const PATH: Rgb = (0, 114, 178);
pub const START: Rgb = (86, 180, 233);
pub const GOAL: Rgb = (230, 159, 0);

/// Widths of a page, and of a figure of one chart.
const PAGE: f32 = 174.0 * MILLIMETRE;
const CHART: f32 = 130.0 * MILLIMETRE;

/// Between maps, and size of the letters around them.
const MARGIN: f32 = 6.0;
const LETTERS: f32 = 7.0;

/// One map with what is drawn on it. Positions are in pixels of the picture.
#[derive(Clone, Debug)]
pub struct MapPanel {
    pub title: String,
    /// Numbers, below the map.
    pub caption: String,
    /// The ground: the map's cells.
    pub picture: Picture,
    /// The first ones below.
    pub lines: Vec<PolyLine>,
    /// Above the lines.
    pub dots: Vec<Dot>,
    /// The map as characters, for the terminal.
    pub text: String,
}

#[derive(Clone, Debug)]
pub struct PolyLine {
    pub stops: Vec<[f32; 2]>,
    pub colour: Rgb,
    pub width: u32,
}

/// A dot with a dark edge.
#[derive(Clone, Copy, Debug)]
pub struct Dot {
    pub at: [f32; 2],
    pub colour: Rgb,
    /// Without the edge.
    pub radius: u32,
}

impl Dot {
    /// Returns a dot that stands out from lines.
    pub fn new(at: [f32; 2], colour: Rgb) -> Self {
        Self { at, colour, radius: 5 }
    }
}

impl MapPanel {
    pub fn new(title: String, caption: String, picture: Picture) -> Self {
        Self { title, caption, picture, lines: Vec::new(), dots: Vec::new(), text: String::new() }
    }

    /// Draws it with its title above and its caption below, each in one line of `room`.
    fn draw(&self, sheet: &mut Sheet, at: [f32; 2], scale: f32, room: f32) {
        let ink = (40, 40, 40);
        let [left, top] = at;
        let (columns, rows) = self.picture.size();
        let size = [scale * columns as f32, scale * rows as f32];
        let (right, bottom) = (left + size[0], top + size[1]);
        let picture = self.picture.clone();
        sheet.marks.push(Mark::Picture { at, size, picture });
        let edge = vec![[left, top], [right, top], [right, bottom], [left, bottom], at];
        sheet.line(edge, 0.4, (128, 128, 128));
        let texts = [(&self.title, top - 0.4 * LETTERS), (&self.caption, bottom + 1.2 * LETTERS)];
        for (text, y) in texts {
            sheet.text([left, y], text, fitted(text, LETTERS, room), Anchor::Start, ink);
        }
        let place = |[x, y]: [f32; 2]| [left + scale * x, top + scale * y];
        for line in &self.lines {
            let stops = line.stops.iter().map(|stop| place(*stop)).collect();
            sheet.line(stops, scale * line.width as f32, line.colour);
        }
        for dot in &self.dots {
            let circle = |radius| circle(place(dot.at), scale * radius);
            sheet.area(circle(dot.radius as f32 + 1.0), (0, 0, 0));
            sheet.area(circle(dot.radius as f32), dot.colour);
        }
    }
}

/// Draws charts side by side, and below them the maps, row by row.
pub fn draw(title: &str, panels: &[Panel], maps: &[Vec<MapPanel>]) -> Sheet {
    let charts: Vec<Chart> = panels.iter().map(chart).collect();
    let columns = charts.len().max(1);
    let width = if maps.is_empty() && columns == 1 { CHART } else { PAGE };
    let mut sheet = Page { title, has_heading: true, charts: &charts, width, columns }.draw();
    let columns = maps.iter().map(Vec::len).max().unwrap_or(0) as f32;
    let widths = maps.iter().flatten().map(|panel| panel.picture.size().0);
    let room = (sheet.size[0] - MARGIN) / columns.max(1.0) - MARGIN;
    let scale = (room / widths.max().unwrap_or(1) as f32).min(0.6);
    for row in maps {
        let rows = row.iter().map(|panel| panel.picture.size().1).max().unwrap_or(0);
        let top = sheet.size[1] + 1.5 * LETTERS;
        for (i, panel) in row.iter().enumerate() {
            let left = MARGIN + i as f32 * (room + MARGIN);
            panel.draw(&mut sheet, [left, top], scale, room);
        }
        sheet.size[1] = top + scale * rows as f32 + 2.0 * LETTERS;
    }
    sheet
}

fn chart(panel: &Panel) -> Chart {
    let curves = panel.curves.iter().enumerate().map(|(marker, curve)| {
        let (name, colour) = (curve.entry.title.to_owned(), curve.entry.colour);
        Curve { name, colour, marker, points: curve.means() }
    });
    let curves: Vec<Curve> = curves.collect();
    let points = || curves.iter().flat_map(|curve| &curve.points);
    Chart {
        title: String::new(),
        labels: panel.labels.map(str::to_owned),
        x: [0.0, points().map(|point| point.x).fold(1.0, f64::max)],
        y: match panel.top {
            Some(high) => Range { high, ..Range::SHARE },
            None => Range::from_zero(points().map(|point| point.high)),
        },
        curves,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::map::parse_map;

    #[test]
    fn a_path_is_drawn_as_characters() {
        let map = parse_map(
            "map",
            b"......##\n......##\n......##\n......##\n........\n........\n........\n........\n",
        );
        let walk = Walked {
            distance: 7,
            shortest: 7,
            goal: [7.5, 7.5],
            reached: true,
            plan: Vec::new(),
            path: vec![[0.5, 0.5], [2.5, 4.5], [7.5, 7.5]],
        };
        assert_eq!(text(&map.expect("a map"), &walk, Some([4.5, 4.5])), "S  #\n *bG\n");
        assert_eq!(walk_caption(&walk), "shortest 7; reached in 2");
    }
}
