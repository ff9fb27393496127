//! Runs a trainer on its own thread. The engine takes commands, publishes snapshots and does not
//! depend on any front end.

mod command;
mod snapshot;

use std::fs::File;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::learn::{Policy, Scratch};
use crate::pulse::Pulse;
use crate::text::grouped;
use crate::train::{
    Counters, Due, EndReason, EvaluateAt, Evaluation, Limits, Recovery, Schedule, Session, Tick,
    TrainError, Trainer,
};
pub use command::{Command, MakeWorld};
use snapshot::next_multiple;
pub use snapshot::{FollowedAgent, Networks, NextEvaluation, Notice, Phase, Snapshot, Step};

/// Interval between snapshots while training.
const SNAPSHOT_INTERVAL: Duration = Duration::from_millis(66);

/// Minimum interval between copies of networks and candidates for a snapshot. Copying blocks
/// training, so it is limited to one part in [`NETWORKS_PAUSE_FACTOR`] of the time.
const MIN_NETWORKS_INTERVAL: Duration = Duration::from_millis(300);

/// Minimum updates between evaluations, tasks at each distance, and the pause after an evaluation
/// as a multiple of its duration: evaluations run concurrently with training, but on the same
/// cores. While most walks fail, an evaluation takes long, and so would the pause; beyond
/// [`LONG_EVALUATION_PAUSE`], it is as short as [`LEAST_PAUSE_FACTOR`] allows.
const EVALUATE_EVERY_UPDATES: u64 = 1_000;
const EVALUATION_TASKS: usize = 10;
const EVALUATION_PAUSE_FACTOR: u32 = 15;
const LONG_EVALUATION_PAUSE: Duration = Duration::from_secs(20);
const LEAST_PAUSE_FACTOR: u32 = 3;

/// Maximum pace of a learner that does not learn, in updates counted per second, unless the user
/// chooses another: at full speed, random steps would fill the replay buffer and be too fast to
/// watch.
const IDLE_UPDATES_PER_SECOND: f64 = 200.0;

/// See [`MIN_NETWORKS_INTERVAL`].
const NETWORKS_PAUSE_FACTOR: u32 = 60;

/// Polling interval for a running evaluation while training is paused.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Time without any movement after which a trainer that is to stop counts as hung. Updates of the
/// largest networks, edits of the largest maps and slow disks take minutes.
const HUNG_AFTER: Duration = Duration::from_mins(10);

/// Priority of the training threads: by how much lower than that of the front end. A thread of this
/// niceness gets a tenth of a core that another one wants.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 10;

/// Number of recent states per agent in a snapshot.
const TRAIL_STATES: usize = 8;

/// What a front end needs of a running trainer: where its commands go, and where snapshots come
/// from.
#[derive(Clone)]
pub struct EngineLink {
    commands: SyncSender<Command>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
}

impl EngineLink {
    /// Connects a front end with what takes `commands` and publishes `snapshots`.
    pub fn new(commands: SyncSender<Command>, snapshots: watch::Receiver<Arc<Snapshot>>) -> Self {
        Self { commands, snapshots }
    }

    /// Queues a command, which runs before the next update. Drops it and returns `false` if the
    /// queue is full.
    pub fn send(&self, command: Command) -> bool {
        self.commands.try_send(command).is_ok()
    }

    /// Returns a receiver of the latest snapshot.
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.snapshots.clone()
    }
}

/// Handle to a running trainer.
pub struct Engine {
    link: EngineLink,
    thread: JoinHandle<Trainer>,
    pulse: Pulse,
}

impl Engine {
    /// Starts training up to `limits`.
    ///
    /// # Errors
    /// The learner fails, or the thread cannot be started.
    pub fn start(trainer: Trainer, limits: Limits) -> Result<Self, TrainError> {
        Self::resume(trainer, limits, None)
    }

