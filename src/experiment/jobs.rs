//! The jobs of an experiment: listed, run in parallel, resumed, saved, and reported.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use clap::Args;
use miette::{IntoDiagnostic, Report, miette};
use parking_lot::Mutex;

use super::folder::Folder;
use super::measure::{self, measure};
use super::plan::Length;
use super::spec::JobSpec;
use crate::headless::{CheckpointSaver, evaluate, save_interval};
use crate::process::EXIT_FAILURE;
use crate::process::errors::{print, print_error};
use crate::process::signals::TerminationSignal;
use crate::process::waiting::duration;
use crate::setup::outputs::elsewhere;
use crate::setup::saves::SAVES;
use crate::setup::values::{counts, output};
use crate::setup::{begin, learn_from, parallel_jobs};
use gdg::files::check_writable;
use gdg::job::Stopwatch;
use gdg::printing::eprint_line;
use gdg::text::{aligned, counted, display_width, fitted_file, grouped, sanitized};
use gdg::train::{
    self, EndReason, Registry, SaveTo, Schedule, Trainer, TrainingEvent, TrainingLoop,
};

/// A length below this share of the usual one says nothing about a method.
const SHORT: f64 = 0.1;

/// Least time between two lines about evaluations; the last one of each job is always printed.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// The fewest columns of a job's name on a terminal.
const LEAST_NAME: usize = 12;

#[derive(Clone, Debug, Args)]
pub struct JobOptions {
    /// Folder for jobs, their checkpoints, results and the report [default: saves/ and the command]
    #[arg(long, value_name = "FOLDER", value_parser = output())]
    pub out: Option<PathBuf>,

    /// Parallel jobs, each on one thread; results do not depend on their number [default: this
    /// machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub jobs: Option<u16>,

    /// Print one line per job, its name first, and exit
    #[arg(long, conflicts_with_all = ["job", "collect"])]
    pub list: bool,

    /// Run only this job, by its name or by its line in --list (repeatable), and report nothing
    #[arg(long, value_name = "NAME|N", conflicts_with = "collect")]
    pub job: Vec<String>,

    /// Run nothing: report from the jobs that are done
    #[arg(long)]
    pub collect: bool,

    /// Remove the checkpoints of finished jobs, which --resume needs
    #[arg(long)]
    pub no_keep: bool,
}

/// The jobs of an experiment, each once, in order.
pub struct Jobs<'a> {
    pub all: Vec<JobSpec>,
    pub folder: Folder,
    registry: &'a Arc<Registry>,
    options: &'a JobOptions,
}

impl JobOptions {
    pub fn folder(&self, command: &str) -> Folder {
        Folder(self.out.clone().unwrap_or_else(|| Path::new(SAVES).join(command)))
    }
}

impl<'a> Jobs<'a> {
    /// Takes the jobs of a command, the same of which may be given several times. Checks that those
    /// named exist, and that results can be written.
    pub fn new(
        command: &str,
        jobs: impl IntoIterator<Item = JobSpec>,
        options: &'a JobOptions,
        registry: &'a Arc<Registry>,
    ) -> Result<Self, Report> {
        let mut known = BTreeSet::new();
        let all = jobs.into_iter().filter(|job| known.insert(job.name.clone())).collect();
        let jobs = Self { all, folder: options.folder(command), registry, options };
        jobs.chosen()?;
        if options.collect {
            jobs.folder.check_has_jobs()?;
        }
        if !options.list {
            jobs.folder.check_writable()?;
        }
        Ok(jobs)
    }

    /// Returns the jobs to run: those given with `--job`, or all.
    fn chosen(&self) -> Result<Vec<&JobSpec>, Report> {
        if self.options.job.is_empty() {
            return Ok(self.all.iter().collect());
        }
        let find = |name: &String| {
            let line = name.parse().ok().and_then(|line: usize| self.all.get(line.checked_sub(1)?));
            line.or_else(|| self.all.iter().find(|job| job.name == *name)).ok_or_else(|| {
                let names: Vec<&str> = self.all.iter().map(|job| job.name.as_str()).collect();
                let (all, names) = (names.len(), names.join(", "));
                let help = format!("give a number from 1 to {all}, or a name: {names}");
                miette!(help = help, "--job {name}: there is no such job")
            })
        };
        let mut chosen = self.options.job.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let mut seen = BTreeSet::new();
        chosen.retain(|job| seen.insert(&job.name));
        Ok(chosen)
    }

