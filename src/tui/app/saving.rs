//! Saving the run, and quitting without losing it.

use std::path::{Path, PathBuf};

use miette::Report;

use super::{App, Autosaved};
use crate::host::logging;
use crate::host::report::from_checkpoint_error;
use crate::host::runs::{self, SAVES};
use crate::host::setup::save_elsewhere;
use crate::host::waiting::{TWICE, Waiting};
use crate::tui::dialog::{Choice, Dialog, Picker, Prompt, Question};
use crate::tui::interface::ClosedRun;
use crate::tui::lists;
use crate::tui::terminal;
use gdg::engine::{Command, Phase, Snapshot};
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
        self.autosaving_as = Some(self.what_is_autosaved());
        self.command(Command::Autosave(self.saving.to.path().to_owned(), self.notes()));
    }

    /// Returns whether anything has changed since the latest autosave. What has not needs no other
    /// copy, which would take the place of an older one.
    pub(in crate::tui) fn has_something_to_autosave(&self) -> bool {
        let changed = self.screen.latest.unsaved_updates() > 0
            && self.autosaved_as != Some(self.what_is_autosaved());
        changed && self.autosaving_as.is_none()
    }

    /// Returns what a checkpoint keeps of the screen.
    fn notes(&self) -> Notes {
        Notes { log: self.screen.log.entries().to_vec(), goal: self.scene.goal() }
    }

    /// Returns the run, updates and map that an autosave would save now.
    pub(super) fn what_is_autosaved(&self) -> Autosaved {
        let map = self.scene.maze().map(|maze| maze.map.clone());
        (self.screen.latest.run.clone(), self.screen.latest.updates(), map)
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
    pub fn close(mut self, is_kept: bool) -> ClosedRun {
        // Decided before: what closing itself reports changes nothing.
        self.catch_up();
        self.screen.snapshot = self.screen.latest.clone();
        let _waiting = Waiting::begin(self.engine.pulse(), TWICE, terminal::restore);
        let failed =
            !self.failures.is_empty() || matches!(self.screen.latest.phase, Phase::Failed(_));
        let mut summary = self.screen.summary(self.scene.title(&self.screen.snapshot));
        let notes = self.notes();
        let (worth_saving, unsaved_map) = (self.is_worth_saving(), self.scene.has_unsaved_map());
        let Self { saving, engine, screen, link, .. } = self;
        // The trainer ends once nothing can send it commands any more.
        drop(link);
        let snapshots = engine.snapshots();
        let trainer = engine.stop();
        let snapshot = snapshots.borrow().clone();
        let to = match (&snapshot.saved, &screen.snapshot.saved) {
            // A save that the screen has not seen any more was the run's first: the file is its own
            // by now.
            (Some((_, path)), None) => SaveTo::Replace(path.to_path_buf()),
            _ => saving.to,
        };
        let wanted = saving.named.is_some();
        let (mut saved, mut saved_to) = (Ok(()), None);
        match trainer {
            Some(mut trainer) if wanted => {
                let is_saved = |(at, _): &(u64, _)| *at == trainer.counters().updates;
                let up_to_date = !unsaved_map && snapshot.saved.as_ref().is_some_and(is_saved);
                let _ = trainer.ensure_finite();
                trainer.set_notes(notes);
                if !up_to_date {
                    (saved_to, saved) = save_somewhere(&trainer, &to, &mut summary);
                }
            }
            None if wanted || worth_saving => {
                let lost = grouped(snapshot.unsaved_updates());
                let problem = format!(
                    "the trainer hung or crashed: {lost} updates since the last save are lost"
                );
                saved = Err(miette::miette!(help = logging::hint(), "{problem}"));
            }
            Some(_) if is_kept && (worth_saving || snapshot.saved.is_some()) => {
                let saved = snapshot.saved.as_ref().map_or(0, |(updates, _)| *updates);
                let unsaved = snapshot.counters.updates.saturating_sub(saved);
                if unsaved > 0 {
                    summary += &format!("\nnot saved: {} updates", grouped(unsaved));
                }
            }
            _ => {}
        }
        if let Some((updates, path)) = &snapshot.saved {
            summary += &format!(
                "\nsaved {} at update {}",
                path.display(),
                grouped(snapshot.learned(*updates))
            );
        }
        let kept_by_user =
            saved.is_ok() && !failed && (wanted || (snapshot.saved.is_some() && !worth_saving));
        for path in snapshot.autosaves.iter() {
            if kept_by_user {
                // What the user saved is newer.
                train::remove_own(path);
            } else {
                summary += &format!("\nautosaved {}", path.display());
            }
        }
        if let Some(file) = saved_to.or_else(|| newest_file(&to, &snapshot)) {
            summary += &format!("\nresume with: {}", runs::resume_command(&file));
        }
        if failed {
            summary += &format!("\nthere were errors; {}", logging::hint());
        }
        ClosedRun { summary, saved, failed }
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
