//! The exploring agents: their goals, exploration and stored experience.

use std::sync::Arc;
use std::time::Duration;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::TrainError;
use super::leaps::Leaps;
use super::settings::{RANDOM_HOLD_STEPS, Settings};
use crate::bridge::{
    BridgeGraph, Candidates, EXPLORED_SHARE, Excursions, FRONTIER_SHARE, Guide, Hop, SEARCH_BUDGET,
    SEEK_SHARE, SearchOutcome, SearchSpace, Walker, search,
};
use crate::env::{EnvError, EnvSettings, Environment, Goals, MAX_MAGNITUDE, Restart};
use crate::learn::{Acting, Replay, Scratch, phase_time};
use crate::store::{Store, StoreError};

type Result<T, E = EnvError> = std::result::Result<T, E>;

/// An agent gives up on a goal after this multiple of D to it, plus [`GIVE_UP_SLACK_STEPS`].
const GIVE_UP_FACTOR: f32 = 3.0;

/// Steps that an agent has for a goal beside the multiple of D.
const GIVE_UP_SLACK_STEPS: f32 = 50.0;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Agent {
    pub goal: Vec<f32>,
    /// Goal to pursue after `goal`, which is a bridge point while this is set.
    pub after_bridge: Option<Vec<f32>>,
    pub steps: u32,
    held: Option<(Vec<f32>, u32)>,
    give_up_at: u32,
}

#[derive(Serialize, Deserialize)]
struct AgentPlan {
    walker: Walker,
    goal: Vec<f32>,
    /// Whether the agent has acted at random since setting out for the waypoint: being late then
    /// says nothing about the edge.
    disturbed: bool,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Round {
    pub before: Vec<f32>,
    pub actions: Vec<f32>,
    /// Whether the world computes it elsewhere, or when it is asked for the outcome.
    elsewhere: bool,
    /// Set once the agents are where it leads: whose episodes the world has ended.
    ended: Option<Vec<bool>>,
}

pub struct StepContext<'a> {
    /// Whether episodes use bridge points and plans.
    pub bridges: bool,
    pub acting: Acting,
    pub episode_steps: u32,
    pub settings: &'a Settings,
    pub guide: Guide<'a>,
    pub replay: &'a mut Replay,
    pub candidates: &'a mut Candidates,
    /// What the round of steps has led to.
    pub result: RoundResult,
}

pub struct Rollout {
    pub(super) env: Box<dyn Environment>,
    agents: Vec<Agent>,
    plans: Vec<Option<AgentPlan>>,
    rng: ChaCha8Rng,
    actions: Vec<f32>,
    goals: Vec<f32>,
    pub(super) round: Option<Round>,
    /// A world with one agent, for the walks to near goals.
    aside: Option<Box<dyn Environment>>,
    scratch: Scratch,
    pub(super) excursions: Excursions,
    pub(super) leaps: Leaps,
    pub(super) last_search: Option<Arc<SearchOutcome>>,
    /// Time spent on plans that is in no profile yet.
    pub(super) planning: Duration,
}

#[derive(Clone, Copy, Debug, Default)]
pub struct RoundResult {
    pub episodes: u64,
    pub reached: u64,
}

impl Rollout {
    pub fn new(mut env: Box<dyn Environment>, mut rng: ChaCha8Rng) -> Result<Self> {
        let goal_dim = env.spec().goal_dim();
        let agents = (0..env.agents()).map(|i| {
            env.restart(i, &mut rng)?;
            let mut goal = vec![0.0; goal_dim];
            env.sample_goal(i, &mut rng, &mut goal);
            // Without a policy, the distance is unknown: the first step chooses another goal.
            Ok(Agent { goal, after_bridge: None, steps: 0, held: None, give_up_at: 0 })
        });
        let agents = agents.collect::<Result<Vec<_>>>()?;
        Ok(Self {
            excursions: Excursions::new(env.spec(), agents.len()),
            plans: agents.iter().map(|_| None).collect(),
            env,
            agents,
            rng,
            actions: Vec::new(),
            goals: Vec::new(),
            round: None,
            aside: None,
            scratch: Scratch::default(),
            leaps: Leaps::default(),
            last_search: None,
            planning: Duration::ZERO,
        })
    }

