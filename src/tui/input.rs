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
use tokio::sync::mpsc::{Receiver, Sender, channel};

use crate::process::waiting::is_in_foreground;

/// Capacity of the event queue; while it is full, input stays in the terminal's buffer.
const MAX_WAITING: usize = 256;

/// Interval for checking whether the program is in the foreground again, in milliseconds.
const IN_BACKGROUND: u16 = 50;

/// Timeout for the rest of a sequence after ESC, which may be the key Esc, or one with Alt.
const AFTER_ESCAPE: Duration = Duration::from_millis(150);

/// Timeout within a longer sequence, and so how long keys do nothing after one that never ends.
const WITHIN: Duration = Duration::from_secs(1);

const CTRL_C: u8 = 3;

/// Bytes kept of a sequence, and of a paste, at most.
const MAX_SEQUENCE: usize = 4096;
const MAX_PASTE: usize = 1 << 16;

const ESC: u8 = 0x1b;
const PASTE_BEGIN: &[u8] = b"\x1b[200~";
const PASTE_END: &[u8] = b"\x1b[201~";

/// Final bytes of keys that begin with SS3 (`ESC O`).
const SS3_KEYS: &[u8] = b"ABCDFHPQRS";

#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    Event(Event),
    /// The reply to a query: a control sequence, or a control string without its terminator.
    Reply(Vec<u8>),
}

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

    pub fn read_already(&mut self) -> Option<Input> {
        self.inputs.try_recv().ok()
    }
}

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

#[derive(Debug, Default)]
struct Scanner {
    /// What is not complete yet.
    held: Vec<u8>,
    /// Whether that begins with an ESC that ended a read, so is not part of a key with Alt.
    is_apart: bool,
}

impl Scanner {
    /// Reads `bytes`, all that has arrived, and returns what they complete.
    fn read(&mut self, bytes: &[u8]) -> Vec<Input> {
        // Whoever presses Ctrl-C or moves the mouse does not paste any more: its end was lost.
        let ends_paste = bytes == [CTRL_C] || bytes.starts_with(b"\x1b[<");
        let is_lost = self.held.starts_with(PASTE_BEGIN) && ends_paste;
        let mut found = if is_lost { self.give_up() } else { Vec::new() };
        self.held.extend(bytes);
        let held = std::mem::take(&mut self.held);
        let mut rest = &held[..];
        while !rest.is_empty()
            && let Some((length, input)) = first(rest, self.is_apart)
        {
            rest = &rest[length..];
            found.extend(input);
            self.is_apart = false;
        }
        self.is_apart |= rest == [ESC];
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
        match self.held.len() {
            0 => None,
            1 | 2 => Some(AFTER_ESCAPE),
            _ => Some(WITHIN),
        }
    }

    /// Handles a timeout: reports incomplete input as keys or a paste, or drops it.
    fn give_up(&mut self) -> Vec<Input> {
        let (held, is_apart) = (std::mem::take(&mut self.held), std::mem::take(&mut self.is_apart));
        match held[..] {
            [ESC] => vec![key(KeyCode::Esc, KeyModifiers::NONE)],
            [ESC, introducer] if introducer.is_ascii() => introducer_keys(introducer, is_apart),
            _ => held.strip_prefix(PASTE_BEGIN).map(paste).into_iter().collect(),
        }
    }
}

