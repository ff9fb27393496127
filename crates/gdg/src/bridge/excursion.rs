//! Excursions: agents that explore beyond the frontier of what has been visited.

mod axes;
mod places;
mod seek;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::env::Spec;
use crate::learn::{Axis, Policy, Scratch};
use crate::store::StoreError;
use axes::Moves;
use places::{NO_FRONTIER, Places};
use seek::{GoalMoves, Seek};

/// An excursion ends after this many actions without a new place, each held as long as it takes.
/// The way to the frontier has an additional allowance.
pub(crate) const EXCURSION_ACTIONS: u32 = 10;

/// Share of random actions on an excursion, which free agents that the table leads in circles.
pub(crate) const RANDOM_SHARE: f32 = 0.1;

/// Steps for which an action is held to leave a place, at least and at most: as many as cross it
/// by the smallest stride. If fewer, an action that leads on would soon count as blocked.
pub(crate) const HELD_STEPS: [u32; 2] = [3, 20];

/// Smallest share of an action that an agent takes per step.
pub(crate) const MIN_STRIDE: f32 = 0.5;

/// Averaging window for the share of steps on excursions, in rounds of steps: longer than any
/// excursion, short enough to set out at once when a door opens.
pub(crate) const SHARE_ROUNDS: u32 = 1_000;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Excursion {
    /// Steps left unless it finds a new place; `None` before the first step.
    left: Option<u32>,
    held: Option<Held>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Held {
    from: usize,
    action: usize,
    steps: u32,
}

/// Excursions of all agents.
///
/// On an excursion, an agent follows what actions have led to before to the nearest place at the
/// frontier, where some action may lead to an unvisited place, and tries it: return first, then
/// explore (Ecoffet et al. 2021), with optimism about untried actions (R-max, Brafman and
/// Tennenholtz 2002). This needs neither D nor the actor, which are not trained there yet. Where the
/// achieved goal seldom moves, agents seek what moves it instead, by the dynamics model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Excursions {
    pub(crate) places: Places,
    moves: Moves,
    goal_moves: GoalMoves,
    #[serde(skip)]
    held_steps: u32,
    at: Vec<Option<usize>>,
    under_way: Vec<Option<Excursion>>,
    seeks: Vec<Option<Seek>>,
    /// Whether the last step of each agent has moved the achieved goal.
    moving: Vec<bool>,
    /// Mean share of agents on an excursion lately, and the number of rounds averaged, at most
    /// [`SHARE_ROUNDS`]; older ones fade.
    spent: (f64, u32),
}

impl Excursions {
    pub fn new(spec: &Spec, agents: usize) -> Self {
        let places = Places::new(spec);
        Self {
            held_steps: held_steps(&places),
            places,
            moves: Moves::new(spec),
            goal_moves: GoalMoves::default(),
            at: vec![None; agents],
            under_way: vec![None; agents],
            seeks: vec![None; agents],
            moving: vec![false; agents],
            spent: (0.0, 0),
        }
    }

    /// Records a step of any agent. When many steps show that places differ in something else, the table
    /// of places starts over, and all excursions end.
    pub fn note(&mut self, agent: usize, spec: &Spec, [state, next]: [&[f32]; 2], action: &[f32]) {
        if spec.state_dim() == spec.goal_dim() {
            return;
        }
        let goal_has_moved = spec.goal_moves(state, next);
        if let Some(seek) = &mut self.seeks[agent] {
            seek.note(goal_has_moved);
        }
        let was_moving = std::mem::replace(&mut self.moving[agent], goal_has_moved);
        if goal_has_moved && !was_moving && self.moves.goal_rests() {
            self.goal_moves.push(spec, [state, next], action);
        }
        if self.moves.note(spec, state, next) {
            self.look(spec);
        }
    }

    /// Takes note of a recorded step.
    pub fn note_recorded(&mut self, spec: &Spec, [state, next]: [&[f32]; 2]) {
        self.moves.note(spec, state, next);
    }

