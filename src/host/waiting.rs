//! Reports what the program still waits for: before it ends, or before it shows or writes something.

use std::io::IsTerminal;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::progress_bar;
use gdg::printing::eprint_line;
use gdg::pulse::{Activity, Progress, Pulse};

/// Time before the first report: to somebody who waits, and to a log.
const PATIENCE: Duration = Duration::from_millis(500);
const PATIENCE_OF_LOGS: Duration = Duration::from_secs(2);

/// Polling interval of lines, ...
const POLL_INTERVAL: Duration = Duration::from_secs(1);

/// ... and time between lines while the activity stays the same, ...
const REPEAT_AFTER: Duration = Duration::from_mins(1);

/// ... or until it is farther by this share.
const TOLD_SHARE: f64 = 0.1;

/// Time between reports that replace each other.
const REDRAW_INTERVAL: Duration = Duration::from_millis(100);

/// How to end the program at once if no Ctrl-C has been received yet, ...
pub const TWICE: &str = "Ctrl-C twice ends at once, without what is not saved";

/// ... and if one has.
pub const ONCE_MORE: &str = "Ctrl-C ends at once, without what is not saved";

/// How to end a command that has nothing to save.
const CANCELS: &str = "Ctrl-C cancels";

/// Reports on standard error what a long wait is for, until dropped.
pub struct Waiting {
    ended: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Starts to report, in lines, what `pulse` is doing, and how to end the program. `before` runs
    /// before the first line, for instance to leave the alternate screen.
    pub fn begin(pulse: &Pulse, how_to_end: &'static str, before: fn()) -> Self {
        let pulse = pulse.clone();
        Self::start(move |end| print_lines(&pulse, how_to_end, before, end))
    }

    fn start(say: impl FnOnce(&Receiver<()>) + Send + 'static) -> Self {
        let (ended, end) = channel();
        let thread = std::thread::Builder::new().name("waiting".to_owned());
        // Without a thread, nothing is reported.
        Self { ended: Some(ended), thread: thread.spawn(move || say(&end)).ok() }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.ended = None;
        // What is printed next comes after the last report.
        self.thread.take().map(JoinHandle::join);
    }
}

/// Work of a command: reported while it lasts, until dropped.
pub struct Working {
    progress: Progress,
    // Before the activity ends: it is what is reported.
    _waiting: Waiting,
    _activity: Activity,
}

impl Working {
    /// Begins work, named as in "waiting for ACTIVITY". Reports replace each other on a terminal.
    pub fn begin(activity: &'static str) -> Self {
        let (pulse, progress) = (Pulse::default(), Progress::default());
        let activity = pulse.begin_with(activity, progress.clone());
        let pulse = pulse.clone();
        let say = move |end: &Receiver<()>| {
            let target = progress_bar::target();
            if target.is_hidden() {
                print_lines(&pulse, CANCELS, || {}, end);
            } else {
                redraw(&pulse, ProgressBar::with_draw_target(None, target), end);
            }
        };
        let working = Self { progress, _waiting: Waiting::start(say), _activity: activity };
        gdg::faults::point("work");
        working
    }

    /// Returns how far it is.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }
}

/// Prints lines until the end.
fn print_lines(pulse: &Pulse, how_to_end: &str, before: fn(), end: &Receiver<()>) {
    let (began, mut said) = (Instant::now(), None);
    let is_seen = std::io::stderr().is_terminal();
    let mut pause = if is_seen { PATIENCE } else { PATIENCE_OF_LOGS };
    while end.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
        pause = POLL_INTERVAL;
        let (activity, share) = (pulse.activity(), share(pulse));
        if said.is_some_and(|(same, at, before): (_, Instant, Option<f64>)| {
            let moved = share.unwrap_or(0.0) - before.unwrap_or(0.0);
            same == activity && at.elapsed() < REPEAT_AFTER && moved < TOLD_SHARE
        }) {
            continue;
        }
        if said.is_none() {
            before();
        }
        let mut line = describe(activity, began.elapsed(), share);
        if said.is_none() {
            line += &format!("; {how_to_end}");
        }
        said = Some((activity, Instant::now(), share));
        eprint_line(&line);
    }
}

/// Redraws one line until the end, and removes it.
fn redraw(pulse: &Pulse, bar: ProgressBar, end: &Receiver<()>) {
    let (began, mut pause) = (Instant::now(), PATIENCE);
    let style = ProgressStyle::with_template("{spinner} {wide_msg}");
    let bar = style.map_or(bar.clone(), |style| bar.with_style(style));
    while end.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
        pause = REDRAW_INTERVAL;
        let text = describe(pulse.activity(), began.elapsed(), share(pulse));
        bar.set_message(format!("{text}; {CANCELS}"));
        bar.tick();
    }
    bar.finish_and_clear();
}

/// Returns how far the work is, if that is known.
fn share(pulse: &Pulse) -> Option<f64> {
    pulse.busy().and_then(|doing| doing.progress.share())
}

fn describe(activity: &str, so_far: Duration, share: Option<f64>) -> String {
    let part = share.map_or(String::new(), |share| format!(", {:.0} %", 100.0 * share));
    format!("waiting for {activity} ({} s so far{part})", so_far.as_secs())
}