/// Returns how many of the bytes the first input has, and the input, unless they mean nothing;
/// `None` if it is not complete. If its ESC `is_apart`, it is no key with Alt.
fn first(bytes: &[u8], is_apart: bool) -> Option<(usize, Option<Input>)> {
    let [ESC, introducer, rest @ ..] = bytes else {
        let length = if bytes == [ESC] { None } else { character(bytes) }?;
        return Some((length, event_of(&bytes[..length])));
    };
    let end = match introducer {
        b'O' => match rest.first()? {
            last if SS3_KEYS.contains(last) => Ok(1),
            _ => Err(0),
        },
        b'[' => sequence_end(rest)?,
        b']' | b'P' | b'_' | b'^' | b'X' => string_end(rest)?,
        _ if is_apart || *introducer == ESC => {
            return Some((1, Some(key(KeyCode::Esc, KeyModifiers::NONE))));
        }
        _ => {
            let length = 1 + character(&bytes[1..])?;
            return Some((length, event_of(&bytes[..length])));
        }
    };
    match end {
        Ok(length) if rest[..length] == PASTE_BEGIN[2..] => {
            let end = rest.windows(PASTE_END.len()).position(|part| part == PASTE_END)?;
            Some((2 + end + PASTE_END.len(), Some(paste(&rest[length..end]))))
        }
        Ok(length) => {
            let whole = &bytes[..2 + length];
            let is_key = matches!(introducer, b'O' | b'[') && !is_reply(whole);
            let event = is_key.then(|| event_of(whole)).flatten();
            let text = whole.strip_suffix(b"\x1b\\").or(whole.strip_suffix(b"\x07"));
            Some((2 + length, event.or_else(|| Some(Input::Reply(text.unwrap_or(whole).to_vec())))))
        }
        // A key with Alt after all, or two keys: what follows stays for later.
        Err(0) if is_apart => Some((1, Some(key(KeyCode::Esc, KeyModifiers::NONE)))),
        Err(0) => Some((2, introducer_keys(*introducer, false).pop())),
        Err(length) => Some((2 + length, None)),
    }
}

