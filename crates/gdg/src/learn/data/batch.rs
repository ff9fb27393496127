//! Training batches drawn from the replay: pairs, their goals, and bounds on their distances.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::env::Spec;
use crate::learn::data::known::{KnownDistances, KnownPair, Relearning};
use crate::learn::data::replay::{Replay, StoredStep};
use crate::learn::networks::returns::Returns;
use crate::learn::settings::LearnSettings;

/// Mean of the steps that geometric hindsight goals lie ahead.
const GEOMETRIC_MEAN_STEPS: f32 = 25.0;

/// The noise on the actions of targets is clipped at this many standard deviations (Fujimoto et al.
/// 2018, section 5.3).
const MAX_NOISE_DEVIATIONS: f32 = 2.5;

/// Minimum n-step horizon of targets while all distances are in doubt: each update raises them by
/// at most this much.
pub(crate) const RELEARN_N_STEP: usize = 20;

/// Share of the dynamics model's transitions that are recent while distances are relearned.
pub(crate) const RELEARN_RECENT: f32 = 0.5;

/// Lower bound on a distance that the bridge graph knows, as a multiple of the graph's distance.
pub(crate) const GRAPH_LOWER_FACTOR: f32 = 0.6;

/// Steps that are subtracted from this bound: while few paths are known, those through the graph
/// make long detours between near places.
pub(crate) const GRAPH_LOWER_SLACK_STEPS: f32 = 6.0;

/// Bound of the actor's outputs before tanh where its action makes less progress than
/// [`STUCK_PROGRESS_STEPS`], while distances are relearned: a saturated actor has hardly any
/// gradient with which to turn round.
pub(crate) const STUCK_BOUND: f32 = 1.0;

/// Least progress of an action, in steps: D(s, g) - D(f(s, a), g) is 1 for a step on the shortest
/// path.
pub(crate) const STUCK_PROGRESS_STEPS: f32 = 0.2;

/// While distances are relearned, a lower bound raises a target to at most this multiple of what it
/// would be without.
pub(crate) const RAISE_FACTOR: f32 = 2.0;

/// Steps by which it may exceed that multiple. The way round a new wall can be many times as long
/// as the one through it: the error of such a pair would outweigh all others in the batch, and
/// raise D of pairs with the same offset that are far away from the wall.
pub(crate) const RAISE_STEPS: f32 = 4.0;

/// Where something has to be touched first, targets are at most this many times the environment's time
/// limit: D of what is out of reach grows without end, and with it that of all else.
const MOST_TIME_LIMITS: f32 = 2.0;

/// Where something has to be touched first, this share of the pairs without a goal in hindsight keeps the
/// goal pursued: many are out of reach, such as one on the table for an object on the floor.
const OTHER_GOALS: f32 = 0.4;

/// Most pairs drawn in place of one in which what is achieved does not move.
const MOST_REDRAWS: usize = 16;

/// Training data of one update.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// States s of the pairs, `(batch, state_dim)`.
    pub states: Vec<f32>,
    /// Goals g of the pairs, `(batch, goal_dim)`.
    pub goals: Vec<f32>,
    /// What the actor is to approach on its way to g, `(batch, goal_dim)`: a waypoint if one is
    /// known, otherwise g.
    pub actor_goals: Vec<f32>,
    /// 1 where the actor learns from the pair; 0 where g is far and the path through the graph
    /// begins or ends too far away to lead it, `(batch)`.
    pub actor_weights: Vec<f32>,
    /// The states from which targets bootstrap, `(batch, state_dim)`.
    pub bootstrap_states: Vec<f32>,
    /// Steps from s to the state ahead, or to the goal, `(batch)`.
    pub steps: Vec<f32>,
    /// 1 where the target adds D'(ahead, g), 0 where the goal was reached, `(batch)`.
    pub bootstrap: Vec<f32>,
    /// Upper bound of the target, `(batch)`; infinite if unknown.
    pub bound: Vec<f32>,
    /// Lower bound of the target, no higher than the upper one, `(batch)`; 0 if unknown.
    pub lower: Vec<f32>,
    /// Whether targets are capped at the actor's one-step lookahead (see
    /// [`LearnSettings::greedy_targets`]).
    pub greedy_targets: bool,
    /// Whether distances are relearned: lower bounds raise targets little by little, and the actor
    /// is pulled out of saturation where its action makes no progress.
    pub relearns: bool,
    /// States of the dynamics model's transitions, `(batch, state_dim)`.
    pub from: Vec<f32>,
    /// Actions of these transitions, `(batch, action_dim)`.
    pub actions: Vec<f32>,
    /// Next states of these transitions, `(batch, state_dim)`.
    pub next: Vec<f32>,
    /// Of learners with rewards: the reward of each pair's step, `(batch)`.
    pub rewards: Vec<f32>,
    /// Of learners with rewards: noise on the actions of targets, `(batch, action_dim)`; empty for
    /// none.
    pub noise: Vec<f32>,
}

