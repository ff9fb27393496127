//! Formats of maps, one file each, and what they share.
//!
//! A file's format is recognised by its content, and where that says nothing by the ending of its
//! name; everything else is read as plain text.

mod d4rl;
mod list;
mod movingai;
mod numbers;
mod plain;
mod rows;
mod yaml;

use std::path::Path;

use super::error::MapResult;
use super::grid::{Cell, Grid};
use super::text::Text;
pub use movingai::print_movingai;
pub use plain::print_ascii;
use rows::{Mark, Rows};

/// A file that is read as a map.
pub struct Source<'a> {
    /// Its name, for errors.
    pub file: &'a str,
    /// Its text, if it is text.
    pub text: MapResult<Text<'a>>,
}

impl<'a> Source<'a> {
    /// Prepares a file for reading.
    pub fn new(file: &'a str, bytes: &'a [u8]) -> Self {
        Self { file, text: Text::new(file, bytes) }
    }

    /// Returns the map's name: the file's without its ending.
    fn name(&self) -> String {
        let stem = Path::new(self.file).file_stem();
        stem.map_or_else(|| self.file.to_owned(), |stem| stem.to_string_lossy().into_owned())
    }

    /// Returns whether it is text that begins as `is` says.
    fn is_text(&self, is: fn(&Text) -> bool) -> bool {
        self.text.as_ref().is_ok_and(is)
    }

    /// Returns its text.
    fn text(&self) -> MapResult<&Text<'a>> {
        self.text.as_ref().map_err(Clone::clone)
    }
}

/// A format of maps.
pub struct MapFormat {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// The endings of its files' names, without the dot.
    pub endings: &'static [&'static str],
    /// What is lost when a map is written in it; empty if nothing is.
    pub loses: &'static str,
    /// Whether a file's content is of this format.
    is: fn(&Source) -> bool,
    read: fn(&Source) -> MapResult<Grid>,
    write: fn(&Grid) -> Vec<u8>,
}

/// All formats. A file is of the first one that recognises its content; plain text is what no other
/// one recognises.
pub const FORMATS: [MapFormat; 5] =
    [movingai::FORMAT, list::FORMAT, d4rl::FORMAT, numbers::FORMAT, plain::FORMAT];

impl MapFormat {
    /// Returns the format that recognises a file's content.
    pub fn by_content(source: &Source) -> Option<&'static Self> {
        FORMATS.iter().find(|format| (format.is)(source))
    }

    /// Returns the format of a file.
    pub fn of(source: &Source) -> &'static Self {
        let is_named = |format: &&Self| {
            let ending = Path::new(source.file).extension().unwrap_or_default();
            format.endings.iter().any(|own| ending.eq_ignore_ascii_case(own))
        };
        let [.., plain] = &FORMATS;
        Self::by_content(source).or_else(|| FORMATS.iter().find(is_named)).unwrap_or(plain)
    }

    /// Reads a map.
    ///
    /// # Errors
    /// The file is malformed; the error names the place.
    pub fn read(&self, source: &Source) -> MapResult<Grid> {
        (self.read)(source)
    }

    /// Returns the file of a map in this format.
    pub fn write(&self, grid: &Grid) -> Vec<u8> {
        (self.write)(grid)
    }
}

/// Returns the rows of a map, each the marks of its cells.
fn marks(grid: &Grid) -> impl Iterator<Item = impl Iterator<Item = Mark> + '_> + '_ {
    let is_in = |cells: &[Cell], cell: Cell| {
        cells.binary_search_by_key(&(cell.y, cell.x), |c| (c.y, c.x)).is_ok()
    };
    (0..grid.height()).map(move |y| {
        (0..grid.width()).map(move |x| {
            let cell = Cell::new(x, y);
            match (grid.is_free(cell), is_in(grid.starts(), cell), is_in(grid.goals(), cell)) {
                (false, ..) => Mark::Wall,
                (true, false, false) => Mark::Free,
                (true, true, false) => Mark::Start,
                (true, false, true) => Mark::Goal,
                (true, true, true) => Mark::Both,
            }
        })
    })
}
