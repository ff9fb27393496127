//! A worker: a Python interpreter that runs `worker.py`, at the other end of a socket.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, ErrorKind, PipeReader, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, LazyLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use serde::Deserialize;

use super::frames::{self, BadHeader, Expected, HEADER_BYTES, Reply, Request};
use crate::env::EnvError;
use crate::text::truncated;

/// What the worker runs.
const SOURCE: &str = include_str!("worker.py");

/// Reads that source from the socket, which is the standard input, and leaves an empty one: what is
/// listed as the command of the process stays short.
const BOOTSTRAP: &str = "\
import os, socket
channel = socket.socket(fileno=os.dup(0))
os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
stream = channel.makefile('rb')
header = stream.read(8)
exec(compile(stream.read(int.from_bytes(header[4:], 'little')), '<worker>', 'exec'))
";

/// Lines of the worker's output that errors quote.
const QUOTED_LINES: usize = 8;

/// Lines of a worker's output that go to the log.
const LOGGED_LINES: usize = 200;

/// Longest line of output that is kept, in bytes and, shown, in characters.
const MAX_LINE_BYTES: u64 = 4096;
const MAX_SHOWN_CHARS: usize = 200;

/// How long an ending worker may take: to say why, and to end by itself.
const ENDING: Duration = Duration::from_millis(500);

/// The latest lines that a worker has written.
type Output = Arc<Mutex<VecDeque<String>>>;

/// A running worker. It is killed when it is dropped, and ends with this process.
pub struct Worker {
    title: String,
    channel: UnixStream,
    child: Child,
    output: Output,
    reader: Option<JoinHandle<()>>,
    timeout: Duration,
    /// How many environments it has.
    pub environments: usize,
    /// Whether it has failed, and must not be used again.
    pub is_broken: bool,
}

/// What a worker says of an exception.
#[derive(Debug, Deserialize)]
struct Exception {
    /// Whether the environment is one that the program does not support.
    unsupported: bool,
    /// The module that is missing, if that is the problem.
    missing: Option<String>,
    /// The exception and its message.
    error: String,
    /// Files and lines, the innermost last.
    places: Vec<String>,
}

impl Worker {
    /// Starts a worker for the environment called `title`; every answer has to come within
    /// `timeout`.
    ///
    /// # Errors
    /// The interpreter cannot be started.
    pub fn start(python: &Path, title: &str, timeout: Duration) -> Result<Self, EnvError> {
        let unstarted = |error: std::io::Error| {
            let shown = truncated(&python.to_string_lossy(), MAX_SHOWN_CHARS);
            let problem = match error.kind() {
                ErrorKind::NotFound => format!(
                    "there is no Python interpreter {shown}: install Python 3, activate a virtual \
                     environment, or give --python PATH"
                ),
                _ => format!("the Python interpreter {shown} cannot be started: {error}"),
            };
            failed(title, problem, Vec::new())
        };
        let (channel, theirs) = UnixStream::pair().map_err(unstarted)?;
        let (output, their_output) = std::io::pipe().map_err(unstarted)?;
        let mut command = Command::new(python);
        command
            .args(["-u", "-c", BOOTSTRAP, "gdg-tui", title])
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(their_output.try_clone().map_err(unstarted)?)
            .stderr(their_output)
            // Signals of the terminal are for the program, which ends its workers.
            .process_group(0);
        let child = spawn(command).map_err(unstarted)?;
        let lines = Output::default();
        let reader = read_output(title.to_owned(), output, lines.clone()).map_err(unstarted)?;
        let mut worker = Self {
            title: title.to_owned(),
            channel,
            child,
            output: lines,
            reader: Some(reader),
            timeout,
            environments: 0,
            is_broken: false,
        };
        worker.send(Request::Source, SOURCE.as_bytes())?;
        Ok(worker)
    }

    /// Sends a request and returns the answer.
    ///
    /// # Errors
    /// The worker fails; it must not be used again.
    pub fn ask(
        &mut self,
        request: Request,
        body: &[u8],
        expected: Expected,
    ) -> Result<Vec<u8>, EnvError> {
        self.send(request, body)?;
        self.answer(request, expected)
    }

    /// Sends a request.
    ///
    /// # Errors
    /// The worker fails; it must not be used again.
    pub fn send(&mut self, request: Request, body: &[u8]) -> Result<(), EnvError> {
        let sent = self
            .channel
            .set_write_timeout(Some(self.timeout))
            .and_then(|()| self.channel.write_all(&frames::request(request, body)));
        sent.map_err(|error| self.broken_off(request, &error))
    }

    /// Returns the answer to the request sent before.
    ///
    /// # Errors
    /// The worker fails; it must not be used again.
    pub fn answer(&mut self, request: Request, expected: Expected) -> Result<Vec<u8>, EnvError> {
        let deadline = Instant::now() + self.timeout;
        let mut header = [0; HEADER_BYTES];
        self.read(&mut header, deadline).map_err(|error| self.broken_off(request, &error))?;
        let (reply, length) = match frames::reply_header(header, expected) {
            Ok(sound) => sound,
            Err(BadHeader::Kind(_)) => {
                return Err(self.fail("its worker answers something else than asked".to_owned()));
            }
            Err(BadHeader::Length(bytes)) => {
                return Err(self
                    .fail(format!("its worker answers with {bytes} bytes: too many or too few")));
            }
        };
        let mut body = vec![0; length];
        self.read(&mut body, deadline).map_err(|error| self.broken_off(request, &error))?;
        match reply {
            Reply::Done => Ok(body),
            Reply::Failed => Err(self.exception(request, &body)),
        }
    }

