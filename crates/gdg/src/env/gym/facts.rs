//! Finds out what the learner needs to know of an environment: which part of the state is achieved,
//! the scales of states and steps, the goals that there are, and when one is reached.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::Result;
use super::worker::{EnvDescription, GymWorker};
use crate::env::{
    DirectEffect, MAX_MAGNITUDE, RecordedStep, Spec, Walls, contact, direct_effects, share,
};
use crate::store::StoreError;

/// Episodes begun to see starts and goals.
const RESETS: usize = 256;

/// Episodes of random actions, their length, and how long an action is held on average: what is
/// typical of exploration.
const WALKS: usize = 8;
const WALK_STEPS: u32 = 50;
const HOLD_STEPS: f32 = 6.0;

/// Share of the numbers seen that lie below the range of a component, and above.
const TAIL: f64 = 0.01;

/// Goals within each free cell of a maze, along either side.
const GOALS_PER_SIDE: u32 = 3;

/// A range is wider than what was seen of it by this factor.
const MARGIN: f32 = 1.5;

/// A component whose numbers differ by less than this share of their size is constant; the size is at least
/// 1, or this many goal radii where that is less.
const CONSTANT: f32 = 1e-6;
const UNIT_RADII: f32 = 1e4;

/// Share of the steps that change a component by less than its typical change.
const TYPICAL: f64 = 0.9;

/// What random actions hardly move may move later, once an agent gets hold of it: half its range is
/// taken to be at least this share of the median one, or for a goal at least a goal radius; its
/// typical change at least these shares of half its range, or of the goal radius.
const LEAST_RANGE: f32 = 0.1;
const LEAST_CHANGE: f32 = 0.01;
const LEAST_CHANGE_RADII: f32 = 0.05;

/// What is achieved has rested if its typical change is less than this share of the least one: once an
/// agent moves it, a step does so by about this many goal radii.
const RESTS: f32 = 0.1;
const TOUCHED_CHANGE_RADII: f32 = 0.5;

/// Scales of a first look stand up to this multiple of them.
const OUTGROWN: f32 = 2.0;

/// Networks read grids of goal spaces of at most three dimensions that are at least this many goal
/// radii across: smaller ones are learned faster without.
const POSITIONS_RADII: f32 = 12.0;

/// Steps of a walk with other actions, and again whenever a run is resumed: its environment is another
/// one where they lead elsewhere, by this share of what a step changes.
const TRIED_STEPS: u32 = 25;
const ELSEWHERE: f32 = 0.5;

/// A goal radius spans at least this many steps of single precision.
const LEAST_RESOLVED: f32 = 16.0;

/// What has been found out. A checkpoint keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnvFacts {
    pub spec: Spec,
    /// Which number of a row is each component of the state.
    pub columns: Vec<usize>,
    /// Which number of a desired goal is each component of the goal.
    pub goal_columns: Vec<usize>,
    /// Goals that the environment has asked for, `(goals, goal_dim)`.
    pub goals: Vec<f32>,
    /// What actions have moved at once, and the row that a short walk leads to.
    #[serde(default)]
    pub effects: Vec<DirectEffect>,
    #[serde(default)]
    pub led_to: Vec<f32>,
}

