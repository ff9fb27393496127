//! Values, targets and hand-written gradients of one part of a batch.

use super::Variant;
use super::batch::Transitions;
use super::returns::Returns;
use crate::env::Spec;
use crate::learn::networks::encoder::Encoder;
use crate::learn::networks::features::{Pairs, SharedFeatures, Workspace, resized};
use crate::learn::networks::mlp::{GradientRequest, Mlp};
use crate::learn::networks::network::Weights;
use crate::learn::settings::LearnSettings;
use crate::learn::update::gradient::Gradient;
use crate::learn::update::losses::EXCESS_WEIGHT;
use crate::learn::update::rows::rows_of_part;

/// Sizes of the networks, and the meaning of their outputs.
#[derive(Clone, Debug)]
pub struct Shapes {
    pub encoder: Encoder,
    /// Prefix of the networks' names in checkpoints.
    pub prefix: &'static str,
    /// Number of critics.
    pub critics: usize,
    /// Q(s, a, g): rows are pair rows followed by the action.
    pub critic: Mlp,
    /// mu(s, g) = tanh(z).
    pub actor: Mlp,
    pub returns: Returns,
    /// Bound of z; infinite for none.
    pub actor_bound: f32,
    /// Weight of the mean of z^2.
    pub actor_l2: f32,
}

impl Shapes {
    /// Returns the shapes of the networks that `settings` specify.
    pub fn new(variant: Variant, spec: &Spec, settings: &LearnSettings) -> Self {
        let encoder = Encoder::new(spec, settings);
        let mlp = |inputs, outputs| Mlp {
            inputs,
            hidden: settings.hidden,
            layers: settings.layers,
            outputs,
        };
        Self {
            prefix: variant.prefix,
            critics: settings.critics,
            critic: mlp(encoder.pair_width() + spec.action_dim, 1),
            actor: mlp(encoder.pair_width(), spec.action_dim),
            returns: Returns::new(variant.reward, settings.discount, spec),
            actor_bound: if settings.actor_bound > 0.0 {
                settings.actor_bound
            } else {
                f32::INFINITY
            },
            actor_l2: settings.actor_l2,
            encoder,
        }
    }

    /// Builds the critic's rows from pairs and `actions` `(rows, action_dim)`.
    fn rows(&self, critic: Weights, pairs: Pairs, actions: &[f32], x: &mut Vec<f32>) {
        let (width, pair_width) = (self.critic.inputs, self.encoder.pair_width());
        self.encoder.pair_rows(pairs, critic.table, width, x);
        for (row, action) in x.chunks_exact_mut(width).zip(actions.chunks_exact(width - pair_width))
        {
            row[pair_width..].copy_from_slice(action);
        }
    }

    /// Computes Q(s, a, g), `(rows)`; keeps inputs and activations for the backward pass.
    fn values(
        &self,
        critic: Weights,
        pairs: Pairs,
        actions: &[f32],
        out: &mut [f32],
        ws: &mut Workspace,
    ) {
        self.rows(critic, pairs, actions, &mut ws.x);
        let x = &ws.x[..out.len() * self.critic.inputs];
        self.critic.forward(critic.dense, critic.packed, x, out, &mut ws.acts);
    }

    /// Computes the minimum of Q(s, mu(s, g) + noise, g) over `critics`, `(rows)`; Fujimoto et al.
    /// 2018, sections 4.2 and 5.3. `noise` is `(rows, action_dim)`, or empty for none.
    pub fn values_of_actor(
        &self,
        actor: Weights,
        critics: &[Weights],
        pairs: Pairs,
        noise: &[f32],
        out: &mut [f32],
        [actor_ws, critic_ws]: [&mut Workspace; 2],
    ) {
        let mut actions = std::mem::take(&mut actor_ws.y);
        let actions_of_rows = resized(&mut actions, out.len() * self.actor.outputs);
        actor_ws.actions(&self.encoder, &self.actor, actor, pairs, actions_of_rows);
        actions_of_rows
            .iter_mut()
            .zip(noise)
            .for_each(|(action, noise)| *action = (*action + noise).clamp(-1.0, 1.0));
        let mut own = std::mem::take(&mut critic_ws.y);
        for (k, critic) in critics.iter().enumerate() {
            let own = resized(&mut own, out.len());
            self.values(*critic, pairs, actions_of_rows, own, critic_ws);
            out.iter_mut()
                .zip(own)
                .for_each(|(least, q)| *least = if k == 0 { *q } else { least.min(*q) });
        }
        critic_ws.y = own;
        actor_ws.y = actions;
    }

