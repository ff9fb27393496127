//! The steps of the tour.

use super::bridges::FoundBridge;
use super::{Tour, Watched, edit_cells, show_overlay};
use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::scene::MazeState;
use crate::tui::screen::{Caption, Screen};
use crate::tui::session::{Cx, view};
use crate::tui::theme::ColourDepth;
use gdg::draw::{ContourPath, contour_paths};
use gdg::learn::Scratch;
use gdg::map::Cell;
use gdg::viewer::Field;

/// The map of the tour, and where its agent starts.
pub const MAP: &str = "fourrooms";
pub const START: Cell = Cell::new(3, 3);

/// A goal beside a wall, a place behind the wall, and one as far away in the goal's own room.
const GOAL_AT_WALL: Cell = Cell::new(52, 37);
const BEHIND_WALL: Cell = Cell::new(36, 37);
const SAME_ROOM: Cell = Cell::new(68, 37);

/// How much longer than in the same room D must be to have learned of the wall; and the least
/// there, relative to the truth.
const BENT: f32 = 1.4;
const PLAUSIBLE: f32 = 0.7;

/// A goal in the far room, and the doors to it: corners, and a place before the door.
const FAR_GOAL: Cell = Cell::new(80, 62);
const DOORS: [([Cell; 2], Cell); 2] = [
    ([Cell::new(64, 48), Cell::new(71, 55)], Cell::new(68, 44)),
    ([Cell::new(40, 72), Cell::new(47, 79)], Cell::new(36, 76)),
];

/// How many times as far it must be round a closed door, and how near to the old D when it is open
/// again.
const LONGER: f32 = 2.5;
const BACK: f32 = 1.3;

/// Cells between points of a line that captions do not cover.
const SPACING: f32 = 2.0;

pub struct Step {
    pub title: &'static str,
    /// Seconds to read it after its subject has been seen, and until it ends anyway.
    pub reading_secs: f32,
    pub limit_secs: f32,
    /// What it does at first.
    pub enter: fn(&mut Tour, &mut Cx),
    /// What it says now.
    pub look: fn(&MazeState, &Screen, &mut Tour) -> Caption,
}

const fn step(
    title: &'static str,
    [reading_secs, limit_secs]: [f32; 2],
    enter: fn(&mut Tour, &mut Cx),
    look: fn(&MazeState, &Screen, &mut Tour) -> Caption,
) -> Step {
    Step { title, reading_secs, limit_secs, enter, look }
}

pub const STEPS: &[Step] = &[
    step("No reward", [8.0, 8.0], |tour, cx| tour.aim_at(GOAL_AT_WALL, cx), wandering),
    step("D bends", [7.0, 25.0], |_, _| {}, bending),
    step("Contours", [7.0, 10.0], |_, _| {}, contour),
    step("Too far", [6.0, 30.0], colour_from_start, too_far),
    step("A bridge", [8.0, 8.0], colour_over_each, bridge),
    step("Over the bridge", [4.0, 14.0], walk_over, over_bridge),
    step("A plan", [1.5, 16.0], aim_far, plan),
    step("A door closes", [5.0, 24.0], close_door, closed),
    step("It opens again", [4.0, 12.0], open_door, opened),
    step("Now you", [12.0, 12.0], |_, _| {}, now_you),
];

fn distance_to_goal(maze: &MazeState, screen: &Screen, from: [f32; 2]) -> f32 {
    distance(screen, &from, &maze.goal.centre())
}

fn distance(screen: &Screen, from: &[f32], to: &[f32]) -> f32 {
    screen.snapshot.networks.policy.distance(from, to, &mut Scratch::default())
}

/// Returns points along the lines that connect `stops`.
fn points_along(stops: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let between = |ends: &[[f32; 2]]| {
        let [from, to] = [ends[0], ends[1]];
        let n = (straight(from, to) / SPACING).ceil().max(1.0) as usize;
        let share = move |i: usize| i as f32 / n as f32;
        (0..=n).map(move |i| [0, 1].map(|axis| from[axis] + share(i) * (to[axis] - from[axis])))
    };
    stops.windows(2).flat_map(between).collect()
}

