//! Walking to a goal through bridge points, the same in exploration, evaluation and display; and the
//! search for a single one, as published (Algorithm 2).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::candidates::{UNOBSERVED, WALKED_SLACK_STEPS};
use super::graph::{
    BridgeGraph, COST_UNITS_PER_STEP, FirstHop, HopOptions, LINK_CANDIDATES, OBSERVED_FACTOR,
    OBSERVED_PENALTY_STEPS, OBSERVED_SLACK_STEPS, REVERSED_PENALTY_STEPS, Route, UNVERIFIED_FACTOR,
};
use super::settings::{BAN_STEPS, BridgeSettings, LATE_FACTOR, LATE_SLACK_STEPS, late_after};
use crate::learn::{Policy, Scratch, look_ahead};
use crate::store::{StoreError, planes};

/// Number of consecutive late targets after which an agent counts as stuck.
pub(crate) const MAX_STRIKES: u32 = 2;

/// Most times that the ban of a target is doubled.
pub(crate) const MAX_DOUBLINGS: usize = 16;

/// Share of a typical step by which components of two states may differ that count as one.
pub(crate) const SAME_PLACE: f32 = 0.03;

/// Nearest candidates for which an agent that chooses a waypoint computes D.
pub(crate) const NEAREST_CANDIDATES: usize = 3;

/// Candidates with the shortest ways to the goal for which it computes D, too.
pub(crate) const PROMISING_CANDIDATES: usize = 8;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum WalkTarget {
    Goal,
    Candidate(usize),
}

/// One agent's walk to its goal: it commits to a waypoint until that is reached or late, then
/// chooses the next one.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Walker {
    route: Route,
    target: Option<WalkTarget>,
    clock: u32,
    /// D to the target when it was chosen.
    distance: f32,
    /// Step at which the target was chosen, or the actor and lookahead swapped.
    began: u32,
    /// Step at which the target becomes late.
    deadline: u32,
    /// Cost from the last waypoint reached to the goal. The next waypoint must be closer, or the
    /// walk could oscillate between two waypoints forever. Infinite at the start and after a late
    /// target.
    remaining: f32,
    strikes: u32,
    /// Whether the agent has gone in a circle, so that actor and lookahead have swapped.
    turned: bool,
    /// Where the agent was after 1, 2, 4, 8... steps towards the target, whichever was last.
    #[serde(with = "planes")]
    landmark: Vec<f32>,
    /// Late targets so far, and the step until which each was banned.
    banned: Vec<(WalkTarget, u32)>,
    /// The last candidate reached; `None` at the start and after a late target.
    at: Option<usize>,
    #[serde(skip)]
    hop: Option<Hop>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hop {
    pub from: usize,
    pub to: usize,
    /// D from where the agent was, near the former, to the latter.
    pub distance: f32,
    pub arrived: bool,
}

impl WalkTarget {
    fn candidate(self) -> Option<usize> {
        match self {
            Self::Goal => None,
            Self::Candidate(i) => Some(i),
        }
    }
}

impl Walker {
    pub fn new(route: Route) -> Self {
        Self {
            route,
            target: None,
            clock: 0,
            distance: 0.0,
            began: 0,
            deadline: 0,
            remaining: f32::INFINITY,
            strikes: 0,
            turned: false,
            landmark: Vec::new(),
            banned: Vec::new(),
            at: None,
            hop: None,
        }
    }

    /// Continues a walk of a checkpoint on `graph`: finds the paths to its goal again.
    pub fn restore(&mut self, graph: &BridgeGraph) -> Result<(), StoreError> {
        let Route { goal, nearest, links, has_unverified_links, .. } = &mut self.route;
        let mut candidates =
            links.iter().map(|(i, _)| *i as usize).chain(nearest.iter().copied()).chain(self.at);
        let mut targets = self.target.iter().chain(self.banned.iter().map(|(target, _)| target));
        let known = |i: usize| i < graph.candidates().len();
        let fits = candidates.all(known)
            && targets.all(|target| target.candidate().is_none_or(known))
            && goal.len() == graph.candidates.spec.goal_dim()
            && goal.iter().chain([&self.distance]).all(|v| v.is_finite())
            && !self.remaining.is_nan()
            && self.began <= self.clock
            && [0, graph.candidates.spec.state_dim()].contains(&self.landmark.len());
        StoreError::unless(fits, "a stored walk does not fit its bridge graph")?;
        let route = graph.route_from_links(goal, std::mem::take(nearest), std::mem::take(links));
        self.route = Route { has_unverified_links: *has_unverified_links, ..route };
        Ok(())
    }

