//! Formats of maps, one file each, and what they share.
//!
//! A file's format is recognised by its content, and where that says nothing by the ending of its
//! name; everything else is read as plain text.

mod d4rl;
mod image;
mod list;
mod mapf;
mod movingai;
mod notes;
mod numbers;
mod pgm;
mod plain;
mod png;
mod ros;
mod rows;
mod tiled;
mod yaml;

use std::path::{Path, PathBuf};

use super::grid::{Cell, Grid};
use super::text::MapResult;
use super::text::Text;
use image::Image;
pub use mapf::{Agent, agents, has_agents, is_mapf};
pub use movingai::print_movingai;
pub use plain::print_ascii;
use rows::{Mark, Rows};

/// A file that is read as a map.
pub struct Source<'a> {
    /// Its name, for errors.
    pub file: &'a str,
    pub bytes: &'a [u8],
    /// Its text, if it is text.
    pub text: MapResult<Text<'a>>,
    /// Where the files that it names are.
    pub folder: Option<&'a Path>,
    /// The brightness, from 0 to 1, below which pixels of images are walls.
    pub threshold: f32,
}

impl<'a> Source<'a> {
    /// Prepares a file for reading, without those that it names.
    pub fn new(file: &'a str, bytes: &'a [u8]) -> Self {
        Self { file, bytes, text: Text::new(file, bytes), folder: None, threshold: THRESHOLD }
    }

    /// Returns the map's name: the file's without its ending.
    fn name(&self) -> String {
        name_of(Path::new(self.file))
    }

    /// Reads it as an image.
    fn read_image(&self, decode: fn(&str, &[u8]) -> MapResult<Image>) -> MapResult<Grid> {
        let help = "dark pixels are walls: --threshold says how dark, from 0 to 1";
        decode(self.file, self.bytes)?.map(self.file, |shade| shade < self.threshold, help)
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

/// The brightness, from 0 to 1, below which pixels of images are walls unless another is given.
pub const THRESHOLD: f32 = 0.5;

/// Returns the name of a file without its ending.
fn name_of(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Returns the file of a map's image.
type WriteImage = fn(&Grid) -> Vec<u8>;

/// A format of maps.
#[derive(Debug)]
pub struct MapFormat {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is.
    pub about: &'static str,
    /// The endings of its files' names, without the dot.
    pub endings: &'static [&'static str],
    /// Which marks are lost when a map is written in it; empty if none are.
    pub loses: &'static str,
    /// Whether a file of this name keeps a map's scale.
    keeps_scale: fn(&str) -> bool,
    /// Whether a file's content is of this format.
    is: fn(&Source) -> bool,
    read: fn(&Source) -> MapResult<Grid>,
    /// Returns the file of a map, whose name is given.
    write: fn(&Grid, &str) -> Vec<u8>,
    /// The image that goes with it: the ending of its name, and how it is written.
    image: Option<(&'static str, WriteImage)>,
}

/// All formats. A file is of the first one that recognises its content; plain text is what no other
/// one recognises.
pub const FORMATS: [MapFormat; 10] = [
    png::FORMAT,
    pgm::FORMAT,
    movingai::FORMAT,
    tiled::FORMAT,
    ros::FORMAT,
    mapf::FORMAT,
    list::FORMAT,
    d4rl::FORMAT,
    numbers::FORMAT,
    plain::FORMAT,
];

impl MapFormat {
    /// Returns the format that recognises a file's content.
    pub fn by_content(source: &Source) -> Option<&'static Self> {
        FORMATS.iter().find(|format| (format.is)(source))
    }

    /// Returns the format of a file.
    pub fn of(source: &Source) -> &'static Self {
        let [.., plain] = &FORMATS;
        // Plain maps are often called .map too, and no other format recognises them.
        let is_certain = |format: &&Self| format.name != movingai::FORMAT.name;
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

    /// Reads a map.
    ///
    /// # Errors
    /// The file is malformed; the error names the place.
    pub fn read(&self, source: &Source) -> MapResult<Grid> {
        (self.read)(source)
    }

    /// Returns what of a map a file of this name in this format would lack.
    pub fn lost(&self, grid: &Grid, file: &Path) -> Vec<String> {
        let marks = [("starts", grid.starts()), ("goals", grid.goals())];
        let marks = marks.into_iter().filter(|(_, cells)| !cells.is_empty());
        let marks = marks.map(|(which, _)| which).filter(|which| self.loses.contains(which));
        let is_kept = (self.keeps_scale)(&file.to_string_lossy());
        let values = notes::scale_values(grid).filter(|_| !is_kept);
        let values = values.map(|(key, value)| format!("{} {value}", key.replace('_', " ")));
        marks.map(str::to_owned).chain(values).collect()
    }

    /// Returns the names of the formats that keep a whole map.
    pub fn lossless() -> Vec<&'static str> {
        let keeps = |format: &&Self| format.loses.is_empty() && (format.keeps_scale)("");
        FORMATS.iter().filter(keeps).map(|format| format.name).collect()
    }

    /// Returns whether starts and goals are in a scenario beside the map.
    pub fn has_scenarios(&self) -> bool {
        self.name == movingai::FORMAT.name
    }

    /// Returns the files of a map in this format, with their names: `file`, and for some formats an
    /// image beside it.
    pub fn write(&self, grid: &Grid, file: &Path) -> Vec<(PathBuf, Vec<u8>)> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let image = self.image.map(|(_, write)| write(grid));
        let contents = image.into_iter().chain([(self.write)(grid, &name)]);
        self.image_of(file).into_iter().chain([file.to_owned()]).zip(contents).collect()
    }

    /// Returns the name of the image that a map called `file` has beside it in this format, if any.
    pub fn image_of(&self, file: &Path) -> Option<PathBuf> {
        self.image.map(|(ending, _)| file.with_extension(ending))
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

/// Returns a fingerprint that differs between maps of one name: size, goal radius, and a checksum of
/// cells, goals and scale. Starts do not count: they may have been drawn at random.
pub fn fingerprint(grid: &Grid) -> String {
    let text = print_ascii(&grid.with_marks(Vec::new(), grid.goals().to_vec()));
    let scale = grid.scale();
    let checksum = crc32fast::hash(format!("{text}{scale:?}").as_bytes());
    let [width, height] = [grid.width(), grid.height()];
    format!("{width} x {height}, goal radius {}, {checksum:08x}", scale.goal_radius)
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
