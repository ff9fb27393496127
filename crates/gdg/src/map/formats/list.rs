//! Mazes as lists of rows: Gymnasium-Robotics' `maze_map`, OGBench's layouts, and arrays in JSON.

use std::path::Path;

use super::super::grid::Grid;
use super::super::text::{MapError, MapResult};
use super::super::text::{Place, Text};
use super::notes::{comment, with_comment};
use super::yaml::{Event, events};
use super::{MapFormat, Mark, Rows, Source, marks};

pub const FORMAT: MapFormat = MapFormat {
    name: "list",
    about: "rows of Gymnasium-Robotics and OGBench: [[1, 1], ['r', 0]]",
    endings: &["json", "py"],
    loses: "",
    keeps_scale: |file| !is_json(file),
    is: |source| source.is_text(|text| text.source[start(text.source)..].starts_with('[')),
    read,
    write: |grid, file| write(grid, file).into_bytes(),
    image: None,
};

const CELLS: &str = "a cell is 0 (free), 1 (wall), 'r' (start), 'g' (goal) or 'c' (both)";

const ROWS: &str = "a map is one list of rows, each a list of cells: [[1, 1, 1], [1, 'r', 'g']]; before it may only be \
                    comments and NAME =";

/// Returns the byte at which the list begins: after comments of Python and a name.
fn start(source: &str) -> usize {
    let mut at = 0;
    while let Some(comment) = source[at..].trim_start().strip_prefix('#') {
        let next = comment.find('\n').map_or(comment.len(), |end| end + 1);
        at = source.len() - comment.len() + next;
    }
    at + after_name(&source[at..])
}

/// Returns the byte after `NAME =` in Python and the blanks around it.
pub fn after_name(source: &str) -> usize {
    let after = |rest: &str| source.len() - rest.trim_start().len();
    let start = after(source);
    let named =
        source[start..].trim_start_matches(|c: char| c.is_alphanumeric() || "_.".contains(c));
    match named.trim_start().strip_prefix('=') {
        // A line may go on after a backslash.
        Some(value) => after(value.trim_start().strip_prefix("\\\n").unwrap_or(value)),
        None => start,
    }
}

fn mark(cell: &str) -> Option<Mark> {
    Some(match cell {
        "0" => Mark::Free,
        "1" => Mark::Wall,
        "r" | "R" => Mark::Start,
        "g" | "G" => Mark::Goal,
        "c" | "C" => Mark::Both,
        _ => return None,
    })
}

fn read(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let mut rows = Rows::new(text);
    let (mut depth, mut row) = (0, Place::default());
    for event in events(text, start(text.source)) {
        let (event, place) = event?;
        match (depth, event) {
            (0, Event::ListStart) => depth = 1,
            (1, Event::ListStart) => (depth, row) = (2, place),
            (2, Event::Scalar(cell)) => {
                rows.push(mark(&cell).ok_or_else(|| not_a_cell(text, place, &cell))?)?;
            }
            (2, Event::ListEnd) => {
                rows.end_row(row)?;
                depth = 1;
            }
            (1, Event::ListEnd) => depth = 0,
            _ => return Err(text.error_at(place, "this is not a row of cells", ROWS)),
        }
    }
    with_comment(rows.finish(&source.name(), CELLS)?, text.file, text.lines.iter().copied())
}

fn not_a_cell(text: &Text, place: Place, cell: &str) -> Box<MapError> {
    text.error_at(place, format!("{cell:?} is not a cell"), CELLS)
}

/// Returns whether a file is called one of JSON, which has no comments.
fn is_json(file: &str) -> bool {
    Path::new(file).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json"))
}

fn write(grid: &Grid, file: &str) -> String {
    let cell = |mark| match mark {
        Mark::Free => "0",
        Mark::Wall => "1",
        Mark::Start => "\"r\"",
        Mark::Goal => "\"g\"",
        Mark::Both => "\"c\"",
    };
    let rows: Vec<String> = marks(grid)
        .map(|row| format!("  [{}]", row.map(cell).collect::<Vec<_>>().join(", ")))
        .collect();
    let comment = comment(grid, false).filter(|_| !is_json(file));
    let comment = comment.map_or(String::new(), |comment| format!("# {comment}\n"));
    format!("{comment}[\n{}\n]\n", rows.join(",\n"))
}
