//! One update of all networks, its work split over threads.

use std::ops::Deref;
use std::sync::Arc;

use candle_core::{Error, Result};
use parking_lot::{Mutex, RwLock};
use rand_chacha::ChaCha8Rng;

use super::batch::Batch;
use super::encoder::Encoder;
use super::gradient::{Gradient, StepRates};
use super::losses::{ActorPath, MOST_STATE_NUMBERS, Pairs, PlainPairs, Shapes, Workspace};
use super::network::{Network, NetworkState, Weights};
use super::policy::{Nets, Policy};
use super::settings::LearnSettings;
use super::team::Team;
use crate::env::Spec;

/// Parts that a batch is split into, and the fewest rows of one. The parts do not depend on the number of threads and
/// are summed in their order, so that results do not either.
const PARTS: usize = 4;
const LEAST_PART_ROWS: usize = 32;

/// Rows of each part of a batch, the last one perhaps fewer.
fn part_rows(batch: usize) -> usize {
    batch.div_ceil(PARTS).max(LEAST_PART_ROWS)
}

/// Losses of one update, each a mean over the batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Losses {
    /// Weighted squared error on the chosen scale, mean of the critics.
    pub critic: f32,
    /// |f(s, a) - s'|^2 in squared goal radii.
    pub model: f32,
    /// D(f(s, mu(s, g)), g) in steps.
    pub actor: f32,
}

/// A network's gradient: of its flat parameters, and of its grid table `(corners, channels)`.
pub type WholeGradient = (Vec<f32>, Vec<f32>);

/// Names and states of all networks, and the updates done.
pub struct LearnerState {
    /// Updates done.
    pub updates: u64,
    /// State of each network by its name.
    pub networks: Vec<(String, NetworkState)>,
}

/// The networks and everything needed to train them.
pub struct Learner {
    shared: Arc<Shared>,
    team: Team,
}

/// What the threads of an update work on together.
struct Shared {
    shapes: Arc<Shapes>,
    rates: StepRates,
    critics: Vec<RwLock<Network>>,
    model: RwLock<Network>,
    actor: RwLock<Network>,
    parts: Vec<Mutex<Part>>,
    batch: RwLock<Batch>,
    /// The first failure of the current update.
    failure: Mutex<Option<Error>>,
}

/// What one task of an update works with.
#[derive(Default)]
struct Part {
    plain: PlainPairs,
    plain_ahead: PlainPairs,
    targets: Vec<f32>,
    ahead: Vec<f32>,
    critics: Vec<Gradient>,
    model: Gradient,
    actor: Gradient,
    act: Workspace,
    step: Workspace,
    judge: Workspace,
    losses: Losses,
}

impl Learner {
    /// Fresh networks for an environment of `spec`; `threads` share the work of each update, without changing its
    /// result.
    ///
    /// # Errors
    /// What candle reports, or that a thread cannot be started.
    pub fn new(spec: &Spec, settings: &LearnSettings, threads: usize, rng: &mut ChaCha8Rng) -> Result<Self> {
        if spec.state_dim() > MOST_STATE_NUMBERS {
            candle_core::bail!("states of more than {MOST_STATE_NUMBERS} numbers are not supported");
        }
        let shapes = Arc::new(Shapes::new(Encoder::new(spec, settings), settings));
        let grid = shapes.encoder.grid();
        let mut network = |mlp, tau| Network::new(mlp, grid, tau, rng).map(RwLock::new);
        let tau = Some(settings.tau);
        let critics = (0..settings.critics).map(|_| network(shapes.critic, tau)).collect::<Result<Vec<_>>>()?;
        let (model, actor) = (network(shapes.model, None)?, network(shapes.actor, tau)?);
        let part = || Part { critics: vec![Gradient::default(); settings.critics], ..Part::default() };
        let parts = (0..settings.batch.div_ceil(part_rows(settings.batch))).map(|_| Mutex::new(part())).collect();
        let rates = StepRates { dense: settings.learning_rate, table: settings.grid_learning_rate, tau: settings.tau };
        let (batch, failure) = (RwLock::default(), Mutex::default());
        let shared = Shared { shapes, rates, critics, model, actor, parts, batch, failure };
        Ok(Self { shared: Arc::new(shared), team: Team::new(threads)? })
    }

