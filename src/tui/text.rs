//! Formatting of lines, numbers and times in panes.

use ratatui::text::{Line, Span};
use unicode_truncate::UnicodeTruncateStr;

use super::style::{BOLD, DIM};
use gdg::text::display_width;

/// Formats a name and a value.
pub fn fact(name: &str, value: impl std::fmt::Display) -> Line<'static> {
    Line::from(vec![Span::styled(format!(" {name:<10}"), DIM), Span::raw(value.to_string())])
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

/// Formats a heading within a pane.
pub fn heading(text: &str) -> Line<'static> {
    Line::styled(format!(" {text}"), BOLD)
}

/// Formats a number in at most five characters: 950, 12.3k, 4.56M.
pub fn short(value: f64) -> String {
    match value {
        v if v < 1e4 => format!("{v:.0}"),
        v if v < 1e6 => format!("{:.1}k", v / 1e3),
        v => format!("{:.2}M", v / 1e6),
    }
}

/// Formats seconds as hours, minutes and seconds.
pub fn clock(seconds: f64) -> String {
    let whole = seconds as u64;
    format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
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
    use super::wrapped;

    #[test]
    fn text_wraps_between_words_and_within_long_ones() {
        assert_eq!(wrapped("saved a/b at update 12", 10), ["saved a/b", "at update", "12"]);
        assert_eq!(wrapped("abcdefghijkl m", 5), ["abcde", "fghij", "kl m"]);
        assert_eq!(wrapped("\u{8ff7}\u{5bae}\u{8ff7} m", 5), ["\u{8ff7}\u{5bae}", "\u{8ff7} m"]);
        assert_eq!(wrapped("\u{8ff7}\u{5bae}", 1), ["\u{8ff7}", "\u{5bae}"]);
    }
}
