//! Saving the run, by the user and automatically, and quitting without losing it.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use super::{Cx, Session};
use crate::host::logging;
use crate::host::runs::SAVES;
use crate::tui::dialog::{Choice, Picker, Prompt, Question};
use crate::tui::lists;
use crate::tui::screen::Screen;
use gdg::engine::{Command, Snapshot};
use gdg::files::{named, unused_path};
use gdg::map::Grid;
use gdg::train::{Notes, Run, SaveTo};

/// Unsaved training that quitting may discard without asking.
const MAX_DISCARDED_SECS: f64 = 10.0;

/// Files named on the command line.
#[derive(Default)]
pub struct Files {
    pub save: Option<SaveTo>,
}

/// Saves the run, and knows whether the program quits.
pub struct Saver {
    /// The run's own file, or the one it will be saved to.
    pub to: SaveTo,
    /// The path given on the command line; closing saves to it.
    pub named: Option<PathBuf>,
    files: Files,
    /// The folder of runs without a file of their own.
    pub folder: PathBuf,
    pub autosave: Autosave,
    quit_state: QuitState,
    /// Whether a checkpoint is asked for and not written yet.
    is_awaited: bool,
    /// Whether the program is to quit.
    pub is_done: bool,
    /// What to do once the checkpoint is written.
    then: Option<Choice>,
    /// Whether training was running when it was paused to save before quitting.
    was_training: bool,
    /// Whether there was an internal error.
    pub has_failed: bool,
    /// Whether a failure opens a dialog that offers to save: a comparison saves nothing.
    pub offers: bool,
}

/// The progress of quitting.
#[derive(Clone, Copy, PartialEq, Eq)]
enum QuitState {
    No,
    /// Quits once the checkpoint is written.
    Saving,
    /// The checkpoint could not be written: the user is asked for another file.
    Asking,
}

/// Where it saves.
impl Saver {
    /// Creates a saver to `files`; 0 minutes switch autosaves off.
    pub fn new(files: Files, autosave_minutes: f64) -> Self {
        let named = files.save.as_ref().map(|to| to.path().to_owned());
        Self {
            to: SaveTo::CreateNew(PathBuf::new()),
            named,
            files,
            folder: SAVES.into(),
            autosave: Autosave::every(autosave_minutes),
            quit_state: QuitState::No,
            is_awaited: false,
            is_done: false,
            then: None,
            was_training: false,
            has_failed: false,
            offers: true,
        }
    }

    /// Chooses the file for the run in `snapshot`: a file belongs to the run that wrote or loaded
    /// it.
    pub fn start_run(&mut self, snapshot: &Snapshot) {
        let Snapshot { title, run, saved, .. } = snapshot;
        self.then = None;
        let end = format!("-{}-seed{}.safetensors", run.method.name(), run.seed);
        self.to = match (self.files.save.take(), saved, &self.named) {
            (Some(to), ..) => to,
            (None, Some((_, path)), _) => SaveTo::Replace(path.to_path_buf()),
            (None, None, Some(path)) => SaveTo::CreateNew(path.clone()),
            (None, None, None) => SaveTo::CreateNew(named(&self.folder, &**title, &end)),
        };
    }

    /// Leaves the run's file as it is from now on, as the run goes on with new networks.
    pub fn leave_file(&mut self) {
        self.to = SaveTo::CreateNew(unused_path(self.to.path()));
    }

    /// Returns the file of the next checkpoint: a new file, unless the run already has its own.
    fn next_file(&self) -> PathBuf {
        match &self.to {
            SaveTo::Replace(path) => path.clone(),
            SaveTo::CreateNew(path) => unused_path(path),
        }
    }

    fn ask_file(&self, title: &str, hint: String) -> Prompt {
        let stem = self.to.path().file_stem().map(|s| s.to_string_lossy().into_owned());
        Prompt::new(Question::SaveAs, title, hint, stem.unwrap_or_default())
    }
}

/// Saving.
impl Saver {
    /// Saves the run; returns whether the trainer accepted the command.
    pub fn save(&mut self, cx: &mut Cx) -> bool {
        cx.screen.notify(&format!("saving {} ...", self.next_file().display()));
        self.request_save(cx)
    }

