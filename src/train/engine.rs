//! A trainer on a thread of its own: it takes commands and publishes snapshots, and knows no front end.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::checkpoint;
use super::evaluate::Evaluation;
use super::run::{Counters, Limits, Run, Tick};
use super::tasks::TaskSet;
use super::trainer::Trainer;
use crate::bridge::{Experience, SearchOutcome};
use crate::learn::{Losses, Policy};
use crate::map::{Diameter, Grid, StepSearch};

/// How often snapshots are published while training.
const SNAPSHOT_EVERY: Duration = Duration::from_millis(66);

/// How often a snapshot brings new networks and candidates at most; copying them holds training up, of which it takes
/// no larger share than one part in [`PARTS_FOR_TRAINING`].
const NETWORKS_EVERY: Duration = Duration::from_millis(300);

/// Updates between evaluations at least, and tasks at each distance. They run beside training, but on the same cores:
/// one begins only when so many times as long as the last one took has passed.
const EVALUATE_EVERY_UPDATES: u64 = 2_500;
const EVALUATION_TASKS: usize = 10;
const REST_AFTER_EVALUATION: u32 = 25;

/// See [`NETWORKS_EVERY`].
const PARTS_FOR_TRAINING: u32 = 60;

/// How often a trainer that waits looks whether its evaluation is done.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What a front end can ask for.
#[derive(Debug)]
pub enum Command {
    /// Stop training until told otherwise.
    Pause,
    /// Go on.
    Resume,
    /// Save a checkpoint.
    Save(std::path::PathBuf),
    /// Go on with another map of the same size.
    ChangeMap(Arc<Grid>),
}

/// What the trainer is doing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Training.
    Running,
    /// Waiting to be resumed.
    Paused,
    /// A limit was reached.
    Done,
    /// Stopped by an error.
    Failed(String),
}

/// The state of a run at one moment.
#[derive(Clone)]
pub struct Snapshot {
    /// The map.
    pub map: Arc<Grid>,
    /// What it is doing.
    pub phase: Phase,
    /// How far it has come.
    pub counters: Counters,
    /// Training time, in seconds.
    pub seconds: f64,
    /// Updates and environment steps per second of the last moments.
    pub rates: (f64, f64),
    /// Running means of the losses.
    pub losses: Losses,
    /// Slots of the replay: used, and in all.
    pub replay: (usize, usize),
    /// Agents' states, `(agents, state_dim)`.
    pub agents: Arc<Vec<f32>>,
    /// Networks and bridge candidates, renewed now and then.
    pub networks: Arc<(Policy, Arc<Experience>)>,
    /// The latest bridge search.
    pub search: Option<SearchOutcome>,
    /// Evaluations so far: updates and result.
    pub evaluations: Arc<Vec<(u64, Evaluation)>>,
    /// What happened last that is worth telling, and how often something did.
    pub notice: (u64, String),
}

/// A running trainer.
pub struct Engine {
    commands: SyncSender<Command>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    thread: JoinHandle<Trainer>,
    run: Run,
    map: Arc<Grid>,
}

impl Engine {
    /// Starts training up to `limits`; `diameter` is the map's, in steps, which evaluations need.
    ///
    /// # Errors
    /// What candle reports, or that the thread cannot be started.
    pub fn start(trainer: Trainer, diameter: u32, limits: Limits) -> candle_core::Result<Self> {
        let (commands, inbox) = sync_channel(64);
        let first = snapshot(&trainer)?;
        let (publish, snapshots) = watch::channel(Arc::new(first.clone()));
        let (run, map) = (trainer.run().clone(), trainer.map().clone());
        let worker =
            Worker { trainer, diameter, limits, inbox, publish, current: first, evaluation: None, rested: None };
        let thread = std::thread::Builder::new().name("trainer".to_owned()).spawn(|| worker.run())?;
        Ok(Self { commands, snapshots, thread, run, map })
    }

    /// What is run.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// The map.
    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// Sends a command; it is carried out before the next update. Dropped (with `false`) when too many wait.
    pub fn send(&self, command: Command) -> bool {
        self.commands.try_send(command).is_ok()
    }

