//! Pictures in the terminal: which protocol it understands, and what is on its screen.
//!
//! The crate `ratatui-image` does not fit pictures that change all the time. It quantises every
//! sixel picture anew (28 ms for the map on a screen of 200 x 60 characters, 48 ms with its
//! dithering, in colours that differ from frame to frame), sends all of a picture whenever a part
//! changes, never deletes one, and its query leaves a thread behind that swallows keys if a
//! terminal does not answer. So the three protocols are written here: only patches that have
//! changed are sent.
//!
//! * `query`: asks the terminal.
//! * `patches`: what is on the screen, and what has to be sent.
//! * `encode`, `sixel`: patches as bytes.

pub mod encode;
pub mod patches;
pub mod query;
mod sixel;

use ratatui::buffer::Cell;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use tiny_skia::Pixmap;

use crate::tui::marker::Marker;
use gdg::text::obeys_escapes;
use query::Answer;

/// How a terminal is sent pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protocol {
    /// The one of kitty, also understood by Ghostty, Konsole and WezTerm.
    Kitty,
    /// The one of iTerm2.
    Iterm2,
    /// DEC's: in xterm, foot, mlterm, Windows Terminal and others.
    Sixel,
}

/// What a terminal can show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Graphics {
    /// How it is sent pictures.
    pub protocol: Protocol,
    /// Width and height of a character in pixels.
    pub character: (u16, u16),
}

/// Sizes of a character that are believed, in pixels.
const CHARACTER_SIZES: std::ops::RangeInclusive<u16> = 3..=200;

impl Graphics {
    /// Returns what a terminal can show by its answer; `name` is what it calls itself in the
    /// environment, and `character` the size of a character that its driver reports, if that is
    /// known.
    pub fn choose(answer: &Answer, name: &str, character: Option<(u16, u16)>) -> Option<Self> {
        let is_iterm2 = ["iTerm", "mintty"].iter().any(|own| name.contains(own));
        let protocol = match answer {
            Answer { kitty: true, .. } => Protocol::Kitty,
            _ if is_iterm2 => Protocol::Iterm2,
            Answer { sixel: true, .. } => Protocol::Sixel,
            _ => return None,
        };
        let is_sound = |(width, height): &(u16, u16)| {
            [width, height].iter().all(|n| CHARACTER_SIZES.contains(n))
        };
        let character = answer.character.or(character).filter(is_sound)?;
        Some(Self { protocol, character })
    }
}

/// Returns whether to ask the terminal what it can show: not those in which nobody sees a picture,
/// or which pass on only a part of what they are sent, unless the user wants pixels.
pub fn is_worth_asking(marker: Marker, variable: impl Fn(&str) -> Option<String>) -> bool {
    let term = variable("TERM").unwrap_or_default();
    let is_set = |name: &str| variable(name).is_some_and(|value| !value.is_empty());
    let within_another = is_set("TMUX")
        || is_set("STY")
        || ["screen", "tmux"].iter().any(|own| term.starts_with(own));
    obeys_escapes(Some(&term)) && term != "linux" && (!within_another || marker == Marker::Pixels)
}

/// A picture in the place of characters.
pub struct Picture {
    /// The characters it covers.
    pub area: Rect,
    /// Its pixels, all opaque: a whole number for each character.
    pub pixmap: Pixmap,
}

/// How much of the pictures a frame draws again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Redraw {
    /// All that has changed.
    #[default]
    All,
    /// What moves, on a ground that may be some seconds old.
    Moving,
    /// Nothing.
    Nothing,
}

/// Sentinel style of the characters reserved for a picture. Nothing else gives blanks this colour, so
/// ratatui writes whatever replaces them, and nothing while the picture stays.
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

    /// Returns whether a character is still reserved for a picture: nothing has been written over
    /// it.
    pub fn owns(cell: &Cell) -> bool {
        cell.symbol() == " " && Some(cell.fg) == BLANK.fg && cell.modifier.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_terminals_answer_decides() {
        let answer =
            |kitty, sixel| Answer { kitty, sixel, character: Some((9, 18)), ..Answer::default() };
        let protocol =
            |answer: &Answer, name: &str| Graphics::choose(answer, name, None).map(|g| g.protocol);
        assert_eq!(protocol(&answer(true, true), "xterm"), Some(Protocol::Kitty));
        assert_eq!(protocol(&answer(false, true), "xterm"), Some(Protocol::Sixel));
        assert_eq!(protocol(&answer(false, true), "iTerm.app"), Some(Protocol::Iterm2));
        assert_eq!(protocol(&answer(false, false), "xterm"), None);
        assert_eq!(
            protocol(&Answer::default(), "iTerm.app"),
            None,
            "the size of a character is not known"
        );
        let unsized_answer = Answer { character: None, ..answer(false, true) };
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
