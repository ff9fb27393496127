//! The agents: which goal each pursues, how it explores, and what is remembered of it.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::method::Method;
use super::settings::Settings;
use crate::bridge::{Experience, SearchOutcome, search};
use crate::env::Environment;
use crate::learn::{Nets, Replay, Scratch};

/// One agent's episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Agent {
    /// What it pursues now.
    pub goal: Vec<f32>,
    /// What it pursues once it has reached the bridge point that `goal` then is.
    pub after_bridge: Option<Vec<f32>>,
    /// Steps of the episode so far.
    pub steps: u32,
    /// A random action that it holds, and for how many more steps.
    held: Option<(Vec<f32>, u32)>,
}

/// Agents in an environment, acting and remembering.
pub struct Rollout<E> {
    env: E,
    agents: Vec<Agent>,
    rng: ChaCha8Rng,
    actions: Vec<f32>,
    goals: Vec<f32>,
    scratch: Scratch,
    last_search: Option<SearchOutcome>,
}

/// What one round of steps brought.
#[derive(Clone, Copy, Debug, Default)]
pub struct Round {
    /// Episodes that ended.
    pub episodes: u64,
    /// Goals reached.
    pub reached: u64,
}

/// Agents' episodes and the random state, for checkpoints.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RolloutState {
    /// The agents.
    pub agents: Vec<Agent>,
    /// Their states, `(agents, state_dim)`.
    pub states: Vec<f32>,
    /// The random state.
    pub rng: ChaCha8Rng,
}

impl<E: Environment> Rollout<E> {
    /// Agents at random starts with random goals.
    pub fn new(mut env: E, mut rng: ChaCha8Rng) -> Self {
        let goal_dim = env.spec().goal_dim();
        let agents = (0..env.agents()).map(|i| {
            env.restart(i, &mut rng);
            let mut goal = vec![0.0; goal_dim];
            env.sample_goal(i, &mut rng, &mut goal);
            Agent { goal, after_bridge: None, steps: 0, held: None }
        });
        let agents = agents.collect();
        Self {
            env,
            agents,
            rng,
            actions: Vec::new(),
            goals: Vec::new(),
            scratch: Scratch::default(),
            last_search: None,
        }
    }

    /// The environment.
    pub fn env(&self) -> &E {
        &self.env
    }

    /// The agents.
    pub fn agents(&self) -> &[Agent] {
        &self.agents
    }

    /// The latest bridge search.
    pub fn last_search(&self) -> Option<SearchOutcome> {
        self.last_search
    }

    /// Every agent takes one step, stored in `replay` and noted in `experience`.
    pub fn step(
        &mut self,
        method: Method,
        settings: &Settings,
        nets: &Nets,
        replay: &mut Replay,
        experience: &mut Experience,
    ) -> Round {
        let (s, a) = (self.env.spec().state_dim(), self.env.spec().action_dim);
        self.choose_actions(method, settings, nets);
        for (i, agent) in self.agents.iter().enumerate() {
            let state = &self.env.states()[i * s..(i + 1) * s];
            replay.push(i, state, &self.actions[i * a..(i + 1) * a], &agent.goal);
            experience.visit(i, state);
        }
        self.env.step(&self.actions, &mut self.rng);
        let mut round = Round::default();
        for i in 0..self.agents.len() {
            let state = &self.env.states()[i * s..(i + 1) * s];
            let agent = &mut self.agents[i];
            agent.steps += 1;
            if agent.steps >= settings.train.episode_steps {
                replay.end_episode(i, state);
                experience.visit(i, state);
                experience.end_episode(i);
                round.episodes += 1;
                self.begin_episode(i, method, settings, nets, experience);
            } else if self.env.spec().reached(state, &agent.goal) {
                if let Some(goal) = agent.after_bridge.take() {
                    agent.goal = goal;
                } else if settings.train.new_goal_when_reached {
                    round.reached += 1;
                    self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
                }
            }
        }
        round
    }

    /// A random start and goal; with probability epsilon a bridge point is the first goal (Algorithm 1).
    fn begin_episode(&mut self, i: usize, method: Method, settings: &Settings, nets: &Nets, experience: &Experience) {
        self.env.restart(i, &mut self.rng);
        let agent = &mut self.agents[i];
        agent.steps = 0;
        agent.held = None;
        agent.after_bridge = None;
        self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
        if !method.plans() || self.rng.random::<f32>() >= settings.bridge.bridge_epsilon {
            return;
        }
        let s = self.env.spec().state_dim();
        let outcome = search(
            (&self.env.states()[i * s..(i + 1) * s], &agent.goal),
            (experience.states(), experience.points()),
            settings.bridge.search_budget,
            nets,
            &mut self.rng,
            &mut self.scratch,
        );
        if let Some((bridge, _)) = outcome.found {
            let g = agent.goal.len();
            let point = experience.points()[bridge * g..(bridge + 1) * g].to_vec();
            agent.after_bridge = Some(std::mem::replace(&mut agent.goal, point));
        }
        self.last_search = Some(outcome);
    }

    /// The actor's actions with noise, or a random direction held for a while.
    fn choose_actions(&mut self, method: Method, settings: &Settings, nets: &Nets) {
        let a = self.env.spec().action_dim;
        self.actions.resize(self.agents.len() * a, 0.0);
        if method != Method::Random {
            self.goals.clear();
            self.goals.extend(self.agents.iter().flat_map(|agent| agent.goal.iter().copied()));
            nets.actions(self.env.states(), &self.goals, &mut self.actions, &mut self.scratch);
        }
        // With holds of h steps on average, a share r of all steps is random when a hold begins with probability
        // r / (r + (1 - r) h) at each free step.
        let (share, hold) = match method {
            Method::Random => (1.0, settings.train.random_hold_steps),
            _ => (settings.train.random_actions, settings.train.random_hold_steps),
        };
        let begin = if share > 0.0 { share / (share + (1.0 - share) * hold) } else { 0.0 };
        let rng = &mut self.rng;
        for (agent, action) in self.agents.iter_mut().zip(self.actions.chunks_exact_mut(a)) {
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
                    *v = (*v + settings.train.action_noise * noise).clamp(-1.0, 1.0);
                }
            }
        }
    }

    /// Everything that the next steps depend on, for a checkpoint.
    pub fn state(&self) -> RolloutState {
        RolloutState { agents: self.agents.clone(), states: self.env.states().to_vec(), rng: self.rng.clone() }
    }

    /// Takes up what [`Self::state`] gave.
    ///
    /// # Errors
    /// Where it was not saved from as many agents in such an environment.
    pub fn restore(&mut self, state: RolloutState) -> Result<(), String> {
        let (s, g) = (self.env.spec().state_dim(), self.env.spec().goal_dim());
        let whole = state.agents.iter().all(|a| a.goal.len() == g);
        if state.agents.len() != self.agents.len() || state.states.len() != self.agents.len() * s || !whole {
            return Err("the stored agents do not fit these settings".to_owned());
        }
        for (i, own) in state.states.chunks_exact(s).enumerate() {
            self.env.place(i, own);
        }
        self.agents = state.agents;
        self.rng = state.rng;
        Ok(())
    }
}
