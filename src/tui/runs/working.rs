//! Does what may take seconds while the list is still shown: opens runs, draws their curves,
//! deletes files.

use std::path::Path;

use miette::{Report, miette};

use super::files::{self, Question};
use super::{Curves, Next, Opened, RunsScreen, Wish};
use crate::experiment::runs::SavedRun;
use crate::tui::background::{Background, PATIENCE};
use gdg::pulse::Progress;
use gdg::text::{counted, sanitized};

/// What has been done.
pub enum Done {
    /// What is shown next has been opened, or cannot be.
    Opened(Result<Opened, Report>),
    /// Files have been written or deleted, as this says, or could not be.
    Changed(Result<String, String>),
}

/// Work on a thread of its own.
pub struct Work {
    background: Background<Done>,
    /// Whether it writes or deletes files, and so is not given up.
    changes_files: bool,
}

impl RunsScreen {
    /// Begins to open what the user wishes.
    pub(super) fn begin_to_open(&mut self) {
        let Some(wish) = self.wish.take() else { return };
        let (what, opener) = (describe(&wish), self.opener.clone());
        self.begin(what, false, move |progress| Done::Opened(opener(wish, progress)));
    }

    /// Begins to draw the curves of runs into files.
    pub(super) fn begin_to_plot(&mut self, curves: Curves) {
        let runs = self.list.chosen().into_iter();
        let runs: Vec<SavedRun> = runs.map(|entry| (*entry.run).clone()).collect();
        if runs.is_empty() {
            return self.log.show("no run is selected: nothing to plot", true);
        }
        let what = format!("plotting {}", counted(runs.len() as u64, "run"));
        self.begin(what, true, move |progress| Done::Changed(files::plot(&runs, curves, progress)));
    }

    /// Begins to delete the files that the user has been asked about.
    pub(super) fn begin_to_delete(&mut self, question: Question) {
        let what = format!("deleting {}", counted(question.files.len() as u64, "file"));
        self.begin(what, true, move |progress| Done::Changed(question.delete(progress)));
    }

    /// Begins work, in place of what is being opened; what changes files comes to its end first.
    fn begin(
        &mut self,
        what: String,
        changes_files: bool,
        work: impl FnOnce(&Progress) -> Done + Send + 'static,
    ) {
        if let Some(now) = self.work.as_ref().filter(|now| now.changes_files) {
            return self.log.show(&format!("not yet: still {}", now.background.what()), false);
        }
        match Background::start(what, work) {
            Ok(background) => {
                background.wait(PATIENCE);
                self.work = Some(Work { background, changes_files });
                self.follow_work();
            }
            Err(error) => self.log.show(&format!("no thread can be started: {error}"), true),
        }
    }

    /// Shows what has been done, or how far it is; returns whether the list changes.
    pub(super) fn follow_work(&mut self) -> bool {
        let Some(work) = self.work.take_if(|work| work.background.is_finished()) else {
            let notice = self.work.as_mut().and_then(|work| work.background.notice());
            notice.iter().for_each(|notice| self.log.show(notice, false));
            return notice.is_some();
        };
        let failed = |failure: String| Done::Opened(Err(miette!("{failure}")));
        match work.background.finish().unwrap_or_else(failed) {
            Done::Opened(Ok(opened)) => {
                if matches!(opened, Opened::Comparison(_)) {
                    self.list.clear_marks();
                }
                self.next = Some(Next::Show(opened));
            }
            Done::Opened(Err(problem)) => {
                self.log.show(&problem.to_string(), true);
                self.failures.push(problem);
            }
            Done::Changed(Ok(notice)) => {
                self.list.clear_marks();
                self.log.show(&notice, false);
            }
            Done::Changed(Err(problem)) => self.log.show(&problem, true),
        }
        if work.changes_files {
            self.reading.look_again();
        }
        true
    }