    /// Computes a critic's gradient of the mean squared error towards `targets` into `gradient`.
    /// Returns the part's loss.
    fn critic_gradient(
        &self,
        critic: Weights,
        pairs: Pairs,
        rows: &Rows,
        targets: &[f32],
        gradient: &mut Gradient,
        ws: &mut Workspace,
    ) -> f32 {
        gradient.prepare(self.critic.parameters());
        let mut q = std::mem::take(&mut ws.y);
        let values = resized(&mut q, targets.len());
        self.values(critic, pairs, rows.actions, values, ws);
        let mut loss = 0.0;
        for (q, target) in values.iter_mut().zip(targets) {
            let error = *q - target;
            loss += error * error * rows.share;
            *q = 2.0 * error * rows.share;
        }
        let from = self.encoder.plain_pair_width();
        let columns = self.critic.inputs - from;
        let has_grid = self.encoder.grid_width() > 0;
        let dx = has_grid.then(|| (from, resized(&mut ws.dx, targets.len() * columns)));
        let x = &ws.x[..targets.len() * self.critic.inputs];
        let wanted = GradientRequest { parameters: Some(&mut gradient.dense), inputs: dx };
        self.critic.backward(critic.dense, critic.packed, x, values, &mut ws.acts, wanted);
        gradient.add_pair_corners(&self.encoder, pairs, &ws.dx, self.actor.outputs);
        ws.y = q;
        loss
    }

    /// Computes the actor's gradient into `gradient`: that of mean -Q(s, mu(s, g), g) by the frozen
    /// critic (Lillicrap et al. 2016, Eq. 6), of the weighted mean of z^2 (Andrychowicz et al.
    /// 2017, appendix A: the squared outputs before tanh, against vanishing gradients) and of their
    /// excess over a bound. Returns the part's share of mean -Q.
    fn actor_gradient(
        &self,
        actor: Weights,
        critic: Weights,
        pairs: Pairs,
        share: f32,
        gradient: &mut Gradient,
        [actor_ws, critic_ws]: [&mut Workspace; 2],
    ) -> f32 {
        gradient.prepare(self.actor.parameters());
        let a = self.actor.outputs;
        let rows = pairs.states.len() / self.encoder.spec().state_dim();
        let (mut actions, mut q) =
            (std::mem::take(&mut actor_ws.y), std::mem::take(&mut critic_ws.y));
        let (actions_of_rows, values) = (resized(&mut actions, rows * a), resized(&mut q, rows));
        actor_ws.actions(&self.encoder, &self.actor, actor, pairs, actions_of_rows);
        self.values(critic, pairs, actions_of_rows, values, critic_ws);
        let loss = values.iter().map(|q| -share * q).sum();
        values.fill(-share);
        let d_action = resized(&mut critic_ws.dx, rows * a);
        let wanted = GradientRequest {
            parameters: None,
            inputs: Some((self.critic.inputs - a, &mut *d_action)),
        };
        let x = &critic_ws.x[..rows * self.critic.inputs];
        self.critic.backward(critic.dense, critic.packed, x, values, &mut critic_ws.acts, wanted);
        let l2 = self.actor_l2 / a as f32;
        for ((action, d), z) in actions_of_rows.iter_mut().zip(&*d_action).zip(&actor_ws.outputs) {
            let excess = z - z.clamp(-self.actor_bound, self.actor_bound);
            *action =
                d * (1.0 - *action * *action) + 2.0 * share * (EXCESS_WEIGHT * excess + l2 * z);
        }
        let from = self.encoder.plain_pair_width();
        let dx = (from < self.actor.inputs)
            .then(|| (from, resized(&mut actor_ws.dx, rows * (self.actor.inputs - from))));
        let wanted = GradientRequest { parameters: Some(&mut gradient.dense), inputs: dx };
        let x = &actor_ws.x[..rows * self.actor.inputs];
        self.actor.backward(
            actor.dense,
            actor.packed,
            x,
            actions_of_rows,
            &mut actor_ws.acts,
            wanted,
        );
        (actor_ws.y, critic_ws.y) = (actions, q);
        gradient.add_pair_corners(&self.encoder, pairs, &actor_ws.dx, 0);
        loss
    }
}

