//! The replay buffer: every agent's transitions, in order.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::env::{MAX_MAGNITUDE, Spec};
use crate::store::{StoreError, from_zigzag, planes, zigzag};

/// Draws of a recent moment before giving up.
const RECENT_DRAWS: usize = 8;

/// Transitions of many agents: one ring buffer per agent, with episodes one after the other.
///
/// A slot holds a state and the action taken in it towards a goal; the next slot holds the next
/// state. An episode's last state takes one more slot, without an action.
#[derive(Clone, Debug)]
pub struct Replay {
    sizes: ReplaySizes,
    agents: usize,
    /// Slots per agent.
    capacity: usize,
    /// Total number of slots written by each agent; slot number i is at `i % capacity`.
    written: Vec<u64>,
    /// Number of the first slot of each agent's current episode.
    episode: Vec<u64>,
    states: Vec<f32>,
    actions: Vec<f32>,
    goals: Vec<f32>,
    /// Steps from a slot to the end of its episode, for episodes that have ended.
    left: Vec<u16>,
}

/// Sizes of a state, a goal and an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ReplaySizes {
    pub state: usize,
    pub goal: usize,
    pub action: usize,
}

impl ReplaySizes {
    pub fn of(spec: &Spec) -> Self {
        Self { state: spec.state_dim(), goal: spec.goal_dim(), action: spec.action_dim }
    }

    /// Returns the memory in bytes of a replay buffer for this number of transitions.
    pub fn bytes(self, transitions: usize) -> u64 {
        let numbers = (self.state + self.goal + self.action) as u64;
        (4 * numbers + 2).saturating_mul(transitions as u64)
    }

    #[cfg(test)]
    pub fn all(size: usize) -> Self {
        Self { state: size, goal: size, action: size }
    }
}

/// A stored time step: an agent and the number of its slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoredStep {
    pub agent: usize,
    /// The number of its slot, counted from the start of training.
    pub slot: u64,
}

impl Replay {
    /// Creates a replay with room for about `capacity` transitions of `agents` agents.
    pub(crate) fn new(sizes: ReplaySizes, agents: usize, capacity: usize) -> Self {
        let capacity = capacity.div_ceil(agents).max(2);
        let slots = agents * capacity;
        Self {
            sizes,
            agents,
            capacity,
            written: vec![0; agents],
            episode: vec![0; agents],
            states: vec![0.0; slots * sizes.state],
            actions: vec![0.0; slots * sizes.action],
            goals: vec![0.0; slots * sizes.goal],
            left: vec![0; slots],
        }
    }

    /// Stores that `agent` took `action` in `state` while pursuing `goal`.
    pub(crate) fn push(&mut self, agent: usize, state: &[f32], action: &[f32], goal: &[f32]) {
        let at = self.slot_index(StoredStep { agent, slot: self.written[agent] });
        let ReplaySizes { state: s, goal: g, action: a } = self.sizes;
        self.states[at * s..(at + 1) * s].copy_from_slice(state);
        self.actions[at * a..(at + 1) * a].copy_from_slice(action);
        self.goals[at * g..(at + 1) * g].copy_from_slice(goal);
        self.written[agent] += 1;
    }

    pub(crate) fn end_episode(&mut self, agent: usize, state: &[f32]) {
        let (action, goal) = (vec![0.0; self.sizes.action], vec![0.0; self.sizes.goal]);
        self.push(agent, state, &action, &goal);
        let end = self.written[agent] - 1;
        let kept = self.oldest(agent).max(self.episode[agent]);
        for slot in kept..=end {
            let at = self.slot_index(StoredStep { agent, slot });
            self.left[at] = (end - slot).min(u64::from(u16::MAX)) as u16;
        }
        self.episode[agent] = end + 1;
    }

    fn oldest(&self, agent: usize) -> u64 {
        self.written[agent].saturating_sub(self.capacity as u64)
    }

    fn slot_index(&self, moment: StoredStep) -> usize {
        moment.agent * self.capacity + (moment.slot % self.capacity as u64) as usize
    }

