//! What a learner's networks compute and learn; the rest of training is the same for all learners.

use std::sync::Arc;

use candle_core::Result;

use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::mlp::Mlp;
use crate::learn::networks::network::{Network, OwnedWeights, Weights};
use crate::learn::networks::policy::{Policy, Scratch};
use crate::learn::networks::table::TouchedCorners;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::Losses;

/// The networks of a learner: what they compute together, and their gradients on one part of a
/// batch.
///
/// Everything that there is once per network comes in the order of [`Self::networks`], whose last
/// one is the actor.
pub trait Objective: Send + Sync + 'static {
    /// Training data of one update.
    type Batch: Clone + Default + Send + Sync;
    /// Buffers of one task, kept between updates.
    type Buffers: Default + Send;
    /// D and mu of borrowed networks.
    type Nets<'a>: Policy;

    /// Number of sets of positions that networks read from their grid tables: the corners around
    /// each set are found once per batch.
    const POSITION_SETS: usize;

    /// Returns what encodes the inputs of all networks.
    fn encoder(&self) -> &Encoder;

    /// Returns the networks, in the order in which they are created; the actor comes last.
    fn networks(&self) -> Vec<NetworkPlan>;

    /// Finds the corners around set number `set` of a batch's positions, in the order in which
    /// gradients list them, part by part.
    fn find_corners(&self, set: usize, batch: &Self::Batch, touched: &mut TouchedCorners);

    /// Computes the gradients of all networks but the actor on part number `i` of the batch.
    fn gradients(
        &self,
        batch: &Self::Batch,
        i: usize,
        networks: NetworkWeights,
        part: &mut Part<Self::Buffers>,
    );

    /// Computes the actor's gradient on part number `i` of the batch, after [`Self::gradients`] and
    /// a step of the other networks, whose `current` weights are frozen.
    fn actor_gradient(
        &self,
        batch: &Self::Batch,
        i: usize,
        current: &[Weights],
        part: &mut Part<Self::Buffers>,
    );

    /// Returns D and mu of networks with these weights.
    fn nets<'a>(&'a self, weights: Vec<Weights<'a>>) -> Self::Nets<'a>;

    /// Returns outputs on a batch that are finite as long as the networks are sound.
    fn outputs(nets: &Self::Nets<'_>, batch: &Self::Batch) -> Vec<f32>;
}

/// A network to create.
pub struct NetworkPlan {
    /// Its name in checkpoints.
    pub name: String,
    /// Its size.
    pub mlp: Mlp,
    /// Whether it has a running average.
    pub is_averaged: bool,
    /// The set of positions that it reads.
    pub positions: usize,
}

impl NetworkPlan {
    /// Plans a network with a running average.
    pub fn averaged(name: String, mlp: Mlp, positions: usize) -> Self {
        Self { name, mlp, is_averaged: true, positions }
    }

    /// Plans a network without a running average.
    pub fn plain(name: String, mlp: Mlp, positions: usize) -> Self {
        Self { name, mlp, is_averaged: false, positions }
    }
}

/// All networks' weights during an update.
#[derive(Clone, Copy)]
pub struct NetworkWeights<'a> {
    /// The weights that are trained.
    pub current: &'a [Weights<'a>],
    /// Their running averages, where there are any.
    pub averaged: &'a [Weights<'a>],
}

/// What one task computes from its part of a batch.
#[derive(Default)]
pub struct Part<B> {
    /// Of each network.
    pub gradients: Vec<Gradient>,
    pub losses: Losses,
    pub buffers: B,
}

/// Returns the number of trainable parameters in all networks.
pub fn count_parameters(objective: &impl Objective) -> u64 {
    let encoder = objective.encoder();
    objective.networks().iter().map(|plan| encoder.parameters_with(&plan.mlp)).sum()
}

/// A frozen copy of a learner's networks.
pub struct Frozen<O> {
    objective: Arc<O>,
    weights: Vec<OwnedWeights>,
}

impl<O: Objective> Frozen<O> {
    /// Copies `networks`, or their running averages if `averaged`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn copy<'a>(
        objective: &Arc<O>,
        networks: impl Iterator<Item = &'a Network>,
        averaged: bool,
    ) -> Result<Self> {
        let weights = networks.map(|network| network.freeze(averaged)).collect::<Result<_>>()?;
        Ok(Self { objective: objective.clone(), weights })
    }

    fn nets(&self) -> O::Nets<'_> {
        self.objective.nets(self.weights.iter().map(OwnedWeights::weights).collect())
    }
}

impl<O: Objective> Policy for Frozen<O> {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().distances(states, goals, out, scratch);
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], scratch: &mut Scratch) {
        self.nets().actions(states, goals, out, scratch);
    }

    fn improve_actions(
        &self,
        states: &[f32],
        goals: &[f32],
        actions: &mut [f32],
        scratch: &mut Scratch,
    ) {
        self.nets().improve_actions(states, goals, actions, scratch);
    }
}
