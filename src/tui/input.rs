//! Terminal input, read on its own thread.
//!
//! crossterm mistakes replies of the terminal for keys and buffers an unfinished paste forever. So
//! this module splits the bytes into sequences itself, and `terminput` only parses those of keys.
//! Terminals send replies, also to the queries of other programs, in the same stream as keys:
//! control strings (OSC, DCS, APC, PM, SOS) and control sequences that are not keys are replies,
//! however reads split them. Keys with Alt begin the same way (Alt-] and OSC are both `ESC ]`), so
//! what follows decides, and how soon.

use std::fs::File;
use std::io::{ErrorKind, IsTerminal, Read, stdin};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crossterm::event::{Event, KeyCode, KeyEvent, KeyModifiers};
use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::unistd::{getpgrp, tcgetpgrp};
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Capacity of the event queue; while it is full, input stays in the terminal's buffer.
const MAX_WAITING: usize = 256;

/// Interval for checking whether the program is in the foreground again, in milliseconds.
const IN_BACKGROUND: u16 = 50;

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

const CTRL_C: u8 = 3;

/// Bytes kept of a sequence, and of a paste, at most.
const MAX_SEQUENCE: usize = 4096;
const MAX_PASTE: usize = 1 << 16;

const ESC: u8 = 0x1b;
const PASTE_BEGIN: &[u8] = b"\x1b[200~";
const PASTE_END: &[u8] = b"\x1b[201~";

/// Final bytes of keys that begin with SS3 (`ESC O`).
const SS3_KEYS: &[u8] = b"ABCDFHPQRS";

/// Input from a terminal.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// A key, a mouse event or a paste.
    Event(Event),
    /// The reply to a query: a control sequence, or a control string without its terminator.
    Reply(Vec<u8>),
}

/// Whether the program is in the terminal's foreground process group.
pub fn is_in_foreground(terminal: impl AsFd) -> bool {
    // If the terminal is gone, later errors report that.
    tcgetpgrp(terminal).map_or(true, |group| group == getpgrp())
}

/// A stream of terminal input.
pub struct InputStream {
    inputs: Receiver<Input>,
    /// Whether nothing is read.
    pauses: Arc<AtomicBool>,
    /// Ends the thread when dropped.
    _stop: UnixStream,
}

impl InputStream {
    /// Starts reading standard input if it is a terminal, otherwise the controlling terminal.
    pub fn start() -> std::io::Result<Self> {
        let input = stdin();
        let terminal = if input.is_terminal() {
            File::from(input.as_fd().try_clone_to_owned()?)
        } else {
            File::open("/dev/tty")?
        };
        let (stop, stopped) = UnixStream::pair()?;
        let (sender, inputs) = channel(MAX_WAITING);
        let pauses = Arc::new(AtomicBool::new(false));
        let is_paused = pauses.clone();
        let read = move || {
            if let Err(error) = read_all(&terminal, &stopped, &is_paused, &sender) {
                log::info!("reading from the terminal: {error}");
            }
        };
        std::thread::Builder::new().name("terminal input".to_owned()).spawn(read)?;
        Ok(Self { inputs, pauses, _stop: stop })
    }

    /// Leaves what is typed from now on to others, or no longer.
    pub fn pause(&self, pauses: bool) {
        self.pauses.store(pauses, Ordering::SeqCst);
    }

    /// Waits for the next input. Nothing is lost if the future is dropped.
    pub async fn next(&mut self) -> std::io::Result<Input> {
        self.inputs.recv().await.ok_or_else(|| std::io::Error::other("the terminal is gone"))
    }

    /// Returns the next input if it has been read already.
    pub fn read_already(&mut self) -> Option<Input> {
        self.inputs.try_recv().ok()
    }
}

