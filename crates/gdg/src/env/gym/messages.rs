//! What a worker is asked for, and what it answers: a kind and a length, then that many bytes, all
//! little-endian. `worker.py` is the other side.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::process::Worker;
use crate::env::task::MAX_BUDGET_STEPS;
use crate::env::{EnvError, MAX_MAGNITUDE, Rendering, Walls};
use crate::text::grouped;

/// Bytes before the contents of a message.
pub const HEADER_BYTES: usize = 8;

/// Largest reply whose size is not known beforehand: descriptions and errors.
pub const MAX_TEXT_BYTES: usize = 1 << 20;

/// An action of environments that are left as they are.
pub const REST: f32 = f32::NAN;

/// What the program asks a worker to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Run this source, before all else.
    Source = 0,
    /// Import what is needed and describe the environment.
    Open = 1,
    /// Have at least this number of environments, which render if a second number is not 0.
    Make = 2,
    /// Begin an episode: of an environment, with a seed, of a task.
    Reset = 3,
    /// Step the first environments.
    Step = 4,
    /// Return the rewards of pairs of goals.
    Reward = 5,
    /// Return a picture of the first environment.
    Picture = 6,
}

/// The length of a reply that is expected, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expected {
    Exactly(usize),
    AtMost(usize),
}

/// Why the header of a reply is none: its kind is unknown, or its length cannot be expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadHeader {
    Kind(u32),
    Length(u32),
}

/// Returns a request with its header.
pub fn request(kind: Request, body: &[u8]) -> Vec<u8> {
    [&(kind as u32).to_le_bytes(), &(body.len() as u32).to_le_bytes(), body].concat()
}

/// Returns whether a reply is what was asked for, or says why it cannot be done, and the number of
/// bytes that follow. Memory is not taken before the length has been checked.
pub fn reply_header(
    header: [u8; HEADER_BYTES],
    expected: Expected,
) -> Result<(bool, usize), BadHeader> {
    let [kind, length] =
        [0, 4].map(|at| u32::from_le_bytes(std::array::from_fn(|i| header[at + i])));
    let (is_done, expected) = match kind {
        0 => (true, expected),
        1 => (false, Expected::AtMost(MAX_TEXT_BYTES)),
        other => return Err(BadHeader::Kind(other)),
    };
    let fits = match expected {
        Expected::Exactly(bytes) => length as usize == bytes,
        Expected::AtMost(bytes) => length as usize <= bytes,
    };
    if fits { Ok((is_done, length as usize)) } else { Err(BadHeader::Length(length)) }
}

/// What a worker says of its environment. A checkpoint keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Length of an observation.
    pub observed: usize,
    /// Length of the achieved goal that comes beside it; 0 if it is part of the observation.
    pub achieved: usize,
    /// Length of a desired goal.
    pub goal: usize,
    /// Lowest and highest action; `None` where there is no bound.
    pub low: Vec<Option<f32>>,
    pub high: Vec<Option<f32>>,
    /// Length of an episode, if it is limited.
    pub time_limit: Option<u64>,
    /// Number of tasks of its own, chosen by `task_id` from 1.
    pub tasks: Option<u32>,
    /// Distance below which a goal is reached, if it says so.
    pub goal_radius: Option<f32>,
    /// Whether it has `compute_reward`.
    pub has_reward: bool,
    /// The walls of its maze, if it has one; positions in it are a goal's first two numbers.
    pub maze: Option<Walls>,
    pub renders: bool,
    /// Versions of Python and of packages.
    pub versions: BTreeMap<String, String>,
}

impl Description {
    /// The length of a row: an observation and what is achieved.
    pub fn row(&self) -> usize {
        self.observed + self.achieved
    }

    /// The lengths of observations, of goals achieved beside them, and of goals desired.
    pub fn sizes(&self) -> [usize; 3] {
        [self.observed, self.achieved, self.goal]
    }

    /// Returns the lowest and the highest action of each component. Where a bound is missing, the
    /// range is as long as [-1, 1]; without both, it is that.
    fn action_bounds(&self) -> impl Iterator<Item = [f32; 2]> + Clone {
        self.low.iter().zip(&self.high).map(|bounds| match bounds {
            (Some(low), Some(high)) => [*low, high.max(*low)],
            (Some(low), None) => [*low, low + 2.0],
            (None, Some(high)) => [high - 2.0, *high],
            (None, None) => [-1.0, 1.0],
        })
    }

    /// Returns the length of an episode, unless it is none: longer than evaluations may be.
    pub fn episode_steps(&self) -> Option<u32> {
        let limit = u32::try_from(self.time_limit?).ok()?;
        (limit <= MAX_BUDGET_STEPS).then_some(limit)
    }

