//! Draws a figure: charts side by side, and rows of maps with distances, plans and paths (Figures 2
//! and 5).

use super::MethodRuns;
use super::catalogue::{Figure, Shows};
use crate::experiment::measure::{Bridge, Walked, draw_walk, field};
use crate::figure::{Anchor, Chart, MILLIMETRE, Mark, Page, Sheet, fitted};
use gdg::draw::{Picture, Raster, Rgb, WALL};
use gdg::map::{Cell, Grid, builtin};
use gdg::text::counted;

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

pub struct MapPanel {
    pub title: String,
    pub caption: String,
    picture: Picture,
}

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
pub fn draw(title: &str, charts: &[Chart], maps: &[Vec<MapPanel>]) -> Sheet {
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
