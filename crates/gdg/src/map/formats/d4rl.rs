//! D4RL's mazes: rows in one string, with backslashes between them: `"#####\\#GOO#\\#####"`, as
//! Python source or as the string itself.

use super::super::grid::Grid;
use super::super::text::MapResult;
use super::super::text::{Place, Text};
use super::list::after_name;
use super::notes::{comment, with_comment};
use super::{MapFormat, Mark, Rows, Source, marks};
use crate::text::line_and_column;

pub const FORMAT: MapFormat = MapFormat {
    name: "d4rl",
    about: "a string of D4RL, in which O is free: \"#####\\\\#GOO#\\\\#####\"",
    endings: &["d4rl"],
    loses: "",
    keeps_scale: |_| true,
    is: |source| source.is_text(is_d4rl),
    read,
    write: |grid, _| write(grid).into_bytes(),
    image: None,
};

const CELLS: &str = "in a maze of D4RL '#' is a wall, 'O', '0' and ' ' are free, 'G' is a goal and \
                     'S' a start, and a backslash ends a row";

/// Returns whether the text has backslashes: without them it is a plain map, where `O` is a wall.
fn is_d4rl(text: &Text) -> bool {
    let value = &text.source[after_name(text.source)..];
    value.starts_with(['#', '"', '\'', '(', '\\']) && value.contains('\\') && value.contains('#')
}

fn mark(c: char) -> Option<Mark> {
    Some(match c {
        '#' => Mark::Wall,
        'O' | '0' | ' ' => Mark::Free,
        'S' => Mark::Start,
        'G' => Mark::Goal,
        _ => return None,
    })
}

fn read(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let mut rows = Rows::new(text);
    let (mut row, mut last) = (Place::default(), Place::default());
    for (c, place) in characters(text) {
        let follows = last == Place { column: place.column.wrapping_sub(1), ..place };
        if rows.is_row_empty() && c != '\\' {
            row = place;
        }
        match mark(c) {
            Some(mark) => rows.push(mark)?,
            // Source has two backslashes for one.
            None if c == '\\' && follows => {}
            None if c == '\\' => {
                let from = if rows.is_row_empty() { place } else { row };
                rows.end_row(from)?;
                last = place;
            }
            None => {
                return Err(text.error_at(place, format!("{c:?} is not a cell of D4RL"), CELLS));
            }
        }
    }
    if !rows.is_row_empty() {
        rows.end_row(row)?;
    }
    with_comment(rows.finish(&source.name(), CELLS)?, text.file, text.lines.iter().copied())
}

/// Returns the characters of the maze with their places: those in quotes, if there are any.
fn characters<'a>(text: &'a Text<'a>) -> impl Iterator<Item = (char, Place)> + 'a {
    let from = after_name(text.source);
    let is_quoted = text.source[from..].contains(['"', '\'']);
    let (line, column) = line_and_column(text.source, from);
    let first = Place { line: line - 1, column: column - 1 };
    let all = text.lines.iter().enumerate().flat_map(|(line, chars)| {
        chars.chars().enumerate().map(move |(column, c)| (c, Place { line, column }))
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

fn write(grid: &Grid) -> String {
    let cell = |mark| match mark {
        Mark::Wall => '#',
        Mark::Free | Mark::Start => 'O',
        Mark::Goal | Mark::Both => 'G',
    };
    let rows: Vec<String> = marks(grid).map(|row| row.map(cell).collect()).collect();
    // Goals have a letter, starts have none.
    let starts = grid.with_marks(grid.starts().to_vec(), Vec::new());
    let comment = comment(&starts, true).map_or(String::new(), |comment| format!("# {comment}\n"));
    format!("\"{}\"\n{comment}", rows.join("\\\\"))
}