    /// Lists the jobs; or runs those without a result and, unless single ones were named, calls
    /// `report` with the names of those that have none yet. Returns the exit status.
    pub fn run(&self, report: impl FnOnce(&[&str]) -> Result<(), Report>) -> Result<u8, Report> {
        if self.options.list {
            return print(&self.list()).map(|()| 0);
        }
        let (chosen, collect) = (self.chosen()?, self.options.collect);
        let mut any_failed = false;
        if !collect {
            let (failed, interrupted) = self.run_open(&chosen)?;
            if let Some(status) = interrupted {
                return Ok(status);
            }
            any_failed = failed;
        }
        if self.options.job.is_empty() {
            let open = self.all.iter().filter(|job| self.folder.result_of(job).is_none());
            let missing: Vec<&str> = open.map(|job| &*job.name).collect();
            report(&missing)?;
            if !missing.is_empty() {
                let names = missing.join(", ");
                eprint_line(&format!("{} missing: {names}", counted(missing.len() as u64, "job")));
                any_failed |= collect;
            }
        }
        Ok(if any_failed { EXIT_FAILURE } else { 0 })
    }

    fn list(&self) -> String {
        let row = |job: &JobSpec| {
            let variant = job.variant.as_ref().map_or(String::new(), |name| format!(" {name}"));
            let length = job.plan.length;
            vec![
                job.name.clone(),
                sanitized(job.world.name()),
                format!("{}{variant}", job.run.method),
                format!("seed {}", job.run.seed),
                format!("{:>7} {}", length.amount(), length.unit()),
                self.folder.state(job),
            ]
        };
        aligned(&self.all.iter().map(row).collect::<Vec<_>>())
    }
}

/// Warns if jobs train for far less than is `usual` for them, given in the same unit.
pub fn warn_if_short<'a>(jobs: impl IntoIterator<Item = (&'a JobSpec, u64)>) {
    let is_short =
        |(job, usual): &(&JobSpec, u64)| (job.plan.length.amount() as f64) < SHORT * *usual as f64;
    if let Some((job, usual)) = jobs.into_iter().find(is_short) {
        let (name, length, usual) = (job.world.name(), job.plan.length, grouped(usual));
        eprint_line(&sanitized(&format!(
            "warning: {} {} on {name}, where {usual} are usual, are too few to compare methods",
            grouped(length.amount()),
            length.unit()
        )));
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    Done,
    /// A signal arrived: its checkpoint is saved.
    Interrupted,
    Elsewhere,
    Failed,
}

struct Runner<'a> {
    all: &'a Jobs<'a>,
    termination: TerminationSignal,
    open: Vec<&'a JobSpec>,
    progress: JobsProgress,
    /// When the last line about an evaluation was printed.
    said: Mutex<Option<Instant>>,
}

impl Jobs<'_> {
    /// Runs those of `jobs` that have no result until a signal arrives, and says which failed or
    /// run elsewhere. Returns whether any failed, and the exit status if a signal ended them.
    fn run_open(&self, jobs: &[&JobSpec]) -> Result<(bool, Option<u8>), Report> {
        let Self { folder, options, .. } = self;
        let (done, open): (Vec<&JobSpec>, Vec<&JobSpec>) =
            jobs.iter().partition(|job| folder.result_of(job).is_some());
        for job in &open {
            folder.check_result_writable(job)?;
            if let Some(problem) = folder.problem(job)? {
                eprint_line(&format!("{problem}; it runs again"));
            }
        }
        let checkpoints = open.iter().map(|job| folder.checkpoint(job));
        if let Some(longest) = checkpoints.max_by_key(|path| path.as_os_str().len()) {
            check_writable(&longest).map_err(|error| {
                let (help, path) = ("give --out another folder", longest.display());
                miette!(help = help, "{path}: cannot be saved: {error}")
            })?;
        }
        eprint_line(&format!("{} done, {} to run", counted(done.len() as u64, "job"), open.len()));
        let (termination, progress) = (TerminationSignal::listen()?, JobsProgress::new(open.len()));
        let runner = Runner { all: self, termination, open, progress, said: Mutex::default() };
        let ends = runner.run(parallel_jobs(options.jobs));
        let named = |wanted: End| {
            let found = runner.open.iter().zip(&ends).filter(move |(_, end)| **end == wanted);
            found.map(|(job, _)| &*job.name).collect::<Vec<_>>()
        };
        let (failed, others) = (named(End::Failed), named(End::Elsewhere));
        if !failed.is_empty() {
            let names = failed.join(", ");
            eprint_line(&format!("{} failed: {names}", counted(failed.len() as u64, "job")));
        }
        if !others.is_empty() {
            let names = others.join(", ");
            let then = "once they are done, run this again for all of the report";
            eprint_line(&format!("other processes run {names}: {then}"));
        }
        Ok((!failed.is_empty(), runner.termination.status()))
    }
}

