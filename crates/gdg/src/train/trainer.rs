//! One training run: agent steps and updates, interleaved in an order that depends only on seed and
//! settings.

mod change;
mod graphs;
mod persistence;
mod recorded;

use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::Result;
use super::evaluate::EvaluationJob;
use super::film::Film;
use super::history::{History, Moment, Notes};
use super::registry::Registry;
use super::rollout::{Rollout, Round, RoundResult, StepContext};
use super::run::{Counters, EndReason, Limits, Pace, Run, Tick};
use super::score::Evaluation;
use super::settings::UpdateWhen;
use super::visits::Visits;
use crate::bridge::{BridgeGraph, Candidates, Guide, SearchOutcome};
use crate::env::{EffectWatch, EnvError, Environment, Episodes, Goals, Spec, WorldScene};
use crate::job::{Job, Stopwatch};
use crate::learn::{
    Acting, KnownDistances, LearnError, Learner, Losses, Policy, Profile, Relearning, Replay,
    ReplaySizes, Scratch, Threads, TrainingData, TrainingPhase, phase_time,
};
pub use change::{WorldChange, resets_networks};
use graphs::{BuiltGraph, Graphs};
use persistence::LastGood;
pub use persistence::{About, Recovery, Saved};
use recorded::Data;
pub use recorded::LeftOut;

/// Losses are reported as running means over about this many updates.
pub(crate) const LOSS_AVERAGE_UPDATES: f64 = 500.0;

/// Random streams of a run, one per purpose, so that they do not affect each other.
#[derive(Clone, Copy)]
enum RandomStream {
    Initial = 0,
    Explore = 1,
    Batch = 2,
    Evaluate = 3,
    Graph = 4,
    Data = 5,
}

/// A change of the world to come.
pub struct Edit {
    /// Number of updates after which to apply it.
    pub updates: u64,
    pub world: Box<dyn Environment>,
}

pub struct Trainer {
    run: Run,
    registry: Arc<Registry>,
    rollout: Rollout,
    visits: Visits,
    learner: Box<dyn Learner>,
    replay: Replay,
    data: Option<Data>,
    batch_rng: ChaCha8Rng,
    candidates: Candidates,
    graphs: Graphs,
    counters: Counters,
    seconds: f64,
    profile: Profile,
    threads: Threads,
    history: History,
    film: Film,
    /// The networks to roll back to when numbers are no longer finite, and the latest rollback.
    last_good: LastGood,
    recovery: Option<Recovery>,
    /// Whether an update is in progress: a panic during it leaves the networks partially updated.
    in_update: bool,
    /// Changes of the world to come.
    pub edits: Vec<Edit>,
    /// Counters and seconds at the first update in this process, or with these settings, and then at
    /// the first one with a bridge graph if the run needs one: whether no graph is still to come.
    paced_from: Option<(Counters, f64, bool)>,
    effect_watch: EffectWatch,
    /// What users should know and have not been told yet.
    warnings: Vec<String>,
    job: Job,
}

fn stream(seed: u64, stream: RandomStream) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream as u64);
    rng
}

fn new_learner(
    run: &Run,
    spec: &Spec,
    registry: &Registry,
    threads: Threads,
) -> Result<Box<dyn Learner>> {
    let kind = registry.learner(&run.method.learner)?;
    Ok((kind.create)(
        spec,
        &run.settings.learn,
        threads,
        &mut stream(run.seed, RandomStream::Initial),
    )?)
}

fn fork_world(run: &Run, world: &dyn Environment) -> Result<Box<dyn Environment>> {
    let has_task = || world.abilities().episodes.and_then(Episodes::default_task).is_some();
    if run.settings.train.goals == Goals::Map && !has_task() {
        let (title, lacks) = (world.title(), "has no start S from which a goal G can be reached");
        return Err(EnvError::Unfit(format!("{title} {lacks}, which goals=map requires")).into());
    }
    let mut world = world.fork(run.settings.train.agents)?;
    world.configure(&run.settings.train.env());
    Ok(world)
}

fn new_rollout(run: &Run, world: &dyn Environment) -> Result<Rollout> {
    Ok(Rollout::new(fork_world(run, world)?, stream(run.seed, RandomStream::Explore))?)
}

fn new_candidates(run: &Run, spec: &Spec) -> Candidates {
    Candidates::new(spec, run.settings.train.agents, &run.bridge())
}

