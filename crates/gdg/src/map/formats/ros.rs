//! Maps of ROS: a description in YAML, and its image beside it.

use std::path::Path;

use super::super::file::read as read_file;
use super::super::grid::{Cell, Grid};
use super::super::text::Text;
use super::super::text::{MapError, MapResult};
use super::image::Image;
use super::notes::{with_notes, yaml_lines};
use super::yaml::{Node, tree};
use super::{MapFormat, Source, name_of, pgm, png};

pub const FORMAT: MapFormat = MapFormat {
    name: "ros",
    about: "ROS's map.yaml with its image; unknown cells are walls",
    endings: &["yaml", "yml"],
    loses: "",
    keeps_scale: |_| true,
    is: |source| source.is_text(|text| has_key(text, "image") && has_key(text, "resolution")),
    read,
    write: |grid, name| {
        let place = |cell: &Cell| Frame::WRITTEN.place(*cell, grid.height());
        (write(name) + &yaml_lines(grid, place)).into_bytes()
    },
    image: Some(("pgm", |grid| pgm::write(grid, None))),
};

const HELP: &str = "a map of ROS has the keys image, resolution, origin, negate, occupied_thresh and free_thresh, and \
                    may have mode (trinary, scale or raw)";

const IMAGE: &str = "image is the path of a PNG or PGM image from this file's folder";

/// Where a map is in the world.
struct Frame {
    /// Metres per cell.
    resolution: f64,
    /// The lower left corner of the image, in metres. The third number of a file's origin, an angle,
    /// is ignored, as ROS itself does mostly, in a file without starts and goals.
    origin: [f64; 2],
}

impl Frame {
    /// That of written maps.
    const WRITTEN: Self = Self { resolution: 0.05, origin: [0.0; 2] };

    /// Returns the middle of a cell, in metres, of a map that is `height` cells high.
    fn place(&self, cell: Cell, height: usize) -> [String; 2] {
        let [x, y] = self.origin;
        let along = |origin: f64, cells: f64| format!("{:.3}", origin + cells * self.resolution);
        [along(x, cell.x as f64 + 0.5), along(y, (height - cell.y) as f64 - 0.5)]
    }

    /// Returns column and row of a place in metres, from the upper left.
    fn column_and_row(&self, [x, y]: [f64; 2], height: usize) -> [f64; 2] {
        let cells = |at: f64, origin: f64| (at - origin) / self.resolution;
        [cells(x, self.origin[0]), height as f64 - cells(y, self.origin[1])]
    }
}

/// What is free or occupied unless a map says so: as in ROS 1.
const OCCUPIED: f32 = 0.65;
const FREE: f32 = 0.196;

/// Returns whether a line begins with `key:`.
pub fn has_key(text: &Text, key: &str) -> bool {
    let is_key = |line: &str| {
        line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with(':'))
    };
    text.lines.iter().any(|line| is_key(line))
}

/// How brightness becomes occupancy.
struct Rule {
    negate: bool,
    occupied: f32,
    free: f32,
    mode: Mode,
}

#[derive(Clone, Copy, PartialEq)]
enum Mode {
    Trinary,
    Scale,
    Raw,
}

impl Rule {
    fn is_wall(&self, brightness: f32) -> bool {
        let occupied = if self.negate { brightness } else { 1.0 - brightness };
        match self.mode {
            // What is neither is unknown.
            Mode::Trinary => occupied >= self.free,
            Mode::Scale => occupied > self.occupied,
            Mode::Raw => (brightness * 255.0).round() >= 100.0 * self.free,
        }
    }
}

