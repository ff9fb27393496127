//! The state of the screen: everything a frame is drawn from.

use std::collections::HashSet;
use std::sync::Arc;

use super::action::Mode;
use super::config::UiConfig;
use super::dialog::Dialog;
use super::graphics::{Graphics, Redraw};
use super::keymap::Keymap;
use super::layers::Overlays;
use super::layout::ScreenLayout;
use super::log::Log;
use super::offer::Offer;
use super::panes::Pane;
use super::scene::{ArmState, MazeState, SceneKind};
use super::theme::{ColourDepth, Theme};
use super::tour::ShownStep;
use crate::tui::marker::Marker;
use gdg::bridge::SearchOutcome;
use gdg::engine::{Phase, Snapshot};
use gdg::env::Scene;
use gdg::text::grouped;
use gdg::train::{FilmFrame, Preset, Run, Settings, Success, changed_from, settings_in_world};
use gdg::viewer::{Field, OnArrival};

/// Everything that the screen shows.
pub struct Screen {
    /// Keys and their actions.
    pub keymap: Keymap,
    /// Colours.
    pub theme: Theme,
    /// The training state shown.
    pub snapshot: Arc<Snapshot>,
    /// The names of the run's settings that differ from those of its preset.
    pub changed_settings: HashSet<String>,
    /// What is shown of a maze.
    pub maze: MazeState,
    /// What is shown of an arm.
    pub arm: ArmState,
    /// The log.
    pub log: Log,
    /// The field shown by the colours.
    pub field: Field,
    /// The overlays drawn over the colours.
    pub overlays: Overlays,
    /// What the map is drawn with.
    pub marker: Marker,
    /// What pictures the terminal shows.
    pub graphics: Option<Graphics>,
    /// How much of the pictures is drawn again.
    pub redraw: Redraw,
    /// The selected pane.
    pub pane: Pane,
    /// Whether that pane fills the screen.
    pub maximised: bool,
    /// How far back curves and log are scrolled, in pages.
    pub scrolled: usize,
    /// Whether curves are drawn on logarithmic scales.
    pub log_scale: bool,
    /// What the walking agent does at the goal.
    pub on_arrival: OnArrival,
    /// The open dialogs, topmost last.
    pub dialogs: Vec<Dialog>,
    /// Whether the trainer has been asked to pause.
    pub pausing: bool,
    /// Whether the screen is frozen.
    pub frozen: bool,
    /// The value that the colours reach at least, for two screens to be compared.
    pub least_farthest: f32,
    /// The steps between two contour lines, at least, for the same purpose.
    pub least_contour_interval: f32,
    /// The exploring agent followed instead of the walking one.
    pub following: Option<usize>,
    /// The saved run that is offered.
    pub offer: Option<Offer>,
    /// The frame of the film that is looked at instead of the present.
    pub past: Option<Arc<FilmFrame>>,
    /// The step of the guided tour, while it lasts.
    pub tour: Option<ShownStep>,
    /// The bridge search that the tour explains, instead of the latest.
    pub explained: Option<Arc<SearchOutcome>>,
    /// Whether the interface has not been used yet: a line says what there is to see.
    pub first_run: bool,
    /// Where things were last drawn.
    pub layout: ScreenLayout,
}

impl Screen {
    /// Creates a screen that shows `snapshot`.
    pub fn new((config, keymap): (&UiConfig, Keymap), snapshot: Arc<Snapshot>) -> Self {
        let theme = Theme::new(config.theme, ColourDepth::detect());
        let mut screen = Self {
            keymap,
            overlays: Overlays::by_default(theme.depth),
            theme,
            maze: MazeState::new(snapshot.scene.maze().map),
            arm: ArmState::default(),
            snapshot,
            changed_settings: HashSet::new(),
            log: Log::default(),
            field: Field::default(),
            marker: config.marker,
            graphics: None,
            redraw: Redraw::default(),
            pane: Pane::default(),
            maximised: false,
            scrolled: 0,
            log_scale: false,
            on_arrival: OnArrival::default(),
            dialogs: Vec::new(),
            pausing: false,
            frozen: false,
            least_farthest: 0.0,
            least_contour_interval: 0.0,
            following: None,
            offer: None,
            past: None,
            tour: None,
            explained: None,
            first_run: false,
            layout: ScreenLayout::default(),
        };
        screen.update_changed_settings();
        screen
    }

    /// Returns the kind of world that is shown.
    pub fn scene(&self) -> SceneKind {
        SceneKind::of(&self.snapshot.scene)
    }

    /// Returns whether the colours can show `field`.
    pub fn has_field(&self, field: Field) -> bool {
        self.scene().shows(field) && (field != Field::Composed || self.run().method.plans())
    }

    /// Returns the world's title: of a map, its name as last edited.
    pub fn title(&self) -> &str {
        match self.scene() {
            SceneKind::Maze => self.maze.map.name(),
            SceneKind::Arm => &self.snapshot.title,
        }
    }

