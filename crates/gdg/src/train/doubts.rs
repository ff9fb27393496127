//! Says why recorded steps may be damaged, or of another world.

use super::dataset::Dataset;
use crate::env::{Agreement, Environment, FirstLook, RecordedStep, Spec, share};

/// Most steps of a file that are looked at.
const MOST_STEPS: usize = 200_000;

/// A file is judged in parts: whole episodes with at least this number of steps together, or else at most
/// this share of all steps.
const PART_STEPS: usize = 20;
const PARTS: usize = 10;

/// From this share of odd steps on, nearly all are.
const ALL: f64 = 0.75;

/// Most groups of episodes that are named.
const NAMED: usize = 4;

/// Steps are long where a component typically changes by this multiple of what it does in random steps,
/// short where none does so by this share of it: nine of ten change it by less.
const LONG: f32 = 30.0;
const SHORT: f32 = 0.1;
const TYPICAL: f64 = 0.9;

/// States are far that are this many half ranges away from the middle of goals and starts.
const FAR: f32 = 2.0;

/// How far a number may lie beyond bounds, as a share of them.
const BEYOND: f32 = 1e-3;

/// Steps from one episode to the next are this many times as long as hardly any other.
const LEAP: f32 = 2.0;

/// Unscaled actions reach this share of the range between narrow bounds, which is at most this long.
const REACHED: f32 = 0.9;
const NARROW: f32 = 1.8;

/// What is judged by a world's first look, and said where it is so in more than this share of the steps.
const CHECKS: [(Check, f64); 5] =
    [(outside, 0.0), (far, 0.5), (long, 0.1), (short, 0.5), (otherwise, 0.1)];

type Judge<'a> = (&'a Spec, FirstLook<'a>);
type Check = fn(&Judge, &[NumberedStep]) -> Option<String>;

/// A step and its episode.
type NumberedStep<'a> = (usize, RecordedStep<'a>);

fn outside((_, look): &Judge, steps: &[NumberedStep]) -> Option<String> {
    look.columns.iter().enumerate().find_map(|(i, column)| {
        let [low, high] = *look.bounds.get(*column)?;
        let [low, high] = [low.unwrap_or(f32::MIN), high.unwrap_or(f32::MAX)];
        let margin = BEYOND * low.abs().min(high.abs()).max(1.0);
        let mut values = steps.iter().map(|(_, [state, ..])| state[i]);
        let value = values.find(|v| !(low - margin..=high + margin).contains(v))?;
        Some(format!("component {i} is {value}, which its space does not contain"))
    })
}

fn far((spec, _): &Judge, steps: &[NumberedStep]) -> Option<String> {
    let Spec { state_centre, state_half_range, achieved, .. } = spec;
    let is_far = |i: usize, v: f32| (v - state_centre[i]).abs() > FAR * state_half_range[i];
    let count = |i: &usize| steps.iter().filter(|(_, [state, ..])| is_far(*i, state[*i])).count();
    let far = achieved.iter().find(|i| 2 * count(i) > steps.len());
    far.map(|i| format!("component {i} is mostly far from all goals and starts"))
}

/// Returns how much a step typically changes what actions move at once, and random ones do: others may
/// be of an object that lies still until it is pushed.
fn changes((spec, look): &Judge, steps: &[NumberedStep]) -> Vec<(usize, f32, f32)> {
    let moved = |i: usize| {
        let changes = steps.iter().map(|(_, [from, _, to])| (to[i] - from[i]).abs());
        (i, share(changes.collect(), 1.0 - TYPICAL)[1], spec.change_scale[i])
    };
    look.effects.iter().map(|effect| moved(effect.component)).collect()
}

fn changed((i, now, usual): &(usize, f32, f32)) -> String {
    format!("a step changes component {i} by {now}, and by {usual} in random steps")
}

fn long(judge: &Judge, steps: &[NumberedStep]) -> Option<String> {
    changes(judge, steps).iter().find(|(_, now, usual)| *now > LONG * usual).map(changed)
}

fn short(judge: &Judge, steps: &[NumberedStep]) -> Option<String> {
    let changes = changes(judge, steps);
    let are_short = changes.iter().all(|(_, now, usual)| *now < SHORT * usual);
    changes.first().filter(|_| are_short).map(changed)
}

fn agreement(look: &FirstLook, steps: &[NumberedStep]) -> Agreement {
    let mut agreement = Agreement::default();
    steps.iter().for_each(|(_, step)| agreement.add(look.effects, *step));
    agreement
}

fn otherwise((_, look): &Judge, steps: &[NumberedStep]) -> Option<String> {
    let said = "actions do not lead where they lead here: rows may be shifted or reversed, actions \
                negated or in another order";
    agreement(look, steps).is_lost().then(|| said.to_owned())
}

/// Says that something goes the other way in the whole file, which the few steps of a part do not show.
fn reversed(look: FirstLook, steps: &[NumberedStep]) -> Option<String> {
    let at = agreement(&look, steps).reversed(look.effects)?;
    Some(format!("actions move component {at} the other way than here: they may be negated"))
}

