//! One training run: agents and updates in lockstep, in an order that depends on nothing but seed and settings.

mod change;
mod recovery;

use std::sync::Arc;
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::error::TrainError;
use super::evaluate::{Evaluation, EvaluationJob};
use super::graphs::{Built, GraphJob, Graphs, StoredGraph};
use super::history::History;
use super::memory;
use super::registry::Registry;
use super::rollout::{Rollout, RolloutState, StepContext};
use super::run::{Counters, EndReason, Limits, Run, Tick};
use super::settings::reference::Setting;
use super::settings::{Settings, UpdateWhen};
use crate::bridge::{Candidates, CandidatesState, SearchOutcome};
use crate::env::{Environment, Spec, TaskSet};
use crate::learn::{
    Acting, KnownDistances, Learner, Losses, OutOfRange, Policy, Profile, Replay, ReplayState, Stage, TrainingData,
};
use crate::store::{Store, StoreError};
pub use change::{Kept, WorldChange};
use recovery::LastGood;
pub use recovery::Recovery;

/// The names of what a saved run holds: bridge candidates; the bridge graph in use, and the one to come.
const CANDIDATES: &str = "bridge";
const GRAPHS: [&str; 2] = ["graph", "next_graph"];

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
    registry: Arc<Registry>,
    rollout: Rollout,
    learner: Box<dyn Learner>,
    replay: Replay,
    batch_rng: ChaCha8Rng,
    candidates: Candidates,
    graphs: Graphs,
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

type Result<T> = std::result::Result<T, TrainError>;

/// A fresh learner for `run` in a world of `spec`.
fn learner_of(run: &Run, spec: &Spec, registry: &Registry, threads: usize) -> Result<Box<dyn Learner>> {
    let kind = registry.learner(&run.method.learner)?;
    Ok((kind.create)(spec, &run.settings.learn, threads, &mut stream(run.seed, Stream::Initial))?)
}

/// `world` for the agents of `run`.
fn world_of(run: &Run, world: &dyn Environment) -> Box<dyn Environment> {
    let mut world = world.fork(run.settings.train.agents);
    world.configure(&run.settings.train.env());
    world
}

fn replay_of(run: &Run, spec: &Spec) -> Replay {
    let sizes = (spec.state_dim(), spec.goal_dim(), spec.action_dim);
    Replay::new(sizes.into(), run.settings.train.agents, run.settings.learn.buffer_size)
}

