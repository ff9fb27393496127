//! Writes to the terminal on a thread of its own: a terminal that does not read, such as one behind a stalled connection,
//! holds up nothing else.

use std::io::{ErrorKind, Write};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};

/// Bytes that are written at once: so much is known of how far a slow terminal is.
const PIECE: usize = 4096;

/// How many times longer a terminal may take that reads, but slowly.
const LIMITS: u32 = 4;

/// Writes bytes in the order in which they are given.
pub struct Writer(Arc<Shared>);

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    /// Notified when there is something to write, and when all is written.
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// What is to be written next.
    waiting: Vec<u8>,
    is_writing: bool,
    /// Pieces written so far.
    pieces: u64,
    /// When the latest write ended, and how long it took.
    latest: Option<(Instant, Duration)>,
    error: Option<std::io::Error>,
}

impl Writer {
    /// Starts a thread that writes to `to`.
    ///
    /// # Errors
    /// The system starts no more threads.
    pub fn start(to: impl Write + Send + 'static) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let own = shared.clone();
        std::thread::Builder::new().name("terminal output".to_owned()).spawn(move || own.write_all(to))?;
        Ok(Self(shared))
    }

    /// Whether all has been written, or has failed.
    pub fn is_idle(&self) -> bool {
        self.0.state.lock().is_idle()
    }

    /// Has bytes written after those that wait already.
    ///
    /// # Errors
    /// An earlier write failed: nothing that was given since will be written.
    pub fn send(&self, bytes: &[u8]) -> std::io::Result<()> {
        let mut state = self.0.state.lock();
        if let Some(error) = &state.error {
            return Err(std::io::Error::new(error.kind(), error.to_string()));
        }
        state.waiting.extend(bytes);
        self.0.changed.notify_all();
        Ok(())
    }

    /// Waits until all is written, as long as something is written within each `limit`, [`LIMITS`] of them at most; returns
    /// whether all has been.
    pub fn wait(&self, limit: Duration) -> bool {
        let last = Instant::now() + LIMITS * limit;
        let mut state = self.0.state.lock();
        let (mut pieces, mut end) = (state.pieces, Instant::now() + limit);
        while !state.is_idle() && !self.0.changed.wait_until(&mut state, end).timed_out() {
            if state.pieces > pieces {
                (pieces, end) = (state.pieces, last.min(Instant::now() + limit));
            }
        }
        state.is_idle() && state.error.is_none()
    }

    /// Returns when the latest write ended, and how long it took.
    pub fn latest(&self) -> Option<(Instant, Duration)> {
        self.0.state.lock().latest
    }
}

impl State {
    fn is_idle(&self) -> bool {
        self.waiting.is_empty() && !self.is_writing
    }
}

impl Shared {
    /// Writes what is given until an error.
    fn write_all(&self, mut to: impl Write) {
        loop {
            let mut state = self.state.lock();
            while state.waiting.is_empty() {
                self.changed.wait(&mut state);
            }
            let bytes = std::mem::take(&mut state.waiting);
            state.is_writing = true;
            drop(state);
            let began = Instant::now();
            let written = bytes.chunks(PIECE).try_for_each(|piece| {
                write_patiently(&mut to, piece)?;
                self.state.lock().pieces += 1;
                self.changed.notify_all();
                Ok(())
            });
            let mut state = self.state.lock();
            state.is_writing = false;
            state.latest = Some((Instant::now(), began.elapsed()));
            let failed = written.is_err();
            if let Err(error) = written {
                state.waiting.clear();
                state.error = Some(error);
            }
            self.changed.notify_all();
            if failed {
                return;
            }
        }
    }
}

/// Writes all bytes, however long that takes, also if another program has set the terminal not to block.
fn write_patiently(to: &mut impl Write, mut bytes: &[u8]) -> std::io::Result<()> {
    while !bytes.is_empty() {
        match to.write(bytes) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(count) => bytes = &bytes[count..],
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(Duration::from_millis(5)),
            Err(error) => return Err(error),
        }
    }
    to.flush()
}

/// Returns the writer to the terminal.
///
/// # Errors
/// The system starts no more threads, or opens no more files.
pub fn terminal() -> std::io::Result<&'static Writer> {
    static WRITER: OnceLock<Writer> = OnceLock::new();
    if let Some(writer) = WRITER.get() {
        return Ok(writer);
    }
    let writer = Writer::start(output()?)?;
    Ok(WRITER.get_or_init(|| writer))
}

/// Returns standard output, without the library's buffer, and its lock, which a write that blocks would keep.
#[cfg(unix)]
fn output() -> std::io::Result<impl Write + Send> {
    use std::os::fd::AsFd;
    Ok(std::fs::File::from(std::io::stdout().as_fd().try_clone_to_owned()?))
}

/// Returns standard output.
#[cfg(not(unix))]
fn output() -> std::io::Result<impl Write + Send> {
    Ok(std::io::stdout())
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    /// Reads from nothing until it is told to.
    fn stalled() -> (Writer, std::io::PipeReader) {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        (Writer::start(writer).expect("a thread"), reader)
    }

    #[test]
    fn a_reader_that_does_not_read_delays_nothing_and_loses_nothing() {
        let (writer, mut reader) = stalled();
        let large = vec![b'x'; 1 << 20];
        writer.send(&large).expect("accepted");
        assert!(!writer.wait(Duration::from_millis(20)) && !writer.is_idle());
        writer.send(b"end").expect("accepted");
        let mut read = vec![0; large.len() + 3];
        reader.read_exact(&mut read).expect("all of it");
        assert!(read.ends_with(b"xend") && writer.wait(Duration::from_mins(1)));
        assert!(writer.latest().is_some());
    }

    #[test]
    fn a_reader_that_is_gone_is_an_error_and_no_wait() {
        let (writer, reader) = stalled();
        drop(reader);
        writer.send(b"x").expect("not known yet");
        assert!(!writer.wait(Duration::from_mins(1)));
        assert!(writer.is_idle() && writer.send(b"y").is_err());
    }
}
