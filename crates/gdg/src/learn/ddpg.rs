//! Deep deterministic policy gradient with goals: the rivals that learn from rewards.
//!
//! Q(s, a, g) and mu(s, g) with target networks (Lillicrap et al. 2016), goals as inputs (Schaul et
//! al. 2015) and, for `her`, goals relabelled in hindsight (Andrychowicz et al. 2017, strategy
//! "future"). With two critics, targets use their minimum, and `target_noise` smooths them
//! (Fujimoto et al. 2018, sections 4.2 and 5.3; TD3 without its delayed actor). The target is r +
//! gamma Q'(s', mu'(s', g), g); a state at the goal ends the task, the end of an episode's time
//! does not.
//!
//! The losses are the critics' mean squared error and the mean of -Q(s, mu(s, g), g), both in units
//! of the reward. Distances known from the bridge graph are not used.

mod batch;
mod losses;
mod objective;
mod returns;
#[cfg(test)]
mod tests;

use candle_core::Result;
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::learner::{LearnerKind, TrainingData};
use crate::learn::phased::PhasedLearner;
use crate::learn::settings::LearnSettings;
use crate::learn::update::objective::count_parameters;
use crate::learn::update::threads::Threads;
use crate::learn::update::training::Training;
use batch::{Sampler, Transitions};
use losses::Shapes;
use returns::Reward;

/// How the learners differ.
#[derive(Clone, Copy)]
struct Variant {
    name: &'static str,
    about: &'static str,
    reward: Reward,
    /// Whether goals are relabelled.
    hindsight: bool,
    /// Prefix of the networks' names in checkpoints. Variants with the same prefix can continue
    /// with each other's networks.
    prefix: &'static str,
}

const SPARSE: Variant = Variant {
    name: "ddpg",
    about: "deep deterministic policy gradient; -1 a step up to the goal",
    reward: Reward::Sparse,
    hindsight: false,
    prefix: "ddpg",
};
const HINDSIGHT: Variant = Variant {
    name: "her",
    about: "ddpg with hindsight experience replay",
    hindsight: true,
    ..SPARSE
};
const DISTANCE: Variant = Variant {
    name: "ddpg-distance",
    about: "ddpg rewarded by minus the straight-line distance",
    reward: Reward::Distance,
    prefix: "ddpg-distance",
    ..SPARSE
};

const VARIANTS: [Variant; 3] = [SPARSE, HINDSIGHT, DISTANCE];

/// Registry entry: sparse rewards, goals as they were pursued.
pub const DDPG: LearnerKind = kind::<0>();

/// Registry entry: sparse rewards, goals relabelled in hindsight.
pub const HER: LearnerKind = kind::<1>();

/// Registry entry: rewards from straight-line distance, goals as they were pursued.
pub const DDPG_DISTANCE: LearnerKind = kind::<2>();

/// Returns the registry entry of variant number `V`.
const fn kind<const V: usize>() -> LearnerKind {
    LearnerKind {
        name: VARIANTS[V].name,
        about: VARIANTS[V].about,
        is_rewarded: true,
        create: |spec, settings, threads, rng| {
            Ok(Box::new(Ddpg::new(VARIANTS[V], spec, settings, threads, rng)?))
        },
        parameters: |spec, settings| count_parameters(&Shapes::new(VARIANTS[V], spec, settings)),
    }
}

/// The networks and everything needed to train them.
struct Ddpg {
    name: &'static str,
    sampler: Sampler,
    training: Training<Shapes>,
}

impl Ddpg {
    /// Creates networks for an environment of `spec`. `threads` share the work of each update, which
    /// does not change its result.
    fn new(
        variant: Variant,
        spec: &Spec,
        settings: &LearnSettings,
        threads: impl Into<Threads>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        let shapes = Shapes::new(variant, spec, settings);
        let sampler = Sampler::new(spec, settings, shapes.returns.clone(), variant.hindsight);
        let training = Training::new(shapes, settings, threads, rng)?;
        Ok(Self { name: variant.name, sampler, training })
    }
}

impl PhasedLearner for Ddpg {
    type Objective = Shapes;

    fn name(&self) -> &'static str {
        self.name
    }

    fn training(&self) -> &Training<Shapes> {
        &self.training
    }

    fn sample(&mut self, data: TrainingData, batch: &mut Transitions) -> Result<()> {
        self.sampler.sample(data.replay, data.rng, batch);
        Ok(())
    }

    fn exports_actor(&self) -> bool {
        false
    }
}
