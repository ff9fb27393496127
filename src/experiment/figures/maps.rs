//! Figures 2 and 5: pictures of the map with distances, plans and paths.

use super::MethodRuns;
use super::catalogue::{Figure, Shows};
use super::panel::{Dot, FLOOR, GOAL, MapPanel, PANEL_PIXELS, PATH, PLAN, PolyLine, START, WALL};
use crate::experiment::measure::{Bridge, LINE_SPACING, Walked};
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