/// Reads until the terminal is gone or the receiver is dropped.
fn read_all(
    terminal: &File,
    stopped: &UnixStream,
    is_paused: &AtomicBool,
    to: &Sender<Input>,
) -> std::io::Result<()> {
    let mut scanner = Scanner::default();
    let mut bytes = [0; 4096];
    loop {
        let patience = scanner.patience().and_then(|patience| PollTimeout::try_from(patience).ok());
        let mut ready = [terminal.as_fd(), stopped.as_fd()]
            .map(|source| PollFd::new(source, PollFlags::POLLIN));
        let found = match poll(&mut ready, patience.unwrap_or(PollTimeout::NONE)) {
            Err(Errno::EINTR) => continue,
            Err(error) => return Err(error.into()),
            Ok(0) => scanner.give_up(),
            Ok(_) if ready[1].any() == Some(true) => return Ok(()),
            // In the background, and from the moment on at which the program gives the terminal
            // back, input belongs to the shell.
            Ok(_) if is_paused.load(Ordering::SeqCst) || !is_in_foreground(terminal) => {
                match poll(&mut ready[1..], IN_BACKGROUND) {
                    Ok(_) | Err(Errno::EINTR) => continue,
                    Err(error) => return Err(error.into()),
                }
            }
            Ok(_) => match { terminal }.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(count) => scanner.read(&bytes[..count]),
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted | ErrorKind::WouldBlock => continue,
                    // The program may have moved to the background meanwhile.
                    _ if !is_in_foreground(terminal) => continue,
                    _ => return Err(error),
                },
            },
        };
        for input in found {
            if to.blocking_send(input).is_err() {
                return Ok(());
            }
        }
    }
}

/// How an ESC arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Escape {
    /// Together with what follows it.
    #[default]
    Together,
    /// As the last byte of a read, so not as part of a key with Alt.
    Apart,
    /// It has been reported as the key Esc.
    Reported,
}

/// Splits bytes into inputs.
#[derive(Debug, Default)]
struct Scanner {
    /// What is not complete yet.
    held: Vec<u8>,
    /// How ESC arrived, if that begins with one.
    escape: Escape,
    /// What was reported as keys, and may be the start of a sequence.
    regretted: Vec<u8>,
}

impl Scanner {
    /// Reads `bytes`, all that has arrived, and returns what they complete.
    fn read(&mut self, bytes: &[u8]) -> Vec<Input> {
        // Whoever presses Ctrl-C or moves the mouse does not paste any more: its end was lost.
        let ends_paste = bytes == [CTRL_C] || bytes.starts_with(b"\x1b[<");
        let mut found = if self.held.starts_with(PASTE_BEGIN) && ends_paste {
            self.give_up()
        } else {
            Vec::new()
        };
        self.regret(bytes);
        self.held.extend(bytes);
        let held = std::mem::take(&mut self.held);
        let mut rest = &held[..];
        while !rest.is_empty()
            && let Some((length, input)) = first(rest, self.escape)
        {
            rest = &rest[length..];
            found.extend(input);
            self.escape = Escape::Together;
        }
        if rest == [ESC] {
            self.escape = Escape::Apart;
        }
        self.held = rest.to_vec();
        // What is too long loses its middle, but not the beginning of its end.
        let most = if rest.starts_with(PASTE_BEGIN) { MAX_PASTE } else { MAX_SEQUENCE };
        if let Some(end) = rest.len().checked_sub(PASTE_END.len()).filter(|end| *end > most) {
            self.held.drain(most..end);
        }
        found
    }

    /// Returns how long to wait for more before [`Self::give_up`]; `None` if nothing is incomplete.
    fn patience(&self) -> Option<Duration> {
        match &self.held[..] {
            [] if self.regretted.is_empty() => None,
            [] => Some(REGRET),
            [ESC, _] if self.escape == Escape::Together => Some(AFTER_INTRODUCER),
            [ESC] | [ESC, _] => Some(AFTER_ESCAPE),
            _ => Some(WITHIN),
        }
    }

    /// Handles a timeout: reports incomplete input as keys or a paste, or drops it.
    fn give_up(&mut self) -> Vec<Input> {
        self.regretted.clear();
        let (held, escape) = (std::mem::take(&mut self.held), std::mem::take(&mut self.escape));
        match &held[..] {
            [ESC] => {
                self.regretted = held;
                vec![key(KeyCode::Esc, KeyModifiers::NONE)]
            }
            [ESC, introducer] if is_introducer(*introducer) => {
                let keys = introducer_keys(*introducer, escape);
                // No reply begins with SS3, and what comes long after ESC is a separate key.
                if *introducer != b'O' && escape == Escape::Together {
                    self.regretted = held;
                }
                keys
            }
            _ => held.strip_prefix(PASTE_BEGIN).map(paste).into_iter().collect(),
        }
    }

