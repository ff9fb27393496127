//! Exports to files.

use std::thread::JoinHandle;

use crate::tui::export;
use crate::tui::output::ExportKind;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;

/// The export that is pending, and the film that is being written.
#[derive(Default)]
pub struct Exports {
    pending: Option<ExportKind>,
    /// Returns the notice.
    film: Option<JoinHandle<Result<String, String>>>,
}

impl Exports {
    /// Asks for an export. It is written at the next tick, without the dialog that asked for it.
    pub fn request(&mut self, kind: ExportKind) {
        self.pending = Some(kind);
    }

    /// Writes what is pending, and says what has been written.
    pub fn on_tick(&mut self, screen: &mut Screen, scene: &Scene) {
        match self.pending.take() {
            Some(kind @ (ExportKind::Still | ExportKind::Film)) => {
                self.begin_film(kind, screen, scene);
            }
            Some(kind) => say(export::write(kind, screen, scene), screen),
            None => {}
        }
        if let Some(film) = self.film.take_if(|film| film.is_finished()) {
            let written =
                film.join().unwrap_or_else(|_| Err("the film cannot be drawn".to_owned()));
            say(written, screen);
        }
    }

    fn begin_film(&mut self, kind: ExportKind, screen: &mut Screen, scene: &Scene) {
        if self.film.is_some() {
            return screen.notify("the film is being written already");
        }
        match export::write_film(kind, screen, scene) {
            Ok(film) => {
                self.film = Some(film);
                screen.notify(&format!("writing {} ...", kind.name(scene.noun())));
            }
            Err(error) => screen.report(&format!("the film cannot be written: {error}")),
        }
    }

    /// Waits until the film is written.
    pub fn finish(&mut self) {
        if let Some(film) = self.film.take() {
            // A second at most; otherwise its temporary file would stay behind.
            drop(film.join());
        }
    }
}

/// Says where an export has been written, or why not.
fn say(written: Result<String, String>, screen: &mut Screen) {
    match written {
        Ok(notice) => screen.notify(&notice),
        Err(problem) => screen.report(&problem),
    }
}