impl Batch {
    pub(in crate::learn) fn len(&self) -> usize {
        self.steps.len()
    }

    /// Replaces pair `i` with one that is `steps` apart along the bridge graph (distillation).
    ///
    /// A path through the graph exists, so its length is an upper bound. A part of it is a lower
    /// bound `at_least`, which raises D where it is far too short. In between, the actor's one-step
    /// lookahead decides: if D followed the graph, it would inherit the graph's detours, and so would
    /// the next graph, whose edges are as long as D says.
    pub fn set_graph_distance(
        &mut self,
        i: usize,
        state: &[f32],
        [goal, waypoint]: [&[f32]; 2],
        [at_least, steps]: [f32; 2],
    ) {
        self.begin_at(i, state, steps);
        self.goals[i * goal.len()..(i + 1) * goal.len()].copy_from_slice(goal);
        self.actor_goals[i * goal.len()..(i + 1) * goal.len()].copy_from_slice(waypoint);
        self.lower[i] = at_least;
    }

    /// Moves the start of pair `i` to another state, at most `bound` steps from its goal. The
    /// trajectory says nothing about it, so the actor's one-step lookahead decides.
    fn begin_at(&mut self, i: usize, state: &[f32], bound: f32) {
        for states in [&mut self.states, &mut self.bootstrap_states] {
            states[i * state.len()..(i + 1) * state.len()].copy_from_slice(state);
        }
        self.steps[i] = 0.0;
        self.bootstrap[i] = 1.0;
        self.bound[i] = bound;
        self.lower[i] = 0.0;
    }

    fn clear(&mut self) {
        for numbers in [
            &mut self.states,
            &mut self.goals,
            &mut self.actor_goals,
            &mut self.actor_weights,
            &mut self.bootstrap_states,
            &mut self.steps,
            &mut self.bootstrap,
            &mut self.bound,
            &mut self.lower,
            &mut self.from,
            &mut self.actions,
            &mut self.next,
            &mut self.rewards,
            &mut self.noise,
        ] {
            numbers.clear();
        }
    }
}

/// Draws batches according to the settings.
#[derive(Clone, Debug)]
pub struct BatchSampler {
    pub spec: Spec,
    pub settings: LearnSettings,
    /// Of a learner with rewards.
    pub returns: Option<Returns>,
}