    /// Takes back what was reported as keys, if `bytes` look like the rest of a sequence.
    fn regret(&mut self, bytes: &[u8]) {
        let regretted = std::mem::take(&mut self.regretted);
        let is_rest = match (&regretted[..], bytes) {
            ([ESC], [b'O', last]) => SS3_KEYS.contains(last),
            ([ESC], [first, ..]) => *first != b'O' && is_introducer(*first),
            ([ESC, _], [first, ..]) => *first >= b' ' && bytes.len() >= BURST,
            _ => false,
        };
        if is_rest {
            self.escape = if regretted.len() == 1 { Escape::Reported } else { Escape::Together };
            self.held = regretted;
        }
    }
}

/// Whether ESC and this character begin a sequence: SS3, CSI, OSC, DCS, APC, PM or SOS.
fn is_introducer(byte: u8) -> bool {
    b"O[]P_^X".contains(&byte)
}

/// Returns how many of the bytes the first input has, and the input, unless they mean nothing;
/// `None` if it is not complete.
fn first(bytes: &[u8], escape: Escape) -> Option<(usize, Option<Input>)> {
    let (introducer, rest) = match bytes {
        [ESC] => return None,
        [ESC, introducer, rest @ ..] if is_introducer(*introducer) => (*introducer, rest),
        [ESC, next, ..] if escape != Escape::Together || *next == ESC => {
            let is_new = escape != Escape::Reported;
            return Some((1, is_new.then(|| key(KeyCode::Esc, KeyModifiers::NONE))));
        }
        _ => {
            let start = usize::from(bytes[0] == ESC);
            let length = start + character(&bytes[start..])?;
            return Some((length, event_of(&bytes[..length]).map(Input::Event)));
        }
    };
    let end = match introducer {
        b'O' => match rest.first()? {
            last if escape != Escape::Together && !SS3_KEYS.contains(last) => Err(0),
            last if last.is_ascii_alphanumeric() => Ok(1),
            _ => Err(0),
        },
        b'[' => sequence_end(rest)?,
        _ => string_end(rest)?,
    };
    match end {
        Ok(length) if rest[..length] == PASTE_BEGIN[2..] => {
            let end = rest.windows(PASTE_END.len()).position(|part| part == PASTE_END)?;
            Some((2 + end + PASTE_END.len(), Some(paste(&rest[length..end]))))
        }
        Ok(length) if matches!(introducer, b'O' | b'[') => {
            let whole = &bytes[..2 + length];
            let event = event_of(whole).filter(|_| !is_reply(whole)).map(Input::Event);
            Some((2 + length, event.or_else(|| Some(Input::Reply(whole.to_vec())))))
        }
        Ok(length) => {
            let (bell, terminator): (&[u8], &[u8]) = (b"\x07", b"\x1b\\");
            let text = [bell, terminator].iter().find_map(|end| rest[..length].strip_suffix(*end));
            let text = text.unwrap_or_default();
            Some((2 + length, Some(Input::Reply([&bytes[..2], text].concat()))))
        }
        // A key with Alt after all, or two keys: what follows stays for later.
        Err(0) if escape == Escape::Apart => Some((1, Some(key(KeyCode::Esc, KeyModifiers::NONE)))),
        Err(0) => Some((2, introducer_keys(introducer, escape).pop())),
        Err(length) => Some((2 + length, None)),
    }
}

/// Returns the length of the first character; 1 if it is none.
fn character(bytes: &[u8]) -> Option<usize> {
    let length = match bytes[0] {
        0xc2..=0xdf => 2,
        0xe0..=0xef => 3,
        0xf0..=0xf4 => 4,
        _ => return Some(1),
    };
    match bytes.get(1..length) {
        Some(rest) if rest.iter().all(|byte| matches!(byte, 0x80..=0xbf)) => Some(length),
        None if bytes[1..].iter().all(|byte| matches!(byte, 0x80..=0xbf)) => None,
        _ => Some(1),
    }
}

/// Returns the length of what follows the introducer of a control sequence, or how much of it there
/// is before something else begins.
fn sequence_end(rest: &[u8]) -> Option<Result<usize, usize>> {
    match rest {
        // A function key of the Linux console, and a mouse event in X10 format.
        [b'[', ..] => return (rest.len() >= 2).then_some(Ok(2)),
        [b'M', ..] => return (rest.len() >= 4).then_some(Ok(4)),
        _ => {}
    }
    let end = rest.iter().position(|byte| !matches!(byte, 0x20..=0x3f))?;
    Some(if matches!(rest[end], 0x40..=0x7e) { Ok(end + 1) } else { Err(end) })
}

