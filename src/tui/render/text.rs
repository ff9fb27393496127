//! Formatting of lines, numbers and times in panes.

use ratatui::text::{Line, Span};

use super::{BOLD, DIM};

/// Formats a name and a value.
pub fn fact(name: &str, value: impl std::fmt::Display) -> Line<'static> {
    Line::from(vec![Span::styled(format!(" {name:<10}"), DIM), Span::raw(value.to_string())])
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