impl Runner<'_> {
    /// Runs the jobs, the longest first, also after one has failed; returns how each ended.
    fn run(&self, parallel: usize) -> Vec<End> {
        let all = self.open.len();
        let mut order: Vec<usize> = (0..all).collect();
        order.sort_by_key(|i| {
            let length = self.open[*i].plan.length;
            std::cmp::Reverse((matches!(length, Length::Episodes(_)), length.amount()))
        });
        let (next, ended) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let ends = Mutex::new(vec![End::Interrupted; all]);
        let work = || {
            while let Some(i) = order.get(next.fetch_add(1, Ordering::Relaxed))
                && self.termination.number().is_none()
            {
                let end = self.run_guarded(*i);
                self.progress.advance(*i, 1.0);
                let count = ended.fetch_add(1, Ordering::Relaxed) + 1;
                match end {
                    End::Done => self.say(*i, &format!("done, {count} of {all}")),
                    End::Elsewhere => self.say(*i, "another process runs it"),
                    End::Interrupted => self.say(*i, "stopped and saved; run this again to go on"),
                    End::Failed => {}
                }
                ends.lock()[*i] = end;
            }
        };
        std::thread::scope(|scope| {
            let thread =
                |i| std::thread::Builder::new().name(format!("jobs {i}")).spawn_scoped(scope, work);
            if (1..=parallel.min(all)).filter(|i| thread(*i).is_ok()).count() == 0 {
                work();
            }
        });
        ends.into_inner()
    }

    fn share_of(&self, i: usize, trainer: &Trainer) -> f64 {
        let length = self.open[i].plan.length;
        length.done(&trainer.counters()) as f64 / length.amount().max(1) as f64
    }

    fn say(&self, i: usize, text: &str) {
        eprint_line(&line(&self.open[i].name, text, terminal_width()));
    }

    /// Runs a job; an error or a panic becomes [`End::Failed`].
    fn run_guarded(&self, i: usize) -> End {
        let job = self.open[i];
        let run = || match self.all.folder.lock(job)? {
            // Another process may have finished it in the meantime.
            Some(_) if self.all.folder.result_of(job).is_some() => Ok(End::Done),
            Some(_lock) => self.run_locked(i),
            None => Ok(End::Elsewhere),
        };
        let panicked =
            |_| Err(miette!(help = crate::process::logging::hint(), "an internal error"));
        catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(panicked).unwrap_or_else(|error| {
            log::error!("{}: {error}", job.name);
            print_error(&error.wrap_err(format!("job {} failed", job.name)));
            End::Failed
        })
    }

    /// Runs a job to its end. If its result or checkpoint cannot be written, it is saved elsewhere:
    /// the next run resumes from there.
    fn run_locked(&self, i: usize) -> Result<End, Report> {
        let job = self.open[i];
        let mut trainer = self.resume_or_begin(i)?;
        trainer.set_job(self.termination.job.clone());
        self.progress.begin(i, self.share_of(i, &trainer));
        let mut saver = CheckpointSaver::new(SaveTo::Replace(self.all.folder.checkpoint(job)));
        let ended = self.train_and_finish(i, &mut trainer, &mut saver);
        if ended.is_err()
            && self.all.folder.result_of(job).is_none()
            && saver.save(&mut trainer).is_err()
        {
            let kept = &saver.instead;
            let line = kept.as_ref().map_or("what it has learned cannot be saved".into(), |path| {
                format!("saved to {} instead, where the next run finds it", path.display())
            });
            self.say(i, &line);
        }
        ended
    }

    /// Trains to the end and keeps the result, or the checkpoint if a signal arrives.
    fn train_and_finish(
        &self,
        i: usize,
        trainer: &mut Trainer,
        saver: &mut CheckpointSaver,
    ) -> Result<End, Report> {
        let job = self.open[i];
        let is_whole = self.train(i, trainer, saver)?;
        if !is_whole || !self.all.options.no_keep {
            saver.save(trainer)?;
        }
        if !is_whole {
            return Ok(End::Interrupted);
        }
        let map = job.world.map().filter(|_| job.plan.picture);
        let picture = map.map(|map| measure::picture(trainer, map)).transpose()?;
        let measured = measure(&job.plan, trainer, job.world.map())?;
        self.all.folder.finish(
            job,
            &job.result(trainer, measured),
            picture.as_deref(),
            !self.all.options.no_keep,
        )?;
        Ok(End::Done)
    }

    fn resume_or_begin(&self, i: usize) -> Result<Trainer, Report> {
        let job = self.open[i];
        let (own, length) = (self.all.folder.checkpoint(job), job.plan.length);
        let (amount, unit) = (grouped(length.amount()), length.unit());
        // Includes where it was saved if its own file could not be written; `max_by_key` prefers
        // its own, the last, among equals.
        let found = elsewhere(&own).into_iter().chain([own]).filter(|path| path.exists());
        if let Some(checkpoint) =
            found.max_by_key(|path| train::describe(path).map_or(0, |found| found.updates))
        {
            // It may be resumed another time.
            let help = "it is kept: run this again, or move it away to begin anew";
            let trainer = train::load(&checkpoint, self.all.registry, 1)
                .map_err(|error| miette!(help = help, "{error}"))?;
            if !job.is_run_of(&trainer) {
                return Err(miette!(help = help, "{}: is of another run", checkpoint.display()));
            }
            job.world.check(trainer.world())?;
            trainer.check_data().into_diagnostic()?;
            let done = grouped(length.done(&trainer.counters()));
            self.say(i, &format!("resumes after {done} of {amount} {unit}"));
            return Ok(trainer);
        }
        self.say(i, &format!("begins, {amount} {unit}"));
        let world = job.world.create(self.all.registry)?;
        job.world.check(&*world)?;
        let mut trainer = begin(job.run.clone(), &*world, self.all.registry, 1)?;
        if let Some(data) = &job.plan.data {
            let untold = gdg::job::Job::default();
            let warning = learn_from(&mut trainer, &data.file, &untold)?;
            if trainer.data().map(|read| read.checksum) != Some(data.checksum) {
                let file = sanitized(&data.file.to_string_lossy());
                let help = "run it again";
                return Err(miette!(help = help, "{file}: has changed since the experiment began"));
            }
            warning.iter().for_each(|warning| eprint_line(warning));
        }
        Ok(trainer)
    }

    /// Trains and evaluates to the end; returns whether it got there before a signal arrived.
    fn train(
        &self,
        i: usize,
        trainer: &mut Trainer,
        saver: &mut CheckpointSaver,
    ) -> Result<bool, Report> {
        let (evaluate, limits) = self.open[i].plan.schedule();
        let schedule =
            Schedule { evaluate, save_every: save_interval(None), ..Schedule::default() };
        let mut training_loop = TrainingLoop::resume(schedule, trainer);
        loop {
            match training_loop.next(trainer, &limits).into_diagnostic()? {
                TrainingEvent::Evaluation if !self.evaluate(i, trainer)? => return Ok(false),
                TrainingEvent::Save => {
                    let then = "training continues; saving will be tried again";
                    let failed = saver.save(trainer).err();
                    failed.into_iter().for_each(|error| print_error(&error.wrap_err(then)));
                }
                TrainingEvent::Recovery(recovery) => self.say(i, &recovery.to_string()),
                TrainingEvent::Ended(reason) => return Ok(reason != EndReason::Interrupted),
                _ => {}
            }
        }
    }

    fn evaluate(&self, i: usize, trainer: &mut Trainer) -> Result<bool, Report> {
        let plan = &self.open[i].plan;
        let (amount, unit) = (plan.length.amount(), plan.length.unit());
        let done = plan.length.done(&trainer.counters());
        let tasks = plan.tasks_after(done);
        let evaluated = evaluate(trainer, tasks, plan.max_steps, true, &self.termination)?;
        let Some(evaluation) = evaluated.transpose().into_diagnostic()? else {
            return Ok(false);
        };
        let updates = trainer.counters().updates;
        let rate = updates as f64 / trainer.seconds().max(1e-3);
        self.progress.advance(i, self.share_of(i, trainer));
        let (success, overall) = (evaluation.success(updates), self.progress.overall());
        let mut said = self.said.lock();
        if done >= amount || said.is_none_or(|at| at.elapsed() >= BETWEEN_LINES) {
            *said = Some(Instant::now());
            let share = 100.0 * self.share_of(i, trainer);
            let [done, amount] = [done, amount].map(grouped);
            self.say(
                i,
                &match terminal_width() {
                    Some(_) => format!("{share:.0} %, {success}{overall}"),
                    None => format!(
                        "{done} of {amount} {unit}, {success}, {rate:.0} updates/s{overall}"
                    ),
                },
            );
        }
        if !evaluation.is_finite() && done >= amount {
            let help = "try another seed, or a smaller learning_rate";
            return Err(miette!(help = help, "the distances are not finite"));
        }
        Ok(true)
    }
}

