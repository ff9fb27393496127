//! Runs jobs in parallel; resumes and saves them.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use miette::{IntoDiagnostic, Report, miette};
use parking_lot::Mutex;

use super::folder::Folder;
use super::job::Job;
use super::measure::measure;
use super::picture;
use super::plan::{JobData, Length};
use super::progress::Progress;
use crate::headless::{Saver, evaluate, save_interval};
use crate::host::outputs::{elsewhere, save_elsewhere};
use crate::host::report::print_error;
use crate::host::setup::{begin, learn_from};
use crate::host::signals::TerminationSignal;
use gdg::files::{LockFile, check_writable};
use gdg::printing::eprint_line;
use gdg::text::{counted, sanitized};
use gdg::train::{self, Due, EndReason, Registry, SaveTo, Schedule, Session, Trainer, describe};

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
    folder: Folder,
    /// Worlds and learners.
    registry: Arc<Registry>,
    /// Ends all jobs when a signal arrives.
    termination: TerminationSignal,
    /// Whether the checkpoints of finished jobs are kept.
    keep: bool,
}

/// Outcome of the jobs that had no result.
pub struct Outcome<'a> {
    /// These jobs.
    pub open: Vec<&'a Job>,
    /// How each ended, in the same order.
    pub ends: Vec<End>,
    /// Exit status if a signal ended them.
    pub interrupted: Option<u8>,
}

