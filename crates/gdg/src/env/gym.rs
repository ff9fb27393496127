//! Any Gymnasium environment with continuous actions and goals, in a Python process of its own.
//!
//! A `process` steps several environments and exchanges one message a step with the program
//! (`frames`); what the learner needs is found out once (`facts`). Environments are reset with
//! seeds from the run's random numbers, so that the same seed gives the same run wherever the
//! environment itself is deterministic.

mod abilities;
mod description;
mod facts;
mod frames;
mod options;
mod pool;
#[cfg_attr(not(unix), path = "gym/no_process.rs")]
mod process;
mod slots;

use std::ops::Range;
use std::sync::Arc;

use parking_lot::Mutex;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::{Abilities, EnvError, EnvSettings, Environment, Spec, Walls, WorldKind};
use crate::pulse::Pulse;
use crate::store::{Store, StoreError};
use description::Description;
use facts::Found;
pub use options::{Address, GymOptions};
use pool::Pool;
use process::{Worker, failed};

/// Registry entry of the environments of Gymnasium.
pub const KIND: WorldKind = WorldKind {
    name: "gym",
    about: "a Gymnasium environment with goals, in Python: gym:ID or gym:PACKAGE:ID",
    create: None,
    open: Some(|argument, options| {
        let address = argument.parse().map_err(|why| failed(argument, why, Vec::new()))?;
        Ok(Box::new(Gym::open(&address, options)?))
    }),
    load: |store, options| Ok(Box::new(Gym::load(store, options)?)),
    // Steps are slow, so each is worth an update, as of the arm.
    defaults: &["agents=8", "learning_starts=500", "env_steps_per_update=1", "near_goals=0"],
};

/// Name in the store.
const STORED: &str = "gym";

/// Tasks of an evaluation that run at once: each takes an environment.
const TASKS_AT_ONCE: usize = 16;

/// Largest answer with full states.
const MAX_STATE_BYTES: usize = 64 << 20;

/// What follows the state in a full state: bytes that restore it, or a seed and a task to begin
/// with. A full state without either is only a state, which no environment can be put into. Earlier
/// versions wrote 1 before numbers of another form.
const RESTORED: f64 = 3.0;
const SEEDED: f64 = 2.0;

/// Tasks count from 1.
const NO_TASK: f64 = 0.0;

/// What a checkpoint keeps of a world: no path of an interpreter, which belongs to a machine.
#[derive(Serialize, Deserialize)]
struct Stored {
    address: Address,
    found: Found,
    /// What the environment says of itself, and the length of full states; earlier checkpoints do
    /// not have it.
    #[serde(default)]
    about: Option<(Description, usize)>,
}

/// Agents in environments of Gymnasium.
pub struct Gym {
    pool: Arc<Pool>,
    noise: f32,
    /// Workers, and the agents in the environments of each.
    workers: Mutex<Vec<(Worker, Range<usize>)>>,
    /// `(agents, state_dim)`.
    states: Vec<f32>,
    ended: Vec<bool>,
    /// Agents whose environments need not be stepped.
    retired: Vec<bool>,
    /// What restores each agent's environment, once asked for; none if that cannot be.
    saved: Mutex<Option<Vec<Vec<f64>>>>,
    /// Whether the workers compute a step.
    is_stepping: bool,
}

impl Gym {
    /// Opens an environment, without agents, and finds out what the learner needs.
    ///
    /// # Errors
    /// There is no interpreter, package or environment, or it is not supported.
    pub fn open(address: &Address, options: &GymOptions) -> Result<Self, EnvError> {
        Ok(Self::without_agents(Arc::new(Pool::open(address, options)?)))
    }

    fn load(store: &Store, options: &GymOptions) -> Result<Self, EnvError> {
        let Stored { address, found, about } = store.json(STORED)?;
        let address: Address = address.to_string().parse().map_err(StoreError::inconsistent)?;
        let pool = match about.filter(|_| options.reads_only) {
            Some(about) => Pool::only_read(&address, options, about, found)?,
            None => Pool::resume(&address, options, found)?,
        };
        Ok(Self::without_agents(Arc::new(pool)))
    }

    fn without_agents(pool: Arc<Pool>) -> Self {
        Self {
            pool,
            noise: 0.0,
            workers: Mutex::default(),
            states: Vec::new(),
            ended: Vec::new(),
            retired: Vec::new(),
            saved: Mutex::default(),
            is_stepping: false,
        }
    }

    /// Returns how the environment is called and where it comes from.
    pub fn address(&self) -> &Address {
        &self.pool.address
    }

    /// Returns whether a resumed run goes on exactly where it stopped; otherwise agents restart.
    pub fn resumes_exactly(&self) -> bool {
        self.pool.about.restorable
    }

    /// Returns the walls of its maze, if it has one.
    fn maze(&self) -> Option<&Walls> {
        self.pool.found.maze_of(&self.pool.about)
    }

