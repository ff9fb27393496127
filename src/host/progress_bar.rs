//! Where progress bars are drawn.

#[cfg(unix)]
use std::io::{self, Write};

use gdg::printing;
use gdg::text::terminal_obeys_escapes;
use indicatif::ProgressDrawTarget;

/// Returns where progress bars are drawn: on standard error, if that is a terminal that can move
/// its cursor.
#[cfg(unix)]
pub fn target() -> ProgressDrawTarget {
    if !terminal_obeys_escapes() {
        return ProgressDrawTarget::hidden();
    }
    ProgressDrawTarget::term(console::Term::read_write_pair(io::stdin(), Frames), FRAMES_PER_SECOND)
}

/// Returns where progress bars are drawn: on standard error, if that is a terminal.
#[cfg(not(unix))]
pub fn target() -> ProgressDrawTarget {
    ProgressDrawTarget::stderr()
}

/// Frames of a progress bar, at most.
#[cfg(unix)]
const FRAMES_PER_SECOND: u8 = 20;

/// Standard error for the frames of a progress bar.
#[cfg(unix)]
#[derive(Debug)]
struct Frames;

#[cfg(unix)]
impl Write for Frames {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        printing::stderr().print_frame(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(unix)]
impl std::os::fd::AsRawFd for Frames {
    fn as_raw_fd(&self) -> std::os::fd::RawFd {
        io::stderr().as_raw_fd()
    }
}
