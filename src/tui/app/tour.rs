//! The guided tour: a minute and a half on the four rooms, with captions beside what they explain.
//!
//! `steps` is the table of steps. This file moves through it: a step ends a while after what it
//! explains has been seen, or at its time limit. Whatever the tour does, it does by the same
//! commands as the user.

mod steps;

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::App;
use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::raster::Viewport;
use crate::tui::scene::maze::maze_on;
use crate::tui::screen::Screen;
use crate::tui::tour::{Caption, ShownStep};
use gdg::engine::Command;
use gdg::map::{Cell, Grid, builtin};
use gdg::train::{Method, Preset, Run};
use gdg::viewer::{Field, OnArrival};
pub use steps::MAP;
#[cfg(test)]
pub use steps::STEPS as ALL_STEPS;
use steps::{FoundBridge, START, STEPS, Step};

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
    /// The bridge search that is explained: later ones must not replace it.
    bridge: Option<FoundBridge>,
    /// The way to the far room, as planned before a door was closed.
    route: Vec<[f32; 2]>,
    /// The cells of the closed door.
    closed: Vec<Cell>,
    /// What is watched while the door is closed.
    watched: Watched,
    /// When the agent was last sent to walk.
    sent_at: f32,
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

    /// Returns what is shown of the current step.
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

impl App {
    /// Starts the tour's run, with which the tour begins.
    pub(super) fn start_tour_run(&mut self) {
        let Some(map) = builtin(MAP) else { return };
        self.tour_requested =
            self.command(Command::StartRun(Box::new(run()), maze_on(Arc::new(map))));
    }

    /// Begins the tour of the run that is shown.
    pub(in crate::tui) fn begin_tour(&mut self) {
        if let Some(maze) = self.scene.maze_mut() {
            maze.editor.close();
            maze.viewport = Viewport::default();
        }
        (self.screen.maximised, self.screen.following) = (false, None);
        if self.screen.frozen {
            self.freeze(false);
        }
        for overlay in [Overlay::Contours, Overlay::Agents, Overlay::Path] {
            self.show_overlay(overlay, true);
        }
        self.show_field(Field::Learned);
        let on_arrival = self.screen.on_arrival;
        self.set_on_arrival(OnArrival::Wait);
        self.tour = Some(Tour {
            step: 0,
            elapsed: 0.0,
            looked_at: 0.0,
            seen_at: None,
            bridge: None,
            route: Vec::new(),
            closed: Vec::new(),
            watched: Watched::default(),
            sent_at: 0.0,
            shows_search: false,
            on_arrival,
            ticked: Instant::now(),
        });
        (STEPS[0].enter)(self);
        self.look();
    }

    /// Shows or hides an overlay; returns whether that changed anything.
    fn show_overlay(&mut self, overlay: Overlay, shown: bool) -> bool {
        let changes = self.screen.overlays.has(overlay) != shown;
        if changes {
            self.act(Action::Toggle(overlay));
        }
        changes
    }

    /// Goes to the next step; after the last one, the tour is over.
    pub(super) fn next_tour_step(&mut self) {
        match &mut self.tour {
            Some(tour) if tour.is_last() => self.end_tour(),
            Some(tour) => {
                tour.step += 1;
                (tour.elapsed, tour.looked_at, tour.sent_at, tour.seen_at) = (0.0, 0.0, 0.0, None);
                let enter = tour.current().enter;
                enter(self);
                self.look();
            }
            None => {}
        }
    }

    /// Ends the tour and leaves the trainer as the user would have found it.
    pub(super) fn end_tour(&mut self) {
        self.hide_search();
        // If the trainer is busy, the tour goes on until the door is open.
        if self.open_door()
            && let Some(tour) = self.tour.take()
        {
            self.forget_tour();
            self.set_on_arrival(tour.on_arrival);
            // The line about what there is to see would repeat it.
            self.screen.on_first_use();
        }
    }

    /// Handles the passing of time; returns whether the screen changes.
    pub(super) fn on_tour_tick(&mut self) -> bool {
        let Some(tour) = &mut self.tour else { return false };
        let now = Instant::now();
        let passed = now - std::mem::replace(&mut tour.ticked, now);
        self.advance_tour(passed)
    }

