//! Splits terminal input into keys, mouse events, pastes and replies.
//!
//! Terminals send replies, also to the queries of other programs, in the same stream as keys.
//! Control strings (OSC, DCS, APC, PM, SOS) and control sequences that are not keys are replies,
//! however reads split them. Keys with Alt begin the same way (Alt-] and OSC are both `ESC ]`), so
//! what follows decides, and how soon.
//!
//! `sequence` parses bytes; `report` turns them into keys and pastes.

mod report;
mod sequence;
#[cfg(test)]
mod tests;

use std::time::Duration;

use crossterm::event::Event;

use sequence::{event_of, is_introducer, is_reply, is_ss3_key};

/// Input from a terminal.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// A key, a mouse event or a paste.
    Event(Event),
    /// The reply to a query: a control sequence, or a control string without its terminator, with a
    /// 7-bit introducer.
    Reply(Vec<u8>),
}

/// Timeout for the rest of a sequence after ESC alone, which may be the key Esc.
const AFTER_ESCAPE: Duration = Duration::from_millis(150);

/// Timeout after ESC and one character, which may be a key with Alt.
const AFTER_INTRODUCER: Duration = Duration::from_millis(250);

/// Timeout within a longer sequence, and so how long keys do nothing after one that never ends.
const WITHIN: Duration = Duration::from_secs(1);

/// How long a reported Esc, or key with Alt, may still turn out to be the start of a sequence.
const REGRET: Duration = Duration::from_secs(2);

/// Bytes in one read, more than a key has, that count as the rest of such a sequence.
const BURST: usize = 4;

/// Maximum bytes kept of a sequence, and of a paste.
const LONGEST_SEQUENCE: usize = 4096;
const LONGEST_PASTE: usize = 1 << 16;

/// Ends a paste.
const PASTE_END: &[u8] = b"\x1b[201~";

/// The state of the scanner: what has been read so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    /// Nothing.
    #[default]
    Ground,
    /// The first bytes of a character of this length.
    Character(usize),
    /// ESC.
    Escape,
    /// ESC, reported as the key Esc; a sequence may follow.
    EscapeReported,
    /// ESC and an introducer.
    Introducer,
    /// ESC and an introducer, reported as keys; a sequence may follow.
    IntroducerReported,
    /// A control sequence without its final character.
    Sequence,
    /// A control sequence's final character, which this many bytes follow.
    Operands(usize),
    /// A control string whose latest character lacks this many bytes.
    Text(usize),
    /// A control string, and ESC.
    TextEscape,
    /// A paste, with this many bytes of its end.
    Paste(usize),
}

/// How ESC arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Escape {
    /// Together with what follows it.
    #[default]
    Together,
    /// As the last byte of a read, so not as part of a key with Alt.
    Apart,
    /// It has been reported.
    Reported,
}

/// A scanner of terminal input.
#[derive(Debug, Default)]
pub struct Scanner {
    state: State,
    escape: Escape,
    /// The bytes of the sequence, string, character or paste.
    held: Vec<u8>,
    found: Vec<Input>,
}

impl Scanner {
    /// Reads `bytes`, all that has arrived, and returns what they complete.
    pub fn read(&mut self, bytes: &[u8]) -> Vec<Input> {
        self.regret(bytes);
        bytes.iter().for_each(|byte| self.advance(*byte));
        if self.state == State::Escape {
            self.escape = Escape::Apart;
        }
        std::mem::take(&mut self.found)
    }

    /// Returns how long to wait for more before [`Self::give_up`]; `None` if nothing is incomplete.
    pub fn patience(&self) -> Option<Duration> {
        match self.state {
            State::Ground => None,
            State::Introducer if self.escape == Escape::Together => Some(AFTER_INTRODUCER),
            State::Escape | State::Introducer => Some(AFTER_ESCAPE),
            State::EscapeReported | State::IntroducerReported => Some(REGRET),
            _ => Some(WITHIN),
        }
    }

