//! Plain ASCII maps: one character per cell.

use super::super::grid::{Cell, Grid, is_size};
use super::super::text::Text;
use super::super::text::{MapError, MapResult};
use super::numbers::size_rows;
use super::rows::too_large;
use super::{MapFormat, Mark, marks};
use crate::text::{counted, grouped};

/// Maximum number of further characters that an error names.
const MAX_NAMED_CHARACTERS: usize = 3;

pub const FORMAT: MapFormat = MapFormat {
    name: "plain",
    about: "a character a cell: '#' wall, '.' free, S start, G goal, C both",
    endings: &["txt"],
    loses: "",
    keeps_scale: |_| false,
    is: |_| false,
    read: |source| {
        let text = source.text()?;
        parse_ascii(&source.name(), text).map(|grid| grid.with_doubt(doubtful_letters(&text.lines)))
    },
    write: |grid, _| print_ascii(grid).into_bytes(),
    image: None,
};

const ALLOWED_CHARACTERS: &str = "free cells are '.' or space, walls '#' (or '@', 'O', 'T', 'W'), 'S' a start, 'G' a goal, 'C' both";

const ROW_LENGTHS: &str = "all rows must have the same length (an editor may have removed or added spaces at their ends: \
                           write free cells as '.')";

fn mark(c: char) -> Option<Mark> {
    match c {
        '.' | ' ' => Some(Mark::Free),
        '#' | '@' | 'O' | 'T' | 'W' => Some(Mark::Wall),
        'S' => Some(Mark::Start),
        'G' => Some(Mark::Goal),
        'C' => Some(Mark::Both),
        _ => None,
    }
}

/// Parses a plain ASCII map: `#`, `@`, `O`, `T`, `W` wall; `.` and space free; `S` a start, `G` a
/// goal, `C` both. The map's size may come first, on lines of its own.
///
/// # Errors
/// Fails on rows of different lengths, unknown characters, no free cell, or a size beyond
/// [`size_limits`].
fn parse_ascii(name: &str, text: &Text) -> MapResult<Grid> {
    let lines: Vec<_> = text.lines.iter().copied().enumerate().collect();
    let first = size_rows(&lines);
    let lines = &text.lines[first..];
    let rows = without_stray_blanks(lines).unwrap_or_else(|| lines.to_vec());
    let width = rows[0].chars().count();
    if width == 0 {
        return Err(text.error(
            0,
            0..0,
            "the first row is empty",
            "begin the file with the map's first row",
        ));
    }
    if !is_size(width, rows.len()) {
        return Err(too_large(text, width, rows.len()));
    }
    let mut free = Vec::with_capacity(width * rows.len());
    let (mut starts, mut goals) = (Vec::new(), Vec::new());
    for (y, line) in rows.iter().enumerate() {
        for (x, c) in line.chars().enumerate() {
            let Some(mark) = mark(c) else {
                let is_known = |c| mark(c).is_some();
                return Err(unknown_character(text, first, &rows, is_known, ALLOWED_CHARACTERS));
            };
            if matches!(mark, Mark::Start | Mark::Both) {
                starts.push(Cell::new(x, y));
            }
            if matches!(mark, Mark::Goal | Mark::Both) {
                goals.push(Cell::new(x, y));
            }
            free.push(mark != Mark::Wall);
        }
        check_row_length(text, first + y, line, width, "the first row has", ROW_LENGTHS)?;
    }
    check_some_free(text, &free)?;
    Ok(Grid::new(name, width, free, starts, goals))
}

/// Returns the rows of a ragged map without trailing blanks, if they are then equally long and
/// contain no other blanks: blanks are not its free cells.
fn without_stray_blanks<'a>(rows: &[&'a str]) -> Option<Vec<&'a str>> {
    let lengths = |rows: &[&str]| {
        let mut lengths = rows.iter().map(|row| row.chars().count());
        let first = lengths.next();
        lengths.all(|length| Some(length) == first)
    };
    if lengths(rows) {
        return None;
    }
    let trimmed: Vec<&str> = rows.iter().map(|row| row.trim_end_matches([' ', '\t'])).collect();
    (lengths(&trimmed) && trimmed.iter().all(|row| !row.contains(' '))).then_some(trimmed)
}

/// Prints the map as plain ASCII with LF line endings. Parsing the result gives the same map.
pub fn print_ascii(grid: &Grid) -> String {
    let character = |mark| match mark {
        Mark::Free => '.',
        Mark::Wall => '#',
        Mark::Start => 'S',
        Mark::Goal => 'G',
        Mark::Both => 'C',
    };
    marks(grid).flat_map(|row| row.map(character).chain(['\n'])).collect()
}

/// Creates the error for the first character of `rows`, which begin in line `first`, that is not a
/// map character; it also names later ones. `help` lists those that `is_known` accepts.
pub fn unknown_character(
    text: &Text,
    first: usize,
    rows: &[&str],
    is_known: impl Fn(char) -> bool + Copy,
    help: &str,
) -> Box<MapError> {
    let mut unknown = rows.iter().zip(first..).flat_map(|(row, y)| {
        row.chars().enumerate().filter(move |(_, c)| !is_known(*c)).map(move |(x, c)| (c, y, x))
    });
    let (first, line, column) = unknown.next().unwrap_or((' ', first, 0));
    let named: Vec<String> = unknown
        .by_ref()
        .take(MAX_NAMED_CHARACTERS)
        .map(|(c, y, x)| format!("{c:?} at {}:{}", y + 1, x + 1))
        .collect();
    let mut problem = format!("{first:?} is not a map character");
    if !named.is_empty() {
        problem += &format!("; also {}", named.join(", "));
    }
    match unknown.count() {
        0 => {}
        more => problem += &format!(" and {} more", grouped(more as u64)),
    }
    text.error(line, column..column + 1, problem, help)
}

/// Checks that `row`, on line number `line`, has `width` characters; `because` says where that width
/// comes from.
pub fn check_row_length(
    text: &Text,
    line: usize,
    row: &str,
    width: usize,
    because: &str,
    help: &str,
) -> MapResult<()> {
    let length = row.chars().count();
    if length == width {
        return Ok(());
    }
    let at = length.min(width);
    let blanks = length - row.trim_end().chars().count();
    let blanks = if blanks > 0 {
        format!(", {} at its end", counted(blanks as u64, "blank"))
    } else {
        String::new()
    };
    let problem = format!("this row has {length} characters{blanks}, {because} {width}");
    Err(text.error(line, at..length.max(at + 1), problem, help))
}

/// Checks that the map has a free cell.
pub fn check_some_free(text: &Text, free: &[bool]) -> MapResult<()> {
    if free.iter().any(|f| *f) {
        return Ok(());
    }
    let help = match doubtful_letters(&text.lines) {
        Some(doubt) => format!("{doubt}: write free cells as '.'"),
        None => "write free cells as '.'".to_owned(),
    };
    Err(MapError::whole_file(text.file, "the map has no free cell", help))
}

/// Returns a warning if other programs read a plain map differently.
fn doubtful_letters(lines: &[&str]) -> Option<&'static str> {
    let has = |letter: char| lines.iter().any(|line| line.contains(letter));
    (has('#') && has('O'))
        .then_some("O is a wall, as in Moving AI maps; in D4RL mazes it is a free cell")
}
