//! A run on the screen: forwards what the user does to trainer and viewer, and what they publish to
//! the screen.
//!
//! What commands do with it: `watching`, `change_run`, `disk`, `saving`, `tour`. `answer`:
//! dialogs and their answers. `elsewhere`: a run that another program trains.

pub mod answer;
pub mod change_run;
pub mod disk;
pub mod elsewhere;
pub mod saving;
mod tour;
pub mod watching;

use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::time::Duration;

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::Frame;
use ratatui::layout::Position;
use tokio::sync::watch;

use super::action::{Action, Mode, binding_of};
use super::config::UiConfig;
use super::dialog::Dialog;
use super::interface::TerminalRequest;
use super::keymap::Keymap;
use super::layout::ScreenLayout;
use super::lists;
use super::render;
use super::render::dialog::draw_dialog;
use super::scene::{Cache, MazeState, Scene};
use super::screen::{BANNER_DURATION, PATIENCE, Screen};
use disk::ShowResult;
use elsewhere::TrainedElsewhere;
use gdg::engine::{EngineLink, NextEvaluation, Phase, Snapshot};
use gdg::job::Running;
use gdg::text::grouped;
use gdg::train::{Evaluation, SaveTo};
use gdg::viewer::{Field, Request, View, Viewer};
use saving::Saver;
#[cfg(test)]
pub use tour::STEPS as ALL_STEPS;
use tour::TourGuide;
pub use tour::{MAP as TOUR_MAP, run as tour_run};

/// The success of an actor that has learned what plans have found.
const LEARNED: f64 = 0.9;

/// What commands act on: the screen, which leads to trainer and viewer, and what is drawn in the
/// place of the map.
pub struct Cx {
    pub screen: Screen,
    pub scene: Scene,
    pub writing: Option<Running<ShowResult>>,
    /// What is being read, and how long to wait for that before the interface goes on.
    pub reading: Option<Running<ShowResult>>,
    pub reading_patience: Duration,
}

impl Cx {
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.screen.engine.snapshots()
    }

    pub fn views(&self) -> watch::Receiver<Arc<View>> {
        self.screen.viewer.views()
    }

    /// Lets the maze react to something, if the scene is one.
    pub fn in_maze<T: Default>(&mut self, act: impl FnOnce(&mut MazeState, &mut Screen) -> T) -> T {
        let Self { screen, scene, .. } = self;
        scene.maze_mut().map_or_else(T::default, |maze| act(maze, screen))
    }
}

/// A run on the screen, and what goes on around it.
pub struct Session {
    pub cx: Cx,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    views: watch::Receiver<Arc<View>>,
    pub saver: Saver,
    pub guide: TourGuide,
    /// The run, if another program trains it.
    pub elsewhere: Option<TrainedElsewhere>,
    /// What the terminal has been asked to do.
    pub terminal_request: Option<TerminalRequest>,
    /// What the next frame can reuse.
    pub cache: Cache,
}

impl Deref for Session {
    type Target = Cx;

    fn deref(&self) -> &Cx {
        &self.cx
    }
}

impl DerefMut for Session {
    fn deref_mut(&mut self) -> &mut Cx {
        &mut self.cx
    }
}

impl Session {
    /// Opens the screen on the run of `engine`, with the goal that the run was saved with, the map's
    /// own or a random one; `viewer` computes what it shows.
    pub fn new(
        engine: EngineLink,
        viewer: Viewer,
        config: &UiConfig,
        keymap: Keymap,
        save: Option<SaveTo>,
    ) -> Self {
        let (snapshots, views) = (engine.snapshots(), viewer.views());
        let snapshot = snapshots.borrow().clone();
        let cx = Cx {
            scene: Scene::of(&snapshot),
            screen: Screen::new(config, keymap, engine, viewer),
            writing: None,
            reading: None,
            reading_patience: PATIENCE,
        };
        let mut session = Self {
            cx,
            snapshots,
            views,
            saver: Saver::new(save, config.autosave_minutes),
            guide: TourGuide::default(),
            elsewhere: None,
            terminal_request: None,
            cache: Cache::with_pictures(),
        };
        session.start_run();
        session
    }

