//! The guided tour: a minute and a half on the four rooms, with captions beside the map.
//!
//! `STEPS` is the table of steps: a step ends a while after what it explains has been seen, or at its
//! time limit. Whatever the tour does, it does by the same commands as the user.

mod bridge;

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{Cx, watching};
use crate::tui::action::Action;
use crate::tui::choices::Overlay;
use crate::tui::scene::MazeState;
use crate::tui::scene::maze;
use crate::tui::screen::{Caption, Screen, ShownStep};
use crate::tui::theme::ColourDepth;
use crate::tui::viewport::Viewport;
use bridge::TourBridge;
use gdg::bridge::{BridgePoint, SearchOutcome};
use gdg::draw::positions_along;
use gdg::learn::Scratch;
use gdg::map::{Cell, Grid};
use gdg::train::{Method, Preset, Run};
use gdg::viewer::{Field, OnArrival};

/// Seconds between two looks at what has become of the step's subject.
const LOOK_INTERVAL_SECS: f32 = 0.1;

#[derive(Default)]
pub struct Tour {
    step: usize,
    /// Seconds since the step began, not counting pauses; and at the latest look.
    elapsed: f32,
    looked_at: f32,
    /// When the step's subject was seen.
    seen_at: Option<f32>,
    /// The bridge that is explained, once one has been found, and how often one has been looked for.
    bridge: Option<TourBridge>,
    searches: usize,
    /// Where the agent walks from.
    start: Option<Cell>,
    /// The way to the far room, as planned before a door was closed.
    route: Vec<[f32; 2]>,
    /// The cells of the closed door; a place before it, and what its D to the goal was.
    closed: Vec<Cell>,
    watched: ([f32; 2], f32),
    /// Whether the tour shows searches, which the user did not.
    shows_search: bool,
    /// What the walking agent did on arrival before the tour.
    on_arrival: OnArrival,
}

impl Tour {
    fn current(&self) -> &'static TourStep {
        &STEPS[self.step]
    }

    fn is_last(&self) -> bool {
        self.step + 1 == STEPS.len()
    }
}

pub fn run() -> Run {
    let preset = Preset::Default;
    Run { method: Method::default(), preset, seed: 1, settings: preset.settings() }
}

/// Leads through the tour, while there is one.
#[derive(Default)]
pub struct TourGuide {
    tour: Option<Tour>,
    /// When time last passed.
    ticked: Option<Instant>,
}

impl TourGuide {
    pub fn begin(&mut self, cx: &mut Cx) {
        if let Some(maze) = cx.scene.maze_mut() {
            maze.editor.close();
            maze.viewport = Viewport::default();
        }
        cx.screen.maximised = false;
        for overlay in [Overlay::Contours, Overlay::Agents, Overlay::Path] {
            show_overlay(overlay, true, cx);
        }
        watching::show_field(cx, Field::Learned);
        let on_arrival = cx.screen.on_arrival;
        let tour = self.tour.insert(Tour { start: Some(START), on_arrival, ..Tour::default() });
        watching::set_on_arrival(cx, OnArrival::Again);
        tour.enter(cx);
    }

    pub fn next_step(&mut self, cx: &mut Cx) {
        match &mut self.tour {
            Some(tour) if tour.is_last() => self.end(cx),
            Some(tour) => {
                tour.step += 1;
                tour.enter(cx);
            }
            None => {}
        }
    }

    /// Ends the tour and leaves the trainer as the user would have found it.
    pub fn end(&mut self, cx: &mut Cx) {
        let Some(tour) = &mut self.tour else { return };
        tour.hide_bridge(cx);
        // If the trainer is busy, the tour goes on until the door is open.
        if tour.open_door(cx) {
            watching::set_on_arrival(cx, tour.on_arrival);
            self.forget(&mut cx.screen);
            // The line about what there is to see would repeat it.
            cx.screen.explains = false;
        }
    }

    pub fn forget(&mut self, screen: &mut Screen) {
        (self.tour, screen.tour, screen.explained) = (None, None, None);
    }

    /// Handles the passing of time; returns whether the screen changes.
    pub fn on_tick(&mut self, cx: &mut Cx) -> bool {
        let now = Instant::now();
        let before = self.ticked.replace(now);
        self.advance(before.map_or(Duration::ZERO, |before| now - before), cx)
    }

