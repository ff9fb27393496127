//! Terminal input, read on its own thread.
//!
//! crossterm mistakes terminal replies for keys and buffers an unfinished paste forever. So this
//! module splits the bytes into sequences itself, and `terminput` only parses the sequences.

mod scan;

#[cfg(unix)]
use std::sync::Arc;
#[cfg(unix)]
use std::sync::atomic::{AtomicBool, Ordering};

pub use scan::Input;

#[cfg(unix)]
use super::job_control::is_in_foreground;

/// Capacity of the event queue; while it is full, input stays in the terminal's buffer.
#[cfg(unix)]
const WAITING: usize = 256;

/// Interval for checking whether the program is in the foreground again, in milliseconds.
#[cfg(unix)]
const IN_BACKGROUND: u16 = 50;

/// A stream of terminal input.
pub struct InputStream {
    #[cfg(unix)]
    inputs: tokio::sync::mpsc::Receiver<Input>,
    /// Whether nothing is read.
    #[cfg(unix)]
    pauses: Arc<AtomicBool>,
    /// Ends the thread when dropped.
    #[cfg(unix)]
    _stop: std::os::unix::net::UnixStream,
    #[cfg(not(unix))]
    events: crossterm::event::EventStream,
}

#[cfg(unix)]
impl InputStream {
    /// Starts reading standard input if it is a terminal, otherwise the controlling terminal.
    ///
    /// # Errors
    /// There is no terminal to read from.
    pub fn start() -> std::io::Result<Self> {
        use std::io::{IsTerminal, stdin};
        use std::os::fd::AsFd;

        let input = stdin();
        let terminal = if input.is_terminal() {
            std::fs::File::from(input.as_fd().try_clone_to_owned()?)
        } else {
            std::fs::File::open("/dev/tty")?
        };
        let (stop, stopped) = std::os::unix::net::UnixStream::pair()?;
        let (sender, inputs) = tokio::sync::mpsc::channel(WAITING);
        let pauses = Arc::new(AtomicBool::new(false));
        let is_paused = pauses.clone();
        let read = move || {
            if let Err(error) = read_all(&terminal, &stopped, &is_paused, &sender) {
                log::info!("reading from the terminal: {error}");
            }
        };
        std::thread::Builder::new().name("terminal input".to_owned()).spawn(read)?;
        Ok(Self { inputs, pauses, _stop: stop })
    }

    /// Leaves what is typed from now on to others, or no longer.
    pub fn pause(&self, pauses: bool) {
        self.pauses.store(pauses, Ordering::SeqCst);
    }

    /// Waits for the next input. Nothing is lost if the future is dropped.
    ///
    /// # Errors
    /// The terminal is gone.
    pub async fn next(&mut self) -> std::io::Result<Input> {
        self.inputs.recv().await.ok_or_else(|| std::io::Error::other("the terminal is gone"))
    }

    /// Returns the next input if it has been read already.
    pub fn read_already(&mut self) -> Option<Input> {
        self.inputs.try_recv().ok()
    }
}

/// Reads until the terminal is gone or the receiver is dropped.
#[cfg(unix)]
fn read_all(
    terminal: &std::fs::File,
    stopped: &std::os::unix::net::UnixStream,
    is_paused: &AtomicBool,
    to: &tokio::sync::mpsc::Sender<Input>,
) -> std::io::Result<()> {
    use std::io::Read;
    use std::os::fd::AsFd;

    use nix::errno::Errno;
    use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

    let mut scanner = scan::Scanner::default();
    let mut bytes = [0; 4096];
    loop {
        let patience = scanner.patience().and_then(|patience| PollTimeout::try_from(patience).ok());
        let mut ready = [terminal.as_fd(), stopped.as_fd()]
            .map(|source| PollFd::new(source, PollFlags::POLLIN));
        let found = match poll(&mut ready, patience.unwrap_or(PollTimeout::NONE)) {
            Err(Errno::EINTR) => continue,
            Err(error) => return Err(error.into()),
            Ok(0) => scanner.give_up(),
            Ok(_) if ready[1].any() == Some(true) => return Ok(()),
            // In the background, and from the moment on at which the program gives the terminal back,
            // input belongs to the shell.
            Ok(_) if is_paused.load(Ordering::SeqCst) || !is_in_foreground(terminal) => {
                await_stop(stopped)?;
                continue;
            }
            Ok(_) => match { terminal }.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(count) => scanner.read(&bytes[..count]),
                Err(error)
                    if matches!(
                        error.kind(),
                        std::io::ErrorKind::Interrupted | std::io::ErrorKind::WouldBlock
                    ) =>
                {
                    continue;
                }
                // The program may have moved to the background meanwhile.
                Err(_) if !is_in_foreground(terminal) => continue,
                Err(error) => return Err(error),
            },
        };
        for input in found {
            if to.blocking_send(input).is_err() {
                return Ok(());
            }
        }
    }
}

/// Waits briefly, or until reading is to end.
#[cfg(unix)]
fn await_stop(stopped: &std::os::unix::net::UnixStream) -> std::io::Result<()> {
    use std::os::fd::AsFd;

    use nix::errno::Errno;
    use nix::poll::{PollFd, PollFlags, poll};

    match poll(&mut [PollFd::new(stopped.as_fd(), PollFlags::POLLIN)], IN_BACKGROUND) {
        Ok(_) | Err(Errno::EINTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

#[cfg(not(unix))]
impl InputStream {
    /// Starts reading.
    ///
    /// # Errors
    /// None.
    pub fn start() -> std::io::Result<Self> {
        Ok(Self { events: crossterm::event::EventStream::new() })
    }

    /// Waits for the next input.
    ///
    /// # Errors
    /// The terminal is gone.
    pub async fn next(&mut self) -> std::io::Result<Input> {
        use futures_util::StreamExt;

        let event = self.events.next().await;
        event
            .unwrap_or_else(|| Err(std::io::Error::other("the terminal is gone")))
            .map(Input::Event)
    }

    /// Reading goes on: nothing suspends the program here.
    pub fn pause(&self, _: bool) {}

    /// Nothing is read ahead.
    pub fn read_already(&mut self) -> Option<Input> {
        None
    }
}
