//! The networks of a learner in training, and the threads that update them.
//!
//! An update has four phases of independent tasks: the gradients of all networks but the actor, one
//! task per part of the batch; the steps of these networks, two tasks each; the actor's gradient,
//! again by part; the actor's step.

use std::sync::Arc;
use std::time::Instant;

use candle_core::Result;
use parking_lot::{Mutex, RwLock};
use rand_chacha::ChaCha8Rng;

use crate::job::Job;
use crate::learn::networks::dense::LearningRates;
use crate::learn::networks::export::ActorExport;
use crate::learn::networks::network::{LockedNetwork, Network, Weights};
use crate::learn::networks::shapes::check_state_dim;
use crate::learn::networks::table::TouchedCorners;
use crate::learn::settings::LearnSettings;
use crate::learn::update::gradient::{FullGradient, Gradient, full_gradient};
use crate::learn::update::gradient::{Half, step_half};
use crate::learn::update::losses::Losses;
use crate::learn::update::objective::{Frozen, NetworkPlan, NetworkWeights, Objective, Part};
use crate::learn::update::pool::ThreadPool;
use crate::learn::update::profile::{Profile, Stage};
use crate::learn::update::rows::parts_of;
use crate::learn::update::threads::Threads;

/// Networks with all that is needed to train them. The number of threads does not change results.
pub struct Training<O: Objective> {
    shared: Arc<Shared<O>>,
    pool: ThreadPool,
}

/// Data shared by the threads of an update.
struct Shared<O: Objective> {
    objective: Arc<O>,
    rates: LearningRates,
    networks: Vec<(NetworkPlan, Network)>,
    parts: Vec<Mutex<Part<O::Buffers>>>,
    /// The latest batch.
    batch: Arc<RwLock<O::Batch>>,
    /// Grid table corners around each set of the batch's positions.
    touched: Vec<RwLock<TouchedCorners>>,
}

/// Tasks of one phase.
type Work<O> = fn(&Shared<O>, usize) -> Result<()>;

impl<O: Objective> Training<O> {
    /// Creates the networks of `objective` with random parameters. `threads` share the work of
    /// each update.
    ///
    /// # Errors
    /// Returns an error if states are too large, or a tensor operation fails.
    pub fn new(
        objective: O,
        settings: &LearnSettings,
        threads: impl Into<Threads>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        check_state_dim(objective.encoder().spec())?;
        let grid = objective.encoder().grid();
        let create = |plan: NetworkPlan| {
            let tau = plan.is_averaged.then_some(settings.tau);
            Network::new(plan.mlp, grid, tau, rng).map(|network| (plan, network))
        };
        let networks = objective.networks().into_iter().map(create).collect::<Result<Vec<_>>>()?;
        let part = |_| {
            let gradients = vec![Gradient::default(); networks.len()];
            Mutex::new(Part { gradients, ..Part::default() })
        };
        let shared = Shared {
            rates: LearningRates::from_settings(settings),
            parts: (0..parts_of(settings.batch_size)).map(part).collect(),
            networks,
            batch: Arc::default(),
            touched: (0..O::POSITION_SETS).map(|_| RwLock::default()).collect(),
            objective: Arc::new(objective),
        };
        // No phase has more tasks.
        let tasks = (O::POSITION_SETS + shared.parts.len()).max(2 * shared.actor());
        let pool = ThreadPool::new(threads.into(), tasks);
        Ok(Self { shared: Arc::new(shared), pool })
    }

    /// Returns what the networks compute and learn.
    pub fn objective(&self) -> &O {
        &self.shared.objective
    }

    /// Returns the learning rates.
    pub fn rates(&self) -> LearningRates {
        self.shared.rates
    }

    /// Returns all networks; the actor comes last.
    pub fn networks(&self) -> impl DoubleEndedIterator<Item = &Network> + ExactSizeIterator {
        self.shared.networks.iter().map(|(_, network)| network)
    }

    /// Returns all networks with their names in checkpoints.
    pub fn named(&self) -> impl Iterator<Item = (&str, &Network)> {
        self.shared.networks.iter().map(|(plan, network)| (plan.name.as_str(), network))
    }

    /// Returns network number `k`.
    pub fn network(&self, k: usize) -> &Network {
        &self.shared.networks[k].1
    }

    /// Returns the actor.
    pub fn actor(&self) -> &Network {
        self.network(self.shared.actor())
    }

    /// Returns the number of updates done.
    pub fn updates(&self) -> u64 {
        self.actor().steps()
    }

    /// Returns the latest batch, to be read or replaced.
    pub fn batch(&self) -> &Arc<RwLock<O::Batch>> {
        &self.shared.batch
    }