    fn request_save(&mut self, cx: &mut Cx) -> bool {
        self.is_awaited = cx.command(Command::Save(self.to.clone(), notes(cx)));
        self.is_awaited
    }

    /// Saves the run, and then does something else unless that fails.
    pub fn save_then(&mut self, then: Choice, cx: &mut Cx) {
        self.then = Some(then).filter(|_| self.save(cx));
    }

    /// Saves to a file named by the user, who has confirmed replacing it if it exists.
    pub fn save_under(&mut self, path: PathBuf, cx: &mut Cx) {
        self.to = SaveTo::Replace(path);
        if self.save(cx) && self.quit_state == QuitState::Asking {
            self.quit_state = QuitState::Saving;
        }
    }

    /// Saves a run that has reached its limit, if the command line names a file.
    pub fn save_at_limit(&mut self, cx: &mut Cx) {
        if self.named.is_some() {
            self.request_save(cx);
        }
    }

    /// Saves automatically, to a file next to the user's own.
    fn autosave(&mut self, cx: &mut Cx) {
        self.autosave.writing = Some(Content::of(cx));
        cx.command(Command::Autosave(self.to.path().to_owned(), notes(cx)));
    }

    /// Returns whether anything has changed since the latest autosave. What has not needs no other
    /// copy, which would take the place of an older one.
    pub fn has_something_to_autosave(&self, cx: &Cx) -> bool {
        let Autosave { writing, written, .. } = &self.autosave;
        cx.screen.latest.unsaved_updates() > 0
            && writing.is_none()
            && written.as_ref() != Some(&Content::of(cx))
    }
}

/// Quitting.
impl Saver {
    /// Handles a request to quit. A checkpoint that is asked for and not written yet, as the
    /// environment may hang, is written on closing.
    pub fn quit(&mut self, cx: &mut Cx) {
        if self.is_awaited {
            self.named.get_or_insert_with(|| self.to.path().to_owned());
            self.is_done = true;
        } else if self.named.is_some() {
            self.save_and_quit(cx);
        } else if is_worth_saving(cx) {
            cx.screen.open(self.quit_question(cx));
        } else {
            self.is_done = true;
        }
    }

    pub fn quit_question(&self, cx: &Cx) -> Picker {
        lists::quit_choices(&cx.screen.latest, cx.scene.has_unsaved_map(), &self.next_file())
    }

    pub fn save_and_quit(&mut self, cx: &mut Cx) {
        if cx.screen.latest.saved.is_some() && !is_unsaved(cx) {
            self.is_done = true;
            return;
        }
        self.was_training = cx.screen.latest.phase.is_training();
        cx.command(Command::Pause);
        if self.save(cx) {
            self.quit_state = QuitState::Saving;
        }
    }

    /// Handles a closed dialog: quitting is cancelled, and training paused for it resumes.
    pub fn cancel_quit(&mut self, cx: &mut Cx) {
        let was = std::mem::replace(&mut self.quit_state, QuitState::No);
        if was == QuitState::Asking && self.was_training {
            cx.command(Command::Resume);
        }
    }
}

/// What happens to the run.
impl Saver {
    /// Handles the outcome of saves since `before`; returns what to do after one.
    pub fn on_snapshot(&mut self, before: &Snapshot, cx: &mut Cx) -> Option<Choice> {
        let now = cx.screen.latest.clone();
        let mut then = None;
        if let Some((_, path)) = &now.saved
            && before.saved.as_ref().is_none_or(|(_, earlier)| !Arc::ptr_eq(earlier, path))
        {
            self.to = SaveTo::Replace(path.to_path_buf());
            self.is_awaited = false;
            cx.scene.keep_map();
            self.is_done |= self.quit_state == QuitState::Saving;
            then = self.then.take();
        }
        if now.save_failed.0 > before.save_failed.0 {
            self.is_awaited = false;
            self.then = None;
            if self.quit_state == QuitState::Saving {
                self.quit_state = QuitState::Asking;
                let title = "not saved: save elsewhere and quit (Esc cancels)";
                let mut prompt = self.ask_file(title, String::new());
                prompt.error = Some(now.save_failed.1.clone());
                cx.screen.open(prompt);
            }
        }
        if !Arc::ptr_eq(&now.autosaves, &before.autosaves) {
            self.autosave.written = self.autosave.writing.take();
        }
        then
    }