impl BatchSampler {
    /// Refills `batch`. While relearning, the dynamics model sees more of the recent transitions;
    /// if there is no graph that finds the distances that have changed, targets follow the
    /// behaviour alone, over many steps. Learners with rewards learn from single steps, and whether
    /// the task is over follows from the goal that was chosen; the end of an episode's time does not
    /// end it.
    pub fn sample(
        &self,
        replay: &Replay,
        relearning: Option<Relearning>,
        rng: &mut ChaCha8Rng,
        batch: &mut Batch,
    ) {
        batch.clear();
        let doubt_all = relearning.is_some_and(|r| !r.graph_finds_changed);
        batch.greedy_targets = self.settings.greedy_targets && !doubt_all;
        batch.relearns = relearning.is_some();
        let n_step =
            if doubt_all { RELEARN_N_STEP.max(self.settings.n_step) } else { self.settings.n_step };
        let has_more_than_goals = self.spec.state_dim() > self.spec.goal_dim();
        let recent_rows = (RELEARN_RECENT * self.settings.batch_size as f32) as usize;
        for row in 0..self.settings.batch_size {
            let (mut moment, mut left) = replay.sample(rng);
            let mut bound = self.push_goal(replay, moment, left, rng, &mut batch.goals);
            // Where what is achieved seldom moves, most hindsight goals are achieved already and teach
            // nothing: another pair.
            let mut redraws = if has_more_than_goals { MOST_REDRAWS } else { 0 };
            while redraws > 0 && bound.is_finite() {
                let goal = batch.goals.len() - self.spec.goal_dim();
                if self.spec.is_away(replay.state(moment), batch.goals[goal..].iter().copied()) {
                    break;
                }
                batch.goals.truncate(goal);
                (moment, left) = replay.sample(rng);
                bound = self.push_hindsight_goal(replay, moment, left, rng, &mut batch.goals);
                redraws -= 1;
            }
            let ahead = if bound.is_finite() { bound as usize } else { 0 };
            let state = replay.state(moment);
            let goal = &batch.goals[batch.goals.len() - self.spec.goal_dim()..];
            let (steps, reached) = match &self.returns {
                None => self.look_ahead(replay, moment, n_step.min(left), goal),
                Some(returns) => {
                    let next = replay.state(later(moment, 1));
                    batch.rewards.push(returns.reward(&self.spec, next, goal));
                    (1, self.spec.reached(next, goal))
                }
            };
            batch.states.extend(state);
            batch.bootstrap_states.extend(replay.state(later(moment, steps)));
            batch.steps.push(steps as f32);
            batch.bootstrap.push(if reached { 0.0 } else { 1.0 });
            let bound = if self.settings.hindsight_bound { bound } else { f32::INFINITY };
            batch.bound.push(bound.min(self.max_distance()));
            batch.lower.push(0.0);
            // In place of every second step that moves nothing, the model sees the last one before the
            // goal that does.
            let moves = |moment: &StoredStep| {
                self.spec.goal_moves(replay.state(*moment), replay.state(later(*moment, 1)))
            };
            if has_more_than_goals && row % 2 == 0 && !moves(&moment) {
                let last = (0..ahead).rev().map(|k| later(moment, k)).find(moves);
                moment = last.unwrap_or(moment);
            }
            let recent = relearning.filter(|_| row < recent_rows);
            let moment =
                recent.and_then(|r| replay.sample_recent(r.recent_slots, rng)).unwrap_or(moment);
            batch.from.extend(replay.state(moment));
            batch.actions.extend(replay.action(moment));
            batch.next.extend(replay.state(later(moment, 1)));
            let deviation = self.settings.target_noise;
            if self.returns.is_some() && deviation > 0.0 {
                batch.noise.extend((0..self.spec.action_dim).map(|_| {
                    let noise: f32 = StandardNormal.sample(rng);
                    deviation * noise.clamp(-MAX_NOISE_DEVIATIONS, MAX_NOISE_DEVIATIONS)
                }));
            }
        }
        batch.actor_goals.extend(&batch.goals);
        batch.actor_weights.resize(batch.len(), 1.0);
    }

    /// Returns the number of pairs of places whose distance is known in a batch (distillation), and
    /// the number of those to be chosen where D falls short.
    pub(in crate::learn) fn known_rows(&self, batch: &Batch) -> (usize, usize) {
        let count = (self.settings.distillation * batch.len() as f32).round();
        (count as usize, (self.settings.short_pairs * count).round() as usize)
    }

    /// Whether waypoints lead the actor: not where places differ in more than the goal, such as a key,
    /// which a waypoint leaves out.
    pub(in crate::learn) fn leads(&self, known: &KnownDistances) -> bool {
        self.settings.actor_waypoints && !known.goals.differ_in_more()
    }

    /// Returns the number of pairs, the last ones, from which the actor's walks are imagined: none
    /// where lookahead does not decide.
    pub(in crate::learn) fn walk_rows(&self, batch: &Batch) -> usize {
        let count = (self.settings.imagined_walks * batch.len() as f32).round() as usize;
        let others = batch.len() - self.known_rows(batch).0;
        if batch.greedy_targets { count.min(others) } else { 0 }
    }

    /// Moves the start of pair `i` of `batch` to a state where the actor gets stuck.
    pub(in crate::learn) fn begin_at(&self, batch: &mut Batch, i: usize, state: &[f32]) {
        batch.begin_at(i, state, self.max_distance());
    }

