//! Evaluations, which run beside training on a thread of their own.

use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::snapshot::{NextEvaluation, next_multiple};
use super::{EVALUATE_EVERY_UPDATES, Worker};
use crate::train::{Evaluation, TrainError};

/// Tasks at each distance.
const EVALUATION_TASKS: usize = 10;

/// The pause after an evaluation, as a multiple of its duration: evaluations run beside training,
/// but on the same cores.
pub const EVALUATION_PAUSE_FACTOR: u32 = 15;

/// While most walks fail, an evaluation takes long, and so would the pause: beyond this, it is as
/// short as [`LEAST_PAUSE_FACTOR`] allows.
const LONG_EVALUATION_PAUSE: Duration = Duration::from_secs(20);
const LEAST_PAUSE_FACTOR: u32 = 3;

/// An evaluation running on its own thread.
pub struct RunningEvaluation {
    updates: u64,
    began: Instant,
    result: JoinHandle<Evaluation>,
}

impl Worker {
    /// Starts an evaluation of the current networks unless one is running; returns whether it did.
    pub(super) fn start_evaluation(&mut self) -> Result<bool, TrainError> {
        if self.evaluation.is_some() {
            return Ok(false);
        }
        let job = self.trainer.evaluation()?;
        let began = Instant::now();
        let result =
            std::thread::Builder::new().name("evaluation".to_owned()).spawn(move || {
                let tasks = job.tasks(EVALUATION_TASKS);
                job.run(&tasks)
            })?;
        self.evaluation =
            Some(RunningEvaluation { updates: self.trainer.counters().updates, began, result });
        self.current.next_evaluation = NextEvaluation::Running;
        Ok(true)
    }

    /// Returns when the next evaluation comes.
    pub(super) fn next_evaluation(&self) -> NextEvaluation {
        if self.evaluation.is_some() {
            return NextEvaluation::Running;
        }
        let rest = self
            .next_evaluation_at
            .map_or(Duration::ZERO, |at| at.saturating_duration_since(Instant::now()));
        if rest.is_zero() {
            NextEvaluation::AtUpdate(next_multiple(
                self.trainer.counters().updates,
                EVALUATE_EVERY_UPDATES,
            ))
        } else {
            NextEvaluation::InSeconds(rest.as_secs_f64().ceil() as u64)
        }
    }

    /// Collects the evaluation if it has finished.
    pub(super) fn collect_evaluation(&mut self) {
        let Some(RunningEvaluation { updates, began, result }) =
            self.evaluation.take_if(|e| e.result.is_finished())
        else {
            return;
        };
        let now = Instant::now();
        self.next_evaluation_at = Some(now + pause_after(now - began, self.evaluation_pause));
        match result.join() {
            Ok(evaluation) if evaluation.is_finite() => {
                self.trainer.record_evaluation(updates, evaluation);
                self.current.evaluations = self.trainer.history().evaluations().clone();
            }
            Ok(_) => self
                .report(format!("the evaluation at update {updates} returned non-finite values")),
            Err(_) => self.report("an evaluation failed with an internal error".to_owned()),
        }
        self.current.next_evaluation = self.next_evaluation();
        self.publish();
    }
}

/// Returns the pause after an evaluation that took `duration`, `factor` times as long unless that
/// is very long.
fn pause_after(duration: Duration, factor: u32) -> Duration {
    (factor * duration).min(LONG_EVALUATION_PAUSE.max(factor.min(LEAST_PAUSE_FACTOR) * duration))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_evaluations_are_followed_by_shorter_pauses() {
        let pause = |seconds, factor| pause_after(Duration::from_secs(seconds), factor).as_secs();
        assert_eq!([1, 4, 10].map(|seconds| pause(seconds, 15)), [15, 20, 30]);
        assert_eq!([1, 10, 60].map(|seconds| pause(seconds, 2)), [2, 20, 120]);
    }
}
