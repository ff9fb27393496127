//! Runs a trainer on its own thread: takes commands, publishes snapshots, knows no front end.

mod command;
mod snapshot;

use std::fs::File;
use std::ops::Deref;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::env::EnvError;
use crate::job::{Job, Running, Stopwatch};
use crate::text::{grouped, sanitized};
use crate::train::{
    EndReason, EvaluateAt, Evaluation, Limits, Moment, Recovery, Schedule, Tick, TrainError,
    Trainer, TrainingEvent, TrainingLoop,
};
pub use command::{EngineCommand, MakeWorld};
pub use snapshot::{EngineNotice, Networks, NextEvaluation, Phase, Snapshot, Step};
use snapshot::{PublishTimer, SNAPSHOT_INTERVAL};

const EVALUATE_EVERY_UPDATES: u64 = 500;

/// Most updates per second of a learner that does not learn, unless the user chooses, to be watched.
const IDLE_UPDATES_PER_SECOND: f64 = 200.0;

const EVALUATION_TASKS: usize = 10;

/// The pause after an evaluation, as a multiple of its duration: it takes training's cores.
const EVALUATION_PAUSE_FACTOR: u32 = 15;

/// The longest pause, unless the evaluation took longer: results are replaced before they are old.
const MAX_PAUSE: Duration = Duration::from_secs(10);

const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Time without progress after which a stopping trainer counts as hung: large edits take minutes.
const HUNG_AFTER: Duration = Duration::from_mins(10);

/// Niceness of training relative to the front end: a thread gets about a tenth of a contended core.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 10;

/// A front end's connection to a running trainer: sends commands, receives snapshots.
#[derive(Clone)]
pub struct EngineLink {
    commands: SyncSender<EngineCommand>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    job: Job,
}

impl EngineLink {
    /// Links to an engine: sends it `commands`, follows `snapshots`, and sees in `job` what it does.
    pub fn new(
        commands: SyncSender<EngineCommand>,
        snapshots: watch::Receiver<Arc<Snapshot>>,
        job: Job,
    ) -> Self {
        Self { commands, snapshots, job }
    }

    /// Returns the trainer's progress signal: whether it advances, and its current activity.
    pub fn job(&self) -> &Job {
        &self.job
    }

    pub fn busy(&self) -> Option<Job> {
        self.job.latest_part()
    }

    /// Queues a command to run before the next update. Returns `false` if the queue is full.
    pub fn send(&self, command: EngineCommand) -> bool {
        self.commands.try_send(command).is_ok()
    }

    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.snapshots.clone()
    }
}

pub struct Engine {
    link: EngineLink,
    thread: JoinHandle<Trainer>,
}

impl Engine {
    pub fn start(trainer: Trainer, limits: Limits) -> Result<Self, TrainError> {
        Self::resume(trainer, limits, None, [])
    }

    /// Like [`Self::start`], for a run loaded from `file`; runs `at_first` before the first update.
    pub fn resume(
        mut trainer: Trainer,
        limits: Limits,
        file: Option<PathBuf>,
        at_first: impl IntoIterator<Item = EngineCommand>,
    ) -> Result<Self, TrainError> {
        let (commands, inbox) = sync_channel(64);
        at_first.into_iter().for_each(|command| drop(commands.try_send(command)));
        let job = Job::default();
        trainer.set_job(job.clone());
        let mut first = Snapshot { limits, ..Snapshot::capture(&trainer)? };
        file.into_iter().for_each(|file| first.set_saved(Arc::new(file)));
        let (publish, snapshots) = watch::channel(Arc::new(first.clone()));
        let worker = TrainingThread {
            trainer,
            training_loop: training_loop(),
            inbox,
            publish,
            current: first,
            evaluation: None,
            next_evaluation_at: None,
            evaluation_is_due: false,
            evaluation_pause: EVALUATION_PAUSE_FACTOR,
            next_update_at: None,
            new_file: None,
            autosaved: Vec::new(),
            job: job.clone(),
        };
        let thread =
            std::thread::Builder::new().name("trainer".to_owned()).spawn(|| worker.run())?;
        Ok(Self { link: EngineLink::new(commands, snapshots, job), thread })
    }

