//! The query of the terminal's graphics capabilities.

/// The queries: whether it shows a kitty picture of one pixel, the size of a character and, last,
/// the device attributes, which every terminal reports.
pub const QUESTIONS: &[u8] = b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[16t\x1b[c";

/// A terminal's answer.
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
