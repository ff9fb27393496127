//! A worker: a Python interpreter that runs `worker.py`, at the other end of a socket. A message
//! either way is a kind and a length, then that many bytes, all little-endian.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{self, BufRead, BufReader, ErrorKind, PipeReader, Read, Write};
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, killpg};
use nix::unistd::Pid;
use parking_lot::Mutex;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Result;
use crate::env::task::MAX_BUDGET_STEPS;
use crate::env::{EnvError, MAX_MAGNITUDE, Walls};
use crate::job::Job;
use crate::text::{grouped, truncated};

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

/// Largest reply whose size is not known beforehand: descriptions and errors.
const MAX_TEXT_BYTES: usize = 1 << 20;

/// An action of environments that are left as they are.
pub const REST: f32 = f32::NAN;

/// Lines of the worker's output that errors quote, and that go to the log.
const QUOTED_LINES: usize = 8;
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

/// What the program asks a worker to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Message {
    /// Run this source, before all else.
    Source = 0,
    /// Import what is needed and describe the environment.
    Open = 1,
    /// Have at least this number of environments.
    Make = 2,
    /// Begin an episode: of an environment, with a seed, of a task.
    Reset = 3,
    /// Step the first environments.
    Step = 4,
}

/// The facts of a description: name, in words, and whether a run goes on if it has changed.
const FACTS: [(&str, &str, bool); 11] = [
    ("observed", "the number of components of its observations", false),
    ("goal", "the number of components of its goals", false),
    ("achieved", "the number of components of what is achieved beside them", false),
    ("low", "its lowest action", false),
    ("high", "its highest action", false),
    ("bounds", "the bounds of what it shows", true),
    ("time_limit", "its time limit, in steps,", true),
    ("goal_radius", "its own goal radius (the run keeps that of its beginning)", true),
    ("tasks", "the number of its tasks", true),
    ("maze", "its maze's ", true),
    ("versions", "", true),
];

/// Says what is another in `is` than in `was`: of lists the first component, of what has names all that
/// both have.
fn changes(what: &str, was: &Value, is: &Value) -> Vec<String> {
    let shown = |value: &Value| match value {
        Value::Null => "none".to_owned(),
        Value::String(text) => text.clone(),
        Value::Array(list) => format!("{} long", list.len()),
        other => other.to_string(),
    };
    match (was, is) {
        (Value::Array(own), Value::Array(_)) if own.is_empty() => Vec::new(),
        (Value::Array(own), Value::Array(others)) if own.len() == others.len() => {
            let pairs = own.iter().zip(others).enumerate();
            let found = pairs.map(|(i, (was, is))| changes(&format!("{what}[{i}]"), was, is));
            found.flatten().take(1).collect()
        }
        (Value::Object(own), Value::Object(others)) => {
            let both = own.iter().filter_map(|(name, was)| Some((name, was, others.get(name)?)));
            let found = both.map(|(name, was, is)| changes(&format!("{what}{name}"), was, is));
            found.flatten().collect()
        }
        (was, is) if was == is => Vec::new(),
        (was, is) => {
            let text = format!("{what} was {} and is {} now", shown(was), shown(is));
            vec![truncated(&text, MAX_SHOWN_CHARS)]
        }
    }
}

/// What a worker says of its environment. A checkpoint keeps it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EnvDescription {
    pub observed: usize,
    /// Length of the achieved goal that comes beside it; 0 if it is part of the observation.
    pub achieved: usize,
    pub goal: usize,
    /// Lowest and highest action; `None` where there is no bound.
    pub low: Vec<Option<f32>>,
    pub high: Vec<Option<f32>>,
    /// The bounds of each component of a row; earlier versions kept none.
    #[serde(default)]
    pub bounds: Vec<[Option<f32>; 2]>,
    /// Length of an episode, if it is limited.
    pub time_limit: Option<u64>,
    /// Number of tasks of its own, chosen by `task_id` from 1.
    pub tasks: Option<u32>,
    /// Distance below which a goal is reached, if it says so.
    pub goal_radius: Option<f32>,
    /// The walls of its maze, if it has one; positions in it are a goal's first two numbers.
    pub maze: Option<Walls>,
    /// What of it is left out.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Versions of Python and of packages.
    pub versions: BTreeMap<String, String>,
    /// Checksums of its files, by name.
    #[serde(default)]
    pub sources: BTreeMap<String, u32>,
}

impl EnvDescription {
    /// The length of a row: an observation and what is achieved.
    pub fn row(&self) -> usize {
        self.observed + self.achieved
    }

