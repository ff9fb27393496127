//! Pictures of the comparison in files.

use super::{Comparison, draw};
use crate::tui::export::{ExportError, in_full_colour, on_paper, picture, write_as};
use crate::tui::output::ExportKind;
use crate::tui::scene::Cache;
use crate::tui::theme::Theme;

impl Comparison {
    /// Writes a picture of both maps or of the whole screen to a new file, and says where.
    pub(super) fn export(&mut self, kind: ExportKind) {
        let [a, b] = self.sides.each_ref().map(|side| side.app.screen.run().method.name());
        let [first, _] = &self.sides;
        let (map, updates) = (first.maze().map.name(), first.shown_updates());
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
        let only_maps = matches!(kind, ExportKind::MapPng | ExportKind::MapSvg);
        self.sides.iter_mut().for_each(|side| side.app.screen.on_paper = only_maps);
        let drawn = in_full_colour(self, Self::themes, |own| {
            let mut caches = [Cache::default(), Cache::default()];
            on_paper(own.layout.screen, |frame| {
                draw::draw_parts(frame, own, caches.each_mut()).maps
            })
        });
        self.sides.iter_mut().for_each(|side| side.app.screen.on_paper = false);
        let (drawn, maps) = drawn?;
        let area = if only_maps { maps } else { drawn.area };
        picture(kind, &drawn, area, &self.sides[0].app.screen.theme.in_full_colour())
    }

    fn themes(&mut self) -> [&mut Theme; 2] {
        self.sides.each_mut().map(|side| &mut side.app.screen.theme)
    }
}
