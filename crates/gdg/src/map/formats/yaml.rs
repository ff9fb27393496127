//! YAML with its places, and the maps that are written in it: those of ROS (a description, and its
//! image beside it), and those of planners for many agents (libMultiRobotPlanning and its relatives:
//! dimensions, obstacles, and each agent's start and goal). Lists of Python and JSON are YAML too.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use saphyr_parser::{Event, Parser, StrInput};

use super::super::grid::{Cell, Grid, MAX_CELLS, is_size, size_limits};
use super::super::text_file::{MapResult, TextFile, TextPosition, read_file};
use super::{CellMark, Image, MapFormat, Source, grid, marks, name_of};

pub const ROS: MapFormat = MapFormat {
    name: "ros",
    about: "ROS's map.yaml with its image; unknown cells are walls",
    endings: &["yaml", "yml"],
    loses: "starts and goals",
    besides: "resolution, origin, mode, comments and shades of grey",
    is: |source| source.is_text(|text| has_key(text, "image") && has_key(text, "resolution")),
    read: read_ros,
    write: |_, name| write_ros(name).into_bytes(),
};

pub const MAPF: MapFormat = MapFormat {
    name: "mapf",
    about: "YAML of multi-agent planners; its agents are tasks for --scen",
    endings: &["yaml", "yml"],
    loses: "starts and goals",
    besides: "agents and comments",
    is: |source| source.is_text(is_mapf),
    read: read_mapf,
    write: |grid, _| write_mapf(grid).into_bytes(),
};

const ROS_KEYS: &str = "a map of ROS has the keys image, resolution, origin, negate, occupied_thresh and free_thresh, and \
                        may have mode (trinary, scale or raw)";

const ROS_IMAGE: &str = "image is the path of a PNG or PGM image from this file's folder";

const MAPF_KEYS: &str = "such a map has the key map with dimensions: [WIDTH, HEIGHT] and obstacles, a list of [X, Y] from \
                         [0, 0] at the upper left, and may have agents, each with a start and a goal";

/// The deepest nesting of values.
const MAX_DEPTH: usize = 8;

/// The most values of a document, which take some 64 bytes each: 40 and what the list takes that they
/// are in.
const MAX_NODES: usize = 1 << 22;

/// A value of a YAML document, with its place.
#[derive(Debug)]
pub struct Node<'a> {
    pub place: TextPosition,
    value: Value<'a>,
}