    /// The components of an observation that are the goal unless others are given.
    pub fn usual_goal(&self) -> Vec<usize> {
        (0..self.observed.min(2)).collect()
    }

    /// The lowest and the highest action of each component. Where a bound is missing, the range is as
    /// long as [-1, 1]; without both, it is that.
    fn action_bounds(&self) -> impl Iterator<Item = [f32; 2]> + Clone {
        self.low.iter().zip(&self.high).map(|bounds| match bounds {
            (Some(low), Some(high)) => [*low, high.max(*low)],
            (Some(low), None) => [*low, low + 2.0],
            (None, Some(high)) => [high - 2.0, *high],
            (None, None) => [-1.0, 1.0],
        })
    }

    /// The length of an episode, unless it is none: longer than evaluations may be.
    pub fn episode_steps(&self) -> Option<u32> {
        let limit = u32::try_from(self.time_limit?).ok()?;
        (limit <= MAX_BUDGET_STEPS).then_some(limit)
    }

    /// Warns of a time limit that is none, and of the first action without two bounds.
    pub fn warnings(&self) -> impl Iterator<Item = String> {
        let endless = self.time_limit.is_some() && self.episode_steps().is_none();
        let most = grouped(MAX_BUDGET_STEPS.into());
        let endless = endless
            .then(|| format!("its time limit is ignored: episodes have at most {most} steps"));
        self.notes.iter().cloned().chain(endless).chain(self.unbounded())
    }

    /// Names the files that are others than those of `kept`, if any: "... since the run".
    pub fn changed_files(&self, kept: &Self) -> Option<String> {
        let names: BTreeSet<_> = self.sources.keys().chain(kept.sources.keys()).collect();
        let is_changed = |name: &&String| self.sources.get(*name) != kept.sources.get(*name);
        let changed: Vec<&str> = names.into_iter().filter(is_changed).map(String::as_str).collect();
        let shown = truncated(&changed.join(", "), MAX_SHOWN_CHARS);
        let has = if changed.len() == 1 { "has" } else { "have" };
        (!changed.is_empty()).then(|| format!("{shown} {has} changed since the run"))
    }

    /// Says what has changed since this was `kept`; an error if a run cannot go on with it.
    pub fn changes_since(&self, kept: &Self) -> Result<Vec<String>, String> {
        // As text, single precision stays short.
        let all = |one| serde_json::to_string(one).and_then(|text| serde_json::from_str(&text));
        let [was, is]: [Value; 2] = [kept, self].map(|one| all(one).unwrap_or_default());
        let cells = |one: &Self| one.maze.as_ref().map(Walls::cells);
        let mut said = Vec::new();
        for (name, what, goes_on) in FACTS {
            let changes = changes(what, &was[name], &is[name]);
            let is_fatal = !goes_on || name == "maze" && cells(self) != cells(kept);
            if let Some(first) = changes.first().filter(|_| is_fatal) {
                return Err(format!("{first}: install the version that the run began with"));
            }
            said.extend(changes);
        }
        // Runs of earlier versions know no files.
        let files = self.changed_files(kept).filter(|_| !kept.sources.is_empty());
        said.extend(files.map(|files| files + " was saved: it goes on with what there is now"));
        Ok(said)
    }

    fn unbounded(&self) -> Option<String> {
        let bounds = self.low.iter().zip(&self.high);
        let mut all = bounds.zip(self.action_bounds()).enumerate();
        let (at, (_, [low, high])) =
            all.find(|(_, ((low, high), _))| low.is_none() || high.is_none())?;
        let component = format!("component {at} of its actions has no bounds, or only one");
        Some(format!("{component}: actions stay from {low} to {high} there"))
    }

    pub fn is_sound(&self) -> bool {
        const MOST: usize = 4096;
        let sizes = [self.observed, self.goal, self.low.len()];
        sizes.iter().all(|size| (1..=MOST).contains(size))
            && [0, self.goal].contains(&self.achieved)
            && self.low.len() == self.high.len()
            && self.tasks.is_none_or(|tasks| (1..=1_000).contains(&tasks))
            && self.maze.as_ref().is_none_or(Walls::is_sound)
    }
}

/// What a step leads to: a row, whether the episode has ended, and whether the environment says that its
/// goal is reached, if it says anything.
pub type Stepped = (Vec<f32>, bool, Option<bool>);

