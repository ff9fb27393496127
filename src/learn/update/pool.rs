//! A thread pool for short pieces of work.
//!
//! An update consists of a few pieces of some hundred microseconds each. Waking a thread through the operating system
//! takes a considerable part of that, so helpers spin for a while waiting for the next piece before they sleep.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};

/// How long a helper spins before it sleeps: longer than the gap between two pieces of an update.
const LOOK_OUT: Duration = Duration::from_micros(300);

/// Spin iterations between two clock reads.
const LOOKS: usize = 64;

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
    fn help(&self) {
        loop {
            let task = self.next.fetch_add(1, Ordering::Relaxed);
            if task >= self.tasks {
                return;
            }
            // A panic must not leave the others waiting forever; `ThreadPool::run` panics in the caller instead.
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
    number: AtomicUsize,
    piece: Mutex<Option<Arc<Job>>>,
    /// Number of helpers that sleep or are about to.
    sleeping: AtomicUsize,
    wake: Condvar,
    over: AtomicBool,
}

/// The caller and its helpers.
pub struct ThreadPool {
    board: Arc<JobSlot>,
    helpers: Vec<JoinHandle<()>>,
}

impl ThreadPool {
    /// Creates a pool of `threads` threads, including the caller.
    ///
    /// # Errors
    /// Returns an error if a thread cannot be started.
    pub fn new(threads: usize) -> std::io::Result<Self> {
        let mut team = Self { board: Arc::new(JobSlot::default()), helpers: Vec::new() };
        for i in 1..threads {
            let board = team.board.clone();
            let helper = std::thread::Builder::new().name(format!("helper {i}")).spawn(move || board.serve())?;
            team.helpers.push(helper);
        }
        Ok(team)
    }

    /// Calls `work` with each index below `tasks`, on all threads of the pool; returns when all calls are done.
    ///
    /// # Panics
    /// Panics if a call panicked.
    pub fn run(&self, tasks: usize, work: impl Fn(usize) + Send + Sync + 'static) {
        if self.helpers.is_empty() {
            return (0..tasks).for_each(work);
        }
        let piece = Arc::new(Job {
            work: Box::new(work),
            tasks,
            next: AtomicUsize::new(0),
            done: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
        });
        *self.board.piece.lock() = Some(piece.clone());
        self.board.announce();
        piece.help();
        while piece.done.load(Ordering::Acquire) < tasks {
            std::hint::spin_loop();
        }
        assert!(!piece.panicked.load(Ordering::Relaxed), "a task of the thread pool panicked");
    }
}

impl Drop for ThreadPool {
    fn drop(&mut self) {
        self.board.over.store(true, Ordering::SeqCst);
        self.board.announce();
        for helper in self.helpers.drain(..) {
            // A helper catches the panics of its tasks, so there is nothing to report.
            let _ = helper.join();
        }
    }
}

impl JobSlot {
    /// Signals all helpers, waking those that sleep.
    fn announce(&self) {
        // Sequentially consistent with a helper's increment of `sleeping`: either the helper sees the new number, or it
        // is seen here as sleeping.
        self.number.fetch_add(1, Ordering::SeqCst);
        if self.sleeping.load(Ordering::SeqCst) > 0 {
            let _awake = self.piece.lock();
            self.wake.notify_all();
        }
    }

    /// Runs a helper until the pool is dropped.
    fn serve(&self) {
        let mut seen = 0;
        while !self.over.load(Ordering::SeqCst) {
            seen = self.await_number_after(seen);
            let piece = self.piece.lock().clone();
            if let Some(piece) = piece {
                piece.help();
            }
        }
    }

    fn await_number_after(&self, seen: usize) -> usize {
        let began = Instant::now();
        while began.elapsed() < LOOK_OUT {
            for _ in 0..LOOKS {
                let number = self.number.load(Ordering::SeqCst);
                if number != seen {
                    return number;
                }
                std::hint::spin_loop();
            }
        }
        let mut guard = self.piece.lock();
        self.sleeping.fetch_add(1, Ordering::SeqCst);
        while self.number.load(Ordering::SeqCst) == seen {
            self.wake.wait(&mut guard);
        }
        self.sleeping.fetch_sub(1, Ordering::SeqCst);
        self.number.load(Ordering::SeqCst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_task_runs_once_whether_helpers_sleep_or_not() {
        for threads in [1, 2, 4] {
            let team = ThreadPool::new(threads).expect("a pool");
            for round in 0..300 {
                let counts: Arc<Vec<AtomicUsize>> = Arc::new((0..7).map(|_| AtomicUsize::new(0)).collect());
                let shared = counts.clone();
                team.run(7, move |i| {
                    shared[i].fetch_add(1, Ordering::Relaxed);
                });
                assert!(counts.iter().all(|c| c.load(Ordering::Relaxed) == 1), "round {round}");
                if round % 100 == 0 {
                    std::thread::sleep(3 * LOOK_OUT);
                }
            }
        }
    }

    #[test]
    fn a_panic_in_a_task_reaches_the_caller_and_the_pool_stays_usable() {
        let team = ThreadPool::new(2).expect("a pool");
        let outcome = catch_unwind(AssertUnwindSafe(|| team.run(4, |i| assert!(i != 2, "task 2"))));
        assert!(outcome.is_err());
        team.run(4, |_| {});
    }
}
