//! The state of the screen: everything a frame is drawn from, except the scene; and the ways to
//! trainer and viewer.

use std::collections::HashSet;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::action::Action;
use super::config::UiConfig;
use super::dialog::Dialog;
use super::graphics::{Graphics, Redraw};
use super::keymap::Keymap;
use super::layout::ScreenLayout;
use super::log::Log;
use super::theme::{ColourDepth, Theme};
use crate::tui::choices::{Marker, Overlay, Overlays, Pane};
use gdg::bridge::SearchOutcome;
use gdg::engine::{EngineCommand, EngineLink, Phase, Snapshot};
use gdg::job::Job;
use gdg::text::grouped;
use gdg::train::{
    FilmFrame, Preset, Run, Settings, SuccessSummary, changed_from, settings_in_world,
};
use gdg::viewer::{Field, OnArrival, Request, Viewer};

/// How long the interface waits for what is done on another thread before it goes on.
pub const PATIENCE: Duration = Duration::from_millis(200);

/// Time after which it is shown what the trainer does instead of training.
const SHOWN_AFTER: Duration = Duration::from_millis(500);

/// How long a line over the map is shown.
pub const BANNER_DURATION: Duration = Duration::from_secs(10);

/// Everything that the screen shows around the scene, and how it shows the scene.
pub struct Screen {
    pub keymap: Keymap,
    pub theme: Theme,
    pub snapshot: Arc<Snapshot>,
    /// The names of the run's settings that differ from those of its preset.
    pub changed_settings: HashSet<String>,
    pub log: Log,
    pub field: Field,
    pub overlays: Overlays,
    pub marker: Marker,
    /// The terminal's graphics capabilities, if it shows pictures.
    pub graphics: Option<Graphics>,
    /// How much of the pictures is redrawn.
    pub redraw: Redraw,
    pub pane: Pane,
    /// Whether that pane fills the screen.
    pub maximised: bool,
    /// What the walking agent does at the goal.
    pub on_arrival: OnArrival,
    pub dialogs: Vec<Dialog>,
    /// Whether the trainer has been asked to pause.
    pub pausing: bool,
    /// What the trainer does instead of training, if that takes long.
    pub busy: Option<String>,
    /// How far an evaluation is, if one has been running for some time.
    pub evaluating: Option<String>,
    /// Whether the map is drawn for a file, which has no keys.
    pub on_paper: bool,
    /// Minimum upper end of the colour scale, which the screens of a comparison share.
    pub least_farthest: f32,
    /// Minimum contour interval in steps, shared likewise.
    pub least_contour_interval: f32,
    /// Since when the line over the map is shown, until it goes away.
    pub banner: Option<Instant>,
    /// The frame of the film shown instead of the present.
    pub past: Option<Arc<FilmFrame>>,
    /// The step of the guided tour, while it lasts.
    pub tour: Option<ShownStep>,
    /// What the run does, and when it was saved, if another program trains it.
    pub elsewhere: Option<[String; 2]>,
    /// The bridge search that the tour explains, instead of the latest.
    pub explained: Option<Arc<SearchOutcome>>,
    /// Whether quitting leads back to a list of runs.
    pub from_list: bool,
    /// Whether a hint explains the screen, until a goal is set.
    pub explains: bool,
    /// Where things were last drawn.
    pub layout: ScreenLayout,
    pub engine: EngineLink,
    pub viewer: Viewer,
    /// The number of the latest request for a goal.
    pub goal_request: u64,
    /// Separate, so that training does not depend on user input.
    pub rng: ChaCha8Rng,
}

impl Screen {
    pub fn new(config: &UiConfig, keymap: Keymap, engine: EngineLink, viewer: Viewer) -> Self {
        let snapshot = engine.snapshots().borrow().clone();
        let theme = Theme::new(config.theme, ColourDepth::detect());
        let rng = ChaCha8Rng::seed_from_u64(snapshot.run.seed);
        let mut screen = Self {
            keymap,
            overlays: Overlays::by_default(theme.depth),
            theme,
            snapshot,
            changed_settings: HashSet::new(),
            log: Log::default(),
            field: Field::default(),
            marker: config.marker,
            graphics: None,
            redraw: Redraw::default(),
            pane: Pane::default(),
            maximised: false,
            on_arrival: OnArrival::default(),
            dialogs: Vec::new(),
            pausing: false,
            busy: None,
            evaluating: None,
            on_paper: false,
            least_farthest: 0.0,
            least_contour_interval: 0.0,
            banner: Some(Instant::now()),
            past: None,
            tour: None,
            elsewhere: None,
            explained: None,
            from_list: false,
            explains: false,
            layout: ScreenLayout::default(),
            engine,
            viewer,
            goal_request: 0,
            rng,
        };
        screen.update_changed_settings();
        screen
    }

    pub fn settings_of(&self, preset: Preset) -> Settings {
        settings_in_world(preset, self.snapshot.world_defaults)
    }

    /// Updates the settings that differ from the run's preset, after the run has changed.
    pub fn update_changed_settings(&mut self) {
        let run = self.run();
        let changed = changed_from(&run.settings, &self.settings_of(run.preset));
        self.changed_settings = changed.into_iter().map(|(name, _)| name).collect();
    }

    /// Returns the bridge search that is shown: the latest, unless the tour explains another.
    pub fn search(&self) -> Option<&Arc<SearchOutcome>> {
        self.explained.as_ref().or(self.snapshot.search.as_ref())
    }

