//! The exploring agents: their goals, exploration and stored experience.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::settings::Settings;
use crate::bridge::{
    BridgeGraph, BridgeSettings, Candidates, Excursions, Hop, SearchOutcome, Walker, WalkerState,
    search,
};
use crate::env::{EnvSettings, Environment, Restart};
use crate::learn::{Acting, MAX_MAGNITUDE, Policy, Replay, Scratch, look_ahead};
use crate::store::StoreError;

/// An agent gives up on a goal after this multiple of D to it ...
pub(crate) const GIVE_UP_FACTOR: f32 = 3.0;

/// ... plus this many steps.
pub(crate) const GIVE_UP_SLACK_STEPS: f32 = 50.0;

/// One agent's episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Agent {
    /// Current goal.
    pub goal: Vec<f32>,
    /// Goal to pursue after `goal`, which is a bridge point while this is set.
    pub after_bridge: Option<Vec<f32>>,
    /// Steps of the episode so far.
    pub steps: u32,
    /// Held random action and its remaining steps.
    held: Option<(Vec<f32>, u32)>,
    /// Step of the episode at which it gives up on its goal.
    #[serde(default)]
    give_up_at: u32,
}

/// An agent's plan to a goal through the bridge graph; the agent pursues its waypoints.
struct Plan {
    walker: Walker,
    goal: Vec<f32>,
    /// Whether the agent has acted at random since setting out for the waypoint: being late then
    /// says nothing about the edge.
    disturbed: bool,
}

/// Checkpointed state of a [`Plan`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlanState {
    walker: WalkerState,
    goal: Vec<f32>,
    disturbed: bool,
}

/// Inputs and outputs of a round of steps.
pub struct StepContext<'a> {
    /// Whether episodes use bridge points and plans.
    pub bridges: bool,
    /// How agents act.
    pub acting: Acting,
    /// Steps per episode.
    pub episode_steps: u32,
    /// All settings.
    pub settings: &'a Settings,
    /// The current policy.
    pub policy: &'a dyn Policy,
    /// The current bridge graph.
    pub graph: Option<&'a BridgeGraph>,
    /// Receives the transitions.
    pub replay: &'a mut Replay,
    /// Receives visited states and the outcomes of hops between candidates.
    pub candidates: &'a mut Candidates,
}

/// Agents acting in an environment and storing their experience.
pub struct Rollout {
    env: Box<dyn Environment>,
    agents: Vec<Agent>,
    plans: Vec<Option<Plan>>,
    rng: ChaCha8Rng,
    actions: Vec<f32>,
    goals: Vec<f32>,
    /// A world with one agent, in which the walks to near goals are taken.
    aside: Option<Box<dyn Environment>>,
    scratch: Scratch,
    excursions: Excursions,
    last_search: Option<Arc<SearchOutcome>>,
}

/// Result of one round of steps.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoundResult {
    /// Episodes that ended.
    pub episodes: u64,
    /// Goals reached.
    pub reached: u64,
}

/// Checkpointed episodes of the agents and RNG state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RolloutState {
    /// The agents.
    pub agents: Vec<Agent>,
    /// Their plans.
    pub plans: Vec<Option<PlanState>>,
    /// Their full states, concatenated.
    pub states: Vec<f64>,
    /// RNG state.
    pub rng: ChaCha8Rng,
}

impl Rollout {
    /// Places agents at random starts with random goals.
    pub fn new(mut env: Box<dyn Environment>, mut rng: ChaCha8Rng) -> Self {
        let goal_dim = env.spec().goal_dim();
        let agents = (0..env.agents()).map(|i| {
            env.restart(i, &mut rng);
            let mut goal = vec![0.0; goal_dim];
            env.sample_goal(i, &mut rng, &mut goal);
            // Without a policy there is no telling how long the way is: the first step chooses
            // another goal.
            Agent { goal, after_bridge: None, steps: 0, held: None, give_up_at: 0 }
        });
        let agents: Vec<_> = agents.collect();
        Self {
            excursions: Excursions::new(env.spec(), agents.len()),
            plans: agents.iter().map(|_| None).collect(),
            env,
            agents,
            rng,
            actions: Vec::new(),
            goals: Vec::new(),
            aside: None,
            scratch: Scratch::default(),
            last_search: None,
        }
    }

    /// Returns the environment.
    pub fn env(&self) -> &dyn Environment {
        &*self.env
    }

