//! Goal-distance gradient: distance critics, dynamics model and actor (Algorithm 1), updated by
//! hand-written kernels on several threads.

pub mod graph_paths;
mod part;

use std::sync::Arc;
use std::time::Instant;

use candle_core::Result;
use parking_lot::{Mutex, RwLock};
use rand_chacha::ChaCha8Rng;

use crate::env::Spec;
use crate::learn::data::batch::{Batch, BatchSampler};
use crate::learn::data::known::KnownDistances;
use crate::learn::error::LearnError;
use crate::learn::learner::{Learner, LearnerKind, TrainingData};
use crate::learn::networks::adam::LearningRates;
use crate::learn::networks::dense::NetworkState;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::export::ActorExport;
use crate::learn::networks::features::Pairs;
use crate::learn::networks::network::Network;
use crate::learn::networks::policy::{FrozenNets, Nets, Policy, Scratch};
use crate::learn::networks::shapes::{Shapes, check_state_dim};
use crate::learn::networks::state::{load_networks, save_networks};
use crate::learn::networks::touched::TouchedCorners;
use crate::learn::settings::{Backend, LearnSettings};
use crate::learn::update::gradient::{FullGradient, Gradient, full_gradient};
use crate::learn::update::losses::{ActorLossNetworks, ActorLossOptions, Losses};
use crate::learn::update::pool::ThreadPool;
use crate::learn::update::profile::{Profile, Stage};
use crate::learn::update::reference::{Layers, Parameters, Reference};
use crate::learn::update::rows::{
    Rows, find_corners_of_pairs, find_corners_of_transitions, parts_of,
};
use crate::learn::update::step::{Half, step_half};
use crate::learn::update::tape::Tape;
use crate::pulse::Parts;
use crate::store::Store;
use graph_paths::GraphPaths;
use part::Part;

/// Registry entry of the learner.
pub const KIND: LearnerKind = LearnerKind {
    name: NAME,
    about: "trains an actor through a distance critic and a dynamics model",
    is_rewarded: false,
    create: |spec, settings, threads, rng| Ok(Box::new(Gdg::new(spec, settings, threads, rng)?)),
    parameters: Gdg::parameters,
};

const NAME: &str = "gdg";

/// The networks and everything needed to train them.
pub struct Gdg {
    sampler: BatchSampler,
    /// The latest batch.
    batch: Batch,
    shared: Arc<Shared>,
    pool: ThreadPool,
    backend: Backend,
    /// The networks on a tape backend, if one is selected; each update is written back to `shared`.
    tape: Option<Tape>,
    /// What paths through the bridge graph add to batches, if anything.
    graph_paths: Option<GraphPaths>,
}

/// Data shared by the threads of an update.
struct Shared {
    shapes: Arc<Shapes>,
    rates: RwLock<LearningRates>,
    critics: Vec<Network>,
    model: Network,
    actor: Network,
    parts: Vec<Mutex<Part>>,
    batch: RwLock<Batch>,
    /// Grid table corners that the batch touches, in its pairs and in its transitions.
    pairs: RwLock<TouchedCorners>,
    transitions: RwLock<TouchedCorners>,
}

impl Gdg {
    /// Creates networks for an environment of `spec`. Updates run on `threads` threads, which does
    /// not change their results.
    ///
    /// # Errors
    /// Returns an error if states are too large, or a tensor operation fails.
    pub fn new(
        spec: &Spec,
        settings: &LearnSettings,
        threads: usize,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        check_state_dim(spec)?;
        let shapes = Arc::new(Shapes::new(Encoder::new(spec, settings), settings));
        let grid = shapes.encoder.grid();
        let mut network = |mlp, tau| Network::new(mlp, grid, tau, rng);
        let tau = Some(settings.tau);
        let critics = (0..settings.critics)
            .map(|_| network(shapes.critic, tau))
            .collect::<Result<Vec<_>>>()?;
        let (model, actor) = (network(shapes.model, None)?, network(shapes.actor, tau)?);
        let part = || Part::new(settings.critics);
        let parts = (0..parts_of(settings.batch_size)).map(|_| Mutex::new(part())).collect();
        let rates = RwLock::new(LearningRates::from_settings(settings));
        let (batch, pairs, transitions) = (RwLock::default(), RwLock::default(), RwLock::default());
        let shared =
            Shared { shapes, rates, critics, model, actor, parts, batch, pairs, transitions };
        let tape = Tape::new(settings.backend, shared.networks())?;
        Ok(Self {
            sampler: BatchSampler::new(spec, settings),
            batch: Batch::default(),
            shared: Arc::new(shared),
            pool: ThreadPool::new(threads),
            backend: settings.backend,
            tape,
            graph_paths: GraphPaths::new(settings),
        })
    }