impl EnvFacts {
    /// Returns the walls of the maze, if there is one and goals are positions in it.
    pub fn maze_of<'a>(&self, about: &'a EnvDescription) -> Option<&'a Walls> {
        about.maze.as_ref().filter(|_| self.goal_columns.starts_with(&[0, 1]))
    }

    /// Takes the ranges and typical changes of states from `walks`, `(steps, state_dim)` each, where
    /// they are more than [`OUTGROWN`] times those of the first look; returns whether any is. What
    /// only deliberate actions move hardly moves in a first look: an object that has to be pushed, a
    /// key that is found once in many episodes. The range of goals is known.
    pub fn rescale(&mut self, walks: &[&[f32]], beside_goal: bool) -> bool {
        let (s, spec) = (self.spec.state_dim(), &mut self.spec);
        let mut has_changed = false;
        for i in 0..s {
            if beside_goal && spec.achieved.contains(&i) {
                continue;
            }
            let column = |walk: &[f32]| walk.iter().skip(i).step_by(s).copied().collect::<Vec<_>>();
            let numbers: Vec<f32> = walks.iter().flat_map(|walk| column(walk)).collect();
            // A component that seldom changes has no range but the whole one.
            let mut ranges = [TAIL, 0.0].into_iter().map(|tail| share(numbers.clone(), tail));
            let range = ranges.find(|[low, high]| high > low).unwrap_or_default();
            let [centre, half] =
                [0.5 * (range[0] + range[1]), 0.5 * MARGIN * (range[1] - range[0])];
            let is_constant = is_constant(half, centre, spec.goal_radius);
            if !spec.achieved.contains(&i)
                && !is_constant
                && half > OUTGROWN * spec.state_half_range[i]
            {
                (spec.state_centre[i], spec.state_half_range[i]) = (centre, half);
                has_changed = true;
            }
            // The mean change, weighted by itself: steps in which it rests do not count.
            let (mut sum, mut squares) = (0.0, 0.0);
            for walk in walks {
                for pair in column(walk).windows(2) {
                    let change = f64::from((pair[1] - pair[0]).abs());
                    (sum, squares) = (sum + change, squares + change * change);
                }
            }
            let change = if sum > 0.0 { (squares / sum) as f32 } else { 0.0 };
            if spec.state_half_range[i] > 0.0 && change > OUTGROWN * spec.change_scale[i] {
                spec.change_scale[i] = change;
                has_changed = true;
            }
        }
        contact::refine(spec, walks) || has_changed
    }

    /// Says where a short walk leads now if that is elsewhere than when this was found out, and not by
    /// chance.
    pub fn leads_elsewhere(&self, worker: &mut GymWorker) -> Result<Option<String>> {
        if self.led_to.is_empty() {
            return Ok(None);
        }
        let (first, second) = (try_again(worker, 1.0)?, try_again(worker, 1.0)?);
        let (was, is) = (&self.led_to, &second[second.len() - 1]);
        let scales = self.spec.change_scale.iter().zip(&self.columns).enumerate();
        let mut off = scales.filter(|(_, (scale, column))| {
            let rounding = CONSTANT * was[**column].abs().max(1.0);
            (is[**column] - was[**column]).abs() > ELSEWHERE * **scale + rounding
        });
        Ok(off.next().filter(|_| first == second).map(|(i, (_, column))| {
            let (was, is) = (was[*column], is[*column]);
            format!("the same actions lead elsewhere than when the run began: component {i} is {is}, not {was}")
        }))
    }

    /// Checks what a checkpoint has kept, with a description.
    pub fn check(&self, about: &EnvDescription) -> Result<(), StoreError> {
        let (spec, within) = (&self.spec, |v: &f32| v.abs() <= MAX_MAGNITUDE);
        let (s, g) = (spec.state_dim(), spec.goal_dim());
        let scales = [&spec.state_centre, &spec.state_half_range, &spec.change_scale];
        let sound = about.is_sound()
            && s > 0
            && g > 0
            && scales.iter().all(|scale| scale.len() == s && scale.iter().all(within))
            && spec.state_half_range.iter().chain(&spec.change_scale).all(|v| *v >= 0.0)
            && spec.achieved.iter().all(|i| *i < s)
            && spec.contacts.iter().all(|contact| contact.fits(spec))
            && spec.goal_radius > 0.0
            && within(&spec.goal_radius)
            && self.columns.len() == s
            && self.goal_columns.len() == g
            && spec.position_scale.is_none_or(|scale| scale > 0.0 && within(&scale))
            && self.goals.len() >= g
            && self.goals.len().is_multiple_of(g)
            && self.goals.iter().all(within)
            && self.columns.iter().all(|column| *column < about.row())
            && self.goal_columns.iter().all(|column| *column < about.goal)
            && spec.action_dim == about.low.len()
            && self.effects.iter().all(|effect| effect.fits(s, spec.action_dim))
            && [0, about.row()].contains(&self.led_to.len());
        StoreError::unless(sound, "what it stores of its world is inconsistent")
    }
}

/// What has been seen of an environment.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Rows at the starts of episodes.
    pub starts: Vec<Vec<f32>>,
    /// Desired goals of the same episodes.
    pub goals: Vec<Vec<f32>>,
    pub walks: Vec<Vec<Vec<f32>>>,
    /// The actions between them.
    pub actions: Vec<Vec<Vec<f32>>>,
}

