//! Says why steps may not be what they should: recorded ones that are damaged or of another world, and
//! those of a world that no longer does what it did.

use super::dataset::Dataset;
use crate::env::{Agreement, Environment, FirstLook, Recorded, RecordedStep, Spec, share};

/// Most steps of a file that are looked at.
const MOST_STEPS: usize = 200_000;

/// A file is judged in parts of whole episodes, with at least this number of steps together, or else of
/// at most this share of all.
const PART_STEPS: usize = 20;
const PARTS: usize = 10;

/// Share of the steps, in parts that are odd, from which on something is said; and from which on all are
/// meant.
const SOME: f64 = 0.1;
const MOST: f64 = 0.5;
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

/// Agents' steps that are judged together while a run acts.
const JUDGED_STEPS: usize = 1_000;

/// What is judged by a world's first look, from which share of the steps on, and what is said then.
const CHECKS: [(Check, f64); 5] =
    [(outside, 0.0), (far, MOST), (long, SOME), (short, MOST), (otherwise, SOME)];

type Check = fn(&Judge, &[Step]) -> Option<String>;

/// A step and its episode.
type Step<'a> = (usize, RecordedStep<'a>);

struct Judge<'a> {
    spec: &'a Spec,
    look: FirstLook<'a>,
}

fn outside(judge: &Judge, steps: &[Step]) -> Option<String> {
    judge.look.columns.iter().enumerate().find_map(|(i, column)| {
        let [low, high] = *judge.look.bounds.get(*column)?;
        let [low, high] = [low.unwrap_or(f32::MIN), high.unwrap_or(f32::MAX)];
        let margin = BEYOND * low.abs().min(high.abs()).max(1.0);
        let mut values = steps.iter().map(|(_, [state, ..])| state[i]);
        let value = values.find(|v| !(low - margin..=high + margin).contains(v))?;
        Some(format!("component {i} is {value}, which its space does not contain"))
    })
}

fn far(judge: &Judge, steps: &[Step]) -> Option<String> {
    let Spec { state_centre, state_half_range, achieved, .. } = judge.spec;
    let is_far = |i: usize, v: f32| (v - state_centre[i]).abs() > FAR * state_half_range[i];
    let far = achieved.iter().find(|i| {
        2 * steps.iter().filter(|(_, [state, ..])| is_far(**i, state[**i])).count() > steps.len()
    });
    far.map(|i| format!("component {i} is mostly far from all goals and starts"))
}

/// Returns the components that actions move at once, as others may be of an object that lies still
/// until it is pushed, each with how much a step typically changes it and random ones do.
fn changes(judge: &Judge, steps: &[Step]) -> Vec<(usize, [f32; 2])> {
    let moved = |i: usize| {
        let changes = steps.iter().map(|(_, [from, _, to])| (to[i] - from[i]).abs());
        (i, [share(changes.collect(), 1.0 - TYPICAL)[1], judge.spec.change_scale[i]])
    };
    judge.look.effects.iter().map(|effect| moved(effect.component)).collect()
}

fn long(judge: &Judge, steps: &[Step]) -> Option<String> {
    let changes = changes(judge, steps);
    changes.into_iter().find(|(_, [now, usual])| *now > LONG * usual).map(changed)
}

fn short(judge: &Judge, steps: &[Step]) -> Option<String> {
    let changes = changes(judge, steps);
    let are_short = changes.iter().all(|(_, [now, usual])| *now < SHORT * usual);
    changes.into_iter().next().filter(|_| are_short).map(changed)
}

fn otherwise(judge: &Judge, steps: &[Step]) -> Option<String> {
    let mut agreement = Agreement::default();
    steps.iter().for_each(|(_, step)| agreement.add(judge.look.effects, *step));
    let said = "actions do not lead where they lead here: rows may be shifted or reversed, actions \
                negated or in another order";
    agreement.is_lost().then(|| said.to_owned())
}

/// Says that actions seem to be in the environment's own unit.
fn unscaled(judge: &Judge, steps: &[Step]) -> Option<String> {
    let bounds = judge.look.low.iter().zip(judge.look.high).enumerate();
    let narrow: Vec<(usize, [f32; 2])> = bounds
        .filter_map(|(i, (low, high))| Some((i, [(*low)?, (*high)?])))
        .filter(|(_, [low, high])| *low >= -1.0 && *high <= 1.0 && high - low < NARROW)
        .collect();
    let fill = |(i, [low, high]): &(usize, [f32; 2])| {
        let [least, most] =
            share(steps.iter().map(|(_, [_, action, _])| action[*i]).collect(), 0.0);
        let is_within = least >= low - BEYOND && most <= high + BEYOND;
        is_within && most - least > REACHED * (high - low)
    };
    let (i, [low, high]) = narrow.first().filter(|_| narrow.iter().all(fill))?;
    Some(format!(
        "its actions seem to be unscaled: component {i} stays within the environment's bounds, {low} to \
         {high}, which 1 and -1 stand for"
    ))
}

fn changed((i, [now, usual]): (usize, [f32; 2])) -> String {
    format!("a step changes component {i} by {now}, and by {usual} in random steps")
}