    /// Returns the environment mutably, to change its settings and statistics.
    pub fn env_mut(&mut self) -> &mut dyn Environment {
        &mut *self.env
    }

    /// Returns the agents.
    pub fn agents(&self) -> &[Agent] {
        &self.agents
    }

    /// Returns agent `i`'s final goal and the waypoints ahead of it, if it has a plan.
    pub fn goal_and_waypoints(&self, i: usize) -> (&[f32], Vec<usize>) {
        let agent = &self.agents[i];
        match (&self.plans[i], &agent.after_bridge) {
            (Some(plan), _) => (&plan.goal, plan.walker.waypoints_ahead()),
            (None, Some(goal)) => (goal, Vec::new()),
            (None, None) => (&agent.goal, Vec::new()),
        }
    }

    /// Returns the excursions beyond the frontier.
    pub fn excursions(&self) -> &Excursions {
        &self.excursions
    }

    /// Returns the excursions, to keep what they have found.
    pub(super) fn into_excursions(self) -> Excursions {
        self.excursions
    }

    /// Returns the excursions mutably, to restore or replace them.
    pub(super) fn excursions_mut(&mut self) -> &mut Excursions {
        &mut self.excursions
    }

    /// Returns the latest bridge search.
    pub fn last_search(&self) -> Option<&Arc<SearchOutcome>> {
        self.last_search.as_ref()
    }

    /// Steps every agent once and stores the transitions in replay buffer and candidates. Returns
    /// `None` without stepping if the actor's actions are not finite.
    pub fn step(&mut self, context: &mut StepContext) -> Option<RoundResult> {
        let (s, a) = (self.env.spec().state_dim(), self.env.spec().action_dim);
        // In this order, a plan that begins as an excursion ends has a waypoint at once.
        self.follow_excursions(context);
        self.follow_plans(context);
        self.choose_actions(context);
        if !self.actions.iter().all(|a| a.is_finite()) {
            return None;
        }
        self.excursions.count_steps();
        for (i, agent) in self.agents.iter().enumerate() {
            let state = &self.env.states()[i * s..(i + 1) * s];
            context.replay.push(i, state, &self.actions[i * a..(i + 1) * a], &agent.goal);
            context.candidates.visit(i, state);
        }
        self.env.step(&self.actions, &mut self.rng);
        let mut round = RoundResult::default();
        for i in 0..self.agents.len() {
            let state = &self.env.states()[i * s..(i + 1) * s];
            self.agents[i].steps = self.agents[i].steps.saturating_add(1);
            if self.agents[i].steps >= context.episode_steps {
                context.replay.end_episode(i, state);
                // The trajectory of an agent that is not moved goes on.
                if !self.stays(i, context) {
                    context.candidates.visit(i, state);
                    context.candidates.end_episode(i);
                }
                round.episodes += 1;
                self.start_episode(i, context);
            } else if !self.excursions.is_on(i) {
                self.end_pursuit(i, context, &mut round);
            }
        }
        Some(round)
    }

    /// Gives agent `i` its next goal if it has reached its own or gives up on it.
    fn end_pursuit(&mut self, i: usize, context: &StepContext, round: &mut RoundResult) {
        let s = self.env.spec().state_dim();
        let agent = &mut self.agents[i];
        let pursued = self.plans[i].as_ref().map_or(&agent.goal, |plan| &plan.goal);
        let reached = self.env.spec().reached(&self.env.states()[i * s..(i + 1) * s], pursued);
        if reached && let Some(goal) = agent.after_bridge.take() {
            agent.goal = goal;
            self.plans[i] = None;
            self.set_deadline(i, context);
        } else if context.settings.train.new_goal_when_reached
            && (reached || agent.steps >= agent.give_up_at)
        {
            round.reached += u64::from(reached);
            self.choose_goal(i, context);
        }
    }

    /// Drops all plans, whose agents pursue the plans' goals directly, and ends all excursions.
    pub fn discard_plans(&mut self) {
        self.excursions.end_all();
        for (agent, plan) in self.agents.iter_mut().zip(&mut self.plans) {
            if let Some(plan) = plan.take() {
                agent.goal = plan.goal;
            }
        }
    }

