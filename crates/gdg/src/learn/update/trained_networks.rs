//! The networks of a learner in training, and the threads that update them.
//!
//! An update has four phases of independent tasks: the gradients of all networks but the actor, one
//! task per part of the batch; the steps of these networks, two tasks each; the actor's gradient,
//! again by part; the actor's step.

use std::sync::Arc;

use candle_core::Result;
use parking_lot::{Mutex, RwLock};
use rand_chacha::ChaCha8Rng;

use crate::job::{Job, Stopwatch};
use crate::learn::data::batch::Batch;
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::{
    LearningRates, LockedNetwork, Network, TouchedCorners, Weights,
};
use crate::learn::networks::policy::{Frozen, Nets, Policy, Scratch};
use crate::learn::networks::shapes::Shapes;
use crate::learn::settings::LearnSettings;
use crate::learn::update::parts::{
    BatchPart, Gradient, Half, PAIRS, TRANSITIONS, find_corners, parts_of, step_half,
};
use crate::learn::update::profile::{Losses, Profile, TrainingPhase, phase_time};
use crate::learn::update::thread_pool::ThreadPool;
use crate::learn::update::threads::Threads;

/// Networks with all that is needed to train them. The number of threads does not change results.
pub struct Training {
    shared: Arc<Shared>,
    pool: ThreadPool,
}

/// Data shared by the threads of an update.
struct Shared {
    shapes: Arc<Shapes>,
    rates: LearningRates,
    /// Critics, model and actor, as far as the learner has them.
    networks: Vec<(NetworkPlan, Network)>,
    parts: Vec<Mutex<BatchPart>>,
    batch: RwLock<Batch>,
    /// Grid table corners around each set of the batch's positions.
    touched: Vec<RwLock<TouchedCorners>>,
}

struct NetworkPlan {
    name: String,
    mlp: Mlp,
    is_averaged: bool,
    /// The set of positions that it reads.
    positions: usize,
}

impl Shapes {
    /// Returns the networks, in the order in which they are created.
    fn networks(&self) -> Vec<NetworkPlan> {
        let plan = |name: &str, mlp, positions| NetworkPlan {
            name: format!("{}{name}", self.prefix),
            mlp,
            is_averaged: positions == PAIRS,
            positions,
        };
        let critics = (0..self.critics).map(|k| plan(&format!("critic{k}"), self.critic, PAIRS));
        let model = self.returns.is_none().then(|| plan("model", self.model, TRANSITIONS));
        critics.chain(model).chain([plan("actor", self.actor, PAIRS)]).collect()
    }

    /// Returns the number of trainable parameters in all networks.
    pub fn count_parameters(&self) -> u64 {
        self.networks().iter().map(|plan| self.encoder.parameters_with(&plan.mlp)).sum()
    }
}

/// Tasks of one phase.
type Work = fn(&Shared, usize) -> Result<()>;

impl Training {
    /// Creates the networks with random parameters. `threads` share the work of each update.
    pub fn new(
        shapes: Shapes,
        settings: &LearnSettings,
        threads: impl Into<Threads>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        let create = |plan: NetworkPlan| {
            let tau = plan.is_averaged.then_some(settings.tau);
            Network::new(plan.mlp, shapes.encoder.grid.as_ref(), tau, rng)
                .map(|network| (plan, network))
        };
        let networks = shapes.networks().into_iter().map(create).collect::<Result<Vec<_>>>()?;
        let part = |_| {
            let gradients = vec![Gradient::default(); networks.len()];
            Mutex::new(BatchPart { gradients, ..BatchPart::default() })
        };
        let sets = if shapes.returns.is_none() { 2 } else { 1 };
        let shared = Shared {
            rates: LearningRates::from_settings(settings),
            parts: (0..parts_of(settings.batch_size)).map(part).collect(),
            networks,
            batch: RwLock::default(),
            touched: (0..sets).map(|_| RwLock::default()).collect(),
            shapes: Arc::new(shapes),
        };
        // No phase has more tasks.
        let tasks = shared.gradient_tasks().max(2 * shared.actor());
        let pool = ThreadPool::new(threads.into(), tasks);
        Ok(Self { shared: Arc::new(shared), pool })
    }

    pub fn shapes(&self) -> &Shapes {
        &self.shared.shapes
    }

    pub fn named(&self) -> impl DoubleEndedIterator<Item = (&str, &Network)> {
        self.shared.networks.iter().map(|(plan, network)| (plan.name.as_str(), network))
    }

    pub fn network(&self, k: usize) -> &Network {
        &self.shared.networks[k].1
    }

    pub fn actor(&self) -> &Network {
        self.network(self.shared.actor())
    }

    /// Returns the latest batch, to be read or replaced.
    pub fn batch(&self) -> &RwLock<Batch> {
        &self.shared.batch
    }

    /// Updates all networks once on the latest batch and adds the time to `profile`;
    /// `job` beats before each part.
    pub fn update(&self, job: Option<&Job>, profile: &mut Profile) -> Result<Losses> {
        let (actor, parts) = (self.shared.actor(), self.shared.parts.len());
        let phases: [(TrainingPhase, usize, Work); 4] = [
            (TrainingPhase::CriticModelGradients, self.shared.gradient_tasks(), Shared::gradients),
            (TrainingPhase::CriticModelSteps, 2 * actor, Shared::step),
            (TrainingPhase::ActorGradient, parts, Shared::actor_gradient),
            (TrainingPhase::ActorStep, 2, |shared, task| shared.step(2 * shared.actor() + task)),
        ];
        let (all_began, mut began) = (Stopwatch::start(), phase_time());
        for (stage, tasks, work) in phases {
            self.pool.try_run(tasks, &self.shared, job, work)?;
            began = profile.lap(stage, began);
        }
        self.pool.record(all_began.elapsed());
        Ok(self.losses())
    }