/// What a worker says of an exception.
#[derive(Debug, Deserialize)]
struct Exception {
    /// Whether the environment is one that the program does not support.
    unsupported: bool,
    /// The module that is missing, if that is the problem.
    missing: Option<String>,
    error: String,
    /// Files and lines, the innermost last.
    #[serde(default)]
    places: Vec<String>,
    /// Where Python looks for modules.
    #[serde(default)]
    searched: Vec<String>,
}

type LatestLines = Arc<Mutex<VecDeque<String>>>;

/// A running worker. It ends when it is dropped, or with this process, and all that it has started
/// with it.
pub struct GymWorker {
    title: String,
    /// What it says of its environment, once that is open.
    pub about: EnvDescription,
    channel: UnixStream,
    child: Child,
    output: LatestLines,
    reader: JoinHandle<()>,
    timeout: Duration,
    /// How long the present answer has been waited for while this program ran, and how long of that
    /// since training is to stop.
    waited: [Duration; 2],
    job: Arc<Mutex<Job>>,
    ends_by: Option<Instant>,
    pub environments: usize,
    /// Whether a desired goal has moved within one of its first episodes.
    pub moves_goal: bool,
    /// Whether it has failed, and must not be used again.
    pub is_broken: bool,
}

impl GymWorker {
    /// Opens the environment and describes it.
    pub fn open(&mut self, package: Option<&str>, id: &str) -> Result<()> {
        let config = serde_json::json!({ "package": package.unwrap_or_default(), "id": id });
        self.send(Message::Open, config.to_string().as_bytes())?;
        let reply = self.answer(Message::Open, MAX_TEXT_BYTES)?;
        self.environments = 1;
        // Errors to come have nothing to do with what it has written so far.
        self.output.lock().clear();
        let found: Option<EnvDescription> = serde_json::from_slice(&reply).ok();
        self.about = found.filter(EnvDescription::is_sound).ok_or_else(|| {
            self.fail("its worker describes it in a way that makes no sense".to_owned())
        })?;
        Ok(())
    }

    /// Creates environments until there are `count`.
    pub fn make(&mut self, count: usize) -> Result<()> {
        // One by one, as the time limit is for each.
        while self.environments < count {
            let more = self.environments + 1;
            self.send(Message::Make, &bytes([more as f64]))?;
            self.numbers(Message::Make, 0)?;
            self.environments = more;
        }
        Ok(())
    }

    /// Begins an episode in an environment: everything random in it follows from `seed`. Returns a
    /// row, and the desired goal.
    pub fn reset(
        &mut self,
        environment: usize,
        seed: u32,
        task: Option<u32>,
    ) -> Result<(Vec<f32>, Vec<f32>)> {
        let numbers = [environment as f64, f64::from(seed), task.map_or(-1.0, f64::from)];
        self.send(Message::Reset, &bytes(numbers))?;
        let reply = self.numbers(Message::Reset, self.about.row() + 1 + self.about.goal)?;
        let (row, goal) = reply.split_at(self.about.row() + 1);
        let (row, ..) = self.checked("reset", row)?;
        let goal: Vec<f32> = goal.iter().map(|v| *v as f32).collect();
        if goal.iter().all(|v| v.abs() <= MAX_MAGNITUDE) {
            return Ok((row, goal));
        }
        Err(self.fail("a goal that it asks for is not finite, or huge".to_owned()))
    }

    /// Steps the first environments by `actions`, `(environments, action_dim)`.
    pub fn step(&mut self, actions: &[f32]) -> Result<Vec<Stepped>> {
        self.begin_step(actions)?;
        self.end_step(actions.len() / self.about.low.len())
    }

    /// Asks for a step, as [`Self::step`] does; [`Self::end_step`] returns its result. Actions lie
    /// in [-1, 1], or are [`REST`].
    pub fn begin_step(&mut self, actions: &[f32]) -> Result<()> {
        let bounds = self.about.action_bounds().cycle();
        let actions = actions.iter().zip(bounds).map(|(a, to)| f64::from(scaled(*a, to)));
        self.send(Message::Step, &bytes(actions))
    }

    pub fn end_step(&mut self, count: usize) -> Result<Vec<Stepped>> {
        let length = self.about.row() + 1;
        let reply = self.numbers(Message::Step, count * length)?;
        reply.chunks(length).map(|row| self.checked("step", row)).collect()
    }