    /// Moves the tour on by some time, unless it is paused: while training is, and while something
    /// hides the map. Returns whether the screen changes.
    pub fn advance(&mut self, passed: Duration, cx: &mut Cx) -> bool {
        let screen = &cx.screen;
        let trains = screen.snapshot.phase.is_training() && !screen.pausing;
        let is_hidden = screen.maximised || !screen.dialogs.is_empty();
        let Some(tour) = self.tour.as_mut().filter(|_| trains && !is_hidden) else { return false };
        tour.elapsed += passed.as_secs_f32();
        if tour.elapsed - tour.looked_at < LOOK_INTERVAL_SECS {
            return false;
        }
        tour.looked_at = tour.elapsed;
        let TourStep { reading_secs, limit_secs, .. } = tour.current();
        let is_read = tour.seen_at.is_some_and(|at| tour.elapsed >= at + reading_secs);
        let is_over = is_read || tour.elapsed >= *limit_secs;
        if is_over {
            self.next_step(cx);
            return true;
        }
        tour.look(cx)
    }
}

/// What it does and sees on the screen.
impl Tour {
    fn enter(&mut self, cx: &mut Cx) {
        (self.elapsed, self.looked_at) = (0.0, 0.0);
        self.seen_at = None;
        (self.current().enter)(self, cx);
        self.look(cx);
    }

    /// Looks what has become of the step's subject; returns whether the caption changes.
    fn look(&mut self, cx: &mut Cx) -> bool {
        let Some(caption) = (self.current().look)(self, cx) else { return false };
        if caption.seen {
            self.seen_at.get_or_insert(self.elapsed);
        }
        let title = format!("{}/{} {}", self.step + 1, STEPS.len(), self.current().title);
        let shown = ShownStep { step: self.step, title, is_last: self.is_last(), caption };
        let before = cx.screen.tour.replace(shown);
        before.map(|before| before.caption)
            != cx.screen.tour.as_ref().map(|now| now.caption.clone())
    }

    fn send_walker(&mut self, cx: &mut Cx) {
        maze::place_walker(self.start, &mut cx.screen);
    }

    fn aim_at(&mut self, goal: Cell, cx: &mut Cx) {
        cx.in_maze(|maze, screen| maze.set_goal(goal, screen));
        self.send_walker(cx);
    }

    fn hide_bridge(&mut self, cx: &mut Cx) {
        cx.screen.explained = None;
        if cx.screen.field == Field::OverEach {
            watching::show_field(cx, Field::Learned);
        }
        if std::mem::take(&mut self.shows_search) {
            show_overlay(Overlay::Search, false, cx);
        }
    }

    /// Opens the door that the tour has closed, if any; returns whether it is open.
    fn open_door(&mut self, cx: &mut Cx) -> bool {
        let open = edit_cells(&self.closed, true, cx);
        if open {
            self.closed.clear();
        }
        open
    }
}

/// Shows or hides an overlay; returns whether that changed anything.
fn show_overlay(overlay: Overlay, shown: bool, cx: &mut Cx) -> bool {
    let changes = cx.screen.overlays.has(overlay) != shown;
    if changes {
        cx.screen.overlays.toggle(overlay);
        cx.scene.act(Action::Toggle(overlay), &mut cx.screen);
    }
    changes
}

/// Makes cells free or walls, as the editor does; returns whether they are.
fn edit_cells(cells: &[Cell], free: bool, cx: &mut Cx) -> bool {
    cx.in_maze(|maze, screen| {
        let map = maze.map.clone();
        let inside = |cell: &&Cell| map.contains(**cell);
        let done = |map: &Grid| cells.iter().filter(inside).all(|cell| map.is_free(*cell) == free);
        if !done(&map) {
            let changed = map.with_cells(cells.iter().map(|cell| (*cell, free)));
            let new = changed.filter(|new| *new != *map).map(Arc::new);
            maze.change_map(new, screen);
        }
        done(&maze.map)
    })
}

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

const SEARCHES_PER_SECOND: f32 = 3.0;

/// How many times as far it must be round a closed door.
const LONGER: f32 = 2.5;

/// Cells between the points by which it is found which door a way leads through.
const SPACING: f32 = 2.0;

