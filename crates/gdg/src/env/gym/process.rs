//! A worker: a Python interpreter that runs `worker.py`, at the other end of a socket.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, ErrorKind, PipeReader, Read, Write};
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use serde::Deserialize;

use super::messages::{self, BadHeader, Expected, HEADER_BYTES, Request};
use crate::env::EnvError;
use crate::job::Job;
use crate::text::truncated;

/// What the worker runs.
const SOURCE: &str = include_str!("worker.py");

/// Reads that source from the socket, which is the standard input, and leaves an empty one: what is
/// listed as the command of the process stays short. Files in the present folder do not take the
/// place of Python's own.
///
/// Its first lines are Python of any version, which they check.
const BOOTSTRAP: &str = "\
import sys
if sys.path[0] == '':
    del sys.path[0]
import os, socket, struct
if sys.version_info < (3, 8):
    problem = 'Python 3.8 or later is needed, and this is %d.%d' % sys.version_info[:2]
    reply = '{\"unsupported\": true, \"error\": \"%s: --python PATH names another one\"}' % problem
    os.write(0, struct.pack('<II', 1, len(reply)) + reply.encode())
    os.read(0, 8)
    sys.exit(problem)
channel = socket.socket(fileno=os.dup(0))
os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
stream = channel.makefile('rb')
header = stream.read(8)
exec(compile(stream.read(int.from_bytes(header[4:], 'little')), '<worker>', 'exec'))
";

/// Modules that environments need and packages of the same name install, and those that others do.
/// Any other name may be that of anybody's package.
const KNOWN_PACKAGES: [&str; 16] = [
    "gymnasium",
    "h5py",
    "imageio",
    "jax",
    "matplotlib",
    "minari",
    "mujoco",
    "networkx",
    "numba",
    "numpy",
    "ogbench",
    "pandas",
    "pybullet",
    "pygame",
    "scipy",
    "torch",
];
const OTHER_PACKAGES: [(&str, &str); 9] = [
    ("Box2D", "box2d"),
    ("PIL", "pillow"),
    ("cv2", "opencv-python"),
    ("dm_control", "dm-control"),
    ("gymnasium_robotics", "gymnasium-robotics"),
    ("panda_gym", "panda-gym"),
    ("skimage", "scikit-image"),
    ("sklearn", "scikit-learn"),
    ("yaml", "PyYAML"),
];

/// Lines of the worker's output that errors quote.
const QUOTED_LINES: usize = 8;

/// Lines of a worker's output that go to the log.
const LOGGED_LINES: usize = 200;

/// Longest line of output that is kept, in bytes and, shown, in characters.
const MAX_LINE_BYTES: u64 = 4096;
const MAX_SHOWN_CHARS: usize = 200;

/// How long a worker may take to say why it ends, and one that has failed to end, which is killed
/// after half a second (`worker.py`).
const ENDING: Duration = Duration::from_secs(1);

/// How long a worker may take to close its environments.
const CLOSING: Duration = Duration::from_secs(3);

/// How long an answer is waited for once training is to stop: systems that end programs often wait
/// ten seconds, in which the run is also to be saved.
const STOPPING: Duration = Duration::from_secs(2);

/// How long one look for an answer takes.
const LOOK: Duration = Duration::from_millis(100);

/// The latest lines that a worker has written.
type Output = Arc<Mutex<VecDeque<String>>>;

/// A running worker. It ends when it is dropped, or with this process, and all that it has started
/// with it.
pub struct Worker {
    title: String,
    channel: UnixStream,
    child: Child,
    output: Output,
    reader: Option<JoinHandle<()>>,
    timeout: Duration,
    /// Says when training is to stop.
    job: Arc<Mutex<Job>>,
    /// When it is to have ended.
    ends_by: Option<Instant>,
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
    #[serde(default)]
    missing: Option<String>,
    /// The exception and its message.
    error: String,
    /// Files and lines, the innermost last.
    #[serde(default)]
    places: Vec<String>,
    /// Where Python looks for modules.
    #[serde(default)]
    searched: Vec<String>,
}

impl Worker {
    /// Starts a worker for the environment called `title`; every answer has to come within
    /// `timeout`, or soon once `job` says that training is to stop.
    pub fn start(
        python: &Path,
        title: &str,
        timeout: Duration,
        job: Arc<Mutex<Job>>,
    ) -> Result<Self, EnvError> {
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
        channel.set_read_timeout(Some(LOOK)).map_err(unstarted)?;
        channel.set_write_timeout(Some(LOOK)).map_err(unstarted)?;
        let (output, their_output) = std::io::pipe().map_err(unstarted)?;
        let mut command = Command::new(python);
        command
            .args(["-u", "-c", BOOTSTRAP, "gdg-tui", title])
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(their_output.try_clone().map_err(unstarted)?)
            .stderr(their_output);
        let child = command.spawn().map_err(unstarted)?;
        let lines = Output::default();
        let reader = read_output(title.to_owned(), output, lines.clone()).map_err(unstarted)?;
        let mut worker = Self {
            title: title.to_owned(),
            channel,
            child,
            output: lines,
            reader: Some(reader),
            timeout,
            job,
            ends_by: None,
            environments: 0,
            is_broken: false,
        };
        worker.send(Request::Source, SOURCE.as_bytes())?;
        Ok(worker)
    }

    /// Sends a request and returns the answer.
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
    pub fn send(&mut self, request: Request, body: &[u8]) -> Result<(), EnvError> {
        let message = messages::request(request, body);
        self.transfer(&mut Waited::default(), message.len(), |mut channel, done| {
            channel.write(&message[done..])
        })
        .map_err(|error| self.broken_off(request, &error))
    }

