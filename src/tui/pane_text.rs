//! Formatting of lines, numbers and times in panes.

use ratatui::text::{Line, Span};
use unicode_truncate::UnicodeTruncateStr;

use crate::tui::theme::{BOLD, DIM};
use gdg::text::{display_width, fitted, grouped};

pub fn fact(name: &str, value: impl std::fmt::Display) -> Line<'static> {
    Line::from(vec![Span::styled(format!(" {name:<11}"), DIM), Span::raw(value.to_string())])
}

/// A number with its name, and what follows it where there is room.
pub type Number = (&'static str, String, String);

pub fn number((name, value, aside): Number) -> Line<'static> {
    fact(name, value + &aside)
}

/// Returns numbers in lines of two, so that those of two runs beside each other line up: where room is
/// short without what follows them.
pub fn in_pairs(numbers: &[Number], columns: u16) -> Vec<Line<'static>> {
    let line = |numbers: &[Number], is_whole: bool| -> Line {
        let spans = numbers.iter().flat_map(|(name, value, aside)| {
            let value = if is_whole { format!("{value}{aside}") } else { value.clone() };
            [Span::styled(format!(" {name} "), DIM), Span::raw(value + " ")]
        });
        spans.collect()
    };
    let row = |pair| {
        let whole = line(pair, true);
        if whole.width() <= usize::from(columns) + 1 { whole } else { line(pair, false) }
    };
    numbers.chunks(2).map(row).collect()
}

/// Minimum width for explanations beside numbers, and the column in which they start.
pub const EXPLAINED_WIDTH: usize = 79;
pub const EXPLANATION_COLUMN: usize = 33;

/// Appends the meaning of a line's number, looked up by the line's name.
pub fn explain(line: &mut Line<'static>, meanings: &[(&str, &str)]) {
    let name = line.spans.first().map(|span| span.content.trim().to_owned()).unwrap_or_default();
    // The name may end with something specific to the run.
    let first = name.split_whitespace().next().unwrap_or_default();
    let known = |name: &str| meanings.iter().find(|(known, _)| *known == name);
    if let Some((_, meaning)) = known(&name).or_else(|| known(first).filter(|_| first == "success"))
    {
        let gap = EXPLANATION_COLUMN.saturating_sub(line.width()).max(2);
        line.push_span(Span::styled(format!("{:gap$}{meaning}", ""), DIM));
    }
}

pub fn heading(text: &str) -> Line<'static> {
    Line::styled(format!(" {text}"), BOLD)
}

/// Formats a number that is not negative in at most nine characters: 950, 1,234,567, 12.3M.
pub fn short(value: f64) -> String {
    match value {
        v if v < 9_999_999.5 => grouped(v.round() as u64),
        v => format!("{:.1}M", v / 1e6),
    }
}

pub fn clock(seconds: f64) -> String {
    let whole = seconds as u64;
    format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
}

/// Shortens lines that are wider than `columns`, with dots.
pub fn fitted_lines(lines: Vec<Line<'static>>, columns: u16) -> Vec<Line<'static>> {
    lines.into_iter().map(|line| fitted_line(line, columns)).collect()
}

/// Shortens a line that is wider than `columns`, with dots.
pub fn fitted_line(mut line: Line<'static>, columns: u16) -> Line<'static> {
    const DOTS: &str = "...";
    let columns = usize::from(columns);
    if display_width(line.to_string().trim_end()) <= columns {
        return line;
    }
    let mut room = columns.saturating_sub(DOTS.len());
    let mut kept = 0;
    while let Some(next) = line.spans.get(kept).map(Span::width).filter(|next| *next <= room) {
        (room, kept) = (room - next, kept + 1);
    }
    line.spans.truncate(kept + 1);
    if let Some(cut) = line.spans.last_mut() {
        cut.content = format!("{}{DOTS}", cut.content.unicode_truncate(room).0).into();
    }
    line
}

/// Keeps the first `most` lines, with dots where others are missing.
pub fn first_lines(mut lines: Vec<String>, most: usize, columns: usize) -> Vec<String> {
    if lines.len() > most {
        lines.truncate(most);
        if let Some(last) = lines.last_mut() {
            *last = fitted(&format!("{last} ..."), columns);
        }
    }
    lines
}

/// Wraps text between words, or within words that are too long.
pub fn wrapped(text: &str, columns: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let mut rest = word;
        while !rest.is_empty() {
            let line = lines.last_mut().expect("there is always a line");
            let gap = if line.is_empty() { "" } else { " " };
            if display_width(line) + gap.len() + display_width(rest) <= columns {
                line.extend([gap, std::mem::take(&mut rest)]);
            } else if line.is_empty() {
                // At least one character, however wide.
                let first = rest.chars().next().map_or(0, char::len_utf8);
                let (part, after) =
                    rest.split_at(rest.unicode_truncate(columns).0.len().max(first));
                line.push_str(part);
                rest = after;
            } else {
                lines.push(String::new());
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_replaced_by_dots() {
        let line = || Line::from(vec![Span::raw(" ab "), Span::raw("cdef"), Span::raw(" gh  ")]);
        let fitted = |columns| fitted_line(line(), columns).to_string();
        assert_eq!(fitted(13), " ab cdef gh  ");
        assert_eq!(fitted(11), " ab cdef gh  ", "only blanks are missing");
        assert_eq!([10, 9, 7, 5].map(fitted), [" ab cde...", " ab cd...", " ab ...", " a..."]);
        let lines = || ["one", "two"].map(str::to_owned).to_vec();
        assert_eq!(first_lines(lines(), 2, 10), lines());
        assert_eq!(first_lines(lines(), 1, 10), ["one ..."]);
        assert_eq!(first_lines(lines(), 1, 5), ["on..."]);
    }

    #[test]
    fn text_wraps_between_words_and_within_long_ones() {
        assert_eq!(wrapped("saved a/b at update 12", 10), ["saved a/b", "at update", "12"]);
        assert_eq!(wrapped("abcdefghijkl m", 5), ["abcde", "fghij", "kl m"]);
        assert_eq!(wrapped("\u{8ff7}\u{5bae}\u{8ff7} m", 5), ["\u{8ff7}\u{5bae}", "\u{8ff7} m"]);
        assert_eq!(wrapped("\u{8ff7}\u{5bae}", 1), ["\u{8ff7}", "\u{5bae}"]);
    }
}