    /// Removes transitions (state, action, next state) that are not `possible`, splitting their
    /// episodes there, and restores transitions removed earlier that are possible again; leaves
    /// those alone for which `possible` returns `None`. Every agent's episode must have ended.
    /// Returns the numbers of transitions removed and restored.
    pub(crate) fn retain_possible(
        &mut self,
        possible: impl Fn(&[f32], &[f32], &[f32]) -> Option<bool>,
    ) -> (usize, usize) {
        let (mut removed, mut restored) = (0, 0);
        for agent in 0..self.agents {
            let mut left_behind: u16 = 0;
            for slot in (self.oldest(agent)..self.written[agent]).rev() {
                let moment = StoredStep { agent, slot };
                let at = self.slot_index(moment);
                let before = self.left[at] > 0;
                // Only the last state of an episode has no action, or one of zeros.
                let moved =
                    slot + 1 < self.written[agent] && self.action(moment).iter().any(|a| *a != 0.0);
                let next = StoredStep { agent, slot: slot + 1 };
                let kept = (before || moved)
                    && possible(self.state(moment), self.action(moment), self.state(next))
                        .unwrap_or(before);
                removed += usize::from(before && !kept);
                restored += usize::from(!before && kept);
                self.left[at] = if kept { left_behind.saturating_add(1) } else { 0 };
                left_behind = self.left[at];
            }
        }
        (removed, restored)
    }

    /// Returns all stored slots, agent by agent and in order, each with the number of steps left in its
    /// episode: none in an agent's last.
    fn slots(&self) -> impl Iterator<Item = (StoredStep, usize)> {
        let moments = (0..self.agents).flat_map(|agent| {
            (self.oldest(agent)..self.written[agent]).map(move |slot| StoredStep { agent, slot })
        });
        moments.map(|moment| (moment, self.steps_left(moment)))
    }

    /// Visits all stored episodes, agent by agent: calls `visit(agent, Some(state))` for each
    /// state, and `visit(agent, None)` at the end of each episode.
    pub fn visit_episodes(&self, mut visit: impl FnMut(usize, Option<&[f32]>)) {
        let mut going = false;
        for (moment, left) in self.slots() {
            if going || left > 0 {
                visit(moment.agent, Some(self.state(moment)));
            }
            going = left > 0;
            if !going {
                visit(moment.agent, None);
            }
        }
    }

    /// Visits all complete transitions, episode by episode: calls `visit` with each state, the
    /// action taken in it, and whether it is its episode's last, whose action leads nowhere.
    pub fn visit_rows(&self, mut visit: impl FnMut(&[f32], &[f32], bool)) {
        let mut going = false;
        for (moment, left) in self.slots() {
            if going || left > 0 {
                visit(self.state(moment), self.action(moment), left == 0);
            }
            going = left > 0;
        }
    }

    /// Visits all transitions: calls `visit` with the states before and after each.
    pub fn visit_steps(&self, mut visit: impl FnMut(&[f32], &[f32])) {
        let mut from = None;
        for (moment, left) in self.slots() {
            from.into_iter().for_each(|from| visit(from, self.state(moment)));
            from = (left > 0).then(|| self.state(moment));
        }
    }

    /// Copies all complete episodes to `other`, each to the agent with the least data; if there is
    /// not enough room, each agent's oldest episodes are overwritten.
    pub(crate) fn copy_episodes_into(&self, other: &mut Self) {
        let mut to = None;
        for (moment, left) in self.slots() {
            let agent = match to {
                Some(agent) => agent,
                // A state without a successor is not a transition.
                None if left == 0 => continue,
                None => (0..other.agents).min_by_key(|i| other.written[*i]).unwrap_or(0),
            };
            if left > 0 {
                other.push(agent, self.state(moment), self.action(moment), self.goal(moment));
                to = Some(agent);
            } else {
                other.end_episode(agent, self.state(moment));
                to = None;
            }
        }
    }

