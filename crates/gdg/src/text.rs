//! Makes external text safe to display: file names, quoted lines, values.
//!
//! Text from a file or an argument may control the terminal that shows it: move its cursor, change
//! its title, reverse the text direction. All external text passes through here before it is
//! displayed.

mod excerpt;
mod number;

use unicode_truncate::UnicodeTruncateStr;
use unicode_width::UnicodeWidthStr;

pub use excerpt::{Excerpt, SourceLine, line_and_column};
pub use number::{NumberError, parse_count, parse_real};

/// Returns whether a character does anything but display itself.
pub fn is_active(c: char) -> bool {
    // Control characters (C0, DEL, C1), line separators, and characters that change the text
    // direction or are invisible.
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}' | '\u{061c}' | '\u{feff}')
        || ('\u{202a}'..='\u{202e}').contains(&c)
        || ('\u{2066}'..='\u{2069}').contains(&c)
        || ('\u{e0000}'..='\u{e007f}').contains(&c)
}

/// Returns the replacement for a character that acts on the terminal. It has the same length in
/// bytes, so offsets in the text stay valid.
fn replacement(c: char) -> char {
    match c.len_utf8() {
        1 => '?',
        2 => '¿',
        3 => '\u{fffd}',
        _ => '\u{1f6ab}',
    }
}

/// Replaces all characters of `text` that act on a terminal, line breaks included. The length in
/// bytes stays the same.
pub fn sanitized(text: &str) -> String {
    text.chars().map(|c| if is_active(c) { replacement(c) } else { c }).collect()
}

/// Like [`sanitized`], but keeps line breaks.
pub fn sanitized_lines(text: &str) -> String {
    text.chars().map(|c| if is_active(c) && c != '\n' { replacement(c) } else { c }).collect()
}

/// Returns text as Markdown shows it literally, within a line or a cell of a table.
pub fn markdown(text: &str) -> String {
    let escaped = |c: char| "\\`*_[]<>|~&#$".contains(c).then_some('\\').into_iter().chain([c]);
    sanitized(text).chars().flat_map(escaped).collect()
}

/// Returns a number and what it counts: `1 task`, `2,000 tasks`.
pub fn counted(n: u64, what: &str) -> String {
    format!("{} {what}{}", grouped(n), if n == 1 { "" } else { "s" })
}

/// Returns a number in groups of three digits: `57,000`.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<&str> =
        digits.as_bytes().rchunks(3).rev().filter_map(|group| str::from_utf8(group).ok()).collect();
    groups.join(",")
}

/// Returns whether a terminal supports escape sequences, given the variable `TERM`.
pub fn obeys_escapes(term: Option<&str>) -> bool {
    let none = |term: &str| term.is_empty() || term == "unknown" || term.starts_with("dumb");
    term.is_some_and(|term| !none(term))
}

/// Returns whether the program's terminal supports escape sequences.
pub fn terminal_obeys_escapes() -> bool {
    obeys_escapes(std::env::var("TERM").ok().as_deref())
}

/// Returns the beginning of `text`, made safe by [`sanitized`], in at most `max_chars` characters.
pub fn truncated(text: &str, max_chars: usize) -> String {
    let start: String = text.chars().take(max_chars).collect();
    let cut = start.len() < text.len();
    let kept = if cut { start.chars().take(max_chars.saturating_sub(3)).collect() } else { start };
    sanitized(&kept) + if cut { "..." } else { "" }
}

/// Escapes the characters in a line of JSON that act on a terminal but need no escape in JSON
/// itself.
pub fn escape_json_line(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if is_active(c) && !matches!(c, '\n' | '\t' | '\r') {
            c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| out += &format!("\\u{unit:04x}"));
        } else {
            out.push(c);
        }
    }
    out
}

/// Returns the beginning of `text` in at most `max_bytes` bytes, without splitting a character.
pub fn beginning(text: &str, max_bytes: usize) -> &str {
    &text[..text.floor_char_boundary(max_bytes)]
}

/// Turns `name` into a file name for a folder of our choice: its last component, without characters
/// that act on a terminal, never empty, and short enough for any suffix. An external name cannot
/// escape from that folder.
pub fn safe_file_name(name: &str) -> String {
    const MAX_BYTES: usize = 80;
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let kept: String = last
        .chars()
        .filter(|c| !is_active(*c) && !matches!(c, ':' | '*' | '?' | '"' | '<' | '>' | '|'))
        .collect();
    let kept = kept.trim_start_matches(|c: char| c == '.' || c.is_whitespace());
    let kept = beginning(kept, MAX_BYTES).trim_end();
    if kept.is_empty() { "unnamed".to_owned() } else { kept.to_owned() }
}

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

/// Shortens the name of a file that does not fit: its middle is left out, as names differ in their ends.
pub fn fitted_file(name: &str, columns: usize) -> String {
    if display_width(name) <= columns {
        return name.to_owned();
    }
    let first = fitted(name, columns.div_ceil(2) + 1);
    let room = columns.saturating_sub(display_width(&first));
    format!("{first}{}", name.unicode_truncate_start(room).0)
}

