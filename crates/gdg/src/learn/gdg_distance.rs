//! Goal-distance gradient with the distance given (the paper's section 4.1): D(s, g) = |s - g|, the
//! straight line from the achieved goal to the goal. Only the dynamics model f and the actor mu are
//! learned: mu descends
//! |f(s, mu(s, g)) - g|, through the frozen model.
//!
//! Where something is in the way, such as the walls of a maze, D ignores it: the actor walks
//! straight at the goal.

mod policy;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Instant;

use candle_core::Result;
use parking_lot::{Mutex, RwLock};
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::error::LearnError;
use crate::learn::learner::{Learner, LearnerKind, TrainingData};
use crate::learn::networks::adam::LearningRates;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::export::ActorExport;
use crate::learn::networks::features::{Pairs, SharedFeatures};
use crate::learn::networks::network::{Network, Weights};
use crate::learn::networks::policy::{Policy, Scratch};
use crate::learn::networks::shapes::{MAX_STATE_DIM, Shapes, Workspaces, check_state_dim};
use crate::learn::networks::state::{load_networks, save_networks};
use crate::learn::networks::touched::TouchedCorners;
use crate::learn::settings::LearnSettings;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::{Losses, SpecialRows};
use crate::learn::update::pool::ThreadPool;
use crate::learn::update::profile::{Profile, Stage};
use crate::learn::update::rows::{
    Rows, find_corners_of_pairs, find_corners_of_transitions, parts_of,
};
use crate::learn::update::step::{Half, step_half};
use crate::learn::update::straight::StraightLine;
use crate::learn::update::tape::refuse_tape;
use crate::pulse::Parts;
use crate::store::Store;
use policy::{FrozenActor, Nets};

/// Registry entry of the learner.
pub const KIND: LearnerKind = LearnerKind {
    name: NAME,
    about: "gdg with D given as the straight line; learns model and actor",
    is_rewarded: false,
    create: |spec, settings, threads, rng| {
        Ok(Box::new(GdgDistance::new(spec, settings, threads, rng)?))
    },
    parameters,
};

const NAME: &str = "gdg-distance";

/// Returns the number of trainable parameters in the networks that `settings` specify.
fn parameters(spec: &Spec, settings: &LearnSettings) -> u64 {
    let shapes = Shapes::new(Encoder::new(spec, settings), settings);
    shapes.encoder.parameters_with(&shapes.model) + shapes.encoder.parameters_with(&shapes.actor)
}

/// The networks and everything needed to train them.
struct GdgDistance {
    sampler: BatchSampler,
    /// The latest batch.
    batch: Batch,
    shared: Arc<Shared>,
    pool: ThreadPool,
}

/// What the actor descends.
struct Objective {
    shapes: Shapes,
    line: StraightLine,
}

/// Data shared by the threads of an update.
struct Shared {
    objective: Arc<Objective>,
    rates: LearningRates,
    model: Network,
    actor: Network,
    parts: Vec<Mutex<Part>>,
    batch: RwLock<Batch>,
    /// Grid table corners that the batch touches, in its pairs and in its transitions.
    pairs: RwLock<TouchedCorners>,
    transitions: RwLock<TouchedCorners>,
}

/// Buffers of one task of an update.
#[derive(Default)]
struct Part {
    plain: SharedFeatures,
    model: Gradient,
    actor: Gradient,
    buffers: Workspaces,
    losses: Losses,
}

impl Objective {
    /// Computes the actor's gradient of mean |f(s, mu(s, g)) - g| in steps, plus that of the excess
    /// of the actor's outputs over their bound, into `gradient`; `share` is 1 / batch size. Returns
    /// the part's contribution to the mean.
    fn actor_gradient(
        &self,
        (actor, model): (Weights, Weights),
        (pairs, share): (Pairs, f32),
        gradient: &mut Gradient,
        buffers: &mut Workspaces,
    ) -> f32 {
        let spec = self.shapes.encoder.spec();
        let s = spec.state_dim();
        let mut next = std::mem::take(&mut buffers.model.y);
        self.shapes.step_with_actor((actor, model), pairs, &mut next, buffers);
        let (mut loss, mut d_state) = (0.0, [0.0; MAX_STATE_DIM]);
        let d_state = &mut d_state[..s];
        let d_change = &mut next[..pairs.states.len()];
        for (next, goal) in
            d_change.chunks_exact_mut(s).zip(pairs.goals.chunks_exact(spec.goal_dim()))
        {
            loss += share * self.line.gradient(next, goal, d_state);
            for ((next, d), scale) in next.iter_mut().zip(&*d_state).zip(&spec.change_scale) {
                *next = share * scale * d;
            }
        }
        let special = SpecialRows::default();
        self.shapes.actor_gradient_through_model(
            (actor, model),
            pairs,
            (d_change, share, special),
            gradient,
            buffers,
        );
        buffers.model.y = next;
        loss
    }
}

