//! Splits what comes from a terminal into keys, mouse events, pastes and replies.
//!
//! Terminals answer questions, those of other programs too, on the line that keys come from.
//! Control strings (OSC, DCS, APC, PM, SOS) and control sequences that are no key are replies,
//! however they are cut into reads. A key with Alt begins as they do (Alt-] and OSC are both `ESC
//! ]`): what follows decides, and when.

use std::time::Duration;

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};

/// What a terminal sends.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// What the user does.
    Event(Event),
    /// A control sequence, or a control string without its end, with introducers of 7 bits: an
    /// answer to a question.
    Reply(Vec<u8>),
}

/// How long the rest of a sequence may take after ESC alone, which may be the key Esc, ...
const AFTER_ESCAPE: Duration = Duration::from_millis(150);

/// ... after ESC and one character, which may be a key with Alt, ...
const AFTER_INTRODUCER: Duration = Duration::from_millis(250);

/// ... and after more than that. This is also how long keys do nothing after a sequence that never
/// ends.
const WITHIN: Duration = Duration::from_secs(1);

/// How long what has been taken for Esc, or a key with Alt, may turn out to have begun a sequence.
const REGRET: Duration = Duration::from_secs(2);

/// What arrives at once after that, and is longer than keys are, is the rest of a sequence.
const BURST: usize = 4;

/// Bytes of a sequence, and of a paste, that are kept.
const LONGEST_SEQUENCE: usize = 4096;
const LONGEST_PASTE: usize = 1 << 16;

/// What follows SS3 in the keys of terminals.
const SS3_KEYS: &[u8] = b"ABCDFHPQRS";

/// Ends a paste.
const PASTE_END: &[u8] = b"\x1b[201~";

/// What has been read so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    /// Nothing.
    #[default]
    Ground,
    /// The first bytes of a character of so many.
    Character(usize),
    /// ESC.
    Escape,
    /// The key Esc has been reported; a sequence may go on.
    EscapeReported,
    /// ESC and what introduces a sequence.
    Introducer,
    /// That has been reported as keys; a sequence may go on.
    IntroducerReported,
    /// A control sequence without its final character.
    Sequence,
    /// A control sequence's final character, and so many bytes that follow it.
    Operands(usize),
    /// A control string; so many bytes of its latest character are missing.
    Text(usize),
    /// A control string, and ESC.
    TextEscape,
    /// A paste, with so many bytes of its end.
    Paste(usize),
}

/// How ESC came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Escape {
    /// Together with what follows it.
    #[default]
    Together,
    /// As the last byte of a read: a key with Alt is sent as a whole.
    Apart,
    /// It has been reported.
    Reported,
}

