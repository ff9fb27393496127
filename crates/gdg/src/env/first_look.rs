//! What the first look at a world has found of its actions, by which other steps are judged.

use serde::{Deserialize, Serialize};

use super::Environment;
use crate::text::grouped;

/// A state, the action in it, and where that has led.
pub type RecordedStep<'a> = [&'a [f32]; 3];

/// What goes with an action as closely as `DIRECT` is moved by it at once; what goes with it no more
/// closely than `UNRELATED`, or the other way, is not.
const DIRECT: f64 = 0.6;
const UNRELATED: f64 = 0.1;

/// What goes with it no more closely than this, over half of [`JUDGED_STEPS`], goes the other way.
const REVERSED: f64 = -0.3;

/// What differs by no more than this share of its size is constant.
const ROUNDING: f64 = 1e-9;

/// Steps of agents that are judged together.
const JUDGED_STEPS: usize = 2_000;

/// Share of the steps whose changes count in full; larger ones as these, as an impact changes a velocity
/// by far more than any action.
const ORDINARY: f64 = 0.7;

/// A component of the state that actions move at once, how far its changes count, and how closely they go
/// with each component of an action: their correlations.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DirectEffect {
    pub component: usize,
    limit: f32,
    weights: Vec<f32>,
}

impl DirectEffect {
    /// Whether what a checkpoint has kept fits these sizes.
    pub fn fits(&self, state_dim: usize, action_dim: usize) -> bool {
        let is_finite = self.weights.iter().all(|weight| weight.is_finite());
        let has_limit = (0.0..f32::INFINITY).contains(&self.limit);
        self.component < state_dim && self.weights.len() == action_dim && has_limit && is_finite
    }

    fn change(&self, from: &[f32], to: &[f32]) -> f32 {
        (to[self.component] - from[self.component]).clamp(-self.limit, self.limit)
    }
}

/// Returns what actions have moved at once in some steps.
pub fn direct_effects(steps: &[RecordedStep]) -> Vec<DirectEffect> {
    let Some([state, action, _]) = steps.first() else { return Vec::new() };
    let effects = (0..state.len()).map(|component| {
        let change = |[from, _, to]: &RecordedStep| (to[component] - from[component]).abs();
        let limit = share(steps.iter().map(change).collect(), 1.0 - ORDINARY)[1];
        let mut effect = DirectEffect { component, limit, weights: Vec::new() };
        let related = |j: usize| {
            let mut sums = PairSums::default();
            let mut add = |[from, a, to]: &RecordedStep| sums.add(effect.change(from, to), a[j]);
            steps.iter().for_each(&mut add);
            sums.correlation().unwrap_or(0.0) as f32
        };
        effect.weights = (0..action.len()).map(related).collect();
        effect
    });
    effects.filter(|effect| effect.weights.iter().any(|w| f64::from(w.abs()) > DIRECT)).collect()
}

#[derive(Clone, Copy, Debug)]
pub struct FirstLook<'a> {
    pub effects: &'a [DirectEffect],
    /// The bounds of each component of a row, and which of these each component of the state is.
    pub bounds: &'a [[Option<f32>; 2]],
    pub columns: &'a [usize],
    /// Lowest and highest action, in the world's own unit.
    pub low: &'a [Option<f32>],
    pub high: &'a [Option<f32>],
}

/// How far actions do what they did in a first look, over some steps.
#[derive(Clone, Debug, Default)]
pub struct Agreement {
    /// Of each direct effect: what has changed, and what was to be expected.
    sums: Vec<PairSums>,
    pub steps: usize,
    /// Whether anything has moved of what actions move at once, or else at all.
    pub has_moved: bool,
}

impl Agreement {
    pub fn add(&mut self, effects: &[DirectEffect], [from, action, to]: RecordedStep) {
        self.sums.resize(effects.len(), PairSums::default());
        for (sums, effect) in self.sums.iter_mut().zip(effects) {
            let expected = effect.weights.iter().zip(action).map(|(weight, a)| weight * a);
            sums.add(effect.change(from, to), expected.sum());
        }
        self.steps += 1;
        let moves = |effect: &DirectEffect| from[effect.component] != to[effect.component];
        self.has_moved |= if effects.is_empty() { from != to } else { effects.iter().any(moves) };
    }

    /// Whether most of what actions moved at once, as far as it moves, moves otherwise.
    pub fn is_lost(&self) -> bool {
        let known: Vec<f64> = self.sums.iter().filter_map(PairSums::correlation).collect();
        2 * known.iter().filter(|known| **known < UNRELATED).count() > known.len()
    }

    /// Returns the component that goes the other way, if one does.
    pub fn reversed(&self, effects: &[DirectEffect]) -> Option<usize> {
        let is_reversed =
            |sums: &PairSums| sums.correlation().is_some_and(|known| known < REVERSED);
        let at =
            self.sums.iter().position(is_reversed).filter(|_| self.steps >= JUDGED_STEPS / 2)?;
        Some(effects[at].component)
    }
}

/// Watches whether actions still do what they did in the first look.
#[derive(Debug, Default)]
pub struct EffectWatch {
    recent: Agreement,
    has_said: bool,
}

impl EffectWatch {
    /// Adds one step of every agent, made before the run's step number `steps`. Returns a warning the
    /// first time that actions no longer do what they did.
    pub fn note(
        &mut self,
        world: &dyn Environment,
        (before, actions): (&[f32], &[f32]),
        steps: u64,
    ) -> Option<String> {
        let look = world.first_look()?;
        let (s, a) = (world.spec().state_dim(), world.spec().action_dim);
        let moves = before.chunks_exact(s).zip(world.states().chunks_exact(s));
        for ((from, to), action) in moves.zip(actions.chunks_exact(a)) {
            self.recent.add(look.effects, [from, action, to]);
        }
        if self.recent.steps < JUDGED_STEPS {
            return None;
        }
        let judged = std::mem::take(&mut self.recent);
        let what = match judged.has_moved {
            false => "nothing moves that actions moved",
            true if judged.is_lost() || judged.reversed(look.effects).is_some() => {
                "actions do not lead where they led"
            }
            true => return None,
        };
        let said = std::mem::replace(&mut self.has_said, true);
        let by = format!("{}: since step {} or before", world.title(), grouped(steps));
        (!said).then(|| format!("{by}, {what}"))
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct PairSums([f64; 6]);

impl PairSums {
    fn add(&mut self, a: f32, b: f32) {
        let [a, b] = [a, b].map(f64::from);
        self.0.iter_mut().zip([1.0, a, b, a * a, b * b, a * b]).for_each(|(sum, v)| *sum += v);
    }

    /// Returns the correlation, unless one of them is constant.
    fn correlation(&self) -> Option<f64> {
        let [count, sums @ ..] = self.0;
        let [a, b, aa, bb, ab] = sums.map(|sum| sum / count);
        let spread = ((aa - a * a) * (bb - b * b)).max(0.0).sqrt();
        (spread > ROUNDING * (aa * bb).sqrt()).then(|| (ab - a * b) / spread)
    }
}

/// Returns the range of `numbers` without the share `tail` of them below it and above it.
pub fn share(mut numbers: Vec<f32>, tail: f64) -> [f32; 2] {
    let Some(last) = numbers.len().checked_sub(1) else { return [0.0; 2] };
    [tail, 1.0 - tail].map(|share| {
        let at = (share * last as f64).round() as usize;
        *numbers.select_nth_unstable_by(at, f32::total_cmp).1
    })
}