impl GdgDistance {
    /// Creates networks for an environment of `spec`. Updates run on `threads` threads, which does
    /// not change their results.
    fn new(
        spec: &Spec,
        settings: &LearnSettings,
        threads: usize,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        check_state_dim(spec)?;
        refuse_tape(settings.backend, NAME)?;
        let shapes = Shapes::new(Encoder::new(spec, settings), settings);
        let grid = shapes.encoder.grid();
        let shared = Shared {
            rates: LearningRates::from_settings(settings),
            model: Network::new(shapes.model, grid, None, rng)?,
            actor: Network::new(shapes.actor, grid, Some(settings.tau), rng)?,
            parts: (0..parts_of(settings.batch_size)).map(|_| Mutex::default()).collect(),
            batch: RwLock::default(),
            pairs: RwLock::default(),
            transitions: RwLock::default(),
            objective: Arc::new(Objective { shapes, line: StraightLine::new(spec) }),
        };
        Ok(Self {
            sampler: BatchSampler::new(spec, settings),
            batch: Batch::default(),
            shared: Arc::new(shared),
            pool: ThreadPool::new(threads),
        })
    }

    /// Updates model, actor and the actor's average once on `batch`, in parts that are `asked` for
    /// if it takes long, and adds the time to `profile`.
    fn update_on(
        &mut self,
        batch: &Batch,
        asked: Option<&Arc<Parts>>,
        profile: &mut Profile,
    ) -> Result<Losses> {
        let began = Instant::now();
        self.shared.batch.write().clone_from(batch);
        let parts = self.shared.parts.len();
        let run = |tasks, work: fn(&Shared, usize) -> Result<()>| {
            self.pool.try_run(tasks, &self.shared, asked, work)
        };
        run(Shared::TOUCH_TASKS + parts, Shared::touched_corners_or_gradients)?;
        let began = profile.lap(Stage::CriticModelGradients, began);
        run(2, Shared::step_model)?;
        let began = profile.lap(Stage::CriticModelSteps, began);
        run(parts, Shared::actor_gradient)?;
        let began = profile.lap(Stage::ActorGradient, began);
        run(2, Shared::step_actor)?;
        profile.lap(Stage::ActorStep, began);
        Ok(self.losses())
    }

    fn losses(&self) -> Losses {
        self.shared.parts.iter().map(|part| part.lock().losses).sum()
    }

    /// Calls `use_nets` with the current actor or its running average; no update can run in the
    /// meantime.
    fn with_nets<R>(&self, averaged: bool, use_nets: impl FnOnce(Nets) -> R) -> Result<R> {
        let actor = self.shared.actor.lock();
        Ok(use_nets(Nets { objective: &self.shared.objective, actor: actor.weights(averaged)? }))
    }

    /// Returns all networks with their names.
    fn named(&self) -> impl Iterator<Item = (String, &Network)> {
        [("model", &self.shared.model), ("actor", &self.shared.actor)]
            .into_iter()
            .map(|(name, network)| (format!("{NAME}.{name}"), network))
    }
}

