//! Exports to files.

use crate::tui::background::Background;
use crate::tui::export;
use crate::tui::output::ExportKind;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;

/// The export that is pending, and the one that is being written.
#[derive(Default)]
pub struct Exports {
    pending: Option<ExportKind>,
    /// Returns the notice at the end.
    writing: Option<Background<Result<String, String>>>,
}

impl Exports {
    /// Asks for an export. It is written from the next tick on, without the dialog that asked for
    /// it.
    pub fn request(&mut self, kind: ExportKind) {
        self.pending = Some(kind);
    }

    /// Begins to write what is pending, and says what is being written and what has been.
    pub fn on_tick(&mut self, screen: &mut Screen, scene: &Scene) {
        if let Some(kind) = self.pending.take() {
            self.begin(kind, screen, scene);
        }
        if let Some(done) = self.writing.take_if(|writing| writing.is_finished()) {
            match done.finish().flatten() {
                Ok(notice) => screen.notify(&notice),
                Err(problem) => screen.report(&problem),
            }
        }
        let notice = self.writing.as_mut().and_then(Background::notice);
        notice.iter().for_each(|notice| screen.say(notice));
    }

    fn begin(&mut self, kind: ExportKind, screen: &mut Screen, scene: &Scene) {
        if let Some(writing) = &self.writing {
            return screen.notify(&format!("not yet: still {}", writing.what()));
        }
        match export::begin(kind, screen, scene) {
            Ok(writing) => self.writing = Some(writing),
            Err(error) => {
                let name = kind.name(scene.noun());
                screen.report(&format!("{name} cannot be written: {error}"));
            }
        }
    }

    /// Waits until what is being written is there.
    pub fn finish(&mut self) {
        // A second or two; otherwise its temporary file would stay behind.
        self.writing.take().map(Background::finish);
    }
}
