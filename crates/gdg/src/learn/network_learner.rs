//! The built-in learners: variants of one, whose networks hand-written kernels update on several
//! threads.
//!
//! - `gdg`, the goal-distance gradient (Algorithm 1): distance critics, a dynamics model and an actor
//!   that descends D(f(s, mu(s, g)), g).
//! - `gdg-distance`, the same with the distance given (the paper's section 4.1): D(s, g) = |s - g|,
//!   the straight line from the achieved goal to the goal. Where something is in the way, such as the
//!   walls of a maze, D ignores it: the actor walks straight at the goal.
//! - `ddpg`, `her` and `ddpg-distance`, the rivals that learn from rewards: Q(s, a, g) and mu(s, g)
//!   with target networks (Lillicrap et al. 2016), goals as inputs (Schaul et al. 2015) and, for
//!   `her`, goals relabelled in hindsight (Andrychowicz et al. 2017, strategy "future"). With two
//!   critics, targets use their minimum, and `target_noise` smooths them (Fujimoto et al. 2018,
//!   sections 4.2 and 5.3; TD3 without its delayed actor). The target is r + gamma Q'(s', mu'(s', g),
//!   g); a state at the goal ends the task, the end of an episode's time does not. Losses are in units
//!   of the reward. Distances known from the bridge graph are not used.
//! - `random`: random actions without learning. It keeps the networks that a run of `gdg` trained
//!   before, so that the run can continue with them.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::job::Job;
use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::data::graph_paths::follow_graph;
use crate::learn::data::hard_pairs::{imagine_walks, short_pairs};
use crate::learn::error::LearnError;
use crate::learn::learner::{Acting, Learner, LearnerKind, TrainingData};
use crate::learn::networks::encoder::CONTACT_SCALES;
use crate::learn::networks::named_arrays::{ActorExport, CriticsExport};
use crate::learn::networks::policy::{Frozen, Nets, Policy, Scratch};
use crate::learn::networks::rescale;
use crate::learn::networks::returns::Reward;
use crate::learn::networks::shapes::{Critics, Shapes};
use crate::learn::settings::LearnSettings;
use crate::learn::update::profile::{Losses, Profile, TrainingPhase, phase_time};
use crate::learn::update::threads::Threads;
use crate::learn::update::trained_networks::Training;
use crate::store::{Store, StoreError};

#[derive(Clone, Copy, Debug)]
pub struct LearnerVariant {
    name: &'static str,
    about: &'static str,
    /// Prefix of the networks' names in checkpoints. Variants with the same prefix can continue
    /// with each other's networks.
    prefix: &'static str,
    critics: Critics,
    hindsight: bool,
    acting: Acting,
}

/// Goal-distance gradient.
pub const GDG: LearnerVariant = LearnerVariant {
    name: "gdg",
    about: "trains an actor through a distance critic and a dynamics model",
    prefix: "",
    critics: Critics::Distance,
    hindsight: true,
    acting: Acting::Policy,
};
const DDPG: LearnerVariant = LearnerVariant {
    name: "ddpg",
    about: "deep deterministic policy gradient; -1 a step up to the goal",
    prefix: "ddpg.",
    critics: Critics::Value(Reward::Sparse),
    hindsight: false,
    ..GDG
};

pub const VARIANTS: [LearnerVariant; 6] = [
    GDG,
    LearnerVariant {
        name: "gdg-distance",
        about: "gdg with D given as the straight line; learns model and actor",
        prefix: "gdg-distance.",
        critics: Critics::Given,
        ..GDG
    },
    DDPG,
    LearnerVariant {
        name: "her",
        about: "ddpg with hindsight experience replay",
        hindsight: true,
        ..DDPG
    },
    LearnerVariant {
        name: "ddpg-distance",
        about: "ddpg rewarded by minus the straight-line distance",
        prefix: "ddpg-distance.",
        critics: Critics::Value(Reward::Distance),
        ..DDPG
    },
    LearnerVariant {
        name: "random",
        about: "random actions without learning",
        acting: Acting::AtRandom,
        ..GDG
    },
];

/// Returns the registry entry of variant number `V`.
pub const fn kind<const V: usize>() -> LearnerKind {
    LearnerKind {
        name: VARIANTS[V].name,
        about: VARIANTS[V].about,
        is_rewarded: matches!(VARIANTS[V].critics, Critics::Value(_)),
        create: |spec, settings, threads, rng| {
            Ok(Box::new(NetworkLearner::new(VARIANTS[V], spec, settings, threads, rng)?))
        },
        parameters: |spec, settings| VARIANTS[V].shapes(spec, settings).count_parameters(),
    }
}

impl LearnerVariant {
    #[cfg(test)]
    pub fn is_random(self) -> bool {
        self.acting == Acting::AtRandom
    }

