//! Terminal input, split into reads in every way.

use crossterm::event::{KeyCode, KeyModifiers};

use super::*;

const NONE: KeyModifiers = KeyModifiers::NONE;
const ALT: KeyModifiers = KeyModifiers::ALT;

/// Replies of terminals to queries of any program.
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
}

#[test]
fn keys_and_the_mouse_are_recognised() {
    let plain = |code| (code, NONE);
    let bytes = "f\x1b[A\x1bOB \u{e9}Q\r\x03\x7f\t\x1b[Z\x1b[5~\x1b[1;5C\x1b[15~\x1b[[A\x1b[113;5u"
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