    /// Networks' shapes and input features.
    pub fn shapes(&self) -> &Shapes {
        &self.shared.shapes
    }

    /// Critic `k`; the actor follows the first.
    pub fn critic(&self, k: usize) -> impl Deref<Target = Network> + '_ {
        self.shared.critics[k].read()
    }

    /// The dynamics model.
    pub fn model(&self) -> impl Deref<Target = Network> + '_ {
        self.shared.model.read()
    }

    /// The actor.
    pub fn actor(&self) -> impl Deref<Target = Network> + '_ {
        self.shared.actor.read()
    }

    /// Updates done.
    pub fn updates(&self) -> u64 {
        self.shared.actor.read().steps()
    }

    /// One update of critics, model, actor and averages on `batch` (Algorithm 1's inner loop).
    ///
    /// # Errors
    /// What candle reports.
    pub fn update(&mut self, batch: &Batch) -> Result<Losses> {
        self.shared.batch.write().clone_from(batch);
        let (parts, critics) = (self.shared.parts.len(), self.shared.critics.len());
        self.together(parts, Shared::critic_and_model_gradients)?;
        self.together(critics + 1, Shared::step_critic_or_model)?;
        self.together(parts, Shared::actor_gradients)?;
        self.together(1, |shared, _| shared.step(&mut shared.actor.write(), |part| &mut part.actor))?;
        Ok(self.losses())
    }

    /// Does `work` for each number below `tasks`, on all threads.
    fn together(&self, tasks: usize, work: fn(&Shared, usize) -> Result<()>) -> Result<()> {
        let shared = self.shared.clone();
        self.team.run(tasks, move |i| {
            if let Err(error) = work(&shared, i) {
                shared.failure.lock().get_or_insert(error);
            }
        });
        self.shared.failure.lock().take().map_or(Ok(()), Err)
    }

    /// Losses and gradients on `batch` of the first critic, the model and the actor, all at the current weights and
    /// without a step: flat parameters and table of each. For checks against other ways to compute them.
    ///
    /// # Errors
    /// What candle reports.
    pub fn gradients(&mut self, batch: &Batch) -> Result<(Losses, [WholeGradient; 3])> {
        self.shared.batch.write().clone_from(batch);
        let parts = self.shared.parts.len();
        self.together(parts, Shared::critic_and_model_gradients)?;
        self.together(parts, Shared::actor_gradients)?;
        let table = self.critic(0).table_size();
        let parts: Vec<_> = self.shared.parts.iter().map(Mutex::lock).collect();
        let sum = |of: fn(&Part) -> &Gradient| Gradient::sum(parts.iter().map(|part| of(part)), table);
        let gradients = [sum(|p| &p.critics[0]), sum(|p| &p.model), sum(|p| &p.actor)];
        drop(parts);
        Ok((self.losses(), gradients))
    }

    fn losses(&self) -> Losses {
        self.shared.parts.iter().map(|part| part.lock().losses).fold(Losses::default(), |sum, part| Losses {
            critic: sum.critic + part.critic,
            model: sum.model + part.model,
            actor: sum.actor + part.actor,
        })
    }

    /// Uses the networks as they are, or their averages, while no update runs.
    ///
    /// # Errors
    /// What candle reports.
    pub fn with_nets<R>(&self, averaged: bool, use_nets: impl FnOnce(Nets) -> R) -> Result<R> {
        let critics: Vec<_> = self.shared.critics.iter().map(RwLock::read).collect();
        let locked: Vec<_> = critics.iter().map(|c| c.lock()).collect();
        let actor = self.shared.actor.read();
        let actor = actor.lock();
        Ok(use_nets(Nets {
            shapes: &self.shared.shapes,
            critics: locked.iter().map(|l| l.weights(averaged)).collect::<Result<_>>()?,
            actor: actor.weights(averaged)?,
        }))
    }

    /// A frozen copy of critics and actor, of their averages if asked for.
    ///
    /// # Errors
    /// What candle reports.
    pub fn policy(&self, averaged: bool) -> Result<Policy> {
        let critics = self.shared.critics.iter().map(|c| c.read().copy(averaged)).collect::<Result<_>>()?;
        let actor = self.shared.actor.read().copy(averaged)?;
        Ok(Policy::new(self.shared.shapes.clone(), critics, actor))
    }

    /// Everything that training changed, for a checkpoint.
    ///
    /// # Errors
    /// What candle reports.
    pub fn state(&self) -> Result<LearnerState> {
        let networks =
            self.shared.named().map(|(name, network)| Ok((name, network.read().state()?))).collect::<Result<_>>()?;
        Ok(LearnerState { updates: self.updates(), networks })
    }

    /// Takes up what [`Self::state`] gave; `find(network, part)` returns the numbers saved under these names.
    ///
    /// # Errors
    /// A part that is missing or of another size.
    pub fn restore(&mut self, updates: u64, find: impl Fn(&str, &str) -> Option<Vec<f32>>) -> Result<()> {
        self.shared.named().try_for_each(|(name, network)| network.write().restore(updates, |part| find(&name, part)))
    }
}