    fn start_run(&mut self) {
        let Self { cx, saver, guide, .. } = self;
        saver.start_run(&cx.screen.snapshot);
        cx.screen.log.start_run(&cx.screen.snapshot.notes.log);
        guide.forget(&mut cx.screen);
        cx.screen.return_to_present();
        cx.screen.layout = ScreenLayout::default();
        cx.scene.enter(&cx.screen.snapshot);
        if !cx.scene.has_field(cx.screen.field, &cx.screen) {
            cx.screen.field = Field::default();
        }
        // Another kind of scene has a worker of its own, which does not know these yet.
        cx.screen.request(Request::Field(cx.screen.field));
        cx.screen.request(Request::OnArrival(cx.screen.on_arrival));
        cx.scene.start(&mut cx.screen);
    }

    pub fn begin_tour(&mut self) {
        self.guide.begin(&mut self.cx);
    }

    pub fn mode(&self) -> Mode {
        self.scene.mode(&self.screen)
    }

    pub fn is_training(&self) -> bool {
        self.screen.snapshot.phase.is_training()
    }

    pub fn open(&mut self, dialog: impl Into<Dialog>) {
        self.screen.open(dialog);
    }

    pub fn act(&mut self, action: Action) {
        binding_of(action).into_iter().for_each(|binding| binding.perform(self));
    }

    pub fn ask_terminal(&mut self, request: TerminalRequest) {
        self.terminal_request = Some(request);
    }

    pub fn quit(&mut self) {
        self.catch_up();
        self.saver.quit(&mut self.cx);
    }

    pub fn on_mouse(&mut self, kind: MouseEventKind, at: Position) {
        let moves_on = self.moves_tour_on(kind);
        let Cx { screen, scene, .. } = &mut self.cx;
        if !moves_on && !screen.maximised {
            scene.on_mouse(kind, at, screen);
        }
    }

    /// Has a click move the tour on; returns whether that is all it does. The click that ends the
    /// tour sets a goal.
    fn moves_tour_on(&mut self, kind: MouseEventKind) -> bool {
        let Some(tour) = self.screen.tour.as_ref().filter(|_| !self.scene.is_editing()) else {
            return false;
        };
        let last = tour.is_last;
        match kind {
            MouseEventKind::Down(MouseButton::Left) => self.act(Action::NextTourStep),
            MouseEventKind::Drag(MouseButton::Left) => {}
            _ => return false,
        }
        !last
    }

    /// Waits for the next snapshot or view, and shows it. Nothing is lost if the future is dropped.
    pub async fn update(&mut self) {
        tokio::select! {
            Ok(()) = self.snapshots.changed() => {
                self.show_latest();
            }
            Ok(()) = self.views.changed() => {
                let view = self.views.borrow_and_update().clone();
                self.on_view(view);
            }
            // Both threads have ended.
            else => std::future::pending().await,
        }
    }

    /// Handles the passing of time; returns whether the screen changes.
    pub fn on_tick(&mut self) -> bool {
        let Self { cx, saver, guide, .. } = self;
        saver.on_tick(cx);
        let dropped = cx.screen.banner.take_if(|since| since.elapsed() > BANNER_DURATION).is_some();
        let tour_changed = guide.on_tick(cx);
        let log_changed = cx.screen.log.on_tick();
        let read = disk::on_tick(cx);
        let busy_changed = self.update_busy();
        self.follow_files() || read || log_changed || dropped || tour_changed || busy_changed
    }

    /// Looks at what the trainer is doing; returns whether the screen changes.
    pub fn update_busy(&mut self) -> bool {
        let Cx { screen, .. } = &mut self.cx;
        let evaluating = match screen.snapshot.next_evaluation {
            NextEvaluation::Running(_) => screen.snapshot.evaluation_progress.short(),
            _ => None,
        };
        let now = (screen.busy_with().map(|job| job.to_string()), evaluating);
        let changed = now != (screen.busy.take(), screen.evaluating.take());
        (screen.busy, screen.evaluating) = now;
        changed
    }