pub struct TourStep {
    pub title: &'static str,
    /// Seconds to read it after its subject has been seen, and until it ends anyway.
    pub reading_secs: f32,
    pub limit_secs: f32,
    pub enter: fn(&mut Tour, &mut Cx),
    /// What it says now.
    pub look: fn(&mut Tour, &mut Cx) -> Option<Caption>,
}

const fn step(
    title: &'static str,
    [reading_secs, limit_secs]: [f32; 2],
    enter: fn(&mut Tour, &mut Cx),
    look: fn(&mut Tour, &mut Cx) -> Option<Caption>,
) -> TourStep {
    TourStep { title, reading_secs, limit_secs, enter, look }
}

pub const STEPS: &[TourStep] = &[
    step("No reward", [8.0, 8.0], |tour, cx| tour.aim_at(GOAL_AT_WALL, cx), wandering),
    step("D bends", [7.0, 25.0], |_, _| {}, bending),
    step("A bridge", [16.0, 45.0], |_, _| {}, explain_bridge),
    step("A plan", [1.5, 16.0], aim_far, plan),
    step("A door closes", [5.0, 24.0], close_door, closed),
    step("Now you", [40.0, 40.0], open_door, now_you),
];

fn distance_to_goal(maze: &MazeState, screen: &Screen, from: [f32; 2]) -> f32 {
    let policy = &screen.snapshot.networks.policy;
    policy.distance(&from, &maze.goal.centre(), &mut Scratch::default())
}

/// Returns points along the lines that connect `stops`.
fn points_along(stops: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let between = |ends: &[[f32; 2]]| {
        let count = (straight(ends[0], ends[1]) / SPACING).ceil().max(1.0);
        positions_along([ends[0], ends[1]], count as usize)
    };
    stops.windows(2).flat_map(between).collect()
}

/// Returns the steps between two positions without walls: a cell a step along each axis.
fn straight(from: [f32; 2], to: [f32; 2]) -> f32 {
    (from[0] - to[0]).abs().max((from[1] - to[1]).abs())
}

fn wandering(_: &mut Tour, Cx { screen, scene, .. }: &mut Cx) -> Option<Caption> {
    scene.maze()?;
    let text = if screen.theme.depth == ColourDepth::Mono {
        "The o are agents that wander about. Nobody rewards them. Shades show what they learn: D, the number of steps to G. \
         The denser, the farther."
    } else {
        "The white squares are agents that wander about. Nobody rewards them. Colours show what they learn: D, the number of \
         steps to G. Light is near, dark is far."
    };
    Some(Caption { text: text.to_owned(), marks: Vec::new(), seen: true })
}

fn bending(_: &mut Tour, Cx { screen, scene, .. }: &mut Cx) -> Option<Caption> {
    let maze = scene.maze()?;
    let (behind, goal) = (BEHIND_WALL.centre(), maze.goal.centre());
    let (straight, learned) = (straight(behind, goal), distance_to_goal(maze, screen, behind));
    let open = distance_to_goal(maze, screen, SAME_ROOM.centre());
    let seen = open >= PLAUSIBLE * straight && learned >= BENT * open.max(straight);
    let then =
        if seen { "D has learned to go round the wall." } else { "Watch it learn about the wall." };
    let text = format!(
        "From P, G would be {straight:.0} steps away, were there no wall. Learned so far: D = {learned:.0}. {then} Lines \
         connect places with the same D."
    );
    Some(Caption { text, marks: vec![(behind, 'P')], seen })
}

/// Looks for a bridge, and puts start and goal at its ends.
fn find_bridge(tour: &mut Tour, cx: &mut Cx) {
    // A search takes a moment.
    if (tour.searches as f32) > SEARCHES_PER_SECOND * tour.elapsed {
        return;
    }
    tour.searches += 1;
    let (networks, Some(maze)) = (&cx.screen.snapshot.networks, cx.scene.maze()) else { return };
    let Some(found) = bridge::find(networks, &maze.map, tour.searches) else { return };
    let [start, point, goal] = found.stops;
    let bridge = BridgePoint { point: point.to_vec(), gain: found.gain() };
    cx.screen.explained = Some(Arc::new(SearchOutcome {
        state: start.to_vec(),
        goal: goal.to_vec(),
        found: Some(bridge),
        ..SearchOutcome::default()
    }));
    let cell = |at: [f32; 2]| Cell::new(at[0] as usize, at[1] as usize);
    (tour.start, tour.bridge) = (Some(cell(start)), Some(found));
    tour.aim_at(cell(goal), cx);
    watching::set_on_arrival(cx, OnArrival::Wait);
    watching::show_field(cx, Field::OverEach);
    tour.shows_search |= show_overlay(Overlay::Search, true, cx);
}

