//! Parses sequences of bytes.

use crossterm::event::Event;

/// Final bytes of keys that begin with SS3.
const SS3_KEYS: &[u8] = b"ABCDFHPQRS";

/// Returns whether ESC and this character begin a sequence: SS3, CSI, OSC, DCS, APC, PM or SOS.
pub fn is_introducer(byte: u8) -> bool {
    b"O[]P_^X".contains(&byte)
}

/// Returns whether these bytes are the rest of a key that begins with SS3.
pub fn is_ss3_key(rest: &[u8]) -> bool {
    matches!(rest, [b'O', last] if SS3_KEYS.contains(last))
}

/// Returns whether a control sequence that looks like a key or the mouse is a reply: the cursor's
/// position, or a position off the screen.
pub fn is_reply(sequence: &[u8]) -> bool {
    let mut numbers =
        sequence.split(|byte| !byte.is_ascii_digit()).filter(|number| !number.is_empty()).skip(1);
    match sequence {
        [.., b'R'] => numbers.next().is_some(),
        [.., b'M' | b'm'] => numbers.any(|number| number.iter().all(|digit| *digit == b'0')),
        _ => false,
    }
}

/// Returns the event that `bytes` mean, if any.
pub fn event_of(bytes: &[u8]) -> Option<Event> {
    let event = terminput::Event::parse_from(bytes).ok()??;
    terminput_crossterm::to_crossterm(event).ok()
}