fn read(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let root = tree(text)?;
    let image = root.wanted(text, "image", HELP)?;
    let (frame, rule) = (frame(text, &root)?, rule(text, &root)?);
    let name = image.scalar(text, "the name of an image", HELP)?;
    let Some(folder) = source.folder else {
        return Err(text.error_at(image.place, "the image cannot be read from here", HELP));
    };
    let path = folder.join(name);
    let file = path.to_string_lossy();
    let map = read_file(&path, "image")
        .and_then(|bytes| decode(&file, &bytes))
        .and_then(|image| image.map(&file, |shade| rule.is_wall(shade), IMAGE))
        .map_err(|error| {
            let at = error.at.map_or(String::new(), |(line, column)| format!(":{line}:{column}"));
            let problem = format!("the image {name}{at}: {}", error.problem);
            text.error_at(image.place, problem, IMAGE)
        })?;
    let height = map.height();
    let place = |place| frame.column_and_row(place, height);
    with_notes(&root, text, &map.named(&source.name()), place)
}

/// Decodes an image in any of the formats.
fn decode(file: &str, bytes: &[u8]) -> MapResult<Image> {
    if png::is_png(bytes) {
        png::decode(file, bytes)
    } else if pgm::is_pgm(bytes) {
        pgm::decode(file, bytes)
    } else {
        Err(MapError::whole_file(file, "is not an image that can be read", IMAGE))
    }
}

fn frame(text: &Text, root: &Node) -> MapResult<Frame> {
    let number = |node: &Node| node.parsed::<f64>(text, "a number", HELP);
    let resolution = number(root.wanted(text, "resolution", HELP)?)?;
    let origin = match root.get("origin") {
        None => Vec::new(),
        Some(origin) => origin.list(text, HELP)?.iter().map(number).collect::<MapResult<_>>()?,
    };
    let along = |axis: usize| origin.get(axis).copied().unwrap_or(0.0);
    let marks = || ["starts", "goals"].iter().find_map(|key| root.get(key));
    if along(2) != 0.0
        && let Some(marks) = marks()
    {
        let problem = format!("the origin turns the map by {}, and these places with it", along(2));
        let help = "give an origin whose third number, an angle, is 0";
        return Err(text.error_at(marks.place, problem, help));
    }
    Ok(Frame { resolution, origin: [along(0), along(1)] })
}

fn rule(text: &Text, root: &Node) -> MapResult<Rule> {
    let number = |key: &str, otherwise: f32| match root.get(key) {
        None => Ok(otherwise),
        Some(node) => node.parsed(text, "a number", HELP),
    };
    let negate = match root.get("negate") {
        None => false,
        Some(node) => match node.scalar(text, "0 or 1", HELP)? {
            "0" | "false" | "False" => false,
            "1" | "true" | "True" => true,
            _ => return Err(text.error_at(node.place, "negate is neither 0 nor 1", HELP)),
        },
    };
    let mode = match root.get("mode") {
        None => Mode::Trinary,
        Some(node) => match node.scalar(text, "a mode", HELP)? {
            "trinary" => Mode::Trinary,
            "scale" => Mode::Scale,
            "raw" => Mode::Raw,
            _ => return Err(text.error_at(node.place, "there is no such mode", HELP)),
        },
    };
    let (occupied, free) = (number("occupied_thresh", OCCUPIED)?, number("free_thresh", FREE)?);
    if !(0.0..=1.0).contains(&free) || !(free..=1.0).contains(&occupied) {
        let key = ["occupied_thresh", "free_thresh"].iter().find_map(|key| root.get(key));
        let place = key.map_or(root.place, |node| node.place);
        let problem = format!("free_thresh {free} and occupied_thresh {occupied} do not fit");
        let help = "both are from 0 to 1, and free_thresh is the smaller one";
        return Err(text.error_at(place, problem, help));
    }
    Ok(Rule { negate, occupied, free, mode })
}

fn write(stem: &str) -> String {
    let image = name_of(Path::new(stem)) + ".pgm";
    format!(
        "image: {image:?}\nresolution: {}\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n\
         occupied_thresh: {OCCUPIED}\nfree_thresh: {FREE}\n",
        Frame::WRITTEN.resolution
    )
}