    /// Replaces a share of the pairs, the first ones, with pairs of places whose distance is known
    /// (distillation), and bounds the targets of distances that have changed. The last of them are
    /// `short`, pairs where D falls short of what is known. Returns the number of pairs replaced.
    pub fn add_known(
        &self,
        known: &KnownDistances,
        short: &[KnownPair],
        rng: &mut ChaCha8Rng,
        batch: &mut Batch,
    ) -> usize {
        let (s, g) = (self.spec.state_dim(), self.spec.goal_dim());
        let state_of = |place: usize| &known.states[place * s..(place + 1) * s];
        let (count, _) = self.known_rows(batch);
        for i in 0..count {
            let KnownPair { from, to, steps, waypoint } = match (i + short.len()).checked_sub(count)
            {
                Some(k) => short[k],
                None => known.by_goal.any_pair(rng),
            };
            let towards = if self.leads(known) { waypoint } else { to };
            let goals = [to, towards].map(|place| known.goals.goal(place as usize));
            let part = (GRAPH_LOWER_FACTOR * steps - GRAPH_LOWER_SLACK_STEPS).max(0.0);
            let at_least = if known.by_goal.walks_arrive { part } else { 0.0 };
            batch.set_graph_distance(i, state_of(from as usize), goals, [at_least, steps]);
            for limit in [&mut batch.bound[i], &mut batch.lower[i]] {
                *limit = limit.min(self.max_distance());
            }
        }
        let Some(changed) = known.changed else { return count };
        let by_goal = known.by_goal;
        for i in 0..batch.len() {
            let state = known.goals.place_of(&batch.states[i * s..(i + 1) * s]);
            let goal = &batch.goals[i * g..(i + 1) * g];
            let (from, at) = (known.goals.nearest(&state), known.goals.nearest(goal));
            if let (Some((from, off_start)), Some((at, off_goal))) = (from, at) {
                // The triangle inequality, with straight lines for the short distances to the
                // nearest places, and the path from there to a place whose changes are known: the
                // nearest one in a straight line may lie behind a wall.
                let to = by_goal.nearest_checked[at] as usize;
                let on = by_goal.steps[to * known.goals.len() + at];
                let (pair, off) = (to * known.goals.len() + from, off_start + off_goal);
                // How far it is back from there, an upper bound would have to know.
                if by_goal.places[to] as usize == at {
                    batch.bound[i] = batch.bound[i].min(changed.upper[pair] + off);
                }
                let lower = changed.lower[pair] - off - on;
                batch.lower[i] = batch.lower[i].max(lower).min(batch.bound[i]);
            }
        }
        count
    }

    /// Returns the upper bound of all targets, in steps; infinite if there is none.
    fn max_distance(&self) -> f32 {
        let given = Some(self.settings.max_distance_steps).filter(|most| *most > 0.0);
        let limit = self.spec.time_limit.filter(|_| !self.spec.contacts.is_empty());
        let most = limit.map(|steps| MOST_TIME_LIMITS * steps as f32);
        given.into_iter().chain(most).fold(f32::INFINITY, f32::min)
    }

    /// Chooses a goal for `moment`, which `left` steps of the episode follow, and appends it to
    /// `goals`; returns the number of steps in which it was reached, infinite if unknown.
    fn push_goal(
        &self,
        replay: &Replay,
        moment: StoredStep,
        left: usize,
        rng: &mut ChaCha8Rng,
        goals: &mut Vec<f32>,
    ) -> f32 {
        let LearnSettings { goal_hindsight: mut hindsight, goal_random: mut random, .. } =
            self.settings;
        if self.returns.is_none() && !self.spec.contacts.is_empty() {
            (hindsight, random) = (1.0 - OTHER_GOALS * (1.0 - hindsight), 0.0);
        }
        let kind: f32 = rng.random();
        if kind < hindsight {
            return self.push_hindsight_goal(replay, moment, left, rng, goals);
        }
        if kind < hindsight + random {
            goals.extend(self.spec.achieved(replay.state(replay.sample_any(rng))));
        } else {
            goals.extend(replay.goal(moment));
        }
        f32::INFINITY
    }

    /// Appends what is achieved later in the episode to `goals`; returns after how many steps.
    fn push_hindsight_goal(
        &self,
        replay: &Replay,
        moment: StoredStep,
        left: usize,
        rng: &mut ChaCha8Rng,
        goals: &mut Vec<f32>,
    ) -> f32 {
        let ahead = self.hindsight_steps(left, rng);
        goals.extend(self.spec.achieved(replay.state(later(moment, ahead))));
        ahead as f32
    }

