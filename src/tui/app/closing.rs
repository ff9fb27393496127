//! Closing the interface: the run is saved if that is wanted, and the terminal says what is left.

use std::path::{Path, PathBuf};

use miette::Report;

use super::App;
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

impl App {
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
            summary: self.screen.summary(self.scene.title(&self.screen.snapshot)),
            files: String::new(),
            is_wanted: self.saver.named.is_some(),
            is_worth_saving: is_worth_saving(&self.scene, &self.screen),
            is_kept,
            has_unsaved_map: self.scene.has_unsaved_map(),
        };
        let notes = notes(&self.scene, &self.screen);
        let Self { saver, screen, link, .. } = self;
        let snapshots = engine.snapshots();
        // The trainer ends once nothing can send it commands any more.
        drop(link);
        let trainer = engine.stop();
        let snapshot = snapshots.borrow().clone();
        let to = match (&snapshot.saved, &screen.snapshot.saved) {
            // A save that the screen has not seen any more was the run's first: the file is its own
            // by now.
            (Some((_, path)), None) => SaveTo::Replace(path.to_path_buf()),
            _ => saver.to,
        };
        let (saved_to, saved) = ending.save(trainer, notes, &to, &snapshot);
        ending.tell_files(saved.is_ok() && !failed, &snapshot);
        let Ending { mut summary, files, .. } = ending;
        summary += &files;
        if let Some(file) = saved_to.or_else(|| newest_file(&to, &snapshot)) {
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
    /// The text left on the terminal, and the lines of it that are about files.
    summary: String,
    files: String,
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
                    return save_somewhere(&trainer, to, &mut self.files);
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
                    self.files += &format!("\nnot saved: {} updates", grouped(unsaved));
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
            let at = snapshot.learned(*updates);
            // First: what is not saved has come since.
            self.files.insert_str(0, &was_saved(path, at, snapshot.unsaved_updates()));
        }
        let has_own = snapshot.saved.is_some() && !self.is_worth_saving;
        for path in snapshot.autosaves.iter() {
            if well && (self.is_wanted || has_own) {
                train::remove_own(path);
            } else {
                self.files += &format!("\nautosaved {}", path.display());
            }
        }
    }
}

/// Says at which update a file was saved, which lacks those `unsaved`.
fn was_saved(path: &Path, updates: u64, unsaved: u64) -> String {
    let last = if unsaved > 0 { "last " } else { "" };
    format!("\n{last}saved {} at update {}", path.display(), grouped(updates))
}

/// Saves to the requested file; if that fails, tries another one and returns the error. Returns the
/// file written.
fn save_somewhere(
    trainer: &Trainer,
    to: &SaveTo,
    lines: &mut String,
) -> (Option<PathBuf>, Result<(), Report>) {
    let first = match train::save(trainer, to) {
        Ok(path) => {
            *lines += &format!("\nsaved {}", path.display());
            return (Some(path), Ok(()));
        }
        Err(error) => error,
    };
    let elsewhere = save_elsewhere(trainer, to.path());
    if let Some(path) = &elsewhere {
        *lines += &format!("\nsaved {} instead", path.display());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_lacks_the_latest_updates_was_saved_last() {
        let said = |unsaved| was_saved(Path::new("own"), 2_178, unsaved);
        assert_eq!(said(0), "\nsaved own at update 2,178");
        assert_eq!(said(691), "\nlast saved own at update 2,178");
    }
}