    /// Returns a link for a front end, which must be gone before the trainer can be stopped.
    pub fn link(&self) -> EngineLink {
        self.link.clone()
    }

    /// Stops training and returns the trainer; waits as long as there is progress. `None` if its
    /// thread hangs or has panicked.
    pub fn stop(self) -> Option<Trainer> {
        self.stop_unless_hung(HUNG_AFTER)
    }

    fn stop_unless_hung(self, hung_after: Duration) -> Option<Trainer> {
        let job = self.job().clone();
        drop(self.link);
        job.cancel();
        let (mut beats, mut still) = (job.beats(), Stopwatch::start());
        while !self.thread.is_finished() {
            std::thread::sleep(Duration::from_millis(2));
            if job.beats() != beats {
                (beats, still) = (job.beats(), Stopwatch::start());
            } else if still.elapsed() > hung_after {
                return None;
            }
        }
        self.thread.join().ok()
    }
}

impl Deref for Engine {
    type Target = EngineLink;

    fn deref(&self) -> &EngineLink {
        &self.link
    }
}

struct RunningEvaluation {
    made: Moment,
    running: Running<Result<Evaluation, EnvError>>,
}

struct TrainingThread {
    trainer: Trainer,
    training_loop: TrainingLoop,
    inbox: Receiver<EngineCommand>,
    publish: watch::Sender<Arc<Snapshot>>,
    current: Snapshot,
    evaluation: Option<RunningEvaluation>,
    next_evaluation_at: Option<Instant>,
    evaluation_is_due: bool,
    /// The pause after an evaluation, as a multiple of its duration.
    evaluation_pause: u32,
    next_update_at: Option<Instant>,
    /// Path requested by the latest fresh save, and the file it was written to.
    new_file: Option<(PathBuf, PathBuf)>,
    /// Autosaved files, oldest first, and the updates in each.
    autosaved: Vec<(u64, PathBuf, Option<File>)>,
    job: Job,
}

fn training_loop() -> TrainingLoop {
    let evaluate = EvaluateAt::EveryUpdates(EVALUATE_EVERY_UPDATES);
    TrainingLoop::new(Schedule { evaluate, ..Schedule::default() })
}

/// Lowers the priority of this thread, and of those that it starts, to that of training: the front
/// end draws without delay. Only Linux has a priority per thread.
pub fn lower_priority() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(NICENESS) {
        log::warn!("training at the priority of the interface: {error}");
    }
}

impl TrainingThread {
    fn run(mut self) -> Trainer {
        lower_priority();
        loop {
            match catch_unwind(AssertUnwindSafe(|| self.train())) {
                Ok(Ok(())) => break,
                Ok(Err(error)) => self.current.phase = Phase::Failed(error.to_string()),
                Err(_) => self.repair("training"),
            }
            self.trainer
                .take_recovery()
                .into_iter()
                .for_each(|recovery| self.on_recovery(recovery));
            self.publish();
            // The run can still be saved or replaced by another one: commands are handled until the
            // front end disconnects.
            while matches!(self.current.phase, Phase::Failed(_)) {
                match self.inbox.recv() {
                    Ok(command) => self.execute_latest(command),
                    Err(_) => return self.trainer,
                }
            }
        }
        self.trainer
    }

    /// Repairs the run after a panic so that it can be saved, and stops it.
    fn repair(&mut self, activity: &str) {
        let mended = catch_unwind(AssertUnwindSafe(|| self.trainer.repair_after_panic()));
        let state = match mended {
            Ok(Ok(())) => "the run can be saved",
            _ => "saving may fail",
        };
        self.current.phase = Phase::Failed(format!("an internal error ended {activity}; {state}"));
    }

    fn on_recovery(&mut self, recovery: Recovery) {
        // The rollback changed the settings.
        self.current.run = Arc::new(self.trainer.run().clone());
        self.notify(recovery.to_string());
    }

    fn publish(&self) {
        self.publish.send_replace(Arc::new(self.current.clone()));
    }