    /// Whether agent `i` begins its next episode where it is.
    fn stays(&self, i: usize, context: &StepContext) -> bool {
        match context.settings.train.restart {
            Restart::Never => true,
            Restart::Auto => {
                self.env.abilities().episodes.is_some_and(|episodes| episodes.stays(i))
            }
            Restart::Anywhere | Restart::StartCell => false,
        }
    }

    /// Starts an episode with a new start and goal. With probability `bridge_epsilon`, a bridge
    /// point is the first goal (Algorithm 1).
    fn start_episode(&mut self, i: usize, context: &StepContext) {
        if !self.stays(i, context) {
            self.env.restart(i, &mut self.rng);
        }
        self.begin_episode(i);
        self.choose_goal(i, context);
        if context.bridges
            && self.chance(context.settings.bridge.bridge_epsilon)
            && !self.excursions.is_on(i)
            && let Some(point) = self.search_bridge(i, context)
        {
            let agent = &mut self.agents[i];
            agent.after_bridge = Some(std::mem::replace(&mut agent.goal, point));
            if self.plans[i].is_some() {
                self.plan(i, context);
            }
            self.set_deadline(i, context);
        }
    }

    /// Gives agent `i` a random goal. With given probabilities, it first goes on an excursion
    /// beyond the frontier, or follows a plan through the bridge graph.
    fn choose_goal(&mut self, i: usize, context: &StepContext) {
        let agent = &mut self.agents[i];
        agent.after_bridge = None;
        self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
        self.plans[i] = None;
        if self.chance(context.settings.train.near_goals) {
            self.choose_near_goal(i, context.settings.train.near_goal_steps);
        }
        if context.bridges {
            let BridgeSettings { planned_episodes, .. } = context.settings.bridge;
            if self
                .excursions
                .are_due(context.settings.bridge.frontier_share(self.excursions.has_frontier()))
            {
                self.excursions.begin(i);
            } else if self.chance(planned_episodes) {
                self.plan(i, context);
            }
        }
        self.set_deadline(i, context);
    }

    /// Makes the goal of agent `i` the place where a straight walk of at most `longest` steps from
    /// its own place ends, if the world can put another agent there.
    fn choose_near_goal(&mut self, i: usize, longest: u32) {
        let aside = self.aside.get_or_insert_with(|| {
            let mut world = self.env.fork(1);
            // The walk is straight even where actions are noisy.
            world.configure(&EnvSettings::default());
            world
        });
        let action: Vec<f32> =
            (0..self.env.spec().action_dim).map(|_| self.rng.random_range(-1.0..=1.0)).collect();
        if !aside.set_full_state(0, &self.env.full_state(i)) {
            return;
        }
        for _ in 0..self.rng.random_range(1..=longest) {
            aside.step(&action, &mut self.rng);
        }
        self.agents[i].goal = self.env.spec().achieved(aside.states()).collect();
    }

    fn chance(&mut self, probability: f32) -> bool {
        probability > 0.0 && self.rng.random::<f32>() < probability
    }

    /// Sets the step at which agent `i` gives up on its goal: most goals in unexplored parts cannot
    /// be reached yet.
    fn set_deadline(&mut self, i: usize, context: &StepContext) {
        let s = self.env.spec().state_dim();
        let agent = &mut self.agents[i];
        let state = &self.env.states()[i * s..(i + 1) * s];
        let distance = context.policy.distance(state, &agent.goal, &mut self.scratch);
        let steps = GIVE_UP_FACTOR * distance + GIVE_UP_SLACK_STEPS;
        agent.give_up_at = agent.steps.saturating_add(steps as u32);
    }

    /// Runs the published search for a bridge point between agent `i` and its goal.
    fn search_bridge(&mut self, i: usize, context: &StepContext) -> Option<Vec<f32>> {
        let s = self.env.spec().state_dim();
        let (candidates, goal) = (&*context.candidates, &self.agents[i].goal);
        let outcome = search(
            (&self.env.states()[i * s..(i + 1) * s], goal),
            (candidates.states(), candidates.points()),
            context.settings.bridge.search_budget,
            context.policy,
            &mut self.rng,
            &mut self.scratch,
        );
        let found = outcome.found.as_ref().map(|bridge| bridge.point.clone());
        self.last_search = Some(Arc::new(outcome));
        found
    }

