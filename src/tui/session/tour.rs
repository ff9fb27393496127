//! The guided tour: a minute and a half on the four rooms, with captions beside what they explain.
//!
//! `steps` is the table of steps. This file moves through it: a step ends a while after what it
//! explains has been seen, or at its time limit. Whatever the tour does, it does by the same
//! commands as the user.

mod bridges;
mod steps;

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{Cx, view};
use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::raster::Viewport;
use crate::tui::scene::maze::{self, maze_on};
use crate::tui::screen::{Caption, Screen, ShownStep};
use bridges::BridgeHunt;
use gdg::engine::Command;
use gdg::map::{Cell, Grid, builtin};
use gdg::train::{Method, Preset, Run};
use gdg::viewer::{Field, OnArrival};
pub use steps::MAP;
#[cfg(test)]
pub use steps::STEPS as ALL_STEPS;
use steps::{START, STEPS, Step};

/// Seconds between two looks at what has become of the step's subject, and between two walks.
const LOOK_INTERVAL_SECS: f32 = 0.1;
const REST_SECS: f32 = 2.0;

/// A place whose D to the goal is watched.
#[derive(Clone, Copy, Default)]
struct Watched {
    place: [f32; 2],
    /// D before the door was closed.
    before: f32,
    /// The most that it was since.
    most: f32,
}

/// The state of a tour.
pub struct Tour {
    step: usize,
    /// Seconds since the step began, not counting pauses; and at the latest look.
    elapsed: f32,
    looked_at: f32,
    /// When the step's subject was seen.
    seen_at: Option<f32>,
    /// Looks for a bridge, until one is explained.
    hunt: BridgeHunt,
    /// Whether the bridge that has been found is drawn.
    shows_bridge: bool,
    /// Whether the step begins again, as what it waited for has been found.
    enters_again: bool,
    /// Where the agent walks from, and whether it stays where it arrives.
    start: Cell,
    stays: bool,
    /// The way to the far room, as planned before a door was closed.
    route: Vec<[f32; 2]>,
    /// The cells of the closed door.
    closed: Vec<Cell>,
    /// What is watched while the door is closed.
    watched: Watched,
    /// When the agent was seen to have arrived, until it is sent off again.
    arrived_at: Option<f32>,
    /// Whether the tour shows searches, which the user did not.
    shows_search: bool,
    /// What the walking agent did on arrival before the tour.
    on_arrival: OnArrival,
    ticked: Instant,
}

impl Tour {
    fn current(&self) -> &'static Step {
        &STEPS[self.step]
    }

    fn is_last(&self) -> bool {
        self.step + 1 == STEPS.len()
    }

    fn shown(&self, caption: Caption) -> ShownStep {
        let title = format!("{}/{} {}", self.step + 1, STEPS.len(), self.current().title);
        ShownStep { step: self.step, title, is_last: self.is_last(), caption }
    }

    fn is_over(&self) -> bool {
        let read = self.seen_at.is_some_and(|at| self.elapsed >= at + self.current().reading_secs);
        read || self.elapsed >= self.current().limit_secs
    }
}

/// Returns the run that the tour shows: always the same.
pub fn run() -> Run {
    let preset = Preset::Default;
    Run { method: Method::default(), preset, seed: 0, settings: preset.settings() }
}

/// Leads through the tour, while there is one.
#[derive(Default)]
pub struct Guide {
    tour: Option<Tour>,
    /// Whether the tour begins with the next run.
    pub is_requested: bool,
}

impl Guide {
    pub fn request(&mut self, cx: &mut Cx) {
        if let Some(map) = builtin(MAP) {
            let start = Command::StartRun(Box::new(run()), maze_on(Arc::new(map)));
            self.is_requested = cx.command(start);
        }
    }

    pub fn begin(&mut self, cx: &mut Cx) {
        if let Some(maze) = cx.scene.maze_mut() {
            maze.editor.close();
            maze.viewport = Viewport::default();
        }
        cx.screen.maximised = false;
        for overlay in [Overlay::Contours, Overlay::Agents, Overlay::Path] {
            show_overlay(overlay, true, cx);
        }
        view::show_field(cx, Field::Learned);
        let tour = self.tour.insert(Tour {
            step: 0,
            elapsed: 0.0,
            looked_at: 0.0,
            seen_at: None,
            hunt: BridgeHunt::default(),
            shows_bridge: false,
            enters_again: false,
            start: START,
            stays: false,
            route: Vec::new(),
            closed: Vec::new(),
            watched: Watched::default(),
            arrived_at: None,
            shows_search: false,
            on_arrival: cx.screen.on_arrival,
            ticked: Instant::now(),
        });
        view::set_on_arrival(cx, OnArrival::Wait);
        tour.enter(cx);
    }

