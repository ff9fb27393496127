//! Screens as text, for snapshots: positions and styles. Words may change, so a run of them is only
//! marked by `~` where it begins.

use std::fmt::Write as _;
use std::ops::Range;

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Cell;

/// The mark for a run of words.
const WORDS: char = '~';

/// Returns the characters row by row, then the letters of the cells' styles where they change, with
/// a legend at the end.
pub fn picture(terminal: &Terminal<TestBackend>) -> String {
    let buffer = terminal.backend().buffer();
    let mut styles = Vec::new();
    let (mut signs, mut letters) = (String::new(), String::new());
    for row in buffer.content.chunks(usize::from(buffer.area.width)) {
        let runs = runs_of_words(row);
        let _ = writeln!(signs, "|{}", signs_of(row, &runs).trim_end());
        let _ = writeln!(letters, "|{}", styles_of(row, &runs, &mut styles).trim_end());
    }
    let mut all = format!("{signs}{letters}");
    for (i, style) in styles.iter().enumerate().take(26) {
        let _ = writeln!(all, "{}: {style}", char::from(b'a' + i as u8));
    }
    all
}

/// Returns the cells of words, each run in one style: from a word of two letters to the last one
/// before something else.
fn runs_of_words(row: &[Cell]) -> Vec<Range<usize>> {
    let has = |i: usize, is: fn(char) -> bool| {
        row.get(i).is_some_and(|cell| cell.symbol().chars().all(is) && !cell.symbol().is_empty())
    };
    let is_letter = |i: usize| has(i, |c| c.is_ascii_alphabetic());
    let is_between = |i: usize| has(i, |c| " ,.;:!?'\"()-".contains(c));
    let mut runs: Vec<Range<usize>> = Vec::new();
    let mut i = 0;
    while i < row.len() {
        if !(is_letter(i) && is_letter(i + 1)) {
            i += 1;
            continue;
        }
        let same_style = |at: usize| row.get(at).is_some_and(|cell| cell.style() == row[i].style());
        let (mut end, mut at) = (i, i);
        while same_style(at) && (is_letter(at) || is_between(at)) {
            let blanks = at > i && has(at, |c| c == ' ') && has(at - 1, |c| c == ' ');
            if blanks {
                break;
            }
            at += 1;
            end = if is_letter(at - 1) { at } else { end };
        }
        runs.push(i..end);
        i = end;
    }
    runs
}

fn signs_of(row: &[Cell], runs: &[Range<usize>]) -> String {
    let mut line = String::new();
    for (i, cell) in row.iter().enumerate() {
        match runs.iter().find(|run| run.contains(&i)) {
            Some(run) if run.start == i => line.push(WORDS),
            Some(_) => line.push(' '),
            None => line.push_str(cell.symbol()),
        }
    }
    line
}

/// Returns the letter of each style where it begins; not where words end.
fn styles_of(row: &[Cell], runs: &[Range<usize>], styles: &mut Vec<String>) -> String {
    let mut line = String::new();
    let (mut last, mut after_words) = (None, false);
    for (i, cell) in row.iter().enumerate() {
        let style = format!("{} on {} {:?}", cell.fg, cell.bg, cell.modifier);
        let at = styles.iter().position(|known| *known == style).unwrap_or_else(|| {
            styles.push(style);
            styles.len() - 1
        });
        let within = runs.iter().any(|run| run.contains(&i) && run.start < i);
        after_words = within || after_words && cell.symbol() == " ";
        if after_words || last == Some(at) {
            line.push(' ');
            continue;
        }
        last = Some(at);
        // The field has many colours, so other characters are used after the alphabet.
        let letter = char::from_u32(0x61 + at as u32).filter(char::is_ascii_lowercase);
        line.push(letter.unwrap_or_else(|| char::from_u32(0x4e00 + at as u32).unwrap_or('?')));
    }
    line
}