/// Returns the columns of the terminal that lines are printed to, if they are.
fn terminal_width() -> Option<usize> {
    console::Term::stderr().size_checked().map(|(_, columns)| columns.into())
}

/// Returns a line about a job, with as much of its name as fits: its checksum is left out first.
fn line(name: &str, text: &str, width: Option<usize>) -> String {
    let room = width.map(|width| width.saturating_sub(display_width(text) + 2).max(LEAST_NAME));
    let room = room.unwrap_or(usize::MAX);
    let label = name.rsplit_once('-').filter(|_| display_width(name) > room);
    format!("{}: {text}", fitted_file(label.map_or(name, |(label, _)| label), room))
}

struct JobsProgress {
    /// The share done of each job, and what of that earlier processes have done.
    shares: Mutex<Vec<[f64; 2]>>,
    began: Stopwatch,
}

impl JobsProgress {
    fn new(jobs: usize) -> Self {
        Self { shares: Mutex::new(vec![[0.0; 2]; jobs]), began: Stopwatch::start() }
    }

    /// Records the share of a job that earlier processes have done.
    fn begin(&self, job: usize, share: f64) {
        self.shares.lock()[job] = [share; 2];
    }

    /// Records the share of a job that is done; all of one that has failed or runs elsewhere.
    fn advance(&self, job: usize, share: f64) {
        self.shares.lock()[job][0] = share;
    }