/// Says that actions seem to be in the environment's own unit.
fn unscaled(look: FirstLook, steps: &[NumberedStep]) -> Option<String> {
    let bounds = look.low.iter().zip(look.high).enumerate();
    let bounds = bounds.filter_map(|(i, (low, high))| Some((i, (*low)?, (*high)?)));
    let narrow: Vec<_> = bounds.filter(|(_, low, high)| high - low < NARROW).collect();
    let is_filled = |(i, low, high): &(usize, f32, f32)| {
        let [least, most] = share(steps.iter().map(|(_, [_, a, _])| a[*i]).collect(), 0.0);
        let is_within = least >= low - BEYOND && most <= high + BEYOND;
        is_within && most - least > REACHED * (high - low)
    };
    let (i, low, high) = narrow.first().filter(|_| narrow.iter().all(is_filled))?;
    Some(format!(
        "its actions seem to be unscaled: component {i} stays within the environment's bounds, {low} to \
         {high}, which -1 and 1 stand for"
    ))
}

impl Dataset {
    /// Says why its steps may not be of `world`, or are not what they should be.
    pub fn doubts(&self, world: &dyn Environment) -> Vec<String> {
        let (steps, mut said) = (self.steps(MOST_STEPS), Vec::new());
        if let Some(look) = world.first_look() {
            let (judge, parts) = ((world.spec(), look), parts(&steps));
            for (check, least) in CHECKS {
                let odd = parts.iter().filter_map(|part| Some((*part, check(&judge, part)?)));
                let odd: Vec<_> = odd.collect();
                let count = odd.iter().map(|(part, _)| part.len()).sum::<usize>();
                let share = count as f64 / steps.len() as f64;
                if let Some((_, text)) = odd.first().filter(|_| share > least) {
                    said.push(place(odd.iter().map(|(part, _)| *part), share) + text);
                }
            }
            said.extend(reversed(look, &steps));
            said.extend(unscaled(look, &steps));
        }
        let first = steps.first().map_or(&[][..], |(_, [_, action, _])| action);
        let is_always = |i: usize, v: f32| steps.iter().all(|(_, [_, action, _])| action[i] == v);
        let constant = first.iter().enumerate().find(|(i, v)| is_always(*i, **v));
        let text = |(i, v)| format!("component {i} of its actions is always {}", v + 0.0);
        said.extend(constant.map(text));
        let all = self.source().transitions;
        let endless = format!("no row ends an episode: all {all} transitions are taken for one");
        let others = [
            (self.ends_are_off(), "most episodes begin or end with a leap: ends may be a row off"),
            (self.is_endless, &endless),
        ];
        said.extend(others.into_iter().filter(|(is, _)| *is).map(|(_, text)| text.to_owned()));
        said
    }

    /// Whether most first, or most last, steps of episodes lead from one episode to the next.
    fn ends_are_off(&self) -> bool {
        let width = self.state(0).len();
        let [mut first, mut inner, mut last] = [const { Vec::new() }; 3];
        for walk in self.walks() {
            let pairs = walk.chunks_exact(width).zip(walk.chunks_exact(width).skip(1));
            let change = |(a, b): (&f32, &f32)| (a - b) * (a - b);
            let lengths = pairs.map(|(from, to)| from.iter().zip(to).map(change).sum::<f32>());
            if let [begin, others @ .., end] = &lengths.collect::<Vec<_>>()[..] {
                first.push(*begin);
                inner.extend(others);
                last.push(*end);
            }
        }
        let usual = LEAP * LEAP * share(inner, 0.01)[1];
        usual > 0.0 && [first, last].into_iter().any(|edge| share(edge, 0.5)[0] > usual)
    }
}

/// Divides steps into parts.
fn parts<'a, 'b>(steps: &'a [NumberedStep<'b>]) -> Vec<&'a [NumberedStep<'b>]> {
    let most = steps.len().div_ceil(PARTS).max(PART_STEPS);
    let (mut parts, mut from) = (Vec::new(), 0);
    for at in 1..=steps.len() {
        let ends = steps.get(at).is_none_or(|next| next.0 != steps[at - 1].0);
        if at == steps.len() || at - from >= if ends { PART_STEPS } else { most } {
            parts.push(&steps[from..at]);
            from = at;
        }
    }
    parts
}

/// Says where the odd parts of a file are, unless it is nearly everywhere.
fn place<'a>(odd: impl Iterator<Item = &'a [NumberedStep<'a>]>, share: f64) -> String {
    let mut groups: Vec<[usize; 2]> = Vec::new();
    for part in odd {
        let [first, last] = [part[0].0, part[part.len() - 1].0];
        match groups.last_mut().filter(|group| first <= group[1] + 1) {
            Some(group) => group[1] = last,
            None => groups.push([first, last]),
        }
    }
    let name = |[first, last]: &[usize; 2]| {
        if first == last { first.to_string() } else { format!("{first} to {last}") }
    };
    let named = groups.iter().take(NAMED).map(name).collect::<Vec<_>>().join(", ");
    let (percent, more) = (100.0 * share, if groups.len() > NAMED { " and others" } else { "" });
    let place = format!("in {percent:.0} % of the steps (episodes {named}{more}): ");
    Some(place).filter(|_| share < ALL).unwrap_or_default()
}
