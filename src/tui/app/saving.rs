//! Saving the run, and quitting without losing it.

use std::path::{Path, PathBuf};

use miette::Report;

use super::App;
use super::autosave::Content;
use crate::host::logging;
use crate::host::report::from_checkpoint_error;
use crate::host::runs::{self, SAVES};
use crate::host::setup::save_elsewhere;
use crate::host::waiting::{TWICE, Waiting};
use crate::tui::dialog::{Choice, Dialog, Picker, Prompt, Question};
use crate::tui::interface::ClosedRun;
use crate::tui::lists;
use crate::tui::terminal;
use gdg::engine::{Command, Engine, Phase, Snapshot};
use gdg::files::{named, unused_path};
use gdg::text::grouped;
use gdg::train::{self, Notes, SaveTo, Trainer};

/// Unsaved training that may be discarded without asking.
const MAX_DISCARDED_SECS: f64 = 10.0;

/// Files named on the command line.
#[derive(Default)]
pub struct Files {
    /// Where to save.
    pub save: Option<SaveTo>,
}

/// Where the next checkpoint goes, and whether the program quits once it is written.
pub struct Saving {
    /// The run's own file, or the one it will be saved to.
    to: SaveTo,
    /// The path given on the command line.
    named: Option<PathBuf>,
    files: Files,
    quit_state: QuitState,
    /// What to do once the checkpoint is written.
    then: Option<Choice>,
    /// Whether training was running when it was paused to save before quitting.
    was_training: bool,
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

impl Saving {
    pub fn new(files: Files) -> Self {
        let named = files.save.as_ref().map(|to| to.path().to_owned());
        Self {
            to: SaveTo::CreateNew(PathBuf::new()),
            named,
            files,
            quit_state: QuitState::No,
            then: None,
            was_training: false,
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
            (None, None, None) => SaveTo::CreateNew(named(Path::new(SAVES), &**title, &end)),
        };
    }

    /// Returns the intended file of the next checkpoint.
    pub fn path(&self) -> &Path {
        self.to.path()
    }
}

impl App {
    /// Returns the file of the next checkpoint: a new file, unless the run already has its own.
    pub fn save_path(&self) -> PathBuf {
        match &self.saving.to {
            SaveTo::Replace(path) => path.clone(),
            SaveTo::CreateNew(path) => unused_path(path),
        }
    }

    /// Saves the run; returns whether the trainer accepted the command.
    pub(super) fn save(&mut self) -> bool {
        self.notify(&format!("saving {} ...", self.save_path().display()));
        self.request_save()
    }

    fn request_save(&mut self) -> bool {
        self.command(Command::Save(self.saving.to.clone(), self.notes()))
    }

    /// Saves the run, and then does something else unless that fails.
    pub(super) fn save_then(&mut self, then: Choice) {
        self.saving.then = Some(then).filter(|_| self.save());
    }

    /// Saves to a file named by the user, who has confirmed replacing it if it exists.
    pub(super) fn save_under(&mut self, path: PathBuf) {
        self.saving.to = SaveTo::Replace(path);
        if self.save() && self.saving.quit_state == QuitState::Asking {
            self.saving.quit_state = QuitState::Saving;
        }
    }

    /// Saves a run that has reached its limit, if the command line names a file.
    pub(super) fn save_at_limit(&mut self) {
        if self.saving.named.is_some() {
            self.request_save();
        }
    }

    /// Saves automatically, to a file next to the user's own.
    pub(super) fn autosave(&mut self) {
        self.autosave.begin(self.autosave_content());
        self.command(Command::Autosave(self.saving.to.path().to_owned(), self.notes()));
    }

    /// Returns whether anything has changed since the latest autosave. What has not needs no other
    /// copy, which would take the place of an older one.
    pub(in crate::tui) fn has_something_to_autosave(&self) -> bool {
        let is_changed = self.screen.latest.unsaved_updates() > 0;
        is_changed && self.autosave.wants(&self.autosave_content())
    }

    /// Returns what a checkpoint keeps of the screen.
    fn notes(&self) -> Notes {
        Notes { log: self.screen.log.entries().to_vec(), goal: self.scene.goal() }
    }

    /// Returns what an autosave would save now.
    fn autosave_content(&self) -> Content {
        let Snapshot { run, .. } = &*self.screen.latest;
        let map = self.scene.maze().map(|maze| maze.map.clone());
        Content { run: run.clone(), updates: self.screen.latest.updates(), map }
    }

    /// Returns whether enough is unsaved to be worth asking about: training, or any edit of the
    /// map.
    pub(in crate::tui) fn is_worth_saving(&self) -> bool {
        let updates = self.screen.latest.updates().max(1);
        let seconds = self.screen.latest.seconds * self.screen.latest.unsaved_updates() as f64
            / updates as f64;
        seconds > MAX_DISCARDED_SECS || self.scene.has_unsaved_map()
    }