    /// Returns the components of a row that form the state.
    fn state<'a>(&'a self, row: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        self.pool.found.columns.iter().map(|column| row[*column])
    }

    /// Begins an episode of `agent`; returns its goal.
    fn begin(&mut self, agent: usize, seed: u32, task: Option<u32>) -> Result<Vec<f32>, EnvError> {
        let pool = self.pool.clone();
        let begun = self.with_worker(agent, |worker, environment| {
            slots::reset(worker, &pool.about, environment, seed, task)
        })?;
        self.set_state(agent, &self.state(&begun.row).collect::<Vec<_>>());
        let goal = self.pool.found.goal_columns.iter().map(|column| begun.goal[*column]);
        Ok(goal.collect())
    }

    fn set_state(&mut self, agent: usize, state: &[f32]) {
        let s = state.len();
        self.states[agent * s..(agent + 1) * s].copy_from_slice(state);
        (self.ended[agent], self.retired[agent]) = (false, false);
        *self.saved.get_mut() = None;
    }

    /// Calls `act` with the worker of `agent` and the number of its environment there.
    fn with_worker<R>(
        &mut self,
        agent: usize,
        act: impl FnOnce(&mut Worker, usize) -> Result<R, EnvError>,
    ) -> Result<R, EnvError> {
        self.check()?;
        let found = self.workers.get_mut().iter_mut().find(|(_, agents)| agents.contains(&agent));
        let Some((worker, agents)) = found else { unreachable!("every agent has a worker") };
        act(worker, agent - agents.start)
    }

    /// Whether a worker has failed: the environments may differ from the states.
    fn has_failed(&self) -> bool {
        self.workers.lock().iter().any(|(worker, _)| worker.is_broken)
    }

    /// Checks that there are workers, none of which has failed before.
    fn check(&self) -> Result<(), EnvError> {
        let problem = match (self.has_failed(), self.pool.only_read.is_some()) {
            (true, _) => "it has failed before: resume the run from its checkpoint",
            (false, true) => "only what its checkpoint knows of it is read here",
            (false, false) => return Ok(()),
        };
        Err(failed(&self.pool.address.id, problem.to_owned(), Vec::new()))
    }

    /// Has all workers begin a step.
    fn begin_all(&mut self, actions: &[f32]) -> Result<(), EnvError> {
        let (about, a) = (&self.pool.about, self.pool.found.spec.action_dim);
        self.workers.get_mut().iter_mut().try_for_each(|(worker, agents)| {
            slots::begin_step(worker, about, &actions[a * agents.start..a * agents.end])
        })
    }

    /// Waits for the step begun; returns the rows of all environments, and which have ended.
    fn end_all(&mut self) -> Result<(Vec<Vec<f32>>, Vec<bool>), EnvError> {
        let (mut rows, mut ended) = (Vec::new(), Vec::new());
        for (worker, agents) in self.workers.get_mut() {
            let (more, are_ended) = slots::end_step(worker, &self.pool.about, agents.len())?;
            rows.extend(more);
            ended.extend(are_ended);
        }
        Ok((rows, ended))
    }

    /// Returns what restores each agent's environment, as numbers; none if that cannot be, which a
    /// warning says once.
    fn save_all(&self) -> Vec<Vec<f64>> {
        if self.has_failed() || !self.resumes_exactly() {
            return Vec::new();
        }
        let mut all = Vec::new();
        for (worker, agents) in self.workers.lock().iter_mut() {
            match slots::save(worker, agents.len()) {
                Ok(states) => all.extend(states),
                Err(why) => {
                    self.pool.warn_of_states(&why);
                    return Vec::new();
                }
            }
        }
        let longest = all.iter().map(Vec::len).max().unwrap_or(0);
        all.iter().map(|bytes| frames::packed(bytes, longest)).collect()
    }

    /// Returns the state of `agent`.
    fn state_of(&self, agent: usize) -> Vec<f64> {
        let s = self.pool.found.spec.state_dim();
        self.states[agent * s..(agent + 1) * s].iter().map(|v| f64::from(*v)).collect()
    }
}

impl Environment for Gym {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn spec(&self) -> &Spec {
        &self.pool.found.spec
    }