    fn train(&mut self) -> Result<(), TrainError> {
        let mut timer = PublishTimer::new(&self.trainer);
        while self.process_commands() {
            let episodes = self.trainer.counters().episodes;
            let tick = loop {
                match self.training_loop.next(&mut self.trainer, &self.current.limits)? {
                    TrainingEvent::Recovery(recovery) => self.on_recovery(recovery),
                    TrainingEvent::Warned => {
                        let warnings = self.trainer.take_warnings();
                        self.report(sanitized(&warnings.join("; ")));
                    }
                    TrainingEvent::Evaluation => self.evaluation_is_due = true,
                    TrainingEvent::Edit => self.make_edit()?,
                    TrainingEvent::Progress | TrainingEvent::Save => {}
                    TrainingEvent::Ticked(tick) => break Some(tick),
                    // The engine is being stopped.
                    TrainingEvent::Ended(EndReason::Interrupted) => return Ok(()),
                    TrainingEvent::Ended(_) => break None,
                }
            };
            let Some(tick) = tick else {
                self.current.phase = Phase::Done;
                self.refresh_snapshot(true)?;
                continue;
            };
            // Unless the latest one ended only recently.
            let is_time = self.next_evaluation_at.is_none_or(|at| Instant::now() >= at);
            if self.evaluation_is_due && is_time {
                self.start_evaluation()?;
            }
            if tick == Tick::Update
                && let Some(speed) = self.pace()
            {
                self.next_update_at = Some(Instant::now() + Duration::from_secs_f64(1.0 / speed));
            }
            let stepped = match &self.current.phase {
                Phase::Stepping(Step::Update) => tick == Tick::Update,
                Phase::Stepping(Step::Episode) => self.trainer.counters().episodes > episodes,
                _ => false,
            };
            if stepped {
                self.report_step();
                self.current.phase = Phase::Paused;
                self.refresh_snapshot(true)?;
            } else if timer.published.elapsed() >= SNAPSHOT_INTERVAL {
                self.report_progress(&mut timer)?;
            }
        }
        Ok(())
    }

    fn pace(&self) -> Option<f64> {
        self.current.speed.or((!self.trainer.learns()).then_some(IDLE_UPDATES_PER_SECOND))
    }

    /// Runs queued commands; blocks while training is paused or the speed limit holds it back.
    /// Returns `false` once the front end has disconnected.
    fn process_commands(&mut self) -> bool {
        loop {
            let waiting = !self.current.phase.is_training();
            let until_update =
                self.next_update_at.map(|at| at.saturating_duration_since(Instant::now()));
            let command = if waiting && self.evaluation.is_none() {
                self.inbox.recv().map_err(|_| RecvTimeoutError::Disconnected)
            } else {
                let wait = if waiting { POLL_INTERVAL } else { until_update.unwrap_or_default() };
                self.inbox.recv_timeout(wait)
            };
            match command {
                Ok(command) => self.execute_latest(command),
                Err(RecvTimeoutError::Disconnected) => return false,
                Err(RecvTimeoutError::Timeout) => {
                    self.collect_evaluation();
                    if !waiting {
                        return true;
                    }
                }
            }
        }
    }

    /// Runs a command. Of several changes of the world in a row, runs only the last: each replaces
    /// the whole world, which takes seconds on the largest maps.
    fn execute_latest(&mut self, mut command: EngineCommand) {
        while matches!(command, EngineCommand::ChangeWorld(..)) {
            let Ok(next) = self.inbox.try_recv() else { break };
            let before = std::mem::replace(&mut command, next);
            if !matches!(command, EngineCommand::ChangeWorld(..)) {
                self.execute(before);
            }
        }
        self.execute(command);
    }

    fn report_step(&mut self) {
        let counters = self.trainer.counters();
        let (is_update, learns) =
            (self.current.phase == Phase::Stepping(Step::Update), self.trainer.learns());
        let text = match (is_update, learns) {
            (true, true) => format!("update {} done", grouped(self.trainer.learned_updates())),
            (true, false) => format!(
                "no update, as this method does not learn; {} steps so far",
                grouped(counters.env_steps)
            ),
            (false, _) => format!("episode {} ended", grouped(counters.episodes)),
        };
        self.notify(text);
    }