#[derive(Debug)]
enum Value<'a> {
    Scalar(Cow<'a, str>),
    List(Box<[Node<'a>]>),
    Map(Box<[(Cow<'a, str>, Node<'a>)]>),
}

/// Returns the root of the document that begins at byte `from`. Tags are ignored.
pub fn tree_from<'a>(text: &'a TextFile<'a>, from: usize) -> MapResult<Node<'a>> {
    let first = text.place_of(from);
    let parser = Parser::new_from_str(&text.source[from..]);
    let mut reader = YamlReader { text, parser, first, left: MAX_NODES };
    let nothing = || text.line_error(0, "there is nothing but comments", "give a file with a map");
    let root = reader.node(MAX_DEPTH)?.ok_or_else(nothing)?;
    match reader.next()? {
        None => Ok(root),
        Some((_, place)) => {
            let help = "give a file with one map";
            Err(text.error_at(place, "a second document begins here", help))
        }
    }
}

/// What is left to read of a document.
struct YamlReader<'a> {
    text: &'a TextFile<'a>,
    parser: Parser<'a, StrInput<'a>>,
    first: TextPosition,
    /// Values that it may still have.
    left: usize,
}

impl<'a> YamlReader<'a> {
    /// Returns the next event and its place.
    fn next(&mut self) -> MapResult<Option<(Event<'a>, TextPosition)>> {
        let first = self.first;
        let place = |line: usize, column: usize| match line.saturating_sub(1) {
            0 => TextPosition { column: column + first.column, ..first },
            more => TextPosition { line: more + first.line, column },
        };
        for event in self.parser.by_ref() {
            match event {
                Ok((
                    Event::StreamStart
                    | Event::StreamEnd
                    | Event::DocumentStart(_)
                    | Event::DocumentEnd
                    | Event::Nothing,
                    _,
                )) => {}
                Ok((event, span)) => {
                    return Ok(Some((event, place(span.start.line(), span.start.col()))));
                }
                Err(error) => {
                    let problem = format!("this is not YAML or a list: {}", error.info());
                    let help = "brackets, quotes and indentation must be those of YAML, JSON or a list of Python, and \
                                a file has one map";
                    let at = place(error.marker().line(), error.marker().col());
                    return Err(self.text.error_at(at, problem, help));
                }
            }
        }
        Ok(None)
    }

    /// Returns the next value, with all that is inside it; `None` at the end of a list or a map.
    fn node(&mut self, depth: usize) -> MapResult<Option<Node<'a>>> {
        let Some((event, place)) = self.next()? else { return Ok(None) };
        let refuse = |problem: &str| Err(self.text.error_at(place, problem, "is this a map?"));
        if depth == 0 {
            return refuse("values are nested too deeply");
        }
        if self.left == 0 {
            return refuse("there are too many values");
        }
        self.left -= 1;
        let value = match event {
            Event::Scalar(value, ..) => Value::Scalar(self.borrowed(place, value)),
            Event::SequenceStart(..) => {
                // Most are pairs, of which there may be millions.
                let mut values = Vec::with_capacity(2);
                while let Some(value) = self.node(depth - 1)? {
                    values.push(value);
                }
                Value::List(values.into())
            }
            Event::MappingStart(..) => {
                let mut entries = Vec::new();
                while let Some(key) = self.node(depth - 1)? {
                    let (Value::Scalar(name), Some(value)) = (key.value, self.node(depth - 1)?)
                    else {
                        let problem = "this key is not a word";
                        return Err(self.text.error_at(key.place, problem, "is this a map?"));
                    };
                    entries.push((name, value));
                }
                Value::Map(entries.into())
            }
            Event::Alias(_) => {
                let help = "write out what it stands for";
                return Err(self.text.error_at(place, "an alias is not supported", help));
            }
            _ => return Ok(None),
        };
        Ok(Some(Node { place, value }))
    }

    /// Returns a value as a part of the text, if it is one, instead of a copy: a map may have millions.
    fn borrowed(&self, at: TextPosition, value: Cow<'a, str>) -> Cow<'a, str> {
        let line = self.text.lines.get(at.line);
        let written = line.and_then(|line| line.get(at.column..)?.get(..value.len()));
        written.filter(|written| *written == value).map_or(value, Cow::Borrowed)
    }
}

/// Errors say what is wanted instead, and help with `help`.
impl Node<'_> {
    pub fn get(&self, key: &str) -> Option<&Self> {
        let Value::Map(entries) = &self.value else { return None };
        entries.iter().find(|(name, _)| name == key).map(|(_, value)| value)
    }

    fn wanted(&self, text: &TextFile, key: &str, help: &str) -> MapResult<&Self> {
        let missing = || text.error_at(self.place, format!("the key {key} is missing"), help);
        let Value::Map(entries) = &self.value else { return Err(missing()) };
        let mut own = entries.iter().filter(|(name, _)| name == key).map(|(_, value)| value);
        let found = own.next().ok_or_else(missing)?;
        let again = |own: &Self| text.error_at(own.place, format!("a second key {key}"), help);
        own.next().map_or(Ok(found), |own| Err(again(own)))
    }

    pub fn list(&self, text: &TextFile, help: &str) -> MapResult<&[Self]> {
        match &self.value {
            Value::List(values) => Ok(values),
            _ => Err(text.error_at(self.place, "this is not a list", help)),
        }
    }

    /// Returns a value that is not made of others.
    pub fn scalar(&self, text: &TextFile, what: &str, help: &str) -> MapResult<&str> {
        match &self.value {
            Value::Scalar(value) => Ok(value),
            _ => Err(text.error_at(self.place, format!("this is not {what}"), help)),
        }
    }

    fn parsed<T: FromStr>(&self, text: &TextFile, what: &str, help: &str) -> MapResult<T> {
        let value = self.scalar(text, what, help)?;
        let other = || text.error_at(self.place, format!("{value:?} is not {what}"), help);
        value.parse().map_err(|_| other())
    }
}

/// Whether a line begins with `key:`.
fn has_key(text: &TextFile, key: &str) -> bool {
    let is_key = |line: &str| {
        line.trim_start().strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with(':'))
    };
    text.lines.iter().any(|line| is_key(line))
}