/// Returns the steps between two positions without walls: at most one cell per step along each
/// axis.
fn straight(from: [f32; 2], to: [f32; 2]) -> f32 {
    (from[0] - to[0]).abs().max((from[1] - to[1]).abs())
}

fn is_mono(screen: &Screen) -> bool {
    screen.theme.depth == ColourDepth::Mono
}

fn wandering(maze: &MazeState, screen: &Screen, _: &mut Tour) -> Caption {
    let text = if is_mono(screen) {
        "The o are agents that wander about. Nobody rewards them. Shades show what they learn: D, the number of steps to G. \
         The denser, the farther."
    } else {
        "The white dots are agents that wander about. Nobody rewards them. Colours show what they learn: D, the number of \
         steps to G. Light is near, dark is far."
    };
    Caption {
        text: text.to_owned(),
        subject: vec![maze.goal.centre()],
        seen: true,
        ..Caption::default()
    }
}

fn bending(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    let (behind, goal) = (BEHIND_WALL.centre(), maze.goal.centre());
    let (straight, learned) = (straight(behind, goal), distance_to_goal(maze, screen, behind));
    let open = distance_to_goal(maze, screen, SAME_ROOM.centre());
    let seen = open >= PLAUSIBLE * straight && learned >= BENT * open.max(straight);
    if seen {
        tour.hunt.go_on(&screen.snapshot.networks);
    }
    let then =
        if seen { "D has learned to go round the wall." } else { "Watch it learn about the wall." };
    let text = format!(
        "From P, G would be {straight:.0} steps away, were there no wall. Learned so far: D = {learned:.0}. {then}"
    );
    let subject = [vec![behind, goal], points_along(&[behind, goal])].concat();
    Caption { text, subject, marks: vec![(behind, 'P')], seen }
}

/// Returns the positions on the contour line nearest to `near`, the nearest first, and its
/// distance.
fn contour_near(maze: &MazeState, screen: &Screen, near: [f32; 2]) -> Option<(Vec<[f32; 2]>, f32)> {
    let (view, (field, raster)) = (&maze.view, maze.view.field()?);
    if view.kind != screen.field || !view.kind.is_distance() {
        return None;
    }
    let columns = raster.pixels.0;
    let position = |i: usize| raster.middle_of(i);
    let lines = contour_paths(field, columns, screen.layout.contour_interval?);
    let nearest = |line: &ContourPath| {
        let off = line.pixels(columns).into_iter().map(|i| straight(position(i), near));
        off.fold(f32::INFINITY, f32::min)
    };
    let line = lines.iter().min_by(|a, b| nearest(a).total_cmp(&nearest(b)))?;
    let mut places: Vec<[f32; 2]> = line.pixels(columns).into_iter().map(position).collect();
    places.sort_by(|a, b| straight(*a, near).total_cmp(&straight(*b, near)));
    Some((places, line.level))
}

fn contour(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    tour.hunt.go_on(&screen.snapshot.networks);
    let Some((line, level)) = contour_near(maze, screen, Cell::new(24, 24).centre()) else {
        return Caption {
            text: "Contour lines connect places with the same D.".to_owned(),
            ..Caption::default()
        };
    };
    let text = format!(
        "The dots mark a contour line: from every place on it, G is D = {level:.0} steps away. Where lines bend, D knows the \
         way round a wall."
    );
    let marks = line.iter().map(|at| (*at, '\u{2022}')).collect();
    Caption { text, subject: line, marks, seen: true }
}

/// What is said as long as no bridge has been found.
const NO_BRIDGE: &str = "Wait for a bridge: a place B between S and G with D(S,B) + D(B,G) far below \
     D(S,G).";

/// Returns the bridge that is shown. As long as there is none, looks for one, with which the step
/// begins again.
fn shown_bridge(tour: &mut Tour, screen: &Screen) -> Option<FoundBridge> {
    if !tour.shows_bridge {
        tour.hunt.go_on(&screen.snapshot.networks);
        tour.enters_again = tour.hunt.best.is_some();
        return None;
    }
    tour.hunt.best.clone()
}