/// Like [`sequence_end`], of a control string with its terminator.
fn string_end(rest: &[u8]) -> Option<Result<usize, usize>> {
    // No string contains these: they are keys, and the string will not end.
    let end = rest.iter().position(|byte| matches!(byte, 0x00..=0x08 | 0x0e..=0x1f))?;
    match &rest[end..] {
        [0x07, ..] => Some(Ok(end + 1)),
        [ESC] => None,
        [ESC, b'\\', ..] => Some(Ok(end + 2)),
        _ => Some(Err(end)),
    }
}

/// Returns ESC and an introducer as a key with Alt, or as two keys.
fn introducer_keys(introducer: u8, escape: Escape) -> Vec<Input> {
    let character = char::from(introducer);
    let shift = if character.is_uppercase() { KeyModifiers::SHIFT } else { KeyModifiers::NONE };
    let escaped = key(KeyCode::Esc, KeyModifiers::NONE);
    match escape {
        Escape::Together => vec![key(KeyCode::Char(character), shift | KeyModifiers::ALT)],
        Escape::Apart => vec![escaped, key(KeyCode::Char(character), shift)],
        Escape::Reported => vec![key(KeyCode::Char(character), shift)],
    }
}

fn key(code: KeyCode, modifiers: KeyModifiers) -> Input {
    Input::Event(Event::Key(KeyEvent::new(code, modifiers)))
}

fn paste(bytes: &[u8]) -> Input {
    let text = &bytes[..bytes.len().min(MAX_PASTE)];
    Input::Event(Event::Paste(String::from_utf8_lossy(text).into_owned()))
}