    /// Looks for further components that distinguish places.
    pub fn look(&mut self, spec: &Spec) {
        if let Some(axes) = self.moves.more_axes(spec, self.places.axes()) {
            self.places = Places::along(spec, axes);
            self.held_steps = held_steps(&self.places);
            self.end_all();
        }
    }

    /// Returns the axes that distinguish places besides those of the goal.
    pub fn other_axes(&self, spec: &Spec) -> &[Axis] {
        &self.places.axes()[spec.goal_dim()..]
    }

    /// Whether agents have lately spent less than `share` of their steps on excursions. Counting
    /// goals would not do: on a large map, one goal takes many times as long as an excursion.
    pub fn are_due(&self, share: f32) -> bool {
        self.spent.0 < f64::from(share)
    }

    pub(crate) fn count_steps(&mut self) {
        let agents = self.at.len();
        let on = (0..agents).filter(|agent| self.is_on(*agent)).count() as f64 / agents as f64;
        let (share, rounds) = &mut self.spent;
        *rounds = (*rounds + 1).min(SHARE_ROUNDS);
        *share += (on - *share) / f64::from(*rounds);
    }

    /// Returns the centre of the place at the frontier that `agent` is heading for, as a goal,
    /// `(goal_dim)`.
    pub fn destination(&self, agent: usize) -> Option<Vec<f32>> {
        let at = self.at[agent].filter(|_| self.under_way[agent].is_some())?;
        Some(self.places.centre(self.places.frontier_from(at)?))
    }

    /// Records that `agent` is in `state` and what its held action has led to. Ends its excursion
    /// if it has found nothing new for too long or nothing is left to find.
    pub fn arrive(&mut self, agent: usize, state: &[f32]) {
        let visited = self.places.visit(state);
        self.at[agent] = visited.map(|(place, _)| place);
        self.seeks[agent] = self.seeks[agent].take().filter(|seek| seek.left > 0);
        let Some(mut excursion) = self.under_way[agent].take() else { return };
        let ended = match visited {
            None => true,
            Some((place, is_new)) => {
                if let Some(Held { from, action, steps }) = excursion.held
                    && (from != place || steps >= self.held_steps)
                {
                    self.places.record(from, action, place);
                    excursion.held = None;
                }
                let ahead = self.places.ahead(place);
                let steps = |actions: u32| actions.saturating_mul(self.held_steps);
                let left = match excursion.left {
                    _ if is_new => steps(EXCURSION_ACTIONS),
                    None => steps(ahead.saturating_add(EXCURSION_ACTIONS)),
                    Some(left) => left - 1,
                };
                excursion.left = Some(left);
                left == 0 || ahead == NO_FRONTIER
            }
        };
        self.under_way[agent] = (!ended).then_some(excursion);
    }

    /// Writes the next action of `agent` to `action`, `(action_dim)`, if it is on an excursion;
    /// returns whether it is.
    pub fn act(
        &mut self,
        agent: usize,
        (spec, state): (&Spec, &[f32]),
        action: &mut [f32],
        policy: &dyn Policy,
        rng: &mut ChaCha8Rng,
        scratch: &mut Scratch,
    ) -> bool {
        if let Some(seek) = &mut self.seeks[agent] {
            let moves = &self.goal_moves;
            action.copy_from_slice(seek.act(spec, moves, state, policy, rng, scratch));
            return true;
        }
        let (Some(at), Some(excursion)) = (self.at[agent], &mut self.under_way[agent]) else {
            return false;
        };
        let held = excursion.held.unwrap_or_else(|| {
            let is_random = rng.random::<f32>() < RANDOM_SHARE;
            let action = self.places.choose_action(at, is_random, rng);
            Held { from: at, action, steps: 0 }
        });
        excursion.held = Some(Held { steps: held.steps + 1, ..held });
        let stride = rng.random_range(MIN_STRIDE..=1.0);
        for (own, along) in action.iter_mut().zip(self.places.action(held.action)) {
            *own = stride * along;
        }
        true
    }

