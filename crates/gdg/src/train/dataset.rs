//! Recorded transitions, to learn from without acting: files as of OGBench, and the program's own.

mod npz;

use std::path::{Path, PathBuf};

use candle_core::{Device, Tensor};
use serde::{Deserialize, Serialize};

use super::error::{DataError, TrainError};
use super::memory;
use crate::env::{Environment, MAX_MAGNITUDE};
use crate::learn::{Replay, ReplaySizes};
use crate::pulse::Progress;
use crate::store::StoreError;
pub(super) use npz::Stamp;
use npz::{Arrays, Opened};

/// Names of the arrays.
const STATES: &str = "observations";
const ACTIONS: &str = "actions";
const ENDS: &str = "terminals";

/// Names of arrays that need not be there: further ends of episodes, as in data of D4RL, and where
/// each action leads.
const OTHER_ENDS: [&str; 2] = ["timeouts", "truncations"];
const NEXT: &str = "next_observations";

/// How far actions may lie beyond [-1, 1], by rounding.
const ACTION_TOLERANCE: f32 = 1e-3;

/// Where a run's data comes from. A checkpoint keeps this, and no copy of the data.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DataSource {
    /// The file.
    pub file: PathBuf,
    /// CRC-32 of its contents.
    pub checksum: u32,
    /// Number of transitions.
    pub transitions: usize,
    /// Number of episodes.
    pub episodes: usize,
}

impl DataSource {
    /// Says what has become of the file that was read with this stamp, if it cannot be read again.
    pub(super) fn loss(&self, stamp: &Stamp) -> Option<&'static str> {
        if stamp.is_of(&self.file) {
            return None;
        }
        // It may have been copied or touched.
        match Opened::new(&self.file, [0, 1], &Progress::default()) {
            Ok(found) if found.checksum == self.checksum => None,
            Ok(_) => Some("has changed"),
            Err(_) => Some("can no longer be read"),
        }
    }
}

/// Episodes of recorded transitions.
#[derive(Clone, Debug)]
pub struct Dataset {
    source: DataSource,
    stamp: Stamp,
    sizes: ReplaySizes,
    /// `(rows, state_dim)`.
    states: Vec<f32>,
    /// `(rows, action_dim)`; those of an episode's last row lead nowhere.
    actions: Vec<f32>,
    /// The row after each episode's last one.
    ends: Vec<usize>,
}

impl Dataset {
    /// Reads an `.npz` file with `observations` (rows, `state_dim`), `actions` (rows, `action_dim`)
    /// in [-1, 1], and `terminals` (rows), which are not 0 in the last row of each episode;
    /// `timeouts` and `truncations` are further ends. The action of a row leads to the next one, or
    /// to that of `next_observations`, if they are there. States are in the unit of the world's
    /// records. Says how far it is, as one stage of `progress`.
    ///
    /// # Errors
    /// It cannot be read, is no such file, or does not fit the world.
    pub fn read(
        file: &Path,
        world: &dyn Environment,
        progress: &Progress,
    ) -> Result<Self, DataError> {
        let opened = open(file, [0, 2], progress)?;
        Self::read_opened(file, opened, world, 2, progress)
    }

    /// Reads a file that has been opened, and reports progress as the last of `parts`.
    fn read_opened(
        file: &Path,
        opened: Opened,
        world: &dyn Environment,
        parts: usize,
        progress: &Progress,
    ) -> Result<Self, DataError> {
        let (sizes, checksum) = (ReplaySizes::of(world.spec()), opened.checksum);
        let read = || -> Result<Self, String> {
            let mut arrays = Arrays::new(file, opened)?;
            let shapes = Shapes::of(&mut arrays)?;
            let rows = shapes.rows(sizes)?;
            // The arrays are by far the most of it.
            let tell = |thirds| progress.set(3 * (parts - 1) + thirds, 3 * parts);
            tell(0);
            let mut states = shapes.states(STATES, &mut arrays, sizes, world)?;
            tell(1);
            let columns = (sizes.action, "the world's actions");
            let mut actions = shapes.table(ACTIONS, &mut arrays, columns)?;
            let mut is_last = shapes.ends(&mut arrays)?;
            tell(2);
            check(ACTIONS, &actions, sizes.action, 1.0 + ACTION_TOLERANCE, "in [-1, 1]")?;
            actions.iter_mut().for_each(|action| *action = action.clamp(-1.0, 1.0));
            if let Some(last) = is_last.last_mut() {
                *last = true;
            }
            if shapes.has(NEXT) {
                let next = shapes.states(NEXT, &mut arrays, sizes, world)?;
                (states, actions, is_last) = with_next(&states, &actions, &is_last, &next, sizes);
            }
            let stamp = arrays.close()?;
            let all = is_last.len();
            let ends: Vec<usize> = (1..=all).filter(|row| is_last[row - 1]).collect();
            let (transitions, episodes) = (all - ends.len(), ends.len());
            if transitions == 0 {
                return Err(format!("has no transition: all {rows} rows end an episode"));
            }
            // Resumed from anywhere.
            let file = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
            let source = DataSource { file, checksum, transitions, episodes };
            Ok(Self { source, stamp, sizes, states, actions, ends })
        };
        read().map_err(|problem| unfit(file, problem))
    }

