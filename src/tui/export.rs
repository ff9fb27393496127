//! What is seen, as files: pictures of map and screen, curves as a drawing and as numbers.

mod curves;
mod picture;
mod vector;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;

use super::app::App;
use super::render;
use super::theme::{Rgb, Theme, ThemeName};
pub use picture::png_of;

/// What can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// The map pane as a picture of pixels.
    MapPng,
    /// The map pane as a drawing.
    MapSvg,
    /// The whole screen as a picture.
    ScreenPng,
    /// The whole screen as a drawing.
    ScreenSvg,
    /// The curves as a drawing.
    CurvesSvg,
    /// The curves as a table of numbers.
    CurvesCsv,
}

impl What {
    /// All of it.
    pub const ALL: [Self; 6] =
        [Self::MapPng, Self::MapSvg, Self::ScreenPng, Self::ScreenSvg, Self::CurvesSvg, Self::CurvesCsv];

    /// What it is called on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::MapPng => "the map as a picture",
            Self::MapSvg => "the map as a drawing",
            Self::ScreenPng => "the screen as a picture",
            Self::ScreenSvg => "the screen as a drawing",
            Self::CurvesSvg => "the curves as a drawing",
            Self::CurvesCsv => "the curves as numbers",
        }
    }

    /// The file's name without map and update.
    pub fn stem(self) -> &'static str {
        match self {
            Self::MapPng | Self::MapSvg => "map",
            Self::ScreenPng | Self::ScreenSvg => "screen",
            Self::CurvesSvg | Self::CurvesCsv => "curves",
        }
    }

    /// The file's extension.
    pub fn file_type(self) -> &'static str {
        match self {
            Self::MapPng | Self::ScreenPng => "png",
            Self::MapSvg | Self::ScreenSvg | Self::CurvesSvg => "svg",
            Self::CurvesCsv => "csv",
        }
    }
}

/// The file's contents.
///
/// # Errors
/// What cannot be drawn or written.
pub fn contents(what: What, app: &mut App) -> Result<Vec<u8>, String> {
    match what {
        What::CurvesSvg => curves::svg(app),
        What::CurvesCsv => curves::csv(app),
        What::MapPng | What::MapSvg | What::ScreenPng | What::ScreenSvg => {
            let screen = draw(app).map_err(|e| e.to_string())?;
            let area = match what {
                What::MapPng | What::MapSvg => app.places.map_pane.intersection(screen.area),
                _ => screen.area,
            };
            if area.is_empty() {
                return Err("there is nothing to be seen: the window is too small".to_owned());
            }
            let paper = Paper::of(&app.theme);
            match what {
                What::MapPng | What::ScreenPng => png_of(&screen, area, paper).map_err(|e| e.to_string()),
                _ => Ok(vector::svg_of(&screen, area, paper).into_bytes()),
            }
        }
    }
}

/// The screen as it is without dialogs on top.
fn draw(app: &mut App) -> std::io::Result<Buffer> {
    let Rect { width, height, .. } = app.places.screen;
    let mut terminal = Terminal::new(TestBackend::new(width.max(1), height.max(1))).map_err(std::io::Error::other)?;
    let on_top = std::mem::take(&mut app.dialogs);
    let drawn = terminal.draw(|frame| render::draw(frame, app)).map(|_| ());
    app.dialogs = on_top;
    drawn.map_err(std::io::Error::other)?;
    Ok(terminal.backend().buffer().clone())
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