impl Trainer {
    /// Creates a new run in `world`. `threads` share the work of each update without changing its
    /// result.
    pub fn new(
        run: Run,
        world: &dyn Environment,
        registry: &Arc<Registry>,
        threads: impl Into<Threads>,
    ) -> Result<Self> {
        let threads = threads.into();
        let (rollout, spec) = (new_rollout(&run, world)?, world.spec());
        let learner = new_learner(&run, spec, registry, threads)?;
        Ok(Self {
            visits: Visits::none(world),
            rollout,
            replay: Replay::new(
                ReplaySizes::of(spec),
                run.settings.train.agents,
                run.settings.learn.buffer_size,
            ),
            data: None,
            batch_rng: stream(run.seed, RandomStream::Batch),
            candidates: new_candidates(&run, spec),
            graphs: Graphs::default(),
            counters: Counters::default(),
            seconds: 0.0,
            profile: Profile::default(),
            threads,
            history: History::default(),
            film: Film::default(),
            last_good: LastGood::capture(0, [0.0; 3], &*learner)?,
            recovery: None,
            in_update: false,
            edits: Vec::new(),
            paced_from: None,
            effect_watch: EffectWatch::default(),
            warnings: Vec::new(),
            job: Job::default(),
            learner,
            registry: registry.clone(),
            run,
        })
    }

    /// Returns how many threads share the work of an update.
    pub fn threads(&self) -> Threads {
        self.threads
    }

    /// Returns the progress signal, which also carries the request to stop.
    pub fn job(&self) -> &Job {
        &self.job
    }

    /// Shares a job with those that wait for the trainer.
    pub fn set_job(&mut self, job: Job) {
        self.rollout.env.share_job(&job);
        self.job = job;
    }

    pub fn run(&self) -> &Run {
        &self.run
    }

    pub fn registry(&self) -> &Arc<Registry> {
        &self.registry
    }

    pub fn world(&self) -> &dyn Environment {
        self.rollout.env()
    }

    pub fn scene(&self) -> WorldScene {
        self.visits.scene(self.world())
    }

    /// Returns the share of the agents' latest steps in which the achieved goal has moved; `None` where
    /// the goal is the whole state.
    pub fn goal_moved(&self) -> Option<f64> {
        self.rollout.excursions().goal_share().filter(|_| self.acts())
    }

    pub fn coverage(&self) -> Option<f64> {
        self.visits.coverage(self.world())
    }

    /// Returns the world mutably, to change its evaluation tasks.
    pub fn world_mut(&mut self) -> &mut dyn Environment {
        &mut *self.rollout.env
    }

    pub fn spec(&self) -> &Spec {
        self.world().spec()
    }

    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Returns the training time so far, in seconds, without evaluation.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    pub fn losses(&self) -> Losses {
        let [critic, model, actor] = self.counters.losses.map(|l| l as f32);
        Losses { critic, model, actor, model_steps: 0.0 }
    }

    pub fn rollout(&self) -> &Rollout {
        &self.rollout
    }

    pub fn learner(&self) -> &dyn Learner {
        &*self.learner
    }

    /// Returns whether the learner learns: if not, updates are counted as they fall due, but not
    /// done.
    pub fn learns(&self) -> bool {
        self.learner.acting() != Acting::AtRandom
    }

    /// Returns the updates done by a learner, without those only counted (see [`Self::learns`]).
    pub fn learned_updates(&self) -> u64 {
        self.history.methods().learned(self.counters.updates, self.learns())
    }

    pub fn replay(&self) -> &Replay {
        &self.replay
    }

    pub fn candidates(&self) -> &Candidates {
        &self.candidates
    }

    /// Returns the bridge graph that agents plan on, once there is one.
    pub fn graph(&self) -> Option<&BridgeGraph> {
        self.graphs.current.as_ref().map(|built| &*built.graph)
    }

    pub(crate) fn last_search(&self) -> Option<&Arc<SearchOutcome>> {
        self.rollout.last_search.as_ref()
    }

    pub fn limit_reached(&self, limits: &Limits) -> Option<EndReason> {
        let steps_done = |n| self.counters.env_steps >= n && !self.is_update_due();
        let reached = [
            (limits.updates.is_some_and(|n| self.counters.updates >= n), EndReason::MaxUpdates),
            (limits.episodes.is_some_and(|n| self.counters.episodes >= n), EndReason::MaxEpisodes),
            (limits.seconds.is_some_and(|s| self.seconds >= s), EndReason::MaxSeconds),
            (limits.env_steps.is_some_and(steps_done), EndReason::MaxSteps),
        ];
        reached.iter().find(|(is, _)| *is).map(|(_, reason)| *reason)
    }

    pub fn pace(&self) -> Pace {
        let now = (self.counters, self.seconds);
        let from = self.paced_from.map_or(now, |(counters, seconds, _)| (counters, seconds));
        Pace { from, now, first_graph_at: self.first_graph_at() }
    }