    /// Returns how far all jobs are, for the end of a line.
    fn overall(&self) -> String {
        self.estimate(self.began.elapsed()).map_or(String::new(), |(share, seconds_left)| {
            format!("; all jobs {:.0} %, {} left", 100.0 * share, duration(seconds_left))
        })
    }

    /// Returns the share of all jobs that is done, and the seconds left, once anything is known.
    fn estimate(&self, elapsed: Duration) -> Option<(f64, f64)> {
        let shares = self.shares.lock();
        let sum = |i: usize| shares.iter().map(|shares| shares[i]).sum::<f64>();
        let (all, done, here) = (shares.len() as f64, sum(0), sum(0) - sum(1));
        (here > 0.0).then(|| (done / all, elapsed.as_secs_f64() * (all - done) / here))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_fit_the_terminal_if_there_is_one() {
        let of = |width| line("trap-hidden_32-seed1-19e239", "10 %, planned 0.50", width);
        let [whole, cut] = ["trap-hidden_32-seed1-19e239", "trap-h...-seed1"];
        assert_eq!(
            [None, Some(47)].map(of),
            [(); 2].map(|()| format!("{whole}: 10 %, planned 0.50"))
        );
        assert_eq!(of(Some(35)), format!("{cut}: 10 %, planned 0.50"));
    }

    #[test]
    fn the_time_left_follows_from_what_this_process_has_done() {
        let progress = JobsProgress::new(2);
        let estimate = || progress.estimate(Duration::from_secs(30));
        progress.begin(0, 0.5);
        assert_eq!(estimate(), None);
        progress.advance(0, 1.0);
        assert_eq!(estimate(), Some((0.5, 60.0)), "half a job in 30 s, and one is left");
        progress.advance(1, 1.0);
        assert_eq!(estimate(), Some((1.0, 0.0)));
    }
}