impl Runner {
    /// Runs those of `jobs` that have no result, `parallel` at a time, until a signal arrives.
    ///
    /// # Errors
    /// A result could not be written, or signals cannot be listened for.
    pub fn run_open<'a>(
        folder: &Folder,
        registry: &Arc<Registry>,
        jobs: impl Iterator<Item = &'a Job>,
        parallel: usize,
        keep: bool,
    ) -> Result<Outcome<'a>, Report> {
        let (done, open): (Vec<&Job>, Vec<&Job>) =
            jobs.partition(|job| folder.result_of(job).is_some());
        for job in &open {
            folder.check_result_writable(job)?;
            if let Some(problem) = folder.problem(job) {
                eprint_line(&format!("{problem}; it runs again"));
            }
        }
        if let Some(longest) =
            open.iter().map(|job| folder.checkpoint(job)).max_by_key(|path| path.as_os_str().len())
        {
            check_writable(&longest).map_err(|error| {
                miette!(
                    help = "give --out another folder",
                    "{}: cannot be saved: {error}",
                    longest.display()
                )
            })?;
        }
        eprint_line(&format!("{} done, {} to run", counted(done.len() as u64, "job"), open.len()));
        let termination = TerminationSignal::listen()?;
        let (folder, registry) = (folder.clone(), registry.clone());
        let runner = Self { folder, registry, termination: termination.clone(), keep };
        let ends = runner.run(&open, parallel);
        Ok(Outcome { open, ends, interrupted: termination.status() })
    }

    /// Runs `jobs` without a result, `parallel` at a time, the longest first; returns how each
    /// ended, in the same order. A job that fails does not end the others.
    fn run(&self, jobs: &[&Job], parallel: usize) -> Vec<End> {
        let mut order: Vec<usize> = (0..jobs.len()).collect();
        let length = |i: &usize| {
            (matches!(jobs[*i].plan.length, Length::Episodes(_)), jobs[*i].plan.length.amount())
        };
        order.sort_by_key(|i| std::cmp::Reverse(length(i)));
        let progress = Progress::new(jobs, parallel);
        let (next, ended) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let ends: Vec<Mutex<End>> = jobs.iter().map(|_| Mutex::new(End::Interrupted)).collect();
        let work = || {
            while let Some(i) = order.get(next.fetch_add(1, Ordering::Relaxed))
                && self.termination.number().is_none()
            {
                let end = self.run_guarded(jobs[*i], &At { progress: &progress, job: *i });
                progress.end(*i, end == End::Done);
                let count = ended.fetch_add(1, Ordering::Relaxed) + 1;
                let name = &jobs[*i].name;
                match &end {
                    End::Done => progress.line(&format!("{name}: done, {count} of {}", jobs.len())),
                    End::Elsewhere => progress.line(&format!("{name}: another process runs it")),
                    End::Interrupted => progress.line(&format!("{name}: interrupted, saved")),
                    End::Failed => {}
                }
                *ends[*i].lock() = end;
            }
        };
        std::thread::scope(|scope| {
            let thread =
                |i| std::thread::Builder::new().name(format!("jobs {i}")).spawn_scoped(scope, work);
            if (1..=parallel.min(jobs.len())).filter(|i| thread(*i).is_ok()).count() == 0 {
                work();
            }
        });
        ends.into_iter().map(Mutex::into_inner).collect()
    }

    /// Runs a job; an error or a panic becomes [`End::Failed`].
    fn run_guarded(&self, job: &Job, at: &At) -> End {
        let run = || match self.folder.lock(job)? {
            Some(lock) => self.run_locked(job, at, &lock),
            None => Ok(End::Elsewhere),
        };
        match catch_unwind(AssertUnwindSafe(run)) {
            Ok(Ok(end)) => end,
            Ok(Err(error)) => failed(job, error),
            Err(_) => {
                failed(job, miette!(help = crate::host::logging::hint(), "an internal error"))
            }
        }
    }

    /// Runs a job, unless another process has finished it in the meantime.
    fn run_locked(&self, job: &Job, at: &At, _: &LockFile) -> Result<End, Report> {
        if self.folder.result_of(job).is_some() {
            return Ok(End::Done);
        }
        let mut trainer = self.resume_or_begin(job, at)?;
        trainer.set_job(self.termination.job().clone());
        let mut saver = Saver::new(SaveTo::Replace(self.folder.checkpoint(job)));
        at.progress.begin(at.job, job.plan.length.done(&trainer.counters()));
        let ended = self.train_and_finish(job, &mut trainer, &mut saver, at);
        if ended.is_err() && self.folder.result_of(job).is_none() {
            rescue(job, &mut trainer, &mut saver, at);
        }
        ended
    }

    /// Trains to the end and keeps the result, or the checkpoint if a signal arrives.
    fn train_and_finish(
        &self,
        job: &Job,
        trainer: &mut Trainer,
        saver: &mut Saver,
        at: &At,
    ) -> Result<End, Report> {
        if !self.train(job, trainer, saver, at)? {
            saver.save(trainer)?;
            return Ok(End::Interrupted);
        }
        if self.keep {
            saver.save(trainer)?;
        }
        let map = job.world.map().filter(|_| job.plan.picture);
        let picture = map.map(|map| picture::draw(trainer, map)).transpose()?;
        let measured = measure(&job.plan, trainer, job.world.map())?;
        self.folder.finish(job, &job.result(trainer, measured), picture.as_deref(), self.keep)?;
        Ok(End::Done)
    }

    /// Resumes the job from its checkpoint; begins it if there is none that can be loaded.
    fn resume_or_begin(&self, job: &Job, at: &At) -> Result<Trainer, Report> {
        let (name, own, length) = (&job.name, self.folder.checkpoint(job), job.plan.length);
        let (amount, unit) = (length.amount(), length.unit());
        // Includes where it was saved if its own file could not be written; `max_by_key` prefers
        // its own, the last, among equals.
        let found = elsewhere(&own).into_iter().chain([own]).filter(|path| path.exists());
        if let Some(checkpoint) =
            found.max_by_key(|path| describe(path).map_or(0, |found| found.updates))
        {
            match train::load(&checkpoint, &self.registry, 1) {
                Ok(trainer) if job.is_run_of(&trainer) => {
                    trainer.check_data().into_diagnostic()?;
                    let done = length.done(&trainer.counters());
                    at.progress.line(&format!("{name}: resumes after {done} of {amount} {unit}"));
                    return Ok(trainer);
                }
                Ok(_) => at
                    .progress
                    .line(&format!("{name}: its checkpoint is of another run: begins again")),
                Err(error) => at.progress.line(&format!("{name}: {error}: begins again")),
            }
        }
        at.progress.line(&format!("{name}: begins, {amount} {unit}"));
        let world = job.world.create(&self.registry)?;
        let mut trainer = begin(job.run.clone(), &*world, &self.registry, 1)?;
        let data = job.plan.data.as_ref();
        let untold = gdg::job::Job::default();
        let learn = |data: &JobData| {
            let warning = learn_from(&mut trainer, &data.file, &untold)?;
            let read = trainer.data().map(|read| read.checksum);
            if read == Some(data.checksum) {
                return Ok(warning);
            }
            let file = sanitized(&data.file.to_string_lossy());
            Err(miette!(help = "run it again", "{file}: has changed since the experiment began"))
        };
        if let Some(warning) = data.map_or(Ok(None), learn)? {
            at.progress.line(&warning);
        }
        Ok(trainer)
    }

    /// Trains and evaluates to the end; returns whether it got there before a signal arrived.
    fn train(
        &self,
        job: &Job,
        trainer: &mut Trainer,
        saver: &mut Saver,
        at: &At,
    ) -> Result<bool, Report> {
        let (length, evaluate) = (job.plan.length, job.plan.evaluate_at());
        let schedule =
            Schedule { evaluate, save_every: save_interval(None), ..Schedule::default() };
        let (mut session, limits) = (Session::resume(schedule, trainer), length.limits());
        loop {
            while let Some(due) = session.next_due() {
                match due {
                    Due::Evaluation => {
                        if !self.evaluate(job, trainer, at)? {
                            return Ok(false);
                        }
                    }
                    Due::Save => {
                        if let Err(error) = saver.save(trainer) {
                            print_error(
                                error.wrap_err("training continues; saving will be tried again"),
                            );
                        }
                    }
                    Due::Recovery(recovery) => {
                        at.progress.line(&format!("{}: {recovery}", job.name));
                    }
                    Due::Progress | Due::Edit(_) => {}
                }
            }
            if let ControlFlow::Break(reason) = session.tick(trainer, &limits).into_diagnostic()? {
                return Ok(reason != EndReason::Interrupted);
            }
            let is_steady = trainer.pace().per_second(|counters| counters.updates).is_some();
            at.progress.advance(at.job, length.done(&trainer.counters()), is_steady);
        }
    }

    /// Evaluates the present state; returns whether no signal arrived.
    fn evaluate(&self, job: &Job, trainer: &mut Trainer, at: &At) -> Result<bool, Report> {
        let (plan, length) = (&job.plan, job.plan.length);
        let done = length.done(&trainer.counters());
        let tasks = plan.tasks_after(done);
        let evaluated = evaluate(trainer, tasks, plan.max_steps, &self.termination)?;
        let Some(evaluation) = evaluated.transpose().into_diagnostic()? else {
            return Ok(false);
        };
        let updates = trainer.counters().updates;
        let (name, success, amount, unit) =
            (&job.name, evaluation.success(updates), length.amount(), length.unit());
        let rate = updates as f64 / trainer.seconds().max(1e-3);
        at.progress.line(&format!(
            "{name}: {done} of {amount} {unit}, {success}, {rate:.0} updates/s{}",
            at.progress.overall()
        ));
        if !evaluation.is_finite() && done >= amount {
            return Err(miette!(
                help = "try another seed, or a smaller learning_rate",
                "the distances are not finite"
            ));
        }
        Ok(true)
    }
}

/// Where a job reports its progress.
struct At<'a> {
    progress: &'a Progress,
    /// The job's index.
    job: usize,
}

/// Saves a job elsewhere if its result or checkpoint could not be written: the next run resumes
/// from there.
fn rescue(job: &Job, trainer: &mut Trainer, saver: &mut Saver, at: &At) {
    if saver.save(trainer).is_err() {
        let kept = save_elsewhere(trainer, saver.path());
        let line = kept.map_or("what it has learned cannot be saved".to_owned(), |path| {
            format!("saved to {} instead, where the next run finds it", path.display())
        });
        at.progress.line(&format!("{}: {line}", job.name));
    }
}

/// Prints why a job failed.
fn failed(job: &Job, error: Report) -> End {
    log::error!("{}: {error}", job.name);
    print_error(error.wrap_err(format!("job {} failed", job.name)));
    End::Failed
}
