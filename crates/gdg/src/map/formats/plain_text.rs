//! Maps of a character a cell: plain text, and Moving AI's `.map` files (`type octile`).

use super::super::grid::{Grid, MAX_SIDE, is_size};
use super::super::text_file::{MapResult, TextFile};
use super::{CellMark, MapFormat, Source, grid, marks, rows_of, too_large};
use crate::text::grouped;

pub const PLAIN: MapFormat = MapFormat {
    name: "plain",
    about: "a character a cell: '#' wall, '.' free, S start, G goal, C both",
    endings: &["txt"],
    loses: "",
    besides: "own characters",
    is: |_| false,
    read: read_plain,
    write: |grid, _| print_ascii(grid).into_bytes(),
};

pub const MOVINGAI: MapFormat = MapFormat {
    name: "movingai",
    about: "Moving AI's format",
    endings: &["map"],
    loses: "starts and goals",
    besides: "kinds of terrain",
    is: |source| source.is_text(is_movingai),
    read: read_movingai,
    write: |grid, _| write_movingai(grid).into_bytes(),
};

const PLAIN_CELLS: &str = "free cells are '.' or space, walls '#' (or '@', 'O', 'T', 'W'), 'S' a start, 'G' a goal, 'C' both";

const PLAIN_LENGTHS: &str = "all rows must have the same length (an editor may have removed or added spaces at their ends: \
                             write free cells as '.')";

const MOVINGAI_CELLS: &str =
    "in a Moving AI map '.', 'G' and 'S' are passable, '@', 'O', 'T' and 'W' are not";

const MOVINGAI_LENGTHS: &str = "all rows must have as many characters as the header's width says, and there must be as many as its height says";

const HEADER: &str = "a Moving AI map begins with the lines 'type octile', 'height H', 'width W' and 'map', then H rows follow";

fn plain_mark(c: char) -> Option<CellMark> {
    match c {
        '.' | ' ' => Some(CellMark::Free),
        '#' | '@' | 'O' | 'T' | 'W' => Some(CellMark::Wall),
        'S' => Some(CellMark::Start),
        'G' => Some(CellMark::Goal),
        'C' => Some(CellMark::Both),
        _ => None,
    }
}

fn movingai_mark(c: char) -> Option<CellMark> {
    match c {
        '.' | 'G' | 'S' => Some(CellMark::Free),
        '@' | 'O' | 'T' | 'W' => Some(CellMark::Wall),
        _ => None,
    }
}

/// Returns the marks of `rows`, which begin in line `first` and are to be `width` long, as `because`
/// says. `help` is that of errors in their lengths and in their characters.
fn marks_of(
    text: &TextFile,
    (first, rows): (usize, &[&str]),
    (width, because): (usize, &str),
    mark: fn(char) -> Option<CellMark>,
    help: [&str; 2],
) -> MapResult<Vec<CellMark>> {
    let mut marks = Vec::with_capacity(width * rows.len());
    for (line, row) in (first..).zip(rows) {
        for (column, c) in row.chars().enumerate() {
            let problem = || format!("{c:?} is not a map character");
            let unknown = || text.error(line, column..column + 1, problem(), help[1]);
            marks.push(mark(c).ok_or_else(unknown)?);
        }
        let length = row.chars().count();
        if length != width {
            let at = length.min(width);
            let problem = format!("this row has {length} characters, {because} {width}");
            return Err(text.error(line, at..length.max(at + 1), problem, help[0]));
        }
    }
    Ok(marks)
}

fn read_plain(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let (rows, width) = (&text.lines, text.lines[0].chars().count());
    if width == 0 {
        let help = "begin the file with the map's first row";
        return Err(text.error(0, 0..0, "the first row is empty", help));
    }
    if !is_size(width, rows.len()) {
        return Err(too_large(text, width, rows.len()));
    }
    let (width, help) = ((width, "the first row has"), [PLAIN_LENGTHS, PLAIN_CELLS]);
    let marks = marks_of(text, (0, rows), width, plain_mark, help)?;
    let with = |letters: &[char]| rows.iter().position(|row| row.contains(letters));
    // The others are letters of Moving AI's alone.
    if let (Some(_), Some(line), None) = (with(&['#']), with(&['O']), with(&['@', 'T', 'W'])) {
        let at = rows[line].chars().position(|c| c == 'O').unwrap_or(0);
        let problem = "'O' beside '#' may be a wall, or as in D4RL's mazes a free cell";
        return Err(text.error(line, at..at + 1, problem, "write '#' or '.'"));
    }
    grid(source, width.0, &marks, PLAIN_CELLS)
}

