//! Pictures in the terminal, by kitty's protocol (also of Ghostty, Konsole and WezTerm).
//!
//! `ratatui-image` does not suit pictures that change constantly. It resends the whole picture when
//! a part changes, never deletes one, and its query leaves a thread behind that swallows keys if the
//! terminal does not answer. So the protocol is implemented here, and only changed patches
//! are sent.
//!
//! * `patches`: tracks what is on the screen and what to send.

pub mod patches;

use ratatui::buffer::Cell;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};

use crate::tui::choices::Marker;
use gdg::text::obeys_escapes;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Graphics {
    /// Width and height of a character in pixels.
    pub character: (u16, u16),
}

const CHARACTER_SIZES: std::ops::RangeInclusive<u16> = 3..=200;

impl Graphics {
    /// Returns the capabilities of a terminal whose driver reports this character size, if any.
    pub fn choose(answer: &Answer, character: Option<(u16, u16)>) -> Option<Self> {
        let is_sound = |(width, height): &(u16, u16)| {
            [width, height].iter().all(|n| CHARACTER_SIZES.contains(n))
        };
        let character = answer.character.or(character).filter(is_sound)?;
        answer.kitty.then_some(Self { character })
    }
}

/// Returns whether to query the terminal: not if it cannot show pictures, and not through tmux or
/// screen, which filter escape sequences, unless the user asks for pixels.
pub fn is_worth_asking(marker: Marker, variable: impl Fn(&str) -> Option<String>) -> bool {
    let term = variable("TERM").unwrap_or_default();
    let is_set = |name: &str| variable(name).is_some_and(|value| !value.is_empty());
    let within_another = is_set("TMUX")
        || is_set("STY")
        || ["screen", "tmux"].iter().any(|own| term.starts_with(own));
    obeys_escapes(Some(&term)) && term != "linux" && (!within_another || marker == Marker::Pixels)
}

/// A picture drawn in place of characters.
pub struct TerminalPicture {
    pub area: Rect,
    /// Columns of pixels: a whole number per character.
    pub columns: usize,
    /// Red, green and blue, row by row.
    pub pixels: Vec<[u8; 3]>,
}

/// How much of the pictures a frame redraws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Redraw {
    /// Everything that has changed.
    #[default]
    All,
    /// Moving parts, over a ground that may be a few seconds old.
    Moving,
    Nothing,
}

/// Sentinel style of the blank cells under a picture. No other blank has it, so ratatui writes to
/// these cells only once something replaces the picture.
const BLANK: Style = Style::new().fg(Color::Indexed(16));

impl TerminalPicture {
    pub fn reserve(area: Rect, buffer: &mut ratatui::buffer::Buffer) {
        for at in area.intersection(buffer.area).positions() {
            let cell = &mut buffer[at];
            cell.reset();
            cell.set_style(BLANK);
        }
    }

    /// Returns whether a cell is still reserved for a picture: nothing has been written over it.
    pub fn owns(cell: &Cell) -> bool {
        cell.symbol() == " " && Some(cell.fg) == BLANK.fg && cell.modifier.is_empty()
    }
}

/// The queries: whether it shows a kitty picture of one pixel, the size of a character and, last,
/// the device attributes, which every terminal reports.
pub const QUESTIONS: &[u8] = b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[16t\x1b[c";

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    /// It shows pictures as kitty does.
    pub kitty: bool,
    /// Width and height of a character in pixels.
    pub character: Option<(u16, u16)>,
    pub is_complete: bool,
}

impl Answer {
    /// Handles a reply of the terminal, if it belongs to the answer.
    pub fn take(&mut self, reply: &[u8]) {
        let Ok(text) = std::str::from_utf8(reply) else { return };
        if let Some(text) = text.strip_prefix("\x1b_Gi=31;") {
            self.kitty = text == "OK";
        } else if let Some(text) =
            text.strip_prefix("\x1b[6;").and_then(|text| text.strip_suffix('t'))
        {
            let numbers =
                text.split_once(';').map(|(height, width)| (width.parse(), height.parse()));
            if let Some((Ok(width), Ok(height))) = numbers {
                self.character = Some((width, height));
            }
        } else if text.starts_with("\x1b[?") && text.ends_with('c') {
            self.is_complete = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_terminals_answer_decides() {
        let answer = |kitty, character| Answer { kitty, character, ..Answer::default() };
        for (kitty, own, driver, expected) in [
            (true, Some((9, 18)), None, Some((9, 18))),
            (false, Some((9, 18)), None, None),
            (true, None, Some((8, 16)), Some((8, 16))),
            (true, None, Some((0, 16)), None),
            (true, None, None, None),
        ] {
            let chosen = Graphics::choose(&answer(kitty, own), driver);
            assert_eq!(chosen.map(|graphics| graphics.character), expected);
        }
    }

    #[test]
    fn terminals_within_others_are_asked_only_if_pixels_are_wanted() {
        let asks = |marker, term: &str, other: Option<&str>| {
            is_worth_asking(marker, |name| match name {
                "TERM" => Some(term.to_owned()),
                _ => (other == Some(name)).then(|| "1".to_owned()),
            })
        };
        assert!(asks(Marker::Auto, "xterm-256color", None));
        assert!(
            !asks(Marker::Auto, "tmux-256color", Some("TMUX"))
                && !asks(Marker::Auto, "xterm", Some("STY"))
        );
        assert!(asks(Marker::Pixels, "tmux-256color", Some("TMUX")));
        assert!(!asks(Marker::Pixels, "linux", None) && !asks(Marker::Pixels, "dumb", None));
    }

    #[test]
    fn answers_of_terminals_are_understood() {
        let answer = |replies: &[&[u8]]| {
            let mut answer = Answer::default();
            replies.iter().for_each(|reply| answer.take(reply));
            answer
        };
        let kitty = answer(&[b"\x1b_Gi=31;OK", b"\x1b[6;20;10t", b"\x1b[?62;c"]);
        assert!(kitty.kitty && kitty.is_complete);
        assert_eq!(kitty.character, Some((10, 20)));
        let xterm = answer(&[b"\x1b[6;13;6t", b"\x1b[?63;1;2;4;6;9;15;16;22;28c"]);
        assert!(!xterm.kitty && xterm.is_complete);
        assert_eq!(xterm.character, Some((6, 13)));
        let refused = answer(&[b"\x1b_Gi=31;ENOTSUPPORTED:no", b"\x1b[?64;1;44c"]);
        assert!(!refused.kitty && refused.is_complete);
        assert_eq!(
            answer(&[b"\x1b]11;rgb:0/0/0", b"\x1bP>|tmux", b"\x1b[>1;4;0c"]),
            Answer::default(),
            "of others"
        );
    }
}