    /// Returns the settings of `preset` in the world shown.
    pub fn settings_of(&self, preset: Preset) -> Settings {
        settings_in_world(preset, self.snapshot.world_defaults)
    }

    /// Finds out which settings differ from those of the run's preset, after the run has changed.
    pub fn update_changed_settings(&mut self) {
        let run = self.run();
        let changed = changed_from(&run.settings, &self.settings_of(run.preset));
        self.changed_settings = changed.into_iter().map(|(name, _)| name).collect();
    }

    /// Returns the frame of the film that the scene shows: what the viewer has computed last, so
    /// that nothing flickers.
    pub fn shown_past(&self) -> Option<&FilmFrame> {
        match self.scene() {
            SceneKind::Maze => self.maze.view.past.as_deref(),
            SceneKind::Arm => self.arm.view.past.as_deref(),
        }
    }

    /// Returns the field that the colours show: of the past, there is only D.
    pub fn shown_field(&self) -> Field {
        if self.shown_past().is_some() { Field::Learned } else { self.field }
    }

    /// Returns the largest value that the colours show, at least 1.
    pub fn farthest(&self) -> f32 {
        self.own_farthest().max(self.least_farthest)
    }

    /// Returns the largest value of the field, at least 1.
    pub fn own_farthest(&self) -> f32 {
        match self.scene() {
            SceneKind::Maze => self.maze.view.farthest.max(1.0),
            SceneKind::Arm => self.arm.view.farthest.max(1.0),
        }
    }

    /// Returns what the screen is used for.
    pub fn mode(&self) -> Mode {
        match self.offer {
            _ if self.maze.editor.is_open() => Mode::Editing,
            _ if self.tour.is_some() => Mode::Touring,
            Some(_) => Mode::Offered,
            None => Mode::Watching,
        }
    }

    /// Returns the bridge search that is shown: the latest, unless the tour explains another.
    pub fn search(&self) -> Option<&Arc<SearchOutcome>> {
        self.explained.as_ref().or(self.snapshot.search.as_ref())
    }

    /// Returns method, preset, seed and settings.
    pub fn run(&self) -> &Run {
        &self.snapshot.run
    }

    /// Returns whether the trainer does not know the latest edit of the map yet. It rebuilds the
    /// bridge graph first.
    fn is_applying_edit(&self) -> bool {
        matches!(&self.snapshot.scene, Scene::Maze(scene) if scene.map != self.maze.map)
    }

    /// Returns whether the map has edits that are in no file.
    pub fn has_unsaved_map(&self) -> bool {
        self.scene() == SceneKind::Maze && self.maze.map != self.maze.kept_map
    }

    /// Returns the number of updates not saved in any checkpoint, of those shown.
    pub fn unsaved_updates(&self) -> u64 {
        self.snapshot.unsaved_updates()
    }

    /// Returns a summary of the latest evaluation of the current method.
    pub fn success(&self) -> Option<Success> {
        self.snapshot.evaluation().map(|(updates, e)| e.success(self.snapshot.learned(*updates)))
    }

    /// Describes the phase in a word or two.
    pub fn phase(&self) -> String {
        match &self.snapshot.phase {
            _ if self.frozen => "screen frozen".to_owned(),
            Phase::Running | Phase::Stepping(_) if self.pausing => "pausing".to_owned(),
            Phase::Running if self.is_applying_edit() => "applying the edit".to_owned(),
            Phase::Running if !self.snapshot.learns => "random steps".to_owned(),
            Phase::Running => match self.snapshot.counters.relearning() {
                Some(left) => format!("relearning ({} updates to go)", grouped(left)),
                None => "training".to_owned(),
            },
            Phase::Stepping(_) => "stepping".to_owned(),
            Phase::Paused => "paused".to_owned(),
            Phase::Done => "done".to_owned(),
            Phase::Failed(error) => format!("stopped: {error}"),
        }
    }

    /// Returns the width and height of a character in pixels, if the map is drawn as a picture.
    /// Without colours, it is not.
    pub fn picture_character(&self) -> Option<(u16, u16)> {
        let wanted = self.marker.wants_pixels() && self.theme.depth != ColourDepth::Mono;
        self.graphics.filter(|_| wanted).map(|graphics| graphics.character)
    }

    /// Summarises the run for the terminal after the screen is closed, in lines that fit into 80
    /// columns unless the map's name is long.
    pub fn summary(&self) -> String {
        let counters = self.snapshot.counters;
        let text = format!(
            "{} on {}, seed {}: {} updates in {:.0} s\n{} steps, {} episodes",
            self.run().method.name(),
            self.title(),
            self.run().seed,
            grouped(self.snapshot.updates()),
            self.snapshot.seconds,
            grouped(counters.env_steps),
            grouped(counters.episodes)
        );
        match self.success() {
            Some(success) => {
                format!("{text}\nat update {}: success {success}", grouped(success.updates))
            }
            None => text,
        }
    }
}
