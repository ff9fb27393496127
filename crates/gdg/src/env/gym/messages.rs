//! What a worker is asked for, and what it answers: a kind and a length, then that many bytes, all
//! little-endian. `worker.py` is the other side.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::env::Walls;
use crate::env::task::MAX_BUDGET_STEPS;
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
    pub fn action_bounds(&self) -> impl Iterator<Item = [f32; 2]> + Clone {
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