    /// Like [`Self::start`], for a run loaded from `file`.
    ///
    /// # Errors
    /// See [`Self::start`].
    pub fn resume(
        mut trainer: Trainer,
        limits: Limits,
        file: Option<PathBuf>,
    ) -> Result<Self, TrainError> {
        let (commands, inbox) = sync_channel(64);
        let saved = file.map(|file| (trainer.counters().updates, Arc::new(file)));
        let pulse = Pulse::default();
        trainer.set_pulse(pulse.clone());
        let first = Snapshot { limits, saved, ..Snapshot::capture(&trainer)? };
        let (publish, snapshots) = watch::channel(Arc::new(first.clone()));
        let worker = Worker {
            trainer,
            session: session(),
            inbox,
            publish,
            current: first,
            evaluation: None,
            next_evaluation_at: None,
            evaluation_pause: EVALUATION_PAUSE_FACTOR,
            follow: None,
            next_update_at: None,
            new_file: None,
            autosaved: Vec::new(),
            pulse: pulse.clone(),
            scratch: Scratch::default(),
        };
        let thread =
            std::thread::Builder::new().name("trainer".to_owned()).spawn(|| worker.run())?;
        Ok(Self { link: EngineLink::new(commands, snapshots), thread, pulse })
    }

    /// Returns a link for a front end, which must be gone before the trainer can be stopped.
    pub fn link(&self) -> EngineLink {
        self.link.clone()
    }

    /// Queues a command like [`EngineLink::send`].
    pub fn send(&self, command: Command) -> bool {
        self.link.send(command)
    }

    /// Returns a receiver of the latest snapshot.
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.link.snapshots()
    }

    /// Returns the trainer's progress signal: whether it advances, and its current activity.
    pub fn pulse(&self) -> &Pulse {
        &self.pulse
    }

    /// Stops training and returns the trainer, for as long as it takes while anything moves; `None`
    /// if its thread hangs or has panicked.
    pub fn stop(self) -> Option<Trainer> {
        self.stop_unless_hung(HUNG_AFTER)
    }

    fn stop_unless_hung(self, hung_after: Duration) -> Option<Trainer> {
        drop(self.link);
        self.pulse.stop();
        let (mut beats, mut moved) = (self.pulse.beats(), Instant::now());
        while !self.thread.is_finished() {
            let now = self.pulse.beats();
            if now != beats {
                (beats, moved) = (now, Instant::now());
            } else if moved.elapsed() > hung_after {
                return None;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        self.thread.join().ok()
    }
}

struct Worker {
    trainer: Trainer,
    session: Session,
    inbox: Receiver<Command>,
    publish: watch::Sender<Arc<Snapshot>>,
    current: Snapshot,
    evaluation: Option<RunningEvaluation>,
    /// Earliest start of the next evaluation.
    next_evaluation_at: Option<Instant>,
    /// The pause after an evaluation, as a multiple of its duration.
    evaluation_pause: u32,
    /// The followed agent.
    follow: Option<usize>,
    /// Earliest time of the next update, if speed is limited.
    next_update_at: Option<Instant>,
    /// Path requested by the latest fresh save, and the file it was written to.
    new_file: Option<(PathBuf, PathBuf)>,
    /// Autosaved files, oldest first.
    autosaved: Vec<(PathBuf, Option<File>)>,
    pulse: Pulse,
    scratch: Scratch,
}

/// An evaluation running on its own thread.
struct RunningEvaluation {
    updates: u64,
    began: Instant,
    result: JoinHandle<Evaluation>,
}

/// Timing of the updates for the front end.
struct PublishTimer {
    published: Instant,
    refresh_networks_at: Instant,
    /// Training time and counters when rates were last computed.
    rates_from: (f64, Counters),
}

/// Creates a session in which evaluations come regularly; everything else is a command.
fn session() -> Session {
    let evaluate = EvaluateAt::EveryUpdates(EVALUATE_EVERY_UPDATES);
    Session::new(Schedule { evaluate, ..Schedule::default() })
}

/// Lowers the priority of this thread, and of those that it starts, so that a front end beside it
/// draws without waiting. Only Linux has priorities of threads.
fn lower_priority() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(NICENESS) {
        tracing::warn!("training at the priority of the interface: {error}");
    }
}

