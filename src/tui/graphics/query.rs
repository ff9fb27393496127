//! Asks the terminal what it can show. What the user types meanwhile is kept.

use std::io::Write;
use std::time::{Duration, Instant};

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};

/// How long the terminal has to answer: this delays the first frame.
const TIMEOUT: Duration = Duration::from_millis(250);

/// How long an answer may still come after that.
const LATEST: Duration = Duration::from_secs(5);

/// The questions: whether it shows a kitty picture of one pixel, the size of a character, and its attributes, which every
/// terminal answers, after everything else.
const QUESTIONS: &[u8] = b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[16t\x1b[c";

/// What a terminal has answered.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    /// It shows pictures as kitty does.
    pub kitty: bool,
    /// It shows sixel pictures.
    pub sixel: bool,
    /// Width and height of a character in pixels.
    pub character: Option<(u16, u16)>,
    /// Whether nothing else will come.
    pub is_complete: bool,
    /// What is not part of the answer.
    pub typed: Vec<u8>,
}

impl Answer {
    /// Reads an answer, and what the user has typed before and within it.
    pub fn read(bytes: &[u8]) -> Self {
        let mut answer = Self::default();
        let mut rest = bytes;
        while let [first, after @ ..] = rest {
            if let Some(length) = sequence(rest) {
                let (own, after) = rest.split_at(length);
                if !answer.take(own) {
                    answer.typed.extend(own);
                }
                rest = after;
            } else {
                answer.typed.push(*first);
                rest = after;
            }
        }
        answer
    }

    /// Takes over a control sequence; returns whether it belongs to the answer.
    fn take(&mut self, sequence: &[u8]) -> bool {
        let Ok(text) = std::str::from_utf8(sequence) else { return false };
        if let Some(text) = text.strip_prefix("\x1b_Gi=31;") {
            self.kitty = text.starts_with("OK");
        } else if let Some(text) = text.strip_prefix("\x1b[6;").and_then(|text| text.strip_suffix('t')) {
            let numbers = text.split_once(';').map(|(height, width)| (width.parse(), height.parse()));
            if let Some((Ok(width), Ok(height))) = numbers {
                self.character = Some((width, height));
            }
        } else if let Some(text) = text.strip_prefix("\x1b[?").and_then(|text| text.strip_suffix('c')) {
            self.sixel = text.split(';').skip(1).any(|attribute| attribute == "4");
            self.is_complete = true;
        } else {
            return false;
        }
        true
    }

    /// Returns what the user has typed, as events.
    pub fn events(&self) -> Vec<Event> {
        let mut events = Vec::new();
        let mut rest = &*self.typed;
        while !rest.is_empty() {
            let length = sequence(rest).unwrap_or_else(|| character_length(rest));
            let (own, after) = rest.split_at(length);
            events.extend(key(own).map(Event::Key));
            rest = after;
        }
        events
    }
}

/// Returns the length of the control sequence at the start of `bytes`, if one begins there that is whole.
fn sequence(bytes: &[u8]) -> Option<usize> {
    match bytes {
        [0x1b, b'[', rest @ ..] => rest.iter().position(|byte| (0x40..=0x7e).contains(byte)).map(|at| at + 3),
        [0x1b, b'O', _, ..] => Some(3),
        [0x1b, b'_' | b'P' | b']', rest @ ..] => rest.windows(2).position(|end| end == b"\x1b\\").map(|at| at + 2 + 2),
        _ => None,
    }
}

/// Returns the number of bytes of the first character, or of what is none.
fn character_length(bytes: &[u8]) -> usize {
    let whole = bytes.utf8_chunks().next().and_then(|chunk| chunk.valid().chars().next());
    let length = whole.map_or(1, char::len_utf8);
    // A key pressed with Alt.
    if bytes[0] == 0x1b && bytes.len() > 1 { 1 + character_length(&bytes[1..]) } else { length }
}

/// Returns the key that sends `bytes`.
fn key(bytes: &[u8]) -> Option<KeyEvent> {
    let plain = |code| Some(KeyEvent::new(code, KeyModifiers::NONE));
    match bytes {
        [0x1b, b'[' | b'O', b'A'] => plain(KeyCode::Up),
        [0x1b, b'[' | b'O', b'B'] => plain(KeyCode::Down),
        [0x1b, b'[' | b'O', b'C'] => plain(KeyCode::Right),
        [0x1b, b'[' | b'O', b'D'] => plain(KeyCode::Left),
        [0x1b] => plain(KeyCode::Esc),
        [0x1b, b'[' | b'O' | b'_' | b'P' | b']', ..] => None,
        [0x1b, rest @ ..] => key(rest).map(|key| KeyEvent { modifiers: key.modifiers | KeyModifiers::ALT, ..key }),
        [b'\r' | b'\n'] => plain(KeyCode::Enter),
        [b'\t'] => plain(KeyCode::Tab),
        [0x7f | 0x08] => plain(KeyCode::Backspace),
        [control @ 1..=26] => Some(KeyEvent::new(KeyCode::Char(char::from(control + b'a' - 1)), KeyModifiers::CONTROL)),
        _ => {
            let character = std::str::from_utf8(bytes).ok()?.chars().next().filter(|c| !c.is_control())?;
            let shift = if character.is_uppercase() { KeyModifiers::SHIFT } else { KeyModifiers::NONE };
            Some(KeyEvent::new(KeyCode::Char(character), shift))
        }
    }
}

/// Asks the terminal, which is in raw mode.
#[cfg(unix)]
pub fn ask(to: &mut impl Write) -> std::io::Result<Answer> {
    use std::io::{IsTerminal, stdin};
    use std::os::fd::{AsFd, BorrowedFd};

    let terminal;
    let input = stdin();
    // As the event source does.
    let from: BorrowedFd = if input.is_terminal() {
        input.as_fd()
    } else {
        terminal = std::fs::File::open("/dev/tty")?;
        terminal.as_fd()
    };
    to.write_all(QUESTIONS)?;
    to.flush()?;
    let end = Instant::now() + TIMEOUT;
    let mut bytes = Vec::new();
    loop {
        let answer = Answer::read(&bytes);
        if answer.is_complete || !has_input(from, end)? {
            return Ok(answer);
        }
        let mut more = [0; 1024];
        let count = nix::unistd::read(from, &mut more)?;
        if count == 0 {
            return Ok(answer);
        }
        bytes.extend(&more[..count]);
    }
}

/// Waits for input until `end`.
#[cfg(unix)]
fn has_input(from: std::os::fd::BorrowedFd, end: Instant) -> std::io::Result<bool> {
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

    loop {
        let left = end.saturating_duration_since(Instant::now());
        let timeout = PollTimeout::try_from(left).unwrap_or(PollTimeout::ZERO);
        match poll(&mut [PollFd::new(from, PollFlags::POLLIN)], timeout) {
            // A signal, which the event loop will handle. Reading now could wait for a key.
            Err(nix::errno::Errno::EINTR) if !left.is_zero() => {}
            Err(nix::errno::Errno::EINTR) => return Ok(false),
            ready => return Ok(ready? > 0),
        }
    }
}

/// Asks nothing: this platform has no way to read the answer.
#[cfg(not(unix))]
pub fn ask(_: &mut impl Write) -> std::io::Result<Answer> {
    Ok(Answer { is_complete: true, ..Answer::default() })
}

/// Recognises an answer that comes late, and would otherwise be taken for keys: the event source reports the sequence
/// `ESC _ text ESC \` as Alt-_, the letters of the text, and Alt-\.
#[derive(Debug, Default)]
pub struct LateAnswer {
    until: Option<Instant>,
    within: bool,
}

impl LateAnswer {
    /// Expects the rest of `answer`, if there is more.
    pub fn after(answer: &Answer) -> Self {
        Self { until: (!answer.is_complete).then(|| Instant::now() + LATEST), within: false }
    }

    /// Returns whether an event is part of the answer.
    pub fn has(&mut self, event: &Event) -> bool {
        let (Some(until), Event::Key(key)) = (self.until, event) else { return false };
        if Instant::now() > until {
            *self = Self::default();
            return false;
        }
        let is = |character| key.code == KeyCode::Char(character) && key.modifiers.contains(KeyModifiers::ALT);
        let own = self.within || is('_');
        self.within = own && !is('\\');
        own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(answer: &Answer) -> Vec<(KeyCode, KeyModifiers)> {
        let key = |event: &Event| event.as_key_event().map(|key| (key.code, key.modifiers));
        answer.events().iter().filter_map(key).collect()
    }

    #[test]
    fn answers_of_terminals_are_understood() {
        let kitty = Answer::read(b"\x1b_Gi=31;OK\x1b\\\x1b[6;20;10t\x1b[?62;c");
        assert!(kitty.kitty && !kitty.sixel && kitty.is_complete);
        assert_eq!(kitty.character, Some((10, 20)));
        let xterm = Answer::read(b"\x1b[6;13;6t\x1b[?63;1;2;4;6;9;15;16;22;28c");
        assert!(!xterm.kitty && xterm.sixel && xterm.is_complete);
        assert_eq!(xterm.character, Some((6, 13)));
        let refused = Answer::read(b"\x1b_Gi=31;ENOTSUPPORTED:no\x1b\\\x1b[?64;1;44c");
        assert_eq!((refused.kitty, refused.sixel, refused.is_complete), (false, false, true), "44 is not 4");
        for part in [&b""[..], b"\x1b", b"\x1b[?62;4", b"\x1b_Gi=31;OK"] {
            assert!(!Answer::read(part).is_complete, "{part:?}");
        }
        assert!(!Answer::read(b"\x1b[?4c").sixel, "the first number is the kind of terminal");
    }

    #[test]
    fn keys_typed_meanwhile_are_kept() {
        let answer =
            Answer::read("f\x1b[A\x1b_Gi=31;OK\x1b\\ \u{e9}\x1b[6;20;10tQ\x1bx\x1b[?62;4c\r\x03\x1b".as_bytes());
        assert!(answer.kitty && answer.sixel);
        let none = KeyModifiers::NONE;
        let expected = [
            (KeyCode::Char('f'), none),
            (KeyCode::Up, none),
            (KeyCode::Char(' '), none),
            (KeyCode::Char('\u{e9}'), none),
            (KeyCode::Char('Q'), KeyModifiers::SHIFT),
            (KeyCode::Char('x'), KeyModifiers::ALT),
            (KeyCode::Enter, none),
            (KeyCode::Char('c'), KeyModifiers::CONTROL),
            (KeyCode::Esc, none),
        ];
        assert_eq!(keys(&answer), expected);
        assert_eq!(keys(&Answer::read(b"\x1b[<0;3;4M\xff\xfe")), [], "nothing that is no key");
    }

    #[test]
    fn an_answer_that_comes_late_is_not_taken_for_keys() {
        let mut late = LateAnswer::after(&Answer::default());
        let mut has = |character, modifiers| late.has(&Event::Key(KeyEvent::new(KeyCode::Char(character), modifiers)));
        let (none, alt) = (KeyModifiers::NONE, KeyModifiers::ALT);
        assert!(!has('q', none), "typed before");
        assert!(has('_', alt) && has('G', none) && has('q', none) && has('\\', alt));
        assert!(!has('q', none), "typed after");
        let mut complete = LateAnswer::after(&Answer { is_complete: true, ..Answer::default() });
        assert!(!complete.has(&Event::Key(KeyEvent::new(KeyCode::Char('_'), alt))));
    }
}
