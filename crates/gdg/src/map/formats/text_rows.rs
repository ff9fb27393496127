//! Mazes as rows in text: lists (Gymnasium-Robotics' `maze_map`, OGBench's layouts, arrays in JSON),
//! D4RL's strings with backslashes between rows (`"#####\\#GOO#\\#####"`), and numbers: digits as in
//! OGBench's layouts (`1001`), and CSV, as NumPy and Tiled export it.

use super::super::grid::Grid;
use super::super::text_file::{MapResult, TextFile, TextPosition};
use super::yaml::tree_from;
use super::{CellMark, MapFormat, MarkRows, Source, rows_of};

pub const LIST: MapFormat = MapFormat {
    name: "list",
    about: "rows of Gymnasium-Robotics and OGBench: [[1, 1], ['r', 0]]",
    endings: &["json", "py"],
    loses: "",
    besides: "name and comments",
    is: |source| source.is_text(|text| text.source[list_start(text.source)..].starts_with('[')),
    read: read_list,
    write: |grid, _| write_list(grid).into_bytes(),
};

pub const D4RL: MapFormat = MapFormat {
    name: "d4rl",
    about: "a string of D4RL, in which O is free: \"#####\\\\#GOO#\\\\#####\"",
    endings: &["d4rl"],
    loses: "starts",
    besides: "name and starts",
    is: |source| source.is_text(is_d4rl),
    read: read_d4rl,
    write: |grid, _| write_d4rl(grid).into_bytes(),
};

pub const NUMBERS: MapFormat = MapFormat {
    name: "csv",
    about: "numbers: 0 is free (-1 in layers of Tiled), others walls; also 10011",
    endings: &["csv"],
    loses: "starts and goals",
    besides: "comments and other numbers",
    is: |source| source.is_text(is_numbers),
    read: read_numbers,
    write: |grid, _| write_numbers(grid).into_bytes(),
};

const LIST_CELLS: &str = "a cell is 0 (free), 1 (wall), 'r' (start), 'g' (goal) or 'c' (both)";

const LIST_ROWS: &str = "a map is one list of rows, each a list of cells: [[1, 1, 1], [1, 'r', 'g']]; before it may only be \
                         comments and NAME =";

/// Returns the byte at which the list begins: after comments of Python and a name.
fn list_start(source: &str) -> usize {
    let mut at = 0;
    while let Some(comment) = source[at..].trim_start().strip_prefix('#') {
        let next = comment.find('\n').map_or(comment.len(), |end| end + 1);
        at = source.len() - comment.len() + next;
    }
    at + after_name(&source[at..])
}

/// Returns the byte after `NAME =` in Python and the blanks around it.
fn after_name(source: &str) -> usize {
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

fn read_list(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let mut cells = MarkRows::new(text);
    let root = tree_from(text, list_start(text.source))?;
    for row in root.list(text, LIST_ROWS)? {
        for cell in row.list(text, LIST_ROWS)? {
            let value = cell.scalar(text, "a cell", LIST_ROWS)?;
            cells.push(match value {
                "0" => CellMark::Free,
                "1" => CellMark::Wall,
                "r" | "R" => CellMark::Start,
                "g" | "G" => CellMark::Goal,
                "c" | "C" => CellMark::Both,
                _ => {
                    let problem = format!("{value:?} is not a cell");
                    return Err(text.error_at(cell.place, problem, LIST_CELLS));
                }
            })?;
        }
        cells.end_row(row.place)?;
    }
    cells.finish(source, LIST_CELLS)
}

fn write_list(grid: &Grid) -> String {
    let cell = |mark| match mark {
        CellMark::Free => "0",
        CellMark::Wall => "1",
        CellMark::Start => "\"r\"",
        CellMark::Goal => "\"g\"",
        CellMark::Both => "\"c\"",
    };
    format!("[\n  [{}]\n]\n", rows_of(grid, cell, ", ").join("],\n  ["))
}

const D4RL_CELLS: &str = "in a maze of D4RL '#' is a wall, 'O', '0' and ' ' are free, 'G' is a goal and \
                          'S' a start, and a backslash ends a row";

/// Whether the text has backslashes: without them it is a plain map, where `O` is a wall.
fn is_d4rl(text: &TextFile) -> bool {
    let value = &text.source[after_name(text.source)..];
    value.starts_with(['#', '"', '\'', '(', '\\']) && value.contains('\\') && value.contains('#')
}

fn read_d4rl(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let mut rows = MarkRows::new(text);
    let (mut row, mut last) = (TextPosition::default(), TextPosition::default());
    for (c, place) in characters(text) {
        let follows = last == TextPosition { column: place.column.wrapping_sub(1), ..place };
        if rows.is_row_empty() && c != '\\' {
            row = place;
        }
        match c {
            '#' => rows.push(CellMark::Wall)?,
            'O' | '0' | ' ' => rows.push(CellMark::Free)?,
            'S' => rows.push(CellMark::Start)?,
            'G' => rows.push(CellMark::Goal)?,
            // Source has two backslashes for one.
            '\\' if follows => {}
            '\\' => {
                let from = if rows.is_row_empty() { place } else { row };
                rows.end_row(from)?;
                last = place;
            }
            _ => {
                let problem = format!("{c:?} is not a cell of D4RL");
                return Err(text.error_at(place, problem, D4RL_CELLS));
            }
        }
    }
    if !rows.is_row_empty() {
        rows.end_row(row)?;
    }
    rows.finish(source, D4RL_CELLS)
}

/// Returns the characters of the maze with their places: those in quotes, if there are any.
fn characters<'a>(text: &'a TextFile<'a>) -> impl Iterator<Item = (char, TextPosition)> + 'a {
    let from = after_name(text.source);
    let is_quoted = text.source[from..].contains(['"', '\'']);
    let first = text.place_of(from);
    let all = text.lines.iter().enumerate().flat_map(|(line, chars)| {
        chars.chars().enumerate().map(move |(column, c)| (c, TextPosition { line, column }))
    });
    let mut inside = None;
    all.skip_while(move |(_, place)| *place < first).filter(move |(c, _)| match (inside, *c) {
        (Some(quote), c) if c == quote => {
            inside = None;
            false
        }
        (Some(_), _) => true,
        (None, '"' | '\'') => {
            inside = Some(*c);
            false
        }
        (None, _) => !is_quoted,
    })
}

fn write_d4rl(grid: &Grid) -> String {
    let cell = |mark| match mark {
        CellMark::Wall => "#",
        CellMark::Free | CellMark::Start => "O",
        CellMark::Goal | CellMark::Both => "G",
    };
    format!("\"{}\"\n", rows_of(grid, cell, "").join("\\\\"))
}

const NUMBER_CELLS: &str =
    "cells are numbers: 0 is free, one other a wall; where there is -1, that is free, others walls";

fn is_numbers(text: &TextFile) -> bool {
    let first = rows(text).next().map(|(_, row)| row.trim_start());
    first.is_some_and(|row| row.starts_with(|c: char| c == '-' || c.is_ascii_digit()))
}

/// Returns the lines after the comments at the beginning that are not empty, with their numbers. The
/// line by which spreadsheets name the separator is a comment, too.
fn rows<'a>(text: &'a TextFile) -> impl Iterator<Item = (usize, &'a str)> {
    let is_before = |line: &str| {
        let line = line.trim();
        let beginning = line.trim_start_matches('"').get(..4).unwrap_or_default();
        line.is_empty() || line.starts_with('#') || beginning.eq_ignore_ascii_case("sep=")
    };
    let rows = text.lines.iter().copied().enumerate().skip_while(move |(_, line)| is_before(line));
    rows.filter(|(_, row)| !row.trim().is_empty())
}

