//! Goal-distance gradient with the distance given (the paper's section 4.1): D(s, g) = |s - g|, the
//! straight line from the achieved goal to the goal. Only the dynamics model f and the actor mu are
//! learned: mu descends |f(s, mu(s, g)) - g|, through the frozen model.
//!
//! Where something is in the way, such as the walls of a maze, D ignores it: the actor walks
//! straight at the goal. There is no critic, so its loss is 0, and distances known from the bridge
//! graph are not used.

mod objective;
#[cfg(test)]
mod tests;

use candle_core::Result;
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::learner::{LearnerKind, TrainingData};
use crate::learn::phased::PhasedLearner;
use crate::learn::settings::LearnSettings;
use crate::learn::update::objective::count_parameters;
use crate::learn::update::threads::Threads;
use crate::learn::update::training::Training;
use objective::GivenDistance;

/// Registry entry of the learner.
pub const KIND: LearnerKind = LearnerKind {
    name: NAME,
    about: "gdg with D given as the straight line; learns model and actor",
    is_rewarded: false,
    create: |spec, settings, threads, rng| {
        Ok(Box::new(GdgDistance::new(spec, settings, threads, rng)?))
    },
    parameters: |spec, settings| count_parameters(&GivenDistance::new(spec, settings)),
};

const NAME: &str = "gdg-distance";

/// The networks and everything needed to train them.
struct GdgDistance {
    sampler: BatchSampler,
    training: Training<GivenDistance>,
}

impl GdgDistance {
    /// Creates networks for an environment of `spec`. `threads` share the work of each update, which
    /// does not change its result.
    fn new(
        spec: &Spec,
        settings: &LearnSettings,
        threads: impl Into<Threads>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        let objective = GivenDistance::new(spec, settings);
        let training = Training::new(objective, settings, threads, rng)?;
        Ok(Self { sampler: BatchSampler::new(spec, settings), training })
    }
}

impl PhasedLearner for GdgDistance {
    type Objective = GivenDistance;

    fn name(&self) -> &'static str {
        NAME
    }

    fn training(&self) -> &Training<GivenDistance> {
        &self.training
    }

    fn sample(&mut self, data: TrainingData, batch: &mut Batch) -> Result<()> {
        self.sampler.sample(data.replay, data.relearning, data.rng, batch);
        Ok(())
    }
}
