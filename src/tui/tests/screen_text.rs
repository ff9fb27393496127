//! Screens as text, for snapshots: characters and styles.

use std::fmt::Write as _;

use ratatui::Terminal;
use ratatui::backend::TestBackend;

/// Returns the characters row by row, then the letters of the cells' styles where they change, with
/// a legend at the end.
pub fn picture(terminal: &Terminal<TestBackend>) -> String {
    let buffer = terminal.backend().buffer();
    let mut known: Vec<String> = Vec::new();
    let (mut signs, mut letters) = (String::new(), String::new());
    for row in buffer.content.chunks(usize::from(buffer.area.width)) {
        let (mut line, mut styles, mut last) = (String::new(), String::new(), None);
        for cell in row {
            line.push_str(cell.symbol());
            let style = format!("{} on {} {:?}", cell.fg, cell.bg, cell.modifier);
            let at = known.iter().position(|known| *known == style).unwrap_or(known.len());
            if at == known.len() {
                known.push(style);
            }
            // The field has many colours, so other characters are used after the alphabet.
            let letter = char::from_u32(0x61 + at as u32).filter(char::is_ascii_lowercase);
            let letter = letter.or(char::from_u32(0x4e00 + at as u32)).unwrap_or('?');
            styles.push(if last.replace(at) == Some(at) { ' ' } else { letter });
        }
        let _ = writeln!(signs, "|{}", line.trim_end());
        let _ = writeln!(letters, "|{}", styles.trim_end());
    }
    let mut all = signs + &letters;
    for (i, style) in known.iter().enumerate().take(26) {
        let _ = writeln!(all, "{}: {style}", char::from(b'a' + i as u8));
    }
    all
}
