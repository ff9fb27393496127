//! Job control: stops the program until the shell resumes it, and leaves the terminal alone while
//! it is the shell's.

#[cfg(unix)]
use std::os::fd::AsFd;

#[cfg(unix)]
use nix::unistd::{Pid, getpgid, getpgrp, getppid, getsid, tcgetpgrp};

/// Whether the program is in the terminal's foreground process group.
#[cfg(unix)]
pub fn is_in_foreground(terminal: impl AsFd) -> bool {
    // If the terminal is gone, later errors report that.
    tcgetpgrp(terminal).map_or(true, |group| group == getpgrp())
}

/// Whether the terminal is in raw mode, which no shell leaves it in.
#[cfg(unix)]
pub fn is_raw(terminal: impl AsFd) -> bool {
    use nix::sys::termios::{OutputFlags, tcgetattr};

    tcgetattr(terminal).is_ok_and(|modes| !modes.output_flags.contains(OutputFlags::OPOST))
}

/// Whether something would resume the program: an ancestor in the same session but in another
/// process group, such as a shell with job control. With `xterm -e`, there is none.
#[cfg(unix)]
pub fn is_resumable() -> bool {
    let Ok(session) = getsid(None) else { return false };
    let group = getpgrp();
    let mut process = getppid();
    // The processes of a script share a group: the shell that started it is further up.
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

/// Stops the process group, as Ctrl-Z in cooked mode does: a shell resumes a script's processes
/// only together.
///
/// # Errors
/// Errors of the system.
#[cfg(unix)]
pub fn stop() -> std::io::Result<()> {
    use nix::sys::signal::{Signal, killpg};
    // SIGTSTP would be handled by this program.
    Ok(killpg(getpgrp(), Signal::SIGSTOP)?)
}

/// Always in the foreground on this platform.
#[cfg(not(unix))]
pub fn is_in_foreground<T>(_: T) -> bool {
    true
}

/// Always in raw mode on this platform.
#[cfg(not(unix))]
pub fn is_raw<T>(_: T) -> bool {
    true
}

/// Nothing would resume the program on this platform.
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