impl Learner for GdgDistance {
    fn kind(&self) -> &'static str {
        NAME
    }

    /// Performs one update. There is no critic, so its loss is 0. Distances known from the bridge
    /// graph are not used: D is given.
    fn update(
        &mut self,
        data: TrainingData,
        profile: &mut Profile,
    ) -> std::result::Result<Losses, LearnError> {
        let began = Instant::now();
        let mut batch = std::mem::take(&mut self.batch);
        self.sampler.sample(data.replay, data.relearning, data.rng, &mut batch);
        profile.lap(Stage::Sample, began);
        let losses = self.update_on(&batch, data.parts, profile);
        self.batch = batch;
        Ok(losses?)
    }

    fn policy(&self, averaged: bool) -> std::result::Result<Arc<dyn Policy>, LearnError> {
        Ok(Arc::new(FrozenActor::new(
            self.shared.objective.clone(),
            self.shared.actor.copy(averaged)?,
        )))
    }

    fn with_policy(
        &self,
        averaged: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> std::result::Result<(), LearnError> {
        Ok(self.with_nets(averaged, |nets| use_policy(&nets))?)
    }

    fn export_actor(&self, averaged: bool) -> std::result::Result<Option<ActorExport>, LearnError> {
        let Shared { objective, actor, .. } = &*self.shared;
        Ok(Some(ActorExport::of(
            &objective.shapes.encoder,
            &objective.shapes.actor,
            actor,
            averaged,
        )?))
    }

    /// Returns whether the averaged actor gives finite actions on the latest batch; the given D
    /// always is finite.
    fn is_finite(&self) -> std::result::Result<bool, LearnError> {
        let (states, goals) = (&self.batch.states, &self.batch.goals);
        let mut actions = vec![0.0; self.batch.len() * self.shared.objective.shapes.actor.outputs];
        self.with_nets(true, |nets| {
            nets.actions(states, goals, &mut actions, &mut Scratch::default());
        })?;
        Ok(actions.iter().all(|a| a.is_finite()))
    }

    fn save(&self, store: &mut Store) -> std::result::Result<(), LearnError> {
        Ok(save_networks(store, self.shared.actor.steps(), self.named())?)
    }

    fn load(&mut self, store: &Store) -> std::result::Result<(), LearnError> {
        Ok(load_networks(store, self.named())?)
    }
}

impl Shared {
    /// Number of tasks in the first phase that find the table corners touched by the batch.
    const TOUCH_TASKS: usize = 2;

    /// Runs one task of an update's first phase: the first tasks find the corners that the steps
    /// will touch, each other one computes the model's gradient on its part of the batch.
    fn touched_corners_or_gradients(&self, task: usize) -> Result<()> {
        let shapes = &self.objective.shapes;
        match task {
            0 => find_corners_of_pairs(shapes, &self.batch.read(), &mut self.pairs.write()),
            1 => find_corners_of_transitions(
                shapes,
                &self.batch.read(),
                &mut self.transitions.write(),
            ),
            _ => return self.model_gradient(task - Self::TOUCH_TASKS),
        }
        Ok(())
    }

    /// Computes the model's gradient on part `i` of the batch.
    fn model_gradient(&self, i: usize) -> Result<()> {
        let shapes = &self.objective.shapes;
        let (model, batch, mut part) = (self.model.lock(), self.batch.read(), self.parts[i].lock());
        let (rows, part) = (Rows::new(shapes, &batch, i), &mut *part);
        part.model.prepare(shapes.model.parameters());
        let transitions = (rows.from, rows.actions, rows.next);
        let (gradient, ws) = (&mut part.model, &mut part.buffers.model);
        part.losses.model =
            shapes.model_gradient(model.weights(false)?, transitions, rows.share, gradient, ws);
        Ok(())
    }

    /// Computes the actor's gradient on part `i` of the batch.
    fn actor_gradient(&self, i: usize) -> Result<()> {
        let shapes = &self.objective.shapes;
        let (actor, model) = (self.actor.lock(), self.model.lock());
        let (batch, mut part) = (self.batch.read(), self.parts[i].lock());
        let (rows, part) = (Rows::new(shapes, &batch, i), &mut *part);
        part.actor.prepare(shapes.actor.parameters());
        shapes.encoder.plain_pairs(rows.states, rows.goals, &mut part.plain);
        let pairs = Pairs { plain: &part.plain, states: rows.states, goals: rows.goals };
        let networks = (actor.weights(false)?, model.weights(false)?);
        let buffers = &mut part.buffers;
        part.losses.actor =
            self.objective.actor_gradient(networks, (pairs, rows.share), &mut part.actor, buffers);
        Ok(())
    }

    /// Steps the model, in two tasks.
    fn step_model(&self, task: usize) -> Result<()> {
        let touched = self.transitions.read();
        step_half(
            &self.model,
            Half::for_task(task),
            &touched,
            self.rates,
            (&self.parts, |part| &mut part.model),
        )
    }

    /// Steps the actor, in two tasks.
    fn step_actor(&self, task: usize) -> Result<()> {
        let touched = self.pairs.read();
        step_half(
            &self.actor,
            Half::for_task(task),
            &touched,
            self.rates,
            (&self.parts, |part| &mut part.actor),
        )
    }
}
