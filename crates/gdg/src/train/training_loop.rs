//! The training loop of all front ends: ticks, and what is due between them.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::run::{EndReason, Limits, Tick};
use super::trainer::{Recovery, Trainer};
use super::{Result, TrainError};
use crate::env::EnvError;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum EvaluateAt {
    #[default]
    Never,
    /// After each multiple of this number of updates.
    EveryUpdates(u64),
    /// After these numbers of updates, ascending.
    Updates(Vec<u64>),
    /// Once for each of these numbers of episodes, ascending. Several may be passed by one step.
    Episodes(Vec<u64>),
    /// Once for each of these numbers of environment steps, ascending, after the updates due then.
    EnvSteps(Vec<u64>),
}

#[derive(Clone, Debug, Default)]
pub struct Schedule {
    pub progress_every_updates: Option<u64>,
    pub evaluate: EvaluateAt,
    pub save_every: Option<Duration>,
}

/// What has happened in training or is due, as front ends get it, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrainingEvent {
    /// Training was rolled back to earlier networks.
    Recovery(Recovery),
    /// The trainer has warnings for the user.
    Warned,
    Progress,
    /// The next of the trainer's edits is to be made.
    Edit,
    /// The run is to be evaluated, also if it has reached its limit.
    Evaluation,
    Save,
    /// A tick has been run, and nothing more is due after it.
    Ticked(Tick),
    Ended(EndReason),
}

/// The first save is due this soon, so that others can watch the run.
pub const FIRST_SAVE: Duration = Duration::from_secs(15);

/// Runs a trainer tick by tick, and tells a front end what is due in between.
#[derive(Debug)]
pub struct TrainingLoop {
    schedule: Schedule,
    due: VecDeque<TrainingEvent>,
    /// Evaluations that have been due so far; one that is not finite leaves no trace in the
    /// history.
    evaluations: usize,
    saved_at: Instant,
}

impl TrainingLoop {
    pub fn new(schedule: Schedule) -> Self {
        let (now, every) = (Instant::now(), schedule.save_every.unwrap_or_default());
        let saved_at = now.checked_sub(every.saturating_sub(FIRST_SAVE)).unwrap_or(now);
        Self { schedule, due: VecDeque::new(), evaluations: 0, saved_at }
    }

    /// Like [`Self::new`], for a run that may have been stopped between a tick and what was due
    /// after it: the edits at its present update, and an evaluation that has not been made.
    pub fn resume(schedule: Schedule, trainer: &Trainer) -> Self {
        let made = trainer.history().evaluations();
        let mut training_loop = Self { evaluations: made.len(), ..Self::new(schedule) };
        let updates = trainer.counters().updates;
        let is_evaluated = made.last().is_some_and(|(at, _)| *at == updates);
        training_loop.add_edits(trainer);
        training_loop.add_evaluations(trainer, updates > 0 && !is_evaluated);
        training_loop
    }

    /// Returns what is still due, or else runs one tick, unless training is to stop or has reached
    /// one of `limits`.
    pub fn next(&mut self, trainer: &mut Trainer, limits: &Limits) -> Result<TrainingEvent> {
        if let Some(due) = self.due.pop_front() {
            return Ok(due);
        }
        if trainer.job().is_cancelled() {
            return Ok(TrainingEvent::Ended(EndReason::Interrupted));
        }
        if let Some(reason) = trainer.limit_reached(limits) {
            return Ok(TrainingEvent::Ended(reason));
        }
        crate::faults::point("trainer");
        let tick = match trainer.tick() {
            Err(TrainError::Env(EnvError::Stopped)) => {
                return Ok(TrainingEvent::Ended(EndReason::Interrupted));
            }
            ticked => ticked?,
        };
        self.due.extend(trainer.take_recovery().map(TrainingEvent::Recovery));
        self.due.extend(trainer.look_for_warnings().then_some(TrainingEvent::Warned));
        let updates = (tick == Tick::Update).then(|| trainer.counters().updates);
        if let Some(updates) = updates {
            let progress = self.schedule.progress_every_updates;
            if progress.is_some_and(|every| updates.is_multiple_of(every)) {
                self.due.push_back(TrainingEvent::Progress);
            }
            self.add_edits(trainer);
        }
        self.add_evaluations(trainer, updates.is_some());
        // It waits while a run diverges: a rollback before saving would make the run depend on when
        // it is saved, and its next updates roll back anyway.
        let is_time = |every| self.saved_at.elapsed() >= every;
        if updates.is_some()
            && self.schedule.save_every.is_some_and(is_time)
            && trainer.is_finite()?
        {
            self.due.push_back(TrainingEvent::Save);
            self.saved_at = Instant::now();
        }
        self.due.push_back(TrainingEvent::Ticked(tick));
        self.next(trainer, limits)
    }

    fn add_edits(&mut self, trainer: &Trainer) {
        let updates = trainer.counters().updates;
        let due = trainer.edits.iter().filter(|edit| edit.updates <= updates);
        self.due.extend(due.map(|_| TrainingEvent::Edit));
    }

