//! Long work beside the main thread, which meanwhile listens for signals.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use miette::{IntoDiagnostic, Report};

use crate::signals::Ending;

/// Polling interval for signals.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Does `work` on a thread called `name`; `None` where a signal came first. The work is then left to end with the program.
///
/// # Errors
/// That the thread cannot be started, or panicked.
pub fn aside<T: Send + 'static>(
    name: &str,
    ending: &Ending,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<Option<T>, Report> {
    let (done, result) = channel();
    // Sending fails only where a signal came and nobody waits any longer.
    let work = move || drop(done.send(work()));
    std::thread::Builder::new().name(name.to_owned()).spawn(work).into_diagnostic()?;
    loop {
        match result.recv_timeout(LOOK_EVERY) {
            Ok(result) => return Ok(Some(result)),
            Err(RecvTimeoutError::Timeout) if ending.number().is_some() => return Ok(None),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(miette::miette!(
                    help = crate::logging::hint(),
                    "an internal error ended the {name} thread"
                ));
            }
        }
    }
}