    pub(crate) fn finished_hop(&self) -> Option<Hop> {
        self.hop
    }

    /// Whether the next action is chosen by one step of lookahead. After a late waypoint or a circle,
    /// the actor takes over, and so on in turns: lookahead exploits errors of the dynamics model, the
    /// actor gets stuck elsewhere.
    pub fn looks_ahead(&self, graph: &BridgeGraph) -> bool {
        graph.candidates.settings.lookahead && self.strikes.is_multiple_of(2) != self.turned
    }

    pub fn route(&self) -> &Route {
        &self.route
    }

    pub fn target(&self) -> Option<WalkTarget> {
        self.target
    }

    fn target_position<'a>(&'a self, graph: &'a BridgeGraph, target: WalkTarget) -> &'a [f32] {
        match target {
            WalkTarget::Goal => &self.route.goal,
            WalkTarget::Candidate(i) => graph.point(i),
        }
    }

    /// Advances the walk and returns the goal to give the actor in `state` for the next step,
    /// `(goal_dim)`.
    pub fn step<'a>(
        &'a mut self,
        state: &[f32],
        graph: &'a BridgeGraph,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> &'a [f32] {
        let settings = &graph.candidates.settings;
        let target = self.keep_target(state, graph);
        // An open loop continues its single plan from the waypoint reached.
        let on_plan = self.at.filter(|_| settings.open_loop);
        let planned = on_plan.map(|at| match self.route.next[at] as usize {
            last if last == at => WalkTarget::Goal,
            next => WalkTarget::Candidate(next),
        });
        let target = target.unwrap_or_else(|| {
            let (target, distance) = match planned {
                Some(target) => {
                    (target, policy.distance(state, self.target_position(graph, target), scratch))
                }
                None => self.choose_target(state, graph, policy, scratch),
            };
            self.distance = distance;
            self.set_out(false);
            self.deadline = self.clock + late_after(distance) as u32;
            target
        });
        self.target = Some(target);
        self.clock += 1;
        self.target_position(graph, target)
    }

    /// Records a hop that ends in `state`. Returns the current target, unless it has been reached
    /// or given up.
    fn keep_target(&mut self, state: &[f32], graph: &BridgeGraph) -> Option<WalkTarget> {
        self.hop = None;
        let (current, settings) = (self.target?, &graph.candidates.settings);
        let reached = graph.candidates.spec.reached(state, self.target_position(graph, current))
            && current.candidate().is_none_or(|i| graph.is_of_kind(i, state));
        let circles = settings.progress_check && self.goes_in_circles(state, graph);
        let late = settings.progress_check && self.clock >= self.deadline || circles && self.turned;
        if circles {
            self.set_out(true);
        }
        if let (Some(from), Some(to)) = (self.at, current.candidate())
            && (reached || late)
        {
            self.hop = Some(Hop { from, to, distance: self.distance, arrived: reached });
        }
        match current {
            WalkTarget::Candidate(i) if reached => {
                self.remaining = self.route.costs[i];
                self.strikes = 0;
                self.at = Some(i);
            }
            _ if late && !reached => {
                self.at = None;
                self.remaining = f32::INFINITY;
                self.strikes += 1;
                // Twice as long each time, so that agents try others.
                let times = self.banned.iter().filter(|(banned, _)| *banned == current).count();
                let ban = BAN_STEPS << times.min(MAX_DOUBLINGS);
                self.banned.push((current, self.clock.saturating_add(ban)));
            }
            _ => {}
        }
        (!late && !reached).then_some(current)
    }

    /// Begins to look for circles; `turned` is whether the agent has gone in one.
    fn set_out(&mut self, turned: bool) {
        (self.turned, self.began) = (turned, self.clock);
        self.landmark.clear();
    }

    /// Whether the agent is back where it was on its way to the target: it would do the same again.
    /// Landmarks at powers of two find circles of any length (Brent's algorithm).
    fn goes_in_circles(&mut self, state: &[f32], graph: &BridgeGraph) -> bool {
        let mut changes = state.iter().zip(&self.landmark).zip(&graph.candidates.spec.change_scale);
        let again = !self.landmark.is_empty()
            && changes.all(|((now, then), scale)| (now - then).abs() <= SAME_PLACE * scale);
        if (self.clock - self.began).is_power_of_two() {
            self.landmark = state.to_vec();
        }
        again
    }

