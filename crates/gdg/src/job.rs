//! A job that takes long: its name, its progress, when it began, and whether it has been cancelled.

mod stopwatch;

use std::borrow::Cow;
use std::fmt;
use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use crate::faults;
pub use stopwatch::Stopwatch;

const POLL_INTERVAL: Duration = Duration::from_millis(1);

const NOTICE_EVERY: Duration = Duration::from_secs(2);

/// Something that takes long, such as a run. Clones share it.
#[derive(Clone, Debug)]
pub struct Job(Arc<JobState>);

#[derive(Debug)]
struct JobState {
    what: Cow<'static, str>,
    since: Instant,
    /// The present stage and the number of stages; what is done of the stage, and all of it.
    progress: Mutex<[usize; 4]>,
    beats: AtomicU64,
    is_cancelled: AtomicBool,
    parts: Mutex<Vec<Job>>,
}

impl Default for Job {
    /// What a run does when it does nothing that has a name of its own.
    fn default() -> Self {
        Self::new("finishing the update in progress")
    }
}

impl Job {
    /// Creates a job called `what`, as in "reading a.map", which begins now.
    pub fn new(what: impl Into<Cow<'static, str>>) -> Self {
        Self(Arc::new(JobState {
            what: what.into(),
            since: Instant::now(),
            progress: Mutex::default(),
            beats: AtomicU64::new(0),
            is_cancelled: AtomicBool::new(false),
            parts: Mutex::default(),
        }))
    }

    pub fn part(&self, what: &'static str) -> JobPart {
        self.add(Self::new(what))
    }

    pub fn add(&self, part: Self) -> JobPart {
        self.beat();
        self.0.parts.lock().push(part.clone());
        JobPart { whole: self.clone(), part }
    }

    /// Returns the part that was begun last, if any has not ended.
    pub fn latest_part(&self) -> Option<Self> {
        self.0.parts.lock().last().cloned()
    }

    pub fn what(&self) -> &str {
        &self.0.what
    }

    pub fn since(&self) -> Instant {
        self.0.since
    }

    /// Begins a stage, counted from 0, of all of it.
    pub fn begin(&self, stage: usize, stages: usize) {
        *self.0.progress.lock() = [stage, stages, 0, 0];
        faults::point("progress");
    }

    pub fn set(&self, done: usize, all: usize) {
        self.0.progress.lock()[2..].copy_from_slice(&[done, all]);
        faults::point("progress");
    }

    /// Returns the share that is done, from 0 to 1; `None` unless it says so.
    pub fn share(&self) -> Option<f64> {
        let [stage, stages, done, all] = self.0.progress.lock().map(|number| number as f64);
        let of_stage = if all > 0.0 { done / all } else { 0.0 };
        (stages > 0.0).then(|| ((stage + of_stage) / stages).clamp(0.0, 1.0))
    }

    /// Returns how far it is, or else for how long it has been going on; nothing in the first second.
    pub fn short(&self) -> Option<String> {
        let seconds = self.since().elapsed().as_secs();
        let percent = self.share().map(|share| format!("{} %", (100.0 * share) as u64));
        (seconds > 0).then(|| percent.unwrap_or(format!("{seconds} s")))
    }

    /// Returns for how long it has been going on and how far it is, as in `, 3 s, 40 %`; nothing in
    /// the first second.
    fn so_far(&self) -> String {
        let seconds = self.since().elapsed().as_secs();
        let percent = self.share().map(|share| format!(", {} %", (100.0 * share) as u64));
        let so_far = || format!(", {seconds} s{}", percent.unwrap_or_default());
        if seconds > 0 { so_far() } else { String::new() }
    }

    pub fn beat(&self) {
        self.0.beats.fetch_add(1, Ordering::Relaxed);
    }

    pub fn beats(&self) -> u64 {
        self.0.beats.load(Ordering::Relaxed)
    }

    /// Wishes that it ends: its result is no longer wanted. Training ends after the update in
    /// progress.
    pub fn cancel(&self) {
        self.0.is_cancelled.store(true, Ordering::Relaxed);
    }

    pub fn is_cancelled(&self) -> bool {
        self.0.is_cancelled.load(Ordering::Relaxed)
    }
}

impl fmt::Display for Job {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}{}", self.what(), self.so_far())
    }
}

#[derive(Debug)]
#[must_use]
pub struct JobPart {
    whole: Job,
    part: Job,
}

impl Deref for JobPart {
    type Target = Job;

    fn deref(&self) -> &Job {
        &self.part
    }
}

