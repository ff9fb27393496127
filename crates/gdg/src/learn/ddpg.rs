//! Deep deterministic policy gradient with goals: the rivals that learn from rewards.
//!
//! Q(s, a, g) and mu(s, g) with target networks (Lillicrap et al. 2016), goals as inputs (Schaul et
//! al. 2015) and, for `her`, goals relabelled in hindsight (Andrychowicz et al. 2017, strategy
//! "future"). With two critics, targets use their minimum, and `target_noise` smooths them
//! (Fujimoto et al. 2018, sections 4.2 and 5.3; TD3 without its delayed actor). The target is r +
//! gamma Q'(s', mu'(s', g), g); a state at the goal ends the task, the end of an episode's time
//! does not.

mod batch;
mod losses;
mod policy;
mod returns;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Instant;

use candle_core::Result;
use parking_lot::{Mutex, RwLock};
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::error::LearnError;
use crate::learn::learner::{Learner, LearnerKind, TrainingData};
use crate::learn::networks::adam::LearningRates;
use crate::learn::networks::network::{LockedNetwork, Network};
use crate::learn::networks::policy::{Policy, Scratch};
use crate::learn::networks::shapes::check_state_dim;
use crate::learn::networks::state::{load_networks, save_networks};
use crate::learn::networks::touched::TouchedCorners;
use crate::learn::settings::LearnSettings;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::Losses;
use crate::learn::update::pool::ThreadPool;
use crate::learn::update::profile::{Profile, Stage};
use crate::learn::update::rows::{find_corners, parts_of};
use crate::learn::update::step::{Half, step_half};
use crate::learn::update::tape::refuse_tape;
use crate::pulse::Parts;
use crate::store::Store;
use batch::{Sampler, Transitions};
use losses::{Part, Rows, Shapes};
use policy::{FrozenNets, Nets};
use returns::Reward;

/// What sets the learners apart.
struct Variant {
    name: &'static str,
    reward: Reward,
    /// Whether goals are relabelled.
    hindsight: bool,
    /// Beginning of the networks' names in checkpoints: those of the same values can go on with
    /// each other's.
    prefix: &'static str,
}

static SPARSE: Variant =
    Variant { name: "ddpg", reward: Reward::Sparse, hindsight: false, prefix: "ddpg" };
static HINDSIGHT: Variant = Variant { name: "her", hindsight: true, ..SPARSE };
static DISTANCE: Variant =
    Variant { name: "ddpg-distance", reward: Reward::Distance, prefix: "ddpg-distance", ..SPARSE };

/// Registry entry: sparse rewards, goals as they were pursued.
pub const DDPG: LearnerKind = LearnerKind {
    name: SPARSE.name,
    about: "deep deterministic policy gradient; -1 a step up to the goal",
    is_rewarded: true,
    create: |spec, settings, threads, rng| {
        Ok(Box::new(Ddpg::new(&SPARSE, (spec, settings), threads, rng)?))
    },
    parameters,
};

/// Registry entry: sparse rewards, goals relabelled in hindsight.
pub const HER: LearnerKind = LearnerKind {
    name: HINDSIGHT.name,
    about: "ddpg with hindsight experience replay",
    is_rewarded: true,
    create: |spec, settings, threads, rng| {
        Ok(Box::new(Ddpg::new(&HINDSIGHT, (spec, settings), threads, rng)?))
    },
    parameters,
};

/// Registry entry: rewards from straight-line distance, goals as they were pursued.
pub const DDPG_DISTANCE: LearnerKind = LearnerKind {
    name: DISTANCE.name,
    about: "ddpg rewarded by minus the straight-line distance",
    is_rewarded: true,
    create: |spec, settings, threads, rng| {
        Ok(Box::new(Ddpg::new(&DISTANCE, (spec, settings), threads, rng)?))
    },
    parameters,
};

/// Returns the number of trainable parameters in all networks that `settings` specify.
fn parameters(spec: &Spec, settings: &LearnSettings) -> u64 {
    let shapes = Shapes::new(spec, settings, Reward::Sparse);
    let of = |mlp| shapes.encoder.parameters_with(mlp);
    settings.critics as u64 * of(&shapes.critic) + of(&shapes.actor)
}

/// The networks and everything needed to train them.
struct Ddpg {
    variant: &'static Variant,
    sampler: Sampler,
    /// The latest batch.
    batch: Transitions,
    shared: Arc<Shared>,
    pool: ThreadPool,
}

