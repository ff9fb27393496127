//! A thread pool for short pieces of work.
//!
//! An update consists of a few pieces of some hundred microseconds each. Whoever has nothing to do
//! sleeps almost at once: waking costs a few microseconds, while a thread that spins uses up its
//! share of a contended core, and keeps suspended threads from the core that it spins on.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

use parking_lot::Mutex;

use crate::job::Job;
use crate::learn::update::threads::{Chooser, Threads};

/// How long a thread spins before it sleeps: about as long as waking it takes.
const SPIN_DURATION: Duration = Duration::from_micros(20);

/// Spin iterations between two clock reads.
const SPINS_PER_CLOCK_READ: usize = 32;

/// A piece of work: `tasks` calls, each with its own index.
struct Calls {
    work: Box<dyn Fn(usize) + Send + Sync>,
    tasks: usize,
    /// The next task to claim.
    next: AtomicUsize,
    /// Number of finished tasks.
    done: AtomicUsize,
    panicked: AtomicBool,
    /// The thread that waits for the last task.
    caller: Thread,
}

impl Calls {
    fn run_tasks(&self) {
        loop {
            let task = self.next.fetch_add(1, Ordering::Relaxed);
            if task >= self.tasks {
                return;
            }
            // A panic must not leave the others waiting forever; `ThreadPool::run` panics in the
            // caller instead.
            let work = || {
                crate::faults::point("helper");
                (self.work)(task);
            };
            if catch_unwind(AssertUnwindSafe(work)).is_err() {
                self.panicked.store(true, Ordering::Relaxed);
            }
            if self.done.fetch_add(1, Ordering::Release) + 1 == self.tasks {
                self.caller.unpark();
            }
        }
    }
}

/// Waits until `is_done`: spins for a while, then sleeps. Who makes it true must unpark this thread.
fn wait_until(is_done: impl Fn() -> bool) {
    let began = Instant::now();
    while began.elapsed() < SPIN_DURATION {
        for _ in 0..SPINS_PER_CLOCK_READ {
            if is_done() {
                return;
            }
            std::hint::spin_loop();
        }
    }
    while !is_done() {
        std::thread::park();
    }
}

#[derive(Default)]
struct JobSlot {
    /// Number of pieces announced.
    generation: AtomicUsize,
    job: Mutex<Option<Arc<Calls>>>,
    shutdown: AtomicBool,
}

/// The caller and its helpers.
pub struct ThreadPool {
    slot: Arc<JobSlot>,
    /// Maximum number of threads, including the caller.
    most: usize,
    /// Number of threads that work at present.
    active: AtomicUsize,
    /// Chooses this number, unless it is fixed.
    chooser: Option<Mutex<Chooser>>,
    created: Instant,
    /// Started by the first piece of work, so that they have the priority of the thread that works.
    helpers: OnceLock<Vec<JoinHandle<()>>>,
}

impl ThreadPool {
    /// Creates a pool of `threads`, including the caller; of fewer if the system refuses to start
    /// as many. More than `tasks` are of no use.
    pub fn new(threads: Threads, tasks: usize) -> Self {
        let most = threads.most().clamp(1, tasks.max(1));
        let chooses = matches!(threads, Threads::Auto { .. }) && most > 1;
        Self {
            slot: Arc::default(),
            most,
            active: AtomicUsize::new(most),
            chooser: chooses.then(|| Mutex::new(Chooser::new(most))),
            created: Instant::now(),
            helpers: OnceLock::new(),
        }
    }

    fn start_helpers(&self) -> Vec<JoinHandle<()>> {
        let start = |i| {
            let slot = self.slot.clone();
            let helper = std::thread::Builder::new()
                .name(format!("helper {i}"))
                .spawn(move || slot.run_helper());
            helper.inspect_err(|error| log::warn!("training with fewer threads: {error}")).ok()
        };
        (1..self.most).map_while(start).collect()
    }

    fn active_helpers(&self) -> &[JoinHandle<()>] {
        let helpers = self.helpers.get_or_init(|| self.start_helpers());
        &helpers[..helpers.len().min(self.active.load(Ordering::Relaxed) - 1)]
    }

    /// Lets this many threads work.
    #[cfg(test)]
    pub fn use_threads(&self, number: usize) {
        self.active.store(number, Ordering::Relaxed);
    }

