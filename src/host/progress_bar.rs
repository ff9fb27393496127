//! Where progress bars are drawn, and how they say how long something takes.

use std::io::{self, Write};

use gdg::printing;
use gdg::text::terminal_obeys_escapes;
use indicatif::ProgressDrawTarget;

/// Returns where progress bars are drawn: on standard error, if that is a terminal that can move
/// its cursor.
pub fn target() -> ProgressDrawTarget {
    if !terminal_obeys_escapes() {
        return ProgressDrawTarget::hidden();
    }
    ProgressDrawTarget::term(console::Term::read_write_pair(io::stdin(), Frames), FRAMES_PER_SECOND)
}

/// Formats a time in seconds, in a word or two.
pub fn duration(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    match seconds as u64 {
        ..90 => format!("{seconds:.0} s"),
        90..5400 => format!("{minutes} min"),
        _ => format!("{} h {:02} min", minutes / 60, minutes % 60),
    }
}

/// Frames of a progress bar, at most.
const FRAMES_PER_SECOND: u8 = 20;

/// Standard error for the frames of a progress bar.
#[derive(Debug)]
struct Frames;

impl Write for Frames {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        printing::stderr().print_frame(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl std::os::fd::AsRawFd for Frames {
    fn as_raw_fd(&self) -> std::os::fd::RawFd {
        io::stderr().as_raw_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn times_are_short() {
        assert_eq!(
            [5.4, 100.0, 5399.0, 7300.0].map(duration),
            ["5 s", "2 min", "90 min", "2 h 02 min"]
        );
    }
}