impl Shared {
    /// All networks with their names.
    fn named(&self) -> impl Iterator<Item = (String, &RwLock<Network>)> {
        let critics = self.critics.iter().enumerate().map(|(k, critic)| (critic_name(k), critic));
        critics.chain([("model".to_owned(), &self.model), ("actor".to_owned(), &self.actor)])
    }

    /// Gradients of the critics and the model from part `i` of the batch.
    fn critic_and_model_gradients(&self, i: usize) -> Result<()> {
        let critics: Vec<_> = self.critics.iter().map(RwLock::read).collect();
        let locked: Vec<_> = critics.iter().map(|c| c.lock()).collect();
        let current = locked.iter().map(|l| l.weights(false)).collect::<Result<Vec<_>>>()?;
        let targets = locked.iter().map(|l| l.weights(true)).collect::<Result<Vec<_>>>()?;
        let model = self.model.read();
        let model = model.lock();
        let (batch, mut part) = (self.batch.read(), self.parts[i].lock());
        let (rows, part) = (Rows::new(&self.shapes, &batch, i), &mut *part);
        part.critic_gradients(&self.shapes, &rows, &current, &targets);
        part.model.prepare(self.shapes.model.parameters());
        let transitions = (rows.from, rows.actions, rows.next);
        let (gradient, ws) = (&mut part.model, &mut part.step);
        part.losses.model = self.shapes.model_gradient(model.weights(false)?, transitions, rows.share, gradient, ws);
        Ok(())
    }

    /// The actor's gradient from part `i` of the batch.
    fn actor_gradients(&self, i: usize) -> Result<()> {
        let (actor, model, critic) = (self.actor.read(), self.model.read(), self.critics[0].read());
        let (actor, model, critic) = (actor.lock(), model.lock(), critic.lock());
        let path =
            ActorPath { actor: actor.weights(false)?, model: model.weights(false)?, critic: critic.weights(false)? };
        let (batch, mut part) = (self.batch.read(), self.parts[i].lock());
        let (rows, part) = (Rows::new(&self.shapes, &batch, i), &mut *part);
        part.actor.prepare(self.shapes.actor.parameters());
        let buffers = (&mut part.act, &mut part.step, &mut part.judge);
        let pairs = Pairs { plain: &part.plain, states: rows.states, goals: rows.goals };
        part.losses.actor = self.shapes.actor_gradient(&path, pairs, rows.share, &mut part.actor, buffers);
        Ok(())
    }

