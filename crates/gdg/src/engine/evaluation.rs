//! Evaluations, which run beside training on a thread of their own.

use std::time::{Duration, Instant};

use super::Worker;
use super::snapshot::NextEvaluation;
use crate::env::EnvError;
use crate::job::{Job, Running};
use crate::train::{Evaluation, Moment, TrainError};

const EVALUATION_TASKS: usize = 10;

/// The pause after an evaluation, as a multiple of its duration: evaluations run beside training,
/// but on the same cores.
pub const EVALUATION_PAUSE_FACTOR: u32 = 15;

/// Results are replaced before they are older than this ...
const MAX_AGE: Duration = Duration::from_secs(10);

/// ... or than this many updates, whichever is later; but the pause after an evaluation is at least
/// as long as the evaluation.
const MAX_AGE_UPDATES: f64 = 1_500.0;

pub struct RunningEvaluation {
    made: Moment,
    running: Running<Result<Option<Evaluation>, EnvError>>,
}

impl Worker {
    /// Starts an evaluation of the current networks unless one is running; returns whether it did.
    pub(super) fn start_evaluation(&mut self) -> Result<bool, TrainError> {
        if self.evaluation.is_some() {
            return Ok(false);
        }
        let (evaluation, job) = (self.trainer.evaluation()?, Job::new("evaluating"));
        self.current.evaluation_progress = job.clone();
        self.current.next_evaluation = NextEvaluation::Running(job.since());
        let work = move |job: &Job| evaluation.evaluate(EVALUATION_TASKS, job);
        let running = Running::start("evaluation", job, work);
        self.evaluation = Some(RunningEvaluation { made: self.trainer.moment(), running });
        self.evaluation_is_due = false;
        Ok(true)
    }

    pub(super) fn start_due_evaluation(&mut self) -> Result<(), TrainError> {
        let is_time = self.next_evaluation_at.is_none_or(|at| Instant::now() >= at);
        if self.evaluation_is_due && is_time {
            self.start_evaluation()?;
        }
        Ok(())
    }

    pub(super) fn next_evaluation(&self) -> NextEvaluation {
        if let Some(running) = &self.evaluation {
            return NextEvaluation::Running(running.running.job().since());
        }
        let rest = self
            .next_evaluation_at
            .map_or(Duration::ZERO, |at| at.saturating_duration_since(Instant::now()));
        if rest.is_zero() {
            NextEvaluation::after(&self.trainer)
        } else {
            NextEvaluation::InSeconds(rest.as_secs_f64().ceil() as u64)
        }
    }

    pub(super) fn collect_evaluation(&mut self) {
        let Some(RunningEvaluation { made, running }) =
            self.evaluation.take_if(|e| e.running.is_finished())
        else {
            return;
        };
        let updates = made.updates;
        let now = Instant::now();
        let pause =
            pause_after(now - running.job().since(), self.evaluation_pause, self.current.rates.0);
        self.next_evaluation_at = Some(now + pause);
        match running.join() {
            Ok(Ok(None)) => {}
            Ok(Ok(Some(evaluation))) if evaluation.is_finite() => {
                self.trainer.record_evaluation(made, evaluation);
                self.current.evaluations = self.trainer.history().evaluations().clone();
            }
            Ok(Ok(_)) => self
                .report(format!("the evaluation at update {updates} returned non-finite values")),
            Ok(Err(error)) => self.report(format!("the evaluation at update {updates}: {error}")),
            Err(_) => self.report("an evaluation failed with an internal error".to_owned()),
        }
        self.current.next_evaluation = self.next_evaluation();
        self.publish();
    }
}

/// Returns the pause after an evaluation that took `duration`: `factor` times as long, but so short
/// that the next one, if it takes as long, ends before the result is too old at `rate` updates per
/// second.
fn pause_after(duration: Duration, factor: u32, rate: f64) -> Duration {
    let age = Duration::try_from_secs_f64(MAX_AGE_UPDATES / rate).unwrap_or(MAX_AGE).max(MAX_AGE);
    (factor * duration).min(age.saturating_sub(2 * duration).max(duration))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_replaced_before_they_are_old_unless_that_takes_most_of_the_time() {
        let pause = |seconds: f64, factor, rate| {
            pause_after(Duration::from_secs_f64(seconds), factor, rate).as_secs_f64()
        };
        assert_eq!([0.2, 1.0, 4.0].map(|seconds| pause(seconds, 15, 200.0)), [3.0, 8.0, 4.0]);
        assert_eq!(pause(1.0, 2, 200.0), 2.0, "the user wants them sooner");
        assert_eq!(pause(4.0, 15, 50.0), 22.0, "1,500 updates take 30 seconds");
        assert_eq!(pause(4.0, 15, 0.0), 4.0, "nothing is known of the speed");
    }
}