    /// Handles a timeout: reports incomplete input as keys or a paste, or drops it.
    pub fn give_up(&mut self) -> Vec<Input> {
        self.state = match self.state {
            State::Escape => {
                self.report_escape();
                State::EscapeReported
            }
            State::Introducer => {
                self.report_introducer();
                // No reply begins with SS3, and what comes long after ESC is a separate key.
                let may_go_on = self.held[1] != b'O' && self.escape == Escape::Together;
                if may_go_on { State::IntroducerReported } else { State::Ground }
            }
            State::Paste(_) => {
                self.report_paste(0);
                State::Ground
            }
            _ => State::Ground,
        };
        std::mem::take(&mut self.found)
    }

    /// Resumes a sequence that was reported as keys, if `bytes` look like its rest.
    fn regret(&mut self, bytes: &[u8]) {
        match (self.state, bytes) {
            (State::EscapeReported, [first, ..])
                if is_introducer(*first) && (*first != b'O' || is_ss3_key(bytes)) =>
            {
                self.state = State::Escape;
                self.escape = Escape::Reported;
            }
            (State::IntroducerReported, [first, ..]) if *first >= b' ' && bytes.len() >= BURST => {
                self.state = State::Introducer;
            }
            (State::EscapeReported | State::IntroducerReported, _) => self.state = State::Ground,
            _ => {}
        }
    }

    /// Reads a byte.
    fn advance(&mut self, byte: u8) {
        match self.state {
            State::Ground | State::EscapeReported | State::IntroducerReported => self.begin(byte),
            State::Character(length) => self.continue_character(byte, length),
            State::Escape => self.after_escape(byte),
            State::Introducer => self.after_introducer(byte),
            State::Sequence => self.continue_sequence(byte),
            State::Operands(left) => {
                self.hold(byte);
                self.state = State::Operands(left - 1);
                if left == 1 {
                    self.end_sequence();
                }
            }
            State::Text(missing) => self.continue_text(byte, missing),
            State::TextEscape if byte == b'\\' => self.end_text(),
            State::TextEscape => {
                // The string is cut short by another sequence.
                self.begin(0x1b);
                self.advance(byte);
            }
            State::Paste(matched) => self.continue_paste(byte, matched),
        }
    }

    /// Reads the first byte of a key or sequence.
    fn begin(&mut self, byte: u8) {
        self.held = vec![byte];
        self.state = State::Ground;
        match byte {
            0x1b => (self.state, self.escape) = (State::Escape, Escape::Together),
            0x80..=0x9f => self.control(byte),
            0xc2..=0xdf => self.state = State::Character(2),
            0xe0..=0xef => self.state = State::Character(3),
            0xf0..=0xf4 => self.state = State::Character(4),
            0xa0.. => {}
            _ => self.report_held(),
        }
    }

    /// Reads an 8-bit control character, which stands for two 7-bit ones.
    fn control(&mut self, byte: u8) {
        let second = byte - 0x40;
        self.held = vec![0x1b, second];
        if is_introducer(second) {
            self.escape = Escape::Together;
            self.introduce(second);
        } else {
            self.state = State::Ground;
        }
    }

    /// Reads another byte of a character of `length` bytes, which may follow ESC.
    fn continue_character(&mut self, byte: u8, length: usize) {
        if !(0x80..=0xbf).contains(&byte) {
            return self.begin(byte);
        }
        self.held.push(byte);
        let start = usize::from(self.held[0] == 0x1b);
        if self.held.len() - start < length {
            return;
        }
        self.state = State::Ground;
        match &self.held[start..] {
            [0xc2, control @ 0x80..=0x9f] => self.control(*control),
            _ => self.report_held(),
        }
    }

    /// Reads what follows ESC.
    fn after_escape(&mut self, byte: u8) {
        if is_introducer(byte) {
            self.held = vec![0x1b, byte];
            self.state = State::Introducer;
        } else if self.escape != Escape::Together || matches!(byte, 0x1b | 0x80..=0x9f) {
            // Two keys.
            self.report_escape();
            self.begin(byte);
        } else if byte.is_ascii() {
            self.held = vec![0x1b, byte];
            self.state = State::Ground;
            self.report_held();
        } else {
            self.begin(byte);
            self.held.insert(0, 0x1b);
        }
    }

