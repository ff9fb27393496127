//! Recorded transitions, to learn from without acting: files as of OGBench, and the program's own.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use candle_core::npy::NpzTensors;
use candle_core::{DType, Device, Tensor};
use flate2::Crc;
use serde::{Deserialize, Serialize};

use super::error::{DataError, TrainError};
use super::memory;
use crate::env::{Environment, MAX_MAGNITUDE};
use crate::files::{Format, Wanted};
use crate::learn::{Replay, ReplaySizes};
use crate::pulse::Progress;
use crate::store::StoreError;

/// Names of the arrays.
const STATES: &str = "observations";
const ACTIONS: &str = "actions";
const ENDS: &str = "terminals";

/// Most numbers of an array: 4 GB of memory.
const MOST_NUMBERS: usize = 1 << 30;

/// No file is packed more tightly than this: the limit of Deflate.
const MOST_PACKED: u64 = 1_040;

/// Bytes that are read at a time.
const CHUNK: usize = 1 << 20;

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
    /// action of a row leads to the next one. States are in the unit of the world's records. Says
    /// how far it is, as one stage of `progress`.
    ///
    /// # Errors
    /// It cannot be read, is no such file, or does not fit the world.
    pub fn read(
        file: &Path,
        world: &dyn Environment,
        progress: &Progress,
    ) -> Result<Self, DataError> {
        let unread = |error| DataError::Unread { file: file.to_string_lossy().into(), error };
        let checked = checksum(file, [0, 2], progress).map_err(unread)?;
        Self::read_checked(file, checked, world, 2, progress)
    }

    /// Reads a file of known CRC-32 and length, and reports progress as the last of `parts`.
    fn read_checked(
        file: &Path,
        (checksum, bytes): (u32, u64),
        world: &dyn Environment,
        parts: usize,
        progress: &Progress,
    ) -> Result<Self, DataError> {
        let unfit = |problem| DataError::Unfit { file: file.to_string_lossy().into(), problem };
        let arrays = Arrays::open(file, bytes).map_err(unfit)?;
        let sizes = ReplaySizes::of(world.spec());
        let read = || -> Result<Self, String> {
            let rows = arrays.rows(sizes)?;
            // The arrays are by far the most of it.
            let tell = |thirds| progress.set(3 * (parts - 1) + thirds, 3 * parts);
            tell(0);
            let mut states = arrays.table(STATES, sizes.state, "the world's states")?;
            tell(1);
            let mut actions = arrays.table(ACTIONS, sizes.action, "the world's actions")?;
            let last = arrays.column(ENDS)?;
            tell(2);
            check(STATES, &states, sizes.state, MAX_MAGNITUDE, "finite, and at most 1e9 in size")?;
            if let Some(recorded) = world.abilities().recorded {
                states.chunks_exact_mut(sizes.state).for_each(|s| recorded.own_state(s));
            }
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
            // Resumed from anywhere.
            let file = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
            let source = DataSource { file, checksum, transitions, episodes };
            Ok(Self { source, sizes, states, actions, ends })
        };
        read().map_err(unfit)
    }

    /// Checks that a file can be read and has the arrays, without a world and without its numbers;
    /// returns its CRC-32. Says how far it is, as one stage of `progress`.
    ///
    /// # Errors
    /// See [`Self::read`].
    pub fn check_file(file: &Path, progress: &Progress) -> Result<u32, DataError> {
        let name = || file.to_string_lossy().into_owned();
        let (checksum, bytes) = checksum(file, [0, 1], progress)
            .map_err(|error| DataError::Unread { file: name(), error })?;
        let arrays = Arrays::open(file, bytes);
        let checked = arrays
            .and_then(|a| [STATES, ACTIONS, ENDS].iter().try_for_each(|n| a.shape(n).map(drop)));
        let checked = checked.map(|()| checksum);
        checked.map_err(|problem| DataError::Unfit { file: name(), problem })
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
        let mut last = Ok((0, 0));
        for (part, file) in places.enumerate() {
            last = checksum(file, [part, parts], progress);
            if let Ok(checked) = last
                && checked.0 == source.checksum
            {
                return Self::read_checked(file, checked, world, parts, progress);
            }
        }
        let file = moved.unwrap_or(&source.file).to_string_lossy().into_owned();
        if let Err(error) = last {
            return Err(DataError::Unread { file, error });
        }
        let problem = format!(
            "is not what the run has learned from, {} with {} transitions",
            source.file.display(),
            source.transitions
        );
        Err(DataError::Unfit { file, problem })
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

/// Returns a file's CRC-32 and length, and reports progress as one of several parts.
fn checksum(
    file: &Path,
    [part, parts]: [usize; 2],
    progress: &Progress,
) -> std::io::Result<(u32, u64)> {
    // Pipes and devices may never end.
    if file.exists() && !file.is_file() {
        return Err(std::io::Error::new(ErrorKind::InvalidInput, "it is no regular file"));
    }
    let file = File::open(file)?;
    let all = file.metadata()?.len() as usize;
    checksum_of(file, |bytes| {
        progress.set(part * all + bytes as usize, parts * all);
    })
}

/// Returns the CRC-32 and the number of all bytes; calls `tell` with how many have been read.
fn checksum_of(mut bytes: impl Read, tell: impl Fn(u64)) -> std::io::Result<(u32, u64)> {
    let (mut crc, mut done, mut chunk) = (Crc::new(), 0, vec![0; CHUNK]);
    tell(done);
    loop {
        match bytes.read(&mut chunk) {
            Ok(0) => return Ok((crc.sum(), done)),
            Ok(read) => {
                crc.update(&chunk[..read]);
                done += read as u64;
                tell(done);
            }
            // By a signal that is handled.
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

/// What is read as data.
const DATA: Wanted =
    Wanted { name: "an .npz file of NumPy", help: "numpy.savez writes one", own: &[Format::Npz] };

/// What is wrong with an archive that is recognised as one.
const CUT_OFF: &str = "is no .npz file of NumPy, or its end is missing";

/// Says why an array cannot be read, and what to do in NumPy.
fn unread_array(name: &str, error: &candle_core::Error) -> String {
    let said = error.to_string();
    if said.contains("fortran order") {
        return format!(
            "{name} is stored column by column (Fortran order): save \
             numpy.ascontiguousarray({name})"
        );
    }
    let is_type = said.contains("descr") || said.contains("unsupported dtype");
    if is_type {
        return format!(
            "{name} has numbers of a kind that cannot be read: save {name}.astype('float32')"
        );
    }
    format!("{name} cannot be read, as if the file were damaged: {said}")
}

/// The arrays of a file.
struct Arrays {
    file: NpzTensors,
    /// The length of the file.
    bytes: u64,
}

impl Arrays {
    fn open(file: &Path, bytes: u64) -> Result<Self, String> {
        let explained = |error| {
            log::debug!("{}: {error}", file.display());
            DATA.mismatch(file).map_or(CUT_OFF.to_owned(), |found| found.problem)
        };
        Ok(Self { file: NpzTensors::new(file).map_err(explained)?, bytes })
    }

    /// Returns the number of rows, which is the same in all arrays, if the data fit into memory: as
    /// they are read, and in the replay buffer.
    fn rows(&self, sizes: ReplaySizes) -> Result<usize, String> {
        let mut rows = [0; 3];
        for (rows, name) in rows.iter_mut().zip([STATES, ACTIONS, ENDS]) {
            *rows = self.shape(name)?.first().copied().unwrap_or(0);
        }
        let [rows, actions, ends] = rows;
        if rows != actions || rows != ends {
            return Err(format!(
                "{STATES}, {ACTIONS} and {ENDS} have {rows}, {actions} and {ends} rows: they must \
                 have as many"
            ));
        }
        let (needed, available) = (2 * sizes.bytes(rows), memory::available_bytes());
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
        let (shape, kind) = read.map_err(|error| unread_array(name, &error))?;
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
            Ok(Some(array)) => flat(array).map_err(|error| unread_array(name, &error)),
            Ok(None) => Err(format!("has no array {name}")),
            Err(error) => Err(unread_array(name, &error)),
        }
    }

    /// Returns the numbers of an array of two dimensions with this number of columns.
    fn table(&self, name: &str, columns: usize, of: &str) -> Result<Vec<f32>, String> {
        match self.shape(name)?[..] {
            [rows, own] if own == columns && rows > 0 => self.numbers(name),
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

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    /// Bytes whose every other read is interrupted by a signal.
    struct Interrupted(&'static [u8], bool);

    impl Read for Interrupted {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            self.1 = !self.1;
            if self.1 { Err(ErrorKind::Interrupted.into()) } else { self.0.read(&mut into[..2]) }
        }
    }

    #[test]
    fn a_checksum_goes_on_where_a_signal_interrupts_it() {
        let told = RefCell::new(Vec::new());
        let found = checksum_of(Interrupted(b"12345", false), |done| told.borrow_mut().push(done));
        assert_eq!(found.expect("a checksum"), (crc32fast::hash(b"12345"), 5));
        assert_eq!(told.into_inner(), [0, 2, 4, 5]);
    }
}