    /// Returns the best next target and the steps to it by D.
    ///
    /// This is the nearby candidate w that minimises D(s,w) + cost(w,g), including expected delays,
    /// or the goal itself if D(s,g) is below the cut-off and no longer than the detour. If no
    /// verified link is usable, unverified ones are; if the graph has no path to the goal, so are
    /// unverified links at the goal. Failing that, the target is the goal itself, for at most the
    /// duration of one hop.
    fn choose_target(
        &mut self,
        state: &[f32],
        graph: &BridgeGraph,
        policy: &dyn Policy,
        scratch: &mut Scratch,
    ) -> (WalkTarget, f32) {
        let nearby = graph.nearby(state, LINK_CANDIDATES);
        let promising = self.promising(state, &nearby, graph);
        let narrowed = promising.len() < nearby.len();
        let mut ask = |walker: &Self, near: Vec<usize>| {
            graph.options(&[(state, near)], &walker.route, policy, scratch).swap_remove(0)
        };
        let mut options = ask(self, promising);
        let mut waypoint = self.best_waypoint(state, &options, graph, true);
        if waypoint.is_none() && narrowed {
            options = ask(self, nearby);
            waypoint = self.best_waypoint(state, &options, graph, true);
        }
        let unverified = |walker: &Self| walker.best_waypoint(state, &options, graph, false);
        waypoint = waypoint.or_else(|| unverified(self));
        if waypoint.is_none()
            && options.direct.is_none()
            && let Some(route) = graph.route_by_unverified_links(&self.route, policy, scratch)
        {
            self.route = route;
            waypoint =
                self.best_waypoint(state, &options, graph, true).or_else(|| unverified(self));
        }
        let direct = options.direct.filter(|_| self.is_allowed(WalkTarget::Goal));
        match (waypoint, direct) {
            (Some((hop, total)), direct) if direct.is_none_or(|direct| total < direct.cost) => {
                (WalkTarget::Candidate(hop.candidate), hop.distance)
            }
            (_, Some(_)) => (WalkTarget::Goal, options.to_goal),
            _ => {
                let most = graph.candidates.settings.window_steps() as f32;
                (WalkTarget::Goal, options.to_goal.min(most))
            }
        }
    }

    /// Returns those of the `nearby` candidates, nearest first, for which D is worth asking: the
    /// nearest ones, which tell where `state` is, and those with the shortest ways to the goal as
    /// far as trajectories show. All of them if edges need no trajectory, or if the agent is stuck.
    fn promising(&self, state: &[f32], nearby: &[usize], graph: &BridgeGraph) -> Vec<usize> {
        let Some(here) = nearby.first().filter(|_| graph.candidates.settings.verify_edges) else {
            return nearby.to_vec();
        };
        if self.strikes >= MAX_STRIKES {
            return nearby.to_vec();
        }
        let ahead = nearby.iter().filter(|i| self.may_head_for(state, **i, graph)).map(|i| {
            let steps = f32::from(graph.candidates().observed(*here, *i)) + self.route.costs[*i];
            // Costs are not negative, so they are in the same order as their bits.
            (steps.to_bits(), *i)
        });
        let mut ahead: Vec<(u32, usize)> = ahead.collect();
        ahead.sort_unstable();
        let best = |i: &usize| ahead.iter().take(PROMISING_CANDIDATES).any(|(_, own)| own == i);
        let own = nearby.iter().enumerate().filter(|(k, i)| *k < NEAREST_CANDIDATES || best(i));
        own.map(|(_, i)| *i).collect()
    }

    /// Whether the way over candidate `i` leads on towards the goal, and is not banned.
    fn may_head_for(&self, state: &[f32], i: usize, graph: &BridgeGraph) -> bool {
        self.route.costs[i] < self.remaining
            && self.is_allowed(WalkTarget::Candidate(i))
            && !(graph.candidates.spec.reached(state, graph.point(i)) && graph.is_of_kind(i, state))
    }