    /// Returns the latest states of `agent`'s current episode, at most `count`, oldest first.
    pub(crate) fn latest_states(&self, agent: usize, count: usize) -> impl Iterator<Item = &[f32]> {
        let from = self.episode[agent]
            .max(self.written[agent].saturating_sub(count as u64))
            .max(self.oldest(agent));
        (from..self.written[agent]).map(move |slot| self.state(StoredStep { agent, slot }))
    }

    pub(crate) fn agents(&self) -> usize {
        self.agents
    }

    /// Returns the number of filled slots.
    #[allow(clippy::len_without_is_empty, reason = "nobody asks whether it is empty")]
    pub fn len(&self) -> usize {
        (0..self.agents).map(|agent| self.filled(agent)).sum()
    }

    pub(crate) fn capacity(&self) -> usize {
        self.agents * self.capacity
    }

    pub(crate) fn has_transitions(&self) -> bool {
        self.slots().any(|(_, left)| left > 0)
    }

    /// Returns the number of steps stored after `moment` in its episode.
    pub(crate) fn steps_left(&self, moment: StoredStep) -> usize {
        if moment.slot >= self.episode[moment.agent] {
            (self.written[moment.agent] - 1 - moment.slot) as usize
        } else {
            usize::from(self.left[self.slot_index(moment)])
        }
    }

    /// Draws a random moment followed by at least one stored step; returns it with the number of
    /// these steps.
    ///
    /// It loops forever if the replay holds no transition; that of an update holds one.
    pub fn sample(&self, rng: &mut ChaCha8Rng) -> (StoredStep, usize) {
        loop {
            let moment = self.sample_any(rng);
            let left = self.steps_left(moment);
            if left > 0 {
                return (moment, left);
            }
        }
    }

    /// Draws a random moment, followed by a stored step, among the latest `slots` of an agent;
    /// `None` if a few draws find no such step.
    pub(crate) fn sample_recent(&self, slots: u64, rng: &mut ChaCha8Rng) -> Option<StoredStep> {
        (0..RECENT_DRAWS).find_map(|_| {
            let agent = rng.random_range(0..self.agents);
            let to = self.written[agent];
            let from = self.oldest(agent).max(to.saturating_sub(slots));
            let moment = StoredStep {
                agent,
                slot: if from < to { rng.random_range(from..to) } else { return None },
            };
            (self.steps_left(moment) > 0).then_some(moment)
        })
    }

    /// Draws a random stored moment, ends of episodes included.
    pub(crate) fn sample_any(&self, rng: &mut ChaCha8Rng) -> StoredStep {
        loop {
            let agent = rng.random_range(0..self.agents);
            let (from, to) = (self.oldest(agent), self.written[agent]);
            if from < to {
                return StoredStep { agent, slot: rng.random_range(from..to) };
            }
        }
    }

    pub fn state(&self, moment: StoredStep) -> &[f32] {
        let at = self.slot_index(moment) * self.sizes.state;
        &self.states[at..at + self.sizes.state]
    }

    pub fn action(&self, moment: StoredStep) -> &[f32] {
        let at = self.slot_index(moment) * self.sizes.action;
        &self.actions[at..at + self.sizes.action]
    }

    pub fn goal(&self, moment: StoredStep) -> &[f32] {
        let at = self.slot_index(moment) * self.sizes.goal;
        &self.goals[at..at + self.sizes.goal]
    }

    /// Returns the number of slots of `agent` that have been filled: the first ones.
    fn filled(&self, agent: usize) -> usize {
        self.written[agent].min(self.capacity as u64) as usize
    }