    /// Goes to the next step; after the last one, the tour is over.
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
            view::set_on_arrival(cx, tour.on_arrival);
            self.forget(&mut cx.screen);
            // The line about what there is to see would repeat it.
            cx.screen.on_first_use();
        }
    }

    pub fn forget(&mut self, screen: &mut Screen) {
        (self.tour, screen.tour, screen.explained) = (None, None, None);
    }

    /// Handles the passing of time; returns whether the screen changes.
    pub fn on_tick(&mut self, cx: &mut Cx) -> bool {
        let Some(tour) = &mut self.tour else { return false };
        let now = Instant::now();
        let passed = now - std::mem::replace(&mut tour.ticked, now);
        self.advance(passed, cx)
    }

    /// Moves the tour on by some time, unless it is paused; returns whether the screen changes.
    pub fn advance(&mut self, passed: Duration, cx: &mut Cx) -> bool {
        let Some(tour) = self.tour.as_mut().filter(|_| !is_waiting(&cx.screen)) else {
            return false;
        };
        tour.elapsed += passed.as_secs_f32();
        if tour.elapsed - tour.looked_at < LOOK_INTERVAL_SECS {
            return false;
        }
        tour.looked_at = tour.elapsed;
        let over = tour.is_over();
        tour.walk_again(cx);
        if over {
            self.next_step(cx);
            return true;
        }
        if std::mem::take(&mut tour.enters_again) {
            tour.enter(cx);
            return true;
        }
        tour.look(cx)
    }
}

/// What it does and sees on the screen.
impl Tour {
    fn enter(&mut self, cx: &mut Cx) {
        (self.elapsed, self.looked_at) = (0.0, 0.0);
        (self.arrived_at, self.seen_at) = (None, None);
        self.stays = false;
        (self.current().enter)(self, cx);
        self.look(cx);
    }

    /// Looks what has become of the step's subject; returns whether the caption changes.
    fn look(&mut self, cx: &mut Cx) -> bool {
        let Cx { screen, scene, .. } = cx;
        let Some(maze) = scene.maze() else { return false };
        let caption = (self.current().look)(maze, screen, self);
        if caption.seen {
            self.seen_at.get_or_insert(self.elapsed);
        }
        let before = screen.tour.take();
        let changed = before.is_none_or(|before| before.caption != caption);
        screen.tour = Some(self.shown(caption));
        let shown = self.hunt.best.as_ref().filter(|_| self.shows_bridge);
        screen.explained = shown.map(|bridge| bridge.search.clone());
        changed
    }

    fn send_walker(&mut self, cx: &mut Cx) {
        maze::place_walker(Some(self.start), &mut cx.screen, &cx.link);
        self.arrived_at = None;
    }

    /// Sends the agent off again a while after it has arrived.
    fn walk_again(&mut self, cx: &mut Cx) {
        let walk = cx.scene.maze().map(|maze| &maze.view.reach);
        if !walk.is_some_and(|walk| walk.arrived || walk.gave_up) {
            self.arrived_at = None;
            return;
        }
        let arrived_at = *self.arrived_at.get_or_insert(self.elapsed);
        if !self.stays && self.elapsed - arrived_at > REST_SECS {
            self.send_walker(cx);
        }
    }

    fn aim_at(&mut self, goal: Cell, cx: &mut Cx) {
        cx.in_maze(|maze, screen, link| maze.set_goal(goal, screen, link));
        self.send_walker(cx);
    }

    fn hide_bridge(&mut self, cx: &mut Cx) {
        cx.screen.explained = None;
        if std::mem::take(&mut self.shows_bridge) && cx.screen.field.depends_on_start() {
            view::show_field(cx, Field::Learned);
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
        view::toggle_overlay(cx, Action::Toggle(overlay));
    }
    changes
}

/// Makes cells free or walls, as the editor does; returns whether they are.
fn edit_cells(cells: &[Cell], free: bool, cx: &mut Cx) -> bool {
    cx.in_maze(|maze, screen, link| {
        let map = maze.map.clone();
        let inside = |cell: &&Cell| map.contains(**cell);
        let done = |map: &Grid| cells.iter().filter(inside).all(|cell| map.is_free(*cell) == free);
        if !done(&map) {
            let changed = map.with_cells(cells.iter().map(|cell| (*cell, free)));
            let new = changed.filter(|new| *new != *map).map(Arc::new);
            maze.change_map(new, screen, link);
        }
        done(&maze.map)
    })
}

/// Whether the tour is paused: while training is, and while something hides the map.
fn is_waiting(screen: &Screen) -> bool {
    let training = screen.snapshot.phase.is_training() && !screen.pausing;
    !training || screen.frozen || screen.maximised || !screen.dialogs.is_empty()
}
