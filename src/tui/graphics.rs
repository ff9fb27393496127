//! Pictures in the terminal: the protocol it supports, and what it currently shows.
//!
//! `ratatui-image` does not suit pictures that change constantly. It resends the whole picture when
//! a part changes, never deletes one, and its query leaves a thread behind that swallows keys if the
//! terminal does not answer. So the two protocols are implemented here, and only changed patches
//! are sent.
//!
//! * `query`: the capability query.
//! * `patches`: tracks what is on the screen and what to send.
//! * `encode`: encodes patches.

pub mod encode;
pub mod patches;
pub mod query;

use ratatui::buffer::Cell;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};

use crate::tui::marker::Marker;
use gdg::text::obeys_escapes;
use query::Answer;

/// A graphics protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// kitty's, also supported by Ghostty, Konsole and WezTerm.
    Kitty,
    /// iTerm2's.
    Iterm2,
}

/// A terminal's graphics capabilities.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Graphics {
    pub protocol: Protocol,
    /// Width and height of a character in pixels.
    pub character: (u16, u16),
}

/// Plausible sizes of a character, in pixels.
const CHARACTER_SIZES: std::ops::RangeInclusive<u16> = 3..=200;

impl Graphics {
    /// Returns the capabilities that `answer` implies. `name` is the terminal's name in the
    /// environment, `character` the character size that its driver reports, if known.
    pub fn choose(answer: &Answer, name: &str, character: Option<(u16, u16)>) -> Option<Self> {
        let is_iterm2 = ["iTerm", "mintty"].iter().any(|own| name.contains(own));
        let protocol = match answer {
            Answer { kitty: true, .. } => Protocol::Kitty,
            _ if is_iterm2 => Protocol::Iterm2,
            _ => return None,
        };
        let is_sound = |(width, height): &(u16, u16)| {
            [width, height].iter().all(|n| CHARACTER_SIZES.contains(n))
        };
        let character = answer.character.or(character).filter(is_sound)?;
        Some(Self { protocol, character })
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
pub struct Picture {
    /// The characters it covers.
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

impl Picture {
    /// Reserves the picture's characters.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_terminals_answer_decides() {
        let answer = |kitty| Answer { kitty, character: Some((9, 18)), ..Answer::default() };
        let protocol =
            |answer: &Answer, name: &str| Graphics::choose(answer, name, None).map(|g| g.protocol);
        assert_eq!(protocol(&answer(true), "xterm"), Some(Protocol::Kitty));
        assert_eq!(protocol(&answer(false), "iTerm.app"), Some(Protocol::Iterm2));
        assert_eq!(protocol(&answer(false), "xterm"), None);
        assert_eq!(
            protocol(&Answer::default(), "iTerm.app"),
            None,
            "the size of a character is not known"
        );
        let unsized_answer = Answer { character: None, ..answer(true) };
        assert_eq!(
            Graphics::choose(&unsized_answer, "", Some((8, 16))).map(|g| g.character),
            Some((8, 16))
        );
        assert_eq!(Graphics::choose(&unsized_answer, "", Some((0, 16))), None);
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
}
