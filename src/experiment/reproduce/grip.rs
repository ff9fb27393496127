//! The arm with a wall: the path of the grip past it, from behind the arm and from above.

use super::MethodResults;
use super::panel::{Dot, FLOOR, GOAL, MapPanel, PANEL_PIXELS, PATH, PLAN, PolyLine, START, WALL};
use crate::experiment::measure::GoalWalk;
use gdg::draw::{Picture, Rgb};
use gdg::env::fetch_reach;

/// The table's top as it is seen in profile.
const TABLE: Rgb = (205, 200, 190);

/// Space around everything that is shown, in metres.
const MARGIN: f32 = 0.04;

/// A view along an axis. Axes are x (away from the robot), y (to its left) and z (up), as numbers.
#[derive(Clone, Copy, Debug)]
struct View {
    name: &'static str,
    /// The axes to the left and up.
    axes: [usize; 2],
    /// Whether the table is seen in profile, instead of as the ground.
    table_in_profile: bool,
}

/// From behind the robot and from above: y is to the left in both, as the robot sees it.
const VIEWS: [View; 2] = [
    View { name: "from behind", axes: [1, 2], table_in_profile: true },
    View { name: "from above", axes: [1, 0], table_in_profile: false },
];

/// A position in metres.
type Position = [f32; 3];

/// A method's walk.
#[derive(Debug)]
struct Walk {
    title: &'static str,
    goal: Position,
    goal_radius: f32,
    reached: bool,
    plan: Vec<Position>,
    path: Vec<Position>,
}

/// Returns one row of panels: both views of the walk of each method.
pub fn rows(methods: &[MethodResults]) -> Vec<Vec<MapPanel>> {
    let walk = |method: &MethodResults| {
        Walk::new(
            method.entry.title,
            method.results.first()?.measured.as_ref()?.long_walk.as_ref()?,
        )
    };
    let walks: Vec<Walk> = methods.iter().filter_map(walk).collect();
    let bounds = bounds(&walks);
    let panels = walks.iter().flat_map(|walk| VIEWS.iter().map(|view| view.panel(walk, bounds)));
    let panels: Vec<MapPanel> = panels.collect();
    if panels.is_empty() { Vec::new() } else { vec![panels] }
}

impl Walk {
    /// Returns `walk` if it is one in space.
    fn new(title: &'static str, walk: &GoalWalk) -> Option<Self> {
        let position = |values: &Vec<f32>| Position::try_from(values.as_slice()).ok();
        Some(Self {
            title,
            goal: position(&walk.goal)?,
            goal_radius: walk.goal_radius,
            reached: walk.reached,
            plan: walk.plan.iter().filter_map(position).collect(),
            path: walk.path.iter().filter_map(position).collect(),
        })
    }

    fn caption(&self) -> String {
        let steps = self.path.len().saturating_sub(1);
        let end = if self.reached { "reached in" } else { "not reached within" };
        format!("{end} {steps} steps")
    }
}

/// Returns the lowest and highest corner of what all panels show: the walks and the wall's top.
fn bounds(walks: &[Walk]) -> [Position; 2] {
    let (low, high) = (fetch_reach::WALL.low.as_vec3(), fetch_reach::WALL.high.as_vec3());
    // The wall reaches far beyond all paths along x.
    let (mut least, mut most) =
        ([f32::INFINITY, low.y, low.z], [f32::NEG_INFINITY, high.y, high.z]);
    for walk in walks {
        for at in walk.path.iter().chain(&walk.plan).chain([&walk.goal]) {
            for axis in 0..3 {
                least[axis] = least[axis].min(at[axis] - walk.goal_radius);
                most[axis] = most[axis].max(at[axis] + walk.goal_radius);
            }
        }
    }
    [least.map(|v| v - MARGIN), most.map(|v| v + MARGIN)]
}