    /// Returns the contents for a checkpoint, without slots that have not been filled.
    pub(crate) fn stored(&self) -> StoredReplay {
        let ReplaySizes { state: s, goal: g, action: a } = self.sizes;
        let filled = |numbers: &[f32], size: usize| {
            let own = (0..self.agents).flat_map(|agent| {
                let first = agent * self.capacity * size;
                &numbers[first..first + self.filled(agent) * size]
            });
            own.copied().collect::<Vec<f32>>()
        };
        let left = (0..self.agents).flat_map(|agent| {
            let first = agent * self.capacity;
            &self.left[first..first + self.filled(agent)]
        });
        let (states, actions) = (filled(&self.states, s), filled(&self.actions, a));
        let [with, without] =
            [true, false].map(|adds| steps(&states, s, adds.then_some((&actions[..], a))));
        let bits =
            |steps: &[f32]| steps.iter().map(|n| 32 - n.to_bits().leading_zeros()).sum::<u32>();
        let adds_actions = bits(&with) < bits(&without);
        StoredReplay {
            sizes: self.sizes,
            written: self.written.clone(),
            episode: self.episode.clone(),
            adds_actions,
            steps: if adds_actions { with } else { without },
            actions,
            goals: steps(&filled(&self.goals, g), g, None),
            left: left.copied().collect(),
        }
    }

    /// Returns whether all episodes end within the slots written.
    fn has_valid_ends(&self) -> bool {
        (0..self.agents).all(|agent| {
            let (written, episode) = (self.written[agent], self.episode[agent]);
            // Slots of an ongoing episode have no end yet.
            let is_valid = |slot: u64| {
                let left = self.left[self.slot_index(StoredStep { agent, slot })];
                slot >= episode || slot + u64::from(left) < episode
            };
            episode <= written && (self.oldest(agent)..written).all(is_valid)
        })
    }

    pub(crate) fn restore(&mut self, stored: StoredReplay) -> Result<(), StoreError> {
        let ReplaySizes { state: s, goal: g, action: a } = self.sizes;
        let misfit = || StoreError::inconsistent("the stored replay does not fit these settings");
        let StoredReplay { sizes, written, episode, adds_actions, steps, actions, goals, left } =
            stored;
        let agents = self.agents;
        if sizes != self.sizes || written.len() != agents || episode.len() != agents {
            return Err(misfit());
        }
        (self.written, self.episode) = (written, episode);
        let slots = self.len();
        let lengths = [steps.len(), actions.len(), goals.len(), left.len()];
        if lengths != [slots * s, slots * a, slots * g, slots] {
            return Err(misfit());
        }
        let states = numbers(&steps, s, adds_actions.then_some((&actions[..], a)));
        let goals = numbers(&goals, g, None);
        let within = |numbers: &[f32], most: f32| numbers.iter().all(|v| v.abs() <= most);
        let are_possible = within(&states, MAX_MAGNITUDE)
            && within(&goals, MAX_MAGNITUDE)
            && within(&actions, 1.0)
            && self.written.iter().all(|written| *written < 1 << 53);
        let mut from = 0;
        for agent in 0..agents {
            let (count, to) = (self.filled(agent), agent * self.capacity);
            for (own, stored, size) in [
                (&mut self.states, &states, s),
                (&mut self.actions, &actions, a),
                (&mut self.goals, &goals, g),
            ] {
                own[to * size..(to + count) * size]
                    .copy_from_slice(&stored[from * size..(from + count) * size]);
            }
            self.left[to..to + count].copy_from_slice(&left[from..from + count]);
            from += count;
        }
        if are_possible && self.has_valid_ends() {
            Ok(())
        } else {
            Err(StoreError::inconsistent("the stored replay contains values out of range"))
        }
    }
}

/// A replay in a checkpoint: the filled slots of one agent after the other.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct StoredReplay {
    sizes: ReplaySizes,
    written: Vec<u64>,
    episode: Vec<u64>,
    /// Whether `steps` are the states without the actions that led there, as in worlds where
    /// actions are displacements.
    adds_actions: bool,
    /// What the state before does not predict of each state, `(slots, state_dim)`.
    #[serde(with = "planes")]
    steps: Vec<f32>,
    /// `(slots, action_dim)`.
    #[serde(with = "planes")]
    actions: Vec<f32>,
    /// What the goal before does not predict of each goal, `(slots, goal_dim)`.
    #[serde(with = "planes")]
    goals: Vec<f32>,
    left: Vec<u16>,
}

