//! Snapshots that an engine publishes for its front end, and when.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{EVALUATE_EVERY_UPDATES, TrainingThread};
use crate::bridge::{Candidates, SearchOutcome};
use crate::env::WorldScene;
use crate::job::Job;
use crate::learn::{Losses, Policy, Profile};
use crate::train::{
    Counters, CurvePoint, DataSource, Evaluation, FilmFrame, Limits, Methods, Notes, Registry, Run,
    TrainError, Trainer,
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    Update,
    Episode,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Phase {
    Running,
    /// Training until the end of a step.
    Stepping(Step),
    Paused,
    Done,
    /// Stopped by an error.
    Failed(String),
}

impl Phase {
    pub fn is_training(&self) -> bool {
        matches!(self, Self::Running | Self::Stepping(_))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NextEvaluation {
    /// It has been running since then.
    Running(Instant),
    /// At this update, within seconds.
    AtUpdate(u64),
    /// In this many seconds: the longer evaluations take, the rarer they are.
    InSeconds(u64),
}

impl NextEvaluation {
    pub(super) fn after(trainer: &Trainer) -> Self {
        let every = EVALUATE_EVERY_UPDATES;
        Self::AtUpdate((trainer.counters().updates / every + 1) * every)
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EngineNotice {
    /// The number of notices so far, including this one.
    pub number: u64,
    pub text: String,
    pub is_error: bool,
}

#[derive(Clone)]
pub struct Snapshot {
    pub run: Arc<Run>,
    /// Index of the run on this engine: curves of different runs must not be joined.
    pub generation: u64,
    pub title: Arc<str>,
    /// Drawable contents of the world, updated with the networks.
    pub scene: WorldScene,
    pub registry: Arc<Registry>,
    /// Default settings of worlds of this kind, as `name=value`.
    pub world_defaults: &'static [&'static str],
    pub phase: Phase,
    pub counters: Counters,
    pub limits: Limits,
    /// Training time, in seconds.
    pub seconds: f64,
    /// Estimated seconds until a limit is reached, if that can be told.
    pub seconds_left: Option<f64>,
    pub rates: (f64, f64),
    /// Maximum updates per second, if limited.
    pub speed: Option<f64>,
    pub profile: Profile,
    pub losses: Losses,
    /// Replay buffer slots: used and total.
    pub replay: (usize, usize),
    /// The data that the run learns from instead of agents' steps, while agents do not act.
    pub data: Option<Arc<DataSource>>,
    /// Agents' states, `(agents, state_dim)`; none while agents do not act.
    pub agents: Arc<Vec<f32>>,
    /// The latest states of each agent's episode, oldest first, `(states, state_dim)`.
    pub trails: Arc<Vec<Vec<f32>>>,
    /// Places at the frontier that agents are heading for, `(goals, goal_dim)`.
    pub frontier_goals: Arc<Vec<f32>>,
    pub networks: Arc<Networks>,
    pub search: Option<Arc<SearchOutcome>>,
    pub curve: Arc<Vec<CurvePoint>>,
    /// The film of how distance was learned, oldest frame first.
    pub film: Arc<Vec<Arc<FilmFrame>>>,
    /// Evaluations so far: updates and result.
    pub evaluations: Arc<Vec<(u64, Evaluation)>>,
    pub methods: Methods,
    /// Updates after which the world was edited, in order.
    pub edits: Arc<Vec<u64>>,
    /// How many of them were to come when the run was opened: no front end has asked for them.
    pub made_edits: u64,
    pub learns: bool,
    /// See [`Trainer::goal_moved`].
    pub goal_moved: Option<f64>,
    /// What a front end kept in the checkpoint that the run was loaded from.
    pub notes: Arc<Notes>,
    /// Update of the latest save, and its file.
    pub saved: Option<(u64, Arc<PathBuf>)>,
    /// Seconds of training at which it was saved or loaded; 0 for a run that has not been.
    pub saved_seconds: f64,
    /// The run as it was saved or loaded; its settings may have changed since.
    pub saved_run: Arc<Run>,
    /// Update of the latest evaluation in that file.
    pub saved_evaluation: Option<u64>,
    pub save_failed: (u64, String),
    /// Autosaved files that are still kept, oldest first, and the updates in each.
    pub autosaves: Arc<Vec<(u64, PathBuf)>>,
    pub next_evaluation: NextEvaluation,
    pub evaluation_progress: Job,
    pub notice: EngineNotice,
}

pub struct Networks {
    /// D and mu.
    pub policy: Arc<dyn Policy>,
    pub candidates: Arc<Candidates>,
}

impl Networks {
    pub(super) fn capture(trainer: &Trainer) -> Result<Arc<Self>, TrainError> {
        Ok(Arc::new(Self { policy: trainer.policy()?, candidates: trainer.candidates().frozen() }))
    }
}

impl Snapshot {
    /// Captures the current state of `trainer`, as if training had just started.
    pub fn capture(trainer: &Trainer) -> Result<Self, TrainError> {
        let run = Arc::new(trainer.run().clone());
        let mut snapshot = Self {
            saved_run: run.clone(),
            run,
            generation: 0,
            title: trainer.world().title().into(),
            scene: trainer.scene(),
            registry: trainer.registry().clone(),
            world_defaults: trainer
                .registry()
                .world(trainer.world().kind())
                .map_or(&[], |kind| kind.defaults),
            phase: Phase::Running,
            counters: Counters::default(),
            limits: Limits::default(),
            seconds: 0.0,
            seconds_left: None,
            rates: (0.0, 0.0),
            speed: None,
            profile: Profile::default(),
            losses: Losses::default(),
            replay: (trainer.replay().len(), trainer.replay().capacity()),
            agents: Arc::default(),
            data: None,
            trails: Arc::default(),
            frontier_goals: Arc::default(),
            networks: Networks::capture(trainer)?,
            search: None,
            curve: Arc::default(),
            film: Arc::default(),
            evaluations: trainer.history().evaluations().clone(),
            methods: trainer.history().methods().clone(),
            edits: Arc::new(trainer.history().edits().to_vec()),
            made_edits: 0,
            learns: trainer.learns(),
            goal_moved: None,
            notes: Arc::new(trainer.history().notes.clone()),
            saved: None,
            saved_seconds: 0.0,
            saved_evaluation: None,
            save_failed: (0, String::new()),
            autosaves: Arc::default(),
            evaluation_progress: Job::default(),
            next_evaluation: NextEvaluation::after(trainer),
            notice: EngineNotice::default(),
        };
        snapshot.update(trainer);
        Ok(snapshot)
    }

    /// Captures what moves while `trainer` trains, but for what is slow to copy.
    pub(super) fn update(&mut self, trainer: &Trainer) {
        self.counters = trainer.counters();
        self.seconds = trainer.seconds();
        self.profile = *trainer.profile();
        self.losses = trainer.losses();
        self.goal_moved = trainer.goal_moved();
        self.curve = trainer.history().points().clone();
        self.film = trainer.film().frames().clone();
        self.replay.0 = trainer.replay().len();
        self.search = trainer.last_search().cloned();
        let rollout = trainer.rollout();
        let (acting, excursions) = (rollout.agents().len(), rollout.excursions());
        let heading = (0..acting).filter_map(|agent| excursions.destination(agent));
        self.frontier_goals = Arc::new(heading.flatten().collect());
        let latest = |agent| trainer.replay().latest_states(agent, TRAIL_STATES);
        let trail = |agent| latest(agent).flatten().copied().collect();
        (self.data, self.agents, self.trails) = if trainer.acts() {
            let agents = Arc::new(trainer.world().states().to_vec());
            (None, agents, Arc::new((0..acting).map(trail).collect()))
        } else {
            (trainer.data().cloned().map(Arc::new), Arc::default(), Arc::default())
        };
    }

    /// Notes that `file` has all that is here.
    pub fn set_saved(&mut self, file: Arc<PathBuf>) {
        self.saved = Some((self.counters.updates, file));
        (self.saved_seconds, self.saved_run) = (self.seconds, self.run.clone());
        self.saved_evaluation = self.evaluations.last().map(|(updates, _)| *updates);
    }

    /// Returns how many of the first `updates` were done by a learner.
    pub fn learned(&self, updates: u64) -> u64 {
        self.methods.learned(updates, self.learns)
    }

    pub fn updates(&self) -> u64 {
        self.learned(self.counters.updates)
    }

    /// Returns the number of updates not saved in a checkpoint that the user has asked for.
    pub fn unsaved_updates(&self) -> u64 {
        let saved = self.saved.as_ref().map_or(0, |(updates, _)| self.learned(*updates));
        self.updates().saturating_sub(saved)
    }

    /// Returns the number of updates that are in no file, not even an autosaved one.
    pub fn lost_updates(&self) -> u64 {
        let autosaved = self.autosaves.last().map_or(0, |(updates, _)| self.learned(*updates));
        self.unsaved_updates().min(self.updates().saturating_sub(autosaved))
    }

    /// Returns the seconds of training not saved in any checkpoint.
    pub fn unsaved_seconds(&self) -> f64 {
        if self.learns { self.seconds - self.saved_seconds } else { 0.0 }
    }

    /// Whether a run that has been saved has other settings now.
    pub fn has_unsaved_settings(&self) -> bool {
        self.saved.is_some() && self.run != self.saved_run
    }

    /// Whether what was saved has been evaluated only afterwards.
    pub fn has_unsaved_evaluation(&self) -> bool {
        let last = self.evaluations.last().map(|(updates, _)| *updates);
        let saved = self.saved.as_ref().map(|(updates, _)| *updates);
        saved.is_some() && last == saved && self.saved_evaluation != saved
    }

    pub fn is_edited_since(&self, updates: u64) -> bool {
        self.edits.last().is_some_and(|at| *at >= updates)
    }

    /// Returns the latest evaluation, if it was of the current method, and the updates counted
    /// then.
    pub fn evaluation(&self) -> Option<&(u64, Evaluation)> {
        self.evaluations.last().filter(|(updates, _)| self.methods.is_current(*updates))
    }

    /// Returns the latest evaluation up to an update, if it was of the method used then.
    pub fn evaluation_at(&self, updates: u64) -> Option<&Evaluation> {
        let (at, evaluation) = self.evaluations.iter().rev().find(|(at, _)| *at <= updates)?;
        (self.methods.index(*at) == self.methods.index(updates)).then_some(evaluation)
    }

    /// Returns the fraction of the world explored over time: updates and coverage, from the curve's
    /// points and the evaluations.
    pub fn coverage(&self) -> Vec<(u64, f64)> {
        let points =
            self.curve.iter().filter_map(|point| Some((point.updates, f64::from(point.coverage?))));
        let evaluated =
            self.evaluations.iter().filter_map(|(updates, e)| Some((*updates, e.explored?)));
        let mut all: Vec<_> = points.chain(evaluated).collect();
        all.sort_by_key(|(updates, _)| *updates);
        all
    }
}

pub(super) const SNAPSHOT_INTERVAL: Duration = Duration::from_millis(66);

/// Minimum interval between copies of networks and candidates for a snapshot. Copying blocks
/// training, so it is limited to one part in [`NETWORKS_PAUSE_FACTOR`] of the time.
const MIN_NETWORKS_INTERVAL: Duration = Duration::from_millis(300);

const NETWORKS_PAUSE_FACTOR: u32 = 60;

const TRAIL_STATES: usize = 8;

pub struct PublishTimer {
    pub published: Instant,
    refresh_networks_at: Instant,
    /// Training time and counters when rates were last computed.
    rates_from: (f64, Counters),
}

impl PublishTimer {
    pub fn new(trainer: &Trainer) -> Self {
        let now = Instant::now();
        let rates_from = (trainer.seconds(), trainer.counters());
        Self { published: now, refresh_networks_at: now, rates_from }
    }
}

/// Estimates the seconds left until a limit is reached, at no more than this many updates a second.
fn seconds_left(trainer: &Trainer, limits: &Limits, at_most: Option<f64>) -> Option<f64> {
    let pace = trainer.pace();
    // Time spent waiting is none of training.
    let per_second = pace.per_second(|counters| counters.updates);
    let slowed = per_second.zip(at_most).map_or(1.0, |(own, most)| (own / most).max(1.0));
    Some(slowed * pace.seconds_left(limits)?)
}

impl TrainingThread {
    pub(super) fn report_progress(&mut self, timer: &mut PublishTimer) -> Result<(), TrainError> {
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

    /// Updates and publishes the snapshot. `networks` says whether to include the networks, which
    /// are slow to copy.
    pub(super) fn refresh_snapshot(&mut self, networks: bool) -> Result<(), TrainError> {
        self.current.next_evaluation = self.next_evaluation();
        let (trainer, pace, current) = (&self.trainer, self.pace(), &mut self.current);
        current.update(trainer);
        current.seconds_left = seconds_left(trainer, &current.limits, pace);
        if !current.phase.is_training() {
            // Nothing moves.
            current.rates = (0.0, 0.0);
        }
        if networks {
            current.networks = Networks::capture(trainer)?;
            current.scene = trainer.scene();
        }
        self.publish();
        Ok(())
    }
}
