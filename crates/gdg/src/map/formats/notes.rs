//! What a map has besides its cells, as `key: value`: in YAML, in comments, in properties. Other
//! programs ignore it.

use super::super::grid::{Cell, Grid};
use super::super::scale::MapScale;
use super::super::text::Text;
use super::super::text::{MapError, MapResult};
use super::yaml::{Node, tree};
use crate::text::SourceLine;

/// Keys of a map's scale, whose values are numbers.
pub const KEYS: [&str; 3] = ["goal_radius", "cells_per_block", "margin"];

/// Keys of its starts and goals, whose values are lists of places.
const STARTS: &str = "starts";
const GOALS: &str = "goals";

/// Begins a comment with notes: no other program's comment is taken for one.
const COMMENT: &str = "gdg-tui:";

/// What the values of [`KEYS`] can be.
pub const VALUES: &str = "goal_radius is a number of cells from 0.1 to 100, cells_per_block an integer from 1 to 256 and margin a number \
     of cells from 0 to 100";

const PLACES: &str = "starts and goals are lists of places [X, Y] in free cells: columns and rows from [0, 0] at the upper \
                      left, but metres in the frame of a map of ROS";

/// Returns a scale with the value of one of [`KEYS`]; `None` if it cannot have that.
pub fn with_value(scale: MapScale, key: &str, value: &str) -> Option<MapScale> {
    let scale = match key {
        "goal_radius" => MapScale { goal_radius: value.parse().ok()?, ..scale },
        "cells_per_block" => MapScale { cell: value.parse().ok()?, ..scale },
        "margin" => MapScale { margin: value.parse().ok()?, ..scale },
        _ => return None,
    };
    scale.is_valid().then_some(scale)
}

/// Returns the values of a map's scale that are not the usual ones, with their keys.
pub fn scale_values(grid: &Grid) -> impl Iterator<Item = (&'static str, String)> {
    let values = |scale: MapScale| {
        [scale.goal_radius.to_string(), scale.cell.to_string(), scale.margin.to_string()]
    };
    let all = KEYS.into_iter().zip(values(grid.scale())).zip(values(MapScale::default()));
    all.filter(|((_, own), usual)| own != usual).map(|(own, _)| own)
}

/// Returns starts and goals, if there are any, with their keys; `place` says where a cell is.
fn mark_values(
    grid: &Grid,
    place: impl Fn(&Cell) -> [String; 2] + Copy,
) -> impl Iterator<Item = (&'static str, String)> {
    let list = move |cells: &[Cell]| {
        let cells: Vec<String> =
            cells.iter().map(|cell| format!("[{}]", place(cell).join(", "))).collect();
        format!("[{}]", cells.join(", "))
    };
    let all = [(STARTS, grid.starts()), (GOALS, grid.goals())];
    all.into_iter().filter(|(_, cells)| !cells.is_empty()).map(move |(key, c)| (key, list(c)))
}

/// Returns column and row of a cell.
pub fn column_and_row(cell: &Cell) -> [String; 2] {
    [cell.x, cell.y].map(|at| at.to_string())
}

/// Returns a map's scale, starts and goals as lines of YAML; `place` says where a cell is.
pub fn yaml_lines(grid: &Grid, place: impl Fn(&Cell) -> [String; 2] + Copy) -> String {
    let all = scale_values(grid).chain(mark_values(grid, place));
    all.map(|(key, value)| format!("{key}: {value}\n")).collect()
}

/// Returns a comment with a map's scale, and with its starts and goals if `with_marks`; `None` if
/// there is nothing to say.
pub fn comment(grid: &Grid, with_marks: bool) -> Option<String> {
    let marks = with_marks.then(|| mark_values(grid, column_and_row)).into_iter().flatten();
    let all: Vec<String> =
        scale_values(grid).chain(marks).map(|(key, value)| format!("{key}: {value}")).collect();
    (!all.is_empty()).then(|| format!("{COMMENT} {{{}}}", all.join(", ")))
}

/// Returns a map with what a comment among these lines of its file says.
///
/// # Errors
/// It says what is not possible.
pub fn with_comment<'a>(
    grid: Grid,
    file: &str,
    lines: impl IntoIterator<Item = &'a str>,
) -> MapResult<Grid> {
    let found = lines.into_iter().enumerate().find_map(|(number, line)| {
        let from = line.find(COMMENT)?;
        Some((number, line, from + COMMENT.len()))
    });
    let Some((number, line, from)) = found else { return Ok(grid) };
    // The place in the file, not in the comment alone.
    let before = line[..from].chars().count();
    let placed = |error: Box<MapError>| {
        let column = match error.at {
            Some((1, column)) => before + column - 1,
            // The comment is all of it, and ends too early.
            _ => before,
        };
        let line = SourceLine { number, text: line };
        MapError::at(file, line, column..column + 1, error.problem, error.help)
    };
    let read = |text: &Text| with_notes(&tree(text)?, text, &grid, |place| place);
    Text::new(file, &line.as_bytes()[from..]).and_then(|text| read(&text)).map_err(placed)
}

/// Returns a map with the scale, the starts and the goals that a document has for it; `place` turns
/// what it says of a place into column and row.
///
/// # Errors
/// A value is not possible.
pub fn with_notes(
    root: &Node,
    text: &Text,
    grid: &Grid,
    place: impl Fn([f64; 2]) -> [f64; 2],
) -> MapResult<Grid> {
    let mut scale = grid.scale();
    for (key, node) in KEYS.iter().filter_map(|key| Some((key, root.get(key)?))) {
        let value = node.scalar(text, "a number", VALUES)?;
        let wrong = || text.error_at(node.place, format!("{value:?} is not a {key}"), VALUES);
        scale = with_value(scale, key, value).ok_or_else(wrong)?;
    }
    let cell = |node: &Node| {
        let at = match node.list(text, PLACES)? {
            [x, y] => [x, y],
            _ => return Err(text.error_at(node.place, "this is not a place", PLACES)),
        };
        let [x, y] = at.map(|node| node.parsed::<f64>(text, "a number", PLACES));
        let [x, y] = place([x?, y?]);
        let is_on_map = x >= 0.0 && y >= 0.0;
        let cell = is_on_map.then(|| Cell::new(x as usize, y as usize));
        cell.filter(|cell| grid.is_free(*cell))
            .ok_or_else(|| text.error_at(node.place, "this place is not in a free cell", PLACES))
    };
    let marked = |key: &str, own: &[Cell]| -> MapResult<Vec<Cell>> {
        let Some(node) = root.get(key) else { return Ok(own.to_vec()) };
        node.list(text, PLACES)?.iter().map(cell).collect()
    };
    let (starts, goals) = (marked(STARTS, grid.starts())?, marked(GOALS, grid.goals())?);
    Ok(grid.with_marks(starts, goals).with_scale(scale))
}