impl Worker {
    fn run(mut self) -> Trainer {
        lower_priority();
        loop {
            match catch_unwind(AssertUnwindSafe(|| self.train())) {
                Ok(Ok(())) => break,
                Ok(Err(error)) => self.current.phase = Phase::Failed(error.to_string()),
                Err(_) => self.repair("training"),
            }
            self.report_recovery();
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

    /// Reports a rollback to earlier networks, if there was one.
    fn report_recovery(&mut self) {
        if let Some(recovery) = self.trainer.take_recovery() {
            self.on_recovery(recovery);
        }
    }

    fn on_recovery(&mut self, recovery: Recovery) {
        // The rollback changed the settings.
        self.current.run = Arc::new(self.trainer.run().clone());
        self.notify(recovery.to_string());
    }

    fn publish(&self) {
        self.publish.send_replace(Arc::new(self.current.clone()));
    }

    /// Trains and runs commands until the front end disconnects.
    fn train(&mut self) -> Result<(), TrainError> {
        let now = Instant::now();
        let rates_from = (self.trainer.seconds(), self.trainer.counters());
        let mut timer = PublishTimer { published: now, refresh_networks_at: now, rates_from };
        while self.process_commands() {
            let episodes = self.trainer.counters().episodes;
            let tick = match self.session.tick(&mut self.trainer, &self.current.limits)? {
                ControlFlow::Continue(tick) => tick,
                // The front end is about to disconnect.
                ControlFlow::Break(EndReason::Interrupted) => continue,
                ControlFlow::Break(_) => {
                    self.current.phase = Phase::Done;
                    self.refresh_snapshot(true)?;
                    continue;
                }
            };
            self.do_what_is_due()?;
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

    /// Reports a rollback, and starts an evaluation unless the latest one ended only recently.
    fn do_what_is_due(&mut self) -> Result<(), TrainError> {
        while let Some(due) = self.session.next_due() {
            match due {
                Due::Recovery(recovery) => self.on_recovery(recovery),
                Due::Evaluation => {
                    if self.next_evaluation_at.is_none_or(|at| Instant::now() >= at) {
                        self.start_evaluation()?;
                    }
                }
                Due::Progress | Due::Edit(_) | Due::Save => {}
            }
        }
        Ok(())
    }

    /// Returns the maximum updates per second, if limited.
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
            let until_update = until_update.filter(|wait| !wait.is_zero());
            let command = match (waiting, until_update) {
                (false, None) => self.inbox.try_recv(),
                (false, Some(wait)) => as_try_recv(self.inbox.recv_timeout(wait)),
                (true, _) if self.evaluation.is_none() => {
                    self.inbox.recv().map_err(|_| TryRecvError::Disconnected)
                }
                (true, _) => as_try_recv(self.inbox.recv_timeout(POLL_INTERVAL)),
            };
            match command {
                Ok(command) => self.execute_latest(command),
                Err(TryRecvError::Disconnected) => return false,
                Err(TryRecvError::Empty) => {
                    self.collect_evaluation();
                    if !waiting {
                        return true;
                    }
                }
            }
        }
    }

    /// Runs a command, or only the last of several changes of the world in a row: each replaces all
    /// of it, and on the largest maps takes seconds.
    fn execute_latest(&mut self, mut command: Command) {
        while matches!(command, Command::ChangeWorld(..)) {
            let Ok(next) = self.inbox.try_recv() else { break };
            let before = std::mem::replace(&mut command, next);
            if !matches!(command, Command::ChangeWorld(..)) {
                self.execute(before);
            }
        }
        self.execute(command);
    }

    /// Reports what a step has done.
    fn report_step(&mut self) {
        let counters = self.trainer.counters();
        let text = match &self.current.phase {
            Phase::Stepping(Step::Update) if self.trainer.learns() => {
                format!("update {} done", grouped(self.trainer.learned_updates()))
            }
            Phase::Stepping(Step::Update) => {
                format!(
                    "no update, as this method does not learn; {} steps so far",
                    grouped(counters.env_steps)
                )
            }
            _ => format!("episode {} ended", grouped(counters.episodes)),
        };
        self.notify(text);
    }

    fn report_progress(&mut self, timer: &mut PublishTimer) -> Result<(), TrainError> {
        timer.published = Instant::now();
        let networks = timer.published >= timer.refresh_networks_at;
        let (seconds, counters) = (self.trainer.seconds(), self.trainer.counters());
        let (since, before) = timer.rates_from;
        if seconds < since || counters.updates < before.updates {
            timer.rates_from = (seconds, counters);
        } else if seconds - since > 1.0 {
            let per_second = |now: u64, then: u64| (now - then) as f64 / (seconds - since);
            self.current.rates = (
                per_second(counters.updates, before.updates),
                per_second(counters.env_steps, before.env_steps),
            );
            timer.rates_from = (seconds, counters);
        }
        self.refresh_snapshot(networks)?;
        if networks {
            timer.refresh_networks_at = Instant::now()
                + MIN_NETWORKS_INTERVAL.max(NETWORKS_PAUSE_FACTOR * timer.published.elapsed());
        }
        Ok(())
    }

    /// Starts an evaluation of the current networks unless one is running; returns whether it did.
    fn start_evaluation(&mut self) -> Result<bool, TrainError> {
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
    fn next_evaluation(&self) -> NextEvaluation {
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
    fn collect_evaluation(&mut self) {
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

    /// Updates and publishes the snapshot. `networks` says whether to include the networks, which
    /// are slow to copy.
    fn refresh_snapshot(&mut self, networks: bool) -> Result<(), TrainError> {
        self.current.next_evaluation = self.next_evaluation();
        let trainer = &self.trainer;
        let current = &mut self.current;
        current.counters = trainer.counters();
        current.seconds = trainer.seconds();
        current.profile = *trainer.profile();
        current.losses = trainer.losses();
        current.curve = trainer.history().points().clone();
        current.film = trainer.film().frames().clone();
        current.replay.0 = trainer.replay().len();
        if !current.phase.is_training() {
            // Nothing moves.
            current.rates = (0.0, 0.0);
        }
        current.agents = Arc::new(trainer.rollout().env().states().to_vec());
        let trail = |agent| {
            trainer.replay().latest_states(agent, TRAIL_STATES).flatten().copied().collect()
        };
        current.trails = Arc::new((0..trainer.rollout().agents().len()).map(trail).collect());
        current.frontier_goals = snapshot::frontier_goals(trainer.rollout());
        current.search = trainer.last_search().cloned();
        if networks {
            current.networks = Networks::capture(trainer)?;
            current.scene = trainer.scene();
        }
        self.current.followed = self.followed()?.map(Arc::new);
        self.publish();
        Ok(())
    }

    /// Returns the state of the followed agent.
    fn followed(&mut self) -> Result<Option<FollowedAgent>, TrainError> {
        let (trainer, scratch) = (&self.trainer, &mut self.scratch);
        let rollout = trainer.rollout();
        let Some(agent) = self.follow.filter(|agent| *agent < rollout.agents().len()) else {
            return Ok(None);
        };
        let s = trainer.spec().state_dim();
        let state = rollout.env().states()[agent * s..(agent + 1) * s].to_vec();
        let own = &rollout.agents()[agent];
        let (goal, waypoints) = rollout.goal_and_waypoints(agent);
        let frontier = rollout.excursions().destination(agent);
        let (aim, goal) =
            frontier.as_deref().map_or((&own.goal[..], goal), |frontier| (frontier, frontier));
        let mut distances = (0.0, 0.0);
        let mut measure = |policy: &dyn Policy| {
            distances =
                (policy.distance(&state, aim, scratch), policy.distance(&state, goal, scratch));
        };
        trainer.learner().with_policy(false, &mut measure)?;
        // Before the first step of an episode, the replay buffer holds none of its states.
        let start =
            trainer.replay().latest_states(agent, usize::MAX).next().unwrap_or(&state).to_vec();
        let (aim, goal, planned) = (aim.to_vec(), goal.to_vec(), !waypoints.is_empty());
        let steps = (own.steps, trainer.episode_steps());
        Ok(Some(FollowedAgent { agent, start, state, steps, aim, goal, distances, planned }))
    }

    fn notify(&mut self, text: String) {
        self.current.notice =
            Notice { number: self.current.notice.number + 1, text, is_error: false };
    }

    /// Notifies the user of something that went wrong.
    fn report(&mut self, text: String) {
        self.notify(text);
        self.current.notice.is_error = true;
    }
}

/// Returns the pause after an evaluation that took `duration`, `factor` times as long unless that
/// is very long.
fn pause_after(duration: Duration, factor: u32) -> Duration {
    (factor * duration).min(LONG_EVALUATION_PAUSE.max(factor.min(LEAST_PAUSE_FACTOR) * duration))
}

/// Converts the result of a receive with a timeout to that of a non-blocking one.
fn as_try_recv(command: Result<Command, RecvTimeoutError>) -> Result<Command, TryRecvError> {
    command.map_err(|e| match e {
        RecvTimeoutError::Timeout => TryRecvError::Empty,
        RecvTimeoutError::Disconnected => TryRecvError::Disconnected,
    })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc::channel;

    use super::*;
    use crate::env::{Environment, PointMaze};
    use crate::train::{Method, Preset, Registry, Run, Settings};

    /// Starts a run in the trap.
    fn engine() -> Engine {
        let run = Run {
            method: Method::default(),
            preset: Preset::Default,
            seed: 1,
            settings: Settings::default(),
        };
        let world =
            PointMaze::new(Arc::new(crate::map::builtin("trap").expect("a built-in map")), 0);
        let trainer = Trainer::new(run, &world, &Registry::builtin(), 1).expect("a trainer");
        Engine::start(trainer, Limits::default()).expect("a thread")
    }

    #[test]
    fn of_edits_in_a_row_only_the_last_is_applied_and_stopping_does_not_wait_for_the_others() {
        let engine = engine();
        let made = Arc::new(AtomicUsize::new(0));
        let edit = |wait: Option<Receiver<()>>| {
            let made = made.clone();
            let make = move |world: &dyn Environment| {
                made.fetch_add(1, Ordering::Relaxed);
                wait.iter().for_each(|release| release.recv().expect("a signal"));
                world.fork(world.agents())
            };
            Command::ChangeWorld(Box::new(make), "edited")
        };
        let (release, wait) = channel();
        assert!(engine.send(Command::Pause) && engine.send(edit(Some(wait))));
        while made.load(Ordering::Relaxed) == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
        for command in
            [edit(None), edit(None), Command::Follow(Some(2)), edit(None), edit(None), edit(None)]
        {
            assert!(engine.send(command));
        }
        release.send(()).expect("the trainer waits");
        assert!(engine.stop().is_some());
        assert_eq!(
            made.load(Ordering::Relaxed),
            3,
            "the one begun, and the last before and after another command"
        );
    }

    #[test]
    fn stopping_waits_for_what_moves_and_gives_up_what_does_not() {
        for (moves, limit) in [(true, Duration::from_secs(2)), (false, Duration::from_millis(100))]
        {
            let engine = engine();
            let ((begun, begins), (release, wait)) = (channel(), channel::<()>());
            let pulse = engine.pulse().clone();
            // An edit that moves for longer than the limit, or hangs.
            let make = move |world: &dyn Environment| {
                begun.send(()).expect("the test waits");
                for _ in (0..60).filter(|_| moves) {
                    std::thread::sleep(limit / 40);
                    pulse.beat();
                }
                let _ =
                    wait.recv_timeout(if moves { Duration::ZERO } else { Duration::from_mins(1) });
                world.fork(world.agents())
            };
            assert!(engine.send(Command::ChangeWorld(Box::new(make), "edited")));
            begins.recv().expect("the edit begins");
            assert_eq!(engine.stop_unless_hung(limit).is_some(), moves);
            drop(release);
        }
    }

    #[test]
    fn long_evaluations_are_followed_by_shorter_pauses() {
        let pause = |seconds, factor| pause_after(Duration::from_secs(seconds), factor).as_secs();
        assert_eq!([1, 4, 10].map(|seconds| pause(seconds, 15)), [15, 20, 30]);
        assert_eq!([1, 10, 60].map(|seconds| pause(seconds, 2)), [2, 20, 120]);
    }
}
