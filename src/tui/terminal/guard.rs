//! A process that restores the terminal when the program cannot do so itself: killed, or aborted
//! because memory ran out.
//!
//! The guard is a second process of this program, reading from a pipe. On an orderly exit the
//! program sends a word through the pipe. If the pipe closes without that word, the program has
//! died, and the guard restores the terminal to its state when the guard started.

use std::ffi::OsStr;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Sent by a program that has restored the terminal itself.
const DISMISSED: &[u8] = b"dismissed";

/// Sent earlier by a program that has shown pictures.
const PICTURES: u8 = b'p';

/// Sent by the guard once it has read the terminal's modes.
const READY: &[u8] = b"r";

/// The argument that makes the program a guard.
pub const GUARD_COMMAND: &str = "terminal-guard";

/// The program's handle on the guard.
pub struct Guard {
    process: Child,
    /// Whether it knows that there are pictures on the screen.
    expects_pictures: bool,
    /// Whether it is to restore the terminal.
    restores: bool,
}

impl Guard {
    /// Starts the guard; `None` if that fails, and the program runs without one.
    pub fn start() -> Option<Self> {
        if cfg!(not(unix)) {
            return None;
        }
        let mut command = Command::new(own_program()?);
        command
            .arg(GUARD_COMMAND)
            .stdin(Stdio::piped())
            .stdout(Stdio::inherit())
            .stderr(Stdio::piped());
        // In its own process group, the guard is not stopped or killed along with the program's.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().ok()?;
        // The terminal's modes may change only once the guard has read them.
        let mut word = [0; READY.len()];
        let ready = child.stderr.take().is_some_and(|mut from| from.read_exact(&mut word).is_ok());
        if !ready {
            let _ = child.kill();
            let _ = child.wait();
            return None;
        }
        Some(Self { process: child, expects_pictures: false, restores: false })
    }

    /// Leaves restoring the terminal to the guard, since the terminal does not read what the
    /// program sends.
    pub fn take_over(&mut self) {
        self.restores = true;
    }

    /// Has the guard delete pictures too.
    pub fn expect_pictures(&mut self) {
        if !std::mem::replace(&mut self.expects_pictures, true)
            && let Some(to) = &mut self.process.stdin
        {
            let _ = to.write_all(&[PICTURES]);
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if self.restores {
            // The guard acts when the pipe closes.
            return;
        }
        if let Some(mut to) = self.process.stdin.take() {
            let _ = to.write_all(DISMISSED);
        }
        let _ = self.process.wait();
    }
}

/// Returns the program to start as the guard.
fn own_program() -> Option<PathBuf> {
    // The program's file may have been replaced since it started.
    let running = Path::new("/proc/self/exe");
    if running.exists() {
        return Some(running.to_owned());
    }
    std::env::current_exe().ok().or_else(|| named_program(&std::env::args_os().next()?))
}

/// Looks up the program by the name it was started with, as a shell does; `None` if that is another
/// program.
fn named_program(name: &OsStr) -> Option<PathBuf> {
    let name = Path::new(name);
    (name.file_name()? == env!("CARGO_PKG_NAME")).then(|| name.to_owned())
}

/// Runs the guard.
#[cfg(unix)]
pub fn run_guard() {
    use nix::sys::signal::SigSet;
    use nix::sys::termios::{SetArg, tcgetattr, tcsetattr};

    // With signals blocked, the guard survives what kills the program, and may set the terminal's
    // modes from the background.
    let _ = SigSet::all().thread_block();
    let modes = tcgetattr(std::io::stdout()).ok();
    let ready = std::io::stderr().write_all(READY);
    let mut word = Vec::new();
    let read = std::io::stdin().take(DISMISSED.len() as u64 + 1).read_to_end(&mut word);
    if ready.is_err() || read.is_err() || word.ends_with(DISMISSED) {
        return;
    }
    if let Some(modes) = modes {
        let _ = tcsetattr(std::io::stdout(), SetArg::TCSANOW, &modes);
    }
    let _ = std::io::stdout().write_all(&super::leaving(word.first() == Some(&PICTURES)));
    let _ = std::io::stdout().flush();
}

/// Does nothing: there is no guard on this platform.
#[cfg(not(unix))]
pub fn run_guard() {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_proc_the_guard_is_started_by_name_if_that_is_the_programs_own() {
        let known = |name: &str| named_program(OsStr::new(name)).is_some();
        assert!(known("gdg-tui") && known("./gdg-tui") && known("/usr/bin/gdg-tui"));
        assert!(!known("sh") && !known("-gdg-tui") && !known("") && !known("/"));
    }
}
