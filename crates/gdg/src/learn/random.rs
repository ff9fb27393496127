//! Random actions without learning: the baseline for learners.

use std::sync::Arc;

use crate::learn::error::LearnError;
use crate::learn::gdg::{self, Gdg};
use crate::learn::learner::{Acting, Learner, LearnerKind, TrainingData};
use crate::learn::networks::policy::Policy;
use crate::learn::update::losses::Losses;
use crate::learn::update::profile::Profile;
use crate::store::Store;

/// Registry entry of the learner.
pub const KIND: LearnerKind = LearnerKind {
    name: NAME,
    about: "random actions without learning",
    is_rewarded: false,
    create: |spec, settings, threads, rng| {
        Ok(Box::new(Random(Gdg::new(spec, settings, threads, rng)?)))
    },
    parameters: gdg::KIND.parameters,
};

const NAME: &str = "random";

/// Acts at random. Keeps the networks that a run trained before untouched, so that the run can
/// continue with them.
struct Random(Gdg);

impl Learner for Random {
    fn kind(&self) -> &'static str {
        NAME
    }

    fn update(&mut self, _: TrainingData, _: &mut Profile) -> Result<Losses, LearnError> {
        Ok(Losses::default())
    }

    fn policy(&self, averaged: bool) -> Result<Arc<dyn Policy>, LearnError> {
        self.0.policy(averaged)
    }

    fn with_policy(
        &self,
        averaged: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> Result<(), LearnError> {
        self.0.with_policy(averaged, use_policy)
    }

    fn acting(&self) -> Acting {
        Acting::AtRandom
    }

    fn save(&self, store: &mut Store) -> Result<(), LearnError> {
        self.0.save(store)
    }

    fn load(&mut self, store: &Store) -> Result<(), LearnError> {
        self.0.load(store)
    }
}
