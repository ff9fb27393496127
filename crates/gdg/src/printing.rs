//! Standard output and standard error, each written by its own thread, so that printing does not
//! block on the reader.
//!
//! A reader may stop reading: a terminal after Ctrl-S or behind a connection that hangs, a pager, a
//! pipe that nobody empties. Writing then blocks for as long as that lasts, and a program that
//! waits for it neither saves nor obeys signals. Output is therefore queued, complete and in order,
//! and printing waits only briefly (`PATIENCE`), so that a reader who keeps up is never behind.

use std::io::{self, ErrorKind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex, MutexGuard};

use crate::text::sanitized_lines;

/// How long printing waits for the reader if nothing else is queued. Errors are then reported where
/// they occur.
const PATIENCE: Duration = Duration::from_millis(50);

/// Sizes of the queue in bytes: days of records, above which printing waits for the reader or a
/// signal, and that above which frames of a progress bar are dropped.
const MAX_QUEUED: usize = 16 << 20;
const MAX_QUEUED_FRAMES: usize = 1 << 16;

/// Bytes per write: few, so that a slow reader's progress is noticed.
const CHUNK: usize = 4096;

/// The interval between looks for a reader, and how long one that reads nothing has after a signal.
const POLL_INTERVAL: Duration = Duration::from_millis(20);
const IDLE_AT_END: Duration = Duration::from_millis(300);

/// Whether a signal ends the program: nothing waits for readers any more.
static HURRIES: AtomicBool = AtomicBool::new(false);

// Written without the locks of the standard library, which a blocked writer would hold.
static STDOUT: OutputStream =
    OutputStream::new("output", |bytes| Ok(nix::unistd::write(io::stdout(), bytes)?));
static STDERR: OutputStream =
    OutputStream::new("errors", |bytes| Ok(nix::unistd::write(io::stderr(), bytes)?));

/// Bytes on their way to a reader.
pub struct OutputStream {
    /// Name of the thread that writes.
    name: &'static str,
    /// Writes some of the bytes, which may block.
    write: fn(&[u8]) -> io::Result<usize>,
    queue: Mutex<Queue>,
    changed: Condvar,
}

struct Queue {
    /// Bytes that the thread has not taken yet.
    bytes: Vec<u8>,
    /// Whether the thread is writing what it took, how many bytes it has written so far, and whether an
    /// error has cut off a line, which is ended first then.
    is_writing: bool,
    written: usize,
    is_torn: bool,
    /// The latest unreported error.
    error: Option<io::Error>,
    /// Whether the thread runs; `None` before the first byte.
    has_thread: Option<bool>,
    /// When the thread last finished writing, and how long that took.
    latest: Option<(Instant, Duration)>,
}

impl Queue {
    /// Whether anything is not written yet.
    fn is_behind(&self) -> bool {
        self.is_writing || !self.bytes.is_empty()
    }

    /// Takes the latest error; none after a signal, which a closing terminal sends.
    fn outcome(&mut self) -> io::Result<()> {
        self.error.take().filter(|_| !hurries()).map_or(Ok(()), Err)
    }
}

impl OutputStream {
    const fn new(name: &'static str, write: fn(&[u8]) -> io::Result<usize>) -> Self {
        let queue = Queue {
            bytes: Vec::new(),
            is_writing: false,
            written: 0,
            is_torn: false,
            error: None,
            has_thread: None,
            latest: None,
        };
        Self { name, write, queue: Mutex::new(queue), changed: Condvar::new() }
    }

    /// Prints `bytes`, later if the reader does not keep up; errors may be those of earlier bytes.
    pub fn print(&'static self, bytes: &[u8]) -> io::Result<()> {
        let mut queue = self.queue.lock();
        while queue.bytes.len() > MAX_QUEUED && !hurries() {
            self.changed.wait_for(&mut queue, POLL_INTERVAL);
        }
        let was_behind = queue.is_behind();
        self.add(&mut queue, bytes);
        let deadline = Instant::now() + PATIENCE;
        while !was_behind && queue.is_behind() && !hurries() {
            if self.changed.wait_until(&mut queue, deadline).timed_out() {
                break;
            }
        }
        queue.outcome()
    }

    /// Prints `bytes` without waiting for the reader; errors are those of earlier bytes.
    pub fn send(&'static self, bytes: &[u8]) -> io::Result<()> {
        let mut queue = self.queue.lock();
        self.add(&mut queue, bytes);
        queue.outcome()
    }

    /// Prints a frame of a progress bar without waiting; leaves it out if the reader is far behind.
    pub fn print_frame(&'static self, bytes: &[u8]) {
        let mut queue = self.queue.lock();
        if queue.bytes.len() < MAX_QUEUED_FRAMES {
            self.add(&mut queue, bytes);
        }
    }

    /// Whether the reader has not read everything yet.
    pub fn is_behind(&self) -> bool {
        self.queue.lock().is_behind()
    }

    /// Returns when the latest bytes were written, and how long that took.
    pub fn latest(&self) -> Option<(Instant, Duration)> {
        self.queue.lock().latest
    }

    /// Waits until everything is written, or for a signal if the reader does not read.
    pub fn flush(&'static self) -> io::Result<()> {
        self.wait(hurries).outcome()
    }

    /// Waits until everything is written, but only briefly for a reader that does not read; returns
    /// whether it is.
    pub fn flush_briefly(&'static self) -> bool {
        let queue = self.wait(|| true);
        !queue.is_behind() && queue.error.is_none()
    }

