//! Signals that end a run: the first in order, the second at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use miette::{IntoDiagnostic, Report};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;

/// What has come so far.
#[derive(Clone, Default)]
pub struct Ending(Arc<AtomicI32>);

impl Ending {
    /// Registers SIGINT, SIGTERM and SIGHUP, but for those that were ignored when the program began (as nohup does). When
    /// a second one comes, `give_back` runs and the process ends.
    ///
    /// # Errors
    /// What the system reports.
    pub fn listen(give_back: fn()) -> Result<Self, Report> {
        let ending = Self::default();
        let ignored = ignored();
        let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP].into_iter().filter(|n| ignored >> (n - 1) & 1 == 0))
            .into_diagnostic()?;
        let first = ending.0.clone();
        let listen = move || {
            for number in signals.forever() {
                tracing::info!("signal {number}");
                if first.swap(number, Ordering::Relaxed) != 0 {
                    give_back();
                    signal_hook::low_level::exit(128 + number);
                }
            }
        };
        std::thread::Builder::new().name("signals".to_owned()).spawn(listen).into_diagnostic()?;
        Ok(ending)
    }

    /// The number of the signal that came, if one did.
    pub fn number(&self) -> Option<i32> {
        Some(self.0.load(Ordering::Relaxed)).filter(|number| *number != 0)
    }

    /// The exit status of a run that a signal ended in order, if one did.
    pub fn status(&self) -> Option<u8> {
        self.number().map(|number| 128 + number as u8)
    }
}

/// Signals ignored by this process, bit n - 1 for number n. Only Linux exposes this without unsafe code; elsewhere
/// none count as ignored.
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