    /// Returns warnings for its users.
    pub fn warnings(&self) -> Vec<String> {
        let huge = self.time_limit.is_some() && self.episode_steps().is_none();
        let huge = huge.then(|| {
            let most = grouped(MAX_BUDGET_STEPS.into());
            format!("its time limit is ignored: episodes have at most {most} steps")
        });
        let mut bounds = self.low.iter().zip(&self.high);
        let unbounded = bounds.position(|(low, high)| low.is_none() || high.is_none());
        let unbounded = unbounded.zip(self.action_bounds().nth(unbounded.unwrap_or(0)));
        let unbounded = unbounded.map(|(at, [low, high])| {
            let component = format!("component {at} of its actions has no bounds, or only one");
            format!("{component}: actions stay from {low} to {high} there")
        });
        unbounded.into_iter().chain(huge).collect()
    }

    /// Whether the numbers make sense.
    pub fn is_sound(&self) -> bool {
        const MOST: usize = 4096;
        let sizes = [self.observed, self.goal, self.low.len()];
        sizes.iter().all(|size| (1..=MOST).contains(size))
            && [0, self.goal].contains(&self.achieved)
            && self.low.len() == self.high.len()
            && self.tasks.is_none_or(|tasks| (1..=1_000).contains(&tasks))
            && self.maze.as_ref().is_none_or(Walls::is_sound)
    }
}

/// How an episode begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Begun {
    /// The observation, and what is achieved.
    pub row: Vec<f32>,
    /// The desired goal.
    pub goal: Vec<f32>,
}

/// What a step leads to: a row, and whether the episode has ended.
pub type Stepped = (Vec<f32>, bool);

impl Worker {
    /// Opens the environment and describes it.
    pub fn open(&mut self, package: Option<&str>, id: &str) -> Result<Description, EnvError> {
        let config = serde_json::json!({ "package": package.unwrap_or_default(), "id": id });
        let expected = Expected::AtMost(MAX_TEXT_BYTES);
        let reply = self.ask(Request::Open, config.to_string().as_bytes(), expected)?;
        self.environments = 1;
        let found: Option<Description> = serde_json::from_slice(&reply).ok();
        found.filter(Description::is_sound).ok_or_else(|| {
            self.fail("its worker describes it in a way that makes no sense".to_owned())
        })
    }

    /// Creates environments until there are `count`. If they are to render, they all are new.
    pub fn make(&mut self, count: usize, renders: bool) -> Result<(), EnvError> {
        if renders {
            self.environments = 0;
        }
        // One by one, as the time limit is for each.
        while self.environments < count {
            let more = self.environments + 1;
            let numbers = [more as f64, f64::from(u8::from(renders && more == 1))];
            self.numbers(Request::Make, numbers, 0)?;
            self.environments = more;
        }
        Ok(())
    }

    /// Begins an episode in an environment: everything random in it follows from `seed`.
    pub fn reset(
        &mut self,
        about: &Description,
        environment: usize,
        seed: u32,
        task: Option<u32>,
    ) -> Result<Begun, EnvError> {
        let numbers = [environment as f64, f64::from(seed), task.map_or(-1.0, f64::from)];
        let reply = self.numbers(Request::Reset, numbers, about.row() + 1 + about.goal)?;
        let (row, goal) = reply.split_at(about.row() + 1);
        let (row, _) = self.checked(about, "reset", row)?;
        let goal: Vec<f32> = goal.iter().map(|v| *v as f32).collect();
        if goal.iter().all(|v| v.abs() <= MAX_MAGNITUDE) {
            return Ok(Begun { row, goal });
        }
        Err(self.fail("a goal that it asks for is not finite, or huge".to_owned()))
    }

    /// Steps the first environments by `actions`, `(environments, action_dim)`.
    pub fn step(&mut self, about: &Description, actions: &[f32]) -> Result<Vec<Stepped>, EnvError> {
        self.begin_step(about, actions)?;
        self.end_step(about, actions.len() / about.low.len())
    }

    /// Asks for a step, as [`Self::step`] does; [`Self::end_step`] returns its result. Actions lie
    /// in [-1, 1], or are [`REST`].
    pub fn begin_step(&mut self, about: &Description, actions: &[f32]) -> Result<(), EnvError> {
        let bounds = about.action_bounds().cycle();
        let actions = actions.iter().zip(bounds).map(|(a, to)| f64::from(scaled(*a, to)));
        self.send(Request::Step, &bytes(actions))
    }

