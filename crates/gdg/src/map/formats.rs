//! Formats of maps, and what they share.
//!
//! A file's format is recognised by its content, and where that says nothing by the ending of its
//! name; everything else is read as plain text.

mod images;
mod plain_text;
mod text_rows;
mod tiled;
mod yaml;

use std::path::{Path, PathBuf};

use super::grid::{Cell, Grid, MAX_CELLS, MAX_SIDE, is_size, size_limits};
use super::text_file::{MapError, MapResult, TextFile, TextPosition};
use crate::text::counted;
use images::Image;
pub use plain_text::print_ascii;
pub use yaml::{AgentTask, agents, has_agents, image_named_in, is_mapf};

/// A file that is read as a map.
pub struct Source<'a> {
    /// Its name, for errors.
    pub file: &'a str,
    pub bytes: &'a [u8],
    pub text: MapResult<TextFile<'a>>,
    /// Where the files that it names are.
    pub folder: Option<&'a Path>,
    /// The brightness, from 0 to 1, below which pixels of images are walls.
    pub threshold: f32,
}

impl<'a> Source<'a> {
    /// Prepares a file for reading, without those that it names.
    pub fn new(file: &'a str, bytes: &'a [u8]) -> Self {
        Self { file, bytes, text: TextFile::new(file, bytes), folder: None, threshold: THRESHOLD }
    }

    /// The map's name: the file's without its ending.
    fn name(&self) -> String {
        name_of(Path::new(self.file))
    }

    /// Whether it is text that begins as `is` says.
    fn is_text(&self, is: fn(&TextFile) -> bool) -> bool {
        self.text.as_ref().is_ok_and(is)
    }

    fn text(&self) -> MapResult<&TextFile<'a>> {
        self.text.as_ref().map_err(Clone::clone)
    }
}

/// The brightness, from 0 to 1, below which pixels of images are walls unless another is given.
pub const THRESHOLD: f32 = 0.5;

/// The name of a file without its ending.
fn name_of(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

#[derive(Debug)]
pub struct MapFormat {
    /// Its name on the command line.
    pub name: &'static str,
    pub about: &'static str,
    /// The endings of its files' names, without the dot.
    pub endings: &'static [&'static str],
    /// Which marks are lost when a map is written in it; empty if none are.
    pub loses: &'static str,
    /// What else its files may have, which is lost when one is written over.
    pub besides: &'static str,
    /// Whether a file's content is of this format.
    is: fn(&Source) -> bool,
    read: fn(&Source) -> MapResult<Grid>,
    /// Returns the file of a map, whose name is given.
    write: fn(&Grid, &str) -> Vec<u8>,
}

/// All formats. A file is of the first one that recognises its content; plain text is what no other
/// one recognises.
pub const FORMATS: [MapFormat; 10] = [
    images::PNG,
    images::PGM,
    plain_text::MOVINGAI,
    tiled::FORMAT,
    yaml::ROS,
    yaml::MAPF,
    text_rows::LIST,
    text_rows::D4RL,
    text_rows::NUMBERS,
    plain_text::PLAIN,
];

impl MapFormat {
    /// Returns the format that recognises a file's content.
    pub(super) fn by_content(source: &Source) -> Option<&'static Self> {
        FORMATS.iter().find(|format| (format.is)(source))
    }

    /// Returns the format of a file.
    pub(super) fn of(source: &Source) -> &'static Self {
        let [.., plain] = &FORMATS;
        // Plain maps are often called .map too, and no other format recognises them.
        let is_certain = |format: &&Self| format.name != plain_text::MOVINGAI.name;
        let by_name = || Self::by_name(Path::new(source.file)).filter(is_certain);
        Self::by_content(source).or_else(by_name).unwrap_or(plain)
    }

    /// Returns the format of files with a name like this one.
    pub fn by_name(path: &Path) -> Option<&'static Self> {
        let ending = path.extension()?;
        let is_own =
            |format: &&Self| format.endings.iter().any(|own| ending.eq_ignore_ascii_case(own));
        FORMATS.iter().find(is_own)
    }

    pub(super) fn read(&self, source: &Source) -> MapResult<Grid> {
        (self.read)(source)
    }

    /// Returns which marks of a map a file in this format would lack.
    pub fn lost(&self, grid: &Grid) -> Vec<&'static str> {
        let marks = [("starts", grid.starts()), ("goals", grid.goals())];
        let lost = |(which, cells): &(&'static str, &[Cell])| {
            !cells.is_empty() && self.loses.contains(which)
        };
        marks.into_iter().filter(lost).map(|(which, _)| which).collect()
    }

    /// Returns the files of a map in this format, with their names: `file`, and for some formats an
    /// image beside it.
    pub fn write(&self, grid: &Grid, file: &Path) -> Vec<(PathBuf, Vec<u8>)> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let image = self.image_of(file).map(|image| (image, images::encode_pgm(grid)));
        image.into_iter().chain([(file.to_owned(), (self.write)(grid, &name))]).collect()
    }

    /// Returns the name of the image that a map of ROS called `file` has beside it.
    pub fn image_of(&self, file: &Path) -> Option<PathBuf> {
        (self.name == yaml::ROS.name).then(|| file.with_extension("pgm"))
    }
}

