//! A replay's contents as plain numbers, for checkpoints.

use crate::store::{Store, StoreError, from_zigzag, zigzag};

/// A replay's contents as plain numbers, for checkpoints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReplayState {
    /// Total number of slots written by each agent.
    pub written: Vec<u64>,
    /// Number of the first slot of each agent's current episode.
    pub episode: Vec<u64>,
    /// `(slots, state_dim)`: each agent's slots, oldest first, one agent after the other.
    pub states: Vec<f32>,
    /// `(slots, action_dim)`.
    pub actions: Vec<f32>,
    /// `(slots, goal_dim)`.
    pub goals: Vec<f32>,
    /// Steps from each slot to the end of its episode, for episodes that have ended.
    pub left: Vec<u16>,
}

impl ReplayState {
    /// Writes the state to `store`.
    pub fn write(self, store: &mut Store) {
        let (steps, adds_actions) = self.steps();
        store.put("replay.written", self.written);
        store.put("replay.episode", self.episode);
        store.put("replay.steps", steps);
        store.put("replay.steps.add_actions", vec![u32::from(adds_actions)]);
        store.put("replay.actions", self.actions);
        store.put("replay.goals", self.goals);
        store.put("replay.left", self.left);
    }

    /// Reads the state that [`Self::write`] wrote.
    ///
    /// # Errors
    /// Returns an error if a part is missing or has the wrong type.
    pub fn read(store: &Store) -> Result<Self, StoreError> {
        let actions = store.f32("replay.actions")?.to_vec();
        let left = store.u16("replay.left")?.to_vec();
        let states = if store.has("replay.states") {
            // Older formats hold the states themselves.
            store.f32("replay.states")?.to_vec()
        } else {
            let adds_actions = store.u32("replay.steps.add_actions")?.contains(&1);
            let steps = Steps { slots: left.len(), actions: &actions, adds_actions };
            steps.states(store.u32("replay.steps")?)
        };
        Ok(Self {
            written: store.u64("replay.written")?.to_vec(),
            episode: store.u64("replay.episode")?.to_vec(),
            states,
            actions,
            goals: store.f32("replay.goals")?.to_vec(),
            left,
        })
    }

    /// Returns the states as differences to their predictions, and whether these add actions: where
    /// that leaves less.
    fn steps(&self) -> (Vec<u32>, bool) {
        let differences = |adds_actions| {
            let steps = Steps { slots: self.left.len(), actions: &self.actions, adds_actions };
            steps.differences(&self.states)
        };
        let bits = |differences: &[u32]| -> u64 {
            differences.iter().map(|d| u64::from(u32::BITS - d.leading_zeros())).sum()
        };
        let (with, without) = (differences(true), differences(false));
        if bits(&with) < bits(&without) { (with, true) } else { (without, false) }
    }
}

/// Predicts each state: the one before it, plus the action taken there if `adds_actions`, as in
/// worlds where actions are displacements. What remains is exact, and mostly short.
struct Steps<'a> {
    slots: usize,
    /// `(slots, action_dim)`.
    actions: &'a [f32],
    adds_actions: bool,
}

impl Steps<'_> {
    /// Returns the size of each of the states with this many `components` in all; damaged files may
    /// have any number.
    fn state_dim(&self, components: usize) -> usize {
        (components / self.slots.max(1)).max(1)
    }

    /// Returns the bits of the prediction of a component, given the `states` up to it.
    fn predicted(&self, states: &[f32], component: usize, state_dim: usize) -> u32 {
        let Some(before) = component.checked_sub(state_dim) else { return 0 };
        let (slot, dim) = (before / state_dim, before % state_dim);
        let action_dim = self.actions.len() / self.slots.max(1);
        let action = (self.adds_actions && dim < action_dim)
            .then(|| self.actions.get(slot * action_dim + dim))
            .flatten();
        ordered(states[before] + action.copied().unwrap_or(0.0))
    }

    /// Returns the differences of `(slots, state_dim)` states to their predictions.
    fn differences(&self, states: &[f32]) -> Vec<u32> {
        let state_dim = self.state_dim(states.len());
        let difference = |(i, state): (usize, &f32)| {
            let by = ordered(*state).wrapping_sub(self.predicted(states, i, state_dim));
            zigzag(i64::from(by.cast_signed())) as u32
        };
        states.iter().enumerate().map(difference).collect()
    }

    /// Returns the states with these `differences`.
    fn states(&self, differences: &[u32]) -> Vec<f32> {
        let state_dim = self.state_dim(differences.len());
        let mut states = Vec::with_capacity(differences.len());
        for (i, difference) in differences.iter().enumerate() {
            let from = self.predicted(&states, i, state_dim);
            let bits = from.wrapping_add(from_zigzag(u64::from(*difference)) as u32);
            states.push(f32::from_bits(from_ordered(bits)));
        }
        states
    }
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
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn walk(step: f32, rng: &mut ChaCha8Rng) -> ReplayState {
        let mut state = ReplayState { left: vec![0; 500], ..ReplayState::default() };
        let mut at = [3.0_f32, -0.5];
        for _ in 0..500 {
            state.states.extend([at[0], at[1], 1.0]);
            let action: [f32; 2] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            at = std::array::from_fn(|i| at[i] + step * action[i]);
            state.actions.extend(action);
        }
        state
    }

    fn restored(state: &ReplayState) -> (ReplayState, u32) {
        let mut store = Store::default();
        state.clone().write(&mut store);
        let adds_actions = store.u32("replay.steps.add_actions").expect("there")[0];
        (ReplayState::read(&store).expect("its own"), adds_actions)
    }

    #[test]
    fn states_are_restored_bit_by_bit_and_follow_from_actions_where_these_are_displacements() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let by_action = walk(1.0, &mut rng);
        assert_eq!(restored(&by_action), (by_action.clone(), 1));
        let (steps, _) = by_action.steps();
        assert!(steps[3..].iter().all(|step| *step == 0), "nothing remains: {steps:?}");
        let otherwise = walk(-0.01, &mut rng);
        assert_eq!(restored(&otherwise), (otherwise.clone(), 0));
        let empty = ReplayState::default();
        assert_eq!(restored(&empty).0, empty);
    }

    #[test]
    fn any_numbers_are_restored_and_wrong_lengths_do_no_harm() {
        let numbers = [0.0, -0.0, f32::MIN_POSITIVE, -1e-45, f32::MAX, f32::MIN, f32::INFINITY];
        let mut state = ReplayState { left: vec![0; 7], ..ReplayState::default() };
        (state.states, state.actions) = (numbers.to_vec(), vec![f32::NAN; 7]);
        let bits = |numbers: &[f32]| numbers.iter().map(|n| n.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&restored(&state).0.states), bits(&numbers));
        for slots in 0..30 {
            let steps = Steps { slots, actions: &[1.0; 5], adds_actions: true };
            assert_eq!(steps.states(&[7; 13]).len(), 13);
        }
    }
}