/// Returns the length of the first character; 1 if it is none.
fn character(bytes: &[u8]) -> Option<usize> {
    let valid = std::str::from_utf8(bytes).or_else(|error| match error.valid_up_to() {
        0 => Err(error),
        end => std::str::from_utf8(&bytes[..end]),
    });
    match valid {
        Ok(text) => text.chars().next().map(char::len_utf8),
        Err(error) => error.error_len().map(|_| 1),
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

/// Returns ESC and the beginning of a sequence as a key with Alt, or as two keys.
fn introducer_keys(introducer: u8, is_apart: bool) -> Vec<Input> {
    let code = KeyCode::Char(char::from(introducer));
    let is_upper = introducer.is_ascii_uppercase();
    let shift = if is_upper { KeyModifiers::SHIFT } else { KeyModifiers::NONE };
    if is_apart {
        return vec![key(KeyCode::Esc, KeyModifiers::NONE), key(code, shift)];
    }
    vec![key(code, shift | KeyModifiers::ALT)]
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

fn event_of(bytes: &[u8]) -> Option<Input> {
    let event = terminput::Event::parse_from(bytes).ok()??;
    terminput_crossterm::to_crossterm(event).ok().map(Input::Event)
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: KeyModifiers = KeyModifiers::NONE;
    const ALT: KeyModifiers = KeyModifiers::ALT;

    /// Replies of terminals to queries of any program.
    const REPLIES: [&[u8]; 12] = [
        b"\x1b]11;rgb:1e1e/1e1e/2e2e\x1b\\",
        b"\x1b]11;rgb:1e1e/1e1e/2e2e\x07",
        "\x1b]lein gr\u{f6}\u{df}er Titel \u{dc}\u{715c}\x1b\\".as_bytes(),
        b"\x1bP>|tmux 3.4\x1b\\",
        b"\x1bP1+r544e=787465726d\x1b\\",
        b"\x1b_Gi=31;OK\x1b\\",
        b"\x1b^private q\x1b\\",
        b"\x1bXstring q\x1b\\",
        b"\x1b[?62;4c",
        b"\x1b[?2026;1$y",
        b"\x1b[12;40R",
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
            let bytes: Vec<&[u8]> = reply.chunks(1).chain([&b"q"[..]]).collect();
            assert_eq!(keys(&read(&bytes)), q, "{shown:?}");
            for at in 1..reply.len() {
                let (first, second) = reply.split_at(at);
                assert_eq!(keys(&read(&[first, second, b"q"])), q, "{shown:?} at {at}");
            }
        }
    }

    #[test]
    fn keys_and_the_mouse_are_recognised() {
        let escape = (KeyCode::Esc, NONE);
        for (parts, expected) in [
            (&[&b"f"[..]][..], character('f', NONE)),
            (&[b"Q"], character('Q', KeyModifiers::SHIFT)),
            (&[b"\xc3", b"\xa9"], character('\u{e9}', NONE)),
            (&[b"\x1b[A"], (KeyCode::Up, NONE)),
            (&[b"\x1bO", b"B"], (KeyCode::Down, NONE)),
            (&[b"\r"], (KeyCode::Enter, NONE)),
            (&[b"\x03"], character('c', KeyModifiers::CONTROL)),
            (&[b"\x7f"], (KeyCode::Backspace, NONE)),
            (&[b"\x1b[Z"], (KeyCode::BackTab, KeyModifiers::SHIFT)),
            (&[b"\x1b[5~"], (KeyCode::PageUp, NONE)),
            (&[b"\x1b[1;5C"], (KeyCode::Right, KeyModifiers::CONTROL)),
            (&[b"\x1b[15~"], (KeyCode::F(5), NONE)),
            (&[b"\x1b[[A"], (KeyCode::F(1), NONE)),
            (&[b"\x1b[113;5u"], character('q', KeyModifiers::CONTROL)),
            (&[b"\x1bx"], character('x', ALT)),
            (&["\x1b\u{e9}".as_bytes()], character('\u{e9}', ALT)),
            (&[b"\x1b\r"], (KeyCode::Enter, ALT)),
        ] {
            assert_eq!(keys(&read(parts)), [expected], "{parts:?}");
        }
        assert_eq!(keys(&read(&[b"\x1b", b"q"])), [escape, character('q', NONE)], "not Alt-q");
        assert_eq!(keys(&read(&[b"\x1b", b"O", b"x"])).len(), 3, "three keys");
        for key in ['_', 'P', ']', '^', 'X', 'O', '['] {
            let shift = if key.is_uppercase() { KeyModifiers::SHIFT } else { NONE };
            let mut scanner = Scanner::default();
            assert!(scanner.read(format!("\x1b{key}").as_bytes()).is_empty());
            assert!(scanner.patience().is_some());
            assert_eq!(keys(&scanner.give_up()), [character(key, ALT | shift)]);
            assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)], "then {key}");
        }
        for mouse in [&b"\x1b[<0;3;4M"[..], b"\x1b[M #$", b"\x1b[32;3;4M"] {
            let [Input::Event(Event::Mouse(at))] = read(&[mouse])[..] else { panic!("{mouse:?}") };
            assert_eq!((at.column, at.row), (2, 3));
        }
        assert!(read(&[b"\xff\xfe\xc3"]).is_empty());
    }

    #[test]
    fn pastes_end_by_themselves_and_stay_small() {
        let paste = |found: &[Input]| match found {
            [Input::Event(Event::Paste(text)), ..] => text.clone(),
            _ => panic!("{found:?}"),
        };
        for parts in [
            &[&b"\x1b[200~a\x1b[A\x03b\x1b[201~"[..]][..],
            &[b"\x1b[20", b"0~a\x1b[A\x03b\x1b", b"[201~"],
        ] {
            assert_eq!(paste(&read(parts)), "a\x1b[A\x03b");
        }
        // Its end was lost, or comes late.
        for after in [&[CTRL_C][..], b"\x1b[<35;3;4M"] {
            let found = read(&[b"\x1b[200~ab", b"c", after]);
            assert_eq!((paste(&found).as_str(), found.len()), ("abc", 2));
        }
        for is_ended in [false, true] {
            let mut scanner = Scanner::default();
            assert!(scanner.read(b"\x1b[200~").is_empty());
            (0..1000).for_each(|_| assert!(scanner.read(&[b'q'; 4096]).is_empty()));
            assert!(scanner.held.len() < 2 * MAX_PASTE);
            let found = if is_ended { scanner.read(PASTE_END) } else { scanner.give_up() };
            assert!((MAX_PASTE - 10..=MAX_PASTE).contains(&paste(&found).len()));
            assert_eq!(keys(&scanner.read(b"q")), [character('q', NONE)]);
        }
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
