//! Pictures of the comparison in files.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::Rect;

use super::{Comparison, draw};
use crate::tui::export::{ExportError, picture, write_as};
use crate::tui::output::ExportKind;
use crate::tui::scene::Cache;

impl Comparison {
    /// Writes a picture of both maps or of the whole screen to a new file, and says where.
    pub(super) fn export(&mut self, kind: ExportKind) {
        let [a, b] = self.sides.each_ref().map(|side| side.app.screen.run().method.name());
        let [first, _] = &self.sides;
        let (map, updates) = (first.maze().map.name(), first.app.screen.snapshot.updates());
        let name = format!("{map}-{a}-{b}-{updates}");
        match write_as(&name, kind, "maps", self.contents(kind)) {
            Ok(notice) => self.log.show(&notice, false),
            Err(problem) => self.log.show(&problem, true),
        }
    }

    /// Returns a picture of the screen in characters, without dialogs, or of both maps; in full
    /// colour even on a terminal that has fewer colours.
    ///
    /// # Errors
    /// The screen is too small, or the picture cannot be encoded.
    pub fn contents(&mut self, kind: ExportKind) -> Result<Vec<u8>, ExportError> {
        let own = self.sides.each_ref().map(|side| side.app.screen.theme);
        for (side, own) in self.sides.iter_mut().zip(&own) {
            side.app.screen.theme = own.in_full_colour();
        }
        let drawn = self.contents_as_they_are(kind);
        for (side, own) in self.sides.iter_mut().zip(own) {
            side.app.screen.theme = own;
        }
        drawn
    }

    fn contents_as_they_are(&self, kind: ExportKind) -> Result<Vec<u8>, ExportError> {
        let Rect { width, height, .. } = self.layout.screen;
        let mut terminal = Terminal::new(TestBackend::new(width.max(1), height.max(1)))
            .map_err(std::io::Error::other)?;
        let mut maps = Rect::default();
        let mut caches = [Cache::default(), Cache::default()];
        terminal
            .draw(|frame| maps = draw::draw_parts(frame, self, caches.each_mut()).maps)
            .map_err(std::io::Error::other)?;
        let drawn = terminal.backend().buffer();
        let area = match kind {
            ExportKind::MapPng | ExportKind::MapSvg => maps,
            _ => drawn.area,
        };
        picture(kind, drawn, area, &self.sides[0].app.screen.theme)
    }
}
