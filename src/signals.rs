//! Termination signals: the first one ends a run gracefully, the second one immediately.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::{Duration, Instant};

use miette::{IntoDiagnostic, Report};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator::Signals;

/// Makes writing beyond the limit on the size of files (`ulimit -f`) an error like a full disk, which would otherwise end
/// the program.
///
/// # Errors
/// Returns the system's error.
pub fn survive_file_size_limit() -> std::io::Result<()> {
    signal_hook::flag::register(SIGXFSZ, Arc::default()).map(drop)
}

/// A signal that arrives again so soon is the same one: `timeout` sends its own to the program and to its group.
const SAME_SIGNAL: Duration = Duration::from_millis(200);

/// The termination signal received so far, if any.
#[derive(Clone, Default)]
pub struct TerminationSignal(Arc<AtomicI32>);

impl TerminationSignal {
    /// Registers the termination signals SIGINT, SIGTERM and SIGHUP, except those that were ignored at startup (as
    /// under nohup). On a second signal, runs `restore_terminal` and exits.
    ///
    /// # Errors
    /// Returns the system's error.
    pub fn listen(restore_terminal: fn()) -> Result<Self, Report> {
        let termination = Self::default();
        let ignored_signals = ignored_signals();
        let mut signals =
            Signals::new([SIGINT, SIGTERM, SIGHUP].into_iter().filter(|n| ignored_signals >> (n - 1) & 1 == 0))
                .into_diagnostic()?;
        let first = termination.0.clone();
        let listen = move || {
            let mut latest: Option<(i32, Instant)> = None;
            for number in signals.forever() {
                tracing::info!("signal {number}");
                if latest.is_some_and(|(same, at)| same == number && at.elapsed() < SAME_SIGNAL) {
                    continue;
                }
                latest = Some((number, Instant::now()));
                if first.swap(number, Ordering::Relaxed) != 0 {
                    restore_terminal();
                    signal_hook::low_level::exit(128 + number);
                }
            }
        };
        std::thread::Builder::new().name("signals".to_owned()).spawn(listen).into_diagnostic()?;
        Ok(termination)
    }

    /// Returns the number of the signal received, if any.
    pub fn number(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Relaxed)).filter(|number| *number != 0)
    }

    /// Returns the exit status of a run ended gracefully by a signal, if there was one.
    pub fn status(&self) -> Option<u8> {
        self.number().map(|number| 128 + number as u8)
    }
}

/// Returns the signals ignored by this process, bit n - 1 for number n. Only Linux exposes this without unsafe code;
/// elsewhere none count as ignored.
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
