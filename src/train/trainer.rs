//! One training run: agents and updates in lockstep, in an order that depends on nothing but seed and settings.

mod change;
mod recovery;

use std::sync::Arc;
use std::time::Instant;

use candle_core::Result;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::evaluate::{Evaluation, EvaluationJob};
use super::graphs::{Built, GraphJob, Graphs, StoredGraph};
use super::history::History;
use super::method::Method;
use super::rollout::{Rollout, RolloutState, Surroundings};
use super::run::{Counters, EndReason, Limits, Run, Tick};
use super::settings::{Restart, Settings, TrainSettings, UpdateWhen};
use super::tasks::TaskSet;
use crate::bridge::{Experience, SearchOutcome};
use crate::env::{Environment, PointMaze, Spec};
use crate::learn::{Batch, BatchSampler, Learner, Losses, Phase, Policy, Profile, Replay};
use crate::map::{Cell, Grid};
pub use change::{Kept, MapChange};
use recovery::LastGood;
pub use recovery::Recovery;

/// Losses are reported as running means over about this many updates.
const LOSS_MEMORY_UPDATES: f64 = 500.0;

/// Random streams of a run, one for each purpose, so that none disturbs another.
#[derive(Clone, Copy)]
enum Stream {
    Initial = 0,
    Explore = 1,
    Batch = 2,
    Evaluate = 3,
    Graph = 4,
}

/// What a checkpoint holds of a trainer besides networks, replay and candidates.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct TrainerState {
    /// How far it has come.
    pub counters: Counters,
    /// Training time so far, in seconds.
    pub seconds: f64,
    /// Agents and their random state.
    pub rollout: RolloutState,
    /// The random state of batches.
    pub batch_rng: ChaCha8Rng,
}

/// A run in progress.
pub struct Trainer {
    run: Run,
    map: Arc<Grid>,
    world: PointMaze,
    rollout: Rollout<PointMaze>,
    learner: Learner,
    replay: Replay,
    sampler: BatchSampler,
    batch: Batch,
    batch_rng: ChaCha8Rng,
    experience: Experience,
    graphs: Graphs,
    /// How often an agent was in each cell, row-major.
    visited: Vec<u32>,
    counters: Counters,
    seconds: f64,
    profile: Profile,
    threads: usize,
    history: History,
    /// The networks to go back to when numbers are no longer finite, and the latest way back.
    last_good: LastGood,
    recovery: Option<Recovery>,
    /// Whether an update is under way: one that a panic ended has left the networks half stepped.
    in_update: bool,
}

fn stream(seed: u64, stream: Stream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream as u64);
    rng
}

/// The agents' world on `map`.
fn world_on(map: &Arc<Grid>, train: &TrainSettings) -> PointMaze {
    let world = PointMaze::new(map.clone(), train.agents, train.env_noise);
    match train.restart {
        Restart::Anywhere => world,
        Restart::StartCell => world.from_starts(),
    }
}

impl Trainer {
    /// A run on `map` that has not begun; `threads` share the work of each update, without changing its result.
    ///
    /// # Errors
    /// What candle reports, or that the threads could not be started.
    pub fn new(run: Run, map: Arc<Grid>, threads: usize) -> Result<Self> {
        let settings = &run.settings;
        let world = world_on(&map, &settings.train);
        let spec = world.spec().clone();
        let learner = Learner::new(&spec, &settings.learn, threads, &mut stream(run.seed, Stream::Initial))?;
        let sizes = (spec.state_dim(), spec.goal_dim(), spec.action_dim);
        Ok(Self {
            rollout: Rollout::new(world.clone(), stream(run.seed, Stream::Explore)),
            replay: Replay::new(sizes.into(), settings.train.agents, settings.learn.replay_capacity),
            sampler: BatchSampler::new(&spec, &settings.learn),
            batch: Batch::default(),
            batch_rng: stream(run.seed, Stream::Batch),
            experience: Experience::new(&spec, settings.train.agents, &settings.bridge),
            graphs: Graphs::default(),
            visited: vec![0; map.free().len()],
            counters: Counters::default(),
            seconds: 0.0,
            profile: Profile::default(),
            threads,
            history: History::default(),
            last_good: LastGood::of(0, [0.0; 3], learner.state()?),
            recovery: None,
            in_update: false,
            learner,
            world,
            map,
            run,
        })
    }

    /// Threads that share an update's work.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// What is run.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// The map.
    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// What states, goals and actions are.
    pub fn spec(&self) -> &Spec {
        self.world.spec()
    }

    /// How far it has come.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Training time so far, in seconds; evaluation is not counted.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// Where the time of this process has gone.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Running means of the losses.
    pub fn losses(&self) -> Losses {
        let [critic, model, actor] = self.counters.losses.map(|l| l as f32);
        Losses { critic, model, actor }
    }

    /// The agents.
    pub fn rollout(&self) -> &Rollout<PointMaze> {
        &self.rollout
    }

    /// The networks.
    pub fn learner(&self) -> &Learner {
        &self.learner
    }

    /// The replay.
    pub fn replay(&self) -> &Replay {
        &self.replay
    }

