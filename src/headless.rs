//! Training without the interface: JSON lines on standard output, a progress bar on standard error.

pub mod metrics;
mod progress;
pub mod records;

use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use miette::{IntoDiagnostic, Report, miette};
use serde_json::{Map, Value, json};

use crate::process::errors::{from_checkpoint_error, print_error};
use crate::process::signals::TerminationSignal;
use crate::process::{EXIT_BAD_INPUT, EXIT_NOT_REACHED, logging};
use crate::setup::Setup;
use crate::setup::outputs::to_elsewhere;
use crate::setup::saves::resume_command;
use crate::setup::values::{counts, output, reals, shares};
use gdg::env::{EnvError, Recorded, gym};
use gdg::files;
use gdg::job::{Job, Running};
use gdg::printing;
use gdg::printing::eprint_line;
use gdg::text::{counted, escape_json_line, grouped, sanitized};
use gdg::train::{
    self, EndReason, EvaluateAt, Evaluation, Moment, Recovery, SaveTo, Schedule, Trainer,
    TrainingEvent, TrainingLoop,
};
use metrics::MetricsFile;
use progress::RunProgress;
use records::Record;

/// Updates between progress records, about a second's worth. Counted in updates so that the same
/// run prints the same records.
pub const PROGRESS_EVERY_UPDATES: u64 = 1_000;

/// Time between looks for a signal while another thread works.
const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Whether records could not be written.
static LOST: AtomicBool = AtomicBool::new(false);

/// Evaluation tasks at each distance unless another number is given.
pub const EVAL_TASKS: u32 = 30;

/// Options of a run without the interface, besides what to train.
#[derive(Clone, Debug, Args)]
pub struct HeadlessOptions {
    /// Minutes between checkpoints during training; 0 for none [default: 5 with --save; interface:
    /// see autosave_minutes]
    #[arg(long, value_name = "MINUTES", value_parser = reals(0.0..=1e6, "a number of minutes, 0 for none"), requires = "no_ui")]
    pub save_every: Option<f64>,

    /// Evaluate every N updates [default: a tenth of all, at least 5,000; environments in Python: at the end]
    #[arg(long, value_name = "N", value_parser = counts::<u64>(1..=u64::MAX))]
    pub eval_every_updates: Option<u64>,

    /// Evaluation tasks at each of six distances (five in fetch-reach) [default: 30, or as last evaluated]
    #[arg(long, value_name = "N", value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: Option<u32>,

    /// Also write losses and evaluations, from the beginning of the run, to this file as CSV
    #[arg(long, value_name = "FILE", requires = "no_ui", value_parser = output())]
    pub csv: Option<PathBuf>,

    /// Replace existing files: tables and, with --save, checkpoints of other runs
    #[arg(long)]
    pub overwrite: bool,

    /// Exit with status 3 unless the final evaluation's success rate is at least X
    #[arg(long, value_name = "X", value_parser = shares())]
    pub require_success: Option<f64>,
}

impl HeadlessOptions {
    fn tasks(&self) -> usize {
        self.eval_tasks.unwrap_or(EVAL_TASKS) as usize
    }
}