    /// Waits until everything is written, or until nothing moves and somebody `gives_up`.
    fn wait(&'static self, gives_up: impl Fn() -> bool) -> MutexGuard<'static, Queue> {
        let mut queue = self.queue.lock();
        let (mut written, mut moved) = (queue.written, Instant::now());
        while queue.is_behind() && !(gives_up() && moved.elapsed() > IDLE_AT_END) {
            if queue.written != written {
                (written, moved) = (queue.written, Instant::now());
            }
            self.changed.wait_for(&mut queue, POLL_INTERVAL);
        }
        queue
    }

    /// Adds `bytes` to the queue, and starts the thread unless it runs; without one, writes them.
    fn add(&'static self, queue: &mut MutexGuard<Queue>, bytes: &[u8]) {
        queue.bytes.extend_from_slice(bytes);
        let has_thread = *queue.has_thread.get_or_insert_with(|| {
            let thread = std::thread::Builder::new().name(self.name.to_owned());
            thread.spawn(|| self.write_forever()).is_ok()
        });
        if has_thread {
            self.changed.notify_all();
        } else {
            self.write_queued(queue);
        }
    }

    fn write_forever(&self) {
        let mut queue = self.queue.lock();
        loop {
            while queue.bytes.is_empty() {
                self.changed.wait(&mut queue);
            }
            self.write_queued(&mut queue);
        }
    }

    fn write_queued(&self, queue: &mut MutexGuard<Queue>) {
        let end: &[u8] = if queue.is_torn { b"\n" } else { b"" };
        let taken = [end, &std::mem::take(&mut queue.bytes)].concat();
        queue.is_writing = true;
        let (before, began) = (queue.written, Instant::now());
        let outcome = MutexGuard::unlocked(queue, || self.write_all(&taken));
        queue.is_writing = false;
        let last = taken[..queue.written - before].last();
        queue.is_torn = outcome.is_err() && last.map_or(queue.is_torn, |last| *last != b'\n');
        queue.latest = Some((Instant::now(), began.elapsed()));
        queue.error = outcome.err().or(queue.error.take());
        self.changed.notify_all();
    }

    /// Writes all of `bytes`, and waits where a pipe or terminal that is shared does not block.
    fn write_all(&self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            match (self.write)(&bytes[..bytes.len().min(CHUNK)]) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(n) => {
                    bytes = &bytes[n..];
                    self.queue.lock().written += n;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    std::thread::sleep(POLL_INTERVAL);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

pub fn stdout() -> &'static OutputStream {
    &STDOUT
}

pub fn stderr() -> &'static OutputStream {
    &STDERR
}

/// Prints a text and waits until it is written. A reader that closes the pipe early is not an error.
pub fn print_text(text: &str) -> io::Result<()> {
    match STDOUT.print(text.as_bytes()).and_then(|()| STDOUT.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error),
        _ => Ok(()),
    }
}

/// Prints a line to standard error, made safe to display. Where that is gone, nothing can be reported.
pub fn eprint_line(line: &str) {
    eprint_raw(&sanitized_lines(line));
}

/// Like [`eprint_line`], but prints the line as it is: one that contains colours of our own.
pub fn eprint_raw(line: &str) {
    let _ = STDERR.print(format!("{line}\n").as_bytes());
}

/// Waits for readers only briefly from now on: a signal ends the program.
pub fn hurry() {
    HURRIES.store(true, Ordering::Relaxed);
}

fn hurries() -> bool {
    HURRIES.load(Ordering::Relaxed)
}

/// Waits at the end of the program until everything is written; errors have been reported.
pub fn finish() {
    let _ = STDOUT.flush();
    let _ = STDERR.flush();
}

#[cfg(test)]
mod tests {
    use super::*;

    static GATE: Mutex<()> = Mutex::new(());
    static READ: Mutex<Vec<u8>> = Mutex::new(Vec::new());

    #[test]
    fn a_reader_that_stops_gets_everything_in_order_later_and_errors_are_reported_once() {
        // A reader that takes a few bytes at a time, and none while the gate is closed.
        static STREAM: OutputStream = OutputStream::new("test", |bytes| {
            let _open = GATE.lock();
            let n = bytes.iter().take(3).take_while(|byte| **byte != b'!').count();
            READ.lock().extend_from_slice(&bytes[..n]);
            if n == 0 { Err(ErrorKind::StorageFull.into()) } else { Ok(n) }
        });
        let closed = GATE.lock();
        let began = Instant::now();
        let lines: Vec<String> = (0..1000).map(|i| format!("line {i}\n")).collect();
        for line in &lines {
            STREAM.print(line.as_bytes()).expect("queued");
        }
        assert!(began.elapsed() < 100 * PATIENCE, "the first line alone waits");
        drop(closed);
        STREAM.flush().expect("written");
        assert_eq!(String::from_utf8_lossy(&READ.lock()), lines.concat());
        // A disk that is full in the middle of a line, and then not any more.
        for torn in ["{cut!off}\n", "!\n"] {
            let printed = STREAM.print(torn.as_bytes()).and_then(|()| STREAM.flush());
            assert_eq!(printed.expect_err("full").kind(), ErrorKind::StorageFull);
        }
        assert!(STREAM.print(b"{whole}\n").and_then(|()| STREAM.flush()).is_ok());
        assert!(READ.lock().ends_with(b"\n{cut\n{whole}\n"), "a line of its own");
    }
}