    /// Handles a request to quit. A second request does not wait for the checkpoint.
    pub(super) fn quit(&mut self) {
        self.catch_up();
        if self.saving.quit_state == QuitState::Saving {
            self.done = true;
        } else if self.saving.named.is_some() {
            self.save_and_quit();
        } else if self.is_worth_saving() {
            self.screen.open(self.quit_question());
        } else {
            self.done = true;
        }
    }

    /// Returns the question whether to save before quitting.
    pub(super) fn quit_question(&self) -> Picker {
        let (unsaved, autosaves) =
            (self.screen.latest.unsaved_updates(), &self.screen.latest.autosaves);
        lists::quit_choices(unsaved, self.scene.has_unsaved_map(), &self.save_path(), autosaves)
    }

    /// Quits once the run is saved.
    pub(super) fn save_and_quit(&mut self) {
        let up_to_date = self.screen.latest.unsaved_updates() == 0 && !self.scene.has_unsaved_map();
        if self.screen.latest.saved.is_some() && up_to_date {
            self.done = true;
            return;
        }
        self.saving.was_training = self.screen.latest.phase.is_training();
        self.command(Command::Pause);
        if self.save() {
            self.saving.quit_state = QuitState::Saving;
        }
    }

    /// Handles a closed dialog: quitting is cancelled, and training paused for it resumes.
    pub(super) fn cancel_quit(&mut self) {
        let asking = self.saving.quit_state == QuitState::Asking;
        self.saving.quit_state = QuitState::No;
        if asking && self.saving.was_training {
            self.command(Command::Resume);
        }
    }

    /// Handles the outcome of saves since `before`.
    pub(super) fn on_saving(&mut self, before: &Snapshot) {
        let now = self.screen.latest.clone();
        if let Some((_, path)) = &now.saved
            && before
                .saved
                .as_ref()
                .is_none_or(|(_, earlier)| !std::sync::Arc::ptr_eq(earlier, path))
        {
            self.saving.to = SaveTo::Replace(path.to_path_buf());
            self.scene.keep_map();
            self.done |= self.saving.quit_state == QuitState::Saving;
            if let Some(then) = self.saving.then.take() {
                self.choose(then);
            }
        }
        if now.save_failed.0 > before.save_failed.0 {
            self.saving.then = None;
        }
        if now.save_failed.0 > before.save_failed.0 && self.saving.quit_state == QuitState::Saving {
            self.saving.quit_state = QuitState::Asking;
            let stem = self
                .saving
                .path()
                .file_stem()
                .map(|s| s.to_string_lossy().into_owned())
                .unwrap_or_default();
            let title = "not saved: save elsewhere and quit (Esc cancels)";
            let mut prompt = Prompt::new(Question::SaveAs, title, "", stem);
            prompt.error = Some(now.save_failed.1.clone());
            self.screen.open(prompt);
        }
    }

    /// Reports internal errors, and saves the run after the first one.
    pub(super) fn on_failures(&mut self) {
        for failure in gdg::faults::take_failures() {
            let text = format!("internal error in thread {}: {}", failure.thread, failure.message);
            self.report(&text);
            if self.failures.is_empty() {
                self.autosave();
                self.show_failure("internal error", &text);
            }
            self.failures.push(failure);
        }
    }

    /// Handles training that stopped without reaching a limit.
    pub(super) fn on_training_failed(&mut self, error: &str) {
        self.report(&format!("training stopped: {error}"));
        if self.failures.is_empty() {
            self.show_failure("training has stopped", error);
        }
    }

    fn show_failure(&mut self, title: &str, problem: &str) {
        let dialog: Picker = lists::failure(title, problem, &self.save_path(), &logging::hint());
        self.screen.dialogs.push(Dialog::Pick(dialog));
    }

    /// Handles a signal to end the program: unsaved training worth asking about will be saved on
    /// closing.
    pub fn on_signal(&mut self) {
        self.catch_up();
        if self.is_worth_saving() && self.saving.named.is_none() {
            self.saving.named = Some(self.saving.to.path().to_owned());
        }
    }

    /// Returns the file that closing saves to, if any.
    #[cfg(test)]
    pub fn saves_at_end(&self) -> Option<PathBuf> {
        self.saving.named.clone()
    }

