//! What an engine tells its front end.

use std::path::PathBuf;
use std::sync::Arc;

use crate::bridge::{Candidates, SearchOutcome};
use crate::env::Scene;
use crate::learn::{Losses, Policy, Profile};
use crate::train::error::TrainError;
use crate::train::evaluate::Evaluation;
use crate::train::history::{LogEntry, LossPoint};
use crate::train::run::{Counters, Limits, Run};
use crate::train::trainer::Trainer;

/// How far to go before pausing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// One update.
    Update,
    /// Until an episode ends.
    Episode,
}

/// What the trainer is doing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Training.
    Running,
    /// Training up to the end of a step.
    Stepping(Step),
    /// Waiting to be resumed.
    Paused,
    /// A limit was reached.
    Done,
    /// Stopped by an error.
    Failed(String),
}

impl Phase {
    /// Whether it trains.
    pub fn trains(&self) -> bool {
        matches!(self, Self::Running | Self::Stepping(_))
    }
}

/// The state of a run at one moment.
#[derive(Clone)]
pub struct Snapshot {
    /// What is run.
    pub run: Arc<Run>,
    /// How many runs there have been on this engine: curves of one do not go on with another's.
    pub generation: u64,
    /// What its world is called.
    pub title: Arc<str>,
    /// What there is to be drawn of the world, renewed with the networks.
    pub scene: Scene,
    /// What it is doing.
    pub phase: Phase,
    /// How far it has come.
    pub counters: Counters,
    /// When it ends.
    pub limits: Limits,
    /// Training time, in seconds.
    pub seconds: f64,
    /// Updates and environment steps per second of the last moments.
    pub rates: (f64, f64),
    /// The most updates a second, if that is limited.
    pub speed: Option<f64>,
    /// Where the time has gone.
    pub profile: Profile,
    /// Running means of the losses.
    pub losses: Losses,
    /// Slots of the replay: used, and in all.
    pub replay: (usize, usize),
    /// Agents' states, `(agents, state_dim)`.
    pub agents: Arc<Vec<f32>>,
    /// The latest states of each agent's episode, oldest first, `(states, state_dim)`.
    pub trails: Arc<Vec<Vec<f32>>>,
    /// How the agent that is followed fares.
    pub followed: Option<Arc<Followed>>,
    /// Networks and bridge candidates, renewed now and then.
    pub networks: Arc<Networks>,
    /// The latest bridge search.
    pub search: Option<Arc<SearchOutcome>>,
    /// Losses over time.
    pub curve: Arc<Vec<LossPoint>>,
    /// Evaluations so far: updates and result.
    pub evaluations: Arc<Vec<(u64, Evaluation)>>,
    /// What the checkpoint says happened before the run was loaded.
    pub log: Arc<Vec<LogEntry>>,
    /// Updates up to which the run is saved, and where.
    pub saved: Option<(u64, Arc<PathBuf>)>,
    /// How often saving failed, and why it did last.
    pub save_failed: (u64, String),
    /// Files that were saved without being asked for and are still there.
    pub autosaves: Arc<Vec<PathBuf>>,
    /// What happened last that is worth telling, and how often something did.
    pub notice: (u64, String),
}

/// What has been learned, and the bridge candidates.
pub struct Networks {
    /// D and mu.
    pub policy: Arc<dyn Policy>,
    /// Candidates and what was seen between them.
    pub candidates: Arc<Candidates>,
}

impl Networks {
    /// Those of `trainer` at this moment.
    pub(super) fn of(trainer: &Trainer) -> Result<Arc<Self>, TrainError> {
        Ok(Arc::new(Self { policy: trainer.policy()?, candidates: trainer.candidates().frozen() }))
    }
}

/// An agent that explores, in the midst of its episode.
#[derive(Clone, Debug, PartialEq)]
pub struct Followed {
    /// Which agent.
    pub agent: usize,
    /// Where its episode began, as far back as the replay knows, `(state_dim)`.
    pub start: Vec<f32>,
    /// Where it is, `(state_dim)`.
    pub state: Vec<f32>,
    /// Steps of its episode.
    pub steps: u32,
    /// What it pursues at this moment: its goal, or a waypoint, `(goal_dim)`.
    pub aim: Vec<f32>,
    /// What it pursues in the end, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// D to both, in steps.
    pub distances: (f32, f32),
    /// Whether it walks through the bridge graph.
    pub planned: bool,
}

impl Snapshot {
    /// The present state of `trainer`, as if it had just begun to train.
    ///
    /// # Errors
    /// What the learner reports.
    pub fn of(trainer: &Trainer) -> Result<Self, TrainError> {
        Ok(Self {
            run: Arc::new(trainer.run().clone()),
            generation: 0,
            title: trainer.world().title().into(),
            scene: trainer.world().scene(),
            phase: Phase::Running,
            counters: trainer.counters(),
            limits: Limits::default(),
            seconds: trainer.seconds(),
            rates: (0.0, 0.0),
            speed: None,
            profile: *trainer.profile(),
            losses: trainer.losses(),
            replay: (trainer.replay().len(), trainer.replay().capacity()),
            agents: Arc::new(trainer.world().states().to_vec()),
            trails: Arc::default(),
            followed: None,
            networks: Networks::of(trainer)?,
            search: trainer.last_search().cloned(),
            curve: trainer.history().points().clone(),
            evaluations: trainer.history().evaluations().clone(),
            log: Arc::new(trainer.history().log.clone()),
            saved: None,
            save_failed: (0, String::new()),
            autosaves: Arc::default(),
            notice: (0, String::new()),
        })
    }
}
