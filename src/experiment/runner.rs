//! Runs jobs in parallel; resumes and saves them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use miette::{IntoDiagnostic, Report, miette};
use parking_lot::Mutex;

use super::folder::{Folder, Lock};
use super::job::Job;
use super::picture;
use crate::env::PointMaze;
use crate::headless::{Saver, evaluate};
use crate::report::print_error;
use crate::setup::begin;
use crate::signals::TerminationSignal;
use crate::text::eprint_line;
use crate::train::{self, Registry, SaveTo, Tick, Trainer};

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// It has a result.
    Done,
    /// A signal arrived: its checkpoint is saved.
    Interrupted,
    /// Another process runs it.
    Elsewhere,
    /// An error, which is printed.
    Failed,
}

/// Runs jobs, each on one thread.
pub struct Runner {
    /// Where results and checkpoints are kept.
    pub folder: Folder,
    /// Worlds and learners.
    pub registry: Arc<Registry>,
    /// Ends all jobs when a signal arrives.
    pub termination: TerminationSignal,
    /// Whether the checkpoints of finished jobs are kept.
    pub keep: bool,
}

impl Runner {
    /// Runs `jobs` without a result, `parallel` at a time, those with most updates first; returns how each ended, in the
    /// same order. A job that fails does not end the others.
    pub fn run(&self, jobs: &[&Job], parallel: usize) -> Vec<End> {
        let mut order: Vec<usize> = (0..jobs.len()).collect();
        order.sort_by_key(|i| std::cmp::Reverse(jobs[*i].updates));
        let (next, ended) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let ends: Vec<Mutex<End>> = jobs.iter().map(|_| Mutex::new(End::Interrupted)).collect();
        let work = || {
            while let Some(i) = order.get(next.fetch_add(1, Ordering::Relaxed))
                && self.termination.number().is_none()
            {
                let end = self.run_guarded(jobs[*i]);
                let count = ended.fetch_add(1, Ordering::Relaxed) + 1;
                let name = &jobs[*i].name;
                match &end {
                    End::Done => eprint_line(&format!("{name}: done, {count} of {}", jobs.len())),
                    End::Elsewhere => eprint_line(&format!("{name}: another process runs it")),
                    End::Interrupted => eprint_line(&format!("{name}: interrupted, saved")),
                    End::Failed => {}
                }
                *ends[*i].lock() = end;
            }
        };
        std::thread::scope(|scope| {
            let thread = |i| std::thread::Builder::new().name(format!("jobs {i}")).spawn_scoped(scope, work);
            if (1..=parallel.min(jobs.len())).filter(|i| thread(*i).is_ok()).count() == 0 {
                work();
            }
        });
        ends.into_iter().map(Mutex::into_inner).collect()
    }

    /// Runs a job; an error or a panic becomes [`End::Failed`].
    fn run_guarded(&self, job: &Job) -> End {
        let run = || match self.folder.lock(job)? {
            Some(lock) => self.run_locked(job, &lock),
            None => Ok(End::Elsewhere),
        };
        match catch_unwind(AssertUnwindSafe(run)) {
            Ok(Ok(end)) => end,
            Ok(Err(error)) => failed(job, error),
            Err(_) => failed(job, miette!(help = crate::logging::hint(), "an internal error")),
        }
    }

    /// Runs a job, unless another process has finished it in the meantime.
    fn run_locked(&self, job: &Job, _: &Lock) -> Result<End, Report> {
        if self.folder.result_of(job).is_some() {
            return Ok(End::Done);
        }
        let mut trainer = self.resume_or_begin(job)?;
        let mut saver = Saver::new(SaveTo::Replace(self.folder.checkpoint(job)), None);
        if !self.train(job, &mut trainer, &mut saver)? {
            saver.save(&mut trainer)?;
            return Ok(End::Interrupted);
        }
        if self.keep {
            saver.save(&mut trainer)?;
        }
        let picture = picture::draw(&trainer, &job.map)?;
        self.folder.finish(job, &job.result(&trainer), &picture, self.keep)?;
        Ok(End::Done)
    }

    /// Resumes the job from its checkpoint; begins it if there is none that can be loaded.
    fn resume_or_begin(&self, job: &Job) -> Result<Trainer, Report> {
        let (name, checkpoint) = (&job.name, self.folder.checkpoint(job));
        if checkpoint.exists() {
            match train::load(&checkpoint, &self.registry, 1) {
                Ok(loaded) if job.is_run_of(&loaded.trainer) => {
                    loaded.warning.iter().for_each(|warning| eprint_line(warning));
                    let updates = loaded.trainer.counters().updates;
                    eprint_line(&format!("{name}: resumes after {updates} of {} updates", job.updates));
                    return Ok(loaded.trainer);
                }
                Ok(_) => eprint_line(&format!("{name}: its checkpoint is of another run: begins again")),
                Err(error) => eprint_line(&format!("{name}: {error}: begins again")),
            }
        }
        eprint_line(&format!("{name}: begins, {} updates", job.updates));
        begin(job.run.clone(), &PointMaze::new(job.map.clone(), 0), &self.registry, 1)
    }

    /// Trains and evaluates to the last update; returns whether it got there before a signal arrived.
    fn train(&self, job: &Job, trainer: &mut Trainer, saver: &mut Saver) -> Result<bool, Report> {
        let mut tick = Tick::Update;
        loop {
            if self.termination.number().is_some() {
                return Ok(false);
            }
            let updates = trainer.counters().updates;
            if tick == Tick::Update && !self.evaluate_if_due(job, trainer)? {
                return Ok(false);
            }
            if updates >= job.updates {
                return Ok(true);
            }
            crate::faults::point("trainer");
            tick = trainer.tick().into_diagnostic()?;
            if let Some(recovery) = trainer.take_recovery() {
                eprint_line(&format!("{}: {recovery}", job.name));
            }
            if saver.is_due()
                && let Err(error) = saver.save(trainer)
            {
                print_error(error.wrap_err("training continues; saving will be tried again"));
            }
        }
    }

    /// Evaluates if an evaluation is due and has not been made; returns whether no signal arrived.
    fn evaluate_if_due(&self, job: &Job, trainer: &mut Trainer) -> Result<bool, Report> {
        let updates = trainer.counters().updates;
        let made = trainer.history().evaluations().last().is_some_and(|(at, _)| *at == updates);
        if made || !job.evaluates_at(updates) {
            return Ok(true);
        }
        let Some(evaluation) = evaluate(trainer, job.eval_tasks as usize, &self.termination)? else {
            return Ok(false);
        };
        let (name, success) = (&job.name, evaluation.success(updates));
        let rate = updates as f64 / trainer.seconds().max(1e-3);
        eprint_line(&format!("{name}: {updates} of {} updates, {success}, {rate:.0} updates/s", job.updates));
        if !evaluation.is_finite() && updates == job.updates {
            return Err(miette!(help = "try another seed, or a smaller learning_rate", "the distances are not finite"));
        }
        Ok(true)
    }
}

/// Prints why a job failed.
fn failed(job: &Job, error: Report) -> End {
    tracing::error!("{}: {error}", job.name);
    print_error(error.wrap_err(format!("job {} failed", job.name)));
    End::Failed
}
