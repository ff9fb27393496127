//! Any Gymnasium environment with continuous actions and goals, in a Python process of its own.
//!
//! A `worker` steps several environments and exchanges one message a step with the program; what the
//! learner needs is found out once (`facts`). Environments are reset with
//! seeds from the run's random numbers, so that the same seed gives the same run wherever the
//! environment itself is deterministic. A resumed run begins the episodes of its agents again and
//! repeats what they did.

mod abilities;
mod facts;
mod worker;
mod worker_pool;

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use parking_lot::Mutex;
use rand::{Rng, RngExt};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{Abilities, EnvError, EnvSettings, Environment, Spec, Walls, WorldKind};
use crate::job::Job;
use crate::store::{Store, StoreError};
use crate::text::counted;
use facts::EnvFacts;
use worker::{EnvDescription, GymWorker, REST, failed};
use worker_pool::Pool;
pub use worker_pool::{Address, GymOptions};

pub const KIND: WorldKind = WorldKind {
    name: "gym",
    about: "a Gymnasium environment with goals, in Python: gym:ID or gym:PACKAGE:ID",
    create: None,
    open: Some(|argument, options| {
        let address = argument.parse().map_err(|why| failed(argument, why, Vec::new()))?;
        let (pool, found) = Pool::open(address, options, None)?;
        Ok(Box::new(Gym::without_agents(Arc::new(pool), Arc::new(found), true)))
    }),
    load: |store, options| Ok(Box::new(Gym::load(store, options)?)),
    // Steps are slow, so each is worth an update, as of the arm.
    defaults: &["agents=8", "learning_starts=500", "env_steps_per_update=1", "near_goals=0"],
};

type Result<T, E = EnvError> = std::result::Result<T, E>;

const STORED: &str = "gym";

/// Tasks of an evaluation that run at once: each takes an environment.
const TASKS_AT_ONCE: usize = 16;

/// In the place of a checksum: whatever comes out of an episode is right.
const UNCHECKED: f64 = -1.0;

/// Messages that are shown once.
const NEW_EPISODES: &str = "the agents begin new episodes";
const OTHER_SUCCESS: &str =
    "its own success is not what the goal radius says (--goal-radius sets another)";

/// An environment's own word on whether a goal is reached counts where the distance is not the goal radius
/// to within this share of it.
const UNSURE: f32 = 0.1;

/// Tasks count from 1.
const NO_TASK: f64 = 0.0;

/// What a checkpoint keeps of a world, with its interpreter as it was given.
#[derive(Serialize, Deserialize)]
struct Stored {
    address: Address,
    found: EnvFacts,
    about: EnvDescription,
    #[serde(default)]
    python: Option<String>,
}

/// How an agent has come to where it is.
#[derive(Clone, Debug, Default)]
struct Episode {
    seed: u32,
    task: Option<u32>,
    /// What the environment asks for.
    goal: Vec<f32>,
    /// `(steps, action_dim)`, in [-1, 1].
    actions: Vec<f32>,
    /// CRC-32 of all that has come out: goal, observations, what was achieved, and the end.
    checksum: u32,
}

impl Episode {
    fn add(&mut self, numbers: &[f32]) {
        let mut hasher = crc32fast::Hasher::new_with_initial(self.checksum);
        numbers.iter().for_each(|v| hasher.update(&v.to_le_bytes()));
        self.checksum = hasher.finalize();
    }

    /// Adds what a step led to.
    fn step(&mut self, action: &[f32], row: &[f32], ended: bool) {
        self.actions.extend(action);
        self.add(row);
        self.add(&[f32::from(u8::from(ended))]);
    }
}

