//! Text in columns: characters may take two columns, or none.

use unicode_truncate::UnicodeTruncateStr;
use unicode_width::UnicodeWidthStr;

/// Returns the columns that `text` takes on a terminal.
pub fn display_width(text: &str) -> usize {
    text.width()
}

/// Pads `text` with blanks to at least this display width, in columns.
pub fn padded(text: &str, columns: usize) -> String {
    format!("{text}{}", " ".repeat(columns.saturating_sub(display_width(text))))
}

/// Truncates `text` to fit, with dots if something is missing.
pub fn fitted(text: &str, columns: usize) -> String {
    const DOTS: &str = "...";
    if display_width(text) <= columns {
        return text.to_owned();
    }
    let (dots, room) =
        if columns > DOTS.len() { (DOTS, columns - DOTS.len()) } else { ("", columns) };
    format!("{}{dots}", text.unicode_truncate(room).0)
}

/// Returns the lines of a table with aligned columns; the last one may have any width.
pub fn aligned(rows: &[Vec<String>]) -> String {
    const GAP: usize = 2;
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let of = |column: usize| {
        rows.iter()
            .filter(move |row| row.len() > column + 1)
            .map(move |row| display_width(&row[column]))
    };
    let widths: Vec<usize> =
        (0..columns).map(|column| of(column).max().unwrap_or(0) + GAP).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| padded(cell, *width));
        format!("{}\n", cells.collect::<String>().trim_end())
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wide, combining and joined characters, and their columns.
    const TEXTS: [(&str, usize); 4] = [
        ("maze", 4),
        ("\u{8ff7}\u{5bae}", 4),
        ("e\u{301}te\u{301}", 3),
        ("\u{1f468}\u{200d}\u{1f469}\u{200d}\u{1f467}", 2),
    ];

    #[test]
    fn columns_are_counted_as_terminals_do() {
        for (text, columns) in TEXTS {
            assert_eq!(display_width(text), columns, "{text}");
            assert_eq!(display_width(&padded(text, 9)), 9, "{text}");
            assert_eq!(fitted(text, columns), text);
            assert!((0..columns).all(|room| display_width(&fitted(text, room)) <= room), "{text}");
        }
        assert_eq!(fitted("abcdefgh", 6), "abc...");
    }
}