    fn shapes(self, spec: &Spec, settings: &LearnSettings) -> Shapes {
        Shapes::new(spec, settings, self.prefix, self.critics)
    }
}

/// Mean errors of the dynamics model in D, in steps and as a share of D, of which both are exceeded
/// where plans and targets no longer look ahead. Where many numbers depend on each other, an actor
/// finds actions of which a model errs on the good side, and D becomes as short as if objects moved by
/// themselves. The model then errs by fewer steps of D, so that only the share says when to trust it
/// again. A D that has been learned from behaviour first is not led astray so easily: the share
/// grows to the second one within [`SETTLED_UPDATES`] where there are contacts.
const LARGEST_ERROR_STEPS: f32 = 0.25;
const LARGEST_ERROR_SHARES: [f32; 2] = [0.03, 0.07];
const SETTLED_UPDATES: f32 = 20_000.0;

const MODEL_ERROR: &str = "learner_model_error";

/// Averaging window of that error, in updates.
const ERROR_UPDATES: f32 = 500.0;

/// The actor's walks are imagined in one of this many updates, which finds nearly as many places where it
/// gets stuck in half of the time.
const WALKS_EVERY_UPDATES: u64 = 2;

/// Whether a model whose mean error in D is `steps`, or a `share` of D, is off by too much to look ahead
/// after a number of updates, if it `was` before.
pub fn is_too_far_off(was: bool, [steps, share]: [f32; 2], updates: u64) -> bool {
    let settled = (updates as f32 / SETTLED_UPDATES).min(1.0);
    let [first, last] = LARGEST_ERROR_SHARES;
    share > first + settled * (last - first) && (was || steps > LARGEST_ERROR_STEPS)
}

/// The networks of a built-in learner, and everything needed to train them.
pub struct NetworkLearner {
    variant: LearnerVariant,
    sampler: BatchSampler,
    /// Inference buffers for what the bridge graph adds to batches.
    scratch: Scratch,
    training: Training,
    /// Means of the model's error in D over the latest updates, in steps and as a share of D, and 1 where
    /// it is not to be trusted.
    model_error: [f32; 3],
}

impl NetworkLearner {
    /// Creates networks for an environment of `spec`. `threads` share the work of each update, which
    /// does not change its result.
    ///
    /// # Errors
    /// A tensor operation fails.
    pub fn new(
        variant: LearnerVariant,
        spec: &Spec,
        settings: &LearnSettings,
        threads: impl Into<Threads>,
        rng: &mut ChaCha8Rng,
    ) -> candle_core::Result<Self> {
        let training = Training::new(variant.shapes(spec, settings), settings, threads, rng)?;
        let mut settings = settings.clone();
        if !variant.hindsight {
            (settings.goal_hindsight, settings.goal_random) = (0.0, 0.0);
        }
        let returns = training.shapes().returns.clone();
        let sampler = BatchSampler { spec: spec.clone(), settings, returns };
        Ok(Self { variant, sampler, scratch: Scratch::default(), training, model_error: [0.0; 3] })
    }

    /// Updates all networks once on `batch` (Algorithm 1's inner loop) and adds the time to
    /// `profile`.
    ///
    /// # Errors
    /// A tensor operation fails.
    pub fn update_on(
        &self,
        batch: &Batch,
        job: Option<&Job>,
        profile: &mut Profile,
    ) -> candle_core::Result<Losses> {
        self.training.batch().write().clone_from(batch);
        self.training.update(job, profile)
    }

    /// Whether the model is exact enough to look ahead.
    fn looks_ahead(&self) -> bool {
        self.model_error[2] == 0.0
    }

    #[cfg(test)]
    pub(in crate::learn) fn training(&self) -> &Training {
        &self.training
    }

    fn sample(
        &mut self,
        TrainingData { replay, known, relearning, rng, .. }: TrainingData,
        profile: &mut Profile,
    ) -> candle_core::Result<()> {
        let mut began = phase_time();
        let (looks_ahead, updates) = (self.looks_ahead(), self.training.actor().dense.steps());
        let Self { variant, sampler, scratch, training, .. } = self;
        let batch = &mut *training.batch().write();
        let relearning = relearning.filter(|_| sampler.returns.is_none());
        sampler.sample(replay, relearning, rng, batch);
        batch.greedy_targets &= looks_ahead;
        began = profile.lap(TrainingPhase::Sample, began);
        let Some(known) = known.filter(|_| variant.critics == Critics::Distance) else {
            return Ok(());
        };
        training.with_nets(true, |mut nets| {
            // The second critic would double the cost and change little.
            nets.critics.truncate(1);
            let (_, count) = sampler.known_rows(batch);
            let short = short_pairs(&sampler.spec, &nets, &known, count, rng, scratch);
            began = profile.lap(TrainingPhase::ShortPairs, began);
            if updates.is_multiple_of(WALKS_EVERY_UPDATES) {
                imagine_walks(&nets, sampler, batch, scratch);
            }
            began = profile.lap(TrainingPhase::ImaginedWalks, began);
            let first = sampler.add_known(&known, &short, rng, batch);
            began = profile.lap(TrainingPhase::Sample, began);
            follow_graph(sampler, &nets, &known, batch, first, scratch);
            profile.lap(TrainingPhase::Paths, began);
        })
    }
}