/// Reads what comes from a terminal.
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

    /// Takes what is incomplete for keys, a paste, or nothing: the rest has not come in time.
    pub fn give_up(&mut self) -> Vec<Input> {
        self.state = match self.state {
            State::Escape => {
                self.report_escape();
                State::EscapeReported
            }
            State::Introducer => {
                self.report_introducer();
                // No reply begins with SS3, and what came long after ESC is a key of its own.
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

    /// Returns to a sequence that has been taken for keys, if `bytes` look like its rest.
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

    /// Reads the first byte of something.
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

    /// Reads a control character of 8 bits, which stands for two of 7.
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
            b'O' => SS3_KEYS.contains(&byte),
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
                // A mouse event of the oldest kind.
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
            // As an encoded character, too.
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

    /// Reports the key that sends what is held.
    fn report_held(&mut self) {
        self.found.extend(event_of(&self.held).map(Input::Event));
    }

    /// Reports the key Esc, unless it has been.
    fn report_escape(&mut self) {
        if self.escape != Escape::Reported {
            self.report_key(KeyCode::Esc, KeyModifiers::NONE);
        }
    }

    /// Reports ESC and an introducer as the keys that they are: one with Alt, or two.
    fn report_introducer(&mut self) {
        let character = char::from(self.held[1]);
        let shift = if character.is_uppercase() { KeyModifiers::SHIFT } else { KeyModifiers::NONE };
        let alt =
            if self.escape == Escape::Together { KeyModifiers::ALT } else { KeyModifiers::NONE };
        if self.escape == Escape::Apart {
            self.report_escape();
        }
        self.report_key(KeyCode::Char(character), shift | alt);
    }

    /// Reports a key.
    fn report_key(&mut self, code: KeyCode, modifiers: KeyModifiers) {
        self.found.push(Input::Event(Event::Key(KeyEvent::new(code, modifiers))));
    }

    /// Reports a paste, without the last bytes.
    fn report_paste(&mut self, without: usize) {
        self.held.truncate(self.held.len().saturating_sub(without).min(LONGEST_PASTE));
        let text = String::from_utf8_lossy(&self.held).into_owned();
        self.held = Vec::new();
        self.found.push(Input::Event(Event::Paste(text)));
    }
}

/// Returns whether ESC and this character begin a sequence: SS3, CSI, OSC, DCS, APC, PM or SOS.
fn is_introducer(byte: u8) -> bool {
    b"O[]P_^X".contains(&byte)
}

/// Returns whether these bytes are the rest of a key that begins with SS3.
fn is_ss3_key(rest: &[u8]) -> bool {
    matches!(rest, [b'O', last] if SS3_KEYS.contains(last))
}

/// Returns whether a control sequence that looks like a key, or the mouse, is neither: the cursor's
/// position, and positions off the screen.
fn is_reply(sequence: &[u8]) -> bool {
    let mut numbers =
        sequence.split(|byte| !byte.is_ascii_digit()).filter(|number| !number.is_empty()).skip(1);
    match sequence {
        [.., b'R'] => numbers.next().is_some(),
        [.., b'M' | b'm'] => numbers.any(|number| number.iter().all(|digit| *digit == b'0')),
        _ => false,
    }
}

/// Returns the event that `bytes` mean, if any.
fn event_of(bytes: &[u8]) -> Option<Event> {
    let event = terminput::Event::parse_from(bytes).ok()??;
    terminput_crossterm::to_crossterm(event).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: KeyModifiers = KeyModifiers::NONE;
    const ALT: KeyModifiers = KeyModifiers::ALT;

    /// Replies of terminals to questions of any program.
    const REPLIES: [&[u8]; 26] = [
        b"\x1b]11;rgb:1e1e/1e1e/2e2e\x1b\\",
        b"\x1b]11;rgb:1e1e/1e1e/2e2e\x07",
        b"\x9d11;rgb:1e1e/1e1e/2e2e\x9c",
        "\u{9d}4;1;rgb:ff/00/00\u{9c}".as_bytes(),
        "\x1b]lein gr\u{f6}\u{df}er Titel \u{dc}\u{715c}\x1b\\".as_bytes(),
        b"\x1b]52;c;cXVpdA==\x1b\\",
        b"\x1bP>|tmux 3.4\x1b\\",
        b"\x1bP>|foot(1.2)\x9c",
        b"\x90>|foot(1.2)\x9c",
        b"\x1bP1$r0m\x1b\\",
        b"\x1bP1+r544e=787465726d\x1b\\",
        b"\x1bP!|00000000\x1b\\",
        b"\x1b_Gi=31;OK\x1b\\",
        b"\x9fGi=31;OK\x9c",
        b"\x1b^private q\x1b\\",
        b"\x1bXstring q\x1b\\",
        b"\x1b[>1;10;0c",
        b"\x9b>1;10;0c",
        b"\x1b[?62;4c",
        b"\x1b[6;20;10t",
        b"\x1b[?2026;1$y",
        b"\x1b[?1u",
        b"\x1b[12;40R",
        b"\x1b[0n",
        b"\x1b[?997;1n",
        b"\x1b[=5;q",
    ];

    fn keys(found: &[Input]) -> Vec<(KeyCode, KeyModifiers)> {
        let key = |input: &Input| match input {
            Input::Event(Event::Key(key)) => Some((key.code, key.modifiers)),
            _ => None,
        };
        found.iter().filter_map(key).collect()
    }

    fn read(parts: &[&[u8]]) -> Vec<Input> {
        let mut scanner = Scanner::default();
        parts.iter().flat_map(|part| scanner.read(part)).collect()
    }

    fn character(c: char, modifiers: KeyModifiers) -> (KeyCode, KeyModifiers) {
        (KeyCode::Char(c), modifiers)
    }

    #[test]
    fn replies_are_never_keys_however_they_are_cut() {
        for reply in REPLIES {
            let shown = String::from_utf8_lossy(reply);
            assert!(keys(&read(&[reply])).is_empty(), "{shown:?}");
            let mut scanner = Scanner::default();
            let mut one_by_one: Vec<Input> =
                reply.iter().flat_map(|byte| scanner.read(&[*byte])).collect();
            assert_eq!(scanner.patience(), None, "{shown:?} is at its end");
            one_by_one.extend(scanner.read(b"q"));
            assert_eq!(keys(&one_by_one), [character('q', NONE)], "{shown:?}");
            for at in 1..reply.len() {
                let (first, second) = reply.split_at(at);
                assert_eq!(
                    keys(&read(&[first, second, b"q"])),
                    [character('q', NONE)],
                    "{shown:?} at {at}"
                );
            }
        }
    }

    #[test]
    fn a_reply_whose_beginning_was_taken_for_a_key_is_recognised() {
        for reply in REPLIES.iter().filter(|reply| reply[0] == 0x1b) {
            for at in (1..3).filter(|at| *at == 1 || reply.len() - at >= BURST) {
                let mut scanner = Scanner::default();
                let (first, second) = reply.split_at(at);
                assert!(
                    scanner.read(first).is_empty() && scanner.give_up().len() == 1,
                    "Esc, or a key with Alt"
                );
                let mut found = scanner.read(second);
                found.extend(scanner.read(b"q"));
                assert_eq!(
                    keys(&found),
                    [character('q', NONE)],
                    "{:?} at {at}",
                    String::from_utf8_lossy(reply)
                );
            }
        }
    }

    #[test]
    fn keys_with_alt_and_escape_still_work() {
        for key in ['_', 'P', ']', '^', 'X', 'O', '['] {
            let shift = if key.is_uppercase() { KeyModifiers::SHIFT } else { NONE };
            let mut scanner = Scanner::default();
            assert!(
                scanner.read(format!("\x1b{key}").as_bytes()).is_empty()
                    && scanner.patience().is_some()
            );
            assert_eq!(keys(&scanner.give_up()), [character(key, ALT | shift)]);
            assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)], "then {key}");
        }
        assert_eq!(
            keys(&read(&[b"\x1bx", "\x1b\u{e9}".as_bytes(), b"\x1b\r"])),
            [character('x', ALT), character('\u{e9}', ALT), (KeyCode::Enter, ALT)]
        );
        let escape = (KeyCode::Esc, NONE);
        assert_eq!(keys(&read(&[b"\x1b", b"q"])), [escape, character('q', NONE)], "not Alt-q");
        assert_eq!(
            keys(&read(&[b"\x1b", b"O", b"t"])),
            [escape, character('O', KeyModifiers::SHIFT), character('t', NONE)]
        );
        let mut scanner = Scanner::default();
        assert!(scanner.read(b"\x1b\x1b").len() == 1);
        assert_eq!(keys(&scanner.give_up()), [escape]);
        assert!(scanner.read(b"P").is_empty(), "it may go on");
        assert_eq!(keys(&scanner.give_up()), [character('P', KeyModifiers::SHIFT)]);
    }

    #[test]
    fn a_key_long_after_escape_is_one_of_its_own_whatever_follows_it() {
        for key in ["O", "[", "]", "P", "X", "^", "_"] {
            for text in ["some text", "A wall", "1234"] {
                let mut scanner = Scanner::default();
                let mut found = scanner.read(b"\x1b");
                found.extend(scanner.give_up());
                found.extend(scanner.read(key.as_bytes()));
                found.extend(scanner.give_up());
                found.extend(scanner.read(text.as_bytes()));
                let typed: String =
                    keys(&found).iter().filter_map(|(code, _)| code.as_char()).collect();
                assert_eq!(typed, format!("{key}{text}"));
                assert_eq!(found.len(), 1 + typed.len(), "the key Esc, and no replies");
            }
        }
        let mut scanner = Scanner::default();
        scanner.read(b"\x1b");
        scanner.give_up();
        assert_eq!(keys(&scanner.read(b"O")), [character('O', KeyModifiers::SHIFT)], "at once");
        scanner.read(b"\x1b");
        scanner.give_up();
        assert_eq!(keys(&scanner.read(b"OA")), [(KeyCode::Up, NONE)], "the rest of a key");
        scanner.read(b"\x1bO");
        assert_eq!(keys(&scanner.give_up()), [character('O', ALT | KeyModifiers::SHIFT)]);
        assert_eq!(keys(&scanner.read(b"text")).len(), 4);
    }

    #[test]
    fn keys_and_the_mouse_are_recognised() {
        let plain = |code| (code, NONE);
        let bytes =
            "f\x1b[A\x1bOB \u{e9}Q\r\x03\x7f\t\x1b[Z\x1b[5~\x1b[1;5C\x1b[15~\x1b[[A\x1b[113;5u"
                .as_bytes();
        let expected = [
            character('f', NONE),
            plain(KeyCode::Up),
            plain(KeyCode::Down),
            character(' ', NONE),
            character('\u{e9}', NONE),
            character('Q', KeyModifiers::SHIFT),
            plain(KeyCode::Enter),
            character('c', KeyModifiers::CONTROL),
            plain(KeyCode::Backspace),
            plain(KeyCode::Tab),
            (KeyCode::BackTab, KeyModifiers::SHIFT),
            plain(KeyCode::PageUp),
            (KeyCode::Right, KeyModifiers::CONTROL),
            plain(KeyCode::F(5)),
            plain(KeyCode::F(1)),
            character('q', KeyModifiers::CONTROL),
        ];
        assert_eq!(keys(&read(&[bytes])), expected);
        for mouse in [&b"\x1b[<0;3;4M"[..], b"\x1b[M #$", b"\x1b[32;3;4M"] {
            assert!(
                matches!(&read(&[mouse])[..], [Input::Event(Event::Mouse(at))] if (at.column, at.row) == (2, 3))
            );
        }
        assert!(matches!(&read(&[b"\x1b[<0;0;0M"])[..], [Input::Reply(_)]));
        assert!(read(&[b"\xff\xfe\xc3"]).is_empty());
    }

    #[test]
    fn pastes_end_by_themselves_and_stay_small() {
        let paste = |found: &[Input]| match found {
            [Input::Event(Event::Paste(text))] => text.clone(),
            _ => panic!("{found:?}"),
        };
        for parts in
            [&[&b"\x1b[200~a\x1b[Ab\x1b[201~"[..]][..], &[b"\x1b[20", b"0~a\x1b[Ab\x1b", b"[201~"]]
        {
            assert_eq!(paste(&read(parts)), "a\x1b[Ab");
        }
        let mut scanner = Scanner::default();
        assert!(scanner.read(b"\x1b[200~").is_empty());
        (0..1000).for_each(|_| assert!(scanner.read(&[b'q'; 4096]).is_empty()));
        assert!(scanner.held.capacity() < 4 * LONGEST_PASTE);
        assert_eq!(paste(&scanner.give_up()).len(), LONGEST_PASTE);
        assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)]);
        assert!(keys(&scanner.read(b"\x1b[201~")).is_empty(), "its end comes late");
    }

    #[test]
    fn a_string_without_an_end_takes_neither_memory_nor_the_keys_for_long() {
        let mut scanner = Scanner::default();
        scanner.read(b"\x1b]0;");
        (0..1000).for_each(|_| assert!(scanner.read(&[b'q'; 4096]).is_empty()));
        assert!(scanner.held.len() <= LONGEST_SEQUENCE && scanner.patience() == Some(WITHIN));
        assert_eq!(
            keys(&scanner.read(b"\x03")),
            [character('c', KeyModifiers::CONTROL)],
            "a key that no string contains"
        );
        scanner.read(b"\x1bPx");
        assert!(scanner.give_up().is_empty());
        assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)]);
    }
}