/// Finds out what the learner needs. `goal` and `radius` may be given: the components of the
/// observation that are the goal, and the distance below which one is reached.
pub fn find(
    worker: &mut GymWorker,
    goal: Option<&[usize]>,
    radius: Option<f32>,
) -> Result<(EnvFacts, Vec<String>)> {
    let (mut rng, about) = (ChaCha8Rng::seed_from_u64(0), &worker.about.clone());
    let mut seen = Seen::default();
    for i in 0..RESETS {
        let task = about.tasks.map(|tasks| 1 + i as u32 % tasks);
        let (row, goal) = worker.reset(0, rng.random(), task)?;
        seen.starts.push(row);
        seen.goals.push(goal);
    }
    for _ in 0..WALKS {
        let [rows, actions] = walk(worker, &mut rng, (WALK_STEPS, 1.0))?;
        seen.walks.push(rows);
        seen.actions.push(actions);
    }
    let [tried, others] = [1.0, -0.5].map(|size| try_again(worker, size));
    let (tried, others) = (tried?, others?);
    let columns = columns(&seen, about, goal).map_err(|why| worker.fail(why))?;
    let Some(radius) = radius.or(about.goal_radius) else {
        let problem = "does not say when a goal is reached: give --goal-radius".to_owned();
        return Err(worker.fail(problem));
    };
    let mut found = scales(&seen, about, columns, radius);
    let (said, reached) = reached_at_once(&seen, &found);
    let none_is_left = (reached == RESETS).then(|| said.clone());
    if let Some(why) = too_fine(&found.spec).or(none_is_left) {
        return Err(worker.fail(why));
    }
    let state = |row: &Vec<f32>| found.columns.iter().map(|column| row[*column]).collect();
    let states = seen.walks.iter().map(|rows| rows.iter().map(state).collect::<Vec<Vec<f32>>>());
    let states: Vec<_> = states.collect();
    let walks = states.iter().zip(&seen.actions);
    let steps = walks.flat_map(|(states, actions)| states.windows(2).zip(actions));
    let steps: Vec<RecordedStep> = steps.map(|(pair, a)| [&pair[0][..], a, &pair[1]]).collect();
    (found.effects, found.led_to) = (direct_effects(&steps), tried[tried.len() - 1].clone());
    let [ends, still, idle] = [
        (steps.len() <= WALKS, "every episode ends with its first step"),
        (
            steps.iter().all(|[from, _, to]| from == to),
            "nothing has moved in the random steps of the first look",
        ),
        (tried == others, "its actions have no effect: others lead to the same observations"),
    ]
    .map(|(is_so, text)| is_so.then(|| text.to_owned()));
    let idle = idle.filter(|_| still.is_none());
    let said = (2 * reached > RESETS).then_some(said);
    Ok((found, [said, ends, still, idle].into_iter().flatten().collect()))
}

/// Walks as at the end of the first look; returns the rows.
fn try_again(worker: &mut GymWorker, size: f32) -> Result<Vec<Vec<f32>>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    walk(worker, &mut rng, (TRIED_STEPS, size)).map(|[rows, _]| rows)
}

/// Says how many goals are reached where their episodes begin.
fn reached_at_once(seen: &Seen, found: &EnvFacts) -> (String, usize) {
    let EnvFacts { spec, columns, goal_columns, .. } = found;
    let pick = |all: &[f32], of: &[usize]| of.iter().map(|i| all[*i]).collect::<Vec<_>>();
    let pairs = seen.starts.iter().zip(&seen.goals);
    let pairs = pairs.map(|(start, goal)| (pick(start, columns), pick(goal, goal_columns)));
    let reached = pairs.filter(|(start, goal)| spec.reached(start, goal)).count();
    let (all, radius) = (seen.starts.len(), spec.goal_radius);
    let text = format!(
        "{reached} of {all} goals are reached at the start: the goal radius of {radius} is large for it \
         (--goal-radius sets another)"
    );
    (text, reached)
}

/// Says why single precision is too coarse for the goals, if it is.
fn too_fine(spec: &Spec) -> Option<String> {
    let size = |i: &usize| spec.state_centre[*i].abs() + spec.state_half_range[*i];
    let most = spec.achieved.iter().map(size).fold(0.0, f32::max);
    let resolved = most * f32::EPSILON;
    (spec.goal_radius < LEAST_RESOLVED * resolved).then(|| {
        format!(
            "its goals reach {most}, where single precision resolves {resolved}, and the goal radius \
             is {}: subtract an origin in the environment",
            spec.goal_radius
        )
    })
}

