//! What a worker's environments are asked for: to begin episodes and to step.

use super::MAX_STATE_BYTES;
use super::description::Description;
use super::frames::{Expected, MAX_TEXT_BYTES, Request, f32_bytes, f32_numbers};
use super::process::Worker;
use crate::env::{EnvError, MAX_MAGNITUDE};
use crate::text::truncated;

/// An action of environments that are left as they are.
pub const REST: f32 = f32::NAN;

/// Most characters of a reason that are shown.
const MAX_REASON_CHARS: usize = 600;

/// How an episode begins.
#[derive(Clone, Debug, PartialEq)]
pub struct Begun {
    /// The observation, and what is achieved.
    pub row: Vec<f32>,
    /// The desired goal.
    pub goal: Vec<f32>,
}

/// Has a worker create environments until it has `count`.
///
/// # Errors
/// The worker fails.
pub fn make(worker: &mut Worker, count: usize) -> Result<(), EnvError> {
    // One by one, as the time limit is for each.
    while worker.environments < count {
        let more = worker.environments + 1;
        worker.ask(Request::Make, &(more as u32).to_le_bytes(), Expected::Exactly(0))?;
        worker.environments = more;
    }
    Ok(())
}

/// Begins an episode in an environment of a worker: everything random in it follows from `seed`.
///
/// # Errors
/// The worker fails, or numbers are not finite.
pub fn reset(
    worker: &mut Worker,
    about: &Description,
    environment: usize,
    seed: u32,
    task: Option<u32>,
) -> Result<Begun, EnvError> {
    let task = task.map_or(-1, |task| task as i32);
    let body =
        [(environment as u32).to_le_bytes(), seed.to_le_bytes(), task.to_le_bytes()].concat();
    let expected = Expected::Exactly(4 * (about.row() + about.goal));
    let reply = worker.ask(Request::Reset, &body, expected)?;
    let mut row: Vec<f32> = f32_numbers(&reply).collect();
    let goal = row.split_off(about.row());
    check(worker, about, "reset", &row)?;
    if !goal.iter().all(|v| v.abs() <= MAX_MAGNITUDE) {
        return Err(worker.fail("a goal that it asks for is not finite, or huge".to_owned()));
    }
    Ok(Begun { row, goal })
}

/// Steps the first environments of a worker by `actions`, `(environments, action_dim)`; returns a
/// row for each, and whether its episode has ended.
///
/// # Errors
/// The worker fails, or numbers are not finite.
pub fn step(
    worker: &mut Worker,
    about: &Description,
    actions: &[f32],
) -> Result<(Vec<Vec<f32>>, Vec<bool>), EnvError> {
    begin_step(worker, about, actions)?;
    end_step(worker, about, actions.len() / about.low.len())
}

/// Asks for a step, as [`step`] does; [`end_step`] returns its result. Actions lie in [-1, 1], or
/// are [`REST`].
///
/// # Errors
/// The worker fails.
pub fn begin_step(
    worker: &mut Worker,
    about: &Description,
    actions: &[f32],
) -> Result<(), EnvError> {
    let bounds = about.action_bounds().cycle();
    let actions: Vec<f32> = actions.iter().zip(bounds).map(|(a, to)| scaled(*a, to)).collect();
    worker.send(Request::Step, &f32_bytes(&actions))
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

/// Returns the result of a step of `count` environments.
///
/// # Errors
/// The worker fails, or numbers are not finite.
pub fn end_step(
    worker: &mut Worker,
    about: &Description,
    count: usize,
) -> Result<(Vec<Vec<f32>>, Vec<bool>), EnvError> {
    let numbers = 4 * count * about.row();
    let reply = worker.answer(Request::Step, Expected::Exactly(numbers + count))?;
    let (rows, ended) = reply.split_at(numbers);
    let rows: Vec<Vec<f32>> =
        rows.chunks_exact(4 * about.row()).map(|row| f32_numbers(row).collect()).collect();
    for row in &rows {
        check(worker, about, "step", row)?;
    }
    Ok((rows, ended.iter().map(|ended| *ended != 0).collect()))
}

/// Returns the full states of the first `count` environments, or why they cannot be saved: then the
/// worker goes on, unless it has failed.
///
/// # Errors
/// The reason, for the user.
pub fn save(worker: &mut Worker, count: usize) -> Result<Vec<Vec<u8>>, String> {
    let body = [count as u32, MAX_STATE_BYTES as u32].map(u32::to_le_bytes).concat();
    let most = Expected::AtMost(1 + 4 * count + MAX_STATE_BYTES);
    let reply = worker.ask(Request::Save, &body, most).map_err(|error| error.to_string())?;
    let mut rest = attempted(&reply)?;
    let mut states = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk() {
        let parts = after.split_at_checked(u32::from_le_bytes(*length) as usize);
        let (state, after) = parts.ok_or("its worker answers something else than asked")?;
        states.push(state.to_vec());
        rest = after;
    }
    if states.len() == count { Ok(states) } else { Err("states are missing".to_owned()) }
}

/// Puts an environment of a worker into a full state; returns why that cannot be.
///
/// # Errors
/// The worker fails.
pub fn restore(
    worker: &mut Worker,
    environment: usize,
    state: &[u8],
) -> Result<Result<(), String>, EnvError> {
    let body = [&(environment as u32).to_le_bytes(), state].concat();
    let reply = worker.ask(Request::Restore, &body, Expected::AtMost(MAX_TEXT_BYTES))?;
    Ok(attempted(&reply).map(drop))
}

/// Returns what follows the first byte of a reply: what was asked for, or why it cannot be done.
fn attempted(reply: &[u8]) -> Result<&[u8], String> {
    match reply {
        [1, done @ ..] => Ok(done),
        [_, why @ ..] => Err(truncated(&String::from_utf8_lossy(why), MAX_REASON_CHARS)),
        [] => Err("its worker answers something else than asked".to_owned()),
    }
}

/// Checks that numbers are finite and can be computed with.
fn check(
    worker: &mut Worker,
    about: &Description,
    during: &str,
    row: &[f32],
) -> Result<(), EnvError> {
    let Some(i) = row.iter().position(|v| v.is_nan() || v.abs() > MAX_MAGNITUDE) else {
        return Ok(());
    };
    let (part, component) = match i.checked_sub(about.observed) {
        Some(component) => ("achieved_goal", component),
        None => ("observation", i),
    };
    let value = row[i];
    Err(worker.fail(format!("{during} returned {value} as component {component} of its {part}")))
}
