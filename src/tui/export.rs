//! Exports to files: a picture of the map, and curves as a drawing or a table.

mod curves;
mod picture;

use std::path::{Path, PathBuf};

use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::{Frame, Terminal};

use super::output::ExportKind;
use super::render;
use super::scene::{Cache, Scene};
use super::screen::Screen;
use super::theme::Theme;
use crate::figure::Format;
use gdg::files::{self, write_atomically};
use picture::{PageColours, picture_of};

/// Folder for exports.
pub const EXPORT_FOLDER: &str = "exports";

/// Why an export fails.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    #[error("nothing to export: the window is too small")]
    Empty,
    /// The file system, or drawing in memory, reports an error.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Png(#[from] png::EncodingError),
    /// A drawing cannot be encoded.
    #[error("{0}")]
    Figure(miette::Report),
    #[error(transparent)]
    Csv(#[from] csv::Error),
}

/// Encodes what has been drawn, which may take a second or two.
type Encode = Box<dyn FnOnce() -> Result<Vec<u8>, ExportError> + Send>;

/// Draws an export; returns what writes it to a new file and returns the notice for the user.
pub fn begin(
    kind: ExportKind,
    screen: &mut Screen,
    scene: &Scene,
) -> Result<impl FnOnce() -> Result<String, String> + Send + use<>, ExportError> {
    let (name, noun) = (name(kind, screen, scene), scene.noun());
    let encode = drawn(kind, screen, scene)?;
    Ok(move || write_as(&name, kind, noun, encode()))
}

/// Returns what a file's name begins with: the world, and the update that is shown.
pub fn name(kind: ExportKind, screen: &Screen, scene: &Scene) -> String {
    // Curves are of the present, whatever the map shows.
    let past = screen.past.as_ref().filter(|_| ExportKind::PICTURES.contains(&kind));
    let updates = match past {
        Some(frame) => screen.snapshot.learned(frame.updates),
        None => screen.snapshot.updates(),
    };
    format!("{}-{updates}", scene.title(&screen.snapshot))
}

/// Writes contents to a new file that begins with `name`, as a paused run may be exported several
/// times; returns the notice for the user.
pub fn write_as(
    name: &str,
    kind: ExportKind,
    noun: &str,
    contents: Result<Vec<u8>, ExportError>,
) -> Result<String, String> {
    let end = format!("-{}.{}", kind.stem(noun), kind.file_type());
    let path: PathBuf = files::unused_path(&files::named(Path::new(EXPORT_FOLDER), name, &end));
    match contents.and_then(|bytes| Ok(write_atomically(&path, &bytes)?)) {
        Ok(()) => Ok(format!("wrote {}", path.display())),
        Err(error) => Err(format!("{} cannot be written: {error}", path.display())),
    }
}

/// Captures the present screen as this kind of export; what takes long is left to the encoder.
fn drawn(kind: ExportKind, screen: &mut Screen, scene: &Scene) -> Result<Encode, ExportError> {
    Ok(match kind {
        ExportKind::MapPng | ExportKind::MapSvg => {
            // For readers, who have no keys.
            screen.on_paper = true;
            let drawn = in_full_colour(
                screen,
                |screen| [&mut screen.theme],
                |screen| {
                    on_paper(screen.layout.screen, |frame| {
                        render::draw_panes(frame, screen, scene, &mut Cache::default()).map_pane
                    })
                },
            );
            screen.on_paper = false;
            let (drawn, map_pane) = drawn?;
            let (area, theme) = (map_pane.intersection(drawn.area), screen.theme.in_full_colour());
            Box::new(move || picture(kind, &drawn, area, &theme))
        }
        ExportKind::CurvesSvg | ExportKind::CurvesPdf => {
            let format = if kind == ExportKind::CurvesSvg { Format::Svg } else { Format::Pdf };
            let (world, run) = (scene.title(&screen.snapshot), screen.run());
            let title = format!("{world}, {}, seed {}", run.method, run.seed);
            let figure = curves::figure(screen, &title);
            Box::new(move || format.encode(&figure).map_err(ExportError::Figure))
        }
        ExportKind::CurvesCsv => {
            let table = curves::csv(screen)?;
            Box::new(|| Ok(table))
        }
    })
}

/// Returns an export's contents.
#[cfg(test)]
pub fn contents(
    kind: ExportKind,
    screen: &mut Screen,
    scene: &Scene,
) -> Result<Vec<u8>, ExportError> {
    drawn(kind, screen, scene)?()
}

/// Returns a picture of part of a drawn screen, in a theme's colours.
pub fn picture(
    kind: ExportKind,
    drawn: &Buffer,
    area: Rect,
    theme: &Theme,
) -> Result<Vec<u8>, ExportError> {
    let page =
        theme.page.map_or(PageColours::default(), |(ink, ground)| PageColours { ink, ground });
    match kind {
        _ if area.is_empty() => Err(ExportError::Empty),
        ExportKind::MapSvg => {
            Format::Svg.encode(&picture::sheet_of(drawn, area, page)).map_err(ExportError::Figure)
        }
        _ => Ok(picture_of(drawn, area, page).to_png("gdg-tui")?),
    }
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