    pub fn run(&self) -> &Run {
        &self.snapshot.run
    }

    pub fn busy_with(&self) -> Option<Job> {
        self.engine.busy().filter(|job| job.since().elapsed() >= SHOWN_AFTER)
    }

    /// Sends a command to the trainer. If too many are queued, shows a notice and returns `false`.
    pub fn command(&mut self, command: EngineCommand) -> bool {
        if self.elsewhere.is_some() {
            self.refuse_to_train();
            return false;
        }
        let sent = self.engine.send(command);
        if !sent {
            self.notify("the trainer is busy: try again");
        } else if let Some(job) = self.busy_with() {
            self.say(&format!("taken: it follows, the trainer is {}", job.what()));
        }
        sent
    }

    pub fn refuse_to_train(&mut self) {
        let key = self.keymap.key_of(Action::TrainCopy);
        self.say(&format!("this run is only watched: {key} trains a copy"));
    }

    pub fn request(&self, request: Request) {
        self.viewer.request(request);
    }

    pub fn next_goal_request(&mut self) -> u64 {
        self.goal_request += 1;
        self.goal_request
    }

    /// Returns to the present; returns whether the past was shown.
    pub fn return_to_present(&mut self) -> bool {
        let was_past = self.past.take().is_some();
        if was_past {
            self.request(Request::Past(None));
        }
        was_past
    }

    pub fn why_not(&self, overlay: Overlay) -> Option<String> {
        let method = &self.run().method;
        match overlay {
            Overlay::Contours if self.theme.depth == ColourDepth::Mono => {
                Some("contour lines need colours: here shades show distances".to_owned())
            }
            Overlay::Candidates
            | Overlay::Edges
            | Overlay::Search
            | Overlay::Path
            | Overlay::Ghost
                if !method.plans() =>
            {
                let is_ghost = overlay == Overlay::Ghost;
                let why = if is_ghost { "is the actor alone" } else { "has no bridges" };
                Some(format!("{} {why}", method.name()))
            }
            _ => None,
        }
    }

    /// Shows a notice and logs it.
    pub fn notify(&mut self, text: &str) {
        self.log.add(text, self.snapshot.seconds, self.snapshot.updates(), false);
    }

    /// Shows a notice without logging it, since it concerns only the screen.
    pub fn say(&mut self, text: &str) {
        self.log.show(text, false);
    }

    /// Shows an error and logs it.
    pub fn report(&mut self, text: &str) {
        self.log.add(text, self.snapshot.seconds, self.snapshot.updates(), true);
    }

    pub fn open(&mut self, dialog: impl Into<Dialog>) {
        self.dialogs.push(dialog.into());
    }

    /// Describes the phase in a word or two, where the trainer may still be `applying_edit`s.
    pub fn phase(&self, applying_edit: bool) -> String {
        if let Some(busy) = &self.busy {
            return if self.pausing { format!("pausing: {busy}") } else { busy.clone() };
        }
        match (&self.elsewhere, &self.snapshot.phase) {
            (Some([state, _]), _) => state.clone(),
            (None, Phase::Running | Phase::Stepping(_)) if self.pausing => "pausing".to_owned(),
            (None, Phase::Running) if applying_edit => "applying the edit".to_owned(),
            (None, Phase::Running) if !self.snapshot.learns => "random steps".to_owned(),
            (None, Phase::Running) => match self.snapshot.counters.relearning() {
                Some(left) => format!("relearning, {} to go", grouped(left)),
                None => "training".to_owned(),
            },
            (None, Phase::Stepping(_)) => "stepping".to_owned(),
            (None, Phase::Paused) => "paused".to_owned(),
            (None, Phase::Done) => "done".to_owned(),
            (None, Phase::Failed(error)) => format!("stopped: {error}"),
        }
    }

    /// Returns the width and height of a character in pixels, if the map is drawn as a picture.
    /// Without colours, it is not.
    pub fn picture_character(&self) -> Option<(u16, u16)> {
        let wanted = self.marker.wants_pixels() && self.theme.depth != ColourDepth::Mono;
        self.graphics.filter(|_| wanted).map(|graphics| graphics.character)
    }
}

/// Summarises the run in the world called `title` for the terminal after the screen is closed, in
/// lines that fit into 80 columns unless the title is long.
pub fn summary_of(snapshot: &Snapshot, title: &str) -> String {
    let (run, counters) = (&snapshot.run, snapshot.counters);
    let text = format!(
        "{} on {title}, seed {}: {} updates in {:.0} s\n{} steps, {} episodes",
        run.method.name(),
        run.seed,
        grouped(snapshot.updates()),
        snapshot.seconds,
        grouped(counters.env_steps),
        grouped(counters.episodes)
    );
    match success_of(snapshot) {
        Some(success) => {
            format!("{text}\nat update {}: success {success}", grouped(success.updates))
        }
        None => text,
    }
}

pub fn success_of(snapshot: &Snapshot) -> Option<SuccessSummary> {
    snapshot.evaluation().map(|(updates, e)| e.success(snapshot.learned(*updates)))
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Caption {
    pub text: String,
    pub marks: Vec<([f32; 2], char)>,
    /// Whether its subject is currently visible.
    pub seen: bool,
}

#[derive(Clone, Debug)]
pub struct ShownStep {
    pub step: usize,
    pub title: String,
    /// Whether the tour waits for the user's first click, which ends it.
    pub is_last: bool,
    pub caption: Caption,
}