    /// Draws how many steps ahead a hindsight goal lies, from 1 to `left`.
    fn hindsight_steps(&self, left: usize, rng: &mut ChaCha8Rng) -> usize {
        let geometric = rng.random::<f32>() < self.settings.goal_geometric;
        if geometric {
            let (u, mean) = (1.0 - rng.random::<f32>(), GEOMETRIC_MEAN_STEPS);
            (1 + (u.ln() / (1.0 - 1.0 / mean).ln()) as usize).min(left)
        } else {
            rng.random_range(1..=left)
        }
    }

    /// Returns the number of steps from `moment` to the state ahead, at most `last`, and whether
    /// the goal is reached there: the n-step return is truncated at the goal and at the end of the
    /// episode. d = 0 if the state is already at the goal (Algorithm 1).
    fn look_ahead(
        &self,
        replay: &Replay,
        moment: StoredStep,
        last: usize,
        goal: &[f32],
    ) -> (usize, bool) {
        let reached = (0..=last).find(|k| self.spec.reached(replay.state(later(moment, *k)), goal));
        reached.map_or((last, false), |steps| (steps, true))
    }
}

/// Returns the moment `steps` later in the same agent's slots.
fn later(moment: StoredStep, steps: usize) -> StoredStep {
    StoredStep { slot: moment.slot + steps as u64, ..moment }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::env::Contact;
    use crate::env::tests::positions;
    use crate::learn::ReplaySizes;
    use crate::learn::data::known::tests::{by_goal, index};
    use crate::learn::data::known::{ChangedDistances, DistancesByGoal};
    use crate::learn::networks::returns::Reward;

    /// Positions on a line, and a replay of one walk along it.
    fn line() -> (Spec, Replay) {
        let spec = positions(&[(50.0, 50.0)]);
        let mut replay = Replay::new(ReplaySizes::all(1), 1, 200);
        (0..100).for_each(|i| replay.push(0, &[i as f32], &[1.0], &[99.0]));
        replay.end_episode(0, &[100.0]);
        (spec, replay)
    }

    #[test]
    fn graph_distances_bound_targets_and_changed_distances_raise_them() {
        let (spec, replay) = line();
        let settings =
            LearnSettings { batch_size: 64, distillation: 0.25, ..LearnSettings::default() };
        let sampler =
            BatchSampler { spec: spec.clone(), settings: settings.clone(), returns: None };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut batch, mut bounded) = (Batch::default(), sampler.clone());
        sampler.sample(&replay, None, &mut rng, &mut batch);
        assert!(batch.greedy_targets && !batch.relearns);
        assert!(batch.lower.iter().all(|steps| *steps == 0.0));
        assert!(batch.bound.iter().any(|bound| *bound > 20.0));
        let set = LearnSettings { max_distance_steps: 20.0, ..settings.clone() };
        let contacts = vec![Contact { other: 0, goal: 0, slope: 1.0, offset: 0.0, width: 1.0 }];
        let limited = Spec { time_limit: Some(10), contacts, ..spec.clone() };
        for (spec, settings) in [(limited, settings), (spec, set)] {
            bounded = BatchSampler { spec, settings, returns: None };
            bounded.sample(&replay, None, &mut rng.clone(), &mut batch);
            assert!(batch.bound.iter().all(|bound| *bound <= 20.0));
        }
        check_known(&sampler, &bounded, &mut rng, &mut batch);
    }

    /// A hand goes back and forth; only in one step of fifty, it takes what is to be moved along.
    #[test]
    fn where_the_goal_seldom_moves_batches_show_pairs_and_steps_in_which_it_does() {
        let spec = Spec { achieved: vec![1], ..positions(&[(0.0, 10.0), (50.0, 50.0)]) };
        let sizes = ReplaySizes::of(&spec);
        let mut replay = Replay::new(sizes, 1, 1001);
        let state = |i: u16| [f32::from(i % 2), f32::from(i / 50) * 3.0];
        (0..1000).for_each(|i| replay.push(0, &state(i), &[1.0, 0.0], &[60.0]));
        replay.end_episode(0, &state(1000));
        let settings =
            LearnSettings { batch_size: 256, goal_geometric: 1.0, ..LearnSettings::default() };
        let sampler = BatchSampler { spec: spec.clone(), settings, returns: None };
        let mut batch = Batch::default();
        sampler.sample(&replay, None, &mut ChaCha8Rng::seed_from_u64(1), &mut batch);
        let pairs = batch.states.chunks_exact(2).zip(&batch.goals);
        let reached = pairs.filter(|(state, goal)| state[1] == **goal).count();
        assert!(reached < 13, "{reached} of 256 goals are reached at once");
        let steps = batch.from.chunks_exact(2).zip(batch.next.chunks_exact(2));
        let moved = steps.filter(|(from, next)| from[1] != next[1]).count();
        assert!(moved > 50, "the goal moves in {moved} of 256 steps");
    }

    /// Adds known distances to a batch of pairs on the line, with and without a limit.
    fn check_known(
        sampler: &BatchSampler,
        bounded: &BatchSampler,
        rng: &mut ChaCha8Rng,
        batch: &mut Batch,
    ) {
        // Places at both ends; from the first to the second it is much farther than D says.
        let pair = |from, to, steps| KnownPair { from, to, steps, waypoint: to };
        let states = [10.0, 90.0];
        let places = index(&states);
        let checked = |goals: &[u32], steps: &[f32]| DistancesByGoal {
            checked: 1,
            nearest_checked: vec![0, 0],
            hop_steps: 1.0,
            ..by_goal(
                &states,
                goals,
                steps,
                &goals.iter().flat_map(|goal| [*goal; 2]).collect::<Vec<_>>(),
            )
        };
        let both_ways = checked(&[1, 0], &[201.0, 0.0, 0.0, 81.0]);
        // Only distances to the second place are known; from the first one it is a long way round.
        let there = checked(&[1], &[120.0, 0.0]);
        let changed = ChangedDistances {
            goals: vec![1],
            lower: vec![150.0, 0.0],
            upper: vec![f32::MAX, 7.0],
        };
        let known =
            KnownDistances { states: &states, goals: &places, by_goal: &both_ways, changed: None };
        sampler.add_known(&known, &[], rng, batch);
        for i in 0..16 {
            let (upper, lower) =
                if batch.states[i] == 10.0 { (200.0, 114.0) } else { (80.0, 42.0) };
            assert_eq!(batch.bound[i], upper);
            assert!((batch.lower[i] - lower).abs() < 1e-3, "{}", batch.lower[i]);
            assert_eq!((batch.steps[i], batch.bootstrap[i]), (0.0, 1.0), "lookahead decides");
        }
        assert!(batch.lower[16..].iter().all(|steps| *steps == 0.0), "others stay");
        let astray = DistancesByGoal { walks_arrive: false, ..both_ways.clone() };
        sampler.add_known(&KnownDistances { by_goal: &astray, ..known }, &[], rng, batch);
        assert!(batch.lower.iter().all(|steps| *steps == 0.0), "paths may be far too long");
        assert!(batch.bound[..16].iter().all(|steps| [80.0, 200.0].contains(steps)));
        let short = [pair(1, 0, 30.0), pair(0, 1, 20.0)];
        sampler.add_known(&known, &short, rng, batch);
        assert_eq!(batch.bound[14..16], [30.0, 20.0]);
        assert_eq!((batch.states[14], batch.goals[14]), (90.0, 10.0));
        bounded.add_known(&known, &[], rng, batch);
        assert!(batch.bound.iter().chain(&batch.lower).all(|steps| *steps <= 20.0));
        sampler.add_known(&known, &[], rng, batch);
        let known = KnownDistances { changed: Some(&changed), by_goal: &there, ..known };
        let before = batch.bound.clone();
        sampler.add_known(&known, &[], rng, batch);
        for (i, before) in before.into_iter().enumerate().skip(16) {
            let (state, goal) = (batch.states[i], batch.goals[i]);
            let off = if state < 50.0 { (state - 10.0).abs() } else { (state - 90.0).abs() }
                + if goal < 50.0 { (goal - 10.0).abs() + 120.0 } else { (goal - 90.0).abs() };
            let lower = if state < 50.0 { 150.0 - off } else { 0.0 };
            let lower = lower.max(0.0).min(batch.bound[i]);
            assert!((batch.lower[i] - lower).abs() < 1e-3, "{state} to {goal}");
            let bounded = batch.bound[i] <= 7.0 + off + 1e-3;
            assert!(bounded || state < 50.0 || goal < 50.0, "{state} to {goal}");
            assert!(goal > 50.0 || batch.bound[i] == before, "the way back is unknown");
        }
    }

    #[test]
    fn relearning_looks_at_recent_transitions_and_doubts_all_distances_only_without_a_graph() {
        let (spec, replay) = line();
        let settings = LearnSettings { batch_size: 64, ..LearnSettings::default() };
        let sampler = BatchSampler { spec, settings, returns: None };
        let mut batch = Batch::default();
        let mut relearn = |graph_finds_changed| {
            let relearning = Some(Relearning { recent_slots: 11, graph_finds_changed });
            sampler.sample(&replay, relearning, &mut ChaCha8Rng::seed_from_u64(1), &mut batch);
            let recent = batch.from[..32].iter().filter(|state| **state >= 90.0).count();
            assert!(recent >= 30, "{recent} recent transitions");
            assert!(batch.relearns);
            batch.greedy_targets
        };
        assert!(relearn(true));
        assert!(!relearn(false));
    }

    /// Draws transitions of a learner with rewards from two walks of ten steps towards 30.
    fn rewarded(reward: Reward, settings: LearnSettings) -> Batch {
        let spec = Spec { goal_radius: 1.5, ..positions(&[(50.0, 50.0)]) };
        let mut replay = Replay::new(ReplaySizes::all(1), 1, 200);
        for start in [0.0, 20.0] {
            (0..10).for_each(|i| replay.push(0, &[start + i as f32], &[1.0], &[30.0]));
            replay.end_episode(0, &[start + 10.0]);
        }
        let returns = Some(Returns::new(reward, 0.99, &spec));
        let (sampler, mut batch) = (BatchSampler { spec, settings, returns }, Batch::default());
        sampler.sample(&replay, None, &mut ChaCha8Rng::seed_from_u64(1), &mut batch);
        batch
    }

    #[test]
    fn goals_that_are_relabelled_lie_in_the_future_and_relabel_reward_and_end() {
        let of = |goal_hindsight| LearnSettings {
            batch_size: 2_000,
            goal_hindsight,
            goal_geometric: 0.0,
            goal_random: 0.0,
            ..LearnSettings::default()
        };
        let batch = rewarded(Reward::Sparse, of(0.8));
        let (mut relabelled, mut ends) = (0, 0);
        for i in 0..batch.len() {
            let (state, next, goal) = (batch.states[i], batch.bootstrap_states[i], batch.goals[i]);
            assert_eq!(next, state + 1.0);
            let same_walk = (state < 15.0) == (goal < 15.0);
            let later = (1.0..=10.0).contains(&(goal - state)) && same_walk;
            assert!(goal == 30.0 || later, "{state} to {goal}");
            assert_eq!(batch.bootstrap[i] == 0.0, (next - goal).abs() < 1.5, "{state} to {goal}");
            assert_eq!(batch.rewards[i], -1.0);
            relabelled += usize::from(goal < 30.0);
            ends += usize::from(batch.bootstrap[i] == 0.0 && goal < 30.0);
        }
        // Some of those relabelled get 30, where the second walk ends: H(10) / 10 of its moments.
        assert!((1_280..1_450).contains(&relabelled), "{relabelled}");
        assert!(ends > 300 && batch.noise.is_empty(), "{ends}");
        let batch = rewarded(Reward::Distance, of(0.0));
        for (i, next) in batch.next.iter().enumerate() {
            assert_eq!((batch.goals[i], batch.rewards[i]), (30.0, -(30.0 - next).abs()));
            // The first walk ends far from the goal: time was up.
            assert_eq!(batch.bootstrap[i] == 0.0, *next >= 29.0, "{next}");
        }
        assert!(batch.next.contains(&10.0));
        let noisy = LearnSettings { target_noise: 0.2, batch_size: 4_000, ..of(0.8) };
        let noise = rewarded(Reward::Sparse, noisy).noise;
        let deviation = (noise.iter().map(|noise| noise * noise).sum::<f32>() / 4_000.0).sqrt();
        assert!((deviation - 0.195).abs() < 0.01, "{deviation}");
        let largest = noise.iter().fold(0.0, |most: f32, noise| most.max(noise.abs()));
        assert!((0.48..=0.5).contains(&largest), "{largest}");
    }
}