    /// Fills `buffer` before the deadline.
    fn read(&mut self, buffer: &mut [u8], deadline: Instant) -> std::io::Result<()> {
        let mut filled = 0;
        while filled < buffer.len() {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(ErrorKind::TimedOut.into());
            }
            self.channel.set_read_timeout(Some(left))?;
            match self.channel.read(&mut buffer[filled..]) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(read) => filled += read,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Returns the error about an answer that has not come.
    fn broken_off(&mut self, request: Request, error: &std::io::Error) -> EnvError {
        let what = match request {
            Request::Source | Request::Open => "to be opened",
            Request::Make => "to be made",
            Request::Reset => "to begin an episode",
            Request::Step => "to step",
            Request::Save | Request::Restore => "to save or restore its state",
            Request::Reward => "to return rewards",
            Request::Picture => "to render a picture",
        };
        match error.kind() {
            ErrorKind::TimedOut | ErrorKind::WouldBlock => self.fail(format!(
                "took more than {} seconds {what} (--env-timeout sets the limit)",
                self.timeout.as_secs_f64()
            )),
            _ => {
                let status = self.ended_within(ENDING);
                let how = status.map_or_else(|| error.to_string(), shown_status);
                self.fail(format!("its Python process has ended: {how}"))
            }
        }
    }

    /// Returns the error about an exception, which the worker describes.
    fn exception(&mut self, request: Request, body: &[u8]) -> EnvError {
        let Ok(found) = serde_json::from_slice::<Exception>(body) else {
            return self.fail("its worker answers something else than asked".to_owned());
        };
        let shown = |text: &str| truncated(text, 3 * MAX_SHOWN_CHARS);
        if let Some(module) = found.missing {
            let module = shown(module.split('.').next().unwrap_or_default());
            let package = module.replace('_', "-");
            return self.fail(format!(
                "the Python package {module} is missing: python -m pip install {package}, in the \
                 virtual environment that is active or that --python PATH names"
            ));
        }
        if found.unsupported {
            return self.fail(shown(&found.error));
        }
        let during = match request {
            Request::Reset => " in reset",
            Request::Step => " in step",
            _ => "",
        };
        self.is_broken = true;
        let places = found.places.iter().map(|place| truncated(place, MAX_SHOWN_CHARS)).collect();
        let problem =
            format!("the environment raised an exception{during}: {}", shown(&found.error));
        failed(&self.title, problem, places)
    }

    /// Marks the worker as broken, and returns the error with the last lines that it has written.
    pub fn fail(&mut self, problem: String) -> EnvError {
        self.is_broken = true;
        let _ = self.child.kill();
        // What it has written is complete once its output ends; others may hold that open.
        let began = Instant::now();
        while self.reader.as_ref().is_some_and(|reader| !reader.is_finished())
            && began.elapsed() < ENDING
        {
            std::thread::sleep(Duration::from_millis(5));
        }
        failed(&self.title, problem, self.output.lock().iter().cloned().collect())
    }

    /// Returns how the process has ended, if it does so in time.
    fn ended_within(&mut self, limit: Duration) -> Option<ExitStatus> {
        let began = Instant::now();
        loop {
            match self.child.try_wait() {
                Ok(None) if began.elapsed() < limit => std::thread::sleep(Duration::from_millis(5)),
                Ok(status) => return status,
                Err(_) => return None,
            }
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It only keeps what can be computed again.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the error about the environment called `title`.
pub fn failed(title: &str, problem: String, details: Vec<String>) -> EnvError {
    EnvError::Failed { world: truncated(title, MAX_SHOWN_CHARS), problem, details }
}

/// Describes how a process has ended.
fn shown_status(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => format!("killed by signal {signal}"),
        (None, Some(code)) => format!("exit status {code}"),
        (None, None) => status.to_string(),
    }
}

/// A process to start, and where to send it.
type Start = (Command, Sender<std::io::Result<Child>>);

/// Starts all workers: on Linux, they ask to be killed when the thread that has started them ends.
static STARTER: LazyLock<Option<Sender<Start>>> = LazyLock::new(|| {
    let (sender, requests) = channel::<Start>();
    let run = move || {
        for (mut command, started) in requests {
            // Whoever has asked waits.
            let _ = started.send(command.spawn());
        }
    };
    std::thread::Builder::new().name("worker starter".to_owned()).spawn(run).ok().map(|_| sender)
});

/// Starts a process on the thread that starts all.
fn spawn(command: Command) -> std::io::Result<Child> {
    let (started, child) = channel();
    let sent = STARTER.as_ref().is_some_and(|starter| starter.send((command, started)).is_ok());
    match child.recv() {
        Ok(child) if sent => child,
        _ => Err(std::io::Error::other("no thread can be started")),
    }
}

/// Keeps the last lines of a worker's output, and logs the first ones, until it ends.
fn read_output(
    title: String,
    output: PipeReader,
    lines: Output,
) -> std::io::Result<JoinHandle<()>> {
    let mut output = BufReader::new(output);
    let keep = move || {
        let (mut line, mut count) = (Vec::new(), 0);
        loop {
            line.clear();
            match (&mut output).take(MAX_LINE_BYTES).read_until(b'\n', &mut line) {
                Ok(1..) => {}
                _ => return,
            }
            let text = truncated(String::from_utf8_lossy(&line).trim_end(), MAX_SHOWN_CHARS);
            count += 1;
            if count <= LOGGED_LINES {
                log::info!("{title}: {text}");
            }
            let mut lines = lines.lock();
            if lines.len() == QUOTED_LINES {
                lines.pop_front();
            }
            lines.push_back(text);
        }
    };
    std::thread::Builder::new().name("worker output".to_owned()).spawn(keep)
}
