//! One update of all networks, its work split over threads.

use std::sync::Arc;

use candle_core::Result;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::batch::Batch;
use super::encoder::Encoder;
use super::losses::{ActorPath, MOST_STATE_NUMBERS, Pairs, PlainPairs, Shapes, Workspace};
use super::network::{Gradient, Network, NetworkState, StepRates, Weights};
use super::policy::{Nets, Policy};
use super::settings::LearnSettings;
use crate::env::Spec;

/// Rows of a batch that one task works on. The parts do not depend on the number of threads and are summed in their
/// order, so that results do not either.
const PART_ROWS: usize = 32;

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
    settings: LearnSettings,
    shapes: Arc<Shapes>,
    critics: Vec<Network>,
    model: Network,
    actor: Network,
    parts: Vec<Part>,
    pool: Option<Arc<rayon::ThreadPool>>,
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
    /// Fresh networks for an environment of `spec`; `pool` runs the parts of an update, `None` on the caller's
    /// thread.
    ///
    /// # Errors
    /// What candle reports.
    pub fn new(
        spec: &Spec,
        settings: &LearnSettings,
        pool: Option<Arc<rayon::ThreadPool>>,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self> {
        if spec.state_dim() > MOST_STATE_NUMBERS {
            candle_core::bail!("states of more than {MOST_STATE_NUMBERS} numbers are not supported");
        }
        let shapes = Arc::new(Shapes::new(Encoder::new(spec, settings), settings));
        let grid = shapes.encoder.grid();
        let critics = (0..settings.critics).map(|_| Network::new(shapes.critic, grid, Some(settings.tau), rng));
        let critics = critics.collect::<Result<Vec<_>>>()?;
        let model = Network::new(shapes.model, grid, None, rng)?;
        let actor = Network::new(shapes.actor, grid, Some(settings.tau), rng)?;
        let parts = (0..settings.batch.div_ceil(PART_ROWS))
            .map(|_| Part { critics: vec![Gradient::default(); settings.critics], ..Part::default() });
        Ok(Self { settings: settings.clone(), parts: parts.collect(), critics, model, actor, pool, shapes })
    }

    /// Networks' shapes and input features.
    pub fn shapes(&self) -> &Shapes {
        &self.shapes
    }

    /// The critics, the first of which the actor follows.
    pub fn critics(&self) -> &[Network] {
        &self.critics
    }

    /// The dynamics model.
    pub fn model(&self) -> &Network {
        &self.model
    }

    /// The actor.
    pub fn actor(&self) -> &Network {
        &self.actor
    }

    /// The threads that share an update's work. A caller that updates often had best do so within
    /// [`rayon::ThreadPool::install`]: entering from outside hands the work to another thread every time.
    pub fn pool(&self) -> Option<Arc<rayon::ThreadPool>> {
        self.pool.clone()
    }

    /// Updates done.
    pub fn updates(&self) -> u64 {
        self.actor.steps()
    }

    /// One update of critics, model, actor and averages on `batch` (Algorithm 1's inner loop).
    ///
    /// # Errors
    /// What candle reports.
    pub fn update(&mut self, batch: &Batch) -> Result<Losses> {
        let rates = StepRates {
            dense: self.settings.learning_rate,
            table: self.settings.grid_learning_rate,
            tau: self.settings.tau,
        };
        self.critic_and_model_gradients(batch)?;
        self.step_critics_and_model(rates)?;
        self.actor_gradients(batch)?;
        self.actor.step(&mut self.parts.iter_mut().map(|p| &mut p.actor).collect::<Vec<_>>(), rates)?;
        Ok(self.losses())
    }

    /// Losses and gradients on `batch` of the first critic, the model and the actor, all at the current weights and
    /// without a step: flat parameters and table of each. For checks against other ways to compute them.
    ///
    /// # Errors
    /// What candle reports.
    pub fn gradients(&mut self, batch: &Batch) -> Result<(Losses, [WholeGradient; 3])> {
        self.critic_and_model_gradients(batch)?;
        self.actor_gradients(batch)?;
        let table = self.critics[0].table_size();
        let sum = |of: fn(&Part) -> &Gradient| Gradient::sum(self.parts.iter().map(of), table);
        Ok((self.losses(), [sum(|p| &p.critics[0]), sum(|p| &p.model), sum(|p| &p.actor)]))
    }

    fn losses(&self) -> Losses {
        self.parts.iter().fold(Losses::default(), |sum, part| Losses {
            critic: sum.critic + part.losses.critic,
            model: sum.model + part.losses.model,
            actor: sum.actor + part.losses.actor,
        })
    }

    /// Each network's step is independent of the others'.
    fn step_critics_and_model(&mut self, rates: StepRates) -> Result<()> {
        let mut gradients: Vec<Vec<&mut Gradient>> = self.critics.iter().map(|_| Vec::new()).collect();
        let mut of_model = Vec::new();
        for part in &mut self.parts {
            gradients.iter_mut().zip(&mut part.critics).for_each(|(all, own)| all.push(own));
            of_model.push(&mut part.model);
        }
        gradients.push(of_model);
        let networks = self.critics.iter_mut().chain([&mut self.model]);
        let mut steps: Vec<_> = networks.zip(gradients).collect();
        match &self.pool {
            Some(pool) => {
                pool.install(|| steps.par_iter_mut().try_for_each(|(network, parts)| network.step(parts, rates)))
            }
            None => steps.iter_mut().try_for_each(|(network, parts)| network.step(parts, rates)),
        }
    }

    fn critic_and_model_gradients(&mut self, batch: &Batch) -> Result<()> {
        let locked: Vec<_> = self.critics.iter().map(Network::lock).collect();
        let model = self.model.lock();
        let critics = locked.iter().map(|l| l.weights(false)).collect::<Result<Vec<_>>>()?;
        let targets = locked.iter().map(|l| l.weights(true)).collect::<Result<Vec<_>>>()?;
        let model = model.weights(false)?;
        let shapes = &*self.shapes;
        run(self.pool.as_deref(), &mut self.parts, |i, part| {
            let rows = Rows::new(shapes, batch, i);
            part.critic_gradients(shapes, &rows, &critics, &targets);
            part.model.prepare(shapes.model.parameters());
            let transitions = (rows.from, rows.actions, rows.next);
            part.losses.model = shapes.model_gradient(model, transitions, rows.share, &mut part.model, &mut part.step);
        });
        Ok(())
    }

    fn actor_gradients(&mut self, batch: &Batch) -> Result<()> {
        let (actor, model, critic) = (self.actor.lock(), self.model.lock(), self.critics[0].lock());
        let path =
            ActorPath { actor: actor.weights(false)?, model: model.weights(false)?, critic: critic.weights(false)? };
        let shapes = &*self.shapes;
        run(self.pool.as_deref(), &mut self.parts, |i, part| {
            let rows = Rows::new(shapes, batch, i);
            part.actor.prepare(shapes.actor.parameters());
            let buffers = (&mut part.act, &mut part.step, &mut part.judge);
            let pairs = Pairs { plain: &part.plain, states: rows.states, goals: rows.goals };
            part.losses.actor = shapes.actor_gradient(&path, pairs, rows.share, &mut part.actor, buffers);
        });
        Ok(())
    }

    /// Uses the networks as they are, or their averages, while no update runs.
    ///
    /// # Errors
    /// What candle reports.
    pub fn with_nets<R>(&self, averaged: bool, use_nets: impl FnOnce(Nets) -> R) -> Result<R> {
        let locked: Vec<_> = self.critics.iter().map(Network::lock).collect();
        let actor = self.actor.lock();
        Ok(use_nets(Nets {
            shapes: &self.shapes,
            critics: locked.iter().map(|l| l.weights(averaged)).collect::<Result<_>>()?,
            actor: actor.weights(averaged)?,
        }))
    }

    /// A frozen copy of critics and actor, of their averages if asked for.
    ///
    /// # Errors
    /// What candle reports.
    pub fn policy(&self, averaged: bool) -> Result<Policy> {
        let critics = self.critics.iter().map(|c| c.copy(averaged)).collect::<Result<_>>()?;
        Ok(Policy::new(self.shapes.clone(), critics, self.actor.copy(averaged)?))
    }

    /// Everything that training changed, for a checkpoint.
    ///
    /// # Errors
    /// What candle reports.
    pub fn state(&self) -> Result<LearnerState> {
        let networks = self.named().map(|(name, network)| Ok((name, network.state()?))).collect::<Result<_>>()?;
        Ok(LearnerState { updates: self.updates(), networks })
    }

    /// Takes up what [`Self::state`] gave; `find(network, part)` returns the numbers saved under these names.
    ///
    /// # Errors
    /// A part that is missing or of another size.
    pub fn restore(&mut self, updates: u64, find: impl Fn(&str, &str) -> Option<Vec<f32>>) -> Result<()> {
        for (k, critic) in self.critics.iter_mut().enumerate() {
            critic.restore(updates, |part| find(&critic_name(k), part))?;
        }
        self.model.restore(updates, |part| find("model", part))?;
        self.actor.restore(updates, |part| find("actor", part))
    }

    fn named(&self) -> impl Iterator<Item = (String, &Network)> {
        let critics = self.critics.iter().enumerate().map(|(k, critic)| (critic_name(k), critic));
        critics.chain([("model".to_owned(), &self.model), ("actor".to_owned(), &self.actor)])
    }
}

fn critic_name(k: usize) -> String {
    format!("critic{k}")
}

/// Runs `work` on every part, on the pool's threads where there is one.
fn run(pool: Option<&rayon::ThreadPool>, parts: &mut [Part], work: impl Fn(usize, &mut Part) + Sync) {
    match pool {
        Some(pool) => pool.install(|| parts.par_iter_mut().enumerate().for_each(|(i, part)| work(i, part))),
        None => parts.iter_mut().enumerate().for_each(|(i, part)| work(i, part)),
    }
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
        let rows = part * PART_ROWS..((part + 1) * PART_ROWS).min(batch.len());
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