    /// Returns the best hop to a candidate, if any may be used, with the planning cost of the hop and
    /// the path from there to the goal; only `verified` ones, or any.
    fn best_waypoint<'a>(
        &self,
        state: &[f32],
        options: &'a HopOptions,
        graph: &BridgeGraph,
        verified: bool,
    ) -> Option<(&'a FirstHop, f32)> {
        let usable = options.candidates.iter().filter_map(|hop| {
            let cost = hop.link.map(|link| link.cost);
            let unverified = UNVERIFIED_FACTOR * hop.distance;
            let may_be_unverified = !verified && graph.is_of_kind(hop.candidate, state);
            let cost = cost.or(may_be_unverified.then_some(unverified))?;
            let total = cost + self.route.costs[hop.candidate];
            let usable = total.is_finite() && self.may_head_for(state, hop.candidate, graph);
            usable.then_some((hop, total))
        });
        // A stuck agent is where the actor makes no progress: take the shortest hop away from
        // there.
        let key = |(hop, total): &(&FirstHop, f32)| {
            if self.strikes >= MAX_STRIKES { hop.distance } else { *total }
        };
        usable.min_by(|a, b| key(a).total_cmp(&key(b)))
    }

    fn is_allowed(&self, target: WalkTarget) -> bool {
        self.banned.iter().all(|(banned, until)| *banned != target || *until <= self.clock)
    }

    /// Returns the waypoints still ahead, as candidates, in walking order.
    pub fn waypoints_ahead(&self) -> Vec<usize> {
        let Some(WalkTarget::Candidate(mut at)) = self.target else { return Vec::new() };
        let mut ahead = vec![at];
        while self.route.next[at] as usize != at && ahead.len() <= self.route.next.len() {
            at = self.route.next[at] as usize;
            ahead.push(at);
        }
        ahead
    }
}

/// What agents choose their actions by. In each step, an agent takes an [aim](Self::aim) and
/// [acts](Self::act) towards it.
#[derive(Clone, Copy)]
pub struct Guide<'a> {
    pub policy: &'a dyn Policy,
    /// The graph to plan on; without one, agents head straight for their goals.
    pub graph: Option<&'a BridgeGraph>,
}

impl<'a> Guide<'a> {
    /// Begins a walk to `goal` `(goal_dim)`; `None` without a graph.
    pub fn plan(&self, goal: &[f32], scratch: &mut Scratch) -> Option<Walker> {
        Some(Walker::new(self.graph?.route(goal, self.policy, scratch)))
    }

    /// Advances the walk of an agent in `state` `(state_dim)`; returns what to give the actor as
    /// goal: the next waypoint, or `goal` without a plan, `(goal_dim)`.
    pub fn aim<'b>(
        &self,
        walker: Option<&'b mut Walker>,
        state: &[f32],
        goal: &'b [f32],
        scratch: &mut Scratch,
    ) -> &'b [f32]
    where
        'a: 'b,
    {
        match (walker, self.graph) {
            (Some(walker), Some(graph)) => walker.step(state, graph, self.policy, scratch),
            _ => goal,
        }
    }

    /// Chooses the agents' `actions` `(agents, action_dim)` in `states` `(agents, state_dim)`
    /// towards `aims` `(agents, goal_dim)`: the actor's, or those of one step of lookahead where an
    /// agent's plan asks for it. `walkers` has the plan, if any, of each agent.
    pub fn act<'b>(
        &self,
        walkers: impl Iterator<Item = Option<&'b Walker>>,
        states: &[f32],
        aims: &[f32],
        actions: &mut [f32],
        scratch: &mut Scratch,
    ) {
        self.policy.actions(states, aims, actions, scratch);
        if let Some(graph) = self.graph {
            let looks_ahead =
                |walker: Option<&Walker>| walker.is_some_and(|w| w.looks_ahead(graph));
            let ahead: Vec<bool> = walkers.map(looks_ahead).collect();
            look_ahead(self.policy, &ahead, states, aims, actions, scratch);
        }
    }
}

