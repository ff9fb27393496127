//! Progress of all jobs together, and the time left: a bar on standard error if that is a terminal,
//! otherwise part of the lines printed there.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use parking_lot::Mutex;

use super::job::Job;
use crate::host::progress_bar::{self, duration};
use gdg::printing::eprint_line;

/// Parts that the bar is divided into.
const BAR_PARTS: u64 = 1000;

/// Minimum time between two changes of the bar.
const BAR_INTERVAL: Duration = Duration::from_millis(500);

/// Progress of several jobs.
pub struct Progress {
    bar: ProgressBar,
    /// Jobs that run at the same time.
    parallel: usize,
    items: Mutex<Vec<Item>>,
    shown: Mutex<Instant>,
    /// The largest share shown so far: an estimate that falls would look like work lost.
    largest_share: Mutex<f64>,
}

/// One job's progress, in updates or episodes.
#[derive(Clone, Debug)]
struct Item {
    /// Jobs of the same group are about equally fast.
    group: String,
    total: u64,
    done: u64,
    /// When this process started the job; progress and time when it had got to its usual pace.
    started: Option<Instant>,
    first: u64,
    began: Option<Instant>,
    /// Time that this process has spent on it, once it has ended.
    spent: Option<Duration>,
}

impl Item {
    /// Returns the seconds that this process has spent on the job.
    fn seconds(&self, now: Instant) -> f64 {
        let running = self.began.map(|began| now.saturating_duration_since(began));
        self.spent.or(running).unwrap_or_default().as_secs_f64()
    }
}

/// Overall progress.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Overall {
    /// Share of the estimated work that is done.
    share: f64,
    /// Estimated seconds left.
    seconds_left: f64,
}