pub struct Gym {
    pool: Arc<Pool>,
    found: Arc<EnvFacts>,
    settings: EnvSettings,
    /// Workers, and the agents in the environments of each.
    workers: Mutex<Vec<(GymWorker, Range<usize>)>>,
    /// `(agents, state_dim)`.
    states: Vec<f32>,
    ended: Vec<bool>,
    /// Agents whose environments need not be stepped.
    retired: Vec<bool>,
    episodes: Vec<Episode>,
    /// The actions of the step that the workers compute.
    stepping: Option<Vec<f32>>,
    /// Whether its agents act. Otherwise, it is only what a checkpoint knows of it.
    is_open: bool,
}

impl Gym {
    fn load(store: &Store, options: &GymOptions) -> Result<Self> {
        let Stored { address, found, about, python } = store.json(STORED)?;
        let address: Address = address.to_string().parse().map_err(StoreError::inconsistent)?;
        // Another machine may not have it.
        let kept = python.map(PathBuf::from).filter(|path| path.exists() || path.is_relative());
        let options = &GymOptions { python: options.python.clone().or(kept), ..options.clone() };
        let (pool, found) = if options.reads_only {
            Pool::only_read(address, options, about, found)?
        } else {
            Pool::open(address, options, Some((found, about)))?
        };
        Ok(Self::without_agents(Arc::new(pool), Arc::new(found), !options.reads_only))
    }

    fn without_agents(pool: Arc<Pool>, found: Arc<EnvFacts>, is_open: bool) -> Self {
        Self {
            pool,
            found,
            settings: EnvSettings::default(),
            workers: Mutex::default(),
            states: Vec::new(),
            ended: Vec::new(),
            retired: Vec::new(),
            episodes: Vec::new(),
            stepping: None,
            is_open,
        }
    }

    /// Returns this world with agents that have not begun yet, in these workers.
    fn with_agents(&self, workers: Vec<(GymWorker, Range<usize>)>, agents: usize) -> Self {
        let mut world = Self::without_agents(self.pool.clone(), self.found.clone(), self.is_open);
        world.settings = self.settings;
        *world.workers.get_mut() = workers;
        world.states = vec![0.0; agents * self.spec().state_dim()];
        (world.ended, world.retired) = (vec![false; agents], vec![false; agents]);
        world.episodes = vec![Episode::default(); agents];
        world
    }

    fn maze(&self) -> Option<&Walls> {
        self.found.maze_of(&self.pool.about)
    }

    /// Returns the components of a row that form the state.
    fn state(&self, row: &[f32]) -> Vec<f32> {
        self.found.columns.iter().map(|column| row[*column]).collect()
    }

    /// Begins an episode of `agent`; returns its goal.
    fn begin(&mut self, agent: usize, seed: u32, task: Option<u32>) -> Result<Vec<f32>> {
        let (row, goal) = self.with_worker(agent, |worker, i| worker.reset(i, seed, task))?;
        let own: Vec<f32> = self.found.goal_columns.iter().map(|column| goal[*column]).collect();
        let mut episode = Episode { seed, task, goal: own.clone(), ..Episode::default() };
        episode.add(&goal);
        episode.add(&row);
        self.episodes[agent] = episode;
        (self.ended[agent], self.retired[agent]) = (false, false);
        self.set_state(agent, &self.state(&row));
        Ok(own)
    }

    /// Warns if the environment says otherwise than the goal radius whether a goal is reached.
    fn compare(&self, state: &[f32], goal: &[f32], told: bool) {
        let (radius, distance) = (self.spec().goal_radius, self.spec().goal_distance(state, goal));
        let by = if told { distance / radius - 1.0 } else { 1.0 - distance / radius };
        if by > UNSURE && !self.pool.moves_goal {
            let why = format!("{told} at a distance of {distance}, where the radius is {radius}");
            self.pool.warn_once(OTHER_SUCCESS, &why);
        }
    }

    fn set_state(&mut self, agent: usize, state: &[f32]) {
        let s = state.len();
        self.states[agent * s..(agent + 1) * s].copy_from_slice(state);
    }