/// Data shared by the threads of an update.
struct Shared {
    shapes: Arc<Shapes>,
    rates: LearningRates,
    /// The actor is trained through the first.
    critics: Vec<Network>,
    actor: Network,
    parts: Vec<Mutex<Part>>,
    batch: RwLock<Transitions>,
    /// Grid table corners that the batch's states and goals touch.
    touched: RwLock<TouchedCorners>,
}

impl Ddpg {
    /// Creates networks for an environment of `spec`. Updates run on `threads` threads, which does
    /// not change their results.
    fn new(
        variant: &'static Variant,
        (spec, settings): (&Spec, &LearnSettings),
        threads: usize,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        check_state_dim(spec)?;
        refuse_tape(settings.backend, variant.name)?;
        let shapes = Arc::new(Shapes::new(spec, settings, variant.reward));
        let mut network = |mlp| Network::new(mlp, shapes.encoder.grid(), Some(settings.tau), rng);
        let critics =
            (0..settings.critics).map(|_| network(shapes.critic)).collect::<Result<Vec<_>>>()?;
        let actor = network(shapes.actor)?;
        let shared = Shared {
            rates: LearningRates::from_settings(settings),
            parts: (0..parts_of(settings.batch_size))
                .map(|_| Mutex::new(Part::new(critics.len())))
                .collect(),
            critics,
            actor,
            batch: RwLock::default(),
            touched: RwLock::default(),
            shapes: shapes.clone(),
        };
        Ok(Self {
            sampler: Sampler::new(spec, settings, shapes.returns.clone(), variant.hindsight),
            variant,
            batch: Transitions::default(),
            shared: Arc::new(shared),
            pool: ThreadPool::new(threads),
        })
    }

    /// Updates critics, actor and target networks once on `batch`, in parts that are `asked` for if
    /// it takes long, and adds the time to `profile`.
    fn update_on(
        &mut self,
        batch: &Transitions,
        asked: Option<&Arc<Parts>>,
        profile: &mut Profile,
    ) -> Result<Losses> {
        let began = Instant::now();
        self.shared.batch.write().clone_from(batch);
        let (parts, critics) = (self.shared.parts.len(), self.shared.critics.len());
        let run = |tasks, work: fn(&Shared, usize) -> Result<()>| {
            self.pool.try_run(tasks, &self.shared, asked, work)
        };
        run(1 + parts, Shared::touched_corners_or_gradients)?;
        let began = profile.lap(Stage::CriticModelGradients, began);
        run(2 * critics, Shared::step_critics)?;
        let began = profile.lap(Stage::CriticModelSteps, began);
        run(parts, Shared::actor_gradient)?;
        let began = profile.lap(Stage::ActorGradient, began);
        run(2, Shared::step_actor)?;
        profile.lap(Stage::ActorStep, began);
        Ok(self.shared.parts.iter().map(|part| part.lock().losses).sum())
    }

    /// Calls `use_nets` with the current networks or the target networks; no update can run in the
    /// meantime.
    fn with_nets<R>(&self, averaged: bool, use_nets: impl FnOnce(Nets) -> R) -> Result<R> {
        let (critics, actor) = self.shared.lock();
        Ok(use_nets(Nets {
            shapes: &self.shared.shapes,
            critics: critics.iter().map(|l| l.weights(averaged)).collect::<Result<_>>()?,
            actor: actor.weights(averaged)?,
        }))
    }

    /// Returns all networks with their names.
    fn named(&self) -> impl Iterator<Item = (String, &Network)> {
        let prefix = self.variant.prefix;
        let critics = self.shared.critics.iter().enumerate();
        let critics = critics.map(move |(k, critic)| (format!("{prefix}.critic{k}"), critic));
        critics.chain([(format!("{prefix}.actor"), &self.shared.actor)])
    }
}