    /// Checks that a file can be read and has the arrays, without a world and without its numbers;
    /// returns its CRC-32. Says how far it is, as one stage of `progress`.
    ///
    /// # Errors
    /// See [`Self::read`].
    pub fn check_file(file: &Path, progress: &Progress) -> Result<u32, DataError> {
        let opened = open(file, [0, 1], progress)?;
        let checksum = opened.checksum;
        let checked =
            Arrays::new(file, opened).and_then(|mut arrays| Shapes::of(&mut arrays).map(drop));
        checked.map(|()| checksum).map_err(|problem| unfit(file, problem))
    }

    /// Reads the file that a run has learned from: `moved` if it is elsewhere now.
    ///
    /// # Errors
    /// See [`Self::read`]; or it is another file.
    pub fn reread(
        source: &DataSource,
        moved: Option<&Path>,
        world: &dyn Environment,
        progress: &Progress,
    ) -> Result<Self, DataError> {
        let places = [Some(&*source.file), moved].into_iter().flatten();
        let parts = places.clone().count() + 1;
        let other = || {
            let (from, transitions) = (source.file.display(), source.transitions);
            let problem = format!(
                "is not what the run has learned from, {from} with {transitions} transitions"
            );
            unfit(moved.unwrap_or(&source.file), problem)
        };
        let mut problem = other();
        for (part, file) in places.enumerate() {
            problem = match open(file, [part, parts], progress) {
                Ok(opened) if opened.checksum == source.checksum => {
                    return Self::read_opened(file, opened, world, parts, progress);
                }
                Ok(_) => other(),
                Err(error) => error,
            };
        }
        Err(problem)
    }

    /// Returns where it comes from.
    pub fn source(&self) -> &DataSource {
        &self.source
    }

    /// Returns what tells whether the file is still the same.
    pub(super) fn stamp(&self) -> &Stamp {
        &self.stamp
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.states.len() / self.sizes.state
    }

    /// Returns the states, `(rows, state_dim)`.
    pub fn states(&self) -> &[f32] {
        &self.states
    }

    /// Returns the state of a row.
    pub fn state(&self, row: usize) -> &[f32] {
        &self.states[row * self.sizes.state..(row + 1) * self.sizes.state]
    }

    /// Returns a replay buffer of `agents` that is full of all episodes; `goal` returns the goal of
    /// each transition.
    pub fn replay(&self, agents: usize, mut goal: impl FnMut() -> Vec<f32>) -> Replay {
        // Each next episode goes to the agent with the fewest rows, as batches draw agents evenly:
        // none may have far more than the others, so longer ones are cut.
        let (mut filled, longest) = (vec![0; agents], self.rows().div_ceil(agents).max(2));
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let parts = starts.zip(&self.ends).flat_map(|(start, end)| {
            // A part ends in the state that the next one begins with.
            let step = longest - 1;
            (start..(end - 1).max(start + 1))
                .step_by(step)
                .map(move |at| at..(at + step + 1).min(*end))
        });
        let episodes: Vec<_> = parts
            .map(|rows| {
                let least = (0..agents).min_by_key(|agent| filled[*agent]).unwrap_or(0);
                filled[least] += rows.len();
                (least, rows)
            })
            .collect();
        let most = filled.iter().max().copied().unwrap_or(0);
        let mut replay = Replay::new(self.sizes, agents, agents * most);
        for (agent, rows) in episodes {
            let last = rows.end - 1;
            for row in rows.start..last {
                let action = &self.actions[row * self.sizes.action..(row + 1) * self.sizes.action];
                replay.push(agent, self.state(row), action, &goal());
            }
            replay.end_episode(agent, self.state(last));
        }
        replay
    }
}