/// Whether the text starts with a Moving AI header, perhaps an incomplete one.
fn is_movingai(text: &TextFile) -> bool {
    let first = text.lines[0].split_whitespace().next().unwrap_or_default();
    ["type", "height", "width", "map"].iter().any(|word| first.eq_ignore_ascii_case(word))
}

fn read_movingai(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let (width, height, first) = header(text)?;
    if !is_size(width, height) {
        return Err(too_large(text, width, height));
    }
    let mut rows: Vec<&str> = text.lines[first..].iter().map(|row| row.trim_end()).collect();
    while rows.last().is_some_and(|row| row.is_empty()) {
        rows.pop();
    }
    let own = (first, &rows[..rows.len().min(height)]);
    let (width, help) = ((width, "the header says width"), [MOVINGAI_LENGTHS, MOVINGAI_CELLS]);
    let marks = marks_of(text, own, width, movingai_mark, help)?;
    if rows.len() != height {
        let problem = format!("the map has {} rows, the header says height {height}", rows.len());
        let line = first + rows.len().min(height);
        return Err(text.line_error(line, problem, MOVINGAI_LENGTHS));
    }
    grid(source, width.0, &marks, MOVINGAI_CELLS)
}

/// Returns width, height and the line of the first row, ignoring case.
fn header(text: &TextFile) -> MapResult<(usize, usize, usize)> {
    let (mut width, mut height) = (None, None);
    for (i, line) in text.lines.iter().enumerate() {
        let error = |problem: &str| Err(text.line_error(i, problem, HEADER));
        let lower = line.to_ascii_lowercase();
        let words: Vec<&str> = lower.split_whitespace().collect();
        match (words.as_slice(), width, height) {
            (["type", "octile"], ..) if i == 0 => {}
            _ if i == 0 => return error("a Moving AI map begins with the line 'type octile'"),
            (["height", value], _, None) => height = Some(size(text, i, value)?),
            (["width", value], None, _) => width = Some(size(text, i, value)?),
            (["map"], Some(width), Some(height)) => return Ok((width, height, i + 1)),
            (["map"], None, _) => return error("the header has no width"),
            (["map"], ..) => return error("the header has no height"),
            _ => return error("unexpected line in the header"),
        }
    }
    Err(text.line_error(text.lines.len() - 1, "the header has no final line 'map'", HEADER))
}

fn size(text: &TextFile, line: usize, value: &str) -> MapResult<usize> {
    value.parse().ok().filter(|size| (1..=MAX_SIDE).contains(size)).ok_or_else(|| {
        let help = format!("sizes are integers from 1 to {}", grouped(MAX_SIDE as u64));
        text.line_error(line, format!("{value:?} is not a size"), help)
    })
}

/// Prints the map as plain ASCII with LF line endings. Parsing the result gives the same map.
pub fn print_ascii(grid: &Grid) -> String {
    let character = |mark| match mark {
        CellMark::Free => '.',
        CellMark::Wall => '#',
        CellMark::Start => 'S',
        CellMark::Goal => 'G',
        CellMark::Both => 'C',
    };
    marks(grid).flat_map(|row| row.map(character).chain(['\n'])).collect()
}

fn write_movingai(grid: &Grid) -> String {
    let rows = rows_of(grid, |mark| if mark == CellMark::Wall { "@" } else { "." }, "");
    let [height, width] = [grid.height(), grid.width()];
    format!("type octile\nheight {height}\nwidth {width}\nmap\n{}\n", rows.join("\n"))
}
