//! Progress of all jobs together, and the time left: a bar on standard error if that is a terminal,
//! otherwise part of the lines printed there.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use parking_lot::Mutex;

use crate::host::progress_bar::{self, duration};
use gdg::printing::eprint_line;

/// Parts that the bar is divided into.
const BAR_PARTS: u64 = 1000;

/// Minimum time between two changes of the bar.
const BAR_INTERVAL: Duration = Duration::from_millis(500);

/// Progress of several jobs.
pub struct Progress {
    bar: ProgressBar,
    state: Mutex<State>,
}

struct State {
    /// The share done of each job, and what of that earlier processes have done.
    shares: Vec<[f64; 2]>,
    began: Instant,
    shown: Instant,
}

impl Progress {
    pub fn new(jobs: usize) -> Self {
        let bar = ProgressBar::with_draw_target(Some(BAR_PARTS), progress_bar::target());
        let template = "{bar:32} {percent:>3} %  {msg}  {elapsed_precise} so far";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        let now = Instant::now();
        Self {
            bar,
            state: Mutex::new(State { shares: vec![[0.0; 2]; jobs], began: now, shown: now }),
        }
    }

    /// Records the share of a job that earlier processes have done.
    pub fn begin(&self, job: usize, share: f64) {
        self.state.lock().shares[job] = [share; 2];
    }

    /// Records the share of a job that is done; all of one that has failed or runs elsewhere.
    pub fn advance(&self, job: usize, share: f64) {
        let mut state = self.state.lock();
        state.shares[job][0] = share;
        if state.shown.elapsed() >= BAR_INTERVAL {
            state.shown = Instant::now();
            if let Some((share, seconds_left)) = state.estimate(state.began.elapsed()) {
                self.bar.set_position((BAR_PARTS as f64 * share) as u64);
                self.bar.set_message(format!("{} left", duration(seconds_left)));
            }
        }
    }

    pub fn line(&self, text: &str) {
        self.bar.suspend(|| eprint_line(text));
    }

    /// Returns how far all jobs are, for the end of a line; nothing for a single job.
    pub fn overall(&self) -> String {
        let state = self.state.lock();
        let several = state.shares.len() > 1;
        let overall = if several { state.estimate(state.began.elapsed()) } else { None };
        overall.map_or(String::new(), |(share, seconds_left)| {
            format!("; all jobs {:.0} %, {} left", 100.0 * share, duration(seconds_left))
        })
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

impl State {
    /// Returns the share of all jobs that is done, each of which counts the same, and the seconds
    /// left; `None` before anything is known.
    fn estimate(&self, elapsed: Duration) -> Option<(f64, f64)> {
        let sum = |i: usize| self.shares.iter().map(|shares| shares[i]).sum::<f64>();
        let (all, done, here) = (self.shares.len() as f64, sum(0), sum(0) - sum(1));
        (here > 0.0).then(|| (done / all, elapsed.as_secs_f64() * (all - done) / here))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_follows_from_what_this_process_has_done() {
        let progress = Progress::new(2);
        let estimate = || progress.state.lock().estimate(Duration::from_secs(30));
        progress.begin(0, 0.5);
        assert_eq!(estimate(), None);
        progress.advance(0, 1.0);
        assert_eq!(estimate(), Some((0.5, 60.0)), "half a job in 30 s, and one is left");
        progress.advance(1, 1.0);
        assert_eq!(estimate(), Some((1.0, 0.0)));
    }
}