impl Learner for Ddpg {
    fn kind(&self) -> &'static str {
        self.variant.name
    }

    /// Performs one update. The losses are the critics' mean squared error and the mean of -Q(s,
    /// mu(s, g), g), both in units of the reward. Distances known from the bridge graph are not
    /// used.
    fn update(
        &mut self,
        data: TrainingData,
        profile: &mut Profile,
    ) -> std::result::Result<Losses, LearnError> {
        let began = Instant::now();
        let mut batch = std::mem::take(&mut self.batch);
        self.sampler.sample(data.replay, data.rng, &mut batch);
        profile.lap(Stage::Sample, began);
        let losses = self.update_on(&batch, data.parts, profile);
        self.batch = batch;
        Ok(losses?)
    }

    fn policy(&self, averaged: bool) -> std::result::Result<Arc<dyn Policy>, LearnError> {
        let Shared { shapes, critics, actor, .. } = &*self.shared;
        let critics = critics.iter().map(|critic| critic.copy(averaged)).collect::<Result<_>>()?;
        Ok(Arc::new(FrozenNets::new(shapes.clone(), critics, actor.copy(averaged)?)))
    }

    fn with_policy(
        &self,
        averaged: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> std::result::Result<(), LearnError> {
        Ok(self.with_nets(averaged, |nets| use_policy(&nets))?)
    }

    /// Returns whether the target networks give finite distances on the latest batch.
    fn is_finite(&self) -> std::result::Result<bool, LearnError> {
        let mut distances = vec![0.0; self.batch.len()];
        let (states, goals) = (&self.batch.states, &self.batch.goals);
        self.with_nets(true, |nets| {
            nets.distances(states, goals, &mut distances, &mut Scratch::default());
        })?;
        Ok(distances.iter().all(|d| d.is_finite()))
    }

    fn save(&self, store: &mut Store) -> std::result::Result<(), LearnError> {
        Ok(save_networks(store, self.shared.actor.steps(), self.named())?)
    }

    fn load(&mut self, store: &Store) -> std::result::Result<(), LearnError> {
        Ok(load_networks(store, self.named())?)
    }
}

impl Shared {
    /// Locks critics and actor for reading.
    fn lock(&self) -> (Vec<LockedNetwork<'_>>, LockedNetwork<'_>) {
        (self.critics.iter().map(Network::lock).collect(), self.actor.lock())
    }

    /// Runs one task of an update's first phase: the first finds the corners that the steps will
    /// touch, each other one computes the critics' gradients on its part of the batch.
    fn touched_corners_or_gradients(&self, task: usize) -> Result<()> {
        if let Some(part) = task.checked_sub(1) {
            return self.critic_gradients(part);
        }
        self.find_touched_corners();
        Ok(())
    }

    /// Finds the corners that the batch's states and goals touch.
    fn find_touched_corners(&self) {
        let (encoder, batch) = (&self.shapes.encoder, self.batch.read());
        let parts = (0..self.parts.len()).map(|part| Rows::new(encoder.spec(), &batch, part));
        find_corners(
            encoder,
            parts.map(|rows| (rows.states, rows.goals)),
            &mut self.touched.write(),
        );
    }

    /// Computes the critics' gradients on part `i` of the batch.
    fn critic_gradients(&self, i: usize) -> Result<()> {
        let (critics, actor) = self.lock();
        let current = critics.iter().map(|l| l.weights(false)).collect::<Result<Vec<_>>>()?;
        let targets = critics.iter().map(|l| l.weights(true)).collect::<Result<Vec<_>>>()?;
        let batch = self.batch.read();
        let rows = Rows::new(self.shapes.encoder.spec(), &batch, i);
        self.parts[i].lock().critic_gradients(
            &self.shapes,
            &rows,
            &current,
            (actor.weights(true)?, &targets),
        );
        Ok(())
    }

    /// Computes the actor's gradient on part `i` of the batch.
    fn actor_gradient(&self, i: usize) -> Result<()> {
        let (actor, critic) = (self.actor.lock(), self.critics[0].lock());
        let batch = self.batch.read();
        let rows = Rows::new(self.shapes.encoder.spec(), &batch, i);
        let networks = (actor.weights(false)?, critic.weights(false)?);
        self.parts[i].lock().actor_gradient(&self.shapes, &rows, networks);
        Ok(())
    }

    /// Steps the critics, in two tasks each.
    fn step_critics(&self, task: usize) -> Result<()> {
        self.step(&self.critics[task / 2], task, |part| &mut part.critics[task / 2])
    }

    /// Steps the actor, in two tasks.
    fn step_actor(&self, task: usize) -> Result<()> {
        self.step(&self.actor, task, |part| &mut part.actor)
    }

    fn step(
        &self,
        network: &Network,
        task: usize,
        gradient: impl Fn(&mut Part) -> &mut Gradient,
    ) -> Result<()> {
        step_half(
            network,
            Half::for_task(task),
            &self.touched.read(),
            self.rates,
            (&self.parts, gradient),
        )
    }
}