impl View {
    /// Draws `walk` within `bounds`.
    fn panel(&self, walk: &Walk, bounds: [Position; 2]) -> MapPanel {
        let [least, most] = bounds;
        let [left, up] = self.axes;
        let size = |axis: usize| most[axis] - least[axis];
        let longest = (0..3).map(size).fold(f32::MIN_POSITIVE, f32::max);
        let scale = PANEL_PIXELS as f32 / longest;
        let pixels = self.axes.map(|axis| ((size(axis) * scale).round() as usize).max(1));
        let place = |at: &Position| [(most[left] - at[left]) * scale, (most[up] - at[up]) * scale];
        let line = |stops: &[Position], colour, width| PolyLine {
            stops: stops.iter().map(place).collect(),
            colour,
            width,
        };
        let goal = Dot::new(place(&walk.goal), GOAL);
        let start: Vec<Position> = walk.path.first().copied().into_iter().collect();
        let planned = if walk.plan.is_empty() {
            Vec::new()
        } else {
            [start.clone(), walk.plan.clone()].concat()
        };
        let waypoints = walk.plan.iter().take(walk.plan.len().saturating_sub(1));
        let mut dots: Vec<Dot> =
            waypoints.map(|at| Dot { radius: 3, ..Dot::new(place(at), PLAN) }).collect();
        dots.extend(start.iter().map(|at| Dot::new(place(at), START)));
        dots.push(goal);
        MapPanel {
            title: format!("{}: {}", walk.title, self.name),
            caption: walk.caption(),
            picture: self.ground(pixels, &place),
            lines: vec![line(&planned, PLAN, 4), line(&walk.path, PATH, 3)],
            // What counts as reached.
            rings: vec![Dot { radius: (walk.goal_radius * scale).round() as u32, ..goal }],
            dots,
            text: String::new(),
        }
    }

    /// Draws the wall, and the table in profile.
    fn ground(&self, pixels: [usize; 2], place: &impl Fn(&Position) -> [f32; 2]) -> Picture {
        let (low, high) = (
            fetch_reach::WALL.low.as_vec3().to_array(),
            fetch_reach::WALL.high.as_vec3().to_array(),
        );
        let ([left, bottom], [right, top]) = (place(&high), place(&low));
        // Left and up have the highest coordinates.
        let (columns, rows) = (left..right, bottom..top);
        let mut picture = Picture::new((pixels[0], pixels[1]), FLOOR);
        for (i, pixel) in picture.pixels_mut().iter_mut().enumerate() {
            let (x, y) = ((i % pixels[0]) as f32 + 0.5, (i / pixels[0]) as f32 + 0.5);
            if columns.contains(&x) && rows.contains(&y) {
                *pixel = WALL;
            } else if self.table_in_profile && y >= top {
                *pixel = TABLE;
            }
        }
        picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(plan: Vec<Position>) -> Walk {
        let path = vec![[1.34, 0.65, 0.5], [1.34, 0.75, 0.8], [1.34, 0.85, 0.5]];
        Walk { title: "GDG", goal: [1.34, 0.86, 0.5], goal_radius: 0.05, reached: true, plan, path }
    }

    #[test]
    fn the_path_leads_over_the_wall_from_right_to_left() {
        let walks = [walk(Vec::new())];
        let panels: Vec<MapPanel> =
            VIEWS.iter().map(|view| view.panel(&walks[0], bounds(&walks))).collect();
        assert_eq!(
            (panels[0].title.as_str(), panels[0].caption.as_str()),
            ("GDG: from behind", "reached in 2 steps")
        );
        let path = &panels[0].lines[1].stops;
        assert!(path[0][0] > path[1][0] && path[1][0] > path[2][0], "{path:?}");
        assert!(path[1][1] < path[0][1], "up is up: {path:?}");
        // Below the top of the path: free, then the wall down to the table.
        let (columns, _) = panels[0].picture.size();
        let column = path[1][0] as usize;
        let seen: Vec<Rgb> =
            panels[0].picture.pixels().iter().skip(column).step_by(columns).copied().collect();
        let mut kinds = seen.clone();
        kinds.dedup();
        assert_eq!(kinds, [FLOOR, WALL, TABLE]);
        assert_eq!(seen[path[1][1] as usize], FLOOR);
    }

    #[test]
    fn waypoints_are_dots_and_everything_lies_within_the_panel() {
        let walks = [walk(vec![[1.4, 0.75, 0.85], [1.34, 0.86, 0.5]])];
        for view in VIEWS {
            let panel = view.panel(&walks[0], bounds(&walks));
            assert_eq!(
                panel.dots.iter().map(|dot| dot.colour).collect::<Vec<_>>(),
                [PLAN, START, GOAL]
            );
            let (width, height) = panel.picture.size();
            let within = |at: &[f32; 2]| {
                at[0] >= 0.0 && at[0] <= width as f32 && at[1] >= 0.0 && at[1] <= height as f32
            };
            assert!(panel.lines.iter().flat_map(|line| &line.stops).all(within), "{}", view.name);
        }
    }
}
