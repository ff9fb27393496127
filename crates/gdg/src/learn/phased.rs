//! Shared code of learners whose networks are updated in phases.

use std::sync::Arc;
use std::time::Instant;

use crate::learn::error::LearnError;
use crate::learn::learner::{Learner, TrainingData};
use crate::learn::networks::export::{ActorExport, CriticsExport};
use crate::learn::networks::network::{load_networks, save_networks};
use crate::learn::networks::policy::Policy;
use crate::learn::update::losses::Losses;
use crate::learn::update::objective::Objective;
use crate::learn::update::profile::{Profile, Stage};
use crate::learn::update::training::Training;
use crate::store::Store;

/// A learner whose networks are updated in phases, on several threads.
pub trait PhasedLearner: Send {
    /// What its networks compute and learn.
    type Objective: Objective;

    /// Returns the name of its [`crate::learn::LearnerKind`].
    fn name(&self) -> &'static str;

    /// Returns its networks.
    fn training(&self) -> &Training<Self::Objective>;

    /// Draws the batch of an update.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    fn sample(
        &mut self,
        data: TrainingData,
        batch: &mut <Self::Objective as Objective>::Batch,
    ) -> candle_core::Result<()>;

    /// Returns whether other programs can run its actor.
    fn exports_actor(&self) -> bool {
        true
    }

    /// Returns critics and dynamics model, or their running averages, for other programs, if there
    /// are any.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    fn critics_for_export(&self, _averaged: bool) -> candle_core::Result<Option<CriticsExport>> {
        Ok(None)
    }
}

impl<L: PhasedLearner> Learner for L {
    fn kind(&self) -> &'static str {
        self.name()
    }

    fn update(&mut self, data: TrainingData, profile: &mut Profile) -> Result<Losses, LearnError> {
        let (began, job) = (Instant::now(), data.job);
        let batch = self.training().batch().clone();
        self.sample(data, &mut batch.write())?;
        profile.lap(Stage::Sample, began);
        Ok(self.training().update(Some(job), profile)?)
    }

    fn policy(&self, averaged: bool) -> Result<Arc<dyn Policy>, LearnError> {
        Ok(Arc::new(self.training().freeze(averaged)?))
    }

    fn with_policy(
        &self,
        averaged: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> Result<(), LearnError> {
        Ok(self.training().with_nets(averaged, |nets| use_policy(&nets))?)
    }

    fn export_actor(&self, averaged: bool) -> Result<Option<ActorExport>, LearnError> {
        Ok(self.exports_actor().then(|| self.training().export_actor(averaged)).transpose()?)
    }

    fn export_critics(&self, averaged: bool) -> Result<Option<CriticsExport>, LearnError> {
        Ok(self.critics_for_export(averaged)?)
    }

    fn is_finite(&self) -> Result<bool, LearnError> {
        Ok(self.training().is_finite()?)
    }

    fn save(&self, store: &mut Store) -> Result<(), LearnError> {
        let training = self.training();
        Ok(save_networks(store, training.updates(), training.named())?)
    }

    fn load(&mut self, store: &Store) -> Result<(), LearnError> {
        Ok(load_networks(store, self.training().named())?)
    }
}