    /// Goes on with the places of other agents in the same world.
    pub(crate) fn keep_places_of(&mut self, others: Self) {
        (self.places, self.held_steps) = (others.places, others.held_steps);
        (self.moves, self.goal_moves) = (others.moves, others.goal_moves);
    }

    pub(crate) fn end_all(&mut self) {
        self.at.fill(None);
        self.under_way.fill(None);
        self.seeks.fill(None);
    }

    /// Whether `agent` is on an excursion.
    pub(crate) fn is_on(&self, agent: usize) -> bool {
        self.under_way[agent].is_some() || self.seeks[agent].is_some()
    }

    pub(crate) fn set_out(&mut self, agent: usize) {
        if self.moves.goal_rests() {
            self.seeks[agent] = Some(Seek::new(self.places.action(0).len()));
        } else {
            self.under_way[agent] = Some(Excursion::default());
        }
    }

    pub(crate) fn end(&mut self, agent: usize) {
        (self.under_way[agent], self.seeks[agent]) = (None, None);
    }

    /// Whether the achieved goal seldom moves.
    pub(crate) fn goal_rests(&self) -> bool {
        self.moves.goal_rests()
    }

    /// Returns the share of the latest steps that have moved the achieved goal; `None` where the
    /// goal is the whole state.
    pub fn goal_share(&self) -> Option<f64> {
        self.moves.goal_share()
    }

    pub(crate) fn forget_outcomes(&mut self) {
        self.places.forget_outcomes();
        self.end_all();
    }

    pub fn restore(&mut self, spec: &Spec, stored: Self) -> Result<(), StoreError> {
        let Self { places, moves, goal_moves, at, under_way, seeks, moving, spent, .. } = stored;
        let places = places.restored(spec)?;
        let held_steps = held_steps(&places);
        let known = |place: &usize| *place < places.len();
        let fits = |excursion: &Excursion| {
            let held = excursion.held.is_none_or(|held| {
                known(&held.from) && held.action < 2 * spec.action_dim && held.steps <= held_steps
            });
            held && excursion.left != Some(0)
        };
        let all_fit = [at.len(), under_way.len(), seeks.len(), moving.len()] == [self.at.len(); 4]
            && seeks.iter().flatten().all(|seek| seek.fits(spec))
            && at.iter().flatten().all(known)
            && under_way.iter().flatten().all(fits)
            && (0.0..=1.0).contains(&spent.0)
            && moves.fit(spec)
            && goal_moves.fit(spec)
            && spent.1 <= SHARE_ROUNDS;
        StoreError::unless(all_fit, "the stored excursions do not fit the agents")?;
        *self = Self { places, moves, goal_moves, held_steps, at, under_way, seeks, moving, spent };
        Ok(())
    }
}

/// Returns the steps for which an action is held: as many as cross a place by the smallest stride.
fn held_steps(places: &Places) -> u32 {
    (places.steps_across(MIN_STRIDE).round() as u32).clamp(HELD_STEPS[0], HELD_STEPS[1])
}

#[cfg(test)]
mod tests {
    use super::places::tests::plane;
    use super::*;

    #[test]
    fn excursions_take_their_share_of_steps_however_long_goals_are_pursued() {
        let mut excursions = Excursions::new(&plane(), 2);
        let (mut on, mut left) = ([0u32; 2], [0u32; 2]);
        let rounds = 20_000;
        for _ in 0..rounds {
            for agent in 0..2 {
                if left[agent] == 0 {
                    let is_due = excursions.are_due(0.2);
                    excursions.under_way[agent] = is_due.then(Excursion::default);
                    left[agent] = if is_due { 20 } else { 300 };
                }
                left[agent] -= 1;
                on[agent] += u32::from(excursions.under_way[agent].is_some());
            }
            excursions.count_steps();
        }
        let share = f64::from(on[0] + on[1]) / f64::from(2 * rounds);
        assert!((0.15..0.25).contains(&share), "{share}");
        assert!(!excursions.are_due(0.0));
        // A door opens: more are due at once.
        assert!(excursions.are_due(0.5));
    }
}