impl Progress {
    /// Creates the progress of `jobs`, of which `parallel` run at the same time.
    pub fn new(jobs: &[&Job], parallel: usize) -> Self {
        let item = |job: &&Job| {
            let run = &job.run;
            let group = format!("{} {} {:?}", job.world.name(), run.method, run.preset);
            Item {
                group,
                total: job.plan.length.amount(),
                done: 0,
                started: None,
                first: 0,
                began: None,
                spent: None,
            }
        };
        let bar = ProgressBar::with_draw_target(Some(BAR_PARTS), progress_bar::target());
        if let Ok(style) =
            ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}  {elapsed_precise} so far")
        {
            bar.set_style(style);
        }
        let items = Mutex::new(jobs.iter().map(item).collect());
        Self {
            bar,
            parallel: parallel.max(1),
            items,
            shown: Mutex::new(Instant::now()),
            largest_share: Mutex::new(0.0),
        }
    }

    /// Records that a job begins, of which `done` was done earlier.
    pub fn begin(&self, job: usize, done: u64) {
        let mut items = self.items.lock();
        let item = &mut items[job];
        (item.done, item.first, item.started) = (done, done, Some(Instant::now()));
    }

    /// Records how much of a job is done, and whether it `is_steady`: its start, before there is a
    /// pace, says nothing about what is left.
    pub fn advance(&self, job: usize, done: u64, is_steady: bool) {
        let mut shown = self.shown.lock();
        let mut items = self.items.lock();
        items[job].done = done;
        if is_steady && items[job].began.is_none() {
            (items[job].first, items[job].began) = (done, Some(Instant::now()));
        }
        drop(items);
        if shown.elapsed() >= BAR_INTERVAL {
            *shown = Instant::now();
            if let Some(overall) = self.estimate() {
                self.bar.set_position((BAR_PARTS as f64 * overall.share) as u64);
                self.bar.set_message(format!("{} left", duration(overall.seconds_left)));
            }
        }
    }

    /// Records that a job has ended, completely or not.
    pub fn end(&self, job: usize, complete: bool) {
        let mut items = self.items.lock();
        let item = &mut items[job];
        let began = item.began.or(item.started);
        item.spent = Some(began.map_or(Duration::ZERO, |began| began.elapsed()));
        if complete {
            item.done = item.total;
        }
    }

    /// Prints a line to standard error, above the bar.
    pub fn line(&self, text: &str) {
        self.bar.suspend(|| eprint_line(text));
    }

    /// Returns how far all jobs are, for the end of a line; nothing for a single job.
    pub fn overall(&self) -> String {
        let several = self.items.lock().len() > 1;
        let overall = if several { self.estimate() } else { None };
        overall.map_or(String::new(), |Overall { share, seconds_left }| {
            format!("; all jobs {:.0} %, {} left", 100.0 * share, duration(seconds_left))
        })
    }

    fn estimate(&self) -> Option<Overall> {
        let overall = estimate(&self.items.lock(), self.parallel, Instant::now())?;
        let mut largest = self.largest_share.lock();
        *largest = largest.max(overall.share);
        Some(Overall { share: *largest, ..overall })
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Estimates how far `items` are, by how fast each group has been in this process; groups that have
/// not begun count as fast as all others together. `None` before anything is known.
fn estimate(items: &[Item], parallel: usize, now: Instant) -> Option<Overall> {
    let mut groups: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for item in items {
        let (done, seconds) = groups.entry(&item.group).or_default();
        *done += item.done.saturating_sub(item.first) as f64;
        *seconds += item.seconds(now);
    }
    let known = |(done, seconds): &(f64, f64)| *done > 0.0 && *seconds > 0.0;
    let all = groups
        .values()
        .filter(|group| known(group))
        .fold((0.0, 0.0), |sum, g| (sum.0 + g.0, sum.1 + g.1));
    if !known(&all) {
        return None;
    }
    let seconds_each = |item: &Item| {
        let (done, seconds) =
            groups.get(item.group.as_str()).filter(|group| known(group)).unwrap_or(&all);
        seconds / done
    };
    let (mut total, mut left, mut longest) = (0.0, 0.0, 0.0f64);
    for item in items {
        total += item.total as f64 * seconds_each(item);
        // A job that has failed or runs elsewhere takes no more time here.
        if item.spent.is_none() {
            let own = item.total.saturating_sub(item.done) as f64 * seconds_each(item);
            left += own;
            longest = longest.max(own);
        }
    }
    let share = if total > 0.0 { 1.0 - left / total } else { 1.0 };
    Some(Overall { share, seconds_left: (left / parallel as f64).max(longest) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(group: &str, total: u64, done: u64, spent: Option<u64>) -> Item {
        let spent = spent.map(Duration::from_secs);
        Item { group: group.to_owned(), total, done, started: None, first: 0, began: None, spent }
    }

    #[test]
    fn the_time_left_follows_from_how_fast_jobs_of_the_same_group_were() {
        let now = Instant::now();
        assert_eq!(estimate(&[item("slow", 100, 0, None)], 2, now), None);
        // 100 in 10 s and 100 in 50 s, so of the two jobs that have not begun, the slow one takes
        // 50 s.
        let done = [item("fast", 100, 100, Some(10)), item("slow", 100, 100, Some(50))];
        let items = [&done[..], &[item("fast", 100, 0, None), item("slow", 100, 0, None)]].concat();
        assert_eq!(estimate(&items, 1, now), Some(Overall { share: 0.5, seconds_left: 60.0 }));
        assert_eq!(
            estimate(&items, 2, now).map(|o| o.seconds_left),
            Some(50.0),
            "the longest job alone takes that"
        );
        // A group that nothing is known of is as fast as the others together: 200 in 60 s.
        let items = [&done[..], &[item("new", 50, 0, None)]].concat();
        assert_eq!(estimate(&items, 1, now).map(|o| o.seconds_left), Some(15.0));
        // A failed job takes no more time.
        let items = [&done[..], &[item("slow", 100, 10, Some(5))]].concat();
        assert_eq!(estimate(&items, 1, now).map(|o| (o.share, o.seconds_left)), Some((1.0, 0.0)));
    }

    #[test]
    fn work_done_by_an_earlier_process_does_not_count_as_fast() {
        let resumed = Item { first: 80, ..item("a", 100, 90, Some(10)) };
        let overall = estimate(&[resumed, item("a", 100, 0, None)], 1, Instant::now());
        assert_eq!(overall.map(|o| o.seconds_left), Some(100.0), "10 in 10 s");
    }

    #[test]
    fn the_start_of_a_job_says_nothing_about_the_rest() {
        let progress = Progress::new(&[], 1);
        *progress.items.lock() = vec![item("a", 100, 0, None)];
        let left = || progress.estimate().map(|overall| overall.seconds_left.round());
        progress.begin(0, 0);
        progress.advance(0, 30, false);
        assert_eq!(left(), None, "updates that are faster than those to come");
        progress.advance(0, 40, true);
        progress.items.lock()[0].began = Instant::now().checked_sub(Duration::from_secs(10));
        progress.advance(0, 50, true);
        assert_eq!(left(), Some(50.0));
    }

    #[test]
    fn the_share_done_never_falls() {
        let progress = Progress::new(&[], 1);
        *progress.items.lock() = vec![item("fast", 100, 100, Some(10)), item("new", 100, 0, None)];
        let share = || progress.estimate().map(|overall| overall.share);
        assert_eq!(share(), Some(0.5));
        // The other job turns out to take far longer.
        progress.items.lock()[1] = Item {
            began: Instant::now().checked_sub(Duration::from_secs(50)),
            done: 1,
            ..item("new", 100, 0, None)
        };
        assert_eq!(share(), Some(0.5));
        progress.items.lock()[1] = item("new", 100, 80, Some(10));
        assert_eq!(share(), Some(1.0));
    }
}