    /// Returns what a row says if it can be computed with.
    fn checked(&mut self, during: &str, row: &[f64]) -> Result<Stepped> {
        let (flags, row) = row.split_last().unwrap_or((&0.0, &[]));
        let has = |flag: u8| *flags as u8 & flag != 0;
        let row: Vec<f32> = row.iter().map(|v| *v as f32).collect();
        let Some(i) = row.iter().position(|v| v.is_nan() || v.abs() > MAX_MAGNITUDE) else {
            self.moves_goal |= has(2);
            return Ok((row, has(1), has(4).then(|| has(8))));
        };
        let (part, component) = match i.checked_sub(self.about.observed) {
            Some(component) => ("achieved_goal", component),
            None => ("observation", i),
        };
        let value = row[i];
        Err(self.fail(format!(
            "{during} returned {value} as component {component} of its {part}: numbers are from -1e9 to 1e9"
        )))
    }
}

impl GymWorker {
    /// Starts a worker for the environment called `title`; every answer has to come within
    /// `timeout`, or soon once `job` says that training is to stop.
    pub fn start(
        python: &Path,
        title: &str,
        timeout: Duration,
        job: Arc<Mutex<Job>>,
    ) -> Result<Self> {
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
            // The order of a set is that of another run.
            .env("PYTHONHASHSEED", "0")
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(their_output.try_clone().map_err(unstarted)?)
            .stderr(their_output);
        let child = command.spawn().map_err(unstarted)?;
        let lines = LatestLines::default();
        let reader = read_output(title.to_owned(), output, lines.clone()).map_err(unstarted)?;
        let mut worker = Self {
            title: title.to_owned(),
            about: EnvDescription::default(),
            channel,
            child,
            output: lines,
            reader,
            timeout,
            waited: [Duration::ZERO; 2],
            job,
            ends_by: None,
            environments: 0,
            moves_goal: false,
            is_broken: false,
        };
        worker.send(Message::Source, SOURCE.as_bytes())?;
        Ok(worker)
    }

    fn send(&mut self, request: Message, body: &[u8]) -> Result<()> {
        self.waited = [Duration::ZERO; 2];
        let header = [request as u32, body.len() as u32].map(u32::to_le_bytes);
        let message = [header.as_flattened(), body].concat();
        self.transfer(request, message.len(), |mut channel, done| channel.write(&message[done..]))
    }