    /// Begins an episode again and repeats its actions; returns whether the same came out.
    fn repeat(&mut self, agent: usize, episode: &Episode) -> Result<bool> {
        self.begin(agent, episode.seed, episode.task)?;
        let a = self.spec().action_dim;
        for action in episode.actions.chunks_exact(a) {
            // The others rest.
            let mut stepped = self.with_worker(agent, |worker, environment| {
                let mut actions = vec![REST; a * environment];
                actions.extend(action);
                worker.step(&actions)
            })?;
            let Some((row, ended, _)) = stepped.pop() else { continue };
            self.episodes[agent].step(action, &row, ended);
            self.ended[agent] = ended;
            self.set_state(agent, &self.state(&row));
        }
        Ok(self.episodes[agent].checksum == episode.checksum)
    }

    /// Calls `act` with the worker of `agent` and the number of its environment there.
    fn with_worker<R>(
        &mut self,
        agent: usize,
        act: impl FnOnce(&mut GymWorker, usize) -> Result<R>,
    ) -> Result<R> {
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
    fn check(&self) -> Result<()> {
        let problem = match (self.has_failed(), self.is_open) {
            (true, _) => "it has failed before: resume the run from its checkpoint",
            (false, false) => "only what its checkpoint knows of it is read here",
            (false, true) => return Ok(()),
        };
        Err(failed(&self.pool.address.id, problem.to_owned(), Vec::new()))
    }

    fn state_of(&self, agent: usize) -> Vec<f64> {
        let s = self.found.spec.state_dim();
        self.states[agent * s..(agent + 1) * s].iter().map(|v| f64::from(*v)).collect()
    }
}

impl Environment for Gym {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn spec(&self) -> &Spec {
        &self.found.spec
    }

    fn rescale(&mut self, walks: &[&[f32]], beside_goal: bool) -> bool {
        Arc::make_mut(&mut self.found).rescale(walks, beside_goal)
    }

    fn states(&self) -> &[f32] {
        &self.states
    }

    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) -> Result<()> {
        if !self.is_open {
            return Ok(());
        }
        self.begin(agent, rng.next_u32(), None).map(drop)
    }

    /// Draws one of the goals that the environment itself has asked for.
    fn sample_goal(&self, _: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        let goals = &self.found.goals;
        let at = goal.len() * rng.random_range(0..goals.len() / goal.len());
        goal.copy_from_slice(&goals[at..at + goal.len()]);
    }

    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<()> {
        self.begin_step(actions, rng)?;
        self.end_step()
    }

    fn begin_step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<bool> {
        self.check()?;
        let mut noisy: Vec<f32> =
            actions.iter().map(|action| self.settings.noisy(*action, rng)).collect();
        let a = self.spec().action_dim;
        for (action, retired) in noisy.chunks_exact_mut(a).zip(&self.retired) {
            if *retired {
                action.fill(REST);
            }
        }
        self.workers.get_mut().iter_mut().try_for_each(|(worker, agents)| {
            worker.begin_step(&noisy[a * agents.start..a * agents.end])
        })?;
        self.stepping = Some(noisy);
        Ok(true)
    }

    fn end_step(&mut self) -> Result<()> {
        let (Some(actions), a) = (self.stepping.take(), self.spec().action_dim) else {
            return Ok(());
        };
        let mut all = Vec::new();
        for (worker, agents) in self.workers.get_mut() {
            all.extend(worker.end_step(agents.len())?);
        }
        for (agent, (action, (row, ended, told))) in actions.chunks_exact(a).zip(all).enumerate() {
            if !self.retired[agent] && !self.ended[agent] {
                self.episodes[agent].step(action, &row, ended);
                self.ended[agent] = ended;
                let state = self.state(&row);
                self.set_state(agent, &state);
                told.into_iter()
                    .for_each(|told| self.compare(&state, &self.episodes[agent].goal, told));
            }
        }
        Ok(())
    }

    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>> {
        let mut workers = Vec::new();
        let each = agents.div_ceil(self.pool.options.workers.max(1)).max(1);
        for start in (0..agents).step_by(each).filter(|_| self.is_open) {
            let range = start..(start + each).min(agents);
            workers.push((self.pool.take(range.len())?, range));
        }
        Ok(Box::new(self.with_agents(workers, agents)))
    }