    /// Bridge candidates and what was seen between them.
    pub fn experience(&self) -> &Experience {
        &self.experience
    }

    /// The latest bridge search.
    pub fn last_search(&self) -> Option<&Arc<SearchOutcome>> {
        self.rollout.last_search()
    }

    /// The first of `limits` that has been reached.
    pub fn limit_reached(&self, limits: &Limits) -> Option<EndReason> {
        let reached = [
            (limits.updates.is_some_and(|n| self.counters.updates >= n), EndReason::MaxUpdates),
            (limits.episodes.is_some_and(|n| self.counters.episodes >= n), EndReason::MaxEpisodes),
            (limits.seconds.is_some_and(|s| self.seconds >= s), EndReason::MaxSeconds),
        ];
        reached.iter().find(|(is, _)| *is).map(|(_, reason)| *reason)
    }

    /// One update if one is due, else one step of every agent.
    ///
    /// # Errors
    /// What candle reports.
    pub fn tick(&mut self) -> Result<Tick> {
        let began = Instant::now();
        // Without a warm-up an update can be due before any agent's second state is known.
        let due = self.counters.owed >= self.run.settings.train.env_steps_per_update && self.replay.has_transitions();
        let tick = if due { self.update()? } else { self.step()? };
        if tick == Tick::Step {
            self.profile.lap(Phase::Explore, began);
        }
        self.seconds += began.elapsed().as_secs_f64();
        Ok(tick)
    }

    fn step(&mut self) -> Result<Tick> {
        let Some(round) = self.with_surroundings(Rollout::step)? else {
            self.go_back()?;
            return Ok(Tick::Step);
        };
        for at in self.rollout.env().states().chunks_exact(2) {
            let cell = self.map.index(Cell::new(at[0] as usize, at[1] as usize));
            self.visited[cell] = self.visited[cell].saturating_add(1);
        }
        let steps = self.run.settings.train.agents as u64;
        let counters = &mut self.counters;
        counters.env_steps += steps;
        counters.episodes += round.episodes;
        counters.goals_reached += round.reached;
        if counters.env_steps <= self.run.settings.train.warmup_env_steps {
            return Ok(Tick::Step);
        }
        counters.waiting += steps;
        if self.run.settings.train.update_when == UpdateWhen::Step || round.episodes > 0 {
            counters.owed += std::mem::take(&mut counters.waiting);
        }
        Ok(Tick::Step)
    }

    /// Lets the agents do something with what surrounds them.
    fn with_surroundings<R>(&mut self, act: impl FnOnce(&mut Rollout<PointMaze>, &mut Surroundings) -> R) -> Result<R> {
        let Self { rollout, learner, replay, experience, run, graphs, .. } = self;
        let graph = graphs.current().map(|built| &*built.graph);
        learner.with_nets(false, |nets| {
            let (method, settings) = (run.method, &run.settings);
            act(rollout, &mut Surroundings { method, settings, nets: &nets, graph, replay, experience })
        })
    }

    fn update(&mut self) -> Result<Tick> {
        self.counters.owed -= self.run.settings.train.env_steps_per_update;
        self.counters.updates += 1;
        if self.run.method == Method::Random {
            return Ok(Tick::Update);
        }
        let began = Instant::now();
        self.renew_graph()?;
        let began = self.profile.lap(Phase::Graph, began);
        let grown = self.counters.updates <= self.counters.relearns_until;
        self.sampler.sample(&self.replay, grown, &mut self.batch_rng, &mut self.batch);
        self.distil_into_batch();
        self.profile.lap(Phase::Sample, began);
        self.in_update = true;
        let losses = self.learner.update(&self.batch, &mut self.profile)?;
        self.in_update = false;
        let keep = (1.0 - 1.0 / LOSS_MEMORY_UPDATES).min(1.0 - 1.0 / self.counters.updates as f64);
        for (mean, loss) in self.counters.losses.iter_mut().zip([losses.critic, losses.model, losses.actor]) {
            *mean += (1.0 - keep) * (f64::from(loss) - *mean);
        }
        self.check_update(&losses)?;
        self.history.add_losses(self.counters.updates, self.counters.losses);
        Ok(Tick::Update)
    }

    /// Takes up the bridge graph that counts from now on, and begins to build the next one where that is due.
    fn renew_graph(&mut self) -> Result<()> {
        let Settings { learn, bridge, .. } = &self.run.settings;
        let wanted = learn.distillation > 0.0 || bridge.planned_episodes > 0.0 || bridge.frontier_epsilon > 0.0;
        if !wanted || !self.run.method.bridges() {
            return Ok(());
        }
        let (now, every) = (self.counters.updates, bridge.graph_every_updates);
        if self.graphs.take_up(now) {
            self.with_surroundings(|rollout, around| rollout.plan_anew(around))?;
        }
        if now.is_multiple_of(every) {
            let job = GraphJob {
                spec: self.spec().clone(),
                settings: self.run.bridge(),
                policy: self.policy()?,
                experience: self.experience.known(),
                rng: self.graph_rng(now),
            };
            self.graphs.begin(now, every, job)?;
        }
        Ok(())
    }

