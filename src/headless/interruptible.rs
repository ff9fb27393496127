//! Runs long work on another thread while the main thread listens for signals.

use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use miette::Report;
use parking_lot::Mutex;

use crate::host::signals::TerminationSignal;

/// Polling interval for signals.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Runs `work` on a thread called `name`, or on this one if none can be started. Returns `None` if
/// a signal arrives first; the thread then ends with the program.
///
/// # Errors
/// The thread panics.
pub fn run_interruptibly<T: Send + 'static>(
    name: &str,
    termination: &TerminationSignal,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<Option<T>, Report> {
    let (done, result) = channel();
    // Sending fails only if a signal has ended the wait.
    let work = Arc::new(Mutex::new(Some(move || drop(done.send(work())))));
    let theirs = work.clone();
    let run = move || {
        let own = theirs.lock().take();
        own.into_iter().for_each(|work| work());
    };
    if let Err(error) = std::thread::Builder::new().name(name.to_owned()).spawn(run) {
        log::warn!("no thread for the {name}: {error}");
        let own = work.lock().take();
        own.into_iter().for_each(|work| work());
    }
    loop {
        match result.recv_timeout(POLL_INTERVAL) {
            Ok(result) => return Ok(Some(result)),
            Err(RecvTimeoutError::Timeout) if termination.number().is_some() => return Ok(None),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(miette::miette!(
                    help = crate::host::logging::hint(),
                    "an internal error ended the {name} thread"
                ));
            }
        }
    }
}
