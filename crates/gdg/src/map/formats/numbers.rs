//! Rows of numbers: digits as in OGBench's layouts (`1001`), and CSV, as NumPy and Tiled export it.

use super::super::grid::Grid;
use super::super::text::MapResult;
use super::super::text::{Place, Text};
use super::{MapFormat, Mark, Rows, Source, marks};

pub const FORMAT: MapFormat = MapFormat {
    name: "csv",
    about: "numbers: 0 is free (-1 in layers of Tiled), others walls; also 10011",
    endings: &["csv"],
    loses: "starts and goals",
    keeps_scale: |_| false,
    is: |source| source.is_text(is_numbers),
    read,
    write: |grid, _| write(grid).into_bytes(),
    image: None,
};

const CELLS: &str = "cells are numbers: 0 is free, or -1 where there is one; others are walls";

/// A map of plain text has no digits but for its size, and its walls look like the comments of
/// `numpy.savetxt`.
fn is_numbers(text: &Text) -> bool {
    let rows = rows(text);
    rows.get(size_rows(&rows)).is_some_and(|(_, row)| begins_with_number(row))
}

fn begins_with_number(row: &str) -> bool {
    row.trim_start().starts_with(|c: char| c == '-' || c.is_ascii_digit())
}

/// Returns the lines after the comments at the beginning that are not empty, with their numbers. The
/// line by which spreadsheets name the separator is a comment, too.
fn rows<'a>(text: &Text<'a>) -> Vec<(usize, &'a str)> {
    let is_before = |line: &str| {
        let line = line.trim();
        let beginning = line.trim_start_matches('"').get(..4).unwrap_or_default();
        line.is_empty() || line.starts_with('#') || beginning.eq_ignore_ascii_case("sep=")
    };
    let rows = text.lines.iter().copied().enumerate().skip_while(|(_, line)| is_before(line));
    rows.filter(|(_, row)| !row.trim().is_empty()).collect()
}

/// Returns how many of these rows only say the size of the map, as some planners write it: two
/// numbers, on one line or two, before rows of another length.
pub fn size_rows(rows: &[(usize, &str)]) -> usize {
    let says_size = |lines: &usize| {
        let Some((size, rest @ [(_, first), ..])) = rows.split_at_checked(*lines) else {
            return false;
        };
        let said = size.iter().flat_map(|(line, row)| numbers(*line, row));
        let said: Option<Vec<usize>> = said.map(|(number, _)| number.parse().ok()).collect();
        let width = match numbers(0, first).count() {
            _ if !begins_with_number(first) => first.chars().count(),
            1 => first.trim().len(),
            cells => cells,
        };
        let size = [width, rest.len()];
        width > 2 && said.is_some_and(|said| said == size || said == [size[1], size[0]])
    };
    (1..=2).find(says_size).unwrap_or(0)
}

/// A number of a map: what is written, and where.
type Number<'a> = (&'a str, Place);

/// Splits a line at commas or semicolons, or else at blanks.
fn numbers(line: usize, text: &str) -> impl Iterator<Item = Number<'_>> {
    let has_commas = text.contains([',', ';']);
    let is_between =
        move |c: char| if has_commas { c == ',' || c == ';' } else { c.is_whitespace() };
    let mut next = 0;
    let placed = text.split(is_between).map(move |part| {
        let column = next + part.chars().take_while(|c| c.is_whitespace()).count();
        next += part.chars().count() + 1;
        (part.trim(), Place { line, column })
    });
    placed.filter(|(number, _)| !number.is_empty())
}

/// Checks that commas and semicolons do not separate cells both: commas may be those of decimals.
fn check_separators(text: &Text, rows: &[(usize, &str)]) -> MapResult<()> {
    let first = rows.iter().find_map(|(_, row)| row.chars().find(|c| ",;".contains(*c)));
    let other = if first == Some(',') { ';' } else { ',' };
    let place = |(line, row): &(usize, &str)| {
        Some(Place { line: *line, column: row.chars().position(|c| c == other)? })
    };
    match rows.iter().find_map(place) {
        None => Ok(()),
        Some(place) => {
            let problem = "rows have both commas and semicolons";
            let help = "cells are separated by one of them, and decimals have a point";
            Err(text.error_at(place, problem, help))
        }
    }
}