    /// Returns the number of trainable parameters in all networks that `settings` specify.
    pub fn parameters(spec: &Spec, settings: &LearnSettings) -> u64 {
        let shapes = Shapes::new(Encoder::new(spec, settings), settings);
        let of = |mlp| shapes.encoder.parameters_with(mlp);
        settings.critics as u64 * of(&shapes.critic) + of(&shapes.model) + of(&shapes.actor)
    }

    /// Returns the networks' shapes and input features.
    pub fn shapes(&self) -> &Shapes {
        &self.shared.shapes
    }

    /// Returns critic `k`; the actor is trained through the first.
    pub fn critic(&self, k: usize) -> &Network {
        &self.shared.critics[k]
    }

    /// Returns the dynamics model.
    pub fn model(&self) -> &Network {
        &self.shared.model
    }

    /// Returns the actor.
    pub fn actor(&self) -> &Network {
        &self.shared.actor
    }

    /// Returns all networks: critics, model, actor.
    pub fn networks(&self) -> impl Iterator<Item = &Network> {
        self.shared.networks()
    }

    /// Returns the number of updates done.
    pub fn updates(&self) -> u64 {
        self.shared.actor.steps()
    }

    /// Updates critics, model, actor and averages once on `batch` (Algorithm 1's inner loop), in
    /// parts that are `asked` for if it takes long, and adds the time to `profile`.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn update_on(
        &mut self,
        batch: &Batch,
        asked: Option<&Arc<Parts>>,
        profile: &mut Profile,
    ) -> Result<Losses> {
        let began = Instant::now();
        if let Some(tape) = &mut self.tape {
            let Shared { shapes, rates, actor, .. } = &*self.shared;
            let steps = actor.steps() + 1;
            let losses = tape.update(shapes, batch, steps, *rates.read())?;
            tape.write_back(self.shared.networks(), steps)?;
            profile.lap(Stage::Tape, began);
            return Ok(losses);
        }
        self.shared.batch.write().clone_from(batch);
        let (parts, critics) = (self.shared.parts.len(), self.shared.critics.len());
        let run = |tasks, work: fn(&Shared, usize) -> Result<()>| {
            self.pool.try_run(tasks, &self.shared, asked, work)
        };
        run(Shared::TOUCH_TASKS + parts, Shared::touched_corners_or_gradients)?;
        let began = profile.lap(Stage::CriticModelGradients, began);
        run(2 * (critics + 1), Shared::step_critics_and_model)?;
        let began = profile.lap(Stage::CriticModelSteps, began);
        run(parts, Shared::actor_gradients)?;
        let began = profile.lap(Stage::ActorGradient, began);
        run(2, Shared::step_actor)?;
        profile.lap(Stage::ActorStep, began);
        Ok(self.losses())
    }

    /// Returns the losses and the gradients (flat parameters and table) of the first critic, the
    /// model and the actor on `batch`, all at the current weights and without a step. For checks
    /// against other implementations.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn gradients(&mut self, batch: &Batch) -> Result<(Losses, [FullGradient; 3])> {
        self.shared.batch.write().clone_from(batch);
        let parts = self.shared.parts.len();
        let run = |tasks, work: fn(&Shared, usize) -> Result<()>| {
            self.pool.try_run(tasks, &self.shared, None, work)
        };
        run(Shared::TOUCH_TASKS + parts, Shared::touched_corners_or_gradients)?;
        run(parts, Shared::actor_gradients)?;
        let Shared { pairs, transitions, parts, .. } = &*self.shared;
        let (pairs, transitions) = (pairs.read(), transitions.read());
        let gradients = [
            full_gradient(self.critic(0), &pairs, parts, |part| &mut part.critics[0]),
            full_gradient(self.model(), &transitions, parts, |part| &mut part.model),
            full_gradient(self.actor(), &pairs, parts, |part| &mut part.actor),
        ];
        Ok((self.losses(), gradients))
    }

    /// Bounds targets and leads the actor along paths through the bridge graph, in the batch's
    /// pairs from row `first` on.
    fn follow_graph(&mut self, known: &KnownDistances, first: usize) -> Result<()> {
        let Some(mut paths) = self.graph_paths.take() else { return Ok(()) };
        let mut batch = std::mem::take(&mut self.batch);
        paths.collect(self.shared.shapes.encoder.spec(), known, &batch, first);
        let applied = self.with_nets(true, |nets| paths.apply(&nets, known, &mut batch));
        (self.batch, self.graph_paths) = (batch, Some(paths));
        applied
    }

    fn losses(&self) -> Losses {
        self.shared.parts.iter().map(|part| part.lock().losses).sum()
    }

    /// Returns the losses at the current weights in candle operations.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn reference(&self, layers: Layers) -> Result<Reference<'_>> {
        Reference::new(self.shapes(), self.networks(), layers)
    }

    /// Returns the losses in candle's operations at the weights that targets use: the running
    /// averages of critics and actor, and the current model.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn target_reference(&self, layers: Layers) -> Result<Reference<'_>> {
        let encoder = &self.shapes().encoder;
        let parameters = |network, averaged| Parameters::copied(network, encoder, averaged);
        let critics = self.shared.critics.iter().map(|critic| parameters(critic, true));
        let others = [parameters(&self.shared.model, false), parameters(&self.shared.actor, true)];
        Reference::with_parameters(
            self.shapes(),
            critics.chain(others).collect::<Result<_>>()?,
            layers,
        )
    }

    /// Calls `use_nets` with the current networks or their running averages; no update can run in
    /// the meantime.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn with_nets<R>(&self, averaged: bool, use_nets: impl FnOnce(Nets) -> R) -> Result<R> {
        let critics: Vec<_> = self.shared.critics.iter().map(Network::lock).collect();
        let (model, actor) = (self.shared.model.lock(), self.shared.actor.lock());
        Ok(use_nets(Nets {
            shapes: &self.shared.shapes,
            critics: critics.iter().map(|l| l.weights(averaged)).collect::<Result<_>>()?,
            // The model has no average.
            model: model.weights(false)?,
            actor: actor.weights(averaged)?,
        }))
    }

    /// Returns the state of each network, by name.
    ///
    /// # Errors
    /// Returns candle's error if a tensor operation fails.
    pub fn networks_state(&self) -> Result<Vec<(String, NetworkState)>> {
        self.shared.named().map(|(name, network)| Ok((name, network.state()?))).collect()
    }
}