impl Trainer {
    /// A run in `world` that has not begun; `threads` share the work of each update, without changing its result.
    ///
    /// # Errors
    /// That the method's learner is not in the registry, or what making it reports.
    pub fn new(run: Run, world: &dyn Environment, registry: &Arc<Registry>, threads: usize) -> Result<Self> {
        let (world, spec) = (world_of(&run, world), world.spec());
        let learner = learner_of(&run, spec, registry, threads)?;
        Ok(Self {
            rollout: Rollout::new(world, stream(run.seed, Stream::Explore)),
            replay: replay_of(&run, spec),
            batch_rng: stream(run.seed, Stream::Batch),
            candidates: Candidates::new(spec, run.settings.train.agents, &run.settings.bridge),
            graphs: Graphs::default(),
            counters: Counters::default(),
            seconds: 0.0,
            profile: Profile::default(),
            threads,
            history: History::default(),
            last_good: LastGood::of(0, [0.0; 3], &*learner)?,
            recovery: None,
            in_update: false,
            learner,
            registry: registry.clone(),
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

    /// The worlds and learners that the run may be changed to.
    pub fn registry(&self) -> &Arc<Registry> {
        &self.registry
    }

    /// The world with the agents that explore it.
    pub fn world(&self) -> &dyn Environment {
        self.rollout.env()
    }

    /// The same, to change what evaluation asks of it.
    pub fn world_mut(&mut self) -> &mut dyn Environment {
        self.rollout.env_mut()
    }

    /// What states, goals and actions are.
    pub fn spec(&self) -> &Spec {
        self.world().spec()
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
    pub fn rollout(&self) -> &Rollout {
        &self.rollout
    }

    /// The learner.
    pub fn learner(&self) -> &dyn Learner {
        &*self.learner
    }

    /// The replay.
    pub fn replay(&self) -> &Replay {
        &self.replay
    }

    /// Bridge candidates and what was seen between them.
    pub fn candidates(&self) -> &Candidates {
        &self.candidates
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
    /// What the learner reports, or that the run has diverged for the last time.
    pub fn tick(&mut self) -> Result<Tick> {
        let began = Instant::now();
        // Without a warm-up an update can be due before any agent's second state is known.
        let due = self.counters.owed >= self.run.settings.train.env_steps_per_update && self.replay.has_transitions();
        let tick = if due { self.update()? } else { self.step()? };
        if tick == Tick::Step {
            self.profile.lap(Stage::Explore, began);
        }
        self.seconds += began.elapsed().as_secs_f64();
        Ok(tick)
    }

    fn step(&mut self) -> Result<Tick> {
        let Some(round) = self.with_step_context(Rollout::step)? else {
            self.go_back()?;
            return Ok(Tick::Step);
        };
        self.rollout.env_mut().count_visits();
        let steps = self.run.settings.train.agents as u64;
        let counters = &mut self.counters;
        counters.env_steps += steps;
        counters.episodes += round.episodes;
        counters.goals_reached += round.reached;
        if counters.env_steps <= self.run.settings.train.learning_starts {
            return Ok(Tick::Step);
        }
        counters.waiting += steps;
        if self.run.settings.train.update_when == UpdateWhen::Step || round.episodes > 0 {
            counters.owed += std::mem::take(&mut counters.waiting);
        }
        Ok(Tick::Step)
    }

    /// Lets the agents do something with what surrounds them.
    fn with_step_context<R>(&mut self, act: impl FnOnce(&mut Rollout, &mut StepContext) -> R) -> Result<R> {
        let Self { rollout, learner, replay, candidates, run, graphs, .. } = self;
        let graph = graphs.current().map(|built| &*built.graph);
        let (bridges, acting, settings) = (run.method.bridges(), learner.acting(), &run.settings);
        let (mut act, mut done) = (Some(act), None);
        learner.with_policy(false, &mut |policy| {
            let mut around = StepContext { bridges, acting, settings, policy, graph, replay, candidates };
            done = act.take().map(|act| act(rollout, &mut around));
        })?;
        Ok(done.unwrap_or_else(|| unreachable!("a learner uses what is handed to it once")))
    }

    fn update(&mut self) -> Result<Tick> {
        self.counters.owed -= self.run.settings.train.env_steps_per_update;
        self.counters.updates += 1;
        if self.learner.acting() == Acting::AtRandom {
            return Ok(Tick::Update);
        }
        let began = Instant::now();
        self.renew_graph()?;
        self.profile.lap(Stage::Graph, began);
        let Self { learner, replay, graphs, batch_rng, profile, .. } = self;
        let known = graphs.current().map(|Built { graph, distilled, .. }| KnownDistances {
            states: graph.candidates().states(),
            goals: graph.candidates().points(),
            pairs: &distilled.pairs,
        });
        let relearning = self.counters.updates <= self.counters.relearns_until;
        self.in_update = true;
        let losses = learner.update(TrainingData { replay, known, relearning, rng: batch_rng }, profile)?;
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
            self.with_step_context(|rollout, around| rollout.plan_anew(around))?;
        }
        if now.is_multiple_of(every) {
            let job = GraphJob {
                spec: self.spec().clone(),
                settings: self.run.bridge(),
                policy: self.policy()?,
                candidates: self.candidates.frozen(),
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

    /// A frozen copy of the networks, as planning and evaluation use them.
    ///
    /// # Errors
    /// What the learner reports.
    pub fn policy(&self) -> Result<Arc<dyn Policy>> {
        Ok(self.learner.policy(self.run.settings.bridge.averaged_weights)?)
    }

    /// Tasks for an evaluation at this moment, `per_group` at each distance: the same ones however often was evaluated
    /// before.
    pub fn tasks(&self, per_group: usize) -> TaskSet {
        self.world().tasks(per_group, &mut self.evaluation_rng(1))
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
    /// What the learner reports.
    pub fn evaluation(&self) -> Result<EvaluationJob> {
        Ok(EvaluationJob {
            run: self.run.clone(),
            world: self.world().fork(0),
            policy: self.policy()?,
            acting: self.learner.acting(),
            candidates: self.run.method.plans().then(|| self.candidates.frozen()),
            coverage: self.world().coverage(),
            task_rng: self.evaluation_rng(1),
            rng: self.evaluation_rng(0),
        })
    }

    /// Evaluates against the truth.
    ///
    /// # Errors
    /// What the learner reports.
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

    /// Everything that the run needs to go on as if it had never stopped.
    ///
    /// # Errors
    /// What the learner reports; numbers that are not finite.
    pub fn save(&self) -> Result<Store> {
        let mut store = Store::default();
        self.learner.save(&mut store)?;
        if !store.is_finite() {
            return Err(TrainError::NotFinite);
        }
        self.replay.snapshot().write(&mut store);
        self.candidates.state().write(&mut store, CANDIDATES);
        for (name, graph) in GRAPHS.iter().zip(self.graphs.state()) {
            if let Some(graph) = graph {
                graph.write(&mut store, name);
            }
        }
        store.put_text("world", self.world().kind());
        store.put_text("title", self.world().title());
        self.world().save(&mut store);
        store.put_json("run", &self.run)?;
        store.put_json("trainer", &self.state())?;
        store.put_json("success", &self.history.success())?;
        store.put_json("history", &self.history)?;
        Ok(store)
    }

    /// The run that [`Self::save`] saved.
    ///
    /// # Errors
    /// What of the store is missing, or does not fit; a run that does not fit into memory.
    pub fn load(store: &Store, registry: &Arc<Registry>, threads: usize) -> Result<Self> {
        let run: Run = store.json("run")?;
        let range = |OutOfRange(name)| {
            let right = Setting::named(name).map_or("in its range", |setting| setting.range);
            StoreError::misfit(format!("its setting {name} is not {right}"))
        };
        run.settings.check().map_err(range)?;
        let world = registry.load_world(store)?;
        let state: TrainerState = store.json("trainer")?;
        memory::check(&run, &*world, registry)?;
        let mut trainer = Self::new(run, &*world, registry, threads)?;
        trainer.learner.load(store)?;
        trainer.replay.restore(&ReplayState::read(store)?)?;
        trainer.candidates.restore(&CandidatesState::read(store, CANDIDATES)?)?;
        trainer.rollout.env_mut().restore_statistics(store)?;
        let [current, next] = GRAPHS.map(|name| StoredGraph::read(store, name));
        let graphs = [current?, next?];
        // The first format had none.
        let history = if store.texts().contains_key("history") { store.json("history")? } else { History::default() };
        trainer.restore(state, &graphs, history)?;
        Ok(trainer)
    }

    fn state(&self) -> TrainerState {
        TrainerState {
            counters: self.counters,
            seconds: self.seconds,
            rollout: self.rollout.state(),
            batch_rng: self.batch_rng.clone(),
        }
    }

    fn restore(&mut self, state: TrainerState, graphs: &[Option<StoredGraph>; 2], history: History) -> Result<()> {
        history.check()?;
        state.counters.check()?;
        if !(0.0..1e12).contains(&state.seconds) {
            return Err(StoreError::misfit("the stored training time is out of range").into());
        }
        let mut restored = Graphs::default();
        restored.restore(self.spec(), &self.run.bridge(), graphs, |at| self.graph_rng(at))?;
        self.graphs = restored;
        self.rollout.restore(state.rollout, self.graphs.current().map(|built| &*built.graph))?;
        self.counters = state.counters;
        self.seconds = state.seconds;
        self.batch_rng = state.batch_rng;
        self.history = history;
        self.last_good = LastGood::of(self.counters.updates, self.counters.losses, &*self.learner)?;
        if !self.last_good.is_finite() {
            let what = "its networks hold numbers that are not finite: the run had diverged";
            return Err(StoreError::misfit(what).into());
        }
        Ok(())
    }
}
