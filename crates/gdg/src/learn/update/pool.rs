//! A thread pool for short pieces of work.
//!
//! An update consists of a few pieces of some hundred microseconds each. Waking a thread through
//! the operating system takes a considerable part of that, so helpers spin for a while waiting for
//! the next piece before they sleep.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};

use crate::pulse::Parts;

/// How long a helper spins before it sleeps: longer than the gap between two pieces of an update.
const SPIN_DURATION: Duration = Duration::from_micros(300);

/// Spin iterations between two clock reads.
const SPINS_PER_CLOCK_READ: usize = 64;

/// A piece of work: `tasks` calls, each with its own index.
struct Job {
    work: Box<dyn Fn(usize) + Send + Sync>,
    tasks: usize,
    /// The next task to claim.
    next: AtomicUsize,
    /// Number of finished tasks.
    done: AtomicUsize,
    panicked: AtomicBool,
}

impl Job {
    /// Runs tasks until none is left.
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
            self.done.fetch_add(1, Ordering::Release);
        }
    }
}

#[derive(Default)]
struct JobSlot {
    /// Number of pieces announced; helpers poll it.
    generation: AtomicUsize,
    job: Mutex<Option<Arc<Job>>>,
    /// Number of helpers that sleep or are about to.
    sleeping: AtomicUsize,
    wake: Condvar,
    shutdown: AtomicBool,
}

/// The caller and its helpers.
pub struct ThreadPool {
    slot: Arc<JobSlot>,
    threads: usize,
    /// Started by the first piece of work, so that they have the priority of the thread that works.
    helpers: OnceLock<Vec<JoinHandle<()>>>,
}

impl ThreadPool {
    /// Creates a pool of `threads` threads, including the caller; of fewer if the system refuses to
    /// start as many.
    pub fn new(threads: usize) -> Self {
        Self { slot: Arc::default(), threads, helpers: OnceLock::new() }
    }

    fn start_helpers(&self) -> Vec<JoinHandle<()>> {
        let start = |i| {
            let slot = self.slot.clone();
            let helper = std::thread::Builder::new()
                .name(format!("helper {i}"))
                .spawn(move || slot.run_helper());
            helper.inspect_err(|error| tracing::warn!("training with fewer threads: {error}")).ok()
        };
        (1..self.threads).map_while(start).collect()
    }

    /// Calls `work` with each index below `tasks`, on all threads of the pool; returns when all
    /// calls are done.
    ///
    /// # Panics
    /// Panics if a call panicked.
    pub fn run(&self, tasks: usize, work: impl Fn(usize) + Send + Sync + 'static) {
        if self.helpers.get_or_init(|| self.start_helpers()).is_empty() {
            return (0..tasks).for_each(work);
        }
        let job = Arc::new(Job {
            work: Box::new(work),
            tasks,
            next: AtomicUsize::new(0),
            done: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
        });
        *self.slot.job.lock() = Some(job.clone());
        self.slot.wake_helpers();
        job.run_tasks();
        while job.done.load(Ordering::Acquire) < tasks {
            std::hint::spin_loop();
        }
        assert!(!job.panicked.load(Ordering::Relaxed), "a task of the thread pool panicked");
    }
}

impl ThreadPool {
    /// Calls `work` with each index below `tasks` on data that all threads share; returns when all
    /// calls are done. A long update passes `parts`, which may skip calls.
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
        parts: Option<&Arc<Parts>>,
        work: fn(&S, usize) -> Result<(), E>,
    ) -> Result<(), E> {
        let failure = Arc::new(Mutex::new(None));
        let (shared, first, parts) = (shared.clone(), failure.clone(), parts.cloned());
        self.run(tasks, move |i| {
            if parts.as_ref().is_some_and(|parts| !parts.next()) {
                return;
            }
            if let Err(error) = work(&shared, i) {
                first.lock().get_or_insert(error);
            }
        });
        failure.lock().take().map_or(Ok(()), Err)
    }
}

impl Drop for ThreadPool {
    fn drop(&mut self) {
        self.slot.shutdown.store(true, Ordering::SeqCst);
        self.slot.wake_helpers();
        for helper in self.helpers.take().into_iter().flatten() {
            // A helper catches the panics of its tasks, so there is nothing to report.
            let _ = helper.join();
        }
    }
}

impl JobSlot {
    /// Signals all helpers, waking those that sleep.
    fn wake_helpers(&self) {
        // Sequentially consistent with a helper's increment of `sleeping`: either the helper sees
        // the new number, or it is seen here as sleeping.
        self.generation.fetch_add(1, Ordering::SeqCst);
        if self.sleeping.load(Ordering::SeqCst) > 0 {
            let _awake = self.job.lock();
            self.wake.notify_all();
        }
    }

    /// Runs a helper until the pool is dropped.
    fn run_helper(&self) {
        let mut seen = 0;
        while !self.shutdown.load(Ordering::SeqCst) {
            seen = self.await_generation_after(seen);
            let job = self.job.lock().clone();
            if let Some(job) = job {
                job.run_tasks();
            }
        }
    }

    fn await_generation_after(&self, seen: usize) -> usize {
        let began = Instant::now();
        while began.elapsed() < SPIN_DURATION {
            for _ in 0..SPINS_PER_CLOCK_READ {
                let generation = self.generation.load(Ordering::SeqCst);
                if generation != seen {
                    return generation;
                }
                std::hint::spin_loop();
            }
        }
        let mut guard = self.job.lock();
        self.sleeping.fetch_add(1, Ordering::SeqCst);
        while self.generation.load(Ordering::SeqCst) == seen {
            self.wake.wait(&mut guard);
        }
        self.sleeping.fetch_sub(1, Ordering::SeqCst);
        self.generation.load(Ordering::SeqCst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_runs_once_whether_helpers_sleep_or_not() {
        for threads in [1, 2, 4] {
            let pool = ThreadPool::new(threads);
            for round in 0..300 {
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
        let pool = ThreadPool::new(2);
        let outcome = catch_unwind(AssertUnwindSafe(|| pool.run(4, |i| assert!(i != 2, "task 2"))));
        assert!(outcome.is_err());
        pool.run(4, |_| {});
    }
}