    /// Returns the result of a step of `count` environments.
    pub fn end_step(
        &mut self,
        about: &Description,
        count: usize,
    ) -> Result<Vec<Stepped>, EnvError> {
        let length = about.row() + 1;
        let reply = self.answer(Request::Step, Expected::Exactly(8 * count * length))?;
        numbers(&reply).chunks(length).map(|row| self.checked(about, "step", row)).collect()
    }

    /// Returns the rewards for pairs of achieved and desired goals.
    pub fn rewards<const N: usize>(
        &mut self,
        achieved: [&[f64]; N],
        desired: [&[f64]; N],
    ) -> Result<Vec<f64>, EnvError> {
        self.numbers(Request::Reward, [achieved.concat(), desired.concat()].concat(), N)
    }

    /// Returns a picture of the first environment, of at most this width and height in pixels.
    pub fn picture(
        &mut self,
        goal: &[f32],
        (width, height): (usize, usize),
    ) -> Result<Rendering, EnvError> {
        let size = [width, height].map(|side| side.max(1) as f64);
        let body = bytes(size.into_iter().chain(goal.iter().map(|v| f64::from(*v))));
        let most = Expected::AtMost(4 + 3 * width.max(1) * height.max(1));
        let reply = self.ask(Request::Picture, &body, most)?;
        let (width, pixels) = reply.split_first_chunk().unwrap_or((&[0; 4], &[]));
        let (width, (pixels, rest)) = (u32::from_le_bytes(*width) as usize, pixels.as_chunks());
        if pixels.is_empty() || !rest.is_empty() || pixels.len().checked_rem(width) != Some(0) {
            return Err(self.fail("what it renders is no picture".to_owned()));
        }
        Ok(Rendering::new(width, pixels.to_vec()))
    }

    /// Sends numbers and returns as many as are expected.
    fn numbers(
        &mut self,
        request: Request,
        body: impl IntoIterator<Item = f64>,
        expected: usize,
    ) -> Result<Vec<f64>, EnvError> {
        let reply = self.ask(request, &bytes(body), Expected::Exactly(8 * expected))?;
        Ok(numbers(&reply))
    }

    /// Returns what a row says if it can be computed with.
    fn checked(
        &mut self,
        about: &Description,
        during: &str,
        row: &[f64],
    ) -> Result<Stepped, EnvError> {
        let (ended, row) = row.split_last().unwrap_or((&0.0, &[]));
        let row: Vec<f32> = row.iter().map(|v| *v as f32).collect();
        let Some(i) = row.iter().position(|v| v.is_nan() || v.abs() > MAX_MAGNITUDE) else {
            return Ok((row, *ended != 0.0));
        };
        let (part, component) = match i.checked_sub(about.observed) {
            Some(component) => ("achieved_goal", component),
            None => ("observation", i),
        };
        let value = row[i];
        Err(self.fail(format!("{during} returned {value} as component {component} of its {part}")))
    }
}

/// Scales an action in [-1, 1] to its bounds.
fn scaled(action: f32, [low, high]: [f32; 2]) -> f32 {
    let action = action.clamp(-1.0, 1.0);
    // Exactly the same numbers where nothing is to be scaled.
    if [low, high] == [-1.0, 1.0] {
        action
    } else {
        (low + 0.5 * (action + 1.0) * (high - low)).clamp(low, high)
    }
}

fn bytes(numbers: impl IntoIterator<Item = f64>) -> Vec<u8> {
    numbers.into_iter().flat_map(f64::to_le_bytes).collect()
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reply_of_another_size_than_expected_is_refused_before_it_is_read() {
        let header = |kind: u32, length: u32| {
            let bytes = [kind.to_le_bytes(), length.to_le_bytes()].concat();
            std::array::from_fn(|i| bytes[i])
        };
        let step = Expected::Exactly(40);
        for (header, expected, read) in [
            (header(0, 40), step, Ok((true, 40))),
            (header(0, 0), step, Err(BadHeader::Length(0))),
            (header(0, 1 << 31), step, Err(BadHeader::Length(1 << 31))),
            (header(1, 400), step, Ok((false, 400))),
            (header(1, u32::MAX), step, Err(BadHeader::Length(u32::MAX))),
            (*b"Hello, w", step, Err(BadHeader::Kind(0x6c6c_6548))),
            (header(0, 17), Expected::AtMost(MAX_TEXT_BYTES), Ok((true, 17))),
        ] {
            assert_eq!(reply_header(header, expected), read);
        }
        assert_eq!(request(Request::Make, &[5, 0]), [2, 0, 0, 0, 2, 0, 0, 0, 5, 0]);
    }
}