impl Learner for Gdg {
    fn kind(&self) -> &'static str {
        NAME
    }

    fn update(
        &mut self,
        data: TrainingData,
        profile: &mut Profile,
    ) -> std::result::Result<Losses, LearnError> {
        let began = Instant::now();
        self.sampler.sample(data.replay, data.relearning, data.rng, &mut self.batch);
        if let Some(known) = &data.known {
            let first = self.sampler.add_known(known, data.rng, &mut self.batch);
            self.follow_graph(known, first)?;
        }
        profile.lap(Stage::Sample, began);
        let batch = std::mem::take(&mut self.batch);
        let losses = self.update_on(&batch, data.parts, profile);
        self.batch = batch;
        Ok(losses?)
    }

    fn policy(&self, averaged: bool) -> std::result::Result<Arc<dyn Policy>, LearnError> {
        let critics =
            self.shared.critics.iter().map(|c| c.copy(averaged)).collect::<Result<_>>()?;
        let others = [self.shared.model.copy(false)?, self.shared.actor.copy(averaged)?];
        Ok(Arc::new(FrozenNets::new(self.shared.shapes.clone(), critics, others)))
    }

    fn with_policy(
        &self,
        averaged: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> std::result::Result<(), LearnError> {
        Ok(self.with_nets(averaged, |nets| use_policy(&nets))?)
    }

    fn export_actor(&self, averaged: bool) -> std::result::Result<Option<ActorExport>, LearnError> {
        let Shared { shapes, actor, .. } = &*self.shared;
        Ok(Some(ActorExport::of(&shapes.encoder, &shapes.actor, actor, averaged)?))
    }

    /// Returns whether the averaged critics give finite distances on the latest batch.
    fn is_finite(&self) -> std::result::Result<bool, LearnError> {
        let (states, goals) = (&self.batch.states, &self.batch.goals);
        let mut distances = vec![0.0; self.batch.len()];
        self.with_nets(true, |nets| {
            nets.distances(states, goals, &mut distances, &mut Scratch::default());
        })?;
        Ok(distances.iter().all(|d| d.is_finite()))
    }

    fn save(&self, store: &mut Store) -> std::result::Result<(), LearnError> {
        Ok(save_networks(store, self.updates(), self.shared.named())?)
    }

    fn load(&mut self, store: &Store) -> std::result::Result<(), LearnError> {
        load_networks(store, self.shared.named())?;
        self.tape = Tape::new(self.backend, self.shared.networks())?;
        Ok(())
    }
}

impl Shared {
    /// Number of tasks in the first phase that find the table corners touched by the batch.
    const TOUCH_TASKS: usize = 2;