impl BridgeGraph {
    /// Returns the settings and constants that a walk along this graph depends on, by name.
    pub fn rules(&self) -> Value {
        let BridgeSettings {
            verify_edges,
            keep_observed_edges,
            edge_cutoff_steps,
            open_loop,
            progress_check,
            lookahead,
            ..
        } = &self.candidates.settings;
        json!({
            "verify_edges": verify_edges,
            "keep_observed_edges": keep_observed_edges,
            "edge_cutoff_steps": edge_cutoff_steps,
            "hop_steps": self.hop_steps(),
            "open_loop": open_loop,
            "progress_check": progress_check,
            "late_factor": LATE_FACTOR,
            "late_slack_steps": LATE_SLACK_STEPS,
            "ban_steps": BAN_STEPS,
            "lookahead": lookahead,
            "same_place": SAME_PLACE,
            "change_scale": self.candidates.spec.change_scale,
            "walked_slack_steps": WALKED_SLACK_STEPS,
            "window_steps": self.candidates.settings.window_steps(),
            "unobserved": UNOBSERVED,
            "told_apart_by": self.candidates.others().iter().map(|axis| (axis.component, axis.width, axis.low)).collect::<Vec<_>>(),
            "link_candidates": LINK_CANDIDATES,
            "nearest_candidates": NEAREST_CANDIDATES,
            "promising_candidates": PROMISING_CANDIDATES,
            "max_strikes": MAX_STRIKES,
            "max_doublings": MAX_DOUBLINGS,
            "unverified_factor": UNVERIFIED_FACTOR,
            "observed_factor": OBSERVED_FACTOR,
            "observed_slack_steps": OBSERVED_SLACK_STEPS,
            "observed_penalty_steps": OBSERVED_PENALTY_STEPS,
            "reversed_penalty_steps": REVERSED_PENALTY_STEPS,
            "cost_units_per_step": COST_UNITS_PER_STEP,
        })
    }
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct SearchOutcome {
    /// The state s searched from, `(state_dim)`.
    pub state: Vec<f32>,
    /// The goal g searched for, `(goal_dim)`.
    pub goal: Vec<f32>,
    /// Candidates tried and rejected, in order, `(rejected, goal_dim)`.
    pub rejected: Vec<f32>,
    pub found: Option<BridgePoint>,
    pub budget: usize,
}

/// A bridge point b with D(s,b) + D(b,g) < D(s,g).
#[derive(Clone, Debug, PartialEq)]
pub struct BridgePoint {
    /// The candidate, `(goal_dim)`.
    pub point: Vec<f32>,
    /// D(s,g) - D(s,b) - D(b,g) in steps.
    pub gain: f32,
}

impl SearchOutcome {
    pub fn tried(&self) -> usize {
        self.rejected.len() / self.goal.len().max(1) + usize::from(self.found.is_some())
    }
}

#[derive(Clone, Copy, Debug)]
pub struct SearchSpace<'a> {
    /// The points as states, `(points, state_dim)`.
    pub states: &'a [f32],
    /// The same points as goals, `(points, goal_dim)`.
    pub goals: &'a [f32],
}

