//! Exports to files: pictures of map and screen, curves as a drawing and as a table.

mod curves;
mod picture;
mod vector;

use std::path::{Path, PathBuf};
use std::thread::JoinHandle;

use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::{Frame, Terminal};

use super::output::ExportKind;
use super::render;
use super::scene::{Cache, Scene};
use super::screen::Screen;
use super::theme::{Rgb, Theme};
use crate::figure::Format;
use gdg::engine::Snapshot;
use gdg::files::{self, write_atomically};
use gdg::pulse::Progress;
use gdg::viewer::{FilmError, animate, still};
pub use picture::{picture_of, png_of};

/// Folder for exports.
pub const EXPORT_FOLDER: &str = "exports";

/// Pixels of a large bitmap from left to right.
const STILL_WIDTH: usize = 1_600;

/// Why an export fails.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The window has no room for what is exported.
    #[error("nothing to export: the window is too small")]
    Empty,
    /// The file system, or drawing in memory, reports an error.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The picture cannot be encoded.
    #[error(transparent)]
    Png(#[from] png::EncodingError),
    /// The curves cannot be drawn.
    #[error("{0}")]
    Figure(miette::Report),
    /// There is no film, or it cannot be drawn.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// The table cannot be written.
    #[error(transparent)]
    Csv(#[from] csv::Error),
}

/// Writes an export to a new file; returns the notice for the user.
///
/// # Errors
/// The notice that the file cannot be written.
pub fn write(kind: ExportKind, screen: &mut Screen, scene: &Scene) -> Result<String, String> {
    write_contents(&export_path(kind, screen, scene), contents(kind, screen, scene))
}

/// Writes the film, or a picture of its end, to a new file on its own thread, as that takes a second
/// or two; it returns the notice.
///
/// # Errors
/// The thread cannot be started.
pub fn write_film(
    kind: ExportKind,
    screen: &Screen,
    scene: &Scene,
    progress: Progress,
) -> std::io::Result<JoinHandle<Result<String, String>>> {
    let (path, run) = (export_path(kind, screen, scene), screen.snapshot.clone());
    let write = move || write_contents(&path, filmed(kind, &run, &progress));
    std::thread::Builder::new().name("film".to_owned()).spawn(write)
}

/// Writes contents to a new file that begins with `name`; returns the notice for the user.
///
/// # Errors
/// The notice that the file cannot be written.
pub fn write_as(
    name: &str,
    kind: ExportKind,
    noun: &str,
    contents: Result<Vec<u8>, ExportError>,
) -> Result<String, String> {
    write_contents(&new_path(name, kind, noun), contents)
}

fn export_path(kind: ExportKind, screen: &Screen, scene: &Scene) -> PathBuf {
    let (world, updates) = (scene.title(&screen.snapshot), screen.snapshot.counters.updates);
    new_path(&format!("{world}-{updates}"), kind, scene.noun())
}

/// Returns a file that does not exist: a paused run may be exported several times.
fn new_path(name: &str, kind: ExportKind, noun: &str) -> PathBuf {
    let end = format!("-{}.{}", kind.stem(noun), kind.file_type());
    files::unused_path(&files::named(Path::new(EXPORT_FOLDER), name, &end))
}

fn write_contents(path: &Path, contents: Result<Vec<u8>, ExportError>) -> Result<String, String> {
    let written = contents.and_then(|bytes| Ok(write_atomically(path, &bytes)?));
    match written {
        Ok(()) => Ok(format!("wrote {}", path.display())),
        Err(error) => Err(format!("{} cannot be written: {error}", path.display())),
    }
}

/// Returns the file's contents.
///
/// # Errors
/// What cannot be drawn or encoded.
pub fn contents(
    kind: ExportKind,
    screen: &mut Screen,
    scene: &Scene,
) -> Result<Vec<u8>, ExportError> {
    match kind {
        ExportKind::CurvesSvg => figure(Format::Svg, screen, scene),
        ExportKind::CurvesPng => figure(Format::Png, screen, scene),
        ExportKind::CurvesPdf => figure(Format::Pdf, screen, scene),
        ExportKind::CurvesCsv => curves::csv(screen),
        ExportKind::Still | ExportKind::Film => {
            filmed(kind, &screen.snapshot, &Progress::default())
        }
        ExportKind::MapPng | ExportKind::MapSvg | ExportKind::ScreenPng | ExportKind::ScreenSvg => {
            let (drawn, map_pane) = draw(screen, scene)?;
            let area = match kind {
                ExportKind::MapPng | ExportKind::MapSvg => map_pane.intersection(drawn.area),
                _ => drawn.area,
            };
            picture(kind, &drawn, area, &screen.theme.in_full_colour())
        }
    }
}

/// Returns the film, or a picture of its end.
fn filmed(kind: ExportKind, run: &Snapshot, progress: &Progress) -> Result<Vec<u8>, ExportError> {
    Ok(match kind {
        ExportKind::Still => still(run, Some(STILL_WIDTH))?,
        _ => animate(run, None, progress)?,
    })
}

/// Draws the curves.
fn figure(format: Format, screen: &Screen, scene: &Scene) -> Result<Vec<u8>, ExportError> {
    let run = screen.run();
    let title = format!("{}, {}, seed {}", scene.title(&screen.snapshot), run.method, run.seed);
    format.encode(&curves::figure(screen, &title)).map_err(ExportError::Figure)
}

/// Returns a picture of part of a drawn screen, in a theme's colours.
///
/// # Errors
/// The part is empty, or cannot be encoded.
pub fn picture(
    kind: ExportKind,
    drawn: &Buffer,
    area: Rect,
    theme: &Theme,
) -> Result<Vec<u8>, ExportError> {
    if area.is_empty() {
        return Err(ExportError::Empty);
    }
    let page = PageColours::for_theme(theme);
    match kind.file_type() {
        "png" => Ok(png_of(drawn, area, page)?),
        _ => Ok(vector::svg_of(drawn, area, page).into_bytes()),
    }
}

/// Draws the screen without dialogs, in full colour even on a terminal that has fewer colours;
/// returns it with the area of the map pane.
fn draw(screen: &mut Screen, scene: &Scene) -> std::io::Result<(Buffer, Rect)> {
    let own = screen.theme;
    screen.theme = own.in_full_colour();
    let drawn = draw_as_it_is(screen, scene);
    screen.theme = own;
    drawn
}

fn draw_as_it_is(screen: &Screen, scene: &Scene) -> std::io::Result<(Buffer, Rect)> {
    let Rect { width, height, .. } = screen.layout.screen;
    let mut terminal = Terminal::new(TestBackend::new(width.max(1), height.max(1)))
        .map_err(std::io::Error::other)?;
    let mut map_pane = Rect::default();
    let panes = |frame: &mut Frame| {
        map_pane = render::draw_panes(frame, screen, scene, &mut Cache::default()).map_pane;
    };
    terminal.draw(panes).map_err(std::io::Error::other)?;
    Ok((terminal.backend().buffer().clone(), map_pane))
}

/// The colours that replace a terminal's default text and background.
#[derive(Clone, Copy, Debug)]
pub struct PageColours {
    /// Text.
    pub ink: Rgb,
    /// Background.
    pub ground: Rgb,
}

impl PageColours {
    /// Returns the colours that go with a theme.
    pub fn for_theme(theme: &Theme) -> Self {
        theme.page.map_or(Self::default(), |(ink, ground)| Self { ink, ground })
    }
}

impl Default for PageColours {
    fn default() -> Self {
        Self { ink: (222, 222, 226), ground: (16, 16, 20) }
    }
}