    /// Plans agent `i`'s path to its goal through the graph, if there is one.
    fn plan(&mut self, i: usize, context: &StepContext) {
        let Some(graph) = context.graph else { return };
        let goal = self.agents[i].goal.clone();
        let walker = Walker::new(graph.route(&goal, context.policy, &mut self.scratch));
        self.plans[i] = Some(Plan { walker, goal, disturbed: false });
    }

    /// Moves all agents at their current states to another environment of the same kind, ending
    /// their episodes and starting new ones.
    pub fn enter_environment(&mut self, env: Box<dyn Environment>, replay: &mut Replay) {
        self.end_episodes(replay);
        let before = std::mem::replace(&mut self.env, env);
        self.aside = None;
        for i in 0..self.agents.len() {
            if !self.env.set_full_state(i, &before.full_state(i)) {
                self.env.restart(i, &mut self.rng);
            }
            self.begin_episode(i);
        }
        self.excursions.forget_outcomes();
    }

    /// Ends the episodes under way in the replay buffer, for agents that do not continue them.
    pub fn end_episodes(&self, replay: &mut Replay) {
        let states = self.env.states().chunks_exact(self.env.spec().state_dim());
        for (i, (state, agent)) in states.zip(&self.agents).enumerate() {
            if agent.steps > 0 {
                replay.end_episode(i, state);
            }
        }
    }

    /// Starts an episode from agent `i`'s current state to a random goal.
    fn begin_episode(&mut self, i: usize) {
        let agent = &mut self.agents[i];
        (agent.steps, agent.held, agent.after_bridge, agent.give_up_at) = (0, None, None, 0);
        self.plans[i] = None;
        self.excursions.end(i);
        self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
    }

    /// Replaces all existing plans after a change of graph.
    pub fn replan(&mut self, context: &StepContext) {
        for i in 0..self.plans.len() {
            if let Some(plan) = self.plans[i].take() {
                self.agents[i].goal = plan.goal;
                self.plan(i, context);
            }
        }
    }

    /// Updates the waypoints of agents with a plan and records the outcomes of their hops.
    fn follow_plans(&mut self, context: &mut StepContext) {
        let Some(graph) = context.graph else { return };
        let s = self.env.spec().state_dim();
        for (i, plan) in self.plans.iter_mut().enumerate() {
            let Some(plan) = plan else { continue };
            let (state, before) = (&self.env.states()[i * s..(i + 1) * s], plan.walker.target());
            let target = plan.walker.step(state, graph, context.policy, &mut self.scratch);
            self.agents[i].goal.copy_from_slice(target);
            if let Some(Hop { from, to, distance, arrived }) = plan.walker.finished_hop()
                && (arrived || !plan.disturbed)
            {
                let id = |candidate| graph.candidates().id(candidate);
                context.candidates.record_walk((id(from), id(to)), distance, arrived);
            }
            if plan.walker.finished_hop().is_some() || plan.walker.target() != before {
                plan.disturbed = false;
            }
            plan.disturbed |= self.agents[i].held.is_some();
        }
    }

    /// Tells agents on an excursion where they are; those whose excursion ends get a goal.
    fn follow_excursions(&mut self, context: &StepContext) {
        if !context.bridges {
            return;
        }
        let s = self.env.spec().state_dim();
        for i in 0..self.agents.len() {
            let was_on = self.excursions.is_on(i);
            self.excursions.arrive(i, &self.env.states()[i * s..(i + 1) * s]);
            if was_on && !self.excursions.is_on(i) {
                self.choose_goal(i, context);
            }
        }
    }