/// What is occupied or free unless a map of ROS says so: as in ROS 1.
const OCCUPIED: f32 = 0.65;
const FREE: f32 = 0.196;

/// Returns the image that the map of ROS at `path` names, if it is one.
pub fn image_named_in(path: &Path) -> Option<PathBuf> {
    let (file, bytes) = (path.to_string_lossy(), read_file(path, "map").ok()?);
    let text = TextFile::new(&file, &bytes).ok().filter(|text| has_key(text, "image"))?;
    let root = tree_from(&text, 0).ok()?;
    Some(path.parent()?.join(root.get("image")?.scalar(&text, "", ROS_KEYS).ok()?))
}

fn read_ros(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let root = tree_from(text, 0)?;
    let image = root.wanted(text, "image", ROS_KEYS)?;
    let is_wall = ros_walls(text, &root)?;
    let name = image.scalar(text, "the name of an image", ROS_KEYS)?;
    let Some(folder) = source.folder else {
        return Err(text.error_at(image.place, "the image cannot be read from here", ROS_KEYS));
    };
    let path = folder.join(name);
    read_file(&path, "image")
        .and_then(|bytes| Image::decode(&path.to_string_lossy(), &bytes, ROS_IMAGE))
        .and_then(|image| image.map(source, is_wall, ROS_IMAGE))
        .map_err(|error| {
            let at = error.at.map_or(String::new(), |(line, column)| format!(":{line}:{column}"));
            let problem = format!("the image {name}{at}: {}", error.problem);
            text.error_at(image.place, problem, ROS_IMAGE)
        })
}

/// Returns whether a pixel of this brightness, from 0 to 1, is a wall.
fn ros_walls(text: &TextFile, root: &Node) -> MapResult<impl Fn(f32) -> bool + use<>> {
    let number = |key: &str, otherwise: f32| match root.get(key) {
        None => Ok(otherwise),
        Some(node) => node.parsed(text, "a number", ROS_KEYS),
    };
    let one_of = |key: &str, words: &[&str]| {
        let Some(node) = root.get(key) else { return Ok(0) };
        let value = node.scalar(text, "a word", ROS_KEYS)?;
        let problem = || format!("{key} is none of {}", words.join(", "));
        let found = words.iter().position(|word| value.eq_ignore_ascii_case(word));
        found.ok_or_else(|| text.error_at(node.place, problem(), ROS_KEYS))
    };
    let negate = one_of("negate", &["0", "1", "false", "true"])? % 2 == 1;
    let mode = one_of("mode", &["trinary", "scale", "raw"])?;
    let (occupied, free) = (number("occupied_thresh", OCCUPIED)?, number("free_thresh", FREE)?);
    if !(0.0..=1.0).contains(&free) || !(free..=1.0).contains(&occupied) {
        let key = ["occupied_thresh", "free_thresh"].iter().find_map(|key| root.get(key));
        let place = key.map_or(root.place, |node| node.place);
        let problem = format!("free_thresh {free} and occupied_thresh {occupied} do not fit");
        let help = "both are from 0 to 1, and free_thresh is the smaller one";
        return Err(text.error_at(place, problem, help));
    }
    Ok(move |brightness: f32| {
        let own = if negate { brightness } else { 1.0 - brightness };
        match mode {
            // What is neither is unknown.
            0 => own >= free,
            1 => own > occupied,
            _ => (brightness * 255.0).round() >= 100.0 * free,
        }
    })
}

fn write_ros(name: &str) -> String {
    let image = name_of(Path::new(name)) + ".pgm";
    format!(
        "image: {image:?}\nresolution: 0.05\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n\
         occupied_thresh: {OCCUPIED}\nfree_thresh: {FREE}\n"
    )
}

/// Whether a text begins like a map for planners.
pub fn is_mapf(text: &TextFile) -> bool {
    has_key(text, "dimensions") && has_key(text, "obstacles")
}

/// Whether a text is such a map with agents.
pub fn has_agents(text: &TextFile) -> bool {
    let has_start = ["start:", "start\":"].iter().any(|key| text.source.contains(key));
    is_mapf(text) && has_key(text, "agents") && has_start
}

/// A task of one agent: cells, and where they are in the file.
pub struct AgentTask {
    pub start: (Cell, TextPosition),
    pub goal: (Cell, TextPosition),
}

