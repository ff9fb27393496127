//! Goal-distance gradient: distance critics, dynamics model and actor (Algorithm 1), updated by
//! hand-written kernels on several threads.

pub mod graph_paths;
mod imagined_walks;
mod objective;
mod short_pairs;
#[cfg(test)]
mod tests;

use candle_core::Result;
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::job::Job;
use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::learner::{LearnerKind, TrainingData};
use crate::learn::networks::export::CriticsExport;
use crate::learn::networks::network::Network;
use crate::learn::networks::policy::{Nets, Scratch};
use crate::learn::networks::shapes::Shapes;
use crate::learn::phased::PhasedLearner;
use crate::learn::settings::LearnSettings;
use crate::learn::update::gradient::FullGradient;
use crate::learn::update::losses::Losses;
use crate::learn::update::objective::count_parameters;
use crate::learn::update::profile::Profile;
use crate::learn::update::reference::{Parameters, Reference};
use crate::learn::update::threads::Threads;
use crate::learn::update::training::Training;
use graph_paths::GraphPaths;
use imagined_walks::ImaginedWalks;
use short_pairs::ShortPairs;

/// Registry entry of the learner.
pub const KIND: LearnerKind = LearnerKind {
    name: NAME,
    about: "trains an actor through a distance critic and a dynamics model",
    is_rewarded: false,
    create: |spec, settings, threads, rng| Ok(Box::new(Gdg::new(spec, settings, threads, rng)?)),
    parameters: |spec, settings| count_parameters(&Shapes::new(spec, settings)),
};

const NAME: &str = "gdg";

/// The networks and everything needed to train them.
pub struct Gdg {
    sampler: BatchSampler,
    /// Adds paths through the bridge graph to batches, if the settings ask for it.
    graph_paths: Option<GraphPaths>,
    /// Chooses pairs whose D falls short of the bridge graph.
    short_pairs: ShortPairs,
    /// Finds pairs at which the actor gets stuck.
    imagined_walks: ImaginedWalks,
    /// Inference buffers, lent to those three.
    scratch: Scratch,
    training: Training<Shapes>,
}

impl Gdg {
    /// Creates networks for an environment of `spec`. `threads` share the work of each update, which
    /// does not change its result.
    ///
    /// # Errors
    /// Returns an error if states are too large, or a tensor operation fails.
    pub fn new(
        spec: &Spec,
        settings: &LearnSettings,
        threads: impl Into<Threads>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        let training = Training::new(Shapes::new(spec, settings), settings, threads, rng)?;
        Ok(Self {
            sampler: BatchSampler::new(spec, settings),
            graph_paths: GraphPaths::new(settings),
            short_pairs: ShortPairs::default(),
            imagined_walks: ImaginedWalks::default(),
            scratch: Scratch::default(),
            training,
        })
    }

    /// Returns the networks' shapes and input features.
    fn shapes(&self) -> &Shapes {
        self.training.objective()
    }

    /// Returns critic `k`; the actor is trained through the first.
    pub fn critic(&self, k: usize) -> &Network {
        self.training.network(k)
    }

    /// Returns the dynamics model.
    pub fn model(&self) -> &Network {
        self.training.network(self.shapes().critics)
    }

    /// Returns the actor.
    pub fn actor(&self) -> &Network {
        self.training.actor()
    }

    /// Returns the number of updates done.
    pub fn updates(&self) -> u64 {
        self.training.updates()
    }

    /// Updates critics, model, actor and averages once on `batch` (Algorithm 1's inner loop) and
    /// adds the time to `profile`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn update_on(
        &self,
        batch: &Batch,
        job: Option<&Job>,
        profile: &mut Profile,
    ) -> Result<Losses> {
        self.training.batch().write().clone_from(batch);
        self.training.update(job, profile)
    }

    /// Returns the losses and the gradients (flat parameters and table) of the first critic, the
    /// model and the actor on `batch`, all at the current weights and without a step. For checks
    /// against other implementations.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn gradients(&self, batch: &Batch) -> Result<(Losses, [FullGradient; 3])> {
        let (losses, model) = (self.training.compute_gradients(batch)?, self.shapes().critics);
        Ok((losses, [0, model, model + 1].map(|k| self.training.full_gradient(k))))
    }

    /// Returns the losses at the current weights in candle operations.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn reference(&self) -> Result<Reference<'_>> {
        Reference::new(self.shapes(), self.training.networks())
    }

    /// Returns the losses in candle operations at the weights that targets use: the running
    /// averages of critics and actor, and the model, which has none.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn target_reference(&self) -> Result<Reference<'_>> {
        let encoder = &self.shapes().encoder;
        let networks = self.training.networks();
        let parameters = networks.map(|network| Parameters::copied(network, encoder, true));
        Reference::with_parameters(self.shapes(), parameters.collect::<Result<_>>()?)
    }

    /// Calls `use_nets` with the current networks or their running averages; no update can run in
    /// the meantime.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn with_nets<R>(&self, averaged: bool, use_nets: impl FnOnce(Nets) -> R) -> Result<R> {
        self.training.with_nets(averaged, use_nets)
    }
}

impl PhasedLearner for Gdg {
    type Objective = Shapes;

    fn name(&self) -> &'static str {
        NAME
    }

    fn training(&self) -> &Training<Shapes> {
        &self.training
    }

    fn sample(&mut self, data: TrainingData, batch: &mut Batch) -> Result<()> {
        self.sampler.sample(data.replay, data.relearning, data.rng, batch);
        let Some(known) = &data.known else { return Ok(()) };
        let Self { sampler, graph_paths, short_pairs, imagined_walks, scratch, training, .. } =
            self;
        let spec = training.objective().encoder.spec();
        let (_, count) = sampler.known_rows(batch);
        short_pairs.draw(spec, known, count, data.rng);
        training.with_nets(true, |mut nets| {
            // The second critic would double the cost and change little.
            nets.critics.truncate(1);
            imagined_walks.apply(spec, &nets, sampler, batch, scratch);
            let short = short_pairs.choose(&nets, scratch);
            let first = sampler.add_known(known, short, data.rng, batch);
            let Some(paths) = graph_paths else { return };
            paths.apply(spec, &nets, known, batch, first, scratch);
        })
    }

    fn critics_for_export(&self, averaged: bool) -> Result<Option<CriticsExport>> {
        let (shapes, model) = (self.shapes(), self.model());
        let critics = (0..shapes.critics).map(|k| self.critic(k));
        CriticsExport::of(shapes, critics, model, averaged).map(Some)
    }
}