    pub fn on_snapshot(&mut self, snapshot: Arc<Snapshot>) {
        let snapshot = match &self.elsewhere {
            Some(run) => Arc::new(run.with_records(&snapshot, &self.screen.snapshot)),
            None => snapshot,
        };
        let before = std::mem::replace(&mut self.screen.snapshot, snapshot);
        let screen = &mut self.cx.screen;
        if screen.snapshot.generation != before.generation {
            self.start_run();
        } else if screen.snapshot.evaluations.len() > before.evaluations.len() {
            log_evaluation(screen);
        }
        let Cx { screen, scene, .. } = &mut self.cx;
        if screen.snapshot.made_edits > before.made_edits
            && let Some(maze) = scene.maze_mut()
        {
            maze.follow(screen);
        }
        if self.screen.run() != &*before.run {
            let screen = &mut self.cx.screen;
            screen.update_changed_settings();
            let items: Vec<_> = lists::settings(screen).items().cloned().collect();
            for dialog in &mut screen.dialogs {
                match dialog {
                    Dialog::Pick(list) if list.stays => list.update(items.clone()),
                    _ => {}
                }
            }
        }
        let then = self.saver.on_snapshot(&before, &mut self.cx);
        then.into_iter().for_each(|then| self.choose(then));
        let Self { cx, saver, .. } = self;
        let latest = cx.screen.snapshot.clone();
        cx.screen.pausing &= latest.phase.is_training();
        let notice = &latest.notice;
        if notice.number > before.notice.number {
            if notice.is_error {
                cx.screen.report(&notice.text);
            } else {
                cx.screen.notify(&notice.text);
            }
        }
        match &latest.phase {
            Phase::Failed(error) if before.phase != latest.phase => {
                cx.screen.report(&format!("training stopped: {error}"));
                if !saver.has_failed {
                    saver.show_failure("training has stopped", error, &mut cx.screen);
                }
            }
            Phase::Done if before.phase.is_training() => {
                let key = cx.screen.keymap.key_of(Action::TogglePause);
                cx.screen.notify(&format!("done: limit reached; {key} continues without it"));
                if saver.named.is_some() {
                    saver.request_save(cx);
                }
            }
            _ => {}
        }
    }

    pub fn catch_up(&mut self) {
        if self.snapshots.has_changed().unwrap_or(true) {
            self.show_latest();
        }
    }

    pub fn show_latest(&mut self) {
        let snapshot = self.snapshots.borrow_and_update().clone();
        self.on_snapshot(snapshot);
    }

    pub fn on_view(&mut self, view: Arc<View>) {
        let Cx { screen, scene, .. } = &mut self.cx;
        scene.show(view, screen);
    }

    pub fn draw(&mut self, frame: &mut Frame) {
        self.cache.begin();
        let Cx { screen, scene, .. } = &self.cx;
        let mut layout = render::draw(frame, screen, scene, &mut self.cache);
        draw_dialog(frame, screen, screen.log.notice(), &mut layout);
        render::finish_frame(frame, &screen.theme);
        self.drawn(layout);
    }

    /// Handles a drawn frame: keeps places for clicks, and asks for what its pixels show.
    pub fn drawn(&mut self, layout: ScreenLayout) {
        let Cx { screen, scene, .. } = &mut self.cx;
        let before = std::mem::replace(&mut screen.layout, layout);
        scene.drawn(before, screen);
    }
}

fn log_evaluation(screen: &mut Screen) {
    let snapshot = &screen.snapshot;
    let Some((updates, e)) = snapshot.evaluations.last() else { return };
    let updates = snapshot.learned(*updates);
    let error = e.error.map_or(String::new(), |e| format!(", error of D {:.0} %", 100.0 * e.mape));
    // Training goes on while tasks are walked.
    let at = if updates == snapshot.updates() {
        String::new()
    } else {
        format!(" at {}", grouped(updates))
    };
    let text = format!("evaluated{at}: {}{error}", e.success(updates));
    screen.log.record(&text, snapshot.seconds, snapshot.updates());
    // When the actor can first do without plans.
    let learned = |e: &Evaluation| e.alone.success.filter(|rate| *rate >= LEARNED);
    let mut before = snapshot.evaluations.iter().rev().skip(1);
    if let Some(rate) = learned(e).filter(|_| e.planned.is_some())
        && !before.any(|(_, earlier)| learned(earlier).is_some())
    {
        screen.notify(&format!("the actor of {} alone now reaches {rate:.2}", screen.run().method));
    }
}
