//! Reads folders on a thread of its own, for as long as the list is open.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::experiment::runs::{Found, Reader};

/// The pause before folders are read again: at least this, and as a multiple of the time that
/// reading took, so that large folders do not keep a core busy.
const PAUSE: Duration = Duration::from_secs(2);
const PAUSE_FACTOR: u32 = 10;

/// How often what has been read so far is shown.
const TOLD_EVERY: Duration = Duration::from_millis(100);

/// What is read, and how to have it read again.
pub struct Reading {
    /// The runs found.
    pub found: watch::Receiver<Arc<Found>>,
    /// Asks for another look; its end ends the thread.
    again: Sender<()>,
}

impl Reading {
    /// Begins to read folders.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn start(folders: &[PathBuf]) -> std::io::Result<Self> {
        let (publish, found) = watch::channel(Arc::default());
        let (again, asked) = channel();
        let reader = Reader::new(folders);
        let read = move || follow(reader, &publish, &asked);
        std::thread::Builder::new().name("runs".to_owned()).spawn(read)?;
        Ok(Self { found, again })
    }

    /// Reads nothing.
    #[cfg(test)]
    pub fn nothing() -> Self {
        Self { found: watch::channel(Arc::default()).1, again: channel().0 }
    }

    /// Has the folders read at once.
    pub fn look_again(&self) {
        // A thread that has ended reads nothing any more.
        let _ = self.again.send(());
    }
}

fn follow(mut reader: Reader, publish: &watch::Sender<Arc<Found>>, asked: &Receiver<()>) {
    loop {
        let began = Instant::now();
        let mut told = began;
        let found = reader.read(|_, so_far| {
            if told.elapsed() > TOLD_EVERY {
                publish.send_replace(Arc::new(so_far()));
                told = Instant::now();
            }
            if publish.is_closed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        publish.send_if_modified(|known| {
            let is_new = **known != found;
            if is_new {
                *known = Arc::new(found);
            }
            is_new
        });
        let pause = PAUSE.max(PAUSE_FACTOR * began.elapsed());
        if asked.recv_timeout(pause) == Err(RecvTimeoutError::Disconnected) {
            return;
        }
    }
}