/// Walks at random for one episode, at most `most` steps, with actions up to `size`; returns the rows
/// and the actions between them.
fn walk(
    worker: &mut GymWorker,
    rng: &mut ChaCha8Rng,
    (most, size): (u32, f32),
) -> Result<[Vec<Vec<f32>>; 2]> {
    let mut actions = Vec::new();
    let mut rows = vec![worker.reset(0, rng.random(), None)?.0];
    let mut action = vec![0.0; worker.about.low.len()];
    for i in 0..worker.about.episode_steps().map_or(most, |limit| limit.min(most)) {
        if i == 0 || rng.random::<f32>() < 1.0 / HOLD_STEPS {
            action.fill_with(|| size * rng.random_range(-1.0..=1.0));
        }
        let next = worker.step(&action)?;
        let has_ended = next.iter().any(|(_, ended, _)| *ended);
        rows.extend(next.into_iter().map(|(row, ..)| row));
        actions.push(action.clone());
        if has_ended {
            break;
        }
    }
    Ok([rows, actions])
}

/// The columns of a row that form the state, which components of the state are achieved, and which
/// of a desired goal they are to equal.
type Columns = (Vec<usize>, Vec<usize>, Vec<usize>);

/// Finds the achieved goal within the observation, where it takes the place of what is observed; what
/// is not found there is added to the state.
/// `given` are the components that are the goal where that is in `info`; by default, the first two.
fn columns(
    seen: &Seen,
    about: &EnvDescription,
    given: Option<&[usize]>,
) -> Result<Columns, String> {
    if about.achieved == 0 {
        let first = about.usual_goal();
        let own = given.unwrap_or(&first);
        let is_wrong = |i: &usize| own[*i] >= about.observed || own[..*i].contains(&own[*i]);
        if let Some(i) = (0..own.len()).find(is_wrong) {
            let (wrong, last) = (own[i], about.observed - 1);
            return Err(format!("--goal {wrong}: give components 0 to {last}, each once"));
        }
        // A goal is an observation, or only what has to be achieved of one.
        let of_goal = if about.goal == about.observed {
            own.to_vec()
        } else if about.goal == own.len() {
            (0..own.len()).collect()
        } else {
            let (goal, own) = (about.goal, own.len());
            return Err(format!("its goals have {goal} components, but --goal names {own}"));
        };
        return Ok(((0..about.observed).collect(), own.to_vec(), of_goal));
    }
    if given.is_some() {
        return Err("--goal is for environments without an achieved_goal: it has one".to_owned());
    }
    let rows = || seen.starts.iter().chain(seen.walks.iter().flatten());
    let mut columns: Vec<usize> = (0..about.observed).collect();
    let mut achieved: Vec<usize> = Vec::new();
    for own in about.observed..about.row() {
        // What never changed may be equal to anything that never did.
        let varies = rows().any(|row| row[own] != seen.starts[0][own]);
        let is_same = |column: &usize| varies && rows().all(|row| row[*column] == row[own]);
        let after_last = achieved.last().map_or(0, |last| last + 1);
        let mut likely = (after_last..about.observed).chain(0..after_last.min(about.observed));
        let found = likely.find(|column| !achieved.contains(column) && is_same(column));
        let place = found.unwrap_or(columns.len());
        // The goal itself, as what is observed may differ from it later.
        match found {
            Some(column) => columns[column] = own,
            None => columns.push(own),
        }
        achieved.push(place);
    }
    Ok((columns, achieved, (0..about.goal).collect()))
}

