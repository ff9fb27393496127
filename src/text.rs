//! Text from outside, made safe to show: names of files, quoted lines, values.
//!
//! What a file or an argument holds may act on the terminal that shows it: move its cursor, change its title, turn the
//! direction of text around. Everything that comes from outside passes through here before it is shown.

mod excerpt;

pub use excerpt::{Excerpt, line_and_column};

/// Whether a character does anything but stand where it is written.
fn acts(c: char) -> bool {
    // Control characters (C0, DEL, C1), separators of lines, and what changes the direction of text or hides in it.
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}' | '\u{061c}' | '\u{feff}')
        || ('\u{202a}'..='\u{202e}').contains(&c)
        || ('\u{2066}'..='\u{2069}').contains(&c)
        || ('\u{e0000}'..='\u{e007f}').contains(&c)
}

/// What stands for a character that acts: of as many bytes, so that places in the text stay what they are.
fn stand_in(c: char) -> char {
    match c.len_utf8() {
        1 => '?',
        2 => '¿',
        3 => '\u{fffd}',
        _ => '\u{1f6ab}',
    }
}

/// One line of `text` with every character that acts on a terminal replaced; of as many bytes as before.
pub fn plain(text: &str) -> String {
    text.chars().map(|c| if acts(c) { stand_in(c) } else { c }).collect()
}

/// The same for text of several lines, whose ends are kept.
pub fn plain_lines(text: &str) -> String {
    text.chars().map(|c| if acts(c) && c != '\n' { stand_in(c) } else { c }).collect()
}

/// Prints a line to standard error. Where nobody can read it there is nobody to be told, and that is no failure.
pub fn tell(line: &str) {
    use std::io::Write as _;
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// The beginning of `text`, plain, in at most `most` characters.
pub fn shortened(text: &str, most: usize) -> String {
    let start: String = text.chars().take(most).collect();
    let cut = start.len() < text.len();
    let kept = if cut { start.chars().take(most.saturating_sub(3)).collect() } else { start };
    plain(&kept) + if cut { "..." } else { "" }
}

/// A line of JSON with everything escaped that acts on a terminal and that JSON itself lets through.
pub fn json_line(json: &str) -> String {
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if acts(c) && !matches!(c, '\n' | '\t' | '\r') {
            let mut units = [0; 2];
            c.encode_utf16(&mut units).iter().for_each(|unit| out.push_str(&format!("\\u{unit:04x}")));
        } else {
            out.push(c);
        }
    }
    out
}

/// `name` as the name of a file in a folder of our choice: its last component, without characters that act, and never
/// empty. What a file calls itself cannot lead anywhere else.
pub fn file_name(name: &str) -> String {
    const MOST: usize = 80;
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let kept: String =
        last.chars().filter(|c| !acts(*c) && !matches!(c, ':' | '*' | '?' | '"' | '<' | '>' | '|')).collect();
    let kept: String = kept.trim_start_matches('.').trim().chars().take(MOST).collect();
    if kept.is_empty() { "unnamed".to_owned() } else { kept }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn escapes_are_replaced_byte_for_byte() {
        let evil = "a\x1b[2Jb\u{9b}31m\u{202e}c\u{e0041}\n";
        let shown = plain(evil);
        assert_eq!(shown.len(), evil.len());
        assert_eq!(shown, "a?[2Jb¿31m\u{fffd}c\u{1f6ab}?");
        assert!(plain_lines(evil).ends_with('\n'));
        assert_eq!(plain("maps/größe 7.txt"), "maps/größe 7.txt", "what is harmless stays");
    }

    #[test]
    fn quotations_are_short() {
        assert_eq!(shortened("abc", 5), "abc");
        assert_eq!(shortened(&"x".repeat(50_000_000), 10), "xxxxxxx...");
    }

    #[test]
    fn json_escapes_what_json_itself_does_not() {
        let line = serde_json::to_string("a\u{9b}b\u{1b}\u{e0041}").expect("a string");
        let safe = json_line(&line);
        assert!(safe.is_ascii() && !safe.contains('\x1b'), "{safe}");
        assert_eq!(serde_json::from_str::<String>(&safe).expect("JSON"), "a\u{9b}b\u{1b}\u{e0041}");
    }

    #[test]
    fn a_name_from_a_file_leads_nowhere() {
        for (name, expected) in [
            ("../../x", "x"),
            ("/etc/passwd", "passwd"),
            ("..", "unnamed"),
            ("a/..", "unnamed"),
            ("", "unnamed"),
            ("..\\..\\x", "x"),
            (".hidden", "hidden"),
            ("\x1b]0;t\x07", "]0;t"),
            ("fourrooms", "fourrooms"),
        ] {
            assert_eq!(file_name(name), expected, "{name:?}");
        }
    }

    proptest! {
        #[test]
        fn nothing_that_acts_is_left(text in any::<String>()) {
            let shown = plain(&text);
            prop_assert!(!shown.chars().any(acts) && shown.len() == text.len());
            let name = file_name(&text);
            prop_assert!(!name.is_empty() && !name.starts_with('.') && !name.contains(['/', '\\']));
            prop_assert_eq!(std::path::Path::new(&name).components().count(), 1);
        }
    }
}
