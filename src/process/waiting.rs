//! Reports what the program waits for, and its progress.

use std::io::{self, IsTerminal, Write};
use std::ops::Deref;
use std::os::fd::{AsFd, AsRawFd, RawFd};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use nix::unistd::{getpgrp, tcgetpgrp};

use gdg::job::Job;
use gdg::printing::{self, eprint_line};
use gdg::text::terminal_obeys_escapes;

/// Time before the first report: to somebody who waits, and to a log.
const PATIENCE: Duration = Duration::from_millis(500);
const PATIENCE_OF_LOGS: Duration = Duration::from_secs(2);

/// Time between looks at a job that lines are printed about, between lines while it does the same,
/// and the share of it that is worth another line before that.
const POLL_INTERVAL: Duration = Duration::from_secs(1);
const REPEAT_AFTER: Duration = Duration::from_mins(1);
const TOLD_SHARE: f64 = 0.1;

/// Time between reports that replace each other.
const REDRAW_INTERVAL: Duration = Duration::from_millis(100);

/// How to end the program at once if no Ctrl-C has been received yet, and if one has.
pub const TWICE: &str = "Ctrl-C twice ends at once, without what is not saved";
pub const ONCE_MORE: &str = "Ctrl-C ends at once, without what is not saved";

/// How to end a command that has nothing to save.
const CANCELS: &str = "Ctrl-C cancels";

/// Reports on standard error what a long wait is for, until dropped.
pub struct Waiting {
    job: Job,
    ended: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Starts to report, in lines, what is being done as part of `job`, and how to end the program.
    /// `before` runs before the first line, for instance to leave the alternate screen.
    pub fn begin(job: &Job, how_to_end: &'static str, before: fn()) -> Self {
        Self::start(job.clone(), move |job, end| print_lines(job, how_to_end, before, end))
    }

    /// Begins the work of a command, called as in "reading a.map". Reports replace each other on a
    /// terminal.
    pub fn on(what: &'static str) -> Self {
        let waiting = Self::start(Job::new(what), |job, end| {
            let bar = progress_bar(None, "{spinner} {wide_msg}");
            if bar.is_hidden() {
                print_lines(job, CANCELS, || {}, end);
            } else {
                redraw(job, &bar, end);
            }
        });
        gdg::faults::point("work");
        waiting
    }

    fn start(job: Job, say: impl FnOnce(&Job, &Receiver<()>) + Send + 'static) -> Self {
        let (ended, end) = channel();
        let (own, thread) = (job.clone(), std::thread::Builder::new().name("waiting".to_owned()));
        // Without a thread, nothing is reported.
        Self { job, ended: Some(ended), thread: thread.spawn(move || say(&own, &end)).ok() }
    }
}

impl Deref for Waiting {
    type Target = Job;

    fn deref(&self) -> &Job {
        &self.job
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.ended = None;
        // What is printed next comes after the last report.
        self.thread.take().map(JoinHandle::join);
    }
}

fn print_lines(job: &Job, how_to_end: &str, before: fn(), end: &Receiver<()>) {
    let (began, mut said) = (Instant::now(), None::<(Job, Instant, f64)>);
    let mut pause = if io::stderr().is_terminal() { PATIENCE } else { PATIENCE_OF_LOGS };
    while end.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
        pause = POLL_INTERVAL;
        let now = job.latest_part().unwrap_or_else(|| job.clone());
        let share = now.share().unwrap_or(0.0);
        if said.as_ref().is_some_and(|(before, at, told)| {
            before.what() == now.what() && at.elapsed() < REPEAT_AFTER && share - told < TOLD_SHARE
        }) {
            continue;
        }
        let mut line = describe(&now, began);
        if said.is_none() {
            before();
            line += &format!("; {how_to_end}");
        }
        said = Some((now, Instant::now(), share));
        eprint_line(&line);
    }
}

/// Redraws one line until the end, and removes it.
fn redraw(job: &Job, bar: &ProgressBar, end: &Receiver<()>) {
    let (began, mut pause) = (Instant::now(), PATIENCE);
    while end.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
        pause = REDRAW_INTERVAL;
        bar.set_message(format!("{}; {CANCELS}", describe(job, began)));
        bar.tick();
    }
    bar.finish_and_clear();
    // Standard output, which has a queue of its own, does not overtake this.
    printing::stderr().flush_briefly();
}

fn describe(job: &Job, began: Instant) -> String {
    let part = job.share().map_or(String::new(), |share| format!(", {:.0} %", 100.0 * share));
    format!("{} ({} s so far{part})", job.what(), began.elapsed().as_secs())
}

/// Returns a progress bar on standard error, hidden unless that is a terminal that can move its
/// cursor.
pub fn progress_bar(length: Option<u64>, template: &str) -> ProgressBar {
    let target = if terminal_obeys_escapes() {
        let terminal = console::Term::read_write_pair(io::stdin(), ProgressFrames);
        ProgressDrawTarget::term(terminal, FRAMES_PER_SECOND)
    } else {
        ProgressDrawTarget::hidden()
    };
    let bar = ProgressBar::with_draw_target(length, target);
    ProgressStyle::with_template(template).map_or(bar.clone(), |style| bar.with_style(style))
}

/// Formats a time in seconds, in a word or two.
pub fn duration(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    match seconds as u64 {
        ..90 => format!("{seconds:.0} s"),
        90..5400 => format!("{minutes} min"),
        _ => format!("{} h {:02} min", minutes / 60, minutes % 60),
    }
}

/// Whether the program is in the terminal's foreground process group.
pub fn is_in_foreground(terminal: impl AsFd) -> bool {
    // If the terminal is gone, later errors report that.
    tcgetpgrp(terminal).map_or(true, |group| group == getpgrp())
}

/// Frames of a progress bar, at most.
const FRAMES_PER_SECOND: u8 = 20;

/// Standard error for the frames of a progress bar; in the background, the terminal is another program's.
#[derive(Debug)]
struct ProgressFrames;

impl Write for ProgressFrames {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if is_in_foreground(io::stderr()) {
            printing::stderr().print_frame(bytes);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl AsRawFd for ProgressFrames {
    fn as_raw_fd(&self) -> RawFd {
        io::stderr().as_raw_fd()
    }
}

#[cfg(test)]
mod tests {
    use super::duration;

    #[test]
    fn times_are_short() {
        assert_eq!([5.4, 100.0, 7300.0].map(duration), ["5 s", "2 min", "2 h 02 min"]);
    }
}