/// Returns a pair of numbers, such as a cell. A third one, for a height, is ignored.
fn pair(text: &TextFile, node: &Node) -> MapResult<(usize, usize)> {
    let number = |node: &Node| node.parsed(text, "a number of cells", MAPF_KEYS);
    match node.list(text, MAPF_KEYS)? {
        [x, y] | [x, y, _] => Ok((number(x)?, number(y)?)),
        _ => Err(text.error_at(node.place, "this is not a pair of numbers", MAPF_KEYS)),
    }
}

fn cell(text: &TextFile, node: &Node, (width, height): (usize, usize)) -> MapResult<Cell> {
    let (x, y) = pair(text, node)?;
    if x < width && y < height {
        return Ok(Cell::new(x, y));
    }
    let problem = format!("({x}, {y}) is outside the map of {width} x {height}");
    Err(text.error_at(node.place, problem, MAPF_KEYS))
}

/// The part of the document with the map: some write it without indentation.
fn map_of<'a, 'b>(root: &'b Node<'a>) -> &'b Node<'a> {
    root.get("map").filter(|map| map.get("dimensions").is_some()).unwrap_or(root)
}

fn dimensions(text: &TextFile, root: &Node) -> MapResult<(usize, usize)> {
    let node = map_of(root).wanted(text, "dimensions", MAPF_KEYS)?;
    let (width, height) = pair(text, node)?;
    if width.max(height) <= MAX_CELLS && is_size(width, height) {
        return Ok((width, height));
    }
    let problem = format!("a map of {width} x {height} cells is not possible");
    Err(text.error_at(node.place, problem, size_limits()))
}

fn read_mapf(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let root = tree_from(text, 0)?;
    let (width, height) = dimensions(text, &root)?;
    let mut marks = vec![CellMark::Free; width * height];
    let obstacles = map_of(&root).wanted(text, "obstacles", MAPF_KEYS)?;
    // A map without obstacles may have the key without a value.
    let has_none =
        matches!(&obstacles.value, Value::Scalar(v) if ["", "~", "null"].contains(&&**v));
    for node in if has_none { &[] } else { obstacles.list(text, MAPF_KEYS)? } {
        let Cell { x, y } = cell(text, node, (width, height))?;
        marks[y * width + x] = CellMark::Wall;
    }
    grid(source, width, &marks, MAPF_KEYS)
}

/// Returns the size of the map that agents are on, and the agents, of which there is one at least.
pub fn agents(text: &TextFile) -> MapResult<((usize, usize), Vec<AgentTask>)> {
    let root = tree_from(text, 0)?;
    let size = dimensions(text, &root)?;
    let nodes = root.wanted(text, "agents", MAPF_KEYS)?;
    let agent = |node: &Node| {
        let at = |key| -> MapResult<_> {
            let node = node.wanted(text, key, MAPF_KEYS)?;
            Ok((cell(text, node, size)?, node.place))
        };
        Ok(AgentTask { start: at("start")?, goal: at("goal")? })
    };
    let agents = nodes.list(text, MAPF_KEYS)?.iter().map(agent).collect::<MapResult<Vec<_>>>()?;
    if agents.is_empty() {
        return Err(text.error_at(nodes.place, "there are no agents", MAPF_KEYS));
    }
    Ok((size, agents))
}

/// Writes the first start with the first goal as an agent, and so on.
fn write_mapf(grid: &Grid) -> String {
    let cell = |cell: &Cell| format!("[{}, {}]", cell.x, cell.y);
    let list =
        |lines: String| if lines.is_empty() { " []\n".to_owned() } else { format!("\n{lines}") };
    let agents = grid.starts().iter().zip(grid.goals()).enumerate().map(|(i, (start, goal))| {
        format!("- name: agent{i}\n  start: {}\n  goal: {}\n", cell(start), cell(goal))
    });
    let walls = marks(grid).flatten().enumerate().filter(|(_, mark)| *mark == CellMark::Wall);
    let walls = walls.map(|(i, _)| format!("  - {}\n", cell(&grid.cell(i))));
    let (width, height) = (grid.width(), grid.height());
    format!(
        "agents:{}map:\n  dimensions: [{width}, {height}]\n  obstacles:{}",
        list(agents.collect()),
        list(walls.collect())
    )
}