pub fn run(mut setup: Setup, options: &HeadlessOptions) -> Result<u8, Report> {
    let last = setup.trainer.history().evaluations().last();
    let before = last.and_then(|(_, last)| last.alone.tasks_per_distance());
    let options = &HeadlessOptions { eval_tasks: options.eval_tasks.or(before), ..options.clone() };
    let termination = TerminationSignal::listen()?;
    setup.trainer.set_job(termination.job.clone());
    let saver = setup.save.clone().map(CheckpointSaver::new);
    let open = |path| MetricsFile::open(path, options.overwrite, &setup);
    let table = match options.csv.as_deref().map(open).transpose() {
        Ok(table) => table,
        Err(error) => {
            print_error(&error);
            return Ok(EXIT_BAD_INPUT);
        }
    };
    files::mark_output_in_use();
    let begun_at = setup.trainer.counters().updates;
    let progress = RunProgress::new(&setup.limits, setup.trainer.seconds());
    let mut run = HeadlessRun { setup, options, progress, saver, table, termination, begun_at };
    let ended = run.run();
    // Saves what was learned, even after an error.
    let saved = run.save();
    run.report_saved(ended.as_ref().ok().map(|(reason, _)| *reason));
    let (reason, evaluation) = ended.map_err(|error| run.explained(error))?;
    saved?;
    if let Some(failure) = gdg::faults::take_failures().first() {
        return Err(miette!(help = logging::hint(), "{failure}"));
    }
    print(&Record::end(reason, &run.setup.trainer))?;
    printed(printing::stdout().flush())?;
    run.progress.finish();
    if let (EndReason::Interrupted, Some(status)) = (reason, run.termination.status()) {
        return Ok(status);
    }
    if LOST.load(Ordering::Relaxed) {
        return Err(miette!("standard output: it lacks records, which could not be written"));
    }
    let (Some(required), Some(found)) = (options.require_success, evaluation) else {
        return Ok(0);
    };
    // Without a rate, a warning has been printed.
    let Some(rate) = found.success_rate() else { return Ok(EXIT_NOT_REACHED) };
    if rate >= required {
        return Ok(0);
    }
    eprint_line(&format!("success rate {rate:.3} is below the required {required}"));
    Ok(EXIT_NOT_REACHED)
}

fn print(record: &Record) -> Result<(), Report> {
    let line = escape_json_line(&serde_json::to_string(record).into_diagnostic()?);
    printed(printing::stdout().print(format!("{line}\n").as_bytes()))
}

/// Returns an error if nothing reads the records any more. Where they cannot be written, as on a full
/// disk, says so once, and training goes on.
fn printed(written: std::io::Result<()>) -> Result<(), Report> {
    let Err(error) = written else { return Ok(()) };
    if error.kind() == ErrorKind::BrokenPipe {
        let help = "redirect the records to a file, or let their reader go on to the end";
        return Err(miette!(help = help, "training ended: nothing reads standard output any more"));
    }
    if !LOST.swap(true, Ordering::Relaxed) {
        eprint_line(&format!("standard output: {error}; training goes on"));
    }
    Ok(())
}

fn report_recovery(recovery: Recovery) -> Result<(), Report> {
    eprint_line(&recovery.to_string());
    print(&Record::Recovery(recovery))
}

fn warn(trainer: &Trainer, text: &str) -> Result<(), Report> {
    eprint_line(&format!("warning: {text}"));
    let Moment { updates, env_steps, .. } = trainer.moment();
    print(&Record::Warning(json!({ "updates": updates, "env_steps": env_steps, "text": text })))
}

struct HeadlessRun<'a> {
    setup: Setup,
    options: &'a HeadlessOptions,
    progress: RunProgress,
    saver: Option<CheckpointSaver>,
    table: Option<MetricsFile>,
    termination: TerminationSignal,
    /// The updates that it had before.
    begun_at: u64,
}