/// Buffers of one task of an update.
#[derive(Default)]
pub struct Buffers {
    plain: SharedFeatures,
    plain_ahead: SharedFeatures,
    pub targets: Vec<f32>,
    actor: Workspace,
    critic: Workspace,
}

impl Buffers {
    /// Computes the targets of the part's rows with the target networks: critics, then the actor.
    pub fn compute_targets(&mut self, shapes: &Shapes, rows: &Rows, networks: &[Weights]) {
        let Self { plain, plain_ahead, targets, actor: actor_ws, critic: critic_ws } = self;
        shapes.encoder.plain_pairs(rows.states, rows.goals, plain);
        shapes.encoder.plain_pairs(rows.next, rows.goals, plain_ahead);
        targets.resize(rows.rewards.len(), 0.0);
        let ahead = Pairs { plain: plain_ahead, states: rows.next, goals: rows.goals };
        let (critics, actor) = (&networks[..shapes.critics], networks[shapes.critics]);
        let buffers = [actor_ws, critic_ws];
        shapes.values_of_actor(actor, critics, ahead, rows.noise, targets, buffers);
        for (i, target) in targets.iter_mut().enumerate() {
            *target = shapes.returns.target(rows.rewards[i], rows.at_goal[i], *target);
        }
    }

    /// Computes a critic's gradient towards the targets into `gradient`. Returns the part's loss.
    pub fn critic_gradient(
        &mut self,
        shapes: &Shapes,
        rows: &Rows,
        critic: Weights,
        gradient: &mut Gradient,
    ) -> f32 {
        let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
        shapes.critic_gradient(critic, pairs, rows, &self.targets, gradient, &mut self.critic)
    }

    /// Computes the actor's gradient by the frozen `critic` into `gradient`; the critics' come
    /// first. Returns the part's loss.
    pub fn actor_gradient(
        &mut self,
        shapes: &Shapes,
        rows: &Rows,
        actor: Weights,
        critic: Weights,
        gradient: &mut Gradient,
    ) -> f32 {
        let pairs = Pairs { plain: &self.plain, states: rows.states, goals: rows.goals };
        let buffers = [&mut self.actor, &mut self.critic];
        shapes.actor_gradient(actor, critic, pairs, rows.share, gradient, buffers)
    }
}

/// The rows of a batch that belong to one part.
pub struct Rows<'a> {
    pub states: &'a [f32],
    pub goals: &'a [f32],
    actions: &'a [f32],
    next: &'a [f32],
    rewards: &'a [f32],
    at_goal: &'a [bool],
    noise: &'a [f32],
    /// 1 / batch size.
    share: f32,
}

impl<'a> Rows<'a> {
    /// Returns the rows of part number `part`.
    pub fn new(shapes: &Shapes, batch: &'a Transitions, part: usize) -> Self {
        let spec = shapes.encoder.spec();
        let rows = rows_of_part(batch.len(), part);
        let cut = |numbers: &'a [f32], width: usize| &numbers[rows.start * width..rows.end * width];
        Self {
            states: cut(&batch.states, spec.state_dim()),
            goals: cut(&batch.goals, spec.goal_dim()),
            actions: cut(&batch.actions, spec.action_dim),
            next: cut(&batch.next, spec.state_dim()),
            rewards: cut(&batch.rewards, 1),
            at_goal: &batch.at_goal[rows.clone()],
            noise: cut(&batch.noise, spec.action_dim),
            share: 1.0 / batch.len() as f32,
        }
    }
}