    /// Runs one update if one is due, else one step of every agent; both if the world computes its
    /// steps elsewhere and an update is due afterwards, which then does not see the outcome of the
    /// step.
    /// Where it fails, the run can be saved.
    pub fn tick(&mut self) -> Result<Tick> {
        let (began, phase_began) = (Stopwatch::start(), phase_time());
        self.job.beat();
        self.check_data()?;
        self.begin_to_act();
        let tick = if self.is_update_due() { self.update_meanwhile()? } else { self.step()? };
        if tick == Tick::Step {
            let planning = std::mem::take(&mut self.rollout.planning);
            self.profile.add(TrainingPhase::Plans, planning);
            let exploring = phase_time().saturating_sub(phase_began + planning);
            self.profile.add(TrainingPhase::Explore, exploring);
        }
        self.seconds += began.elapsed().as_secs_f64();
        if tick == Tick::Update {
            let is_steady = self.first_graph_at().is_none();
            if self.paced_from.is_none_or(|(.., was_steady)| is_steady && !was_steady) {
                self.paced_from = Some((self.counters, self.seconds, is_steady));
            }
        }
        Ok(tick)
    }

    pub(crate) fn is_update_due(&self) -> bool {
        // Without a warm-up, an update can be due before any agent's second state is known.
        let owed = self.counters.owed_steps >= self.run.settings.train.env_steps_per_update;
        (owed || !self.acts()) && self.replay.has_transitions()
    }

    fn step(&mut self) -> Result<Tick> {
        let Some(elsewhere) = self.with_step_context(Rollout::begin)?? else {
            self.roll_back()?;
            return Ok(Tick::Step);
        };
        // Not during the warm-up.
        let learns = self.data.is_some()
            || self.counters.env_steps + self.round_steps()
                > self.run.settings.train.learning_starts;
        let owed = self.counters.owed_steps + self.counters.deferred_steps + self.round_steps();
        let due = learns
            && self.run.settings.train.update_when == UpdateWhen::Step
            && owed >= self.run.settings.train.env_steps_per_update
            && self.replay.has_transitions();
        if elsewhere && due {
            (self.counters.owed_steps, self.counters.deferred_steps) = (owed, 0);
            return self.update_meanwhile();
        }
        let round = self.finish_step()?;
        if learns {
            let counters = &mut self.counters;
            counters.deferred_steps += self.run.settings.train.agents as u64;
            if self.run.settings.train.update_when == UpdateWhen::Step || round.episodes > 0 {
                counters.owed_steps += std::mem::take(&mut counters.deferred_steps);
            }
        }
        Ok(Tick::Step)
    }

    fn round_steps(&self) -> u64 {
        self.run.settings.train.agents as u64
    }

    /// Runs an update while the world computes a round of steps, if it has begun one.
    fn update_meanwhile(&mut self) -> Result<Tick> {
        let updated = self.update();
        // Whatever has become of the update, nothing can be asked of the world before its step ends.
        let waited = self.wait_for_world();
        updated?;
        waited?;
        if self.rollout.round.is_some() {
            self.finish_step()?;
        }
        self.film_learning()?;
        Ok(Tick::Update)
    }

    fn wait_for_world(&mut self) -> Result<()> {
        if self.rollout.round.is_none() {
            return Ok(());
        }
        // Those in other processes may take long, or hang.
        let _activity = self.job.part("waiting for the environment");
        Ok(self.rollout.wait()?)
    }

    fn finish_step(&mut self) -> Result<RoundResult> {
        self.wait_for_world()?;
        if let Some(Round { before, actions, .. }) = &self.rollout.round {
            let (world, steps) = (&*self.rollout.env, self.counters.env_steps);
            self.warnings.extend(self.effect_watch.note(world, (before, actions), steps));
        }
        let round = self.with_step_context(Rollout::finish)?;
        if self.candidates.others() != self.told_apart_by() {
            self.tell_more_apart()?;
        }
        let round = round?;
        self.visits.add(self.rollout.env(), self.rollout.env().states());
        self.counters.env_steps += self.round_steps();
        self.counters.episodes += round.episodes;
        self.counters.goals_reached += round.reached;
        self.rescale(self.counters.env_steps - self.round_steps())?;
        Ok(round)
    }

    pub fn episode_steps(&self) -> u32 {
        let settings = &self.run.settings;
        let own = self.world().abilities().episodes.and_then(Episodes::episode_steps);
        match (settings.train.episode_steps.given(), own) {
            (None, Some(of_world)) => of_world,
            _ => settings.episode_steps(
                self.graphs.current.as_ref().map_or(0.0, |built| built.longest_steps),
            ),
        }
    }

    fn with_step_context<R>(
        &mut self,
        mut act: impl FnMut(&mut Rollout, &mut StepContext) -> R,
    ) -> Result<R> {
        let episode_steps = self.episode_steps();
        let Self { rollout, learner, replay, candidates, run, graphs, .. } = self;
        let graph = graphs.current.as_ref().map(|built| &*built.graph);
        let (acting, settings) = (learner.acting(), &run.settings);
        let mut done = None;
        learner.with_policy(false, &mut |policy| {
            let mut context = StepContext {
                bridges: run.method.bridges(),
                acting,
                episode_steps,
                settings,
                guide: Guide { policy, graph },
                replay,
                candidates,
                result: RoundResult::default(),
            };
            done = Some(act(rollout, &mut context));
        })?;
        done.ok_or_else(|| LearnError::Other("the learner has shown no policy".into()).into())
    }