    /// Handles the passing of time: reports internal errors, saves the run after the first one, and
    /// saves it automatically.
    pub fn on_tick(&mut self, cx: &mut Cx) {
        for failure in gdg::faults::take_failures() {
            let text = format!("internal error in thread {}: {}", failure.thread, failure.message);
            cx.screen.report(&text);
            if !std::mem::replace(&mut self.has_failed, true) {
                self.autosave(cx);
                self.show_failure("internal error", &text, &mut cx.screen);
            }
        }
        if self.autosave.is_due() && self.has_something_to_autosave(cx) {
            self.autosave(cx);
        }
    }

    pub fn on_training_failed(&self, error: &str, screen: &mut Screen) {
        screen.report(&format!("training stopped: {error}"));
        if !self.has_failed {
            self.show_failure("training has stopped", error, screen);
        }
    }

    fn show_failure(&self, title: &str, problem: &str, screen: &mut Screen) {
        if self.offers {
            screen.open(lists::failure(title, problem, &self.next_file(), &logging::hint()));
        }
    }

    /// Handles a signal to end the program, which cannot ask: whatever is unsaved will be saved on
    /// closing.
    pub fn on_signal(&mut self, cx: &Cx) {
        if is_unsaved(cx) && self.named.is_none() {
            self.named = Some(self.to.path().to_owned());
        }
    }
}

/// What an autosave keeps.
#[derive(PartialEq)]
struct Content {
    run: Arc<Run>,
    updates: u64,
    map: Option<Arc<Grid>>,
}

impl Content {
    fn of(cx: &Cx) -> Self {
        let (latest, map) = (&cx.screen.latest, cx.scene.maze().map(|maze| maze.map.clone()));
        Self { run: latest.run.clone(), updates: latest.updates(), map }
    }
}

/// When the run is saved automatically.
pub struct Autosave {
    /// Minutes between two; 0 for none.
    pub minutes: f64,
    since: Instant,
    /// What is being saved, and what was saved last.
    writing: Option<Content>,
    written: Option<Content>,
}

impl Autosave {
    fn every(minutes: f64) -> Self {
        Self { minutes, since: Instant::now(), writing: None, written: None }
    }

    pub fn set_interval(&mut self, minutes: f64) {
        (self.minutes, self.since) = (minutes, Instant::now());
    }

    /// Returns whether an interval is over, and begins the next one.
    fn is_due(&mut self) -> bool {
        let due = self.minutes > 0.0 && self.since.elapsed().as_secs_f64() > 60.0 * self.minutes;
        if due {
            self.since = Instant::now();
        }
        due
    }

    /// Handles an error: perhaps it was the autosave that failed; then it is tried again.
    pub fn failed(&mut self) {
        self.writing = None;
    }
}

pub fn ask_file(session: &mut Session) {
    let hint = format!("a name, saved as {SAVES}/NAME.safetensors, or a path");
    let prompt = session.saver.ask_file("save the checkpoint as", hint);
    session.open(prompt);
}

pub fn ask_interval(session: &mut Session) {
    let (now, hint) = (session.saver.autosave.minutes.to_string(), "minutes; 0 turns autosave off");
    session.open(Prompt::new(Question::Autosave, "autosave interval in minutes", hint, now));
}

pub fn notes(cx: &Cx) -> Notes {
    Notes { log: cx.screen.log.entries().to_vec(), goal: cx.scene.goal() }
}

fn is_unsaved(cx: &Cx) -> bool {
    cx.screen.latest.unsaved_updates() > 0 || cx.scene.has_unsaved_map()
}

/// Returns whether enough is unsaved to be worth asking about: training, or any edit of the map.
pub fn is_worth_saving(cx: &Cx) -> bool {
    cx.screen.latest.unsaved_seconds() > MAX_DISCARDED_SECS || cx.scene.has_unsaved_map()
}