    /// Returns critics, model, actor.
    fn networks(&self) -> impl Iterator<Item = &Network> {
        self.critics.iter().chain([&self.model, &self.actor])
    }

    /// Returns all networks with their names.
    fn named(&self) -> impl Iterator<Item = (String, &Network)> {
        let critics = self.critics.iter().enumerate().map(|(k, critic)| (critic_name(k), critic));
        critics.chain([("model".to_owned(), &self.model), ("actor".to_owned(), &self.actor)])
    }

    /// Runs one task of an update's first phase: the first tasks find the corners that the steps
    /// will touch, each other one computes the gradients of critics and model on its part of the
    /// batch.
    fn touched_corners_or_gradients(&self, task: usize) -> Result<()> {
        if let Some(part) = task.checked_sub(Self::TOUCH_TASKS) {
            return self.critic_and_model_gradients(part);
        }
        self.find_touched_corners(task == 0);
        Ok(())
    }

    /// Finds the corners that the batch's pairs, or its transitions, touch.
    fn find_touched_corners(&self, pairs: bool) {
        let (shapes, batch) = (&self.shapes, self.batch.read());
        if pairs {
            find_corners_of_pairs(shapes, &batch, &mut self.pairs.write());
        } else {
            find_corners_of_transitions(shapes, &batch, &mut self.transitions.write());
        }
    }

    /// Computes the gradients of the critics and the model on part `i` of the batch.
    fn critic_and_model_gradients(&self, i: usize) -> Result<()> {
        let critics: Vec<_> = self.critics.iter().map(Network::lock).collect();
        let current = critics.iter().map(|l| l.weights(false)).collect::<Result<Vec<_>>>()?;
        let targets = critics.iter().map(|l| l.weights(true)).collect::<Result<Vec<_>>>()?;
        let (model, actor) = (self.model.lock(), self.actor.lock());
        let (batch, mut part) = (self.batch.read(), self.parts[i].lock());
        let (rows, part) = (Rows::new(&self.shapes, &batch, i), &mut *part);
        part.model.prepare(self.shapes.model.parameters());
        let transitions = (rows.from, rows.actions, rows.next);
        let (gradient, ws) = (&mut part.model, &mut part.buffers.networks.model);
        part.losses.model = self.shapes.model_gradient(
            model.weights(false)?,
            transitions,
            rows.share,
            gradient,
            ws,
        );
        part.check_model(&self.shapes, &rows);
        part.targets(&self.shapes, &rows, (actor.weights(true)?, model.weights(false)?, &targets));
        part.critic_gradients(&self.shapes, &rows, &current);
        Ok(())
    }

    /// Computes the actor's gradient on part `i` of the batch.
    fn actor_gradients(&self, i: usize) -> Result<()> {
        let (actor, model, critic) = (self.actor.lock(), self.model.lock(), self.critics[0].lock());
        let path = ActorLossNetworks {
            actor: actor.weights(false)?,
            model: model.weights(false)?,
            critic: critic.weights(false)?,
        };
        let (batch, mut part) = (self.batch.read(), self.parts[i].lock());
        let (rows, part) = (Rows::new(&self.shapes, &batch, i), &mut *part);
        part.actor.prepare(self.shapes.actor.parameters());
        let buffers = &mut part.buffers;
        let pairs = Pairs { plain: &part.plain, states: rows.states, goals: rows.goals };
        let options = ActorLossOptions {
            towards: rows.actor_goals,
            share: rows.share,
            frees_stuck: rows.frees_stuck_actor,
        };
        part.losses.actor =
            self.shapes.actor_gradient(&path, pairs, options, &mut part.actor, buffers);
        Ok(())
    }

    /// Steps the critics and the model, which are independent of each other, in two tasks per
    /// network.
    fn step_critics_and_model(&self, task: usize) -> Result<()> {
        let (i, half) = (task / 2, Half::for_task(task));
        match self.critics.get(i) {
            Some(critic) => self.step(critic, half, &self.pairs, |part| &mut part.critics[i]),
            None => self.step(&self.model, half, &self.transitions, |part| &mut part.model),
        }
    }

    /// Steps the actor, in two tasks.
    fn step_actor(&self, task: usize) -> Result<()> {
        self.step(&self.actor, Half::for_task(task), &self.pairs, |part| &mut part.actor)
    }

    fn step(
        &self,
        network: &Network,
        half: Half,
        touched: &RwLock<TouchedCorners>,
        gradient: impl Fn(&mut Part) -> &mut Gradient,
    ) -> Result<()> {
        step_half(network, half, &touched.read(), *self.rates.read(), (&self.parts, gradient))
    }
}

fn critic_name(k: usize) -> String {
    format!("critic{k}")
}