    /// The step of critic `i`, or of the model behind the last: each is independent of the others.
    fn step_critic_or_model(&self, i: usize) -> Result<()> {
        match self.critics.get(i) {
            Some(critic) => self.step(&mut critic.write(), |part| &mut part.critics[i]),
            None => self.step(&mut self.model.write(), |part| &mut part.model),
        }
    }

    /// A network's step along the sum of all parts' gradients. They are taken out of the parts meanwhile, as another
    /// thread may need theirs for another network.
    fn step(&self, network: &mut Network, gradient: impl Fn(&mut Part) -> &mut Gradient) -> Result<()> {
        let mut gradients: Vec<Gradient> =
            self.parts.iter().map(|part| std::mem::take(gradient(&mut part.lock()))).collect();
        let result = network.step(&mut gradients, self.rates);
        self.parts.iter().zip(gradients).for_each(|(part, own)| *gradient(&mut part.lock()) = own);
        result
    }
}

fn critic_name(k: usize) -> String {
    format!("critic{k}")
}

impl Part {
    /// Targets x = d + D'(s', g) of the part's rows, then each critic's gradient towards them.
    fn critic_gradients(&mut self, shapes: &Shapes, rows: &Rows, critics: &[Weights], targets: &[Weights]) {
        shapes.plain_pairs(rows.states, rows.goals, &mut self.plain);
        shapes.plain_pairs(rows.ahead, rows.goals, &mut self.plain_ahead);
        self.targets.clear();
        self.targets.resize(rows.steps.len(), 0.0);
        self.ahead.resize(rows.steps.len(), 0.0);
        for target in targets {
            let ahead = Pairs { plain: &self.plain_ahead, states: rows.ahead, goals: rows.goals };
            shapes.distances(*target, ahead, &mut self.ahead, &mut self.judge);
            self.targets.iter_mut().zip(&self.ahead).for_each(|(x, d)| *x = x.max(*d));
        }
        for (i, x) in self.targets.iter_mut().enumerate() {
            *x = (rows.steps[i] + rows.bootstrap[i] * *x).min(rows.bound[i]);
        }
        self.losses.critic = 0.0;
        for (critic, gradient) in critics.iter().zip(&mut self.critics) {
            gradient.prepare(shapes.critic.parameters());
            let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
            let (targets, ws) = (&self.targets, &mut self.judge);
            let loss = shapes.critic_gradient(*critic, pairs, targets, rows.share, gradient, ws);
            self.losses.critic += loss / critics.len() as f32;
        }
    }
}

/// One part's rows of a batch.
struct Rows<'a> {
    states: &'a [f32],
    goals: &'a [f32],
    ahead: &'a [f32],
    steps: &'a [f32],
    bootstrap: &'a [f32],
    bound: &'a [f32],
    from: &'a [f32],
    actions: &'a [f32],
    next: &'a [f32],
    /// 1 / batch.
    share: f32,
}

impl<'a> Rows<'a> {
    fn new(shapes: &Shapes, batch: &'a Batch, part: usize) -> Self {
        let spec = shapes.encoder.spec();
        let size = part_rows(batch.len());
        let rows = part * size..((part + 1) * size).min(batch.len());
        let cut = |numbers: &'a [f32], width: usize| &numbers[rows.start * width..rows.end * width];
        let (s, g) = (spec.state_dim(), spec.goal_dim());
        Self {
            states: cut(&batch.states, s),
            goals: cut(&batch.goals, g),
            ahead: cut(&batch.ahead, s),
            steps: cut(&batch.steps, 1),
            bootstrap: cut(&batch.bootstrap, 1),
            bound: cut(&batch.bound, 1),
            from: cut(&batch.from, s),
            actions: cut(&batch.actions, spec.action_dim),
            next: cut(&batch.next, s),
            share: 1.0 / batch.len() as f32,
        }
    }
}
