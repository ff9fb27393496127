//! Exports to files: pictures of map and screen, curves as a drawing and as a table.

mod curves;
mod picture;
mod vector;

use std::path::{Path, PathBuf};

use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::{Frame, Terminal};

use super::background::Background;
use super::output::ExportKind;
use super::render;
use super::scene::{Cache, Scene};
use super::screen::Screen;
use super::theme::{Rgb, Theme};
use crate::figure::Format;
use gdg::files::{self, write_atomically};
use gdg::pulse::Progress;
use gdg::viewer::{FilmError, animate, still};
pub use picture::picture_of;

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

/// Encodes what has been drawn, which may take a second or two, and says how far it is.
type Encode = Box<dyn FnOnce(&Progress) -> Result<Vec<u8>, ExportError> + Send>;

/// Draws an export and begins to write it to a new file; returns the notice for the user.
///
/// # Errors
/// It cannot be drawn, or the thread cannot be started.
pub fn begin(
    kind: ExportKind,
    screen: &mut Screen,
    scene: &Scene,
) -> Result<Background<Result<String, String>>, ExportError> {
    let path = new_path(&name(kind, screen, scene), kind, scene.noun());
    let encode = drawn(kind, screen, scene)?;
    let write = move |progress: &Progress| write_contents(&path, encode(progress));
    Ok(Background::start(format!("writing {}", kind.name(scene.noun())), write)?)
}

/// Returns what a file's name begins with: the world, and the update that is shown.
pub fn name(kind: ExportKind, screen: &Screen, scene: &Scene) -> String {
    // Curves and film are of the present, whatever the map shows.
    let past = screen.past.as_ref().filter(|_| ExportKind::PICTURES.contains(&kind));
    let updates = match past {
        Some(frame) => screen.snapshot.learned(frame.updates),
        None => screen.snapshot.updates(),
    };
    format!("{}-{updates}", scene.title(&screen.snapshot))
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

/// Captures the present screen as this kind of export; what takes long is left to the encoder.
fn drawn(kind: ExportKind, screen: &mut Screen, scene: &Scene) -> Result<Encode, ExportError> {
    let curves = |format: Format, screen: &Screen| -> Encode {
        let run = screen.run();
        let title = format!("{}, {}, seed {}", scene.title(&screen.snapshot), run.method, run.seed);
        let figure = curves::figure(screen, &title);
        Box::new(move |_| format.encode(&figure).map_err(ExportError::Figure))
    };
    Ok(match kind {
        ExportKind::CurvesSvg => curves(Format::Svg, screen),
        ExportKind::CurvesPng => curves(Format::Png, screen),
        ExportKind::CurvesPdf => curves(Format::Pdf, screen),
        ExportKind::CurvesCsv => {
            let table = curves::csv(screen)?;
            Box::new(|_| Ok(table))
        }
        ExportKind::Still | ExportKind::Film => {
            let run = screen.snapshot.clone();
            Box::new(move |progress| {
                Ok(match kind {
                    ExportKind::Still => still(&run, Some(STILL_WIDTH))?,
                    _ => animate(&run, None, progress)?,
                })
            })
        }
        ExportKind::MapPng | ExportKind::MapSvg | ExportKind::ScreenPng | ExportKind::ScreenSvg => {
            // The whole screen has its keys; the map alone is for readers, who have none.
            screen.on_paper = matches!(kind, ExportKind::MapPng | ExportKind::MapSvg);
            let drawn = draw(screen, scene);
            let only_map = std::mem::take(&mut screen.on_paper);
            let (drawn, map_pane) = drawn?;
            let area = if only_map { map_pane.intersection(drawn.area) } else { drawn.area };
            let theme = screen.theme.in_full_colour();
            Box::new(move |_| picture(kind, &drawn, area, &theme))
        }
    })
}

/// Returns an export's contents.
///
/// # Errors
/// What cannot be drawn or encoded.
#[cfg(test)]
pub fn contents(
    kind: ExportKind,
    screen: &mut Screen,
    scene: &Scene,
) -> Result<Vec<u8>, ExportError> {
    drawn(kind, screen, scene)?(&Progress::default())
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
        "png" => Ok(picture_of(drawn, area, page).to_png("gdg-tui")?),
        _ => Ok(vector::svg_of(drawn, area, page).into_bytes()),
    }
}

/// Draws the screen without dialogs; returns it with the area of the map pane.
fn draw(screen: &mut Screen, scene: &Scene) -> std::io::Result<(Buffer, Rect)> {
    in_full_colour(
        screen,
        |screen| [&mut screen.theme],
        |screen| {
            on_paper(screen.layout.screen, |frame| {
                render::draw_panes(frame, screen, scene, &mut Cache::default()).map_pane
            })
        },
    )
}

/// Draws `of` with its `themes` in full colour, even on a terminal that has fewer colours.
pub fn in_full_colour<D, T, const N: usize>(
    of: &mut D,
    themes: impl Fn(&mut D) -> [&mut Theme; N],
    draw: impl FnOnce(&D) -> T,
) -> T {
    let own = themes(of).map(|theme| {
        let full = theme.in_full_colour();
        std::mem::replace(theme, full)
    });
    let drawn = draw(of);
    for (theme, own) in themes(of).into_iter().zip(own) {
        *theme = own;
    }
    drawn
}

/// Draws a screen in memory; returns it with the area that `draw` returns.
///
/// # Errors
/// It cannot be drawn.
pub fn on_paper(
    screen: Rect,
    draw: impl FnOnce(&mut Frame) -> Rect,
) -> std::io::Result<(Buffer, Rect)> {
    let backend = TestBackend::new(screen.width.max(1), screen.height.max(1));
    let mut terminal = Terminal::new(backend).map_err(std::io::Error::other)?;
    let mut area = Rect::default();
    terminal.draw(|frame| area = draw(frame)).map_err(std::io::Error::other)?;
    Ok((terminal.backend().buffer().clone(), area))
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