/// Returns the prediction of number `i`: the same component of the row before, `size` numbers back,
/// plus that of its action.
fn predicted(numbers: &[f32], i: usize, size: usize, actions: Option<(&[f32], usize)>) -> u32 {
    let Some(before) = i.checked_sub(size) else { return 0 };
    let (row, component) = (before / size, before % size);
    let action = match actions {
        Some((actions, own)) if component < own => actions[row * own + component],
        _ => 0.0,
    };
    ordered(numbers[before] + action)
}

/// Returns what is left of rows of numbers after predicting them: exact, and mostly short.
fn steps(numbers: &[f32], size: usize, actions: Option<(&[f32], usize)>) -> Vec<f32> {
    let step = |(i, number): (usize, &f32)| {
        let difference = ordered(*number).wrapping_sub(predicted(numbers, i, size, actions));
        f32::from_bits(zigzag(difference))
    };
    numbers.iter().enumerate().map(step).collect()
}

/// Reverses [`steps`].
fn numbers(steps: &[f32], size: usize, actions: Option<(&[f32], usize)>) -> Vec<f32> {
    let mut numbers = Vec::with_capacity(steps.len());
    for (i, step) in steps.iter().enumerate() {
        let before = predicted(&numbers, i, size, actions);
        let bits = before.wrapping_add(from_zigzag(step.to_bits()));
        numbers.push(f32::from_bits(from_ordered(bits)));
    }
    numbers
}

/// Returns a float's bits in the order of floats: near floats have near numbers, across 0 too.
fn ordered(number: f32) -> u32 {
    let bits = number.to_bits();
    if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
}