/// Computes scales from what has been seen.
fn scales(
    seen: &Seen,
    about: &EnvDescription,
    (columns, achieved, goal_columns): Columns,
    goal_radius: f32,
) -> EnvFacts {
    let pick = |numbers: &[f32], columns: &[usize]| -> Vec<f32> {
        columns.iter().map(|column| numbers[*column]).collect()
    };
    let mut goals: Vec<Vec<f32>> =
        seen.goals.iter().map(|goal| pick(goal, &goal_columns)).collect();
    if about.tasks.is_some() {
        // A few tasks show a few goals; where the others begin can be reached as well, and so can
        // all of a maze.
        goals.extend(seen.starts.iter().map(|row| pick(&pick(row, &columns), &achieved)));
        let maze = about.maze.iter().filter(|_| goal_columns == [0, 1]);
        goals.extend(maze.flat_map(|maze| maze.free_points(GOALS_PER_SIDE)).map(Vec::from));
    }
    let mut spec = Spec {
        state_centre: Vec::new(),
        state_half_range: Vec::new(),
        change_scale: Vec::new(),
        action_dim: about.low.len(),
        goal_radius,
        position_scale: None,
        contacts: Vec::new(),
        time_limit: about.episode_steps(),
        achieved,
    };
    for (i, column) in columns.iter().enumerate() {
        let rows = seen.starts.iter().chain(seen.walks.iter().flatten());
        let walked = share(rows.map(|row| row[*column]).collect(), TAIL);
        let of_goals = spec.achieved.iter().position(|own| *own == i).map(|j| {
            let starts = seen.starts.iter().map(|row| row[*column]);
            share(goals.iter().map(|goal| goal[j]).chain(starts).collect(), 0.0)
        });
        // Where no goal is, agents need not go, however far a random walk leads.
        let range = of_goals.filter(|[low, high]| high > low).unwrap_or(walked);
        let [centre, half] = [0.5 * (range[0] + range[1]), 0.5 * (range[1] - range[0])];
        let is_constant = is_constant(half, centre, goal_radius);
        let changes = seen.walks.iter().flat_map(|walk| walk.windows(2));
        let changes = changes.map(|pair| (pair[1][*column] - pair[0][*column]).abs()).collect();
        spec.state_centre.push(centre);
        spec.state_half_range.push(if is_constant { 0.0 } else { MARGIN * half });
        spec.change_scale.push(if is_constant { 0.0 } else { share(changes, 1.0 - TYPICAL)[1] });
    }
    widen(&mut spec);
    let widest = spec.achieved.iter().map(|i| spec.state_half_range[*i]).fold(0.0, f32::max);
    let are_positions =
        spec.goal_dim() <= 3 && 2.0 * widest >= POSITIONS_RADII * MARGIN * spec.goal_radius;
    let mut found = EnvFacts {
        spec,
        columns,
        goal_columns,
        goals: goals.concat(),
        effects: Vec::new(),
        led_to: Vec::new(),
    };
    // Grids that are far finer than a maze learn noise, on which actors stand still.
    let cell = found.maze_of(about).map_or(goal_radius, Walls::cell_size);
    found.spec.position_scale = are_positions.then_some(cell);
    found
}

/// Whether a component that varies by `half` around `centre` is constant.
fn is_constant(half: f32, centre: f32, goal_radius: f32) -> bool {
    half <= CONSTANT * centre.abs().max((UNIT_RADII * goal_radius).min(1.0))
}