    /// Updates all networks once on the latest batch and adds the time to `profile`;
    /// `job` beats before each part.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn update(&self, job: Option<&Job>, profile: &mut Profile) -> Result<Losses> {
        let phases: [(Stage, usize, Work<O>); 4] = [
            (Stage::CriticModelGradients, self.gradient_tasks(), Shared::corners_or_gradients),
            (Stage::CriticModelSteps, 2 * self.shared.actor(), Shared::step),
            (Stage::ActorGradient, self.shared.parts.len(), Shared::actor_gradient),
            (Stage::ActorStep, 2, Shared::step_actor),
        ];
        let first_began = Instant::now();
        let mut began = first_began;
        for (stage, tasks, work) in phases {
            self.pool.try_run(tasks, &self.shared, job, work)?;
            began = profile.lap(stage, began);
        }
        self.pool.record(began - first_began);
        Ok(self.losses())
    }

    /// Computes losses and gradients on `batch` without a step, for checks against other
    /// implementations: see [`Self::full_gradient`].
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn compute_gradients(&self, batch: &O::Batch) -> Result<Losses> {
        self.batch().write().clone_from(batch);
        let run = |tasks, work: Work<O>| self.pool.try_run(tasks, &self.shared, None, work);
        run(self.gradient_tasks(), Shared::corners_or_gradients)?;
        run(self.shared.parts.len(), Shared::actor_gradient)?;
        Ok(self.losses())
    }

    /// Returns the latest gradient of network number `k`.
    pub fn full_gradient(&self, k: usize) -> FullGradient {
        let Shared { networks, parts, touched, .. } = &*self.shared;
        let (plan, network) = &networks[k];
        full_gradient(network, &touched[plan.positions].read(), parts, |part| {
            &mut part.gradients[k]
        })
    }

    /// Returns what the tasks have computed from each part of the latest batch.
    #[cfg(test)]
    pub fn parts(&self) -> &[Mutex<Part<O::Buffers>>] {
        &self.shared.parts
    }

    /// Returns the number of tasks of the first phase.
    fn gradient_tasks(&self) -> usize {
        O::POSITION_SETS + self.shared.parts.len()
    }

    fn losses(&self) -> Losses {
        self.shared.parts.iter().map(|part| part.lock().losses).sum()
    }

    /// Calls `use_nets` with the current networks or their running averages; no update can run in
    /// the meantime.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn with_nets<R>(
        &self,
        averaged: bool,
        use_nets: impl FnOnce(O::Nets<'_>) -> R,
    ) -> Result<R> {
        let locked = self.shared.lock();
        Ok(use_nets(self.objective().nets(weights(&locked, averaged)?)))
    }

    /// Returns a frozen copy of the networks or their running averages.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn freeze(&self, averaged: bool) -> Result<Frozen<O>> {
        Frozen::copy(&self.shared.objective, self.networks(), averaged)
    }

    /// Returns the actor or its running average for other programs.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn export_actor(&self, averaged: bool) -> Result<ActorExport> {
        let (plan, actor) = &self.shared.networks[self.shared.actor()];
        ActorExport::of(self.objective().encoder(), &plan.mlp, actor, averaged)
    }

    /// Returns whether the averaged networks give finite outputs on the latest batch.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn is_finite(&self) -> Result<bool> {
        let outputs = self.with_nets(true, |nets| O::outputs(&nets, &self.batch().read()))?;
        Ok(outputs.iter().all(|output| output.is_finite()))
    }
}

impl<O: Objective> Shared<O> {
    /// Returns the actor's number.
    fn actor(&self) -> usize {
        self.networks.len() - 1
    }

    /// Locks all networks for reading.
    fn lock(&self) -> Vec<LockedNetwork<'_>> {
        self.networks.iter().map(|(_, network)| network.lock()).collect()
    }

    /// Runs one task of an update's first phase: the first ones find the corners that the steps
    /// will touch, each other one computes gradients on its part of the batch.
    fn corners_or_gradients(&self, task: usize) -> Result<()> {
        let batch = self.batch.read();
        let Some(i) = task.checked_sub(O::POSITION_SETS) else {
            self.objective.find_corners(task, &batch, &mut self.touched[task].write());
            return Ok(());
        };
        let locked = self.lock();
        let (current, averaged) = (weights(&locked, false)?, weights(&locked, true)?);
        let networks = NetworkWeights { current: &current, averaged: &averaged };
        self.objective.gradients(&batch, i, networks, &mut self.parts[i].lock());
        Ok(())
    }

    /// Computes the actor's gradient on part `i` of the batch.
    fn actor_gradient(&self, i: usize) -> Result<()> {
        let locked = self.lock();
        let current = weights(&locked, false)?;
        self.objective.actor_gradient(&self.batch.read(), i, &current, &mut self.parts[i].lock());
        Ok(())
    }

    /// Steps the networks, which are independent of each other, in two tasks per network.
    fn step(&self, task: usize) -> Result<()> {
        let (k, half) = (task / 2, Half::for_task(task));
        let (plan, network) = &self.networks[k];
        let touched = self.touched[plan.positions].read();
        step_half(network, half, &touched, self.rates, &self.parts, |part| &mut part.gradients[k])
    }

    /// Steps the actor, in two tasks.
    fn step_actor(&self, task: usize) -> Result<()> {
        self.step(2 * self.actor() + task)
    }
}

/// Returns the current weights, or their running averages if `averaged`.
fn weights<'a>(locked: &'a [LockedNetwork], averaged: bool) -> Result<Vec<Weights<'a>>> {
    locked.iter().map(|network| network.weights(averaged)).collect()
}