    /// Returns the answer to the request sent before.
    pub fn answer(&mut self, request: Request, expected: Expected) -> Result<Vec<u8>, EnvError> {
        let (mut waited, mut header) = (Waited::default(), [0; HEADER_BYTES]);
        self.read(&mut header, &mut waited).map_err(|error| self.broken_off(request, &error))?;
        let (is_done, length) = match messages::reply_header(header, expected) {
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
        self.read(&mut body, &mut waited).map_err(|error| self.broken_off(request, &error))?;
        if is_done { Ok(body) } else { Err(self.exception(request, &body)) }
    }

    /// Forgets what it has written so far: errors to come have nothing to do with it.
    pub fn forget_output(&mut self) {
        self.output.lock().clear();
    }

    /// Fills `buffer`, unless that takes too long.
    fn read(&mut self, buffer: &mut [u8], waited: &mut Waited) -> std::io::Result<()> {
        self.transfer(waited, buffer.len(), |mut channel, done| channel.read(&mut buffer[done..]))
    }

    /// Transfers `length` bytes by calls of `part`, which gets how many are done, unless that takes
    /// too long. What the process has left behind may have the channel too: its own end counts.
    fn transfer(
        &mut self,
        waited: &mut Waited,
        length: usize,
        mut part: impl FnMut(&UnixStream, usize) -> std::io::Result<usize>,
    ) -> std::io::Result<()> {
        let (mut done, mut has_ended) = (0, false);
        while done < length {
            waited.check(self.timeout)?;
            let began = Instant::now();
            match part(&self.channel, done) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(more) => done += more,
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted => {}
                    ErrorKind::WouldBlock if has_ended => {
                        return Err(ErrorKind::UnexpectedEof.into());
                    }
                    // Where children are not waited for, asking is an error.
                    ErrorKind::WouldBlock => {
                        has_ended = !matches!(self.child.try_wait(), Ok(None));
                    }
                    _ => return Err(error),
                },
            }
            waited.add(began.elapsed(), self.job.lock().is_cancelled());
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
            Request::Reward => "to return rewards",
            Request::Picture => "to render a picture",
        };
        match error.kind() {
            ErrorKind::Interrupted => {
                log::warn!("{}: given up {what}, as training was to stop", self.title);
                self.is_broken = true;
                self.begin_to_end();
                EnvError::Stopped
            }
            ErrorKind::TimedOut => self.fail(format!(
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
            let known = KNOWN_PACKAGES.iter().find(|name| **name == module).copied();
            let other = OTHER_PACKAGES.iter().find(|(name, _)| *name == module);
            return self.fail(match known.or(other.map(|(_, package)| *package)) {
                Some(package) => format!(
                    "the Python package {module} is missing: python -m pip install {package}, in \
                     the virtual environment that is active or that --python PATH names"
                ),
                None => format!(
                    "there is no Python module {}: looked for in {}; PYTHONPATH names more folders",
                    shown(&module),
                    shown(&found.searched.join(", "))
                ),
            });
        }
        // All else goes on without a picture.
        if request == Request::Picture {
            return failed(&self.title, shown(&found.error), Vec::new());
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
        self.begin_to_end();
        // What it has written is complete once its output ends; others may hold that open.
        let began = Instant::now();
        while self.reader.as_ref().is_some_and(|reader| !reader.is_finished())
            && began.elapsed() < ENDING
        {
            std::thread::sleep(Duration::from_millis(5));
        }
        failed(&self.title, problem, self.output.lock().iter().cloned().collect())
    }

    /// Has it close its environments and end; one that has failed is not waited for.
    pub fn begin_to_end(&mut self) {
        let (how, limit) =
            if self.is_broken { (Shutdown::Both, ENDING) } else { (Shutdown::Write, CLOSING) };
        let _ = self.channel.shutdown(how);
        self.ends_by.get_or_insert_with(|| Instant::now() + limit);
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
        self.begin_to_end();
        let left = |by: Instant| by.saturating_duration_since(Instant::now());
        if self.ended_within(self.ends_by.map_or(CLOSING, left)).is_none() {
            // What watches over it ends it, if it has got that far.
            let _ = self.channel.shutdown(Shutdown::Both);
            self.ended_within(ENDING);
        }
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

/// How long something has been waited for, while this program ran.
#[derive(Default)]
struct Waited {
    all: Duration,
    /// Since training is to stop.
    stopping: Duration,
}

impl Waited {
    /// Adds the time of one look for an answer. One that took far longer than it was to take: this
    /// program was stopped meanwhile, and the answer may have come.
    fn add(&mut self, time: Duration, stops: bool) {
        let time = time.min(2 * LOOK);
        self.all += time;
        self.stopping += if stops { time } else { Duration::ZERO };
    }

    /// Checks that to wait on makes sense.
    fn check(&self, limit: Duration) -> std::io::Result<()> {
        if self.stopping >= STOPPING {
            Err(ErrorKind::Interrupted.into())
        } else if self.all >= limit {
            Err(ErrorKind::TimedOut.into())
        } else {
            Ok(())
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_waited_for_while_the_program_runs_and_is_not_to_stop() {
        // Looks for an answer, how many of them while training is to stop, and how long each takes.
        for (looks, stopping, each, wanted) in [
            // Stopped for an hour: what has been answered meanwhile is still to be read.
            (1, 0, Duration::from_hours(1), None),
            (31, 0, LOOK, Some(ErrorKind::TimedOut)),
            (20, 1, LOOK, None),
            (22, 21, LOOK, Some(ErrorKind::Interrupted)),
        ] {
            let mut waited = Waited::default();
            (0..looks).for_each(|look| waited.add(each, look >= looks - stopping));
            let found = waited.check(Duration::from_secs(3)).err().map(|error| error.kind());
            assert_eq!(found, wanted, "{looks} {stopping} {each:?}");
        }
    }
}