    /// Adjusts the number of threads, unless it is fixed, to an update that has taken `took`.
    pub fn record(&self, took: Duration) {
        if let Some(chooser) = &self.chooser {
            let mut chooser = chooser.lock();
            chooser.record(self.created.elapsed(), took);
            self.active.store(chooser.threads(), Ordering::Relaxed);
        }
    }

    /// Calls `work` with each index below `tasks`, on several threads; returns when all calls are
    /// done.
    ///
    /// # Panics
    /// Panics if a call panicked.
    pub fn run(&self, tasks: usize, work: impl Fn(usize) + Send + Sync + 'static) {
        let helpers = self.active_helpers();
        if helpers.is_empty() {
            return (0..tasks).for_each(work);
        }
        let job = Arc::new(Calls {
            work: Box::new(work),
            tasks,
            next: AtomicUsize::new(0),
            done: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
            caller: std::thread::current(),
        });
        *self.slot.job.lock() = Some(job.clone());
        self.slot.generation.fetch_add(1, Ordering::Release);
        helpers.iter().take(tasks.saturating_sub(1)).for_each(|helper| helper.thread().unpark());
        job.run_tasks();
        wait_until(|| job.done.load(Ordering::Acquire) >= tasks);
        assert!(!job.panicked.load(Ordering::Relaxed), "a task of the thread pool panicked");
    }

    /// Calls `work` with each index below `tasks` on data that all threads share; returns when all
    /// calls are done. `job` beats before each.
    ///
    /// # Errors
    /// Returns the first error of a call.
    ///
    /// # Panics
    /// Panics if a call panicked.
    pub fn try_run<S: Send + Sync + 'static, E: Send + 'static>(
        &self,
        tasks: usize,
        shared: &Arc<S>,
        job: Option<&Job>,
        work: fn(&S, usize) -> Result<(), E>,
    ) -> Result<(), E> {
        let failure = Arc::new(Mutex::new(None));
        let (shared, first, job) = (shared.clone(), failure.clone(), job.cloned());
        self.run(tasks, move |i| {
            job.iter().for_each(Job::beat);
            if let Err(error) = work(&shared, i) {
                first.lock().get_or_insert(error);
            }
        });
        failure.lock().take().map_or(Ok(()), Err)
    }
}

impl Drop for ThreadPool {
    fn drop(&mut self) {
        self.slot.shutdown.store(true, Ordering::Release);
        let helpers = self.helpers.take().into_iter().flatten();
        for helper in helpers {
            helper.thread().unpark();
            // A helper catches the panics of its tasks, so there is nothing to report.
            let _ = helper.join();
        }
    }
}

impl JobSlot {
    /// Runs a helper until the pool is dropped.
    fn run_helper(&self) {
        let is_over = || self.shutdown.load(Ordering::Acquire);
        let mut seen = 0;
        while !is_over() {
            wait_until(|| self.generation.load(Ordering::Acquire) != seen || is_over());
            seen = self.generation.load(Ordering::Acquire);
            let job = self.job.lock().clone();
            if let Some(job) = job {
                job.run_tasks();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_runs_once_whether_helpers_sleep_or_not() {
        for threads in [1, 2, 4] {
            let pool = ThreadPool::new(Threads::Fixed(threads), 7);
            for round in 0..300 {
                pool.use_threads(1 + round / 10 % threads);
                let counts: Arc<Vec<AtomicUsize>> =
                    Arc::new((0..7).map(|_| AtomicUsize::new(0)).collect());
                let shared = counts.clone();
                pool.run(7, move |i| {
                    shared[i].fetch_add(1, Ordering::Relaxed);
                });
                assert!(counts.iter().all(|c| c.load(Ordering::Relaxed) == 1), "round {round}");
                if round % 100 == 0 {
                    std::thread::sleep(3 * SPIN_DURATION);
                }
            }
        }
    }

    #[test]
    fn a_panic_in_a_task_reaches_the_caller_and_the_pool_stays_usable() {
        let pool = ThreadPool::new(Threads::Fixed(2), 4);
        let outcome = catch_unwind(AssertUnwindSafe(|| pool.run(4, |i| assert!(i != 2, "task 2"))));
        assert!(outcome.is_err());
        pool.run(4, |_| {});
    }
}