/// Splits a line at commas or semicolons, or else at blanks; returns the numbers with their places.
fn numbers(line: usize, text: &str) -> impl Iterator<Item = (&str, TextPosition)> {
    let has_commas = text.contains([',', ';']);
    let is_between = move |c: char| if has_commas { ",;".contains(c) } else { c.is_whitespace() };
    let mut next = 0;
    let placed = text.split(is_between).map(move |part| {
        let column = next + part.chars().take_while(|c| c.is_whitespace()).count();
        next += part.chars().count() + 1;
        (part.trim(), TextPosition { line, column })
    });
    placed.filter(|(number, _)| !number.is_empty())
}

fn read_numbers(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let lines = || rows(text).map(|(line, row)| numbers(line, row));
    if let Some((line, _)) = rows(text).find(|(_, row)| row.contains(',') && row.contains(';')) {
        let help = "cells are separated by one of them, and decimals have a point";
        return Err(text.line_error(line, "this row has both commas and semicolons", help));
    }
    let mut cells = MarkRows::new(text);
    // Digits are cells where only rows are apart: else they are numbers, which may be padded.
    let has_cells = |(_, row): (usize, &str)| row.trim().bytes().all(|b| b"01".contains(&b));
    if rows(text).all(has_cells) && rows(text).any(|(_, row)| row.trim().len() > 1) {
        for (row, place) in lines().flatten() {
            for digit in row.bytes() {
                cells.push(if digit == b'0' { CellMark::Free } else { CellMark::Wall })?;
            }
            cells.end_row(place)?;
        }
        return cells.finish(source, NUMBER_CELLS);
    }
    let place_of = |wanted: f64| {
        let is = |(number, _): &(&str, TextPosition)| number.parse() == Ok(wanted);
        lines().flatten().find(is).map(|(_, place)| place)
    };
    let tiled = place_of(-1.0);
    if let (Some(_), Some(place)) = (tiled, place_of(100.0)) {
        let problem = "100 beside -1: is this an occupancy grid, or a layer of Tiled?";
        return Err(text.error_at(place, problem, "write 0 for free cells and 1 for walls"));
    }
    let empty = if tiled.is_some() { -1.0 } else { 0.0 };
    let mut wall = None;
    for row in lines() {
        let mut first = None;
        for (number, place) in row {
            first.get_or_insert(place);
            // NumPy writes integers as 1.000000000000000000e+00 unless told otherwise.
            let value = number.parse().ok().filter(|value: &f64| value.is_finite());
            let problem = || format!("{number:?} is not a number");
            let value = value.ok_or_else(|| text.error_at(place, problem(), NUMBER_CELLS))?;
            // Tiles are of many kinds.
            if value != empty && tiled.is_none() && *wall.get_or_insert(value) != value {
                let problem = "a third number: which cells are walls, and is this row one?";
                return Err(text.error_at(place, problem, NUMBER_CELLS));
            }
            cells.push(if value == empty { CellMark::Free } else { CellMark::Wall })?;
        }
        first.map_or(Ok(()), |place| cells.end_row(place))?;
    }
    cells.finish(source, NUMBER_CELLS)
}

fn write_numbers(grid: &Grid) -> String {
    rows_of(grid, |mark| if mark == CellMark::Wall { "1" } else { "0" }, ",").join("\n") + "\n"
}