impl HeadlessRun<'_> {
    /// Trains, saves and evaluates at the end. A panic becomes an error, and saving is still tried.
    fn run(&mut self) -> Result<(EndReason, Option<Evaluation>), Report> {
        let run = |run: &mut Self| {
            let interrupted = (EndReason::Interrupted, None);
            let Some(facts) = run.facts()? else { return Ok(interrupted) };
            print(&Record::start(&run.setup, run.options, facts))?;
            run.setup.warnings.iter().try_for_each(|text| warn(&run.setup.trainer, text))?;
            let reason = run.train()?;
            if reason == EndReason::Interrupted {
                return Ok(interrupted);
            }
            // Save first: the evaluation may take long and be interrupted.
            run.save_periodically();
            let Some(evaluation) = run.evaluate()? else { return Ok(interrupted) };
            Ok((reason, Some(evaluation.into_diagnostic()?)))
        };
        catch_unwind(AssertUnwindSafe(|| run(self))).unwrap_or_else(|_| {
            let mended = self.setup.trainer.repair_after_panic().is_ok();
            let then = if mended { "with --save, the run is saved" } else { "saving may fail" };
            Err(miette!(help = logging::hint(), "an internal error ended training; {then}"))
        })
    }

    /// Returns facts about the world, which may take long; `None` if a signal arrives first.
    fn facts(&self) -> Result<Option<Map<String, Value>>, Report> {
        let world = self.setup.trainer.world().fork(0).into_diagnostic()?;
        let facts = move |_: &_| world.abilities().recorded.map_or_else(Map::new, Recorded::facts);
        run_interruptibly("facts", &self.termination, facts)
    }

    fn train(&mut self) -> Result<EndReason, Report> {
        // In a simulator, an evaluation may take longer than the training before it.
        let is_slow = self.setup.trainer.world().kind() == gym::KIND.name;
        let usual = self.setup.limits.updates.unwrap_or(0).max(50_000) / 10;
        let evaluate = self.options.eval_every_updates.or((!is_slow).then_some(usual));
        let schedule = Schedule {
            progress_every_updates: Some(PROGRESS_EVERY_UPDATES),
            evaluate: evaluate.map_or(EvaluateAt::Never, EvaluateAt::EveryUpdates),
            save_every: save_interval(self.options.save_every).filter(|_| self.saver.is_some()),
        };
        let mut training_loop = TrainingLoop::resume(schedule, &self.setup.trainer);
        self.report_limits();
        loop {
            let Setup { trainer, limits, .. } = &mut self.setup;
            match training_loop.next(trainer, limits).into_diagnostic()? {
                TrainingEvent::Ticked(_) => self.progress.show(trainer),
                TrainingEvent::Ended(reason) => return Ok(reason),
                TrainingEvent::Recovery(recovery) => report_recovery(recovery)?,
                TrainingEvent::Warned => {
                    trainer.take_warnings().iter().try_for_each(|text| warn(trainer, text))?;
                }
                TrainingEvent::Progress => {
                    print(&Record::progress(trainer, self.progress.seconds_left(trainer)))?;
                    self.table.iter_mut().for_each(|table| table.write(trainer, false));
                }
                TrainingEvent::Edit => {
                    let made = trainer.make_edit().into_diagnostic()?;
                    made.map_or(Ok(()), |change| print(&Record::edit(trainer, change)))?;
                }
                // An evaluation at the end follows anyway.
                TrainingEvent::Evaluation if trainer.limit_reached(limits).is_some() => {}
                TrainingEvent::Evaluation => match self.evaluate()? {
                    Some(Ok(_)) => {}
                    // The world has prevented it; training goes on.
                    Some(Err(error)) => {
                        log::warn!("{error}");
                        let at = grouped(self.setup.trainer.counters().updates);
                        let then = format!(
                            "training continues without the evaluation at update {at}, which failed \
                             twice"
                        );
                        print_error(&Report::msg(error).wrap_err(then));
                    }
                    None => return Ok(EndReason::Interrupted),
                },
                TrainingEvent::Save => self.save_periodically(),
            }
        }
    }

    /// Reports that a resumed run has nothing left to train, or that it is not saved, if so.
    fn report_limits(&self) {
        let counters = self.setup.trainer.counters();
        let (done, what) = match self.setup.trainer.limit_reached(&self.setup.limits) {
            Some(EndReason::MaxUpdates) => (grouped(counters.updates), "updates"),
            Some(EndReason::MaxEpisodes) => (grouped(counters.episodes), "episodes"),
            _ if self.setup.resumed.is_some() && self.saver.is_none() => {
                return eprint_line("not saved: give --save FILE, which may be the file resumed");
            }
            _ => return,
        };
        let so = format!("the run has {done} {what} already, and --max-{what} counts all");
        eprint_line(&format!("nothing to train: {so}"));
    }

    /// Saves in the middle of a run: a failure is only reported, as the next save may succeed.
    fn save_periodically(&mut self) {
        if let Err(error) = self.save() {
            log::warn!("{error}");
            print_error(&error.wrap_err("training continues; saving will be tried again"));
        }
    }

    fn save(&mut self) -> Result<(), Report> {
        let trainer = &mut self.setup.trainer;
        self.table.iter_mut().for_each(|table| table.write(trainer, true));
        let Some(saver) = &mut self.saver else { return Ok(()) };
        let saved = saver.save(trainer);
        trainer.take_recovery().map_or(Ok(()), report_recovery)?;
        saved?.map_or(Ok(()), |path| print(&Record::saved(trainer, &path)))
    }

    /// Says how an interrupted run goes on, or what is lost without `--save`, unless that seems
    /// intended: a new run that reached its limit.
    fn report_saved(&self, reason: Option<EndReason>) {
        let is_complete = reason.is_some_and(|reason| reason != EndReason::Interrupted);
        let unsaved = self.setup.trainer.counters().updates.saturating_sub(self.begun_at);
        if self.saver.is_none() && unsaved > 0 && !(is_complete && self.setup.resumed.is_none()) {
            let lost = counted(unsaved, "update");
            eprint_line(&format!("not saved: {lost}; give --save FILE to keep them"));
        } else if let (Some(EndReason::Interrupted), Some(how)) = (reason, self.how_to_go_on()) {
            eprint_line(&how);
        }
    }

    /// Adds to an error where the run is saved, unless the error itself says what to do.
    fn explained(&self, error: Report) -> Report {
        let how = self.how_to_go_on().filter(|_| error.help().is_none());
        let Some(help) = how else { return error };
        let causes: Vec<String> = error.chain().map(ToString::to_string).collect();
        miette!(help = help, "{}", causes.join(": "))
    }

    /// Returns where the run is saved, if it is, and the command that goes on.
    fn how_to_go_on(&self) -> Option<String> {
        let saver = self.saver.as_ref().filter(|saver| saver.has_saved(&self.setup.trainer))?;
        let options = &self.setup.trainer.registry().options;
        let (file, resume) = (saver.path().display(), resume_command(saver.path(), options));
        Some(format!("the run is saved to {file}: {resume} goes on"))
    }

    /// Evaluates and prints the result, or returns why the world fails; `None` if a signal arrives.
    fn evaluate(&mut self) -> Result<Option<Result<Evaluation, EnvError>>, Report> {
        let (trainer, tasks) = (&mut self.setup.trainer, self.options.tasks());
        let is_new = trainer.counters().updates > self.begun_at;
        let evaluated = evaluate(trainer, tasks, None, is_new, &self.termination)?;
        let Some(Ok(evaluation)) = evaluated else { return Ok(evaluated) };
        if evaluation.success_rate().is_none() {
            eprint_line("the evaluation has no tasks, so there is no success rate");
        }
        print(&Record::evaluation(&self.setup.trainer, &evaluation))?;
        self.table.iter_mut().for_each(|table| table.write(&self.setup.trainer, true));
        Ok(Some(Ok(evaluation)))
    }
}