    /// Reads what follows ESC and an introducer.
    fn after_introducer(&mut self, byte: u8) {
        let introducer = self.held[1];
        let goes_on = match introducer {
            b'O' if self.escape == Escape::Together => byte.is_ascii_alphanumeric(),
            b'O' => is_ss3_key(&[b'O', byte]),
            b'[' => byte >= b' ',
            _ => byte >= b' ' || matches!(byte, 0x07 | 0x1b),
        };
        if goes_on {
            self.introduce(introducer);
            self.advance(byte);
        } else {
            self.report_introducer();
            self.begin(byte);
        }
    }

    /// Begins the sequence or string that `introducer` introduces.
    fn introduce(&mut self, introducer: u8) {
        self.state = match introducer {
            b'O' => State::Operands(1),
            b'[' => State::Sequence,
            _ => State::Text(0),
        };
    }

    /// Reads a byte of a control sequence.
    fn continue_sequence(&mut self, byte: u8) {
        match byte {
            b'[' if self.held.len() == 2 => {
                // A function key of the Linux console.
                self.hold(byte);
                self.state = State::Operands(1);
            }
            b'M' if self.held.len() == 2 => {
                // A mouse event in X10 format.
                self.hold(byte);
                self.state = State::Operands(3);
            }
            0x40..=0x7e => {
                self.hold(byte);
                self.end_sequence();
            }
            0x20..=0x3f => self.hold(byte),
            _ => self.begin(byte),
        }
    }

    /// Reports a control sequence.
    fn end_sequence(&mut self) {
        self.state = State::Ground;
        let is_whole = self.held.len() < LONGEST_SEQUENCE;
        if self.held == b"\x1b[200~" {
            self.held.clear();
            self.state = State::Paste(0);
        } else if is_whole
            && !is_reply(&self.held)
            && let Some(event) = event_of(&self.held)
        {
            self.found.push(Input::Event(event));
        } else {
            self.found.push(Input::Reply(std::mem::take(&mut self.held)));
        }
    }

    /// Reads a byte of a control string, which lacks `missing` bytes of its latest character.
    fn continue_text(&mut self, byte: u8, missing: usize) {
        let missing = match byte {
            0x07 => return self.end_text(),
            // Also when encoded as UTF-8.
            0x9c if missing == 0 || self.held.ends_with(&[0xc2]) => return self.end_text(),
            0x1b => return self.state = State::TextEscape,
            // No string contains these: they are keys, and the string will not end.
            0x00..=0x08 | 0x0e..=0x1f => return self.begin(byte),
            0x80..=0xbf => missing.saturating_sub(1),
            0xc2..=0xdf => 1,
            0xe0..=0xef => 2,
            0xf0..=0xf4 => 3,
            _ => 0,
        };
        self.hold(byte);
        self.state = State::Text(missing);
    }

    /// Reports a control string.
    fn end_text(&mut self) {
        self.state = State::Ground;
        self.found.push(Input::Reply(std::mem::take(&mut self.held)));
    }

    /// Reads a byte of a paste.
    fn continue_paste(&mut self, byte: u8, matched: usize) {
        if self.held.len() < LONGEST_PASTE + PASTE_END.len() {
            self.held.push(byte);
        }
        let matched = match byte {
            _ if byte == PASTE_END[matched] => matched + 1,
            0x1b => 1,
            _ => 0,
        };
        self.state = State::Paste(matched);
        if matched == PASTE_END.len() {
            self.report_paste(matched);
            self.state = State::Ground;
        }
    }

    /// Keeps a byte, if there is room.
    fn hold(&mut self, byte: u8) {
        if self.held.len() < LONGEST_SEQUENCE {
            self.held.push(byte);
        }
    }
}