    /// Draws what a graph whose build began at update `at` distils.
    fn graph_rng(&self, at: u64) -> ChaCha8Rng {
        let mut rng = stream(self.run.seed, Stream::Graph);
        rng.set_word_pos(u128::from(at) << 34);
        rng
    }

    /// Replaces a share of the batch by pairs of candidates with their graph distance.
    fn distil_into_batch(&mut self) {
        let share = self.run.settings.learn.distillation;
        let Some(Built { graph, distilled, .. }) = self.graphs.current().filter(|_| share > 0.0) else { return };
        if distilled.pairs.is_empty() {
            return;
        }
        let count = (share * self.batch.len() as f32).round() as usize;
        for i in 0..count {
            let (from, to, steps) = distilled.pairs[self.batch_rng.random_range(0..distilled.pairs.len())];
            self.batch.set_known(i, graph.candidate(from as usize), graph.point(to as usize), steps);
        }
    }

    /// How often an agent was in each cell, row-major.
    pub fn visited(&self) -> &[u32] {
        &self.visited
    }

    /// A frozen copy of the networks, as planning and evaluation use them.
    ///
    /// # Errors
    /// What candle reports.
    pub fn policy(&self) -> Result<Policy> {
        self.learner.policy(self.run.settings.bridge.averaged_weights)
    }

    /// Random tasks for an evaluation at this moment: the same ones however often was evaluated before.
    pub fn tasks(&self, diameter: u32, per_distance: usize) -> TaskSet {
        TaskSet::sample(&self.map, diameter, per_distance, &mut self.task_rng())
    }

    /// The random numbers that [`Self::tasks`] draws by.
    pub fn task_rng(&self) -> ChaCha8Rng {
        self.evaluation_rng(1)
    }

    fn evaluation_rng(&self, purpose: u64) -> ChaCha8Rng {
        let mut rng = stream(self.run.seed, Stream::Evaluate);
        // A piece of 2^34 words of the stream for each evaluation and purpose.
        rng.set_word_pos(u128::from(2 * self.counters.updates + purpose) << 34);
        rng
    }

    /// An evaluation of this moment; the training goes on as if it had not happened.
    ///
    /// # Errors
    /// What candle reports.
    pub fn evaluation(&self) -> Result<EvaluationJob> {
        Ok(EvaluationJob {
            run: self.run.clone(),
            world: self.world.clone(),
            policy: self.policy()?,
            experience: self.run.method.plans().then(|| self.experience.known()),
            visited: self.visited.clone(),
            rng: self.evaluation_rng(0),
        })
    }

    /// Evaluates against the truth.
    ///
    /// # Errors
    /// What candle reports.
    pub fn evaluate(&self, tasks: &TaskSet) -> Result<Evaluation> {
        Ok(self.evaluation()?.carry_out(tasks))
    }

    /// Curves, evaluations, and what happened.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The same, to be added to.
    pub fn history_mut(&mut self) -> &mut History {
        &mut self.history
    }

    /// What a checkpoint holds besides networks, replay and candidates.
    pub fn state(&self) -> TrainerState {
        TrainerState {
            counters: self.counters,
            seconds: self.seconds,
            rollout: self.rollout.state(),
            batch_rng: self.batch_rng.clone(),
        }
    }

    /// The bridge graphs, for a checkpoint.
    pub fn graph_state(&self) -> [Option<StoredGraph>; 2] {
        self.graphs.state()
    }

    /// Takes up a state; the networks, replay and candidates come through their own parts.
    ///
    /// # Errors
    /// Where it was not saved from such a run.
    pub fn restore(
        &mut self,
        state: TrainerState,
        graphs: &[Option<StoredGraph>; 2],
        visited: Vec<u32>,
        history: History,
    ) -> std::result::Result<(), String> {
        if visited.len() != self.visited.len() {
            return Err("the stored visits do not fit the map".to_owned());
        }
        history.check()?;
        state.counters.check()?;
        if !(0.0..1e12).contains(&state.seconds) {
            return Err("the stored training time is out of range".to_owned());
        }
        let mut restored = Graphs::default();
        restored.restore(self.spec(), &self.run.bridge(), graphs, |at| self.graph_rng(at))?;
        self.graphs = restored;
        self.rollout.restore(state.rollout, self.graphs.current().map(|built| &*built.graph))?;
        self.visited = visited;
        self.counters = state.counters;
        self.seconds = state.seconds;
        self.batch_rng = state.batch_rng;
        self.history = history;
        let good = self.learner.state().map_err(|e| e.to_string())?;
        if !good.is_finite() {
            return Err("its networks hold numbers that are not finite: the run had diverged".to_owned());
        }
        self.last_good = LastGood::of(self.counters.updates, self.counters.losses, good);
        Ok(())
    }

    /// The networks, to restore them.
    pub fn learner_mut(&mut self) -> &mut Learner {
        &mut self.learner
    }

    /// The replay, to restore it.
    pub fn replay_mut(&mut self) -> &mut Replay {
        &mut self.replay
    }

    /// The candidates, to restore them.
    pub fn experience_mut(&mut self) -> &mut Experience {
        &mut self.experience
    }
}
