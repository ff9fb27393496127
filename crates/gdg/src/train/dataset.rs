//! Recorded transitions, to learn from without acting: files as of OGBench, and the program's own.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use candle_core::npy::NpzTensors;
use candle_core::{DType, Device, Tensor};
use flate2::CrcWriter;
use serde::{Deserialize, Serialize};
use zip::ZipArchive;

use super::memory;
use super::{DataError, TrainError};
use crate::env::{Environment, MAX_MAGNITUDE, RecordedStep};
use crate::files::{self, FileFacts, FileFormat, Wanted};
use crate::job::Job;
use crate::learn::{Replay, ReplaySizes};
use crate::store::StoreError;

type Result<T, E = DataError> = std::result::Result<T, E>;

const STATES: &str = "observations";
const ACTIONS: &str = "actions";

/// Ends of episodes by the names of OGBench, D4RL, Gymnasium and Minari: a file has at least one.
const ENDS: [&str; 8] = [
    "terminals",
    "timeouts",
    "truncations",
    "dones",
    "terminations",
    "terminated",
    "truncated",
    "done",
];

/// Where each action leads, which need not be there.
const NEXT: &str = "next_observations";

/// Most numbers of an array: 4 GB of memory.
const MOST_NUMBERS: usize = 1 << 30;

/// No file is packed more tightly than this: the limit of Deflate.
const MOST_PACKED: u64 = 1_040;

const CHUNK: u64 = 1 << 20;

/// How far actions may lie beyond [-1, 1], by rounding.
const ACTION_TOLERANCE: f32 = 1e-3;

/// Where a run's data comes from. A checkpoint keeps this, and no copy of the data.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DataSource {
    pub file: PathBuf,
    /// CRC-32 of its contents.
    pub checksum: u32,
    pub transitions: usize,
    pub episodes: usize,
}

#[derive(Clone, Debug)]
pub struct Dataset {
    source: DataSource,
    pub(super) facts: Option<FileFacts>,
    sizes: ReplaySizes,
    /// `(rows, state_dim)`.
    states: Vec<f32>,
    /// `(rows, action_dim)`; those of an episode's last row lead nowhere.
    actions: Vec<f32>,
    /// The row after each episode's last one.
    ends: Vec<usize>,
    /// Whether no row ends an episode, so that all are taken for one.
    pub(super) is_endless: bool,
}

impl Dataset {
    /// Reads an `.npz` file with `observations` (rows, `state_dim`), `actions` (rows, `action_dim`)
    /// in [-1, 1], and `terminals`, `truncations` or the like (rows), some of which are not 0 in the
    /// last row of each episode. The action of a row leads to the next one, or to that of
    /// `next_observations`, if they are there. States are in the unit of the world's records. Says
    /// how far it is, as one stage of `progress`.
    pub fn read(file: &Path, world: &dyn Environment, progress: &Job) -> Result<Self> {
        let checked = checksum(file, 2, progress)?;
        Self::read_checked(file, checked, world, progress)
    }

    /// Reads a file of known CRC-32 and facts, as the second half of the progress.
    fn read_checked(
        file: &Path,
        (checksum, facts): (u32, Option<FileFacts>),
        world: &dyn Environment,
        progress: &Job,
    ) -> Result<Self> {
        let sizes = ReplaySizes::of(world.spec());
        let read = || -> Result<Self, String> {
            let arrays = Arrays::open(file, facts)?;
            let rows = arrays.rows(sizes)?;
            // The arrays are by far the most of it.
            let tell = |thirds: usize| progress.set(3 + thirds, 6);
            tell(0);
            let mut states = arrays.numbers(STATES, &[rows, sizes.state])?;
            tell(1);
            let mut actions = arrays.numbers(ACTIONS, &[rows, sizes.action])?;
            let mut is_last = arrays.ends(rows)?;
            let next = arrays.has(NEXT).then(|| arrays.numbers(NEXT, &[rows, sizes.state]));
            let mut next = next.transpose()?;
            // Written over or replaced, it may have parts of two files, or another checksum.
            if FileFacts::of(file) != facts {
                return Err(CHANGED.to_owned());
            }
            tell(2);
            check(ACTIONS, &actions, sizes.action, 1.0 + ACTION_TOLERANCE, "in [-1, 1]")?;
            actions.iter_mut().for_each(|action| *action = action.clamp(-1.0, 1.0));
            for (name, states) in [(STATES, Some(&mut states)), (NEXT, next.as_mut())] {
                let Some(states) = states else { continue };
                check(name, states, sizes.state, MAX_MAGNITUDE, "finite, and at most 1e9 in size")?;
                if let Some(recorded) = world.abilities().recorded {
                    states.chunks_exact_mut(sizes.state).for_each(|s| recorded.own_state(s));
                }
            }
            let has_ends = is_last.contains(&true);
            if let Some(last) = is_last.last_mut() {
                *last = true;
            }
            if let Some(next) = next {
                (states, actions, is_last) = with_next(&states, &actions, &is_last, &next, sizes);
            }
            let all = is_last.len();
            let ends: Vec<usize> = (1..=all).filter(|row| is_last[row - 1]).collect();
            let (transitions, episodes) = (all - ends.len(), ends.len());
            if transitions == 0 {
                return Err(format!("has no transition: all {rows} rows end an episode"));
            }
            // Resumed from anywhere.
            let file = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
            let source = DataSource { file, checksum, transitions, episodes };
            let is_endless = !has_ends && episodes == 1;
            Ok(Self { source, facts, sizes, states, actions, ends, is_endless })
        };
        read().map_err(|problem| unfit(file, problem))
    }

