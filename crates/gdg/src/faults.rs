//! Records the panics of threads for the front ends to show, and injects faults for tests.
//!
//! The panic hook records the message of every thread that panics, whether or not the thread is
//! ever joined. `GDG_TUI_FAULTS=THREAD=panic@N` makes a thread panic when it passes its fault point
//! for the Nth time, `THREAD=delay:MS@N` makes it sleep, and `POINT=once@N` makes an operation fail.
//! Several faults are separated by commas.

use std::backtrace::Backtrace;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use parking_lot::Mutex;

use crate::text::{sanitized, truncated};

/// The environment variable that tests set.
const ENV_VARIABLE: &str = "GDG_TUI_FAULTS";

/// Maximum number of failures kept, so that a repeating one cannot fill the memory.
const MAX_FAILURES: usize = 100;

/// Maximum number of characters of a panic message to show.
const MAX_MESSAGE_CHARS: usize = 300;

static FAILURES: Mutex<Vec<ThreadPanic>> = Mutex::new(Vec::new());

/// Whether a front end shows the panics of other threads, so that they need not be printed.
static SHOWN_BY_INTERFACE: AtomicBool = AtomicBool::new(false);

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("internal error in thread {thread}: {message}")]
pub struct ThreadPanic {
    /// The thread's name.
    pub thread: String,
    /// The message and its location in the source.
    pub message: String,
}

/// Installs a panic hook that records and logs every panic. It prints panics of the main thread,
/// and those of other threads unless an interface shows them.
pub fn install_panic_hook() {
    std::panic::set_hook(Box::new(|info| {
        let thread = std::thread::current();
        let name = thread.name().unwrap_or("unnamed");
        let text = truncated(info.payload_as_str().unwrap_or("no message"), MAX_MESSAGE_CHARS);
        let place = info.location().map(|at| format!(" ({}:{})", at.file(), at.line()));
        let message = sanitized(&(text + &place.unwrap_or_default()));
        let failure = ThreadPanic { thread: name.to_owned(), message };
        log::error!("thread {name} panicked: {}", failure.message);
        if name == "main" || !SHOWN_BY_INTERFACE.load(Ordering::Relaxed) {
            crate::printing::eprint_line(&failure.to_string());
        }
        let mut failures = FAILURES.lock();
        if failures.len() < MAX_FAILURES {
            failures.push(failure);
        }
        drop(failures);
        // Last, because resolving the names of functions takes a second or more.
        log::error!("thread {name}: {}", Backtrace::force_capture());
    }));
}

pub fn show_in_interface(shown: bool) {
    SHOWN_BY_INTERFACE.store(shown, Ordering::Relaxed);
}

/// Returns and clears the failures recorded since the last call.
pub fn take_failures() -> Vec<ThreadPanic> {
    std::mem::take(&mut FAILURES.lock())
}

struct Fault {
    point: String,
    kind: FaultKind,
    /// The pass at which it triggers, from 1.
    at: u64,
    passes: AtomicU64,
}

enum FaultKind {
    Panic,
    Delay(Duration),
    Fail,
}

fn injected_faults() -> &'static [Fault] {
    static FAULTS: OnceLock<Vec<Fault>> = OnceLock::new();
    FAULTS.get_or_init(|| {
        let text = std::env::var(ENV_VARIABLE).unwrap_or_default();
        text.split(',').filter(|fault| !fault.is_empty()).filter_map(parse).collect()
    })
}

fn parse(text: &str) -> Option<Fault> {
    let (point, kind) = text.split_once('=')?;
    let (kind, at) = kind.split_once('@').unwrap_or((kind, "1"));
    let kind = match kind.split_once(':') {
        Some(("delay", ms)) => FaultKind::Delay(Duration::from_millis(ms.parse().ok()?)),
        None if kind == "panic" => FaultKind::Panic,
        None if kind == "once" => FaultKind::Fail,
        _ => return None,
    };
    Some(Fault { point: point.to_owned(), kind, at: at.parse().ok()?, passes: AtomicU64::new(0) })
}

/// Marks a point that a thread passes repeatedly; returns whether the operation there should fail.
/// Without injected faults it only checks an empty list.
///
/// # Panics
/// If a test injects a panic at this point.
pub fn point(name: &str) -> bool {
    let mut fails = false;
    for fault in injected_faults().iter().filter(|fault| fault.point == name) {
        if fault.passes.fetch_add(1, Ordering::Relaxed) + 1 == fault.at {
            match fault.kind {
                FaultKind::Panic => panic!("injected fault in {name}"),
                FaultKind::Delay(time) => std::thread::sleep(time),
                FaultKind::Fail => fails = true,
            }
        }
    }
    fails
}