/// Whether a control sequence that looks like a key or the mouse is a reply: the cursor's position,
/// or a position off the screen.
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

    /// Replies of terminals to queries of any program.
    const REPLIES: [&[u8]; 21] = [
        b"\x1b]11;rgb:1e1e/1e1e/2e2e\x1b\\",
        b"\x1b]11;rgb:1e1e/1e1e/2e2e\x07",
        "\x1b]lein gr\u{f6}\u{df}er Titel \u{dc}\u{715c}\x1b\\".as_bytes(),
        b"\x1b]52;c;cXVpdA==\x1b\\",
        b"\x1bP>|tmux 3.4\x1b\\",
        b"\x1bP1$r0m\x1b\\",
        b"\x1bP1+r544e=787465726d\x1b\\",
        b"\x1bP!|00000000\x1b\\",
        b"\x1b_Gi=31;OK\x1b\\",
        b"\x1b^private q\x1b\\",
        b"\x1bXstring q\x1b\\",
        b"\x1b[>1;10;0c",
        b"\x1b[?62;4c",
        b"\x1b[6;20;10t",
        b"\x1b[?2026;1$y",
        b"\x1b[?1u",
        b"\x1b[12;40R",
        b"\x1b[0n",
        b"\x1b[?997;1n",
        b"\x1b[=5;q",
        b"\x1b[<0;0;0M",
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
        let q = [character('q', NONE)];
        for reply in REPLIES {
            let shown = String::from_utf8_lossy(reply);
            assert!(matches!(&read(&[reply])[..], [Input::Reply(_)]), "{shown:?}");
            let mut scanner = Scanner::default();
            let mut one_by_one: Vec<Input> =
                reply.iter().flat_map(|byte| scanner.read(&[*byte])).collect();
            assert_eq!(scanner.patience(), None, "{shown:?} is at its end");
            one_by_one.extend(scanner.read(b"q"));
            assert_eq!(keys(&one_by_one), q, "{shown:?}");
            for at in 1..reply.len() {
                let (first, second) = reply.split_at(at);
                assert_eq!(keys(&read(&[first, second, b"q"])), q, "{shown:?} at {at}");
            }
            // Its beginning was taken for Esc, or for a key with Alt.
            for at in (1..3).filter(|at| *at == 1 || reply.len() - at >= BURST) {
                let mut scanner = Scanner::default();
                let (first, second) = reply.split_at(at);
                assert!(scanner.read(first).is_empty() && scanner.give_up().len() == 1);
                let mut found = scanner.read(second);
                found.extend(scanner.read(b"q"));
                assert_eq!(keys(&found), q, "{shown:?} at {at}");
            }
        }
    }

    #[test]
    fn keys_with_alt_and_escape_still_work() {
        for key in ['_', 'P', ']', '^', 'X', 'O', '['] {
            let shift = if key.is_uppercase() { KeyModifiers::SHIFT } else { NONE };
            let mut scanner = Scanner::default();
            assert!(scanner.read(format!("\x1b{key}").as_bytes()).is_empty());
            assert!(scanner.patience().is_some());
            assert_eq!(keys(&scanner.give_up()), [character(key, ALT | shift)]);
            assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)], "then {key}");
        }
        assert_eq!(
            keys(&read(&[b"\x1bx", "\x1b\u{e9}".as_bytes(), b"\x1b\r"])),
            [character('x', ALT), character('\u{e9}', ALT), (KeyCode::Enter, ALT)]
        );
        let escape = (KeyCode::Esc, NONE);
        assert_eq!(keys(&read(&[b"\x1b", b"q"])), [escape, character('q', NONE)], "not Alt-q");
        // A key long after Esc is one of its own, whatever follows it.
        for key in ["O", "[", "]", "P", "X", "^", "_"] {
            for text in ["some text", "A wall", "1234"] {
                let mut scanner = Scanner::default();
                let mut found = scanner.read(b"\x1b");
                found.extend(scanner.give_up());
                found.extend(scanner.read(key.as_bytes()));
                found.extend(scanner.give_up());
                found.extend(scanner.read(text.as_bytes()));
                let codes = keys(&found);
                let typed: String = codes.iter().filter_map(|(code, _)| code.as_char()).collect();
                assert_eq!((typed, found.len()), (format!("{key}{text}"), 2 + text.len()));
            }
        }
    }

    #[test]
    fn keys_and_the_mouse_are_recognised() {
        let plain = |code| (code, NONE);
        let bytes = "f\x1b[A\x1bOB \u{e9}Q\r\x03\x7f\t\x1b[Z\x1b[5~\x1b[1;5C\x1b[15~\x1b[[A\
                     \x1b[113;5u"
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
            let [Input::Event(Event::Mouse(at))] = read(&[mouse])[..] else { panic!("{mouse:?}") };
            assert_eq!((at.column, at.row), (2, 3));
        }
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
        for is_ended in [false, true] {
            let mut scanner = Scanner::default();
            assert!(scanner.read(b"\x1b[200~").is_empty());
            (0..1000).for_each(|_| assert!(scanner.read(&[b'q'; 4096]).is_empty()));
            assert!(scanner.held.len() < 2 * MAX_PASTE);
            let found = if is_ended { scanner.read(PASTE_END) } else { scanner.give_up() };
            assert!((MAX_PASTE - 10..=MAX_PASTE).contains(&paste(&found).len()));
            assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)]);
            assert!(keys(&scanner.read(PASTE_END)).is_empty(), "its end comes late");
        }
    }

    #[test]
    fn ctrl_c_and_the_mouse_end_a_paste_whose_end_was_lost() {
        for after in [&[CTRL_C][..], b"\x1b[<35;3;4M"] {
            let found = read(&[b"\x1b[200~ab", b"c", after]);
            assert!(matches!(&found[..], [Input::Event(Event::Paste(text)), _] if text == "abc"));
        }
        assert_eq!(
            read(&[b"\x1b[200~a\x03b\x1b[201~"]).len(),
            1,
            "in the middle of one it is text"
        );
    }

    #[test]
    fn a_string_without_an_end_takes_neither_memory_nor_the_keys_for_long() {
        let mut scanner = Scanner::default();
        scanner.read(b"\x1b]0;");
        (0..1000).for_each(|_| assert!(scanner.read(&[b'q'; 4096]).is_empty()));
        assert!(scanner.held.len() <= MAX_SEQUENCE + 6 && scanner.patience() == Some(WITHIN));
        let ctrl_c = character('c', KeyModifiers::CONTROL);
        assert_eq!(keys(&scanner.read(b"\x03")), [ctrl_c], "a key that no string contains");
        scanner.read(b"\x1bPx");
        assert!(scanner.give_up().is_empty());
        assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)]);
    }
}