/// Evaluates `trainer` on `per_group` tasks at each distance, each within its own budget or
/// `max_steps`, and adds a finite result to its history; one that is not new only if it is another
/// than the latest. Runs on another thread so that signals are handled at once; returns `None` if one
/// arrives, and the error if the world fails.
pub fn evaluate(
    trainer: &mut Trainer,
    per_group: usize,
    max_steps: Option<u32>,
    is_new: bool,
    termination: &TerminationSignal,
) -> Result<Option<Result<Evaluation, EnvError>>, Report> {
    let evaluation = trainer.evaluation().into_diagnostic()?.within(max_steps);
    let work = move |job: &Job| evaluation.evaluate(per_group, job);
    let evaluated = run_interruptibly("evaluation", termination, work)?;
    let evaluated = evaluated.filter(|done| !matches!(done, Err(EnvError::Stopped)));
    if let Some(Ok(evaluation)) = &evaluated
        && evaluation.is_finite()
    {
        let made = trainer.moment();
        let latest = trainer.history().evaluations().last();
        if is_new || latest.is_none_or(|(at, latest)| (*at, latest) != (made.updates, evaluation)) {
            trainer.record_evaluation(made, evaluation.clone());
        }
    }
    Ok(evaluated)
}

/// Runs `work` on a thread called `name`. Returns `None` if a signal arrives first; the thread then
/// ends with the program.
fn run_interruptibly<T: Send + 'static>(
    name: &'static str,
    termination: &TerminationSignal,
    work: impl FnOnce(&Job) -> T + Send + 'static,
) -> Result<Option<T>, Report> {
    let running = Running::start(name, Job::new(name), work);
    while !running.wait(SIGNAL_INTERVAL) {
        if termination.number().is_some() {
            return Ok(None);
        }
    }
    let failed = |_| miette!(help = logging::hint(), "an internal error ended the {name} thread");
    running.join().map(Some).map_err(failed)
}

