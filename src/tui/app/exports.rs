//! Exports to files.

use std::thread::JoinHandle;
use std::time::Instant;

use crate::tui::busy::{self, Lasting};
use crate::tui::export;
use crate::tui::output::ExportKind;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use gdg::pulse::Progress;

/// The export that is pending, and the film that is being written.
#[derive(Default)]
pub struct Exports {
    pending: Option<ExportKind>,
    film: Option<WrittenFilm>,
}

/// A film that is being written.
struct WrittenFilm {
    /// Its name, as in "writing NAME".
    name: String,
    since: Instant,
    /// Seconds at the last notice.
    told: u64,
    progress: Progress,
    /// Returns the notice at the end.
    thread: JoinHandle<Result<String, String>>,
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
        if let Some(film) = &mut self.film
            && film.since.elapsed().as_secs() > film.told
        {
            film.told = film.since.elapsed().as_secs();
            let lasting = Lasting::now(film.since, &film.progress);
            screen.say(&busy::notice(&format!("writing {}", film.name), lasting));
        }
        if let Some(film) = self.film.take_if(|film| film.thread.is_finished()) {
            let written =
                film.thread.join().unwrap_or_else(|_| Err("the film cannot be drawn".to_owned()));
            say(written, screen);
        }
    }

    fn begin_film(&mut self, kind: ExportKind, screen: &mut Screen, scene: &Scene) {
        if self.film.is_some() {
            return screen.notify("the film is being written already");
        }
        let progress = Progress::default();
        match export::write_film(kind, screen, scene, progress.clone()) {
            Ok(thread) => {
                let name = kind.name(scene.noun());
                screen.notify(&format!("writing {name} ..."));
                let since = Instant::now();
                self.film = Some(WrittenFilm { name, since, told: 0, progress, thread });
            }
            Err(error) => screen.report(&format!("the film cannot be written: {error}")),
        }
    }

    /// Waits until the film is written.
    pub fn finish(&mut self) {
        if let Some(film) = self.film.take() {
            // A second at most; otherwise its temporary file would stay behind.
            drop(film.thread.join());
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
