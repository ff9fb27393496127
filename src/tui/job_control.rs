//! Job control: stops the program until the shell resumes it, and leaves the terminal alone while
//! it is the shell's.

#[cfg(unix)]
use std::os::fd::AsFd;

#[cfg(unix)]
use nix::unistd::{Pid, getpgid, getpgrp, getppid, getsid, tcgetpgrp};

/// Whether the terminal is this program's now: in the background, it is the shell's, or that of the
/// program that the shell runs.
#[cfg(unix)]
pub fn is_in_foreground(terminal: impl AsFd) -> bool {
    // Of a terminal that is gone, errors tell.
    tcgetpgrp(terminal).map_or(true, |group| group == getpgrp())
}

/// Whether the terminal passes on everything as it is, as this program wants it and no shell does.
#[cfg(unix)]
pub fn is_raw(terminal: impl AsFd) -> bool {
    use nix::sys::termios::{OutputFlags, tcgetattr};

    tcgetattr(terminal).is_ok_and(|modes| !modes.output_flags.contains(OutputFlags::OPOST))
}

/// Whether something would resume the program: a process of the same session, but of another
/// process group, whose descendants this program and its group are, as a shell with job control. In
/// a terminal window of its own (`xterm -e`), there is none.
#[cfg(unix)]
pub fn is_resumable() -> bool {
    let Ok(session) = getsid(None) else { return false };
    let group = getpgrp();
    let mut process = getppid();
    // Processes of a script are in one group: the shell that started it is further up.
    while process.as_raw() > 0 {
        match (getsid(Some(process)), getpgid(Some(process))) {
            (Ok(its), _) if its != session => return false,
            (Ok(_), Ok(its)) if its != group => return true,
            (Ok(_), Ok(_)) => match parent(process) {
                Some(next) => process = next,
                None => return false,
            },
            _ => return false,
        }
    }
    false
}

/// Returns a process's parent.
#[cfg(target_os = "linux")]
fn parent(process: Pid) -> Option<Pid> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let parent = status.lines().find_map(|line| line.strip_prefix("PPid:"))?;
    parent.trim().parse().ok().map(Pid::from_raw)
}

/// Returns a process's parent.
#[cfg(all(unix, not(target_os = "linux")))]
fn parent(process: Pid) -> Option<Pid> {
    use sysinfo::{ProcessRefreshKind, ProcessesToUpdate, System};

    let id = sysinfo::Pid::from_u32(process.as_raw().cast_unsigned());
    let mut system = System::new();
    system.refresh_processes_specifics(
        ProcessesToUpdate::Some(&[id]),
        false,
        ProcessRefreshKind::nothing(),
    );
    let parent = system.process(id)?.parent()?;
    Some(Pid::from_raw(parent.as_u32().cast_signed()))
}

/// Stops the process group, as the key does that the terminal's driver handles: of a script, the
/// shell resumes all or nothing.
///
/// # Errors
/// Errors of the system.
#[cfg(unix)]
pub fn stop() -> std::io::Result<()> {
    use nix::sys::signal::{Signal, killpg};
    // SIGTSTP would be handled by this program.
    Ok(killpg(getpgrp(), Signal::SIGSTOP)?)
}

/// Whether the terminal is this program's: always.
#[cfg(not(unix))]
pub fn is_in_foreground<T>(_: T) -> bool {
    true
}

/// Whether the terminal is as this program wants it: always.
#[cfg(not(unix))]
pub fn is_raw<T>(_: T) -> bool {
    true
}

/// Whether something would resume the program: not on this platform.
#[cfg(not(unix))]
pub fn is_resumable() -> bool {
    false
}

/// Does nothing.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn stop() -> std::io::Result<()> {
    Ok(())
}
