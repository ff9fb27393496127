//! Closing a run: it is saved if that is wanted, and the terminal says what is left.

use std::path::PathBuf;
use std::sync::Arc;

use miette::Report;

use super::Session;
use super::saving::{is_worth_saving, notes};
use crate::host::logging;
use crate::host::outputs::save_elsewhere;
use crate::host::report::from_checkpoint_error;
use crate::host::runs;
use crate::host::waiting::{TWICE, Waiting};
use crate::tui::interface::ClosedRun;
use crate::tui::terminal;
use gdg::engine::{Engine, Phase, Snapshot};
use gdg::text::grouped;
use gdg::train::{self, Notes, SaveTo, Trainer};

impl Session {
    /// Ends training, and saves if that is requested and not yet done. The summary says how much is
    /// not saved if the run `is_kept` at all.
    pub fn close(mut self, engine: Engine, is_kept: bool) -> ClosedRun {
        self.exports.finish();
        // Decided before: what closing itself reports changes nothing.
        self.catch_up();
        self.screen.snapshot = self.screen.latest.clone();
        let pulse = engine.pulse().clone();
        let _waiting = Waiting::begin(&pulse, TWICE, terminal::restore);
        let failed = self.saver.has_failed || matches!(self.screen.latest.phase, Phase::Failed(_));
        let mut ending = Ending {
            files: String::new(),
            is_wanted: self.saver.named.is_some(),
            is_worth_saving: is_worth_saving(&self),
            is_kept,
            has_unsaved_map: self.scene.has_unsaved_map(),
            tells_lost: false,
        };
        let notes = notes(&self);
        let Self { saver, cx, .. } = self;
        let (mut screen, snapshots) = (cx.screen, engine.snapshots());
        // The trainer ends once nothing can send it commands any more.
        drop(cx.link);
        let trainer = engine.stop();
        // All that is said is said of one moment: the trainer may be farther than its last snapshot.
        let mut snapshot = Snapshot::clone(&snapshots.borrow());
        if let Some(trainer) = &trainer {
            (snapshot.counters, snapshot.seconds) = (trainer.counters(), trainer.seconds());
        }
        let to = match (&snapshot.saved, &screen.snapshot.saved) {
            // A save that the screen has not seen any more was the run's first: the file is its own
            // by now.
            (Some((_, path)), None) => SaveTo::Replace(path.to_path_buf()),
            _ => saver.to,
        };
        let (saved_to, saved) = ending.save(trainer, notes, &to, &mut snapshot);
        ending.tell_files(saved.is_ok() && !failed, &mut snapshot);
        let files = ending.files;
        let newest = saved_to.or_else(|| newest_file(&snapshot));
        screen.snapshot = Arc::new(snapshot);
        let mut summary = screen.summary(cx.scene.title(&screen.snapshot)) + &files;
        if let Some(file) = newest {
            summary += &format!("\nresume with: {}", runs::resume_command(&file));
        }
        if failed {
            summary += &format!("\nthere were errors; {}", logging::hint());
        }
        ClosedRun { summary, files: files.trim_start().replace('\n', "; "), saved, failed }
    }
}

/// What is known and said of a run when the interface is closed.
struct Ending {
    /// The lines of the text left on the terminal that are about files.
    files: String,
    /// Whether the run is to be saved.
    is_wanted: bool,
    is_worth_saving: bool,
    /// Whether the run could have been saved at all.
    is_kept: bool,
    has_unsaved_map: bool,
    /// Whether to say how much is in no file.
    tells_lost: bool,
}

impl Ending {
    /// Saves the run if it is wanted and not yet saved. Returns the file written.
    fn save(
        &mut self,
        trainer: Option<Trainer>,
        notes: Notes,
        to: &SaveTo,
        snapshot: &mut Snapshot,
    ) -> (Option<PathBuf>, Result<(), Report>) {
        let saved_at = snapshot.saved.as_ref().map(|(updates, _)| *updates);
        match trainer {
            Some(mut trainer) if self.is_wanted => {
                let updates = trainer.counters().updates;
                let up_to_date = !self.has_unsaved_map && saved_at == Some(updates);
                let _ = trainer.ensure_finite();
                trainer.set_notes(notes);
                if !up_to_date {
                    let (path, saved) = save_somewhere(&trainer, to);
                    let saved_to = path.clone().map(|path| (updates, Arc::new(path)));
                    snapshot.saved = saved_to.or(snapshot.saved.take());
                    return (path, saved);
                }
            }
            None if self.is_wanted || self.is_worth_saving => {
                let lost = grouped(snapshot.lost_updates());
                let problem = format!(
                    "the trainer hung or crashed: {lost} updates since the last save are lost"
                );
                return (None, Err(miette::miette!(help = logging::hint(), "{problem}")));
            }
            Some(_) => {
                self.tells_lost = self.is_kept && (self.is_worth_saving || saved_at.is_some());
            }
            None => {}
        }
        (None, Ok(()))
    }

    /// Says which files there are, and how much is in none of them. Autosaves go if what the user
    /// has saved, if all went `well`, is newer.
    fn tell_files(&mut self, well: bool, snapshot: &mut Snapshot) {
        let has_own = snapshot.saved.is_some() && !self.is_worth_saving;
        if well && (self.is_wanted || has_own) {
            let autosaves = std::mem::take(&mut snapshot.autosaves);
            autosaves.iter().for_each(|(_, path)| train::remove_own(path));
        }
        let at = |updates| grouped(snapshot.learned(updates));
        if let Some((updates, path)) = &snapshot.saved {
            let last = if snapshot.unsaved_updates() > 0 { "last " } else { "" };
            self.files += &format!("\n{last}saved {} at update {}", path.display(), at(*updates));
        }
        for (updates, path) in snapshot.autosaves.iter() {
            self.files += &format!("\nautosaved {} at update {}", path.display(), at(*updates));
        }
        let lost = snapshot.lost_updates();
        if self.tells_lost && lost > 0 {
            let last = if lost < snapshot.updates() { "the last " } else { "" };
            self.files += &format!("\nnot saved: {last}{} updates", grouped(lost));
        }
    }
}

/// Saves to the requested file; if that fails, tries another one and returns the error. Returns the
/// file written.
fn save_somewhere(trainer: &Trainer, to: &SaveTo) -> (Option<PathBuf>, Result<(), Report>) {
    match train::save(trainer, to) {
        Ok(path) => (Some(path), Ok(())),
        Err(error) => (save_elsewhere(trainer, to.path()), Err(from_checkpoint_error(error))),
    }
}

fn newest_file(snapshot: &Snapshot) -> Option<PathBuf> {
    let own = snapshot.saved.as_ref().map(|(_, path)| path.to_path_buf());
    let autosaves = snapshot.autosaves.iter().map(|(_, path)| path.clone());
    let written = |path: PathBuf| Some((std::fs::metadata(&path).ok()?.modified().ok()?, path));
    own.into_iter().chain(autosaves).filter_map(written).max().map(|(_, path)| path)
}