impl Dataset {
    /// Says why its steps may not be of `world`, or are not what they should be.
    pub fn doubts(&self, world: &dyn Environment) -> Vec<String> {
        let steps = self.steps(MOST_STEPS);
        let mut said = Vec::new();
        if let Some(look) = world.abilities().recorded.and_then(Recorded::first_look) {
            let judge = Judge { spec: world.spec(), look };
            let parts = parts(&steps);
            for (check, least) in CHECKS {
                let odd = parts.iter().filter_map(|part| Some((*part, check(&judge, part)?)));
                let odd: Vec<_> = odd.collect();
                let count = odd.iter().map(|(part, _)| part.len()).sum::<usize>();
                let share = count as f64 / steps.len() as f64;
                if let Some((_, text)) = odd.first().filter(|_| share > least) {
                    let place = if share < ALL { place(&odd, share) } else { String::new() };
                    said.push(format!("{place}{text}"));
                }
            }
            said.extend(unscaled(&judge, &steps));
        }
        let is_same = |(_, [_, action, _]): &Step| *action == steps[0].1[1];
        let all = self.source().transitions;
        let others = [
            (
                self.ends_are_off(),
                "most episodes begin or end with a leap: ends may be a row off".into(),
            ),
            (steps.iter().all(is_same), "all its actions are the same".into()),
            (
                self.is_endless,
                format!("no row ends an episode: all {all} transitions are taken for one"),
            ),
        ];
        said.extend(others.into_iter().filter_map(|(is_so, text)| is_so.then_some(text)));
        said
    }

    /// Whether most first or most last steps of episodes lead farther than hardly any other: from one
    /// episode to the next.
    fn ends_are_off(&self) -> bool {
        let width = self.state(0).len();
        let [mut first, mut inner, mut last] = [const { Vec::new() }; 3];
        for walk in self.walks() {
            let pairs = walk.chunks_exact(width).zip(walk.chunks_exact(width).skip(1));
            let change = |(a, b): (&f32, &f32)| (a - b) * (a - b);
            let lengths =
                pairs.map(|(from, to)| from.iter().zip(to).map(change).sum::<f32>().sqrt());
            if let [begin, others @ .., end] = &lengths.collect::<Vec<_>>()[..] {
                first.push(*begin);
                inner.extend(others);
                last.push(*end);
            }
        }
        let usual = share(inner, 0.01)[1];
        usual > 0.0 && [first, last].into_iter().any(|edge| share(edge, 0.5)[0] > LEAP * usual)
    }
}

/// Divides steps into parts.
fn parts<'a, 'b>(steps: &'a [Step<'b>]) -> Vec<&'a [Step<'b>]> {
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

/// Says where the odd parts of a file are.
fn place(odd: &[(&[Step], String)], share: f64) -> String {
    let mut groups: Vec<[usize; 2]> = Vec::new();
    for (part, _) in odd {
        let [first, last] = [part[0].0, part[part.len() - 1].0];
        match groups.last_mut().filter(|group| first <= group[1] + 1) {
            Some(group) => group[1] = last,
            None => groups.push([first, last]),
        }
    }
    let name = |[first, last]: &[usize; 2]| match last - first {
        0 => first.to_string(),
        _ => format!("{first} to {last}"),
    };
    let named: Vec<String> = groups.iter().take(NAMED).map(name).collect();
    let more = if groups.len() > NAMED { " and others" } else { "" };
    let (percent, named) = ((100.0 * share).round(), named.join(", "));
    format!("in {percent} % of the steps (episodes {named}{more}): ")
}

/// Watches whether actions still do what they did in the first look.
#[derive(Debug, Default)]
pub(super) struct EffectWatch {
    recent: Agreement,
    /// The step since which they have not, in all that has been judged since.
    odd_since: Option<u64>,
    has_said: bool,
}

impl EffectWatch {
    /// Adds what agents do in a round of steps, which `begins` at that step of the run; says, once, that
    /// their actions have no effect any more.
    pub fn note(
        &mut self,
        world: &dyn Environment,
        (before, actions): (&[f32], &[f32]),
        begins: u64,
    ) -> Option<String> {
        let look = world.abilities().recorded.and_then(Recorded::first_look)?;
        let (s, a) = (world.spec().state_dim(), world.spec().action_dim);
        let moves = before.chunks_exact(s).zip(world.states().chunks_exact(s));
        for ((from, to), action) in moves.zip(actions.chunks_exact(a)) {
            self.recent.add(look.effects, [from, action, to]);
        }
        if self.recent.steps < JUDGED_STEPS {
            return None;
        }
        let Agreement { steps, has_moved, .. } = self.recent;
        let is_odd = !has_moved || self.recent.is_lost();
        self.recent = Agreement::default();
        let began = begins.saturating_sub(steps as u64);
        if !is_odd {
            self.odd_since = None;
            return None;
        }
        // Once may be chance.
        let Some(since) = self.odd_since else {
            self.odd_since = Some(began);
            return None;
        };
        if std::mem::replace(&mut self.has_said, true) {
            return None;
        }
        let what =
            if has_moved { "actions no longer lead where they led" } else { "nothing moves" };
        let since = crate::text::grouped(since);
        Some(format!("warning: {}: {what} since about step {since}", world.title()))
    }
}
