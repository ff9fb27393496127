//! A worker as its environments: opens, begins, steps and draws them.

use super::messages::{Description, Expected, MAX_TEXT_BYTES, Request};
use super::process::Worker;
use crate::env::{EnvError, MAX_MAGNITUDE, Rendering};

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