/// Returns the caption of a step about a bridge, as long as none has been found.
fn no_bridge(maze: &MazeState) -> Caption {
    let subject = vec![maze.goal.centre()];
    Caption { text: NO_BRIDGE.to_owned(), subject, ..Caption::default() }
}

/// Puts start and goal at the ends of the bridge that has been found, and sends the agent off;
/// returns whether one has.
fn stage_bridge(tour: &mut Tour, cx: &mut Cx) -> bool {
    if let Some(FoundBridge { stops: [start, _, goal], .. }) = tour.hunt.best.clone() {
        let cell = |at: [f32; 2]| Cell::new(at[0] as usize, at[1] as usize);
        (tour.start, tour.shows_bridge) = (cell(start), true);
        tour.aim_at(cell(goal), cx);
    }
    tour.shows_bridge
}

fn colour_from_start(tour: &mut Tour, cx: &mut Cx) {
    if stage_bridge(tour, cx) {
        view::show_field(cx, Field::FromStart);
    }
}

fn too_far(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    let Some(FoundBridge { stops: [start, _, goal], distances: [.., direct], .. }) =
        shown_bridge(tour, screen)
    else {
        return no_bridge(maze);
    };
    let (shown, line) = if is_mono(screen) { ("Shades", "x") } else { ("Colours", "dots") };
    let text = format!(
        "{shown} now show D from S. To G, straight along the {line}, it says {direct:.0} steps. But D is better at short ways \
         than at long ones."
    );
    let between = points_along(&[start, goal]);
    let sign = if is_mono(screen) { 'x' } else { '\u{2022}' };
    let marks = between.iter().map(|at| (*at, sign)).collect();
    Caption { text, subject: vec![goal, start], marks, seen: true }
}

fn colour_over_each(tour: &mut Tour, cx: &mut Cx) {
    show_bridge(tour, cx);
    if tour.shows_bridge {
        view::show_field(cx, Field::OverEach);
    }
}

fn show_bridge(tour: &mut Tour, cx: &mut Cx) {
    view::show_field(cx, Field::Learned);
    if tour.shows_bridge || stage_bridge(tour, cx) {
        tour.shows_search |= show_overlay(Overlay::Search, true, cx);
    }
}

fn bridge(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    let shown = shown_bridge(tour, screen);
    let Some(FoundBridge { stops, distances: [first, second, direct], .. }) = shown else {
        return Caption { seen: true, ..no_bridge(maze) };
    };
    let (shown, line) = if is_mono(screen) { ("Shades", "=") } else { ("Colours", "line") };
    let text = format!(
        "Over B, along the {line}, D says less: D(S,B) + D(B,G) = {first:.0} + {second:.0} = {:.0}, not D(S,G) = {direct:.0}. \
         B is a bridge: it makes one hard task two easier ones. {shown} are D(S,.) + D(.,G), least at good bridges.",
        first + second
    );
    // Wherever the three are, there is room for the box beside them; a whole line may leave none.
    let [start, bridge, goal] = stops;
    Caption { text, subject: vec![bridge, start, goal], marks: Vec::new(), seen: true }
}

fn walk_over(tour: &mut Tour, cx: &mut Cx) {
    show_bridge(tour, cx);
    if tour.shows_bridge {
        tour.send_walker(cx);
        tour.stays = true;
    }
}

fn over_bridge(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    let shown = shown_bridge(tour, screen);
    let Some(FoundBridge { stops, distances: [first, second, direct], .. }) = shown else {
        return Caption { seen: true, ..no_bridge(maze) };
    };
    let walk = &maze.view.reach;
    // An earlier walk has ended when the step begins.
    let seen = walk.arrived && tour.elapsed > 1.0;
    let state = if seen {
        format!("It has arrived after {} steps.", walk.steps)
    } else {
        format!("{} steps so far.", walk.steps)
    };
    let text = format!(
        "Now @ walks from S to G, from bridge to bridge. {state} D(S,G) was {direct:.0}, over B {:.0}: this early, D is \
         still too long.",
        first + second
    );
    let subject = [vec![stops[2]], points_along(&stops)].concat();
    Caption { text, subject, marks: Vec::new(), seen }
}