fn updates_per_second(trainer: &Trainer) -> f64 {
    let seconds = trainer.seconds();
    if seconds > 0.0 { trainer.counters().updates as f64 / seconds } else { 0.0 }
}

/// Returns the time between checkpoints, by default 5 minutes; `None` for 0: only at the end.
pub fn save_interval(minutes: Option<f64>) -> Option<Duration> {
    let minutes = minutes.unwrap_or(5.0);
    (minutes > 0.0).then(|| Duration::from_secs_f64(60.0 * minutes))
}

pub struct CheckpointSaver {
    to: SaveTo,
    /// Where the run is saved as long as it cannot be saved there.
    pub instead: Option<PathBuf>,
    /// The state saved last: updates, steps and evaluations.
    last_saved_state: Option<(u64, u64, usize)>,
}

impl CheckpointSaver {
    pub fn new(to: SaveTo) -> Self {
        Self { to, instead: None, last_saved_state: None }
    }

    pub fn path(&self) -> &Path {
        self.to.path()
    }

    /// Saves unless this state is already saved; returns the path it took. Rolls a diverged run
    /// back first. What cannot be saved to its path is saved elsewhere, and still an error.
    pub fn save(&mut self, trainer: &mut Trainer) -> Result<Option<PathBuf>, Report> {
        if self.has_saved(trainer) {
            return Ok(None);
        }
        if let Err(error) = trainer.ensure_finite() {
            // The networks are good even then, and can be saved; the next update fails again.
            eprint_line(&error.to_string());
        }
        let instead = self.instead.take();
        let others =
            instead.clone().map(SaveTo::Replace).into_iter().chain(to_elsewhere(self.path()));
        let (path, why) =
            train::save_or_else(trainer, &self.to, others).map_err(from_checkpoint_error)?;
        if let Some(error) = why {
            let path = self.instead.insert(path);
            return Err(miette!("{error}; saved to {} instead", path.display()));
        }
        instead.iter().for_each(|path| train::remove_own(path));
        trainer.take_warnings().iter().for_each(|own| eprint_line(&format!("warning: {own}")));
        let requested = self.to.path();
        if path != requested {
            let is_new = matches!(self.to, SaveTo::CreateNew(_));
            let may_replace = is_new && train::is_checkpoint(requested);
            let help = if may_replace { " (--overwrite replaces it)" } else { "" };
            let [was, now] = [requested, &path].map(|path| sanitized(&path.to_string_lossy()));
            eprint_line(&format!("{was} {}{help}: saving to {now}", self.to.obstacle()));
        }
        self.to = SaveTo::Replace(path.clone());
        self.last_saved_state = Some(state(trainer));
        Ok(Some(path))
    }

    pub fn has_saved(&self, trainer: &Trainer) -> bool {
        self.last_saved_state == Some(state(trainer))
    }
}

/// Returns what identifies a state of `trainer`: its updates, environment steps and evaluations.
fn state(trainer: &Trainer) -> (u64, u64, usize) {
    let counters = trainer.counters();
    (counters.updates, counters.env_steps, trainer.history().evaluations().len())
}
