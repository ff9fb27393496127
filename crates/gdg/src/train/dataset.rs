//! Recorded transitions, to learn from without acting: files as of OGBench, and the program's own.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use candle_core::npy::NpzTensors;
use candle_core::{DType, Device, Tensor};
use serde::{Deserialize, Serialize};

use super::error::TrainError;
use crate::env::{MAX_MAGNITUDE, Spec};
use crate::learn::{Replay, ReplaySizes};
use crate::store::StoreError;

/// Names of the arrays.
const STATES: &str = "observations";
const ACTIONS: &str = "actions";
const ENDS: &str = "terminals";

/// Most numbers of an array: 4 GB of memory.
const MOST_NUMBERS: usize = 1 << 30;

/// No file is packed more tightly than this: the limit of Deflate.
const MOST_PACKED: u64 = 1_040;

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

/// Why a file of data cannot be learned from.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// It cannot be read.
    #[error("{file}: the data cannot be read: {error}")]
    Unread {
        /// The file.
        file: String,
        /// Why.
        error: std::io::Error,
    },
    /// It is no such file, or does not fit the world.
    #[error("{file}: {problem}")]
    Unfit {
        /// The file.
        file: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
}

impl DataError {
    /// Returns what is wrong, without the file.
    pub fn problem(self) -> String {
        match self {
            Self::Unread { error, .. } => {
                format!("the data cannot be read: {error}: give --data FILE if it has moved")
            }
            Self::Unfit { problem, .. } => problem,
        }
    }
}

/// Episodes of recorded transitions.
#[derive(Clone, Debug)]
pub struct Dataset {
    source: DataSource,
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
    /// in [-1, 1], and `terminals` (rows), which are not 0 in the last row of each episode. The
    /// action of a row leads to the next one.
    ///
    /// # Errors
    /// It cannot be read, is no such file, or does not fit a world with `spec`.
    pub fn read(file: &Path, spec: &Spec) -> Result<Self, DataError> {
        let name = file.to_string_lossy().into_owned();
        let unread = |error| DataError::Unread { file: name.clone(), error };
        let (checksum, bytes) = checksum(file).map_err(unread)?;
        let unfit = |problem| DataError::Unfit { file: name.clone(), problem };
        let arrays = Arrays::open(file, bytes).map_err(unfit)?;
        let sizes = ReplaySizes::of(spec);
        let read = || -> Result<Self, String> {
            let (rows, states) = arrays.table(STATES, sizes.state, "the world's states")?;
            let (others, mut actions) = arrays.table(ACTIONS, sizes.action, "its actions")?;
            let last = arrays.column(ENDS)?;
            if rows != others || rows != last.len() {
                let ends = last.len();
                return Err(format!(
                    "{STATES}, {ACTIONS} and {ENDS} have {rows}, {others} and {ends} rows: they \
                     must have as many"
                ));
            }
            check(STATES, &states, sizes.state, MAX_MAGNITUDE, "finite, and at most 1e9 in size")?;
            check(ACTIONS, &actions, sizes.action, 1.0 + ACTION_TOLERANCE, "in [-1, 1]")?;
            actions.iter_mut().for_each(|action| *action = action.clamp(-1.0, 1.0));
            let mut ends: Vec<usize> = (1..=rows).filter(|row| last[row - 1] != 0.0).collect();
            if ends.last() != Some(&rows) {
                ends.push(rows);
            }
            let transitions = rows - ends.len();
            if transitions == 0 {
                return Err(format!("has no transition: all {rows} rows are {ENDS}"));
            }
            let episodes = ends.len();
            let source = DataSource { file: file.to_owned(), checksum, transitions, episodes };
            Ok(Self { source, sizes, states, actions, ends })
        };
        read().map_err(|problem| DataError::Unfit { file: name.clone(), problem })
    }

    /// Reads the file that a run has learned from: `moved` if it is elsewhere now.
    ///
    /// # Errors
    /// See [`Self::read`]; or it is another file.
    pub fn reread(
        source: &DataSource,
        moved: Option<&Path>,
        spec: &Spec,
    ) -> Result<Self, DataError> {
        let file = moved.unwrap_or(&source.file);
        let read = Self::read(file, spec)?;
        if read.source.checksum != source.checksum {
            let problem =
                "has changed since the run began: give --data FILE with the data that it \
                           has learned from"
                    .to_owned();
            return Err(DataError::Unfit { file: file.to_string_lossy().into_owned(), problem });
        }
        Ok(read)
    }