/// Widens ranges and typical changes of what hardly moved, but of constant components.
fn widen(spec: &mut Spec) {
    let mut ranges: Vec<f32> =
        spec.state_half_range.iter().copied().filter(|half| *half > 0.0).collect();
    ranges.sort_by(f32::total_cmp);
    let median = ranges.get(ranges.len() / 2).copied().unwrap_or(0.0);
    let scales = spec.state_half_range.iter_mut().zip(&mut spec.change_scale).enumerate();
    for (i, (half, change)) in scales.filter(|(_, (half, _))| **half > 0.0) {
        let [least_range, least_change] = if spec.achieved.contains(&i) {
            [MARGIN, LEAST_CHANGE_RADII].map(|radii| radii * spec.goal_radius)
        } else {
            [LEAST_RANGE * median, LEAST_CHANGE * half.max(LEAST_RANGE * median)]
        };
        *half = half.max(least_range);
        let rests = spec.achieved.contains(&i) && *change < RESTS * least_change;
        let least_change =
            if rests { TOUCHED_CHANGE_RADII * spec.goal_radius } else { least_change };
        *change = change.max(least_change);
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::env::MOST_HALF_RANGES;
    use crate::env::tests::positions;

    pub fn description(observed: usize, achieved: usize, goal: usize) -> EnvDescription {
        EnvDescription {
            observed,
            achieved,
            goal,
            low: vec![Some(-1.0)],
            high: vec![Some(1.0)],
            ..EnvDescription::default()
        }
    }

    /// Rows of which the last two numbers are achieved: the third observed, and one apart.
    fn seen() -> Seen {
        let row = |i: u16| {
            let t = f32::from(i);
            vec![0.5, t, 3.0 * t, 7.0, 3.0 * t, -t]
        };
        let rows: Vec<Vec<f32>> = (0..101).map(row).collect();
        let goals = (0..5).map(|i| vec![60.0 * f32::from(i as u8), -10.0]).collect();
        Seen { starts: rows[..2].to_vec(), goals, walks: vec![rows], actions: Vec::new() }
    }

    #[test]
    fn what_is_achieved_is_found_in_the_observation_added_to_the_state_or_given() {
        let found = columns(&seen(), &description(4, 2, 2), None);
        assert_eq!(found, Ok((vec![0, 1, 4, 3, 5], vec![2, 4], vec![0, 1])));
        // A goal in info is the first two numbers or those given; a shorter one is only what has to be
        // achieved.
        let all = vec![0, 1, 2, 3];
        for (goal, given, achieved, of_goal) in [
            (4, None, [0, 1], [0, 1]),
            (4, Some(&[3, 2][..]), [3, 2], [3, 2]),
            (2, Some(&[2, 3]), [2, 3], [0, 1]),
        ] {
            let found = columns(&Seen::default(), &description(4, 0, goal), given);
            assert_eq!(found, Ok((all.clone(), achieved.to_vec(), of_goal.to_vec())));
        }
        for (seen, about, given, why) in [
            (seen(), description(4, 2, 2), &[0][..], "--goal is for environments without"),
            (Seen::default(), description(4, 0, 2), &[2], "--goal names 1"),
            (Seen::default(), description(4, 0, 4), &[4], "components 0 to 3, each once"),
            (Seen::default(), description(4, 0, 2), &[1, 1], "components 0 to 3, each once"),
        ] {
            assert!(columns(&seen, &about, Some(given)).is_err_and(|found| found.contains(why)));
        }
        // What never changed is not looked for in the observation.
        let rows: Vec<Vec<f32>> = (0..9).map(|i| vec![f32::from(i as u8), 0.0, 0.0]).collect();
        let still = Seen { starts: rows, ..Seen::default() };
        let found = columns(&still, &description(2, 1, 1), None);
        assert_eq!(found, Ok((vec![0, 1, 2], vec![2], vec![0])));
    }

    #[test]
    fn goals_that_single_precision_cannot_tell_apart_are_refused() {
        let utm = Spec { goal_radius: 0.1, ..positions(&[(5e5, 100.0), (5.4e6, 100.0)]) };
        assert!(too_fine(&utm).is_some_and(|why| why.contains("subtract an origin")));
        assert_eq!(too_fine(&Spec { goal_radius: 20.0, ..utm }), None);
    }

    #[test]
    fn recorded_walks_give_the_scales_of_what_a_first_look_hardly_moves() {
        let (seen, about) = (seen(), description(4, 2, 2));
        let columns = columns(&seen, &about, None).expect("columns");
        let mut found = scales(&seen, &about, columns, 2.0);
        let first = found.clone();
        // Walks like those of the first look change nothing.
        let row = |i: u16| [0.5, f32::from(i), 3.0 * f32::from(i), 7.0, -f32::from(i)];
        let walk: Vec<f32> = (0..101).flat_map(row).collect();
        assert!(!found.rescale(&[&walk], false));
        assert_eq!(found, first);
        // In one step of a hundred, a constant turns to 1 and what is achieved moves by 40, which
        // does not widen the range of goals.
        let key = |i: u16| {
            let on = f32::from(u8::from(i > 50));
            [0.5, f32::from(i), 120.0, 7.0 + on, -40.0 * on]
        };
        let walk: Vec<f32> = (0..101).flat_map(key).collect();
        // Once training has begun, the goal keeps its scales.
        let mut beside = found.clone();
        assert!(beside.rescale(&[&walk, &walk], true));
        assert_eq!(beside.spec.change_scale[4], first.spec.change_scale[4]);
        assert!(found.rescale(&[&walk, &walk], false));
        let Spec { state_centre, state_half_range, change_scale, .. } = &found.spec;
        assert_eq!(
            (state_centre[3], state_half_range[3], change_scale[3]),
            (7.5, MARGIN * 0.5, 1.0)
        );
        assert_eq!((state_half_range[4], change_scale[4]), (first.spec.state_half_range[4], 40.0));
        assert_eq!(change_scale[1], first.spec.change_scale[1]);
        assert_eq!(beside.spec.state_half_range, *state_half_range);
    }

    #[test]
    fn scales_are_those_of_the_goals_and_of_what_a_walk_meets() {
        let (seen, about) = (seen(), description(4, 2, 2));
        let columns = columns(&seen, &about, None).expect("columns");
        let found = scales(&seen, &about, columns.clone(), 2.0);
        let spec = &found.spec;
        // Goals from 0 to 240, starts at 0 and 3; beside them, 103 numbers from 0, 0, 1, 1, 2 to
        // 100, without the lowest and the highest.
        assert_eq!((spec.state_centre[2], spec.state_half_range[2]), (120.0, MARGIN * 120.0));
        assert_eq!((spec.state_centre[1], spec.state_half_range[1]), (49.5, MARGIN * 49.5));
        assert_eq!((spec.state_half_range[0], spec.change_scale[0]), (0.0, 0.0), "constant");
        assert_eq!((spec.change_scale[1], spec.change_scale[2]), (1.0, 3.0));
        assert_eq!(spec.position_scale, Some(spec.goal_radius), "240 is more than 12 radii");
        assert_eq!(found.check(&about), Ok(()));
        assert_eq!(about.changes_since(&about), Ok(Vec::new()));
        // In a unit of a billion.
        let unit = 1e-9;
        let change = |rows: &mut Vec<f32>| rows.iter_mut().for_each(|v| *v *= unit);
        let mut seen = seen;
        seen.starts.iter_mut().chain(&mut seen.goals).chain(&mut seen.walks[0]).for_each(change);
        let small = scales(&seen, &about, columns, 2.0 * unit).spec;
        assert!((small.state_half_range[2] / (MARGIN * 120.0 * unit) - 1.0).abs() < 1e-3);
        assert!((small.change_scale[1] / unit - 1.0).abs() < 1e-3);
    }

    #[test]
    fn what_has_changed_since_a_run_was_saved_is_named() {
        let maze = |rows: &[&[bool]]| {
            let maze = serde_json::json!({"is_wall": rows, "first": [0, 0], "cell": [1, -1]});
            serde_json::from_value::<Walls>(maze).ok()
        };
        let about = EnvDescription {
            bounds: vec![[Some(-1.0), None]],
            maze: maze(&[&[true, false]]),
            ..description(4, 2, 2)
        };
        let is = || about.clone();
        for (is, goes_on, said) in [
            (EnvDescription { high: vec![Some(0.5)], ..is() }, false, "[0] was 1.0 and is 0.5 now"),
            (EnvDescription { maze: maze(&[&[true]]), ..is() }, false, "was 2 long and is 1 long"),
            (EnvDescription { maze: maze(&[&[true; 2]]), ..is() }, true, "is_wall[0][1] was false"),
            (EnvDescription { bounds: vec![[None; 2]], ..is() }, true, "was -1.0 and is none now"),
        ] {
            let found = is.changes_since(&about);
            assert_eq!(found.is_ok(), goes_on, "{found:?}");
            let found = found.unwrap_or_else(|error| vec![error]);
            assert!(found.len() == 1 && found[0].contains(said), "{found:?}");
        }
    }

    #[test]
    fn what_random_actions_hardly_move_has_the_scale_of_the_rest() {
        let mut spec = Spec {
            state_centre: vec![0.0; 5],
            state_half_range: vec![1e-6, 3.0, 2.0, 0.0, 1e-4],
            change_scale: vec![1e-7, 1.0, 0.0, 0.0, 1e-5],
            achieved: vec![0],
            action_dim: 1,
            goal_radius: 0.5,
            position_scale: None,
            contacts: Vec::new(),
            time_limit: None,
        };
        widen(&mut spec);
        // Four components move, and 2.0 is the upper median of their ranges.
        assert_eq!(spec.state_half_range, [MARGIN * 0.5, 3.0, 2.0, 0.0, LEAST_RANGE * 2.0]);
        let least = LEAST_CHANGE * LEAST_RANGE * 2.0;
        assert_eq!(spec.change_scale, [TOUCHED_CHANGE_RADII * 0.5, 1.0, 0.02, 0.0, least]);
        spec.achieved = vec![2];
        // A slow component does not rest.
        spec.goal_radius = 2.0;
        widen(&mut spec);
        assert_eq!((spec.state_half_range[2], spec.change_scale[2]), (MARGIN * 2.0, 0.1));
        assert_eq!(spec.scaled(4, 1e3), MOST_HALF_RANGES, "far outside of what was seen");
    }
}