    pub fn env(&self) -> &dyn Environment {
        &*self.env
    }

    pub fn agents(&self) -> &[Agent] {
        &self.agents
    }

    pub fn excursions(&self) -> &Excursions {
        &self.excursions
    }

    /// Chooses an action for every agent and begins a round of steps, which [`Self::finish`] ends.
    /// Returns whether the world computes it elsewhere, or `None` without a step if the actor's
    /// actions are not finite.
    pub fn begin(&mut self, context: &mut StepContext) -> Result<Option<bool>> {
        // In this order, a plan that begins as an excursion ends has a waypoint at once.
        self.follow_excursions(context)?;
        self.follow_plans(context);
        self.choose_actions(context);
        if !self.actions.iter().all(|a| a.is_finite()) {
            return Ok(None);
        }
        let elsewhere = self.env.begin_step(&self.actions, &mut self.rng)?;
        let (before, actions) = (self.env.states().to_vec(), std::mem::take(&mut self.actions));
        self.round = Some(Round { before, actions, elsewhere, ended: None });
        Ok(Some(elsewhere))
    }

    /// Chooses actions: the actor's with noise, a random direction held for several steps, or those
    /// of an excursion.
    fn choose_actions(&mut self, context: &StepContext) {
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
        let settings = &context.settings.train;
        // With a mean hold of h steps, a fraction r of all steps is random if each free step begins
        // a hold with probability r / (r + (1 - r) h).
        let share = match context.acting {
            Acting::AtRandom => 1.0,
            Acting::Policy => settings.random_actions,
        };
        let hold = RANDOM_HOLD_STEPS;
        let begin = if share > 0.0 { share / (share + (1.0 - share) * hold) } else { 0.0 };
        let (a, rng) = (self.env.spec().action_dim, &mut self.rng);
        for (i, (agent, action)) in
            self.agents.iter_mut().zip(self.actions.chunks_exact_mut(a)).enumerate()
        {
            let (spec, policy) = (self.env.spec(), context.guide.policy);
            let state = self.env.state(i);
            let scratch = &mut self.scratch;
            if self.excursions.act(i, (spec, state), action, policy, rng, scratch) {
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

    /// Waits for the round of steps begun, if there is one.
    /// Where the world fails, the round is as if it had not begun.
    pub fn wait(&mut self) -> Result<()> {
        let begun = self.round.take_if(|round| round.ended.is_none());
        let Some(mut round) = begun else { return Ok(()) };
        if round.elsewhere {
            self.env.end_step()?;
        } else {
            self.env.step(&round.actions, &mut self.rng)?;
        }
        round.ended = Some((0..self.agents.len()).map(|i| self.env.has_ended(i)).collect());
        self.round = Some(round);
        Ok(())
    }

    /// Ends the round of steps begun, and stores its transitions in replay buffer and candidates.
    /// Where the world fails, what is stored holds no transition that has not happened, and the run
    /// can be saved; agents that could not restart are at the ends of their episodes.
    pub fn finish(&mut self, context: &mut StepContext) -> Result<RoundResult> {
        self.wait()?;
        let Some(Round { before, actions, ended: Some(ended), .. }) = self.round.take() else {
            return Ok(context.result);
        };
        let (s, a) = (self.env.spec().state_dim(), self.env.spec().action_dim);
        self.excursions.count_steps();
        let (spec, steps) =
            (self.env.spec(), before.chunks_exact(s).zip(self.env.states().chunks_exact(s)));
        for (i, (agent, (state, next))) in self.agents.iter().zip(steps).enumerate() {
            let action = &actions[i * a..(i + 1) * a];
            context.candidates.visit(i, state, next);
            self.leaps.note(spec, state, next);
            self.excursions.note(i, spec, [state, next], action);
            if self.leaps.is_sure(spec, state, next) {
                context.replay.push(i, state, action, &agent.goal);
            } else {
                context.replay.end_episode(i, state);
                context.candidates.end_episode(i);
            }
        }
        // The others' steps are kept even if one agent's next episode cannot begin.
        let mut went_on = Ok(());
        for (i, has_ended) in ended.into_iter().enumerate() {
            self.agents[i].steps = self.agents[i].steps.saturating_add(1);
            let own = if self.agents[i].steps >= context.episode_steps || has_ended {
                self.end_episode(i, context)
            } else if self.excursions.is_on(i) {
                Ok(())
            } else {
                self.end_pursuit(i, context)
            };
            went_on = went_on.and(own);
        }
        went_on.map(|()| context.result)
    }

    fn end_episode(&mut self, i: usize, context: &mut StepContext) -> Result<()> {
        let state = self.env.state(i);
        context.replay.end_episode(i, state);
        // An agent that stays continues its trajectory.
        if !self.stays(i, context) {
            context.candidates.visit(i, state, state);
            context.candidates.end_episode(i);
        }
        context.result.episodes += 1;
        self.start_episode(i, context)
    }

    fn end_pursuit(&mut self, i: usize, context: &mut StepContext) -> Result<()> {
        let agent = &mut self.agents[i];
        let pursued = self.plans[i].as_ref().map_or(&agent.goal, |plan| &plan.goal);
        let reached = self.env.spec().reached(self.env.state(i), pursued);
        if reached && let Some(goal) = agent.after_bridge.take() {
            agent.goal = goal;
            self.plans[i] = None;
            self.set_deadline(i, context);
        } else if context.settings.train.new_goal_when_reached
            && (reached || agent.steps >= agent.give_up_at)
        {
            context.result.reached += u64::from(reached);
            // There is no other goal.
            if context.settings.train.goals == Goals::Map {
                return self.end_episode(i, context);
            }
            self.choose_goal(i, context)?;
        }
        Ok(())
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

    /// Moves all agents at their current states to another environment of the same kind, ending
    /// their episodes and starting new ones.
    pub fn enter_environment(
        &mut self,
        env: Box<dyn Environment>,
        replay: &mut Replay,
    ) -> Result<()> {
        self.end_episodes(replay);
        let before = std::mem::replace(&mut self.env, env);
        self.aside = None;
        let is_back = self.put_back((0..self.agents.len()).map(|i| before.full_state(i)))?;
        for i in 0..self.agents.len() {
            if !is_back {
                self.env.restart(i, &mut self.rng)?;
            }
            self.begin_episode(i);
        }
        self.excursions.forget_outcomes();
        Ok(())
    }

    pub fn end_episodes(&self, replay: &mut Replay) {
        // A round whose outcome is not stored does not count.
        let states = self.round.as_ref().map_or(self.env.states(), |round| &round.before);
        let states = states.chunks_exact(self.env.spec().state_dim());
        for (i, (state, agent)) in states.zip(&self.agents).enumerate() {
            if agent.steps > 0 {
                replay.end_episode(i, state);
            }
        }
    }

    pub fn replan(&mut self, context: &StepContext) {
        for i in 0..self.plans.len() {
            if let Some(plan) = self.plans[i].take() {
                self.agents[i].goal = plan.goal;
                self.plan(i, context);
            }
        }
    }

    fn follow_plans(&mut self, context: &mut StepContext) {
        let guide = context.guide;
        let Some(graph) = guide.graph else { return };
        let began = phase_time();
        for (i, plan) in self.plans.iter_mut().enumerate() {
            let Some(plan) = plan else { continue };
            let (state, before) = (self.env.state(i), plan.walker.target());
            let aim = guide.aim(Some(&mut plan.walker), state, &plan.goal, &mut self.scratch);
            self.agents[i].goal.copy_from_slice(aim);
            if let Some(Hop { from, to, distance, arrived }) = plan.walker.finished_hop()
                && (arrived || !plan.disturbed)
            {
                let id = |candidate| graph.candidates().id(candidate);
                context.candidates.record_walk(id(from), id(to), distance, arrived);
            }
            if plan.walker.finished_hop().is_some() || plan.walker.target() != before {
                plan.disturbed = false;
            }
            plan.disturbed |= self.agents[i].held.is_some();
        }
        self.planning += phase_time().saturating_sub(began);
    }

    fn follow_excursions(&mut self, context: &StepContext) -> Result<()> {
        if !context.bridges {
            return Ok(());
        }
        for i in 0..self.agents.len() {
            let was_on = self.excursions.is_on(i);
            self.excursions.arrive(i, self.env.state(i));
            if was_on && !self.excursions.is_on(i) {
                self.choose_goal(i, context)?;
            }
        }
        Ok(())
    }

    pub fn save(&self, store: &mut Store) -> Result<(), StoreError> {
        let states: Vec<f64> =
            (0..self.agents.len()).flat_map(|i| self.env.full_state(i)).collect();
        store.put("agents", &self.agents)?;
        store.put("agents.plans", &self.plans)?;
        store.put("agents.states", &states)?;
        store.put("agents.rng", &self.rng)?;
        store.put("agents.leaps", &self.leaps)?;
        store.put("agents.round", &self.round.as_ref().filter(|round| round.ended.is_some()))?;
        store.put("agents.excursions", &self.excursions)
    }

    /// Restores what [`Self::save`] saved. In a world that cannot set full states, or failed before
    /// they were saved, the agents begin new episodes, and those in `replay` and `candidates` end
    /// where they were.
    pub fn load(
        &mut self,
        store: &Store,
        graph: Option<&BridgeGraph>,
        replay: &mut Replay,
        candidates: &mut Candidates,
    ) -> Result<(), TrainError> {
        let (spec, count) = (self.env.spec(), self.agents.len());
        let (s, g, a) = (spec.state_dim(), spec.goal_dim(), spec.action_dim);
        self.excursions.restore(spec, store.get("agents.excursions")?)?;
        self.agents = store.get("agents")?;
        self.plans = store.get("agents.plans")?;
        self.leaps = store.get("agents.leaps")?;
        self.round = store.get("agents.round")?;
        let states: Vec<f64> = store.get("agents.states")?;
        let size = states.len() / count.max(1);
        // Only the states of a world that failed.
        let takes_size = size == s || self.env.takes_full_state(size);
        let within = |numbers: &[f32]| numbers.iter().all(|v| v.abs() <= MAX_MAGNITUDE);
        let sound = |numbers: &[f32], length: usize| numbers.len() == length && within(numbers);
        let agents = self.agents.iter().all(|agent| {
            sound(&agent.goal, g)
                && agent.after_bridge.as_ref().is_none_or(|goal| sound(goal, g))
                && agent.held.as_ref().is_none_or(|(action, steps)| sound(action, a) && *steps > 0)
        });
        let round = self.round.as_ref().is_none_or(|round| {
            sound(&round.before, count * s)
                && sound(&round.actions, count * a)
                && round.ended.as_ref().is_some_and(|ended| ended.len() == count)
        });
        let fits = [self.agents.len(), self.plans.len()] == [count; 2]
            && takes_size
            && states.len() == count * size
            && states.iter().all(|v| v.is_finite())
            && agents
            && self.plans.iter().flatten().all(|plan| sound(&plan.goal, g))
            && round
            && self.leaps.fit(spec);
        StoreError::unless(fits, "the stored agents do not fit these settings")?;
        for plan in self.plans.iter_mut().flatten() {
            let graph = graph
                .ok_or_else(|| StoreError::inconsistent("a stored plan has no bridge graph"))?;
            plan.walker.restore(graph)?;
        }
        self.rng = store.get("agents.rng")?;
        if self.put_back(states.chunks_exact(size))? {
            return Ok(());
        }
        self.round = None;
        for (i, full_state) in states.chunks_exact(size).enumerate() {
            // Then the full state begins with the state.
            let state: Vec<f32> = full_state[..s].iter().map(|v| *v as f32).collect();
            if self.agents[i].steps > 0 {
                replay.end_episode(i, &state);
            }
            candidates.visit(i, &state, &state);
            candidates.end_episode(i);
            self.env.restart(i, &mut self.rng)?;
            self.begin_episode(i);
        }
        Ok(())
    }

    /// Puts the agents back into their full states; returns whether that could be done. Otherwise all
    /// have to begin episodes: what has failed may have been the process of several.
    fn put_back(&mut self, full_states: impl Iterator<Item = impl AsRef<[f64]>>) -> Result<bool> {
        for (i, full_state) in full_states.enumerate() {
            if !self.env.set_full_state(i, full_state.as_ref())? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn stays(&self, i: usize, context: &StepContext) -> bool {
        if self.env.has_ended(i) {
            return false;
        }
        match context.settings.train.restart {
            Restart::Never => true,
            Restart::Auto if context.settings.train.goals == Goals::Map => false,
            Restart::Auto => {
                self.env.abilities().episodes.is_some_and(|episodes| episodes.stays(i))
            }
            Restart::Anywhere | Restart::StartCell => false,
        }
    }

    /// Starts an episode with a new start and goal. With probability `bridge_epsilon`, a bridge
    /// point is the first goal (Algorithm 1).
    fn start_episode(&mut self, i: usize, context: &StepContext) -> Result<()> {
        let restarted =
            if self.stays(i, context) { Ok(()) } else { self.env.restart(i, &mut self.rng) };
        // Even without a start, the episode that has ended in the replay is over.
        self.begin_episode(i);
        restarted?;
        self.choose_goal(i, context)?;
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
        Ok(())
    }

    /// Gives agent `i` a random goal. With given probabilities, it first goes on an excursion
    /// beyond the frontier, or follows a plan through the bridge graph.
    fn choose_goal(&mut self, i: usize, context: &StepContext) -> Result<()> {
        let agent = &mut self.agents[i];
        agent.after_bridge = None;
        self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
        self.plans[i] = None;
        if self.chance(context.settings.train.near_goals) {
            self.choose_near_goal(i, context.settings.train.near_goal_steps)?;
        }
        if context.bridges {
            let bridge = &context.settings.bridge;
            let share = match (self.excursions.goal_rests(), self.excursions.places.has_frontier())
            {
                (true, _) => SEEK_SHARE,
                (false, true) => FRONTIER_SHARE,
                (false, false) => EXPLORED_SHARE,
            };
            if self.excursions.are_due(bridge.frontier_epsilon.given().unwrap_or(share)) {
                self.excursions.set_out(i);
            } else if self.chance(bridge.planned_episodes) {
                self.plan(i, context);
            }
        }
        self.set_deadline(i, context);
        Ok(())
    }

    /// Makes the goal of agent `i` the place where a straight walk of at most `longest` steps from
    /// its own place ends, if the world can put another agent there.
    fn choose_near_goal(&mut self, i: usize, longest: u32) -> Result<()> {
        let aside = match &mut self.aside {
            Some(world) => world,
            none => {
                let mut world = self.env.fork(1)?;
                // The walk is straight even where actions are noisy.
                world.configure(&EnvSettings::default());
                none.insert(world)
            }
        };
        let from = self.env.full_state(i);
        if let Some(goal) = aside.near_goal(&from, longest, &mut self.rng)? {
            self.agents[i].goal = goal;
        }
        Ok(())
    }

    fn chance(&mut self, probability: f32) -> bool {
        probability > 0.0 && self.rng.random::<f32>() < probability
    }

    fn set_deadline(&mut self, i: usize, context: &StepContext) {
        let agent = &mut self.agents[i];
        let state = self.env.state(i);
        let distance = context.guide.policy.distance(state, &agent.goal, &mut self.scratch);
        let steps = GIVE_UP_FACTOR * distance + GIVE_UP_SLACK_STEPS;
        agent.give_up_at = agent.steps.saturating_add(steps as u32);
    }

    fn search_bridge(&mut self, i: usize, context: &StepContext) -> Option<Vec<f32>> {
        let (candidates, goal) = (&*context.candidates, &self.agents[i].goal);
        let outcome = search(
            self.env.state(i),
            goal,
            SearchSpace { states: candidates.states(), goals: candidates.points() },
            SEARCH_BUDGET,
            context.guide.policy,
            &mut self.rng,
            &mut self.scratch,
        );
        let found = outcome.found.as_ref().map(|bridge| bridge.point.clone());
        self.last_search = Some(Arc::new(outcome));
        found
    }

    fn plan(&mut self, i: usize, context: &StepContext) {
        let (goal, began) = (&self.agents[i].goal, phase_time());
        if let Some(walker) = context.guide.plan(goal, &mut self.scratch) {
            self.plans[i] = Some(AgentPlan { walker, goal: goal.clone(), disturbed: false });
        }
        self.planning += phase_time().saturating_sub(began);
    }

    fn begin_episode(&mut self, i: usize) {
        let agent = &mut self.agents[i];
        (agent.steps, agent.held, agent.after_bridge, agent.give_up_at) = (0, None, None, 0);
        self.plans[i] = None;
        self.excursions.end(i);
        self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
    }
}
