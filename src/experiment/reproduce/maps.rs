//! Figures 2 and 5: pictures of the map with distances, plans and paths; panels of the arm's are in
//! `grip`.

use super::MethodResults;
use super::figures::{Figure, Shows};
use super::grip;
use super::panel::{Dot, FLOOR, GOAL, MapPanel, PANEL_PIXELS, PATH, PLAN, PolyLine, START, WALL};
use crate::experiment::measure::{Bridge, Walked};
use crate::experiment::picture::LINE_SPACING;
use gdg::draw::{Picture, Rgb, contour_interval, distance_colour};
use gdg::map::{Grid, builtin};
use gdg::text::counted;

const WALKED: Rgb = (255, 255, 255);
const BRIDGE: Rgb = (255, 70, 50);

/// Returns the panels of a figure, in rows; none if it shows curves alone.
pub fn rows(figure: &Figure, methods: &[MethodResults]) -> Vec<Vec<MapPanel>> {
    if figure.shows == Shows::CompleteSuccessAndGripPath {
        return grip::rows(methods);
    }
    let Some(map) = builtin(figure.world) else { return Vec::new() };
    let row = |method: &MethodResults| {
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

/// Returns pixels per cell.
fn scale(map: &Grid) -> usize {
    (PANEL_PIXELS / map.width().max(map.height())).max(1)
}

/// Returns a picture of the map whose free cells have these colours, by index.
fn picture(map: &Grid, colour: impl Fn(usize) -> Rgb) -> Picture {
    let scale = scale(map);
    let mut picture = Picture::new((map.width() * scale, map.height() * scale), WALL);
    let columns = map.width() * scale;
    for (i, pixel) in picture.pixels_mut().iter_mut().enumerate() {
        let cell = (i / columns / scale) * map.width() + i % columns / scale;
        if map.free()[cell] {
            *pixel = colour(cell);
        }
    }
    picture
}

/// Returns the four panels of Figure 2: D(s,.), D(.,g), their sum with the bridge point, and the
/// walk.
fn bridge_row(map: &Grid, title: &str, bridge: &Bridge) -> Vec<MapPanel> {
    let scale = scale(map) as f32;
    let to_pixels = |at: [f32; 2]| at.map(|v| v * scale);
    let sum: Vec<Option<f32>> = bridge
        .from_start
        .iter()
        .zip(&bridge.to_goal)
        .map(|(from, to)| Some(from.as_ref()? + to.as_ref()?))
        .collect();
    let ends = |walk: &Walked| {
        let start = walk.path.first().map(|at| Dot::new(to_pixels(*at), START));
        start.into_iter().chain([Dot::new(to_pixels(walk.goal), GOAL)]).collect::<Vec<_>>()
    };
    let panel = |what: String, caption: String, values: &[Option<f32>]| MapPanel {
        title: what,
        caption,
        picture: field(map, values),
        lines: Vec::new(),
        rings: Vec::new(),
        dots: ends(&bridge.walk),
        text: String::new(),
    };
    let direct = bridge.direct;
    let found = bridge.found.map(|found| Dot::new(to_pixels(found.point), BRIDGE));
    let numbers = match &bridge.found {
        Some(found) => format!(
            "b: {:.2} + {:.2} = {:.2} < {direct:.2}",
            found.from_start,
            found.to_goal,
            found.from_start + found.to_goal
        ),
        None => format!("none in {} tasks, {} candidates", bridge.searches, bridge.tried),
    };
    let plan = [bridge.walk.path.first().copied().into_iter().collect(), bridge.walk.plan.clone()]
        .concat();
    let line = |stops: &[[f32; 2]], colour, width| PolyLine {
        stops: stops.iter().map(|at| to_pixels(*at)).collect(),
        colour,
        width,
    };
    let searched =
        format!("D(s,g) {direct:.2}; searched {}", counted(bridge.searches as u64, "task"));
    let from = panel(format!("{title}: D(s, .)"), searched, &bridge.from_start);
    let to = panel(
        format!("{title}: D(., g)"),
        format!("true steps {}", bridge.walk.shortest),
        &bridge.to_goal,
    );
    let mut both = panel(format!("{title}: D(s, .) + D(., g)"), numbers, &sum);
    both.dots.extend(found);
    let mut walk = panel(
        format!("{title}: the plan and the walk"),
        walk_caption(&bridge.walk),
        &bridge.to_goal,
    );
    walk.lines = vec![line(&plan, PLAN, 5), line(&bridge.walk.path, WALKED, 2)];
    walk.dots.extend(found);
    walk.text = text(map, &bridge.walk, bridge.found.map(|found| found.point));
    vec![from, to, both, walk]
}

/// Colours free cells by distance, light near and dark far, with contour lines.
fn field(map: &Grid, values: &[Option<f32>]) -> Picture {
    let finite = || values.iter().flatten().copied();
    let (nearest, farthest) =
        (finite().fold(f32::INFINITY, f32::min), finite().fold(1.0, f32::max));
    let scale = scale(map);
    let columns = map.width() * scale;
    let share = |value: f32| (value - nearest) / (farthest - nearest).max(1e-3);
    let mut picture = picture(map, |cell| {
        values
            .get(cell)
            .copied()
            .flatten()
            .map_or(WALL, |value| distance_colour(colorous::VIRIDIS, share(value)))
    });
    let of_pixel = |i: usize| {
        values[(i / columns / scale) * map.width() + i % columns / scale].unwrap_or(f32::NAN)
    };
    let pixels: Vec<f32> = (0..columns * map.height() * scale).map(of_pixel).collect();
    picture.contours(&pixels, contour_interval(&pixels, columns, LINE_SPACING));
    picture
}

fn walk_caption(walk: &Walked) -> String {
    let steps = walk.path.len().saturating_sub(1);
    let end = if walk.reached { "reached in" } else { "not reached within" };
    format!("shortest {}; {end} {steps}", walk.shortest)
}

/// Returns a panel of Figure 5: the path walked, over the plan if there is one.
fn path_panel(map: &Grid, title: &str, walk: &Walked) -> MapPanel {
    let scale = scale(map) as f32;
    let to_pixels = |at: &[f32; 2]| at.map(|v| v * scale);
    let path =
        PolyLine { stops: walk.path.iter().map(to_pixels).collect(), colour: PATH, width: 3 };
    let start = walk.path.first().map(|at| Dot::new(to_pixels(at), START));
    MapPanel {
        title: format!("{title}: {} steps", walk.distance),
        caption: walk_caption(walk),
        picture: picture(map, |_| FLOOR),
        lines: vec![path],
        rings: Vec::new(),
        dots: start.into_iter().chain([Dot::new(to_pixels(&walk.goal), GOAL)]).collect(),
        text: text(map, walk, None),
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
    characters
        .chunks(columns)
        .map(|row| row.iter().collect::<String>().trim_end().to_owned() + "\n")
        .collect()
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