fn explain_bridge(tour: &mut Tour, cx: &mut Cx) -> Option<Caption> {
    if tour.bridge.is_none() {
        find_bridge(tour, cx);
    }
    let maze = cx.scene.maze()?;
    let walk = &maze.view.reach;
    let Some(TourBridge { stops: [start, ..], distances: [first, second, direct] }) = tour.bridge
    else {
        let text = format!(
            "Wait for a bridge: a place B between S and G with D(S,B) + D(B,G) far below D(S,G). Searched {} times so far, among the dots.",
            tour.searches
        );
        return Some(Caption { text, ..Caption::default() });
    };
    // What is seen may still be the walk before.
    let is_own = walk.start == start && maze.view.goal.1 == cx.screen.goal_request;
    let steps = if is_own { walk.steps } else { 0 };
    let state = if is_own && walk.arrived { "is there after" } else { "has taken" };
    let so = if steps as f32 > direct { ", more than D says: it still learns" } else { "" };
    let text = format!(
        "D(S,G) = {direct:.0} steps, but over B, along the line, D says less: D(S,B) + D(B,G) = {first:.0} + {second:.0} = \
         {:.0}. D is better at short ways than at long ones: a bridge makes one hard task two easier ones. @ walks from S to \
         G and {state} {steps} steps{so}. The map shows D(S,.) + D(.,G), least at good bridges.",
        first + second
    );
    Some(Caption { text, marks: Vec::new(), seen: true })
}

fn aim_far(tour: &mut Tour, cx: &mut Cx) {
    tour.hide_bridge(cx);
    watching::set_on_arrival(cx, OnArrival::Again);
    tour.start = Some(START);
    tour.aim_at(FAR_GOAL, cx);
}

fn plan(tour: &mut Tour, Cx { scene, .. }: &mut Cx) -> Option<Caption> {
    let maze = scene.maze()?;
    let path = points_along(&maze.way());
    if path.len() > tour.route.len() {
        tour.route = path;
    }
    let text =
        "G is now in the far room. The line to it is the plan: from bridge to bridge, each near \
                enough to be reached reliably. @ walks it."
            .to_owned();
    let seen = maze.view.reach.arrived && tour.elapsed > 1.0;
    Some(Caption { text, marks: Vec::new(), seen })
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
    tour.watched = (before.centre(), distance);
    let door = cells_between(*corners);
    if edit_cells(&door, false, cx) {
        tour.closed = door;
    }
    tour.send_walker(cx);
}

fn closed(tour: &mut Tour, Cx { screen, scene, .. }: &mut Cx) -> Option<Caption> {
    let maze = scene.maze()?;
    let (place, before) = tour.watched;
    let now = distance_to_goal(maze, screen, place);
    let followed = if now.round() > before.round() {
        format!("D follows: from P, in front of it, it was {before:.0}, now {now:.0}.")
    } else {
        format!("D will follow: from P, in front of it, it is still {now:.0}.")
    };
    let text = format!(
        "A wall now closes this door: you can draw one with {}. The plan changes at once. {followed}",
        screen.keymap.key_of(Action::ToggleEdit)
    );
    Some(Caption { text, marks: vec![(place, 'P')], seen: now >= LONGER * before })
}

fn open_door(tour: &mut Tour, cx: &mut Cx) {
    tour.open_door(cx);
    tour.send_walker(cx);
}

fn now_you(_: &mut Tour, Cx { screen, scene, .. }: &mut Cx) -> Option<Caption> {
    scene.maze()?;
    let key = |action| screen.keymap.key_of(action);
    let text = format!(
        "The door is open again. Click anywhere: @ walks there. {} adds the actor alone, {} draws walls, {} helps. \
         Training goes on. What bridges do, in ten seconds: gdg-tui compare gdg-bridge gdg trap",
        key(Action::Toggle(Overlay::Ghost)),
        key(Action::ToggleEdit),
        key(Action::Help)
    );
    Some(Caption { text, marks: Vec::new(), seen: true })
}
