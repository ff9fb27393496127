//! Actions of exploring agents.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};

use super::{Rollout, StepContext};
use crate::learn::Acting;

impl Rollout {
    /// Chooses actions: the actor's with noise, or a random direction held for several steps.
    pub(super) fn choose_actions(&mut self, context: &StepContext) {
        self.actions.resize(self.agents.len() * self.env.spec().action_dim, 0.0);
        if context.acting == Acting::Policy {
            let Self { env, agents, plans, goals, actions, scratch, .. } = self;
            goals.clear();
            goals.extend(agents.iter().flat_map(|agent| agent.goal.iter().copied()));
            let walkers = plans.iter().zip(&*agents).map(|(plan, agent)| {
                plan.as_ref().filter(|_| agent.held.is_none()).map(|plan| &plan.walker)
            });
            context.guide.act(walkers, env.states(), goals, actions, scratch);
        }
        self.explore(context);
    }

    /// Replaces the actions of agents on an excursion or holding a random direction; adds noise to
    /// the others.
    fn explore(&mut self, context: &StepContext) {
        let settings = &context.settings.train;
        // With a mean hold of h steps, a fraction r of all steps is random if each free step begins
        // a hold with probability r / (r + (1 - r) h).
        let share = match context.acting {
            Acting::AtRandom => 1.0,
            Acting::Policy => settings.random_actions,
        };
        let hold = settings.random_hold_steps;
        let begin = if share > 0.0 { share / (share + (1.0 - share) * hold) } else { 0.0 };
        let (a, rng) = (self.env.spec().action_dim, &mut self.rng);
        for (i, (agent, action)) in
            self.agents.iter_mut().zip(self.actions.chunks_exact_mut(a)).enumerate()
        {
            if self.excursions.act(i, action, rng) {
                agent.held = None;
                continue;
            }
            if agent.held.is_none() && rng.random::<f32>() < begin {
                let direction = (0..a).map(|_| rng.random_range(-1.0..=1.0)).collect();
                let steps = (1.0 - hold * (1.0 - rng.random::<f32>()).ln()).min(1e6) as u32;
                agent.held = Some((direction, steps.max(1)));
            }
            if let Some((direction, left)) = &mut agent.held {
                action.copy_from_slice(direction);
                *left -= 1;
                if *left == 0 {
                    agent.held = None;
                }
            } else {
                for v in action {
                    let noise: f32 = StandardNormal.sample(rng);
                    *v = (*v + settings.exploration_noise * noise).clamp(-1.0, 1.0);
                }
            }
        }
    }
}
