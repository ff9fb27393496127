//! A process that gives the terminal back when the program can no longer do so itself: killed, or aborted because
//! memory ran out.
//!
//! It is this program once more, waiting at a pipe. An orderly end sends a word through the pipe; an end of the pipe
//! without one is the end of the program, and the terminal is put back as it was when the guard began.

use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};

/// Sent by a program that has given the terminal back itself.
const DISMISSED: &[u8] = b"dismissed";

/// Sent by the guard once it knows the terminal's modes.
const READY: &[u8] = b"r";

/// The guard, seen from the program.
pub struct Guard(Child);

impl Guard {
    /// Starts it. Where that cannot be, the program goes on without.
    pub fn start() -> Option<Self> {
        if cfg!(not(unix)) {
            return None;
        }
        // The program's file may have been replaced since it began.
        let own = std::path::Path::new("/proc/self/exe");
        let program = if own.exists() { own.to_owned() } else { std::env::current_exe().ok()? };
        let mut command = Command::new(program);
        command.arg("terminal-guard").stdin(Stdio::piped()).stdout(Stdio::inherit()).stderr(Stdio::piped());
        let mut child = command.spawn().ok()?;
        // Only after that may the modes change.
        let mut word = [0; READY.len()];
        let ready = child.stderr.take().is_some_and(|mut from| from.read_exact(&mut word).is_ok());
        if !ready {
            let _ = child.kill();
            let _ = child.wait();
            return None;
        }
        Some(Self(child))
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Some(mut to) = self.0.stdin.take() {
            let _ = to.write_all(DISMISSED);
        }
        let _ = self.0.wait();
    }
}

/// The guard's own life.
#[cfg(unix)]
pub fn watch() {
    use nix::sys::signal::SigSet;
    use nix::sys::termios::{SetArg, tcgetattr, tcsetattr};

    // It outlives what ends the program, and may change the modes of a terminal whose foreground it is no longer in.
    let _ = SigSet::all().thread_block();
    let modes = tcgetattr(std::io::stdout()).ok();
    let told = std::io::stderr().write_all(READY);
    let mut word = Vec::new();
    let read = std::io::stdin().take(DISMISSED.len() as u64).read_to_end(&mut word);
    if told.is_err() || read.is_err() || word == DISMISSED {
        return;
    }
    super::leave_screen();
    if let Some(modes) = modes {
        let _ = tcsetattr(std::io::stdout(), SetArg::TCSANOW, &modes);
    }
}

/// The guard's own life.
#[cfg(not(unix))]
pub fn watch() {}
