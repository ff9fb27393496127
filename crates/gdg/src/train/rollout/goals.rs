//! Episodes and goals: where agents begin, what they are asked to reach, and when they give up.

use std::sync::Arc;

use rand::RngExt;

use super::{Plan, Rollout, StepContext};
use crate::bridge::{
    EXPLORED_SHARE, Excursion, FRONTIER_SHARE, SEARCH_BUDGET, SearchSpace, search,
};
use crate::env::{EnvError, EnvSettings, Goals, Restart};

/// An agent gives up on a goal after this multiple of D to it ...
const GIVE_UP_FACTOR: f32 = 3.0;

/// ... plus this many steps.
const GIVE_UP_SLACK_STEPS: f32 = 50.0;

impl Rollout {
    /// Whether agent `i` begins its next episode where it is.
    pub(super) fn stays(&self, i: usize, context: &StepContext) -> bool {
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
    pub(super) fn start_episode(
        &mut self,
        i: usize,
        context: &StepContext,
    ) -> Result<(), EnvError> {
        let restarted =
            if self.stays(i, context) { Ok(()) } else { self.env.restart(i, &mut self.rng) };
        // Even without a start, the episode that has ended in the replay is over.
        self.begin_episode(i);
        restarted?;
        self.choose_goal(i, context)?;
        if context.bridges
            && self.chance(context.settings.bridge.bridge_epsilon)
            && self.excursions.under_way[i].is_none()
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
    pub(super) fn choose_goal(&mut self, i: usize, context: &StepContext) -> Result<(), EnvError> {
        let agent = &mut self.agents[i];
        agent.after_bridge = None;
        self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
        self.plans[i] = None;
        if self.chance(context.settings.train.near_goals) {
            self.choose_near_goal(i, context.settings.train.near_goal_steps)?;
        }
        if context.bridges {
            let bridge = &context.settings.bridge;
            let has_frontier = self.excursions.places.has_frontier();
            let share = if has_frontier { FRONTIER_SHARE } else { EXPLORED_SHARE };
            if self.excursions.are_due(bridge.frontier_epsilon.given().unwrap_or(share)) {
                self.excursions.under_way[i] = Some(Excursion::default());
            } else if self.chance(bridge.planned_episodes) {
                self.plan(i, context);
            }
        }
        self.set_deadline(i, context);
        Ok(())
    }

    /// Makes the goal of agent `i` the place where a straight walk of at most `longest` steps from
    /// its own place ends, if the world can put another agent there.
    fn choose_near_goal(&mut self, i: usize, longest: u32) -> Result<(), EnvError> {
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

    pub(super) fn set_deadline(&mut self, i: usize, context: &StepContext) {
        let s = self.env.spec().state_dim();
        let agent = &mut self.agents[i];
        let state = &self.env.states()[i * s..(i + 1) * s];
        let distance = context.guide.policy.distance(state, &agent.goal, &mut self.scratch);
        let steps = GIVE_UP_FACTOR * distance + GIVE_UP_SLACK_STEPS;
        agent.give_up_at = agent.steps.saturating_add(steps as u32);
    }

    fn search_bridge(&mut self, i: usize, context: &StepContext) -> Option<Vec<f32>> {
        let s = self.env.spec().state_dim();
        let (candidates, goal) = (&*context.candidates, &self.agents[i].goal);
        let outcome = search(
            &self.env.states()[i * s..(i + 1) * s],
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

    pub(super) fn plan(&mut self, i: usize, context: &StepContext) {
        let goal = &self.agents[i].goal;
        if let Some(walker) = context.guide.plan(goal, &mut self.scratch) {
            self.plans[i] = Some(Plan { walker, goal: goal.clone(), disturbed: false });
        }
    }

    pub(super) fn begin_episode(&mut self, i: usize) {
        let agent = &mut self.agents[i];
        (agent.steps, agent.held, agent.after_bridge, agent.give_up_at) = (0, None, None, 0);
        self.plans[i] = None;
        self.excursions.under_way[i] = None;
        self.env.sample_goal(i, &mut self.rng, &mut agent.goal);
    }
}