fn aim_far(tour: &mut Tour, cx: &mut Cx) {
    tour.hide_bridge(cx);
    tour.start = START;
    tour.aim_at(FAR_GOAL, cx);
}

fn plan(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    let path = points_along(&maze.way());
    if path.len() > tour.route.len() {
        tour.route.clone_from(&path);
    }
    let line = if is_mono(screen) { "The + are" } else { "The red line is" };
    let text = format!(
        "G is now in the far room. {line} the plan: from bridge to bridge, each near enough to be reached reliably. @ walks it."
    );
    let seen = maze.view.reach.arrived && tour.elapsed > 1.0;
    Caption { text, subject: [vec![maze.goal.centre()], path].concat(), marks: Vec::new(), seen }
}

fn cells_between([from, to]: [Cell; 2]) -> Vec<Cell> {
    (from.y..=to.y).flat_map(|y| (from.x..=to.x).map(move |x| Cell::new(x, y))).collect()
}

fn close_door(tour: &mut Tour, cx: &mut Cx) {
    let leads_through = |cells: &[Cell]| {
        tour.route.iter().any(|at| cells.iter().any(|cell| straight(cell.centre(), *at) <= 0.5))
    };
    let through = DOORS.iter().find(|(corners, _)| leads_through(&cells_between(*corners)));
    let (corners, before) = through.unwrap_or(&DOORS[0]);
    let Some(maze) = cx.scene.maze() else { return };
    let distance = distance_to_goal(maze, &cx.screen, before.centre());
    tour.watched = Watched { place: before.centre(), before: distance, most: distance };
    let door = cells_between(*corners);
    if edit_cells(&door, false, cx) {
        tour.closed = door;
    }
    tour.send_walker(cx);
}

/// Returns the door that was closed, the place before it, and the path of the agent.
fn around_door(maze: &MazeState, tour: &Tour) -> Vec<[f32; 2]> {
    let place = tour.watched.place;
    let door = DOORS.iter().find(|(_, before)| before.centre() == place).unwrap_or(&DOORS[0]).0;
    let door = cells_between(door).into_iter().map(Cell::centre);
    [vec![place], door.collect(), points_along(&maze.way())].concat()
}

fn closed(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    let Watched { place, before, .. } = tour.watched;
    let now = distance_to_goal(maze, screen, place);
    tour.watched.most = tour.watched.most.max(now);
    let followed = if now.round() > before.round() {
        format!("D follows: from P it was {before:.0}, now {now:.0}.")
    } else {
        format!("D will follow: from P it is still {now:.0}.")
    };
    let text = format!(
        "A wall now closes this door: you can draw one with {}. The plan changes at once. {followed}",
        screen.keymap.key_of(Action::ToggleEdit)
    );
    let subject = around_door(maze, tour);
    Caption { text, subject, marks: vec![(place, 'P')], seen: now >= LONGER * before }
}

fn open_door(tour: &mut Tour, cx: &mut Cx) {
    tour.open_door(cx);
    tour.send_walker(cx);
}

fn opened(maze: &MazeState, screen: &Screen, tour: &mut Tour) -> Caption {
    let Watched { place, before, most } = tour.watched;
    let now = distance_to_goal(maze, screen, place);
    let followed = if most.round() <= before.round() {
        format!("D had no time to follow: from P it is {now:.0}.")
    } else if now <= BACK * before {
        format!("D has fallen again: from P it is {now:.0}.")
    } else {
        format!("D will fall: from P it is still {now:.0}.")
    };
    let text = format!("The door is open again. The plan may use it at once. {followed}");
    let subject = around_door(maze, tour);
    Caption { text, subject, marks: vec![(place, 'P')], seen: now <= BACK * before }
}

fn now_you(maze: &MazeState, screen: &Screen, _: &mut Tour) -> Caption {
    let key = |action| screen.keymap.key_of(action);
    let text = format!(
        "Click anywhere: @ walks there. Press {} to draw walls, {} for help. Training goes on.",
        key(Action::ToggleEdit),
        key(Action::Help)
    );
    let walker = maze.walker().unwrap_or(maze.goal.centre());
    Caption { text, subject: vec![maze.goal.centre(), walker], marks: Vec::new(), seen: true }
}