    fn states(&self) -> &[f32] {
        &self.states
    }

    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        if self.pool.only_read.is_some() {
            return Ok(());
        }
        self.begin(agent, rng.next_u32(), None).map(drop)
    }

    /// Draws one of the goals that the environment itself has asked for.
    fn sample_goal(&self, _: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        let goals = &self.pool.found.goals;
        let at = goal.len() * rng.random_range(0..goals.len() / goal.len());
        goal.copy_from_slice(&goals[at..at + goal.len()]);
    }

    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        self.begin_step(actions, rng)?;
        self.end_step()
    }

    fn begin_step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<bool, EnvError> {
        self.check()?;
        let mut noisy = actions.to_vec();
        if self.noise > 0.0 {
            for action in &mut noisy {
                let sample: f32 = StandardNormal.sample(rng);
                *action = action.clamp(-1.0, 1.0) + self.noise * sample;
            }
        }
        let a = self.spec().action_dim;
        for (action, retired) in noisy.chunks_exact_mut(a).zip(&self.retired) {
            if *retired {
                action.fill(slots::REST);
            }
        }
        self.begin_all(&noisy)?;
        self.is_stepping = true;
        Ok(true)
    }

    fn end_step(&mut self) -> Result<(), EnvError> {
        if !std::mem::take(&mut self.is_stepping) {
            return Ok(());
        }
        let (rows, ended) = self.end_all()?;
        self.states = rows.iter().flat_map(|row| self.state(row)).collect();
        self.ended = ended;
        *self.saved.get_mut() = None;
        Ok(())
    }

    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError> {
        let mut world = Self::without_agents(self.pool.clone());
        world.noise = self.noise;
        world.states = vec![0.0; agents * self.spec().state_dim()];
        (world.ended, world.retired) = (vec![false; agents], vec![false; agents]);
        if self.pool.only_read.is_some() {
            return Ok(Box::new(world));
        }
        let each = agents.div_ceil(self.pool.options.workers.max(1)).max(1);
        for start in (0..agents).step_by(each) {
            let range = start..(start + each).min(agents);
            let worker = self.pool.take(range.len())?;
            world.workers.get_mut().push((worker, range));
        }
        Ok(Box::new(world))
    }

    fn has_ended(&self, agent: usize) -> bool {
        self.ended[agent]
    }

    fn retire(&mut self, agent: usize) {
        self.retired[agent] = true;
    }

    /// Honours the noise; the environment itself knows where episodes begin.
    fn configure(&mut self, settings: &EnvSettings) {
        self.noise = settings.noise;
    }

    /// Answers are no longer waited for once training is to stop, by all that share its workers.
    fn share_pulse(&mut self, pulse: &Pulse) {
        *self.pool.pulse.lock() = pulse.clone();
    }

    fn full_state(&self, agent: usize) -> Vec<f64> {
        let mut full = self.state_of(agent);
        if let Some(length) = self.pool.only_read {
            full.resize(length.max(full.len()), 0.0);
            return full;
        }
        let mut saved = self.saved.lock();
        if let Some(numbers) = saved.get_or_insert_with(|| self.save_all()).get(agent) {
            full.push(RESTORED);
            full.extend(numbers);
        }
        full
    }

    fn set_full_state(&mut self, agent: usize, full_state: &[f64]) -> Result<bool, EnvError> {
        let (state, rest) = full_state.split_at(self.spec().state_dim().min(full_state.len()));
        match rest {
            _ if self.pool.only_read.is_some() => {
                self.set_state(agent, &state.iter().map(|v| *v as f32).collect::<Vec<_>>());
                Ok(true)
            }
            [SEEDED, seed, task] => {
                let tasks = self.pool.about.tasks.unwrap_or(0);
                let task = Some(*task as u32).filter(|task| (1..=tasks).contains(task));
                self.begin(agent, *seed as u32, task)?;
                Ok(true)
            }
            [RESTORED, numbers @ ..] if self.resumes_exactly() => {
                let Some(bytes) = frames::unpacked(numbers) else { return Ok(false) };
                let restored = self.with_worker(agent, |worker, environment| {
                    slots::restore(worker, environment, &bytes)
                })?;
                if let Err(why) = restored {
                    log::warn!("{}: agent {agent} begins a new episode: {why}", KIND.name);
                    return Ok(false);
                }
                self.set_state(agent, &state.iter().map(|v| *v as f32).collect::<Vec<_>>());
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    /// Accepts states of any length: an agent whose state cannot be restored begins an episode.
    fn takes_full_state(&self, length: usize) -> bool {
        length >= self.spec().state_dim()
    }

    fn abilities(&self) -> Abilities<'_> {
        Abilities {
            recorded: Some(self),
            episodes: Some(self),
            evaluated: Some(self),
            explored: self.maze().map(|_| self as _),
            drawn: Some(self),
            rendered: self.pool.about.renders.then_some(self as _),
            ..Abilities::default()
        }
    }
}

impl Drop for Gym {
    /// Leaves the workers to the next fork: Python takes seconds to start. After a failure, or during
    /// a step, answers may still be on their way.
    fn drop(&mut self) {
        let is_idle = !self.has_failed() && !self.is_stepping;
        let workers = self.workers.get_mut();
        if is_idle {
            workers.drain(..).for_each(|(worker, _)| self.pool.give_back(worker));
        }
        workers.iter_mut().for_each(|(worker, _)| worker.begin_to_end());
    }
}
