//! Termination signals: the first one ends a run gracefully; the same one again, later, ends it at
//! once.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicI32;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use miette::{IntoDiagnostic, Report, WrapErr};
use nix::sys::signal::{SigSet, Signal};
use signal_hook::consts::{
    SIGALRM, SIGHUP, SIGINT, SIGPROF, SIGTERM, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use signal_hook::iterator::Signals;

use crate::process::waiting::{ONCE_MORE, TWICE, Waiting};
use gdg::job::Job;
use gdg::printing;

/// Turns writing beyond the file size limit (`ulimit -f`), which would end the program, into an
/// error like a full disk.
pub fn survive_file_size_limit() -> std::io::Result<()> {
    signal_hook::flag::register(SIGXFSZ, Arc::default()).map(drop)
}

/// A signal repeated within this time counts once: `timeout` signals both the program and its
/// process group.
const SAME_SIGNAL: Duration = Duration::from_millis(200);

/// Time limit for restoring the terminal before an immediate exit: the terminal may not read.
const LONGEST_RESTORE: Duration = Duration::from_millis(500);

/// Signals that would end the program with nothing saved: from terminals and users, from batch systems
/// (SIGUSR1, SIGUSR2 and SIGXCPU warn of a limit), and from inherited timers. Faults and SIGQUIT,
/// which asks for a core dump, keep their default action.
const ENDING: [i32; 9] =
    [SIGINT, SIGTERM, SIGHUP, SIGUSR1, SIGUSR2, SIGXCPU, SIGALRM, SIGVTALRM, SIGPROF];

/// Further ones on Linux: SIGSTKFLT, SIGIO, SIGPWR (when power fails or a container is to stop), and
/// the real-time signals, less those that C libraries use.
const LINUX: [std::ops::RangeInclusive<i32>; 3] = [16..=16, 29..=30, 34..=64];

/// Signals that may come twice though nobody asks twice, and so never end the program at once: both
/// the shell and the system send SIGHUP when a terminal closes, and timers keep firing.
const REPEATING: [i32; 5] = [SIGHUP, SIGXCPU, SIGALRM, SIGVTALRM, SIGPROF];

/// The termination signal received so far, if any.
#[derive(Clone, Default)]
pub struct TerminationSignal {
    number: Arc<AtomicI32>,
    /// Cancelled by it.
    pub job: Job,
}

impl TerminationSignal {
    /// Registers the signals that end the program, except those that were ignored at startup (as
    /// under nohup). While the program takes long to end, prints what it waits for to standard
    /// error.
    pub fn listen() -> Result<Self, Report> {
        Self::listen_with(None)
    }

    /// Like [`Self::listen`], for the interface, which shows itself what it waits for. An immediate
    /// exit first calls `restore_terminal`. Must be called before the interface's threads start.
    pub fn listen_in_interface(restore_terminal: fn()) -> Result<Self, Report> {
        // In the background, the system would stop the whole program for using the terminal, which
        // could then not even exit. If this fails, it stops like any other.
        let _ = SigSet::from_iter([Signal::SIGTTOU, Signal::SIGTTIN]).thread_block();
        Self::listen_with(Some(restore_terminal))
    }

    fn listen_with(restore_terminal: Option<fn()>) -> Result<Self, Report> {
        let termination = Self::default();
        let ignored = ignored_signals();
        let is_heard = |number: &i32| ignored >> (number - 1) & 1 == 0;
        let mut signals = Signals::new(ENDING.into_iter().filter(is_heard)).into_diagnostic()?;
        let is_there = |number: &i32| cfg!(target_os = "linux") && is_heard(number);
        for number in LINUX.into_iter().flatten().filter(is_there) {
            // The C library reserves some real-time signals.
            let _ = signals.add_signal(number);
        }
        let own = termination.clone();
        let listen = move || {
            let (mut arrivals, mut waiting) = (Arrivals::default(), None);
            for number in signals.forever() {
                log::info!("signal {number}");
                if arrivals.is_repeated_request(number, Instant::now()) {
                    end_at_once(restore_terminal, own.number().unwrap_or(number));
                }
                if own.number.compare_exchange(0, number, Relaxed, Relaxed).is_ok() {
                    printing::hurry();
                    own.job.cancel();
                    let how_to_end = if number == SIGINT { ONCE_MORE } else { TWICE };
                    waiting = restore_terminal
                        .is_none()
                        .then(|| Waiting::begin(&own.job, how_to_end, || {}));
                }
            }
            drop(waiting);
        };
        let begun = std::thread::Builder::new().name("signals".to_owned()).spawn(listen);
        begun.into_diagnostic().wrap_err("a thread cannot be started; ulimit -u limits them")?;
        Ok(termination)
    }

    pub fn number(&self) -> Option<i32> {
        Some(self.number.load(Relaxed)).filter(|number| *number != 0)
    }

    /// Returns the exit status of a run ended gracefully by a signal, if there was one.
    pub fn status(&self) -> Option<u8> {
        self.number().map(|number| 128 + number as u8)
    }
}

/// When each signal arrived last.
#[derive(Default)]
struct Arrivals(BTreeMap<i32, Instant>);

impl Arrivals {
    /// Records a signal; returns whether it repeats the request to end. Different signals are one
    /// request: the end of a login session sends SIGTERM, SIGCONT and SIGHUP, and batch systems
    /// escalate from one signal to the next.
    fn is_repeated_request(&mut self, number: i32, now: Instant) -> bool {
        let before = self.0.insert(number, now);
        let again =
            before.is_some_and(|before| now.saturating_duration_since(before) >= SAME_SIGNAL);
        again && !REPEATING.contains(&number)
    }
}

fn end_at_once(restore_terminal: Option<fn()>, number: i32) -> ! {
    if let Some(restore) = restore_terminal {
        let (done, is_done) = channel();
        std::thread::spawn(move || {
            restore();
            // The receiver is gone if the terminal was too slow.
            let _ = done.send(());
        });
        let _ = is_done.recv_timeout(LONGEST_RESTORE);
    }
    signal_hook::low_level::exit(128 + number)
}

/// Returns the signals that this process ignores as bits, the lowest for number 1, where /proc lists
/// them.
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_same_signal_again_after_a_moment_repeats_the_request_to_end() {
        let began = Instant::now();
        let wishes = |signals: &[(i32, u64)]| {
            let mut arrivals = Arrivals::default();
            let at = |(number, ms): &(i32, u64)| {
                arrivals.is_repeated_request(*number, began + Duration::from_millis(*ms))
            };
            signals.iter().map(at).collect::<Vec<_>>().contains(&true)
        };
        assert!(wishes(&[(SIGINT, 0), (SIGINT, 300)]), "Ctrl-C again");
        assert!(wishes(&[(SIGTERM, 0), (SIGHUP, 1), (SIGTERM, 900)]));
        for together in [
            &[(SIGTERM, 0), (SIGTERM, 5)][..],
            &[(SIGTERM, 0), (SIGHUP, 0)],
            &[(SIGINT, 0), (SIGTERM, 10_000)],
            &[(SIGUSR1, 0), (SIGTERM, 30_000)],
            &[(SIGHUP, 0), (SIGHUP, 700)],
            &[(SIGXCPU, 0), (SIGXCPU, 1000), (SIGXCPU, 2000)],
        ] {
            assert!(!wishes(together), "{together:?}");
        }
    }
}