    /// Moves the tour on by some time, unless it is paused.
    pub(in crate::tui) fn advance_tour(&mut self, passed: Duration) -> bool {
        let waits = is_waiting(&self.screen);
        let Some(tour) = self.tour.as_mut().filter(|_| !waits) else { return false };
        tour.elapsed += passed.as_secs_f32();
        if tour.elapsed - tour.looked_at < LOOK_INTERVAL_SECS {
            return false;
        }
        tour.looked_at = tour.elapsed;
        let over = tour.is_over();
        self.walk_again();
        if over {
            self.next_tour_step();
            return true;
        }
        self.look()
    }

    /// Looks what has become of the step's subject; returns whether the caption changes.
    fn look(&mut self) -> bool {
        let (Some(tour), Some(maze)) = (&mut self.tour, self.scene.maze()) else { return false };
        let caption = (tour.current().look)(maze, &self.screen, tour);
        if caption.seen {
            tour.seen_at.get_or_insert(tour.elapsed);
        }
        let before = self.screen.tour.take();
        let changed = before.is_none_or(|before| before.caption != caption);
        self.screen.tour = Some(tour.shown(caption));
        self.screen.explained = tour.bridge.as_ref().map(|bridge| bridge.search.clone());
        changed
    }

    /// Shows nothing of a tour any more.
    pub(super) fn forget_tour(&mut self) {
        (self.tour, self.screen.tour, self.screen.explained) = (None, None, None);
    }

    /// Sends the agent from its start to the goal.
    fn send_walker(&mut self) {
        self.place_walker(Some(START));
        if let Some(tour) = &mut self.tour {
            tour.sent_at = tour.elapsed;
        }
    }

    /// Sends the agent off again a while after it has arrived.
    fn walk_again(&mut self) {
        let Some(walk) = self.scene.maze().map(|maze| maze.view.walk) else { return };
        let rested = self.tour.as_ref().is_some_and(|tour| tour.elapsed - tour.sent_at > REST_SECS);
        if (walk.arrived || walk.gave_up) && rested {
            self.send_walker();
        }
    }

    fn hide_search(&mut self) {
        let Some(tour) = &mut self.tour else { return };
        tour.bridge = None;
        self.screen.explained = None;
        if std::mem::take(&mut tour.shows_search) {
            self.show_overlay(Overlay::Search, false);
        }
    }

    /// Draws a wall across a door, as the editor does.
    fn close_door(&mut self, cells: Vec<Cell>) {
        if self.edit_cells(&cells, false)
            && let Some(tour) = &mut self.tour
        {
            tour.closed = cells;
        }
    }

    /// Opens the door that the tour has closed, if any; returns whether it is open.
    fn open_door(&mut self) -> bool {
        let cells =
            self.tour.as_mut().map(|tour| std::mem::take(&mut tour.closed)).unwrap_or_default();
        let open = self.edit_cells(&cells, true);
        if let (false, Some(tour)) = (open, &mut self.tour) {
            tour.closed = cells;
        }
        open
    }

    /// Makes cells free or walls; returns whether they are.
    fn edit_cells(&mut self, cells: &[Cell], free: bool) -> bool {
        self.in_maze(|maze, screen, link| {
            let map = maze.map.clone();
            let inside = |cell: &&Cell| map.contains(**cell);
            let done =
                |map: &Grid| cells.iter().filter(inside).all(|cell| map.is_free(*cell) == free);
            if !done(&map) {
                let changed = map.with_cells(cells.iter().map(|cell| (*cell, free)));
                let new = changed.and_then(|new| maze.editor.record(&map, new));
                maze.change_map(new, screen, link);
            }
            done(&maze.map)
        })
    }
}

/// Whether the tour is paused: while training is, and while something hides the map.
fn is_waiting(screen: &Screen) -> bool {
    let training = screen.snapshot.phase.is_training() && !screen.pausing;
    !training || screen.frozen || screen.maximised || !screen.dialogs.is_empty()
}