    /// Ends training, and saves if that is requested and not yet done. The summary says how much is
    /// not saved if the run `is_kept` at all.
    pub fn close(mut self, engine: Engine, is_kept: bool) -> ClosedRun {
        self.exports.finish();
        // Decided before: what closing itself reports changes nothing.
        self.catch_up();
        self.screen.snapshot = self.screen.latest.clone();
        let pulse = engine.pulse().clone();
        let _waiting = Waiting::begin(&pulse, TWICE, terminal::restore);
        let failed =
            !self.failures.is_empty() || matches!(self.screen.latest.phase, Phase::Failed(_));
        let mut ending = Ending {
            summary: self.screen.summary(self.scene.title(&self.screen.snapshot)),
            is_wanted: self.saving.named.is_some(),
            is_worth_saving: self.is_worth_saving(),
            is_kept,
            has_unsaved_map: self.scene.has_unsaved_map(),
        };
        let notes = self.notes();
        let Self { saving, screen, link, .. } = self;
        let snapshots = engine.snapshots();
        // The trainer ends once nothing can send it commands any more.
        drop(link);
        let trainer = engine.stop();
        let snapshot = snapshots.borrow().clone();
        let to = match (&snapshot.saved, &screen.snapshot.saved) {
            // A save that the screen has not seen any more was the run's first: the file is its own
            // by now.
            (Some((_, path)), None) => SaveTo::Replace(path.to_path_buf()),
            _ => saving.to,
        };
        let (saved_to, saved) = ending.save(trainer, notes, &to, &snapshot);
        ending.tell_files(saved.is_ok() && !failed, &snapshot);
        let Ending { mut summary, .. } = ending;
        if let Some(file) = saved_to.or_else(|| newest_file(&to, &snapshot)) {
            summary += &format!("\nresume with: {}", runs::resume_command(&file));
        }
        if failed {
            summary += &format!("\nthere were errors; {}", logging::hint());
        }
        ClosedRun { summary, saved, failed }
    }
}

/// What is known and said of a run when the interface is closed.
struct Ending {
    /// The text left on the terminal.
    summary: String,
    /// Whether the run is to be saved.
    is_wanted: bool,
    is_worth_saving: bool,
    /// Whether the run could have been saved at all.
    is_kept: bool,
    has_unsaved_map: bool,
}

impl Ending {
    /// Saves the run if it is wanted and not yet saved; or says how much is not. Returns the file
    /// written.
    fn save(
        &mut self,
        trainer: Option<Trainer>,
        notes: Notes,
        to: &SaveTo,
        snapshot: &Snapshot,
    ) -> (Option<PathBuf>, Result<(), Report>) {
        let saved_at = snapshot.saved.as_ref().map(|(updates, _)| *updates);
        match trainer {
            Some(mut trainer) if self.is_wanted => {
                let up_to_date =
                    !self.has_unsaved_map && saved_at == Some(trainer.counters().updates);
                let _ = trainer.ensure_finite();
                trainer.set_notes(notes);
                if !up_to_date {
                    return save_somewhere(&trainer, to, &mut self.summary);
                }
            }
            None if self.is_wanted || self.is_worth_saving => {
                let lost = grouped(snapshot.unsaved_updates());
                let problem = format!(
                    "the trainer hung or crashed: {lost} updates since the last save are lost"
                );
                return (None, Err(miette::miette!(help = logging::hint(), "{problem}")));
            }
            Some(_) if self.is_kept && (self.is_worth_saving || saved_at.is_some()) => {
                let unsaved = snapshot.counters.updates.saturating_sub(saved_at.unwrap_or(0));
                if unsaved > 0 {
                    self.summary += &format!("\nnot saved: {} updates", grouped(unsaved));
                }
            }
            _ => {}
        }
        (None, Ok(()))
    }

    /// Says which files there are. Autosaves go if what the user has saved, if all went `well`, is
    /// newer.
    fn tell_files(&mut self, well: bool, snapshot: &Snapshot) {
        if let Some((updates, path)) = &snapshot.saved {
            let at = grouped(snapshot.learned(*updates));
            self.summary += &format!("\nsaved {} at update {at}", path.display());
        }
        let has_own = snapshot.saved.is_some() && !self.is_worth_saving;
        for path in snapshot.autosaves.iter() {
            if well && (self.is_wanted || has_own) {
                train::remove_own(path);
            } else {
                self.summary += &format!("\nautosaved {}", path.display());
            }
        }
    }
}

/// Saves to the requested file; if that fails, tries another one and returns the error. Returns the
/// file written.
fn save_somewhere(
    trainer: &Trainer,
    to: &SaveTo,
    summary: &mut String,
) -> (Option<PathBuf>, Result<(), Report>) {
    let first = match train::save(trainer, to) {
        Ok(path) => {
            *summary += &format!("\nsaved {}", path.display());
            return (Some(path), Ok(()));
        }
        Err(error) => error,
    };
    let elsewhere = save_elsewhere(trainer, to.path());
    if let Some(path) = &elsewhere {
        *summary += &format!("\nsaved {} instead", path.display());
    }
    (elsewhere, Err(from_checkpoint_error(first)))
}

/// Returns the run's latest file: its own or an autosaved one.
fn newest_file(to: &SaveTo, snapshot: &Snapshot) -> Option<PathBuf> {
    let own = matches!(to, SaveTo::Replace(_)).then(|| to.path().to_owned());
    let written = |path: PathBuf| Some((std::fs::metadata(&path).ok()?.modified().ok()?, path));
    let files = own.into_iter().chain(snapshot.autosaves.iter().cloned()).filter_map(written);
    files.max().map(|(_, path)| path)
}