/// Returns the bits of the float with this number.
fn from_ordered(number: u32) -> u32 {
    if number >> 31 == 0 { !number } else { number ^ 1 << 31 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn episodes_can_be_copied_to_a_replay_of_another_shape() {
        let mut replay = Replay::new(ReplaySizes::all(1), 3, 300);
        for episode in 0..6 {
            let state = |step: usize| [(10 * episode + step) as f32];
            (0..4).for_each(|step| replay.push(episode % 3, &state(step), &[0.5], &[7.0]));
            replay.end_episode(episode % 3, &state(4));
        }
        let states = |replay: &Replay| {
            let mut all = Vec::new();
            replay.visit_episodes(|_, state| all.extend(state.map(|s| s[0] as usize)));
            all.sort_unstable();
            all
        };
        let mut other = Replay::new(ReplaySizes::all(1), 2, 100);
        replay.copy_episodes_into(&mut other);
        assert_eq!(other.written, [15, 15], "spread evenly");
        assert_eq!(states(&other), states(&replay));
        assert_eq!(other.steps_left(StoredStep { agent: 1, slot: 6 }), 3);
    }

    /// Returns a replay that has filled one agent's slots and some of the other's, with states
    /// that move by `speed` times the action.
    fn walked(speed: f32) -> Replay {
        let mut replay = Replay::new(ReplaySizes { state: 3, goal: 2, action: 2 }, 2, 400);
        let mut rng = <ChaCha8Rng as rand::SeedableRng>::seed_from_u64(1);
        for (agent, steps) in [(0, 500), (1, 90)] {
            let mut at = [3.0_f32, -0.5];
            for step in 0..steps {
                let action: [f32; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
                replay.push(agent, &[at[0], at[1], 1.0], &action, &[9.0, -0.0]);
                at = std::array::from_fn(|i| at[i] + speed * action[i]);
                if step % 60 == 59 {
                    replay.end_episode(agent, &[at[0], at[1], 1.0]);
                }
            }
        }
        replay
    }

    #[test]
    fn contents_are_restored_and_states_follow_from_actions_where_these_are_displacements() {
        for (speed, adds_actions) in [(1.0, true), (-0.01, false)] {
            let (replay, stored) = (walked(speed), walked(speed).stored());
            assert_eq!(stored.adds_actions, adds_actions);
            let mut again = Replay::new(replay.sizes, 2, 400);
            again.restore(stored).expect("its own contents");
            assert_eq!((&again.written, &again.episode), (&replay.written, &replay.episode));
            assert!(again.states == replay.states && again.actions == replay.actions);
            assert!(again.goals == replay.goals && again.left == replay.left);
            let mut other = Replay::new(replay.sizes, 2, 300);
            other.restore(replay.stored()).expect_err("another capacity");
        }
    }

    #[test]
    fn any_numbers_are_restored_bit_by_bit() {
        let any =
            [0.0, -0.0, f32::MIN_POSITIVE, -1e-45, f32::MAX, f32::MIN, f32::INFINITY, f32::NAN];
        for actions in [None, Some((&[f32::NAN; 16][..], 2))] {
            let again = numbers(&steps(&any, 1, actions), 1, actions);
            assert!(again.iter().zip(&any).all(|(a, b)| a.to_bits() == b.to_bits()), "{again:?}");
        }
    }

    #[test]
    fn impossible_numbers_are_not_restored() {
        let restored = |change: &dyn Fn(&mut Replay)| {
            let mut replay = walked(1.0);
            change(&mut replay);
            Replay::new(replay.sizes, 2, 400).restore(replay.stored()).is_ok()
        };
        assert!(restored(&|_| {}));
        for wrong in [f32::NAN, f32::INFINITY, -3.4e38] {
            assert!(!restored(&|r| r.states[3] = wrong) && !restored(&|r| r.goals[3] = wrong));
        }
        assert!(!restored(&|r| r.actions[2] = -1.01), "actions lie in [-1, 1]");
        assert!(!restored(&|r| r.left[210] = 60), "it leads into the episode that goes on");
        assert!(!restored(&|r| r.written[1] = 1 << 60));
        assert!(!restored(&|r| r.episode[1] = 91 + r.written[1]));
    }

    #[test]
    fn transitions_that_become_possible_again_are_restored() {
        let mut replay = Replay::new(ReplaySizes::all(1), 1, 100);
        (0..5).for_each(|i| replay.push(0, &[i as f32], &[1.0], &[9.0]));
        replay.end_episode(0, &[5.0]);
        (6..8).for_each(|i| replay.push(0, &[i as f32], &[1.0], &[9.0]));
        replay.end_episode(0, &[8.0]);
        let left = |replay: &Replay| {
            (0..9).map(|slot| replay.steps_left(StoredStep { agent: 0, slot })).collect::<Vec<_>>()
        };
        let before = left(&replay);
        assert_eq!(before, [5, 4, 3, 2, 1, 0, 2, 1, 0]);
        assert_eq!(replay.retain_possible(|s, _, _| Some(s[0] != 2.0)), (1, 0));
        assert_eq!(replay.retain_possible(|_, _, _| None), (0, 0));
        assert_eq!(left(&replay), [2, 1, 0, 2, 1, 0, 2, 1, 0]);
        assert_eq!(replay.retain_possible(|s, _, _| Some(s[0] != 7.0)), (1, 1));
        assert_eq!(replay.retain_possible(|_, _, _| Some(true)), (0, 1));
        assert_eq!(left(&replay), before, "ends of episodes stay ends");
    }

    #[test]
    fn recent_moments_are_among_the_latest_slots_and_have_a_next_step() {
        let mut replay = Replay::new(ReplaySizes::all(1), 2, 100);
        let mut rng = <ChaCha8Rng as rand::SeedableRng>::seed_from_u64(1);
        assert_eq!(replay.sample_recent(10, &mut rng), None, "it is empty");
        for agent in 0..2 {
            (0..20).for_each(|i| replay.push(agent, &[i as f32], &[1.0], &[0.0]));
            replay.end_episode(agent, &[20.0]);
        }
        let drawn: Vec<StoredStep> =
            (0..200).filter_map(|_| replay.sample_recent(5, &mut rng)).collect();
        assert!(drawn.len() > 150 && drawn.iter().all(|m| (16..20).contains(&m.slot)), "{drawn:?}");
        assert_eq!(replay.sample_recent(0, &mut rng), None);
    }
}
