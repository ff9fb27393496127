//! Opens runs while the list is still shown, as loading a large one takes seconds.

use std::path::Path;

use miette::miette;

use super::{Next, Opened, RunsScreen, Wish};
use crate::tui::background::{Background, PATIENCE};
use gdg::text::sanitized;

impl RunsScreen {
    /// Begins to open what the user wishes, in place of what is being opened.
    pub(super) fn begin_to_open(&mut self) {
        let Some(wish) = self.wish.take() else { return };
        let (what, opener) = (describe(&wish), self.opener.clone());
        match Background::start(what, move |progress| opener(wish, progress)) {
            Ok(opening) => {
                opening.wait(PATIENCE);
                self.opening = Some(opening);
            }
            Err(error) => self.log.show(&format!("nothing can be opened: {error}"), true),
        }
    }

    /// Shows what has been opened, or how far it is; returns whether the list changes.
    pub(super) fn show_opened(&mut self) -> bool {
        let Some(done) = self.opening.take_if(|opening| opening.is_finished()) else {
            let notice = self.opening.as_mut().and_then(Background::notice);
            notice.iter().for_each(|notice| self.log.show(notice, false));
            return notice.is_some();
        };
        match done.finish().unwrap_or_else(|failure| Err(miette!("{failure}"))) {
            Ok(opened) => {
                if matches!(opened, Opened::Comparison(_)) {
                    self.list.clear_marks();
                }
                self.next = Some(Next::Show(opened));
            }
            Err(problem) => {
                self.log.show(&problem.to_string(), true);
                self.failures.push(problem);
            }
        }
        true
    }

    /// Gives up what is being opened; returns whether there was anything.
    pub(super) fn cancel_opening(&mut self) -> bool {
        // Its thread ends by itself.
        self.opening.take().inspect(|_| self.log.dismiss()).is_some()
    }
}

/// Says what is opened, as in "opening a.safetensors".
fn describe(wish: &Wish) -> String {
    let name = |path: &Path| sanitized(&path.file_name().unwrap_or_default().to_string_lossy());
    match wish {
        Wish::Resume(path) => format!("opening {}", name(path)),
        Wish::Compare([a, b]) => format!("opening {} and {}", name(a), name(b)),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::mpsc::channel;

    use crossterm::event::KeyCode;
    use parking_lot::Mutex;

    use super::*;
    use crate::tui::interface::Interface;
    use crate::tui::runs::tests::{press, screen, text};

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
        let open = |screen: &mut RunsScreen| {
            screen.wish = Some(Wish::Resume("saves/large.safetensors".into()));
            screen.on_tick();
        };
        open(&mut screen);
        let shown = text(&mut screen, 80, 24);
        assert!(
            shown.contains("opening large.safetensors ...") && shown.contains("5 runs"),
            "{shown}"
        );
        press(&mut screen, KeyCode::Esc);
        assert!(screen.opening.is_none() && !text(&mut screen, 80, 24).contains("opening"));
        go_on.send(()).expect("it still runs");
        open(&mut screen);
        go_on.send(()).expect("it waits");
        while screen.opening.is_some() {
            screen.on_tick();
        }
        let shown = text(&mut screen, 80, 24);
        assert!(screen.next.is_none() && shown.contains("is cut off at 12 bytes"), "{shown}");
        assert_eq!(screen.failures.len(), 1);
    }
}