impl Learner for NetworkLearner {
    fn kind(&self) -> &'static str {
        self.variant.name
    }

    fn update(&mut self, data: TrainingData, profile: &mut Profile) -> Result<Losses, LearnError> {
        if self.variant.acting == Acting::AtRandom {
            return Ok(Losses::default());
        }
        let job = data.job;
        self.sample(data, profile)?;
        let losses = self.training.update(Some(job), profile)?;
        let now = [losses.model_steps, losses.model_steps / losses.actor.max(1.0)];
        let spec = &self.sampler.spec;
        let updates =
            if spec.contacts.is_empty() { 0 } else { self.training.actor().dense.steps() };
        let [steps, share, is_off] = &mut self.model_error;
        for (mean, now) in [&mut *steps, &mut *share].into_iter().zip(now) {
            *mean += (now - *mean) / ERROR_UPDATES;
        }
        *is_off = f32::from(u8::from(is_too_far_off(*is_off > 0.0, [*steps, *share], updates)));
        Ok(losses)
    }

    fn policy(&self, averaged: bool) -> Result<Arc<dyn Policy>, LearnError> {
        let frozen = self.training.freeze(averaged)?;
        Ok(Arc::new(Frozen { looks_ahead: self.looks_ahead(), ..frozen }))
    }

    fn with_policy(
        &self,
        averaged: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> Result<(), LearnError> {
        let looks_ahead = self.looks_ahead();
        Ok(self.training.with_nets(averaged, |nets| use_policy(&Nets { looks_ahead, ..nets }))?)
    }

    fn export_actor(&self, averaged: bool) -> Result<Option<ActorExport>, LearnError> {
        let shapes = self.training.shapes();
        let is_learned = self.variant.acting == Acting::Policy && shapes.returns.is_none();
        let export = || ActorExport::of(shapes, self.training.actor(), averaged);
        Ok(is_learned.then(export).transpose()?)
    }

    fn export_critics(&self, averaged: bool) -> Result<Option<CriticsExport>, LearnError> {
        let shapes = self.training.shapes();
        let LearnerVariant { acting, critics, .. } = self.variant;
        let export = || {
            let critics = (0..shapes.critics).map(|k| self.training.network(k));
            let model = self.training.network(shapes.critics);
            CriticsExport::of(shapes, critics, model, averaged).map(|mut export| {
                if !self.looks_ahead() {
                    export.outputs.tried_actions.clear();
                }
                export
            })
        };
        let is_learned = acting == Acting::Policy && critics == Critics::Distance;
        Ok(is_learned.then(export).transpose()?)
    }

    fn acting(&self) -> Acting {
        self.variant.acting
    }

    fn is_finite(&self) -> Result<bool, LearnError> {
        Ok(self.training.is_finite()?)
    }

    fn save(&self, store: &mut Store) -> Result<(), LearnError> {
        store.put_text("learner_updates", self.training.actor().dense.steps().to_string());
        store.put_numbers(MODEL_ERROR, self.model_error.to_vec());
        for (name, network) in self.training.named() {
            network.save(name, store)?;
        }
        Ok(())
    }

    fn save_in_scales_of(&self, spec: &Spec, store: &mut Store) -> Result<(), LearnError> {
        self.save(store)?;
        let shapes = self.training.shapes();
        let specs = [&shapes.encoder.spec, spec];
        for (k, (name, network)) in self.training.named().enumerate() {
            rescale::inputs(store, name, network.dense.mlp, specs);
            if shapes.returns.is_none() && k == shapes.critics {
                rescale::outputs(store, name, network.dense.mlp, specs);
            }
            let read = shapes.encoder.contact_columns();
            let end = read.start + spec.contacts.len() * CONTACT_SCALES.len();
            rescale::widen(store, name, network.dense.mlp, read.end..end);
        }
        Ok(())
    }

    fn load(&mut self, store: &Store) -> Result<(), LearnError> {
        let updates = store.text("learner_updates")?.parse::<u32>();
        let updates = updates
            .map_err(|_| StoreError::inconsistent("its number of updates is out of range"))?;
        // Earlier checkpoints have none.
        let error = store.numbers(MODEL_ERROR).ok().and_then(|numbers| numbers.try_into().ok());
        self.model_error = error.unwrap_or_default();
        let mut networks = self.training.named();
        networks.try_for_each(|(name, network)| network.load(name, store, updates.into()))
    }
}