    fn update(&mut self) -> Result<()> {
        // With data, updates are due without steps.
        let steps = self.run.settings.train.env_steps_per_update;
        self.counters.owed_steps = self.counters.owed_steps.saturating_sub(steps);
        self.counters.updates += 1;
        if !self.learns() {
            return Ok(());
        }
        let began = phase_time();
        self.refresh_graph()?;
        self.profile.lap(TrainingPhase::Graph, began);
        let (relearns, graph_finds_changed) = (self.relearns(), self.needs_graph());
        let Self { learner, replay, graphs, batch_rng, profile, job, .. } = self;
        let known =
            graphs.current.as_ref().and_then(|BuiltGraph { graph, distilled, changed, .. }| {
                Some(KnownDistances {
                    states: graph.candidates().states(),
                    goals: graph.candidates().goal_index(),
                    by_goal: distilled.as_deref()?,
                    changed: changed.as_deref().filter(|_| relearns),
                })
            });
        let agents = self.run.settings.train.agents as u64;
        let recent_slots =
            self.counters.env_steps.saturating_sub(self.counters.changed_at_step) / agents;
        let relearning = relearns.then_some(Relearning { recent_slots, graph_finds_changed });
        self.in_update = true;
        let data = TrainingData { replay, known, relearning, rng: batch_rng, job };
        let losses = learner.update(data, profile)?;
        self.in_update = false;
        let keep = (1.0 - 1.0 / LOSS_AVERAGE_UPDATES).min(1.0 - 1.0 / self.counters.updates as f64);
        for (mean, loss) in
            self.counters.losses.iter_mut().zip([losses.critic, losses.model, losses.actor])
        {
            *mean += (1.0 - keep) * (f64::from(loss) - *mean);
        }
        self.check_update(&losses)?;
        let Self { history, rollout, visits, counters, .. } = self;
        history.add_point(counters.updates, counters.losses, || visits.coverage(rollout.env()));
        Ok(())
    }

    /// Takes a frame of the film if one is due. Draws no random numbers.
    fn film_learning(&mut self) -> Result<()> {
        let updates = self.counters.updates;
        if !self.learns() || !self.film.is_due(updates) {
            return Ok(());
        }
        let Self { film, learner, rollout, counters, run, .. } = self;
        let Some(points) = film.points(rollout.env()) else { return Ok(()) };
        let mut distances = vec![0.0; points.place_of.len()];
        // The scratch memory of a few frames a minute need not be kept.
        learner.with_policy(run.settings.bridge.averaged_weights, &mut |policy| {
            let goals = points.goal.repeat(distances.len());
            policy.distances(&points.states, &goals, &mut distances, &mut Scratch::default());
        })?;
        film.add([updates, counters.env_steps], rollout.env(), &points, &distances);
        Ok(())
    }

    /// Returns a frozen copy of the networks for planning and evaluation.
    pub fn policy(&self) -> Result<Arc<dyn Policy>> {
        Ok(self.learner.policy(self.run.settings.bridge.averaged_weights)?)
    }

    fn evaluation_rng(&self, purpose: u64) -> ChaCha8Rng {
        let mut rng = stream(self.run.seed, RandomStream::Evaluate);
        // Each evaluation and purpose gets its own 2^34 words of the stream.
        rng.set_word_pos(u128::from(2 * self.counters.updates + purpose) << 34);
        rng
    }

    /// Prepares an evaluation of the current state, which does not affect training.
    pub fn evaluation(&self) -> Result<EvaluationJob> {
        Ok(EvaluationJob {
            world: self.world().fork(0)?,
            policy: self.policy()?,
            acting: self.learner.acting(),
            candidates: self.run.method.plans().then(|| self.candidates.frozen()),
            coverage: self.coverage(),
            max_steps: None,
            task_rng: self.evaluation_rng(1),
            rng: self.evaluation_rng(0),
        })
    }

    pub fn history(&self) -> &History {
        &self.history
    }

    pub fn film(&self) -> &Film {
        &self.film
    }

    pub fn moment(&self) -> Moment {
        let Counters { updates, env_steps, .. } = self.counters;
        Moment { updates, env_steps, seconds: self.seconds }
    }

    pub fn record_evaluation(&mut self, made: Moment, evaluation: Evaluation) {
        self.history.add_evaluation(made, evaluation);
    }

    pub fn set_notes(&mut self, notes: Notes) {
        self.history.notes = notes;
    }
}