    pub fn losses(&self) -> Losses {
        self.shared.parts.iter().map(|part| part.lock().losses).sum()
    }

    /// Calls `use_nets` with the current networks or their running averages; no update can run in
    /// the meantime.
    pub fn with_nets<R>(&self, averaged: bool, use_nets: impl FnOnce(Nets) -> R) -> Result<R> {
        let locked = self.shared.lock();
        Ok(use_nets(self.shapes().nets(weights(&locked, averaged)?)))
    }

    /// Returns a frozen copy of the networks or their running averages.
    pub fn freeze(&self, averaged: bool) -> Result<Frozen> {
        let weights = self.named().map(|(_, network)| network.freeze(averaged));
        let weights = weights.collect::<Result<_>>()?;
        Ok(Frozen { shapes: self.shared.shapes.clone(), weights, looks_ahead: true })
    }

    /// Returns whether the averaged networks give finite distances and actions on the latest batch.
    pub fn is_finite(&self) -> Result<bool> {
        let batch = self.batch().read();
        let mut distances = vec![0.0; batch.len()];
        let mut actions = vec![0.0; batch.len() * self.shapes().actor.outputs];
        self.with_nets(true, |nets| {
            let mut scratch = Scratch::default();
            nets.distances(&batch.states, &batch.goals, &mut distances, &mut scratch);
            nets.actions(&batch.states, &batch.goals, &mut actions, &mut scratch);
        })?;
        Ok(distances.iter().chain(&actions).all(|output| output.is_finite()))
    }
}

impl Shared {
    fn actor(&self) -> usize {
        self.networks.len() - 1
    }

    fn gradient_tasks(&self) -> usize {
        self.touched.len() + self.parts.len()
    }

    fn lock(&self) -> Vec<LockedNetwork<'_>> {
        self.networks.iter().map(|(_, network)| network.lock()).collect()
    }

    /// Runs one task of an update's first phase: the first ones find the corners that the steps
    /// will touch, each other one computes gradients on its part of the batch.
    fn gradients(&self, task: usize) -> Result<()> {
        let batch = self.batch.read();
        let Some(i) = task.checked_sub(self.touched.len()) else {
            find_corners(task, &self.shapes, &batch, &mut self.touched[task].write());
            return Ok(());
        };
        let locked = self.lock();
        let [current, averaged] = [weights(&locked, false)?, weights(&locked, true)?]
            .map(|weights| self.shapes.nets(weights));
        self.shapes.gradients(&batch, i, &current, &averaged, &mut self.parts[i].lock());
        Ok(())
    }

    /// Computes the actor's gradient on part `i` of the batch.
    fn actor_gradient(&self, i: usize) -> Result<()> {
        let locked = self.lock();
        let nets = self.shapes.nets(weights(&locked, false)?);
        self.shapes.actor_gradient(&self.batch.read(), i, &nets, &mut self.parts[i].lock());
        Ok(())
    }

    /// Steps the networks, which are independent of each other, in two tasks per network.
    fn step(&self, task: usize) -> Result<()> {
        let k = task / 2;
        let half = if task.is_multiple_of(2) { Half::Table } else { Half::Dense };
        let (plan, network) = &self.networks[k];
        let touched = self.touched[plan.positions].read();
        step_half((k, network), half, &touched, self.rates, &self.parts)
    }
}

/// Returns the current weights, or their running averages if `averaged`.
fn weights<'a>(locked: &'a [LockedNetwork], averaged: bool) -> Result<Vec<Weights<'a>>> {
    locked.iter().map(|network| network.weights(averaged)).collect()
}

/// For checks against other implementations.
#[cfg(test)]
impl Training {
    /// Computes losses, and gradients of flat parameters and table of all networks, on `batch`
    /// without a step.
    pub fn compute_gradients(&self, batch: &Batch) -> (Losses, Vec<[Vec<f32>; 2]>) {
        self.batch().write().clone_from(batch);
        let Shared { networks, parts, touched, .. } = &*self.shared;
        for (tasks, work) in [
            (self.shared.gradient_tasks(), Shared::gradients as Work),
            (parts.len(), Shared::actor_gradient),
        ] {
            self.pool.try_run(tasks, &self.shared, None, work).expect("gradients");
        }
        let gradient = |(k, (plan, network)): (usize, &(NetworkPlan, Network))| {
            let (mut dense, mut encoded) = (Vec::new(), Vec::new());
            for part in parts {
                let Gradient { dense: own, encoded: own_encoded } = &part.lock().gradients[k];
                dense.resize(own.len(), 0.0);
                dense.iter_mut().zip(own).for_each(|(sum, d): (&mut f32, _)| *sum += d);
                encoded.push(own_encoded.clone());
            }
            let touched = touched[plan.positions].read();
            let table = network.table.as_ref().map(|_| touched.table_gradient(&encoded));
            [dense, table.unwrap_or_default()]
        };
        (self.losses(), networks.iter().enumerate().map(gradient).collect())
    }

    /// Returns the targets of the latest batch.
    pub fn targets(&self) -> Vec<f32> {
        let parts = self.shared.parts.iter();
        parts.flat_map(|part| part.lock().buffers.targets.clone()).collect()
    }
}