impl Drop for JobPart {
    fn drop(&mut self) {
        let own = |job: &Job| Arc::ptr_eq(&job.0, &self.part.0);
        let mut parts = self.whole.0.parts.lock();
        if let Some(own) = parts.iter().rposition(own) {
            parts.remove(own);
        }
        drop(parts);
        self.whole.beat();
    }
}

/// A job on a thread of its own; dropping this cancels it. Where no thread can be started, it is
/// done at once.
pub struct Running<T> {
    job: Job,
    told: u32,
    thread: Option<JoinHandle<Option<T>>>,
    done: Option<T>,
}

impl<T: Send + 'static> Running<T> {
    /// Begins `work`, which may say how far it is, on a thread called `name`.
    pub fn start(name: &str, job: Job, work: impl FnOnce(&Job) -> T + Send + 'static) -> Self {
        let work = Arc::new(Mutex::new(Some(work)));
        let (own, theirs) = (job.clone(), work.clone());
        let run = move || {
            let work = theirs.lock().take();
            work.map(|work| work(&own))
        };
        let mut running = Self { job, told: 0, thread: None, done: None };
        match std::thread::Builder::new().name(name.to_owned()).spawn(run) {
            Ok(thread) => running.thread = Some(thread),
            Err(error) => {
                log::warn!("no thread can be started for {}: {error}", running.job.what());
                let work = work.lock().take();
                running.done = work.map(|work| work(&running.job));
            }
        }
        running
    }

    pub fn job(&self) -> &Job {
        &self.job
    }

    pub fn is_finished(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Waits for at most `patience`; returns whether it is done.
    pub fn wait(&self, patience: Duration) -> bool {
        let began = Instant::now();
        while !self.is_finished() && began.elapsed() < patience {
            std::thread::sleep(POLL_INTERVAL);
        }
        self.is_finished()
    }

    /// Returns a notice that it takes a while, at once and then every few seconds.
    pub fn notice(&mut self) -> Option<String> {
        let is_due = self.job.since().elapsed() >= self.told * NOTICE_EVERY;
        is_due.then(|| {
            self.told = (self.job.since().elapsed().as_secs() / NOTICE_EVERY.as_secs()) as u32 + 1;
            format!("{} ...{}", self.job.what(), self.job.so_far().trim_start_matches(','))
        })
    }

    pub fn join(mut self) -> std::thread::Result<T> {
        let done = self.thread.take().map_or(Ok(None), JoinHandle::join)?;
        let none = || Box::new("a job without a result") as Box<dyn std::any::Any + Send>;
        done.or(self.done.take()).ok_or_else(none)
    }

    /// Waits for the result, or says what has failed because of an internal error.
    pub fn finish(self) -> Result<T, String> {
        let job = self.job.clone();
        self.join().map_err(|_| format!("{} failed with an internal error", job.what()))
    }
}

impl<T> Drop for Running<T> {
    fn drop(&mut self) {
        self.job.cancel();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_end_in_any_order_and_say_how_far_they_are() {
        let run = Job::default();
        let what = || run.latest_part().map(|part| part.what().to_owned());
        let edit = run.part("applying the edit");
        let graph = run.part("building the graph");
        assert_eq!((what().as_deref(), graph.share()), (Some("building the graph"), None));
        drop(edit);
        assert_eq!(what().as_deref(), Some("building the graph"), "of another run");
        let shares = [(0, 0), (0, 5), (0, 10), (1, 0), (1, 10)].map(|(stage, done)| {
            graph.begin(stage, 2);
            graph.set(done, 10);
            run.latest_part().and_then(|part| part.share())
        });
        assert_eq!(shares, [0.0, 0.25, 0.5, 0.5, 1.0].map(Some));
        assert_eq!(graph.to_string(), "building the graph", "in the first second");
        drop(graph);
        assert!(run.latest_part().is_none() && run.beats() == 4);
    }

    #[test]
    fn nobody_wants_the_result_of_what_is_dropped() {
        let job = Job::new("counting");
        let work = |job: &Job| {
            while !job.is_cancelled() {
                std::thread::sleep(POLL_INTERVAL);
            }
        };
        let mut running = Running::start("counter", job.clone(), work);
        assert!(!running.wait(2 * POLL_INTERVAL) && !job.is_cancelled());
        assert_eq!([running.notice(), running.notice()], [Some("counting ...".to_owned()), None]);
        drop(running);
        assert!(job.is_cancelled());
        assert_eq!(Running::start("sum", Job::new("adding"), |_| 2 + 2).finish(), Ok(4));
    }
}