    /// Gives up what is being opened; returns whether there was anything.
    pub(super) fn cancel_opening(&mut self) -> bool {
        // Its thread ends by itself.
        let opening = self.work.take_if(|work| !work.changes_files);
        opening.inspect(|_| self.log.dismiss()).is_some()
    }

    /// Waits until files are written or deleted, as the end of the program would cut that short.
    pub(super) fn finish_work(&mut self) {
        self.cancel_opening();
        self.work.take().map(|work| work.background.finish());
    }
}

/// Says what is opened, as in "opening a.safetensors".
fn describe(wish: &Wish) -> String {
    let name = |path: &Path| sanitized(&path.file_name().unwrap_or_default().to_string_lossy());
    match wish {
        Wish::Resume(run) => format!("opening {}", name(&run.file)),
        Wish::Compare([a, b]) => format!("opening {} and {}", name(&a.file), name(&b.file)),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::mpsc::{Sender, channel};

    use crossterm::event::KeyCode;
    use parking_lot::Mutex;

    use super::*;
    use crate::tui::interface::Interface;
    use crate::tui::runs::Saved;
    use crate::tui::runs::tests::{screen, settle};
    use crate::tui::tests::{press, shown_by};

    fn large() -> Wish {
        Wish::Resume(Saved { file: "saves/large.safetensors".into(), goes_on: false })
    }

    #[test]
    fn the_list_stays_while_a_run_is_opened() {
        let mut screen = screen();
        let (go_on, waits) = channel();
        let waits = Mutex::new(waits);
        screen.opener = Arc::new(move |_, progress| {
            progress.begin(1, 2);
            let _ = waits.lock().recv();
            Err(miette!("is cut off at 12 bytes"))
        });
        for gives_up in [true, false] {
            screen.wish = Some(large());
            screen.on_tick();
            let shown = shown_by(&mut screen, 80, 24);
            assert!(shown.contains("opening large.safetensors ...") && shown.contains("5 runs"));
            if gives_up {
                press(&mut screen, KeyCode::Esc);
                assert!(screen.work.is_none());
            }
            go_on.send(()).expect("it waits");
            settle(&mut screen);
        }
        assert!(screen.next.is_none() && screen.failures.len() == 1);
        assert!(shown_by(&mut screen, 80, 24).contains("is cut off at 12 bytes"));
    }

    /// Begins work that changes files, and ends once something is sent.
    fn change_files(screen: &mut RunsScreen) -> Sender<()> {
        let (go_on, waits) = channel();
        screen.begin("plotting 2 runs".to_owned(), true, move |progress| {
            progress.begin(1, 2);
            let _ = waits.recv();
            Done::Changed(Ok("wrote all of it".to_owned()))
        });
        go_on
    }

    #[test]
    fn files_are_written_and_deleted_to_the_end_while_keys_work() {
        let mut screen = screen();
        let go_on = change_files(&mut screen);
        let shown = shown_by(&mut screen, 80, 24);
        assert!(shown.contains("plotting 2 runs ..."), "{shown}");
        for key in [KeyCode::Down, KeyCode::Char(' '), KeyCode::Esc] {
            press(&mut screen, key);
        }
        assert!(screen.list.position() == 1 && screen.work.is_some(), "Esc gives up no files");
        press(&mut screen, KeyCode::Char('p'));
        let shown = shown_by(&mut screen, 80, 24);
        assert!(shown.contains("not yet: still plotting 2 runs"), "{shown}");
        screen.wish = Some(large());
        screen.on_tick();
        assert!(screen.failures.is_empty(), "nor is anything opened meanwhile");
        go_on.send(()).expect("it waits");
        settle(&mut screen);
        assert!(shown_by(&mut screen, 80, 24).contains("wrote all of it"));
        let go_on = change_files(&mut screen);
        go_on.send(()).expect("it waits");
        screen.finish_work();
        assert!(go_on.send(()).is_err(), "its thread has ended");
    }
}