    fn has_ended(&self, agent: usize) -> bool {
        self.ended[agent]
    }

    fn retire(&mut self, agent: usize) {
        self.retired[agent] = true;
    }

    /// Honours the noise; the environment itself knows where episodes begin.
    fn configure(&mut self, settings: &EnvSettings) {
        self.settings = *settings;
    }

    /// Answers are no longer waited for once training is to stop, by all that share its workers.
    fn share_job(&mut self, job: &Job) {
        *self.pool.job.lock() = job.clone();
    }

    /// The state, and how the agent has come there, unless the environment has failed: seed, task,
    /// checksum, number of actions and actions, and zeros that make all of one length.
    fn full_state(&self, agent: usize) -> Vec<f64> {
        let mut full = self.state_of(agent);
        if !self.is_open || self.has_failed() {
            return full;
        }
        let Episode { seed, task, actions, checksum, .. } = &self.episodes[agent];
        let longest = self.episodes.iter().map(|episode| episode.actions.len()).max();
        let head = [*seed, task.unwrap_or(0), *checksum, actions.len() as u32];
        full.extend(head.map(f64::from));
        full.extend(actions.iter().map(|v| f64::from(*v)));
        full.extend(vec![0.0; longest.unwrap_or(0) - actions.len()]);
        full
    }

    fn set_full_state(&mut self, agent: usize, full_state: &[f64]) -> Result<bool> {
        let (state, rest) = full_state.split_at(self.spec().state_dim().min(full_state.len()));
        if !self.is_open {
            self.set_state(agent, &as_f32(state).collect::<Vec<_>>());
            return Ok(true);
        }
        let [seed, task, checksum, length, actions @ ..] = rest else {
            self.pool.warn_once(NEW_EPISODES, "it had failed when the run was saved");
            return Ok(false);
        };
        let tasks = self.pool.about.tasks.unwrap_or(0);
        let episode = Episode {
            seed: *seed as u32,
            task: Some(*task as u32).filter(|task| (1..=tasks).contains(task)),
            actions: as_f32(&actions[..actions.len().min(*length as usize)]).collect(),
            checksum: *checksum as u32,
            ..Episode::default()
        };
        let steps = counted((episode.actions.len() / self.spec().action_dim) as u64, "step");
        let why = match self.repeat(agent, &episode) {
            Ok(is_same) if is_same || *checksum == UNCHECKED => return Ok(true),
            Ok(_) => format!(
                "with the same seed and actions, other numbers than before have come out of {steps}"
            ),
            Err(EnvError::Failed { problem, .. }) if *checksum != UNCHECKED => {
                let failed = self.workers.get_mut().iter_mut();
                for (worker, agents) in failed.filter(|(worker, _)| worker.is_broken) {
                    *worker = self.pool.take(agents.len())?;
                }
                format!("while {steps} were repeated, {problem}")
            }
            Err(error) => return Err(error),
        };
        self.pool.warn_once(NEW_EPISODES, &why);
        Ok(false)
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
            ..Abilities::default()
        }
    }
}

impl Drop for Gym {
    /// Leaves the workers to the next fork: Python takes seconds to start. After a failure, or during
    /// a step, answers may still be on their way.
    fn drop(&mut self) {
        let is_idle = !self.has_failed() && self.stepping.is_none();
        let workers = self.workers.get_mut();
        if is_idle {
            self.pool.idle.lock().extend(workers.drain(..).map(|(worker, _)| worker));
        }
        workers.iter_mut().for_each(|(worker, _)| worker.begin_to_end());
    }
}

fn as_f32(numbers: &[f64]) -> impl Iterator<Item = f32> + '_ {
    numbers.iter().map(|v| *v as f32)
}
