//! Saving the run, and quitting without losing it.

use std::path::PathBuf;
use std::sync::Arc;

use super::autosave::{Autosave, Content};
use crate::host::logging;
use crate::host::runs::SAVES;
use crate::tui::dialog::{Choice, Picker, Prompt, Question};
use crate::tui::link::Link;
use crate::tui::lists;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use gdg::engine::{Command, Snapshot};
use gdg::files::{named, unused_path};
use gdg::train::{Notes, SaveTo};

/// Unsaved training that quitting may discard without asking.
const MAX_DISCARDED_SECS: f64 = 10.0;

/// Files named on the command line.
#[derive(Default)]
pub struct Files {
    /// Where to save.
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
    /// When the run is saved automatically.
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
    /// Whether a failure opens a dialog that offers to save.
    offers: bool,
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

    /// Never offers to save after a failure: a comparison saves nothing.
    pub fn offers_nothing(&mut self) {
        self.offers = false;
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

    /// Returns the intended name of the next checkpoint, without its extension.
    pub fn stem(&self) -> String {
        self.to.path().file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
    }
}

/// Saving.
impl Saver {
    /// Saves the run; returns whether the trainer accepted the command.
    pub fn save(&mut self, scene: &Scene, screen: &mut Screen, link: &Link) -> bool {
        screen.notify(&format!("saving {} ...", self.next_file().display()));
        self.request_save(scene, screen, link)
    }

    fn request_save(&mut self, scene: &Scene, screen: &mut Screen, link: &Link) -> bool {
        self.is_awaited =
            link.command(Command::Save(self.to.clone(), notes(scene, screen)), screen);
        self.is_awaited
    }

    /// Saves the run, and then does something else unless that fails.
    pub fn save_then(&mut self, then: Choice, scene: &Scene, screen: &mut Screen, link: &Link) {
        self.then = Some(then).filter(|_| self.save(scene, screen, link));
    }

    /// Saves to a file named by the user, who has confirmed replacing it if it exists.
    pub fn save_under(&mut self, path: PathBuf, scene: &Scene, screen: &mut Screen, link: &Link) {
        self.to = SaveTo::Replace(path);
        if self.save(scene, screen, link) && self.quit_state == QuitState::Asking {
            self.quit_state = QuitState::Saving;
        }
    }

    /// Saves a run that has reached its limit, if the command line names a file.
    pub fn save_at_limit(&mut self, scene: &Scene, screen: &mut Screen, link: &Link) {
        if self.named.is_some() {
            self.request_save(scene, screen, link);
        }
    }

    /// Saves automatically, to a file next to the user's own.
    fn autosave(&mut self, scene: &Scene, screen: &mut Screen, link: &Link) {
        self.autosave.begin(content(scene, screen));
        let command = Command::Autosave(self.to.path().to_owned(), notes(scene, screen));
        link.command(command, screen);
    }

    /// Returns whether anything has changed since the latest autosave. What has not needs no other
    /// copy, which would take the place of an older one.
    pub fn has_something_to_autosave(&self, scene: &Scene, screen: &Screen) -> bool {
        screen.latest.unsaved_updates() > 0 && self.autosave.wants(&content(scene, screen))
    }
}

/// Quitting.
impl Saver {
    /// Handles a request to quit. A checkpoint that is asked for and not written yet, as the
    /// environment may hang, is written on closing.
    pub fn quit(&mut self, scene: &Scene, screen: &mut Screen, link: &Link) {
        if self.is_awaited {
            self.named.get_or_insert_with(|| self.to.path().to_owned());
            self.is_done = true;
        } else if self.named.is_some() {
            self.save_and_quit(scene, screen, link);
        } else if is_worth_saving(scene, screen) {
            screen.open(self.quit_question(scene, screen));
        } else {
            self.is_done = true;
        }
    }

    /// Returns the question whether to save before quitting.
    pub fn quit_question(&self, scene: &Scene, screen: &Screen) -> Picker {
        lists::quit_choices(&screen.latest, scene.has_unsaved_map(), &self.next_file())
    }

