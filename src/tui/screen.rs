//! The state of the screen: everything that a frame is drawn from.

use std::sync::Arc;

use super::config::UiConfig;
use super::dialog::Dialog;
use super::editor::Editor;
use super::keymap::Keymap;
use super::layers::Overlays;
use super::log::Log;
use super::panes::Pane;
use super::places::Places;
use super::raster::{Marker, Viewport};
use super::theme::{Depth, Theme};
use crate::map::{Cell, Grid};
use crate::train::{Phase, Run, Snapshot, Success};
use crate::view::{Field, Tour, View};

/// Everything that the screen shows.
pub struct Screen {
    /// Keys and their actions.
    pub keymap: Keymap,
    /// Colours.
    pub theme: Theme,
    /// The map as the user last edited it; the trainer follows.
    pub map: Arc<Grid>,
    /// The map editor.
    pub editor: Editor,
    /// The latest state of training that is shown.
    pub snapshot: Arc<Snapshot>,
    /// The latest view that is shown.
    pub view: Arc<View>,
    /// The goal that distances are shown to.
    pub goal: Cell,
    /// The cursor whose cell is described, and the cell under the mouse.
    pub inspecting: Option<Cell>,
    /// The cell under the mouse.
    pub hovered: Option<Cell>,
    /// What happened.
    pub log: Log,
    /// What the colours stand for.
    pub field: Field,
    /// What is drawn over them.
    pub overlays: Overlays,
    /// What the map is drawn with.
    pub marker: Marker,
    /// The part of the map that is shown.
    pub viewport: Viewport,
    /// The pane that is selected.
    pub pane: Pane,
    /// Whether that pane fills the screen.
    pub maximised: bool,
    /// How far back curves and log are scrolled, in pages.
    pub scrolled: usize,
    /// Whether curves are drawn on logarithmic scales.
    pub log_scale: bool,
    /// What the walking agent does at the goal.
    pub tour: Tour,
    /// The dialogs that are open, the topmost last.
    pub dialogs: Vec<Dialog>,
    /// Whether the trainer has been asked to pause.
    pub pausing: bool,
    /// Whether the screen is frozen.
    pub frozen: bool,
    /// The exploring agent that is followed instead of the walking one.
    pub following: Option<usize>,
    /// Where things were drawn last.
    pub places: Places,
}

impl Screen {
    /// A screen that shows `snapshot` and `view`.
    pub fn new((config, keymap): (&UiConfig, Keymap), snapshot: Arc<Snapshot>, view: Arc<View>) -> Self {
        Self {
            keymap,
            theme: Theme::new(config.theme, Depth::detect()),
            map: snapshot.scene.maze().map,
            editor: Editor::default(),
            snapshot,
            view,
            goal: Cell::new(0, 0),
            inspecting: None,
            hovered: None,
            log: Log::default(),
            field: Field::default(),
            overlays: Overlays::default(),
            marker: config.marker,
            viewport: Viewport::default(),
            pane: Pane::default(),
            maximised: false,
            scrolled: 0,
            log_scale: false,
            tour: Tour::default(),
            dialogs: Vec::new(),
            pausing: false,
            frozen: false,
            following: None,
            places: Places::default(),
        }
    }

    /// The map.
    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// Method, preset, seed and settings.
    pub fn run(&self) -> &Run {
        &self.snapshot.run
    }

    /// Updates that no checkpoint holds.
    pub fn unsaved_updates(&self) -> u64 {
        let saved = self.snapshot.saved.as_ref().map_or(0, |(updates, _)| *updates);
        self.snapshot.counters.updates.saturating_sub(saved)
    }

    /// The latest evaluation in brief.
    pub fn success(&self) -> Option<Success> {
        self.snapshot.evaluations.last().map(|(updates, e)| e.success(*updates))
    }

    /// The phase in a word.
    pub fn phase(&self) -> String {
        match &self.snapshot.phase {
            _ if self.frozen => "screen frozen".to_owned(),
            Phase::Running | Phase::Stepping(_) if self.pausing => "pausing".to_owned(),
            Phase::Running => "training".to_owned(),
            Phase::Stepping(_) => "stepping".to_owned(),
            Phase::Paused => "paused".to_owned(),
            Phase::Done => "done".to_owned(),
            Phase::Failed(error) => format!("stopped: {error}"),
        }
    }

    /// The run in a line, for the terminal that remains when the screen is gone.
    pub fn summary(&self) -> String {
        let counters = self.snapshot.counters;
        let text = format!(
            "{} on {}, seed {}: {} updates in {:.0} s, {} episodes",
            self.run().method.name(),
            self.map().name(),
            self.run().seed,
            counters.updates,
            self.snapshot.seconds,
            counters.episodes
        );
        match self.success() {
            Some(success) => format!("{text}; at update {} success {success}", success.updates),
            None => text,
        }
    }
}
