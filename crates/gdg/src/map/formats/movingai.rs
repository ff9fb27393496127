//! Moving AI `.map` files (`type octile`), the field's benchmark format.

use std::num::IntErrorKind;

use super::super::grid::{Cell, Grid, MAX_SIDE, is_size};
use super::super::text::MapResult;
use super::super::text::Text;
use super::MapFormat;
use super::plain::{check_row_length, check_some_free, unknown_character};
use super::rows::too_large;
use crate::text::{counted, grouped};

pub const FORMAT: MapFormat = MapFormat {
    name: "movingai",
    about: "Moving AI's format",
    endings: &["map"],
    loses: "starts and goals",
    keeps_scale: |_| false,
    is: |source| source.is_text(is_movingai),
    read: |source| parse_movingai(&source.name(), source.text()?),
    write: |grid, _| print_movingai(grid).into_bytes(),
    image: None,
};

const HEADER: &str = "a Moving AI map begins with the lines 'type octile', 'height H', 'width W' and 'map', then H rows follow";

const ALLOWED_CHARACTERS: &str =
    "in a Moving AI map '.', 'G' and 'S' are passable, '@', 'O', 'T' and 'W' are not";

/// The words that header lines begin with.
const HEADER_WORDS: [&str; 4] = ["type", "height", "width", "map"];

/// A header: sizes with the lines that state them, and the line of the first row.
struct Header {
    width: (usize, usize),
    height: (usize, usize),
    first_row: usize,
}

/// Returns whether the text starts with a Moving AI header, perhaps an incomplete one.
fn is_movingai(text: &Text) -> bool {
    let first = text.lines[0].split_whitespace().next().unwrap_or_default();
    HEADER_WORDS.iter().any(|word| first.eq_ignore_ascii_case(word))
}

/// Returns whether a character is a free cell; `None` if it is neither that nor a wall.
fn is_free(c: char) -> Option<bool> {
    match c {
        '.' | 'G' | 'S' => Some(true),
        '@' | 'O' | 'T' | 'W' => Some(false),
        _ => None,
    }
}

/// Parses a Moving AI map: `.`, `G` and `S` passable; `@`, `O`, `T` and `W` blocked. Trailing
/// blanks are ignored.
///
/// # Errors
/// Fails if the header is incomplete or contradicts the body, and on everything that makes a plain
/// map invalid.
fn parse_movingai(name: &str, text: &Text) -> MapResult<Grid> {
    let header = parse_header(text)?;
    let Header { width: (width, _), height: (height, _), first_row } = header;
    if !is_size(width, height) {
        return Err(too_large(text, width, height));
    }
    let mut rows: Vec<&str> = text.lines[first_row..].iter().map(|row| row.trim_end()).collect();
    while rows.last().is_some_and(|row| row.is_empty()) {
        rows.pop();
    }
    let help = check_sizes(text, &header, &rows)?;
    let mut free = Vec::with_capacity(width * height);
    for (y, row) in rows.iter().enumerate().take(height) {
        check_row_length(text, first_row + y, row, width, "the header says width", &help)?;
        for c in row.chars() {
            let Some(is_free) = is_free(c) else {
                let is_known = |c| is_free(c).is_some();
                return Err(unknown_character(
                    text,
                    first_row,
                    &rows,
                    is_known,
                    ALLOWED_CHARACTERS,
                ));
            };
            free.push(is_free);
        }
    }
    let help = "give as many rows as the header says";
    if rows.len() < height {
        let problem =
            format!("the map ends after {} rows, but the header says height {height}", rows.len());
        return Err(text.line_error(text.lines.len() - 1, problem, help));
    }
    if rows.len() > height {
        let problem = format!("row {}, but the header says height {height}", height + 1);
        return Err(text.line_error(first_row + height, problem, help));
    }
    check_some_free(text, &free)?;
    Ok(Grid::new(name, width, free, Vec::new(), Vec::new()))
}

/// Checks that height and width are not swapped, and returns the help text for rows of the wrong
/// width.
fn check_sizes(text: &Text, header: &Header, rows: &[&str]) -> MapResult<String> {
    let (width, height) = (header.width.0, header.height.0);
    let length = rows.first().map_or(0, |row| row.chars().count());
    if rows.iter().any(|row| row.chars().count() != length) {
        return Ok("all rows must have as many characters as the header's width says".to_owned());
    }
    if width != height && (length, rows.len()) == (height, width) {
        let problem = format!(
            "height and width are swapped: there are {} of {}",
            counted(rows.len() as u64, "row"),
            counted(length as u64, "character")
        );
        let help = format!("write 'height {}' and 'width {length}'", rows.len());
        return Err(text.line_error(header.width.1.min(header.height.1), problem, help));
    }
    Ok(format!("all rows have this length: write 'width {length}' in line {}", header.width.1 + 1))
}

/// Reads the header, ignoring case.
fn parse_header(text: &Text) -> MapResult<Header> {
    let (mut width, mut height) = (None, None);
    for (i, line) in text.lines.iter().enumerate() {
        let lower = line.to_ascii_lowercase();
        let words: Vec<&str> = lower.split_whitespace().collect();
        match words.as_slice() {
            ["type", "octile"] if i == 0 => {}
            ["type", ..] if i == 0 => {
                return Err(text.line_error(i, "only maps of type octile are supported", HEADER));
            }
            _ if i == 0 => {
                return Err(text.line_error(
                    i,
                    "the line 'type octile' is missing before this one",
                    HEADER,
                ));
            }
            ["height", value] if height.is_none() => {
                height = Some((parse_size(text, i, value)?, i));
            }
            ["width", value] if width.is_none() => width = Some((parse_size(text, i, value)?, i)),
            ["map"] => {
                return match (width, height) {
                    (Some(width), Some(height)) => Ok(Header { width, height, first_row: i + 1 }),
                    (None, _) => Err(text.line_error(i, "the header has no width", HEADER)),
                    (_, None) => Err(text.line_error(i, "the header has no height", HEADER)),
                };
            }
            _ => return Err(text.line_error(i, "unexpected line in the header", HEADER)),
        }
    }
    Err(text.line_error(text.lines.len() - 1, "the header has no final line 'map'", HEADER))
}

fn parse_size(text: &Text, line: usize, value: &str) -> MapResult<usize> {
    let error = |problem: String| {
        // It ends the line.
        let to = text.lines[line].trim_end().chars().count();
        let help = format!("sizes are integers from 1 to {}", grouped(MAX_SIDE as u64));
        text.error(line, to - value.chars().count()..to, problem, help)
    };
    match value.parse::<usize>() {
        Ok(0) => Err(error("a size of 0 is invalid".to_owned())),
        Ok(size) if size <= MAX_SIDE => Ok(size),
        Ok(_) => Err(error(format!("a size of {value} is too large"))),
        Err(e) if *e.kind() == IntErrorKind::PosOverflow => {
            Err(error(format!("a size of {value} is too large")))
        }
        Err(_) => Err(error(format!("{value:?} is not a size"))),
    }
}

/// Prints the map in Moving AI format with LF line endings. The format has no starts or goals: they
/// become free cells.
pub fn print_movingai(grid: &Grid) -> String {
    let mut out = format!("type octile\nheight {}\nwidth {}\nmap\n", grid.height(), grid.width());
    for y in 0..grid.height() {
        out.extend(
            (0..grid.width()).map(|x| if grid.is_free(Cell::new(x, y)) { '.' } else { '@' }),
        );
        out.push('\n');
    }
    out
}