    /// Quits once the run is saved.
    pub fn save_and_quit(&mut self, scene: &Scene, screen: &mut Screen, link: &Link) {
        let up_to_date = screen.latest.unsaved_updates() == 0 && !scene.has_unsaved_map();
        if screen.latest.saved.is_some() && up_to_date {
            self.is_done = true;
            return;
        }
        self.was_training = screen.latest.phase.is_training();
        link.command(Command::Pause, screen);
        if self.save(scene, screen, link) {
            self.quit_state = QuitState::Saving;
        }
    }

    /// Handles a closed dialog: quitting is cancelled, and training paused for it resumes.
    pub fn cancel_quit(&mut self, screen: &mut Screen, link: &Link) {
        let asking = self.quit_state == QuitState::Asking;
        self.quit_state = QuitState::No;
        if asking && self.was_training {
            link.command(Command::Resume, screen);
        }
    }
}

/// What happens to the run.
impl Saver {
    /// Handles the outcome of saves since `before`; returns what to do after one.
    pub fn on_snapshot(
        &mut self,
        before: &Snapshot,
        scene: &mut Scene,
        screen: &mut Screen,
    ) -> Option<Choice> {
        let now = screen.latest.clone();
        let mut then = None;
        if let Some((_, path)) = &now.saved
            && before.saved.as_ref().is_none_or(|(_, earlier)| !Arc::ptr_eq(earlier, path))
        {
            self.to = SaveTo::Replace(path.to_path_buf());
            self.is_awaited = false;
            scene.keep_map();
            self.is_done |= self.quit_state == QuitState::Saving;
            then = self.then.take();
        }
        if now.save_failed.0 > before.save_failed.0 {
            self.is_awaited = false;
            self.then = None;
            if self.quit_state == QuitState::Saving {
                self.quit_state = QuitState::Asking;
                let title = "not saved: save elsewhere and quit (Esc cancels)";
                let mut prompt = Prompt::new(Question::SaveAs, title, "", self.stem());
                prompt.error = Some(now.save_failed.1.clone());
                screen.open(prompt);
            }
        }
        if !Arc::ptr_eq(&now.autosaves, &before.autosaves) {
            self.autosave.done();
        }
        then
    }

    /// Handles the passing of time: reports internal errors, saves the run after the first one, and
    /// saves it automatically.
    pub fn on_tick(&mut self, scene: &Scene, screen: &mut Screen, link: &Link) {
        for failure in gdg::faults::take_failures() {
            let text = format!("internal error in thread {}: {}", failure.thread, failure.message);
            screen.report(&text);
            if !std::mem::replace(&mut self.has_failed, true) {
                self.autosave(scene, screen, link);
                self.show_failure("internal error", &text, screen);
            }
        }
        if self.autosave.is_due() && self.has_something_to_autosave(scene, screen) {
            self.autosave(scene, screen, link);
        }
    }

    /// Handles training that stopped without reaching a limit.
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
    pub fn on_signal(&mut self, scene: &Scene, screen: &Screen) {
        let is_unsaved = screen.latest.unsaved_updates() > 0 || scene.has_unsaved_map();
        if is_unsaved && self.named.is_none() {
            self.named = Some(self.to.path().to_owned());
        }
    }
}

/// Returns what a checkpoint keeps of the screen.
pub fn notes(scene: &Scene, screen: &Screen) -> Notes {
    Notes { log: screen.log.entries().to_vec(), goal: scene.goal() }
}

/// Returns what an autosave would save now.
fn content(scene: &Scene, screen: &Screen) -> Content {
    let map = scene.maze().map(|maze| maze.map.clone());
    Content { run: screen.latest.run.clone(), updates: screen.latest.updates(), map }
}

/// Returns whether enough is unsaved to be worth asking about: training, or any edit of the map.
pub fn is_worth_saving(scene: &Scene, screen: &Screen) -> bool {
    screen.latest.unsaved_seconds() > MAX_DISCARDED_SECS || scene.has_unsaved_map()
}