    /// Chooses actions: the actor's with noise, or a random direction held for several steps.
    fn choose_actions(&mut self, context: &StepContext) {
        let StepContext { acting, settings, policy, graph, .. } = *context;
        let a = self.env.spec().action_dim;
        self.actions.resize(self.agents.len() * a, 0.0);
        if acting == Acting::Policy {
            self.goals.clear();
            self.goals.extend(self.agents.iter().flat_map(|agent| agent.goal.iter().copied()));
            policy.actions(self.env.states(), &self.goals, &mut self.actions, &mut self.scratch);
            if let Some(graph) = graph {
                let walks_ahead = |(plan, agent): (&Option<Plan>, &Agent)| {
                    agent.held.is_none()
                        && plan.as_ref().is_some_and(|plan| plan.walker.looks_ahead(graph))
                };
                let ahead: Vec<bool> =
                    self.plans.iter().zip(&self.agents).map(walks_ahead).collect();
                let states = self.env.states();
                let (goals, actions) = (&self.goals, &mut self.actions);
                look_ahead(policy, &ahead, states, goals, actions, &mut self.scratch);
            }
        }
        // With a mean hold of h steps, a fraction r of all steps is random if each free step begins
        // a hold with probability r / (r + (1 - r) h).
        let (share, hold) = match acting {
            Acting::AtRandom => (1.0, settings.train.random_hold_steps),
            Acting::Policy => (settings.train.random_actions, settings.train.random_hold_steps),
        };
        let begin = if share > 0.0 { share / (share + (1.0 - share) * hold) } else { 0.0 };
        let rng = &mut self.rng;
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
                    *v = (*v + settings.train.exploration_noise * noise).clamp(-1.0, 1.0);
                }
            }
        }
    }

    /// Returns everything that the next steps depend on, for a checkpoint.
    pub fn state(&self) -> RolloutState {
        let plans = self.plans.iter().map(|plan| {
            plan.as_ref().map(|Plan { walker, goal, disturbed }| PlanState {
                walker: walker.state(),
                goal: goal.clone(),
                disturbed: *disturbed,
            })
        });
        RolloutState {
            agents: self.agents.clone(),
            plans: plans.collect(),
            states: (0..self.agents.len()).flat_map(|i| self.env.full_state(i)).collect(),
            rng: self.rng.clone(),
        }
    }

    /// Returns the same as [`Self::state`] without plans: agents pursue the plans' goals directly.
    pub fn state_without_plans(&self) -> RolloutState {
        let mut state = self.state();
        for (agent, plan) in state.agents.iter_mut().zip(&mut state.plans) {
            if let Some(PlanState { goal, .. }) = plan.take() {
                agent.goal = goal;
            }
        }
        state
    }

    /// Restores the state that [`Self::state`] returned. In a world that cannot set full states,
    /// the agents begin new episodes, and those in `replay` and `candidates` end where they were.
    ///
    /// # Errors
    /// The state does not match the number of agents or the environment.
    pub fn restore(
        &mut self,
        state: RolloutState,
        graph: Option<&BridgeGraph>,
        replay: &mut Replay,
        candidates: &mut Candidates,
    ) -> Result<(), StoreError> {
        let (size, g) = (self.env.full_state(0).len(), self.env.spec().goal_dim());
        let a = self.env.spec().action_dim;
        let within = |numbers: &[f32]| numbers.iter().all(|v| v.abs() <= MAX_MAGNITUDE);
        let sound = |numbers: &[f32], length: usize| numbers.len() == length && within(numbers);
        let agents = state.agents.iter().all(|agent| {
            sound(&agent.goal, g)
                && agent.after_bridge.as_ref().is_none_or(|goal| sound(goal, g))
                && agent.held.as_ref().is_none_or(|(action, steps)| sound(action, a) && *steps > 0)
        });
        let plans = state.plans.iter().flatten().all(|plan| sound(&plan.goal, g));
        let states = state.states.len() == self.agents.len() * size
            && state.states.iter().all(|v| v.is_finite());
        if state.agents.len() != self.agents.len() || !states || !agents || !plans {
            return Err(StoreError::inconsistent("the stored agents do not fit these settings"));
        }
        if state.plans.len() != self.agents.len() {
            return Err(StoreError::inconsistent("the stored plans do not fit the agents"));
        }
        let plans = state.plans.into_iter().map(|plan| {
            let Some(PlanState { walker, goal, disturbed }) = plan else { return Ok(None) };
            let graph = graph
                .ok_or_else(|| StoreError::inconsistent("a stored plan has no bridge graph"))?;
            Ok(Some(Plan { walker: Walker::from_state(graph, walker)?, goal, disturbed }))
        });
        self.plans = plans.collect::<Result<_, StoreError>>()?;
        self.agents = state.agents;
        self.rng = state.rng;
        for (i, full_state) in state.states.chunks_exact(size).enumerate() {
            if !self.env.set_full_state(i, full_state) {
                // Then it is the state itself.
                let state: Vec<f32> = full_state.iter().map(|v| *v as f32).collect();
                if self.agents[i].steps > 0 {
                    replay.end_episode(i, &state);
                }
                candidates.visit(i, &state);
                candidates.end_episode(i);
                self.env.restart(i, &mut self.rng);
                self.begin_episode(i);
            }
        }
        Ok(())
    }
}