fn read(source: &Source) -> MapResult<Grid> {
    let text = source.text()?;
    let rows = rows(text);
    let rows = &rows[size_rows(&rows)..];
    check_separators(text, rows)?;
    let lines = || rows.iter().map(|(line, row)| numbers(*line, row));
    let is_binary = |(number, _): Number| number.bytes().all(|b| b == b'0' || b == b'1');
    let is_dense = lines().flatten().all(is_binary) && lines().flatten().any(|n| n.0.len() > 1);
    let is_tiled = |(number, _): Number| number.parse::<f64>().is_ok_and(|value| value == -1.0);
    let empty = if lines().flatten().any(is_tiled) { -1.0 } else { 0.0 };
    let mut cells = Rows::new(text);
    for mut row in lines().map(Iterator::peekable) {
        let Some((_, first)) = row.peek().copied() else { continue };
        for (number, place) in row {
            if is_dense {
                for digit in number.bytes() {
                    cells.push(if digit == b'0' { Mark::Free } else { Mark::Wall })?;
                }
                cells.end_row(place)?;
            } else {
                // NumPy writes integers as 1.000000000000000000e+00 unless told otherwise.
                let value = number.parse().ok().filter(|value: &f64| value.is_finite());
                let value = value.ok_or_else(|| {
                    let problem = format!("{number:?} is not a number");
                    text.error_at(place, problem, CELLS)
                })?;
                cells.push(if value == empty { Mark::Free } else { Mark::Wall })?;
            }
        }
        if !is_dense {
            cells.end_row(first)?;
        }
    }
    cells.finish(&source.name(), CELLS)
}

fn write(grid: &Grid) -> String {
    let cell = |mark| if mark == Mark::Wall { "1" } else { "0" };
    marks(grid).map(|row| row.map(cell).collect::<Vec<_>>().join(",") + "\n").collect()
}

#[cfg(test)]
mod tests {
    use crate::map::parse_map;

    #[test]
    fn a_size_before_the_rows_is_no_row() {
        let size = |text: &str| {
            let maze = parse_map("maze", text.as_bytes()).expect("a map");
            (maze.width(), maze.height())
        };
        for heading in ["2\n3\n", "3\n2\n", "3 2\n", "2,3\n\n", "# height, width\n2, 3\n"] {
            for rows in ["0 1 0\n0 0 0\n", "010\n000\n", "0,1,0\n0,0,0\n"] {
                assert_eq!(size(&format!("{heading}{rows}")), (3, 2), "{heading}{rows}");
            }
        }
        for heading in ["2\n3\n", "3\n2\n", "3 2\n", "2,3\n"] {
            for rows in [".@.\n...\n", " # \n#S \n"] {
                assert_eq!(size(&format!("{heading}{rows}")), (3, 2), "{heading}{rows}");
            }
        }
        let error = parse_map("maze", b"3 2\n.@.\n.?.\n").expect_err("a mark").to_string();
        assert!(error.contains("maze:3:2"), "{error}");
        assert_eq!(size("2 1\n0 0\n"), (2, 2), "rows");
        assert_eq!(size("2\n1\n0\n0\n"), (1, 4), "rows");
        assert!(parse_map("maze", b"3 3\n0 1 0\n0 0 0\n").is_err(), "another size");
    }

    #[test]
    fn one_kind_of_separators_is_read_and_spreadsheets_may_name_it() {
        let read = |text: &str| parse_map("maze", text.as_bytes());
        let named = read("SEP=;\r\n1;1;1\r\n1;0;1\r\n").expect("a map");
        assert_eq!((named.width(), named.free_count()), (3, 1));
        for (decimals, place) in [("1,0;0,0\n0,0;0,0\n", (1, 4)), ("1;0\n 0,5;1\n", (2, 3))] {
            let error = read(decimals).expect_err("two kinds");
            assert_eq!(error.at, Some(place), "{error}");
            assert!(error.help.contains("decimals have a point"), "{error}");
        }
    }
}