    /// Adds the evaluations that are due; `is_new_update` says whether the latest update has not
    /// been evaluated yet.
    fn add_evaluations(&mut self, trainer: &Trainer, is_new_update: bool) {
        let counters = trainer.counters();
        let missing = |marks: &[u64], done: u64| {
            marks.partition_point(|mark| *mark <= done).saturating_sub(self.evaluations)
        };
        let count = match &self.schedule.evaluate {
            EvaluateAt::EveryUpdates(every) => {
                usize::from(is_new_update && counters.updates.is_multiple_of(*every))
            }
            EvaluateAt::Updates(marks) => {
                usize::from(is_new_update && marks.binary_search(&counters.updates).is_ok())
            }
            EvaluateAt::Episodes(marks) => missing(marks, counters.episodes),
            EvaluateAt::EnvSteps(marks) if !trainer.is_update_due() => {
                missing(marks, counters.env_steps)
            }
            EvaluateAt::Never | EvaluateAt::EnvSteps(_) => 0,
        };
        self.evaluations += count;
        self.due.extend(std::iter::repeat_n(TrainingEvent::Evaluation, count));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Job;
    use crate::train::{Edit, small_run};

    fn trainer() -> Trainer {
        small_run("gdg", 1)
    }

    fn edit(trainer: &Trainer, updates: u64) -> Edit {
        Edit { updates, world: trainer.world().fork(0).expect("a world") }
    }

    fn evaluate(trainer: &mut Trainer) {
        let made = trainer.evaluation().expect("one").evaluate(1, &Job::default());
        trainer.record_evaluation(trainer.moment(), made.expect("a result"));
    }

    fn course(
        training_loop: &mut TrainingLoop,
        trainer: &mut Trainer,
        limits: Limits,
    ) -> (Vec<(u64, TrainingEvent)>, EndReason) {
        let mut all = Vec::new();
        loop {
            match training_loop.next(trainer, &limits).expect("it trains") {
                TrainingEvent::Ticked(_) => {}
                TrainingEvent::Ended(reason) => return (all, reason),
                due => {
                    if due == TrainingEvent::Edit {
                        trainer.make_edit().expect("it fits");
                    }
                    all.push((trainer.counters().updates, due));
                }
            }
        }
    }

    #[test]
    fn after_an_update_come_progress_edits_evaluation_and_save() {
        let schedule = Schedule {
            progress_every_updates: Some(4),
            evaluate: EvaluateAt::EveryUpdates(4),
            save_every: Some(Duration::from_hours(1)),
        };
        let limits = Limits { updates: Some(5), ..Limits::default() };
        let mut trainer = trainer();
        trainer.edits = [4, 2, 4].map(|updates| edit(&trainer, updates)).into();
        let mut training = TrainingLoop::new(schedule);
        assert!(
            training.saved_at.elapsed() > Duration::from_mins(59),
            "the first save is due soon"
        );
        let (all, reason) = course(&mut training, &mut trainer, limits);
        let (edit, evaluation) = (TrainingEvent::Edit, TrainingEvent::Evaluation);
        let at_four = [TrainingEvent::Progress, edit, edit, evaluation].map(|due| (4, due));
        assert_eq!(all, [vec![(2, edit)], at_four.to_vec()].concat());
        assert_eq!(reason, EndReason::MaxUpdates);
    }

    #[test]
    fn marks_that_one_step_passes_together_are_each_evaluated_once() {
        let schedule =
            Schedule { evaluate: EvaluateAt::EnvSteps(vec![1, 2, 300]), ..Schedule::default() };
        let limits = Limits { env_steps: Some(300), ..Limits::default() };
        let (mut training_loop, mut trainer) = (TrainingLoop::new(schedule.clone()), trainer());
        let (all, reason) = course(&mut training_loop, &mut trainer, limits);
        assert_eq!(
            all.iter().map(|(_, due)| *due).collect::<Vec<_>>(),
            [TrainingEvent::Evaluation; 3]
        );
        assert!((0..2).all(|i| all[i].0 == 0) && all[2].0 == trainer.counters().updates);
        assert!(reason == EndReason::MaxSteps && !trainer.is_update_due());
        evaluate(&mut trainer);
        let resumed = TrainingLoop::resume(schedule, &trainer);
        assert_eq!(resumed.due.len(), 2, "one of three is made");
    }

    #[test]
    fn what_a_stop_has_prevented_is_due_when_the_run_is_resumed() {
        let schedule = Schedule {
            progress_every_updates: Some(1),
            evaluate: EvaluateAt::Updates(vec![3]),
            ..Schedule::default()
        };
        let mut trainer = trainer();
        let limits = Limits { updates: Some(3), ..Limits::default() };
        course(&mut TrainingLoop::new(Schedule::default()), &mut trainer, limits);
        trainer.edits = vec![edit(&trainer, 3)];
        let due = |trainer: &Trainer| TrainingLoop::resume(schedule.clone(), trainer).due;
        assert_eq!(due(&trainer), [TrainingEvent::Edit, TrainingEvent::Evaluation]);
        evaluate(&mut trainer);
        assert_eq!(due(&trainer), [TrainingEvent::Edit]);
        trainer.job().cancel();
        let ended = TrainingLoop::new(schedule).next(&mut trainer, &Limits::default());
        assert_eq!(ended.expect("no tick"), TrainingEvent::Ended(EndReason::Interrupted));
    }
}