    /// Snapshots, always the latest.
    pub fn snapshots(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.snapshots.clone()
    }

    /// Ends training and hands the trainer back; `None` if it panicked.
    pub fn stop(self) -> Option<Trainer> {
        drop(self.commands);
        self.thread.join().ok()
    }
}

fn snapshot(trainer: &Trainer) -> candle_core::Result<Snapshot> {
    use crate::env::Environment;
    Ok(Snapshot {
        map: trainer.map().clone(),
        phase: Phase::Running,
        counters: trainer.counters(),
        seconds: trainer.seconds(),
        rates: (0.0, 0.0),
        losses: trainer.losses(),
        replay: (trainer.replay().len(), trainer.replay().capacity()),
        agents: Arc::new(trainer.rollout().env().states().to_vec()),
        networks: Arc::new((trainer.policy()?, trainer.experience().known())),
        search: trainer.last_search(),
        evaluations: Arc::new(Vec::new()),
        notice: (0, String::new()),
    })
}

struct Worker {
    trainer: Trainer,
    diameter: u32,
    limits: Limits,
    inbox: Receiver<Command>,
    publish: watch::Sender<Arc<Snapshot>>,
    current: Snapshot,
    evaluation: Option<Evaluating>,
    /// When the next evaluation may begin.
    rested: Option<Instant>,
}

/// An evaluation under way on a thread of its own.
struct Evaluating {
    updates: u64,
    began: Instant,
    result: JoinHandle<Evaluation>,
}

impl Worker {
    fn run(mut self) -> Trainer {
        if let Err(error) = self.train() {
            self.current.phase = Phase::Failed(error.to_string());
            self.publish.send_replace(Arc::new(self.current.clone()));
            // Saving is still possible: commands are heard until the front end goes.
            while let Ok(command) = self.inbox.recv() {
                self.carry_out(command);
            }
        }
        self.trainer
    }

    fn train(&mut self) -> candle_core::Result<()> {
        let mut published = Instant::now();
        let mut renew_at = Instant::now();
        let mut rate_from = (self.trainer.seconds(), self.trainer.counters());
        loop {
            loop {
                let waiting = self.current.phase != Phase::Running;
                let command = match (waiting, &self.evaluation) {
                    (false, _) => self.inbox.try_recv(),
                    (true, None) => self.inbox.recv().map_err(|_| TryRecvError::Disconnected),
                    (true, Some(_)) => self.inbox.recv_timeout(LOOK_EVERY).map_err(|e| match e {
                        RecvTimeoutError::Timeout => TryRecvError::Empty,
                        RecvTimeoutError::Disconnected => TryRecvError::Disconnected,
                    }),
                };
                match command {
                    Ok(command) => self.carry_out(command),
                    Err(TryRecvError::Disconnected) => return Ok(()),
                    Err(TryRecvError::Empty) => {
                        self.collect_evaluation();
                        if !waiting {
                            break;
                        }
                    }
                }
            }
            if self.trainer.limit_reached(&self.limits).is_some() {
                self.current.phase = Phase::Done;
                self.renew(true)?;
                continue;
            }
            let tick = self.trainer.tick()?;
            if tick == Tick::Update && self.trainer.counters().updates.is_multiple_of(EVALUATE_EVERY_UPDATES) {
                self.begin_evaluation()?;
            }
            if published.elapsed() >= SNAPSHOT_EVERY {
                published = Instant::now();
                let networks = published >= renew_at;
                let (seconds, counters) = (self.trainer.seconds(), self.trainer.counters());
                if seconds - rate_from.0 > 1.0 {
                    let per_second = |now: u64, then: u64| (now - then) as f64 / (seconds - rate_from.0);
                    self.current.rates = (
                        per_second(counters.updates, rate_from.1.updates),
                        per_second(counters.env_steps, rate_from.1.env_steps),
                    );
                    rate_from = (seconds, counters);
                }
                self.renew(networks)?;
                if networks {
                    renew_at = Instant::now() + NETWORKS_EVERY.max(PARTS_FOR_TRAINING * published.elapsed());
                }
            }
        }
    }