    /// Checks that a file can be read and has the arrays, without a world and without its numbers;
    /// returns its CRC-32. Says how far it is, as one stage of `progress`.
    pub fn check_file(file: &Path, progress: &Job) -> Result<u32> {
        let (checksum, facts) = checksum(file, 1, progress)?;
        Arrays::open(file, facts).map_err(|problem| unfit(file, problem))?;
        Ok(checksum)
    }

    /// Reads the file that a run has learned from, or else `moved`, which must be the same.
    pub fn reread(
        source: &DataSource,
        moved: Option<&Path>,
        world: &dyn Environment,
        progress: &Job,
    ) -> Result<Self> {
        let file = moved.unwrap_or(&source.file);
        let checked = checksum(file, 2, progress)?;
        if checked.0 != source.checksum {
            let (from, transitions) = (source.file.display(), source.transitions);
            let problem = format!(
                "is not what the run has learned from, {from} with {transitions} transitions"
            );
            return Err(unfit(file, problem));
        }
        Self::read_checked(file, checked, world, progress)
    }

    pub fn source(&self) -> &DataSource {
        &self.source
    }

    pub fn rows(&self) -> usize {
        self.states.len() / self.sizes.state
    }

    pub fn states(&self) -> &[f32] {
        &self.states
    }

    /// Returns the rows of each episode.
    fn episodes(&self) -> impl Iterator<Item = Range<usize>> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| start..*end)
    }

    /// Returns the states of each episode, `(steps, state_dim)`.
    pub(super) fn walks(&self) -> impl Iterator<Item = &[f32]> {
        let width = self.sizes.state;
        self.episodes().map(move |rows| &self.states[rows.start * width..rows.end * width])
    }

    /// Returns at most `most` steps, evenly spread, each with the number of its episode.
    pub(super) fn steps(&self, most: usize) -> Vec<(usize, RecordedStep<'_>)> {
        let (every, width) = (self.source.transitions.div_ceil(most), self.sizes.action);
        let rows = (1..)
            .zip(self.episodes())
            .flat_map(|(episode, rows)| (rows.start..rows.end - 1).map(move |row| (episode, row)));
        let action = |row: usize| &self.actions[row * width..(row + 1) * width];
        let step = |row: usize| [self.state(row), action(row), self.state(row + 1)];
        rows.step_by(every).map(|(episode, row)| (episode, step(row))).collect()
    }

    pub fn state(&self, row: usize) -> &[f32] {
        &self.states[row * self.sizes.state..(row + 1) * self.sizes.state]
    }

    /// Returns a replay buffer of `agents` that is full of all episodes; `goal` returns the goal of
    /// each transition.
    pub fn replay(&self, agents: usize, mut goal: impl FnMut() -> Vec<f32>) -> Replay {
        // Each next episode goes to the agent with the fewest rows, as batches draw agents evenly:
        // none may have far more than the others, so longer ones are cut.
        let (mut filled, longest) = (vec![0; agents], self.rows().div_ceil(agents).max(2));
        let parts = self.episodes().flat_map(|Range { start, end }| {
            // A part ends in the state that the next one begins with.
            let step = longest - 1;
            let firsts = (start..(end - 1).max(start + 1)).step_by(step);
            firsts.map(move |at| at..(at + step + 1).min(end))
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
pub fn data_file(
    replay: &Replay,
    world: &dyn Environment,
    progress: &Job,
) -> Result<Vec<u8>, TrainError> {
    let (mut states, mut actions, mut ends) = (Vec::new(), Vec::new(), Vec::new());
    progress.set(0, 3);
    replay.visit_rows(|state, action, is_last| {
        states.extend(state);
        actions.extend(action);
        ends.push(u8::from(is_last));
    });
    let rows = ends.len();
    StoreError::unless(rows > 0, "it has no transitions yet")?;
    if let Some(recorded) = world.abilities().recorded {
        let width = states.len() / rows;
        states.chunks_exact_mut(width).for_each(|state| recorded.recorded_state(state));
    }
    let table = |numbers: Vec<f32>| Tensor::from_vec(numbers, (rows, ()), &Device::Cpu);
    let last = Tensor::from_vec(ends, rows, &Device::Cpu)?;
    let arrays = [(STATES, table(states)?), (ACTIONS, table(actions)?), (ENDS[0], last)];
    progress.set(1, 3);
    let folder = std::env::temp_dir();
    let failed = |why| TrainError::Other(format!("{} (TMPDIR): {why}", folder.display()));
    let file = tempfile::NamedTempFile::new().map_err(|error| failed(error.to_string()))?;
    Tensor::write_npz(&arrays, file.path()).map_err(|error| failed(error.to_string()))?;
    progress.set(2, 3);
    std::fs::read(file.path()).map_err(|error| failed(error.to_string()))
}

/// Returns a file's CRC-32 and its facts before it was read, as the first part of the progress.
fn checksum(path: &Path, parts: usize, progress: &Job) -> Result<(u32, Option<FileFacts>)> {
    let facts = FileFacts::of(path);
    let all = facts.map_or(0, |facts| facts.bytes as usize);
    let read = || -> io::Result<u32> {
        let (mut file, mut crc, mut done) = (files::open(path)?, CrcWriter::new(io::sink()), 0);
        loop {
            progress.set(done as usize, parts * all);
            match io::copy(&mut (&mut file).take(CHUNK), &mut crc)? {
                0 => return Ok(crc.crc().sum()),
                read => done += read,
            }
        }
    };
    let help = "give --data FILE if it is elsewhere, with --resume FILE for a saved run";
    let unread = |error| unfit(path, format!("cannot be read: {error}: {help}"));
    Ok((read().map_err(unread)?, facts))
}

fn check(name: &str, numbers: &[f32], width: usize, most: f32, wanted: &str) -> Result<(), String> {
    match numbers.iter().position(|v| v.is_nan() || v.abs() > most) {
        None => Ok(()),
        Some(i) => {
            let (row, column, value) = (i / width, i % width, numbers[i]);
            Err(format!("{name}[{row}, {column}] is {value}: it must be {wanted}"))
        }
    }
}

fn unfit(file: &Path, problem: String) -> DataError {
    DataError { file: file.to_string_lossy().into(), problem }
}

const DATA: Wanted = Wanted {
    name: "an .npz file of NumPy",
    help: "numpy.savez writes one",
    own: &[FileFormat::Npz],
};

const CUT_OFF: &str = "is no .npz file of NumPy, or its end is missing";

const CHANGED: &str = "has changed while it was read";

fn unread_array(name: &str, error: &candle_core::Error) -> String {
    let said = error.to_string();
    if said.contains("fortran order") {
        return format!(
            "{name} is stored column by column (Fortran order): save \
             numpy.ascontiguousarray({name})"
        );
    }
    if said.contains("descr") || said.contains("unsupported dtype") {
        return format!(
            "{name} has numbers of a kind that cannot be read: save {name}.astype('float32')"
        );
    }
    format!("{name} cannot be read, as if the file were damaged: {said}")
}

struct Arrays<'a> {
    path: &'a Path,
    file: NpzTensors,
    bytes: u64,
}

impl<'a> Arrays<'a> {
    fn open(path: &'a Path, facts: Option<FileFacts>) -> Result<Self, String> {
        let explained = |error| {
            log::debug!("{}: {error}", path.display());
            DATA.mismatch(path).map_or(CUT_OFF.to_owned(), |found| found.problem)
        };
        let file = NpzTensors::new(path).map_err(explained)?;
        let arrays = Self { path, file, bytes: facts.map_or(0, |facts| facts.bytes) };
        let ends = ENDS.iter().find(|name| arrays.has(name)).unwrap_or(&ENDS[0]);
        [STATES, ACTIONS, ends].iter().try_for_each(|name| arrays.shape(name).map(drop))?;
        Ok(arrays)
    }

    fn has(&self, name: &str) -> bool {
        self.file.names().iter().any(|known| *known == name)
    }

    /// Returns the number of rows, if the data fit into memory: as they are read, and in the replay
    /// buffer.
    fn rows(&self, sizes: ReplaySizes) -> Result<usize, String> {
        let rows = self.shape(STATES)?.first().copied().unwrap_or(0);
        // In the worst case, each transition is an episode of two rows.
        let most = if self.has(NEXT) { 2 * rows } else { rows };
        let (needed, available) = (2 * sizes.bytes(most), memory::available_bytes());
        if needed <= available {
            return Ok(rows);
        }
        let [needed, available] = [needed, available].map(|bytes| bytes as f64 / 1e9);
        let but = format!("but {available:.1} GB are available");
        Err(format!("{rows} rows need about {needed:.1} GB of memory, {but}"))
    }

    fn shape(&self, name: &str) -> Result<Vec<usize>, String> {
        if !self.has(name) {
            let mut names: Vec<&str> = self.file.names().into_iter().map(String::as_str).collect();
            names.sort_unstable();
            return Err(format!(
                "has no array {name}, but {}: data are {STATES}, {ACTIONS} and terminals",
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

    /// Returns the numbers of an array of the `wanted` shape, which may have a last length of 1 more.
    fn numbers(&self, name: &str, wanted: &[usize]) -> Result<Vec<f32>, String> {
        let shape = self.shape(name)?;
        if shape != wanted && shape != [wanted, &[1]].concat() {
            return Err(format!(
                "{name} have shape {shape:?}: to fit the world and the other arrays, it must be \
                 {wanted:?}"
            ));
        }
        let read = || {
            let flat = |array: Tensor| array.to_dtype(DType::F32)?.flatten_all()?.to_vec1();
            let numbers = self.file.get(name)?.map_or(Ok(Vec::new()), flat)?;
            // The archive compares the CRC-32 of an array where that ends, before which candle stops.
            let mut archive = ZipArchive::new(BufReader::new(File::open(self.path)?))?;
            io::copy(&mut archive.by_name(&format!("{name}.npy"))?, &mut io::sink())?;
            Ok(numbers)
        };
        match read() {
            Ok(numbers) if numbers.len() == wanted.iter().product::<usize>() => Ok(numbers),
            Ok(_) => Err(CHANGED.to_owned()),
            Err(error) => Err(unread_array(name, &error)),
        }
    }

    fn ends(&self, rows: usize) -> Result<Vec<bool>, String> {
        let mut is_last = vec![false; rows];
        for name in ENDS.into_iter().filter(|name| self.has(name)) {
            let ends = self.numbers(name, &[rows])?;
            if let Some(row) = ends.iter().position(|end| end.is_nan()) {
                return Err(format!(
                    "{name}[{row}] is NaN: it must be 1 in the last row of an episode, and else 0"
                ));
            }
            is_last.iter_mut().zip(ends).for_each(|(is_last, end)| *is_last |= end != 0.0);
        }
        Ok(is_last)
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::env::PointMaze;

    #[test]
    fn a_file_that_changes_while_it_is_read_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("d.npz");
        let write = |rows: usize| {
            let array = |columns| Tensor::zeros((rows, columns), DType::F32, &Device::Cpu);
            let arrays = [(STATES, 2), (ACTIONS, 2), (ENDS[0], 1)];
            let arrays = arrays.map(|(name, columns)| (name, array(columns).expect("an array")));
            Tensor::write_npz(&arrays, &file).expect("written");
        };
        let map = Arc::new(crate::map::builtin("trap").expect("built in"));
        let (world, progress) = (PointMaze::new(map, 0), Job::default());
        write(4);
        let checked = checksum(&file, 2, &progress).expect("a checksum");
        let read = || Dataset::read_checked(&file, checked, &world, &progress);
        assert_eq!(read().expect("data").rows(), 4);
        let arrays = Arrays::open(&file, checked.1).expect("arrays");
        write(3);
        assert!(arrays.numbers(STATES, &[4, 2]).is_err(), "no row is missing");
        assert!(read().expect_err("another file").to_string().ends_with(CHANGED));
    }
}
