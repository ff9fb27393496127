//! Training without the interface: JSON lines on standard output, a progress bar on standard error.

mod progress;
mod records;

use std::io::Write;
use std::sync::atomic::{AtomicUsize, Ordering};

use miette::{IntoDiagnostic, Report, WrapErr};

use crate::cli::TrainArgs;
use crate::map::Diameter;
use crate::setup::{Setup, ending_signals};
use crate::train::{self, EndReason, Evaluation, Success, TaskSet, Tick, Trainer};
use progress::Progress;
use records::Record;

/// Updates between progress records: about a second's worth. Counted in updates, so that the same run prints the
/// same records.
const PROGRESS_EVERY_UPDATES: u64 = 1_000;

/// Exit status when `--require-success` is not reached.
const NOT_REACHED: u8 = 3;

/// Runs to its end; the exit status.
///
/// # Errors
/// What goes wrong while running: training, writing records, saving.
pub fn run(setup: Setup, args: &TrainArgs) -> Result<u8, Report> {
    let signal = ending_signals()?;
    let diameter = Diameter::of(setup.trainer.map());
    let mut session = Session { setup, diameter, args, progress: Progress::new(args), success: None };
    print(&Record::start(&session.setup, diameter))?;
    let trained = session.train(&signal);
    let result = trained.and_then(|reason| session.finish(reason));
    // Whatever happened, what was learned is kept.
    let saved = args.save.as_deref().map(|path| train::save(&session.setup.trainer, path, session.success)).transpose();
    let (reason, evaluation) = result?;
    saved?;
    print(&Record::end(reason, &session.setup.trainer))?;
    session.progress.finish();
    let number = signal.load(Ordering::Relaxed);
    if reason == EndReason::Interrupted {
        return Ok(128 + number as u8);
    }
    match (args.require_success, evaluation) {
        (Some(required), Some(found)) if success(&found) < required => {
            eprintln!("success {:.3} does not reach the {required} required", success(&found));
            Ok(NOT_REACHED)
        }
        _ => Ok(0),
    }
}

/// Writes one line to standard output.
fn print(record: &Record) -> Result<(), Report> {
    let line = serde_json::to_string(record).into_diagnostic()?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush()).into_diagnostic().wrap_err("standard output")
}

/// Success by the method's own way of acting.
fn success(evaluation: &Evaluation) -> f64 {
    evaluation.planned.as_ref().unwrap_or(&evaluation.greedy).success
}

struct Session<'a> {
    setup: Setup,
    /// The map's farthest distance.
    diameter: Diameter,
    args: &'a TrainArgs,
    progress: Progress,
    /// The latest evaluation in brief.
    success: Option<Success>,
}

impl Session<'_> {
    /// Trains until a limit or a signal ends it.
    fn train(&mut self, signal: &AtomicUsize) -> Result<EndReason, Report> {
        // What is to be changed at the update that the run begins with comes before its first step.
        self.edit(self.setup.trainer.counters().updates)?;
        loop {
            if signal.load(Ordering::Relaxed) != 0 {
                return Ok(EndReason::Interrupted);
            }
            if let Some(reason) = self.limit_reached() {
                return Ok(reason);
            }
            if self.setup.trainer.tick().into_diagnostic()? != Tick::Update {
                continue;
            }
            let updates = self.setup.trainer.counters().updates;
            if updates.is_multiple_of(PROGRESS_EVERY_UPDATES) {
                print(&Record::progress(&self.setup.trainer))?;
                self.progress.show(&self.setup.trainer);
            }
            self.edit(updates)?;
            let due = self.args.eval_every_updates.is_some_and(|every| updates.is_multiple_of(every));
            if due && self.limit_reached().is_none() {
                self.evaluate()?;
            }
        }
    }

    /// Changes the map where that is asked for after `updates`.
    fn edit(&mut self, updates: u64) -> Result<(), Report> {
        let Setup { trainer, edits, .. } = &mut self.setup;
        for (_, map) in edits.iter().filter(|(at, _)| *at == updates) {
            let change = trainer.change_map(map.clone()).map_err(Report::msg)?;
            self.diameter = Diameter::of(map);
            print(&Record::edit(trainer, change))?;
        }
        Ok(())
    }

    fn limit_reached(&self) -> Option<EndReason> {
        self.setup.trainer.limit_reached(&self.args.limits())
    }

    fn evaluate(&mut self) -> Result<Evaluation, Report> {
        let Setup { trainer, scenario, .. } = &mut self.setup;
        let tasks = match scenario {
            Some(scenario) => TaskSet::from_scenario(trainer.map(), scenario, 6 * self.args.eval_tasks as usize),
            None => trainer.tasks(self.diameter.steps, self.args.eval_tasks as usize),
        };
        let evaluation = trainer.evaluate(&tasks).into_diagnostic()?;
        self.success = Some(evaluation.success(trainer.counters().updates));
        print(&Record::evaluation(&self.setup.trainer, &evaluation))?;
        Ok(evaluation)
    }

    /// The final evaluation, skipped where the run was interrupted.
    fn finish(&mut self, reason: EndReason) -> Result<(EndReason, Option<Evaluation>), Report> {
        if reason == EndReason::Interrupted {
            return Ok((reason, None));
        }
        Ok((reason, Some(self.evaluate()?)))
    }
}

/// Rate of updates over the whole training.
fn updates_per_second(trainer: &Trainer) -> f64 {
    if trainer.seconds() > 0.0 { trainer.counters().updates as f64 / trainer.seconds() } else { 0.0 }
}