/// Returns the lines of a table with aligned columns; the last one may have any width.
pub fn aligned(rows: &[Vec<String>]) -> String {
    const GAP: usize = 2;
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let of = |column: usize| {
        rows.iter().filter_map(move |row| Some(display_width(row.split_last()?.1.get(column)?)))
    };
    let widths: Vec<usize> =
        (0..columns).map(|column| of(column).max().unwrap_or(0) + GAP).collect();
    let line = |row: &Vec<String>| {
        let cells = row.iter().zip(&widths).map(|(cell, width)| padded(cell, *width));
        format!("{}\n", cells.collect::<String>().trim_end())
    };
    rows.iter().map(line).collect()
}

/// Minimum similarity of a suggestion; 1 for equal names.
const LEAST_LIKENESS: f64 = 0.85;

/// Of two names, one this many times as long as the other is no form of it. Comparing long names
/// takes time that grows with the product of their lengths.
const MOST_TIMES_AS_LONG: usize = 4;

/// Returns the known name most similar to `typed`, ignoring case, if any is similar enough.
pub fn nearest<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let typed = typed.to_lowercase();
    let likeness = |name: &str| strsim::jaro_winkler(&name.to_lowercase(), &typed);
    let most = known
        .into_iter()
        .filter(|name| typed.len() <= MOST_TIMES_AS_LONG * name.len())
        .filter(|name| name.len() <= MOST_TIMES_AS_LONG * typed.len())
        .map(|name| (likeness(name), name))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    most.filter(|(likeness, _)| *likeness > LEAST_LIKENESS).map(|(_, name)| name)
}

/// Asks for the one of `known` that is most like `typed`, if one is like it at all.
pub fn did_you_mean<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest(typed, known).map_or(String::new(), |known| format!("did you mean {known}? "))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn what_acts_is_replaced_or_escaped() {
        let evil = "a\x1b[2Jb\u{9b}31m\u{202e}c\u{e0041}\n";
        assert_eq!(sanitized(evil), "a?[2Jb¿31m\u{fffd}c\u{1f6ab}?");
        assert!(sanitized_lines(evil).ends_with('\n'));
        assert_eq!(sanitized("maps/größe 7.txt"), "maps/größe 7.txt", "harmless text stays");
        assert_eq!(markdown("<b>a|b*_`[x](y)\\\n# c"), "\\<b\\>a\\|b\\*\\_\\`\\[x\\](y)\\\\?\\# c");
        let safe = escape_json_line(&serde_json::to_string(evil).expect("a string"));
        assert!(safe.is_ascii() && !safe.contains('\x1b'), "{safe}");
        assert_eq!(serde_json::from_str::<String>(&safe).expect("JSON"), evil);
        for (name, expected) in [
            ("../../x", "x"),
            ("..", "unnamed"),
            ("a/..", "unnamed"),
            ("..\\..\\x", "x"),
            (".hidden", "hidden"),
            ("\x1b]0;t\x07", "]0;t"),
            ("fourrooms", "fourrooms"),
        ] {
            assert_eq!(safe_file_name(name), expected, "{name:?}");
        }
    }

    #[test]
    fn columns_are_counted_as_terminals_do() {
        // Wide, combining and joined characters.
        for (text, columns) in [
            ("maze", 4),
            ("\u{8ff7}\u{5bae}", 4),
            ("e\u{301}te\u{301}", 3),
            ("\u{1f468}\u{200d}\u{1f469}\u{200d}\u{1f467}", 2),
        ] {
            assert_eq!(display_width(text), columns, "{text}");
            assert_eq!(display_width(&padded(text, 9)), 9, "{text}");
            assert_eq!(fitted(text, columns), text);
            assert!((0..columns).all(|room| display_width(&fitted(text, room)) <= room), "{text}");
        }
        assert_eq!(fitted("abcdefgh", 6), "abc...");
        let file = |columns| fitted_file("room-gdg-bridge-seed1", columns);
        assert_eq!([21, 14, 2].map(file), ["room-gdg-bridge-seed1", "room-...-seed1", "ro"]);
    }

    #[test]
    fn names_are_suggested_whatever_their_letters() {
        let typed = ["TRAP", "Citty", "for-rooms", "foo", &"trap".repeat(10_000_000)];
        let found = typed.map(|typed| nearest(typed, ["trap", "city", "fourrooms"]));
        assert_eq!(found, [Some("trap"), Some("city"), Some("fourrooms"), None, None]);
        assert_eq!(nearest("foo", ["fourier_octaves"]), None, "much longer");
    }

    proptest! {
        #[test]
        fn plain_text_and_file_names_are_safe(text in any::<String>()) {
            let shown = sanitized(&text);
            prop_assert!(!shown.chars().any(is_active) && shown.len() == text.len());
            let name = safe_file_name(&text);
            prop_assert!(!name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\']));
            prop_assert!(name.len() <= 80 && safe_file_name(&name) == name);
            prop_assert_eq!(std::path::Path::new(&name).components().count(), 1);
        }
    }
}