    /// Returns where it comes from.
    pub fn source(&self) -> &DataSource {
        &self.source
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
        // Each next episode goes to the agent with the fewest rows.
        let mut filled = vec![0; agents];
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        let episodes: Vec<_> = starts
            .zip(&self.ends)
            .map(|(start, end)| {
                let least = (0..agents).min_by_key(|agent| filled[*agent]).unwrap_or(0);
                filled[least] += end - start;
                (least, start..*end)
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

/// Returns the contents of an `.npz` file with all complete transitions of a replay buffer, as
/// [`Dataset::read`] reads them.
///
/// # Errors
/// There are none, or no temporary file can be written.
pub fn data_file(replay: &Replay) -> Result<Vec<u8>, TrainError> {
    let (mut states, mut actions, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    replay.visit_rows(|state, action, is_last| {
        states.extend(state);
        actions.extend(action);
        ends.push(u8::from(is_last));
    });
    let rows = ends.len();
    if rows == 0 {
        return Err(StoreError::inconsistent("it has no transitions yet").into());
    }
    let table = |numbers: Vec<f32>| {
        let columns = numbers.len() / rows;
        Tensor::from_vec(numbers, (rows, columns), &Device::Cpu)
    };
    let last = Tensor::from_vec(ends, rows, &Device::Cpu)?;
    let arrays = [(STATES, table(states)?), (ACTIONS, table(actions)?), (ENDS, last)];
    let file = tempfile::NamedTempFile::new()?;
    Tensor::write_npz(&arrays, file.path())?;
    Ok(std::fs::read(file.path())?)
}

/// Returns the CRC-32 and the length of a file.
fn checksum(file: &Path) -> std::io::Result<(u32, u64)> {
    let (mut file, mut hasher) = (File::open(file)?, crc32fast::Hasher::new());
    let (mut buffer, mut bytes) = (vec![0; 1 << 16], 0);
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok((hasher.finalize(), bytes)),
            Ok(read) => {
                hasher.update(&buffer[..read]);
                bytes += read as u64;
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
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

/// The arrays of a file.
struct Arrays {
    file: NpzTensors,
    /// The length of the file.
    bytes: u64,
}

impl Arrays {
    fn open(file: &Path, bytes: u64) -> Result<Self, String> {
        let opened = NpzTensors::new(file);
        let file = opened.map_err(|error| format!("is no .npz file of NumPy: {error}"))?;
        Ok(Self { file, bytes })
    }

    /// Returns the shape of an array, if the file can hold it.
    fn shape(&self, name: &str) -> Result<Vec<usize>, String> {
        let mut names = self.file.names();
        names.sort();
        if !names.iter().any(|known| *known == name) {
            let names: Vec<&str> = names.iter().map(|name| name.as_str()).collect();
            return Err(format!(
                "has no array {name}, but {}: data are {STATES}, {ACTIONS} and {ENDS}",
                names.join(", ")
            ));
        }
        let read = self.file.get_shape_and_dtype(name);
        let (shape, kind) = read.map_err(|error| format!("{name}: {error}"))?;
        let count = shape.dims().iter().try_fold(1_usize, |count, n| count.checked_mul(*n));
        let most = self.bytes.saturating_mul(MOST_PACKED) / kind.size_in_bytes().max(1) as u64;
        match count {
            Some(count) if count <= MOST_NUMBERS && count as u64 <= most => {
                Ok(shape.dims().to_vec())
            }
            _ => Err(format!(
                "{name} has shape {:?}: more than the file holds, or than {MOST_NUMBERS} numbers",
                shape.dims()
            )),
        }
    }

    /// Returns the numbers of an array.
    fn numbers(&self, name: &str) -> Result<Vec<f32>, String> {
        let flat = |array: Tensor| array.to_dtype(DType::F32)?.flatten_all()?.to_vec1();
        match self.file.get(name) {
            Ok(Some(array)) => flat(array).map_err(|error| format!("{name}: {error}")),
            Ok(None) => Err(format!("has no array {name}")),
            Err(error) => Err(format!("{name}: {error}")),
        }
    }

    /// Returns the rows of an array of two dimensions with this number of columns, and its numbers.
    fn table(&self, name: &str, columns: usize, of: &str) -> Result<(usize, Vec<f32>), String> {
        match self.shape(name)?[..] {
            [rows, own] if own == columns && rows > 0 => Ok((rows, self.numbers(name)?)),
            [rows, own] if rows > 0 => {
                Err(format!("{name} have {own} numbers a row, but {of} {columns}"))
            }
            ref shape => Err(format!("{name} have shape {shape:?}: it must be (rows, {columns})")),
        }
    }

    /// Returns an array of one dimension, or of one column.
    fn column(&self, name: &str) -> Result<Vec<f32>, String> {
        match self.shape(name)?[..] {
            [_] | [_, 1] => self.numbers(name),
            ref shape => Err(format!("{name} have shape {shape:?}: it must be (rows,)")),
        }
    }
}
