//! What is seen, as files: pictures of map and screen, curves as a drawing and as numbers.

mod curves;
mod picture;
mod vector;

use std::path::{Path, PathBuf};

use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::{Frame, Terminal};

use super::output::What;
use super::render;
use super::screen::Screen;
use super::theme::{Rgb, Theme, ThemeName};
use crate::files::{self, write_whole};
pub use picture::png_of;

/// Where exports go.
const FOLDER: &str = "exports";

/// Writes what was asked for to a file of its own; what is to be said of it.
pub fn write(what: What, screen: &Screen) -> String {
    let (map, updates) = (screen.map().name(), screen.snapshot.counters.updates);
    let name = format!("{map}-{updates}-{}", what.stem());
    let path = unused(Path::new(FOLDER), &name, what.file_type());
    let written = contents(what, screen).and_then(|bytes| write_whole(&path, &bytes).map_err(|e| e.to_string()));
    match written {
        Ok(()) => format!("wrote {}", path.display()),
        Err(error) => format!("{} cannot be written: {error}", path.display()),
    }
}

/// A file that is not there yet: of a paused run there may be several pictures.
fn unused(folder: &Path, name: &str, file_type: &str) -> PathBuf {
    files::unused(&folder.join(format!("{name}.{file_type}")))
}

/// The file's contents.
///
/// # Errors
/// What cannot be drawn or written.
pub fn contents(what: What, screen: &Screen) -> Result<Vec<u8>, String> {
    match what {
        What::CurvesSvg => curves::svg(screen),
        What::CurvesCsv => curves::csv(screen),
        What::MapPng | What::MapSvg | What::ScreenPng | What::ScreenSvg => {
            let (drawn, map_pane) = draw(screen).map_err(|e| e.to_string())?;
            let area = match what {
                What::MapPng | What::MapSvg => map_pane.intersection(drawn.area),
                _ => drawn.area,
            };
            if area.is_empty() {
                return Err("there is nothing to be seen: the window is too small".to_owned());
            }
            let paper = Paper::of(&screen.theme);
            match what {
                What::MapPng | What::ScreenPng => png_of(&drawn, area, paper).map_err(|e| e.to_string()),
                _ => Ok(vector::svg_of(&drawn, area, paper).into_bytes()),
            }
        }
    }
}

/// The screen as it is without dialogs, and where the map's pane lies.
fn draw(screen: &Screen) -> std::io::Result<(Buffer, Rect)> {
    let Rect { width, height, .. } = screen.places.screen;
    let mut terminal = Terminal::new(TestBackend::new(width.max(1), height.max(1))).map_err(std::io::Error::other)?;
    let mut map_pane = Rect::default();
    let panes =
        |frame: &mut Frame| map_pane = render::draw_panes(frame, screen, &mut render::Cache::default()).map_pane;
    terminal.draw(panes).map_err(std::io::Error::other)?;
    Ok((terminal.backend().buffer().clone(), map_pane))
}

/// The colours of text and ground where a terminal's own would be.
#[derive(Clone, Copy, Debug)]
pub struct Paper {
    /// Text.
    pub ink: Rgb,
    /// Ground.
    pub ground: Rgb,
}

impl Paper {
    /// What goes with a theme.
    pub fn of(theme: &Theme) -> Self {
        match theme.name {
            ThemeName::Light => Self { ink: (30, 30, 34), ground: (252, 252, 252) },
            _ => Self::default(),
        }
    }
}

impl Default for Paper {
    fn default() -> Self {
        Self { ink: (222, 222, 226), ground: (16, 16, 20) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_export_replaces_another() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut names = Vec::new();
        for _ in 0..3 {
            let path = unused(folder.path(), "rooms-5-map", "png");
            std::fs::write(&path, b"").expect("written");
            names.push(path.file_name().expect("a name").to_owned());
        }
        assert_eq!(names, ["rooms-5-map.png", "rooms-5-map-2.png", "rooms-5-map-3.png"]);
    }
}