    /// Starts an evaluation of this moment unless one is under way or was a short while ago.
    fn begin_evaluation(&mut self) -> candle_core::Result<()> {
        if self.evaluation.is_some() || self.rested.is_some_and(|at| Instant::now() < at) {
            return Ok(());
        }
        let (job, rng) = (self.trainer.evaluation()?, self.trainer.task_rng());
        let (map, diameter) = (self.trainer.map().clone(), self.diameter);
        let began = Instant::now();
        let result = std::thread::Builder::new().name("evaluation".to_owned()).spawn(move || {
            let mut rng = rng;
            job.carry_out(&TaskSet::sample(&map, diameter, EVALUATION_TASKS, &mut rng))
        })?;
        self.evaluation = Some(Evaluating { updates: self.trainer.counters().updates, began, result });
        Ok(())
    }

    /// Takes up an evaluation that is done.
    fn collect_evaluation(&mut self) {
        let Some(Evaluating { updates, began, result }) = self.evaluation.take_if(|e| e.result.is_finished()) else {
            return;
        };
        let now = Instant::now();
        self.rested = Some(now + REST_AFTER_EVALUATION * (now - began));
        match result.join() {
            Ok(evaluation) => Arc::make_mut(&mut self.current.evaluations).push((updates, evaluation)),
            Err(_) => self.current.notice = (self.current.notice.0 + 1, "an evaluation failed".to_owned()),
        }
        self.publish.send_replace(Arc::new(self.current.clone()));
    }

    /// Publishes what has changed; networks only now and then, as copying them takes longer.
    fn renew(&mut self, networks: bool) -> candle_core::Result<()> {
        use crate::env::Environment;
        let trainer = &self.trainer;
        self.current.counters = trainer.counters();
        self.current.seconds = trainer.seconds();
        self.current.losses = trainer.losses();
        self.current.replay.0 = trainer.replay().len();
        self.current.agents = Arc::new(trainer.rollout().env().states().to_vec());
        self.current.search = trainer.last_search();
        if networks {
            self.current.networks = Arc::new((trainer.policy()?, trainer.experience().known()));
        }
        self.publish.send_replace(Arc::new(self.current.clone()));
        Ok(())
    }

    /// Changes the map; what is to be said of it, or against it.
    fn change_map(&mut self, map: Arc<Grid>) -> Result<String, String> {
        let change = self.trainer.change_map(map.clone())?;
        self.diameter = Diameter::of(&map).steps;
        let pieces = StepSearch::new(&map).components(&map).sizes.len();
        self.current.map = map;
        // What is being found out about the map as it was says nothing of the map that there is now.
        (self.evaluation, self.rested) = (None, None);
        self.renew(true).map_err(|error| error.to_string())?;
        let apart = if pieces > 1 { format!("; {pieces} pieces that do not reach each other") } else { String::new() };
        let (walled, opened, gone) = (change.walled, change.opened, change.transitions_removed);
        Ok(format!("{walled} cells walled, {opened} opened, {gone} transitions forgotten{apart}"))
    }

    fn carry_out(&mut self, command: Command) {
        match command {
            Command::Pause if self.current.phase == Phase::Running => self.current.phase = Phase::Paused,

            Command::Resume if self.current.phase == Phase::Paused => self.current.phase = Phase::Running,
            Command::Pause | Command::Resume => {}
            Command::Save(path) => {
                let text = match checkpoint::save(&self.trainer, &path) {
                    Ok(()) => format!("saved {} at update {}", path.display(), self.trainer.counters().updates),
                    Err(error) => error.to_string(),
                };
                self.current.notice = (self.current.notice.0 + 1, text);
            }
            Command::ChangeMap(map) => {
                let text = self.change_map(map).unwrap_or_else(|error| error);
                self.current.notice = (self.current.notice.0 + 1, text);
            }
        }
        self.publish.send_replace(Arc::new(self.current.clone()));
    }
}