/// Returns the contents of an `.npz` file with all complete transitions of a replay buffer in
/// `world`, as [`Dataset::read`] reads them. Says how far it is, as one stage of `progress`.
///
/// # Errors
/// There are none, or no temporary file can be written.
pub fn data_file(
    replay: &Replay,
    world: &dyn Environment,
    progress: &Progress,
) -> Result<Vec<u8>, TrainError> {
    let (mut states, mut actions, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    progress.set(0, 3);
    replay.visit_rows(|state, action, is_last| {
        states.extend(state);
        actions.extend(action);
        ends.push(u8::from(is_last));
    });
    let rows = ends.len();
    if rows == 0 {
        return Err(StoreError::inconsistent("it has no transitions yet").into());
    }
    if let Some(recorded) = world.abilities().recorded {
        let width = states.len() / rows;
        states.chunks_exact_mut(width).for_each(|state| recorded.recorded_state(state));
    }
    let table = |numbers: Vec<f32>| {
        let columns = numbers.len() / rows;
        Tensor::from_vec(numbers, (rows, columns), &Device::Cpu)
    };
    let last = Tensor::from_vec(ends, rows, &Device::Cpu)?;
    let arrays = [(STATES, table(states)?), (ACTIONS, table(actions)?), (ENDS, last)];
    progress.set(1, 3);
    let file = tempfile::NamedTempFile::new()?;
    Tensor::write_npz(&arrays, file.path())?;
    progress.set(2, 3);
    Ok(std::fs::read(file.path())?)
}

/// Checks the size of every number; the text says what it must be.
fn check(
    name: &str,
    numbers: &[f32],
    columns: usize,
    most: f32,
    wanted: &str,
) -> Result<(), String> {
    match numbers.iter().position(|v| v.is_nan() || v.abs() > most) {
        None => Ok(()),
        Some(i) => {
            let (row, column, value) = (i / columns, i % columns, numbers[i]);
            Err(format!("{name}[{row}, {column}] is {value}: it must be {wanted}"))
        }
    }
}

fn open(file: &Path, part: [usize; 2], progress: &Progress) -> Result<Opened, DataError> {
    let unread = |error| DataError::Unread { file: file.to_string_lossy().into(), error };
    Opened::new(file, part, progress).map_err(unread)
}

fn unfit(file: &Path, problem: String) -> DataError {
    DataError::Unfit { file: file.to_string_lossy().into(), problem }
}

/// The arrays that a file has, and their shapes.
struct Shapes(Vec<(&'static str, Vec<usize>)>);

impl Shapes {
    fn of(arrays: &mut Arrays) -> Result<Self, String> {
        let names = arrays.names();
        let has = |name: &str| names.iter().any(|known| known == name);
        if let Some(missing) = [STATES, ACTIONS, ENDS].iter().find(|name| !has(name)) {
            return Err(format!(
                "has no array {missing}, but {}: data are {STATES}, {ACTIONS} and {ENDS}",
                names.join(", ")
            ));
        }
        let all = [STATES, ACTIONS, ENDS].into_iter().chain(OTHER_ENDS).chain([NEXT]);
        let there = all.filter(|name| has(name));
        there.map(|name| Ok((name, arrays.shape(name)?))).collect::<Result<_, _>>().map(Self)
    }

    fn has(&self, name: &str) -> bool {
        self.0.iter().any(|(own, _)| *own == name)
    }

    fn shape(&self, name: &str) -> &[usize] {
        self.0.iter().find(|(own, _)| *own == name).map_or(&[], |(_, shape)| shape)
    }

    /// Returns the number of rows, which is the same in all arrays, if the data fit into memory: as
    /// they are read, and in the replay buffer.
    fn rows(&self, sizes: ReplaySizes) -> Result<usize, String> {
        let rows_of = |shape: &[usize]| shape.first().copied().unwrap_or(0);
        let rows = rows_of(self.shape(STATES));
        if self.0.iter().any(|(_, shape)| rows_of(shape) != rows) {
            let (names, counts): (Vec<_>, Vec<_>) =
                self.0.iter().map(|(name, shape)| (*name, rows_of(shape).to_string())).unzip();
            return Err(format!(
                "{} have {} rows: they must have as many",
                listed(&names),
                listed(&counts)
            ));
        }
        // In the worst case, each transition is an episode of two rows.
        let most = if self.has(NEXT) { 2 * rows } else { rows };
        let (needed, available) = (2 * sizes.bytes(most), memory::available_bytes());
        let gigabytes = |bytes: u64| bytes as f64 / 1e9;
        if needed <= available {
            return Ok(rows);
        }
        Err(format!(
            "{rows} rows need about {:.1} GB of memory, but {:.1} GB are available",
            gigabytes(needed),
            gigabytes(available)
        ))
    }

    /// Returns the numbers of an array of two dimensions with this number of columns.
    fn table(
        &self,
        name: &str,
        arrays: &mut Arrays,
        (columns, of): (usize, &str),
    ) -> Result<Vec<f32>, String> {
        match *self.shape(name) {
            [rows, own] if own == columns && rows > 0 => arrays.numbers(name, self.shape(name)),
            [rows, own] if rows > 0 => {
                Err(format!("{name} have {own} numbers a row, but {of} {columns}"))
            }
            ref shape => Err(format!("{name} have shape {shape:?}: it must be (rows, {columns})")),
        }
    }

    /// Returns states of the world.
    fn states(
        &self,
        name: &str,
        arrays: &mut Arrays,
        sizes: ReplaySizes,
        world: &dyn Environment,
    ) -> Result<Vec<f32>, String> {
        let mut states = self.table(name, arrays, (sizes.state, "the world's states"))?;
        check(name, &states, sizes.state, MAX_MAGNITUDE, "finite, and at most 1e9 in size")?;
        if let Some(recorded) = world.abilities().recorded {
            states.chunks_exact_mut(sizes.state).for_each(|state| recorded.own_state(state));
        }
        Ok(states)
    }

    /// Returns whether each row is the last one of an episode by any of the arrays.
    fn ends(&self, arrays: &mut Arrays) -> Result<Vec<bool>, String> {
        let mut is_last = Vec::new();
        for name in [ENDS].into_iter().chain(OTHER_ENDS).filter(|name| self.has(name)) {
            let ends = match *self.shape(name) {
                [_] | [_, 1] => arrays.numbers(name, self.shape(name))?,
                ref shape => {
                    return Err(format!("{name} have shape {shape:?}: it must be (rows,)"));
                }
            };
            if let Some(row) = ends.iter().position(|end| end.is_nan()) {
                return Err(format!(
                    "{name}[{row}] is NaN: it must be 1 in the last row of an episode, and else 0"
                ));
            }
            is_last.resize(ends.len(), false);
            is_last.iter_mut().zip(ends).for_each(|(is_last, end)| *is_last |= end != 0.0);
        }
        Ok(is_last)
    }
}

/// Returns names or numbers as text: `a, b and c`.
fn listed(all: &[impl AsRef<str>]) -> String {
    let all: Vec<&str> = all.iter().map(AsRef::as_ref).collect();
    match &*all {
        [start @ .., last] if !start.is_empty() => format!("{} and {last}", start.join(", ")),
        all => all.join(""),
    }
}

/// Returns states, actions and ends of episodes with a row more where a row does not lead to the
/// next one, but to its own of the states `next`: an episode ends there. So the rows of a shuffled
/// replay buffer become episodes of a single transition.
fn with_next(
    states: &[f32],
    actions: &[f32],
    is_last: &[bool],
    next: &[f32],
    sizes: ReplaySizes,
) -> (Vec<f32>, Vec<f32>, Vec<bool>) {
    let (mut all_states, mut all_actions, mut all_last) = (Vec::new(), Vec::new(), Vec::new());
    let state = |row: usize| &states[row * sizes.state..(row + 1) * sizes.state];
    let rows = next.chunks_exact(sizes.state).zip(actions.chunks_exact(sizes.action));
    for (row, (next, action)) in rows.enumerate() {
        let is_next_row = next == state((row + 1) % is_last.len());
        all_states.extend(state(row));
        all_actions.extend(action);
        // Where an episode ends, the next row is the start of another one: the file's states moved
        // by a row, and not where the action led.
        all_last.push(is_last[row] && is_next_row);
        if !is_next_row {
            all_states.extend(next);
            all_actions.resize(all_states.len() / sizes.state * sizes.action, 0.0);
            all_last.push(true);
        }
    }
    (all_states, all_actions, all_last)
}