/// Returns a fingerprint that differs between maps of one name: size, goal radius, and a checksum of
/// cells, goals and scale. Starts do not count: they may have been drawn at random.
pub fn fingerprint(grid: &Grid) -> String {
    let text = print_ascii(&grid.with_marks(Vec::new(), grid.goals().to_vec()));
    let scale = grid.scale();
    let checksum = crc32fast::hash(format!("{text}{scale:?}").as_bytes());
    let [width, height] = [grid.width(), grid.height()];
    format!("{width} x {height}, goal radius {}, {checksum:08x}", scale.goal_radius)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CellMark {
    Wall,
    Free,
    Start,
    Goal,
    /// Start and goal.
    Both,
}

/// Returns the rows of a map, each the marks of its cells.
fn marks(grid: &Grid) -> impl Iterator<Item = impl Iterator<Item = CellMark> + '_> + '_ {
    let is_in = |cells: &[Cell], cell: Cell| {
        cells.binary_search_by_key(&(cell.y, cell.x), |c| (c.y, c.x)).is_ok()
    };
    (0..grid.height()).map(move |y| {
        (0..grid.width()).map(move |x| {
            let cell = Cell::new(x, y);
            match (grid.is_free(cell), is_in(grid.starts(), cell), is_in(grid.goals(), cell)) {
                (false, ..) => CellMark::Wall,
                (true, false, false) => CellMark::Free,
                (true, true, false) => CellMark::Start,
                (true, false, true) => CellMark::Goal,
                (true, true, true) => CellMark::Both,
            }
        })
    })
}

/// Returns the rows of a map as text: what stands for each cell, and what between two.
fn rows_of(grid: &Grid, cell: fn(CellMark) -> &'static str, between: &str) -> Vec<String> {
    marks(grid).map(|row| row.map(cell).collect::<Vec<_>>().join(between)).collect()
}

/// Returns the map of these cells, row by row; `cells` says how they are written.
fn grid(source: &Source, width: usize, marks: &[CellMark], cells: &str) -> MapResult<Grid> {
    let free: Vec<bool> = marks.iter().map(|mark| *mark != CellMark::Wall).collect();
    if !free.contains(&true) {
        return Err(MapError::whole_file(source.file, "the map has no free cell", cells));
    }
    let of = |which: CellMark| {
        let is = |mark: &CellMark| *mark == which || *mark == CellMark::Both;
        let at = marks.iter().enumerate().filter(|(_, mark)| is(mark));
        at.map(|(i, _)| Cell::new(i % width, i / width)).collect()
    };
    Ok(Grid::new(&source.name(), width, free, of(CellMark::Start), of(CellMark::Goal)))
}

fn too_large(text: &TextFile, width: usize, height: usize) -> Box<MapError> {
    text.line_error(0, format!("a map of {width} x {height} cells is too large"), size_limits())
}

/// The rows read so far, all of the first one's length.
struct MarkRows<'a> {
    text: &'a TextFile<'a>,
    /// Cells of the first row, once it has ended.
    width: Option<usize>,
    /// Index of the first cell of the row that is being read.
    row: usize,
    marks: Vec<CellMark>,
}

impl<'a> MarkRows<'a> {
    fn new(text: &'a TextFile<'a>) -> Self {
        Self { text, width: None, row: 0, marks: Vec::new() }
    }

    /// Adds a cell to the row, unless the map is too large.
    fn push(&mut self, mark: CellMark) -> MapResult<()> {
        self.marks.push(mark);
        let width = self.marks.len() - self.row;
        if width > MAX_SIDE || self.marks.len() > MAX_CELLS {
            let height = self.width.map_or(1, |width| self.marks.len().div_ceil(width));
            return Err(too_large(self.text, self.width.unwrap_or(width), height));
        }
        Ok(())
    }

    fn is_row_empty(&self) -> bool {
        self.row == self.marks.len()
    }

    /// Ends the row, which began at `from`; it must be as long as the first one.
    fn end_row(&mut self, from: TextPosition) -> MapResult<()> {
        let length = self.marks.len() - self.row;
        let width = *self.width.get_or_insert(length);
        let help = "all rows must have the same number of cells";
        if length == 0 {
            return Err(self.text.error_at(from, "this row has no cells", help));
        }
        if length != width {
            let cells = counted(length as u64, "cell");
            let problem = format!("this row has {cells}, the first row has {width}");
            return Err(self.text.error_at(from, problem, help));
        }
        self.row = self.marks.len();
        Ok(())
    }

    /// Returns the map; `cells` says how its cells are written.
    fn finish(self, source: &Source, cells: &str) -> MapResult<Grid> {
        let width = self.width.unwrap_or(1);
        let height = self.marks.len() / width;
        if height == 0 {
            return Err(MapError::whole_file(source.file, "the map has no rows", cells));
        }
        if !is_size(width, height) {
            return Err(too_large(self.text, width, height));
        }
        grid(source, width, &self.marks, cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{MapScale, parse_map};

    #[test]
    fn a_fingerprint_depends_on_cells_goals_and_scale_but_not_on_starts() {
        let map = |text: &str| parse_map("map", text.as_bytes()).expect("a map");
        let own = fingerprint(&map("...#\n....\n"));
        assert!(own.starts_with("4 x 2, goal radius 1, "), "{own}");
        let wider = MapScale { goal_radius: 2.0, ..MapScale::default() };
        for other in
            [map("..##\n....\n"), map("...#\n...G\n"), map("...#\n....\n").with_scale(wider)]
        {
            assert_ne!(fingerprint(&other), own);
        }
        assert_eq!(fingerprint(&map("S..#\n....\n")), own);
    }
}