    /// Returns the answer to the latest request: at most this many bytes.
    fn answer(&mut self, request: Message, most: usize) -> Result<Vec<u8>> {
        let header = self.read(request, 8)?;
        let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| header[at + i]));
        let (kind, length) = (number(0), number(4) as usize);
        let most = match kind {
            0 => most,
            1 => MAX_TEXT_BYTES,
            _ => return Err(self.fail("its worker answers something else than asked".to_owned())),
        };
        // Memory is not taken before the length has been checked.
        if length > most {
            return Err(self.fail(format!("its worker answers with {length} bytes: too many")));
        }
        let body = self.read(request, length)?;
        if kind == 0 { Ok(body) } else { Err(self.exception(request, &body)) }
    }

    /// Returns the answer to the latest request: this many numbers.
    fn numbers(&mut self, request: Message, count: usize) -> Result<Vec<f64>> {
        let reply = self.answer(request, 8 * count)?;
        if reply.len() != 8 * count {
            let bytes = reply.len();
            return Err(self.fail(format!("its worker answers with {bytes} bytes: too few")));
        }
        Ok(reply.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number)).collect())
    }

    fn read(&mut self, request: Message, length: usize) -> Result<Vec<u8>> {
        let mut buffer = vec![0; length];
        self.transfer(request, length, |mut channel, done| channel.read(&mut buffer[done..]))?;
        Ok(buffer)
    }

    /// Transfers `length` bytes by calls of `part`, which gets how many are done, unless that takes
    /// too long. What the process has left behind may have the channel too: its own end counts.
    fn transfer(
        &mut self,
        request: Message,
        length: usize,
        mut part: impl FnMut(&UnixStream, usize) -> io::Result<usize>,
    ) -> Result<()> {
        let (mut done, mut has_ended) = (0, false);
        while done < length {
            let began = Instant::now();
            let error = match part(&self.channel, done) {
                Ok(0) => Some(ErrorKind::UnexpectedEof),
                Ok(more) => {
                    done += more;
                    None
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock && !has_ended => {
                    // Where children are not waited for, asking is an error.
                    has_ended = !matches!(self.child.try_wait(), Ok(None));
                    None
                }
                Err(error) => Some(error.kind()).filter(|kind| *kind != ErrorKind::Interrupted),
            };
            // One that took far longer than a look: this program was stopped meanwhile, and the
            // answer may have come.
            let time = began.elapsed().min(2 * LOOK);
            let stops = self.job.lock().is_cancelled();
            self.waited[0] += time;
            self.waited[1] += if stops { time } else { Duration::ZERO };
            if error.is_some() || self.waited[0] >= self.timeout || self.waited[1] >= STOPPING {
                return Err(self.broken_off(request, error));
            }
        }
        Ok(())
    }

    /// Returns the error about an answer that has not come: the process has ended, or took too long.
    fn broken_off(&mut self, request: Message, error: Option<ErrorKind>) -> EnvError {
        let what = match request {
            Message::Source | Message::Open => "to be opened",
            Message::Make => "to be made",
            Message::Reset => "to begin an episode",
            Message::Step => "to step",
        };
        if let Some(error) = error {
            let status = self.ended_within(ENDING);
            let how = status.map_or_else(|| error.to_string(), |status| status.to_string());
            return self.fail(format!("its Python process has ended: {how}"));
        }
        if self.waited[1] >= STOPPING {
            log::warn!("{}: given up {what}, as training was to stop", self.title);
            self.is_broken = true;
            self.begin_to_end();
            return EnvError::Stopped;
        }
        let limit = self.timeout.as_secs_f64();
        self.fail(format!("took more than {limit} seconds {what} (--env-timeout sets the limit)"))
    }

    /// Returns the error about an exception, which the worker describes.
    fn exception(&mut self, request: Message, body: &[u8]) -> EnvError {
        let Ok(found) = serde_json::from_slice::<Exception>(body) else {
            return self.fail("its worker answers something else than asked".to_owned());
        };
        let shown = |text: &str| truncated(text, 3 * MAX_SHOWN_CHARS);
        if let Some(module) = found.missing {
            let known = ["numpy", "gymnasium", "gymnasium_robotics", "mujoco"].contains(&&*module);
            let farama = "pip install gymnasium, and for Farama's mazes gymnasium-robotics mujoco,";
            let how = if known { farama } else { "install it" };
            return self.fail(format!(
                "there is no Python module {}: looked for in {}; {how} in the virtual \
                 environment that is active or that --python PATH names, or name its folder in PYTHONPATH",
                shown(&module),
                shown(&found.searched.join(", "))
            ));
        }
        if found.unsupported {
            return self.fail(shown(&found.error));
        }
        let during = match request {
            Message::Reset => " in reset",
            Message::Step => " in step",
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
        while !self.reader.is_finished() && began.elapsed() < ENDING {
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

impl Drop for GymWorker {
    fn drop(&mut self) {
        self.begin_to_end();
        let left = |by: Instant| by.saturating_duration_since(Instant::now());
        if self.ended_within(self.ends_by.map_or(CLOSING, left)).is_none() {
            // It ends all that it has started, if it has got that far.
            let _ = self.channel.shutdown(Shutdown::Both);
            self.ended_within(ENDING);
        }
        let _ = self.child.kill();
        // What it has started and not ended.
        let _ = killpg(Pid::from_raw(self.child.id() as i32), Signal::SIGKILL);
        let _ = self.child.wait();
    }
}

/// Returns the error about the environment called `title`.
pub fn failed(title: &str, problem: String, details: Vec<String>) -> EnvError {
    EnvError::Failed { world: truncated(title, MAX_SHOWN_CHARS), problem, details }
}

fn scaled(action: f32, [low, high]: [f32; 2]) -> f32 {
    let action = action.clamp(-1.0, 1.0);
    // Exactly the same numbers where nothing is to be scaled.
    if [low, high] == [-1.0, 1.0] {
        action
    } else {
        (low + 0.5 * (action + 1.0) * (high - low)).clamp(low, high)
    }
}

fn bytes(numbers: impl IntoIterator<Item = f64>) -> Vec<u8> {
    numbers.into_iter().flat_map(f64::to_le_bytes).collect()
}

/// Keeps the last lines of a worker's output, and logs the first ones, until it ends.
fn read_output(
    title: String,
    output: PipeReader,
    lines: LatestLines,
) -> io::Result<JoinHandle<()>> {
    let mut output = BufReader::new(output);
    let keep = move || {
        for count in 0.. {
            let mut line = Vec::new();
            match (&mut output).take(MAX_LINE_BYTES).read_until(b'\n', &mut line) {
                Ok(1..) => {}
                _ => return,
            }
            let text = truncated(String::from_utf8_lossy(&line).trim_end(), MAX_SHOWN_CHARS);
            if count < LOGGED_LINES {
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