/// Draws points b from `space` until D(s,g) > D(s,b) + D(b,g) or `budget` have been tried.
pub fn search(
    state: &[f32],
    goal: &[f32],
    space: SearchSpace,
    budget: usize,
    policy: &dyn Policy,
    rng: &mut ChaCha8Rng,
    scratch: &mut Scratch,
) -> SearchOutcome {
    let (s, g) = (state.len(), goal.len());
    let mut outcome = SearchOutcome {
        state: state.to_vec(),
        goal: goal.to_vec(),
        budget,
        ..SearchOutcome::default()
    };
    let candidates = space.states.len() / s;
    if candidates == 0 {
        return outcome;
    }
    let drawn: Vec<usize> = (0..budget).map(|_| rng.random_range(0..candidates)).collect();
    // One batch for all candidates, judged in the order drawn: the same result as one by one, but
    // faster.
    let mut from: Vec<f32> = state.repeat(budget);
    from.extend(drawn.iter().flat_map(|i| &space.states[i * s..(i + 1) * s]));
    let mut to: Vec<f32> =
        drawn.iter().flat_map(|i| &space.goals[i * g..(i + 1) * g]).copied().collect();
    let tried = to.clone();
    to.extend(goal.repeat(budget));
    let mut distances = vec![0.0; 2 * budget];
    policy.distances(&from, &to, &mut distances, scratch);
    let direct = policy.distance(state, goal, scratch);
    let mut gains = distances[..budget]
        .iter()
        .zip(&distances[budget..])
        .map(|(to_b, from_b)| direct - to_b - from_b);
    let found = gains.by_ref().enumerate().find(|(_, gain)| *gain > 0.0);
    outcome.found =
        found.map(|(i, gain)| BridgePoint { point: tried[i * g..(i + 1) * g].to_vec(), gain });
    outcome.rejected = tried[..found.map_or(budget, |(i, _)| i) * g].to_vec();
    outcome
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bridge::candidates::Candidates;
    use crate::bridge::candidates::tests::{line, walked};

    /// D is the distance along both axes.
    struct BothAxes;

    impl Policy for BothAxes {
        fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
            let pairs = states.chunks_exact(2).zip(goals.chunks_exact(2));
            out.iter_mut()
                .zip(pairs)
                .for_each(|(d, (s, g))| *d = (s[0] - g[0]).abs() + (s[1] - g[1]).abs());
        }

        fn actions(&self, _: &[f32], _: &[f32], _: &mut [f32], _: &mut Scratch) {}
    }

    fn graph(candidates: &Candidates) -> BridgeGraph {
        BridgeGraph::build(&candidates.frozen(), &BothAxes, &mut Scratch::default())
    }

    #[test]
    fn a_plan_leads_close_to_a_goal_whose_nearest_candidate_no_path_leads_to() {
        let (.., mut candidates) = walked(200, 79.5);
        candidates.visit(0, &[84.0, 0.5], &[84.0, 0.5]);
        let (graph, mut scratch) = (graph(&candidates), Scratch::default());
        let route = graph.route(&[85.0, 0.5], &BothAxes, &mut scratch);
        assert!(route.costs[0].is_infinite(), "{:?}", route.costs);
        let (mut walker, mut at) = (Walker::new(route), 2.0);
        walker.step(&[at, 0.5], &graph, &BothAxes, &mut scratch);
        assert!(matches!(walker.target(), Some(WalkTarget::Candidate(_))));
        assert!(walker.route().costs[0].is_finite());
        let bytes = crate::store::to_bytes(&walker).expect("numbers");
        walker = postcard::from_bytes(&bytes).expect("its own bytes");
        walker.restore(&graph).expect("its own graph");
        for _ in 0..100 {
            let aim = walker.step(&[at, 0.5], &graph, &BothAxes, &mut scratch)[0];
            at += (aim - at).clamp(-1.0, 1.0);
        }
        assert_eq!(at, 85.0);
        let again = graph.route_by_unverified_links(walker.route(), &BothAxes, &mut scratch);
        assert!(again.is_none(), "once is enough");
    }

    #[test]
    fn a_far_goal_without_a_plan_is_pursued_no_longer_than_a_hop() {
        let (spec, settings) = line(200);
        let graph = graph(&Candidates::new(&spec, 1, &settings));
        let mut scratch = Scratch::default();
        let mut walker = Walker::new(graph.route(&[99.0, 0.5], &BothAxes, &mut scratch));
        let longest = late_after(settings.window_steps() as f32) as u32;
        for step in 0..=longest {
            assert_eq!(walker.strikes, 0);
            let state = [1.0 + 0.1 * step as f32, 0.5];
            assert_eq!(walker.step(&state, &graph, &BothAxes, &mut scratch)[0], 99.0);
        }
        walker.step(&[1.0, 0.5], &graph, &BothAxes, &mut scratch);
        assert_eq!(walker.strikes, 1);
    }

    #[test]
    fn an_agent_in_a_circle_acts_otherwise_and_gives_up_at_the_second_one() {
        let (.., candidates) = walked(200, 39.5);
        let (graph, mut scratch) = (graph(&candidates), Scratch::default());
        for circle in 1..=3 {
            let mut walker = Walker::new(graph.route(&[39.0, 0.5], &BothAxes, &mut scratch));
            let mut looked = Vec::new();
            for step in 0..12 {
                let at = 5.0 + 0.3 * (step % circle) as f32;
                walker.step(&[at, 0.5], &graph, &BothAxes, &mut scratch);
                if walker.strikes > 0 {
                    break;
                }
                looked.push(walker.looks_ahead(&graph));
            }
            assert_eq!(walker.strikes, 1, "{circle}");
            assert!(looked[0] && !looked[looked.len() - 1], "{circle}: {looked:?}");
            assert!(looked.len() < late_after(walker.distance) as usize, "{circle}: {looked:?}");
        }
    }

    #[test]
    fn bans_of_a_target_last_twice_as_long_each_time() {
        let (.., candidates) = walked(200, 39.5);
        let (graph, mut scratch) = (graph(&candidates), Scratch::default());
        let mut walker = Walker::new(graph.route(&[39.0, 0.5], &BothAxes, &mut scratch));
        for _ in 0..2_000 {
            walker.step(&[5.0, 0.5], &graph, &BothAxes, &mut scratch);
        }
        let bans = &walker.banned;
        let until = bans.iter().filter(|(target, _)| *target == bans[0].0).map(|(_, until)| until);
        let until: Vec<u32> = until.copied().collect();
        assert!(until.len() > 3, "{bans:?}");
        for three in until.windows(3) {
            assert!(three[2] - three[1] > 3 * (three[1] - three[0]) / 2, "{until:?}");
        }
        assert!(bans.iter().any(|(target, _)| *target != bans[0].0), "others are tried: {bans:?}");
    }
}
