//! The arm with a wall: the path of the grip past it, from behind the arm and from above.

use super::MethodRuns;
use super::panel::{
    Dot, FLOOR, GOAL, MapPanel, PANEL_PIXELS, PATH, PLAN, PolyLine, START, WALL, walk_end,
};
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

/// In metres.
type Position = [f32; 3];

pub fn rows(methods: &[MethodRuns]) -> Vec<Vec<MapPanel>> {
    let walk = |method: &'_ MethodRuns| -> Option<(&'static str, GoalWalk)> {
        let walk = method.results.first()?.measured.as_ref()?.long_walk.as_ref()?;
        Some((method.entry.title, walk.clone()))
    };
    let walks: Vec<(&str, GoalWalk)> = methods.iter().filter_map(walk).collect();
    let bounds = bounds(walks.iter().map(|(_, walk)| walk));
    let panels = walks
        .iter()
        .flat_map(|(title, walk)| VIEWS.iter().map(move |view| view.panel(title, walk, bounds)));
    if walks.is_empty() { Vec::new() } else { vec![panels.collect()] }
}

/// Returns the lowest and highest corner of what all panels show: the walks and the wall's top.
fn bounds<'a>(walks: impl Iterator<Item = &'a GoalWalk>) -> [Position; 2] {
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
    fn panel(&self, title: &str, walk: &GoalWalk, [least, most]: [Position; 2]) -> MapPanel {
        let [left, up] = self.axes;
        let size = |axis: usize| most[axis] - least[axis];
        let longest = (0..3).map(size).fold(f32::MIN_POSITIVE, f32::max);
        let scale = PANEL_PIXELS as f32 / longest;
        let pixels = self.axes.map(|axis| ((size(axis) * scale).round() as usize).max(1));
        let place = |at: &[f32]| [(most[left] - at[left]) * scale, (most[up] - at[up]) * scale];
        let line = |stops: &[Vec<f32>], colour, width| {
            let stops = stops.iter().map(|at| place(at)).collect();
            PolyLine { stops, colour, width }
        };
        let goal = Dot::new(place(&walk.goal), GOAL);
        let start: Vec<Vec<f32>> = walk.path.first().cloned().into_iter().collect();
        let planned =
            if walk.plan.is_empty() { Vec::new() } else { [&start[..], &walk.plan].concat() };
        let waypoints = walk.plan.iter().take(walk.plan.len().saturating_sub(1));
        let mut dots: Vec<Dot> =
            waypoints.map(|at| Dot { radius: 3, ..Dot::new(place(at), PLAN) }).collect();
        dots.extend(start.iter().map(|at| Dot::new(place(at), START)));
        dots.push(goal);
        let caption = walk_end(walk.reached, walk.path.len()) + " steps";
        let ground = self.ground(pixels, &place);
        MapPanel {
            lines: vec![line(&planned, PLAN, 4), line(&walk.path, PATH, 3)],
            // What counts as reached.
            rings: vec![Dot { radius: (walk.goal_radius * scale).round() as u32, ..goal }],
            dots,
            ..MapPanel::new(format!("{title}: {}", self.name), caption, ground)
        }
    }

    fn ground(&self, pixels: [usize; 2], place: &impl Fn(&[f32]) -> [f32; 2]) -> Picture {
        let [low, high] = [fetch_reach::WALL.low, fetch_reach::WALL.high];
        let [low, high] = [low, high].map(|corner| corner.as_vec3().to_array());
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

    #[test]
    fn the_path_leads_over_the_wall_and_everything_lies_within_the_panel() {
        let walk = GoalWalk {
            goal: vec![1.34, 0.86, 0.5],
            goal_radius: 0.05,
            reached: true,
            plan: vec![vec![1.4, 0.75, 0.85], vec![1.34, 0.86, 0.5]],
            path: vec![vec![1.34, 0.65, 0.5], vec![1.34, 0.75, 0.8], vec![1.34, 0.85, 0.5]],
        };
        let bounds = bounds([&walk].into_iter());
        let [behind, above] = VIEWS.map(|view| view.panel("GDG", &walk, bounds));
        assert_eq!([&*behind.title, &*behind.caption], ["GDG: from behind", "reached in 2 steps"]);
        let path = &behind.lines[1].stops;
        assert!(path[0][0] > path[1][0] && path[1][0] > path[2][0], "{path:?}");
        assert!(path[1][1] < path[0][1], "up is up: {path:?}");
        // Below the top of the path: free, then the wall down to the table.
        let (columns, _) = behind.picture.size();
        let below = behind.picture.pixels().iter().skip(path[1][0] as usize).step_by(columns);
        let seen: Vec<Rgb> = below.copied().collect();
        assert_eq!(seen[path[1][1] as usize], FLOOR);
        let mut kinds = seen;
        kinds.dedup();
        assert_eq!(kinds, [FLOOR, WALL, TABLE]);
        for panel in [behind, above] {
            let colours: Vec<Rgb> = panel.dots.iter().map(|dot| dot.colour).collect();
            assert_eq!(colours, [PLAN, START, GOAL]);
            let (width, height) = panel.picture.size();
            let within = |[x, y]: &[f32; 2]| {
                (0.0..=width as f32).contains(x) && (0.0..=height as f32).contains(y)
            };
            assert!(panel.lines.iter().flat_map(|line| &line.stops).all(within), "{}", panel.title);
        }
    }
}