    fn notify(&mut self, text: String) {
        self.current.notice =
            EngineNotice { number: self.current.notice.number + 1, text, is_error: false };
    }

    fn report(&mut self, text: String) {
        self.notify(text);
        self.current.notice.is_error = true;
    }
}

impl TrainingThread {
    fn start_evaluation(&mut self) -> Result<bool, TrainError> {
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

    fn next_evaluation(&self) -> NextEvaluation {
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

    fn collect_evaluation(&mut self) {
        let Some(RunningEvaluation { made, running }) =
            self.evaluation.take_if(|e| e.running.is_finished())
        else {
            return;
        };
        let updates = made.updates;
        let now = Instant::now();
        let duration = now - running.job().since();
        let pause = (self.evaluation_pause * duration).min(MAX_PAUSE.max(duration));
        self.next_evaluation_at = Some(now + pause);
        match running.join() {
            Ok(Err(EnvError::Stopped)) => {}
            Ok(Ok(evaluation)) if evaluation.is_finite() => {
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc::channel;

    use super::*;
    use crate::env::Environment;

    fn started(at_first: impl IntoIterator<Item = EngineCommand>) -> Engine {
        let trainer = crate::train::small_run("gdg-bridge", 1);
        Engine::resume(trainer, Limits::default(), None, at_first).expect("a thread")
    }

    #[test]
    fn a_run_that_begins_paused_takes_no_step() {
        let engine = started([EngineCommand::Pause]);
        let mut snapshots = engine.snapshots();
        while snapshots.borrow_and_update().phase != Phase::Paused {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(engine.stop().expect("the trainer").counters().env_steps, 0);
    }

    #[test]
    fn of_edits_in_a_row_only_the_last_is_applied_and_stopping_does_not_wait_for_the_others() {
        let engine = started([]);
        let made = Arc::new(AtomicUsize::new(0));
        let edit = |wait: Option<Receiver<()>>| {
            let made = made.clone();
            let make = move |world: &dyn Environment| {
                made.fetch_add(1, Ordering::Relaxed);
                wait.iter().for_each(|release| release.recv().expect("a signal"));
                world.fork(world.agents())
            };
            EngineCommand::ChangeWorld(Box::new(make), "edited")
        };
        let (release, wait) = channel();
        assert!(engine.send(EngineCommand::Pause) && engine.send(edit(Some(wait))));
        while made.load(Ordering::Relaxed) == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
        let other = EngineCommand::LimitSpeed(None);
        for command in [edit(None), edit(None), other, edit(None), edit(None), edit(None)] {
            assert!(engine.send(command));
        }
        release.send(()).expect("the trainer waits");
        assert!(engine.stop().is_some());
        // The one begun, and the last before and after another command.
        assert_eq!(made.load(Ordering::Relaxed), 3);
    }

    #[test]
    fn stopping_waits_for_what_moves_and_gives_up_what_does_not() {
        for (moves, limit) in [(true, Duration::from_secs(2)), (false, Duration::from_millis(100))]
        {
            let engine = started([]);
            let _held = engine.link();
            let ((begun, begins), (release, wait)) = (channel(), channel::<()>());
            let job = engine.job().clone();
            // An edit that moves for longer than the limit, or hangs.
            let make = move |world: &dyn Environment| {
                begun.send(()).expect("the test waits");
                for _ in (0..60).filter(|_| moves) {
                    std::thread::sleep(limit / 40);
                    job.beat();
                }
                let _ =
                    wait.recv_timeout(if moves { Duration::ZERO } else { Duration::from_mins(1) });
                world.fork(world.agents())
            };
            assert!(engine.send(EngineCommand::ChangeWorld(Box::new(make), "edited")));
            begins.recv().expect("the edit begins");
            assert_eq!(engine.stop_unless_hung(limit).is_some(), moves);
            drop(release);
        }
    }
}
