//! Moving AI `.map` files (`type octile`), the field's benchmark format.

use std::num::IntErrorKind;

use super::ascii::{check_row_length, check_some_free, too_large, unknown_character};
use super::error::MapResult;
use super::grid::{Cell, Grid, MAX_SIDE, is_size};
use super::text::Text;

const HEADER: &str =
    "a Moving AI map begins with the lines 'type octile', 'height H', 'width W' and 'map', then H rows follow";

const ALLOWED_CHARACTERS: &str = "in a Moving AI map '.', 'G' and 'S' are passable, '@', 'O', 'T' and 'W' are not";

/// Returns whether the text starts with a Moving AI header.
pub fn is_movingai(text: &Text) -> bool {
    text.lines[0].split_whitespace().next() == Some("type")
}

/// Returns whether a character is a free cell; `None` if it is neither that nor a wall.
fn is_free(c: char) -> Option<bool> {
    match c {
        '.' | 'G' | 'S' => Some(true),
        '@' | 'O' | 'T' | 'W' => Some(false),
        _ => None,
    }
}

/// Parses a Moving AI map: `.`, `G` and `S` passable; `@`, `O`, `T` and `W` blocked.
///
/// # Errors
/// Fails if the header is incomplete or contradicts the body, and on everything that makes a plain map invalid.
pub fn parse_movingai(name: &str, text: &Text) -> MapResult<Grid> {
    let (width, height, first_row) = parse_header(text)?;
    if !is_size(width, height) {
        return Err(too_large(text, width, height));
    }
    let rows = text.lines.len() - first_row;
    let mut free = Vec::with_capacity(width * height);
    for line in first_row..text.lines.len().min(first_row + height) {
        check_row_length(text, line, width, "the header says width")?;
        for c in text.lines[line].chars() {
            let Some(is_free) = is_free(c) else {
                return Err(unknown_character(text, line, |c| is_free(c).is_some(), ALLOWED_CHARACTERS));
            };
            free.push(is_free);
        }
    }
    if rows < height {
        let line = text.lines.len() - 1;
        let problem = format!("the map ends after {rows} rows, but the header says height {height}");
        return Err(text.line_error(line, problem, "give as many rows as the header says"));
    }
    if rows > height {
        let problem = format!("row {}, but the header says height {height}", height + 1);
        return Err(text.line_error(first_row + height, problem, "give as many rows as the header says"));
    }
    check_some_free(text, &free)?;
    Ok(Grid::new(name, width, free, Vec::new(), Vec::new()))
}

/// Returns the width, the height and the index of the first row's line.
fn parse_header(text: &Text) -> MapResult<(usize, usize, usize)> {
    let (mut width, mut height) = (None, None);
    for (i, line) in text.lines.iter().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["type", "octile"] if i == 0 => {}
            ["type", ..] if i == 0 => {
                return Err(text.line_error(i, "only maps of type octile are supported", HEADER));
            }
            ["height", value] if height.is_none() => height = Some(parse_size(text, i, value)?),
            ["width", value] if width.is_none() => width = Some(parse_size(text, i, value)?),
            ["map"] => {
                return match (width, height) {
                    (Some(w), Some(h)) => Ok((w, h, i + 1)),
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
    let column = text.lines[line].chars().count() - text.lines[line].trim_start().chars().count();
    let from = column + text.lines[line].trim_start().find(value).unwrap_or(0);
    let error = |problem: String| {
        let help = format!("sizes are integers from 1 to {MAX_SIDE}");
        text.error(line, from..from + value.chars().count(), problem, help)
    };
    match value.parse::<usize>() {
        Ok(0) => Err(error("a size of 0 is invalid".to_owned())),
        Ok(size) if size <= MAX_SIDE => Ok(size),
        Ok(_) => Err(error(format!("a size of {value} is too large"))),
        Err(e) if *e.kind() == IntErrorKind::PosOverflow => Err(error(format!("a size of {value} is too large"))),
        Err(_) => Err(error(format!("{value:?} is not a size"))),
    }
}

/// Prints the map in Moving AI format with LF line endings. The format has no starts or goals: they become free cells.
pub fn print_movingai(grid: &Grid) -> String {
    let mut out = format!("type octile\nheight {}\nwidth {}\nmap\n", grid.height(), grid.width());
    for y in 0..grid.height() {
        out.extend((0..grid.width()).map(|x| if grid.is_free(Cell::new(x, y)) { '.' } else { '@' }));
        out.push('\n');
    }
    out
}
