//! Checkpoints: one file with everything needed to resume a run exactly where it stopped.
//!
//! It is a safetensors file. Its metadata say what lists of checkpoints show, and hold the history,
//! as JSON; the rest of what [`Trainer::save`] returns is one tensor of bytes, packed without loss.

mod content;

use std::collections::BTreeMap;
use std::fs::Metadata;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use parking_lot::Mutex;
use serde::de::DeserializeOwned;

use super::TrainError;
use super::history::History;
use super::memory;
use super::registry::Registry;
use super::trainer::{About, Saved, Trainer};
use crate::files::{self, FileFacts, FileFormat, Mismatch, Wanted};
use crate::job::Job;
use crate::learn::Threads;
use crate::store::StoreError;
use crate::text::{safe_file_name, sanitized, truncated};
use content::{MAX_HEADER_BYTES, Texts};

const ABOUT: &str = "about";
const HISTORY: &str = "history";

const MAX_REASON_CHARS: usize = 400;

#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", sanitized(&file.to_string_lossy()))]
pub struct CheckpointError {
    pub file: PathBuf,
    pub problem: String,
    pub help: String,
}

type Result<T, E = CheckpointError> = std::result::Result<T, E>;

#[derive(Clone, Debug)]
pub struct RunDescription {
    pub file: PathBuf,
    pub about: About,
    pub bytes: u64,
    pub written: Option<SystemTime>,
}

impl std::ops::Deref for RunDescription {
    type Target = About;

    fn deref(&self) -> &About {
        &self.about
    }
}

const CHECKPOINT: Wanted = Wanted {
    name: "a checkpoint",
    help: "give a checkpoint of gdg-tui with its ending, e.g. saves/NAME.safetensors",
    own: &[FileFormat::Safetensors],
};

/// Reads a checkpoint's summary without its state.
pub fn describe(path: &Path) -> Result<RunDescription> {
    described(path).map(|(found, _)| found)
}

/// Reads a checkpoint's summary and history without its state or its world.
pub fn read_history(path: &Path) -> Result<(RunDescription, History)> {
    let (found, texts) = described(path)?;
    let history = parsed(&texts, HISTORY).map_err(|e| unreadable(path, &e.to_string()))?;
    Ok((found, history))
}

fn described(path: &Path) -> Result<(RunDescription, Texts)> {
    let (start, facts) =
        read_start(path).map_err(|e| unreadable(path, &format!("cannot be read: {e}")))?;
    let read = || {
        let texts = content::texts(&start, facts.len())?;
        Ok::<_, StoreError>((parsed::<About>(&texts, ABOUT)?, texts))
    };
    let (mut about, texts) = read().map_err(|e| unreadable(path, &e.to_string()))?;
    (about.world, about.title) = (safe_file_name(&about.world), safe_file_name(&about.title));
    let (file, written) = (path.to_owned(), facts.modified().ok());
    Ok((RunDescription { file, about, bytes: facts.len(), written }, texts))
}

fn parsed<T: DeserializeOwned>(texts: &Texts, name: &str) -> Result<T, StoreError> {
    let text = texts.get(name).ok_or_else(|| StoreError::missing(name))?;
    serde_json::from_str(text).map_err(|e| StoreError::unreadable(name, e))
}

/// Returns whether the file at `path` is a checkpoint of any version of this program, perhaps a
/// damaged one.
pub fn is_checkpoint(path: &Path) -> bool {
    read_start(path).is_ok_and(|(start, _)| content::is_start_of_checkpoint(&start))
}

/// Reads a safetensors file up to the end of its header, which may be truncated.
fn read_start(path: &Path) -> std::io::Result<(Vec<u8>, Metadata)> {
    let mut file = files::open(path)?;
    let facts = file.metadata()?;
    let mut start = Vec::new();
    (&mut file).take(8).read_to_end(&mut start)?;
    if let Some(length) = start.first_chunk() {
        file.take(u64::from_le_bytes(*length).min(MAX_HEADER_BYTES)).read_to_end(&mut start)?;
    }
    Ok((start, facts))
}

/// Returns the largest size for which there is memory: contents are briefly held twice, as bytes
/// and as numbers.
fn most_bytes() -> u64 {
    memory::available_bytes() / 3
}

/// Returns the error about a file that is no checkpoint: what else it is if that is known, else
/// `problem`.
fn unreadable(path: &Path, problem: &str) -> CheckpointError {
    let found = CHECKPOINT.mismatch(path);
    let found = found.unwrap_or_else(|| Mismatch {
        problem: problem.to_owned(),
        help: CHECKPOINT.help.to_owned(),
    });
    CheckpointError {
        file: path.to_owned(),
        problem: truncated(&found.problem, MAX_REASON_CHARS),
        help: found.help,
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SaveTo {
    /// Replaces the existing file: the run's own, or one that the user agreed to overwrite. Acts
    /// like `CreateNew` if another program has replaced the file in the meantime, or if it is not a
    /// checkpoint.
    Replace(PathBuf),
    /// Writes to this path, or to the path with the suffix `-2`, `-3` ... if it exists: an existing
    /// file belongs to another run.
    CreateNew(PathBuf),
}

impl SaveTo {
    pub fn path(&self) -> &Path {
        match self {
            Self::Replace(path) | Self::CreateNew(path) => path,
        }
    }

    pub fn obstacle(&self) -> &'static str {
        match self {
            Self::CreateNew(path) if !path.exists() => "is a link to a file that is not there",
            _ if !is_checkpoint(self.path()) => "is not a checkpoint of gdg-tui",
            Self::Replace(_) => "is saved by another program as well",
            Self::CreateNew(_) => "belongs to another run",
        }
    }
}

/// Checkpoints that this program has read or written, as they were then: any change since was made
/// by another program.
static KNOWN_FILES: Mutex<BTreeMap<PathBuf, (FileFacts, u32)>> = Mutex::new(BTreeMap::new());

fn remember(path: &Path, facts: Option<FileFacts>, bytes: &[u8]) {
    if let (Ok(path), Some(facts)) = (path.canonicalize(), facts) {
        KNOWN_FILES.lock().insert(path, (facts, crc32fast::hash(bytes)));
    }
}

/// Whether the file at `path` is still what this program has read or written there, if it has.
fn is_unchanged(path: &Path) -> Option<bool> {
    let known = KNOWN_FILES.lock().get(&path.canonicalize().ok()?).copied();
    let ((facts, contents), found) = (known?, FileFacts::of(path)?);
    let is_copy =
        || files::read(path, facts.bytes).is_ok_and(|bytes| crc32fast::hash(&bytes) == contents);
    Some(found == facts || found.bytes == facts.bytes && is_copy())
}

/// Whether the file at `path` must not be replaced: another program has written it since this one
/// last read or wrote it, or may come back to it, or it is not a checkpoint.
fn is_foreign(path: &Path) -> bool {
    !is_unchanged(path).unwrap_or_else(|| !path.exists() || is_checkpoint(path))
        || files::is_in_use(path)
}

/// Whether this program has read or written the checkpoint at `path`, and no other has written it
/// since.
pub fn is_own(path: &Path) -> bool {
    is_unchanged(path) == Some(true)
}

/// Removes a checkpoint if it [`is_own`]. Errors are ignored: a leftover file does no harm.
pub fn remove_own(path: &Path) {
    files::while_locked(path, || {
        if is_own(path) {
            let _ = std::fs::remove_file(path);
        }
    });
}

/// Writes a checkpoint and returns its path. A crash leaves either the old or the new file.
pub fn save(trainer: &Trainer, to: &SaveTo) -> Result<PathBuf> {
    let failed = |problem: String| CheckpointError {
        file: to.path().to_owned(),
        problem: format!("not saved: {problem}"),
        help: "choose a file in a writable folder with enough free space".to_owned(),
    };
    let progress = trainer.job().part("saving");
    if crate::faults::point("save") {
        return Err(failed("injected fault".to_owned()));
    }
    let saved = trainer.save().map_err(|e| failed(e.to_string()))?;
    progress.begin(0, 2);
    let bytes = to_bytes(&saved, &progress).map_err(|e| failed(e.to_string()))?;
    progress.begin(1, 2);
    let path = write(to, &bytes).map_err(|e| failed(e.to_string()))?;
    log::info!("saved {} at update {}", path.display(), trainer.counters().updates);
    Ok(path)
}

/// Saves as [`save`] does, or else in the first of other places that works; returns why, too, if so.
pub fn save_or_else(
    trainer: &Trainer,
    to: &SaveTo,
    others: impl IntoIterator<Item = SaveTo>,
) -> Result<(PathBuf, Option<CheckpointError>), CheckpointError> {
    let why = match save(trainer, to) {
        Ok(path) => return Ok((path, None)),
        Err(why) => why,
    };
    match others.into_iter().find_map(|to| save(trainer, &to).ok()) {
        Some(path) => Ok((path, Some(why))),
        None => Err(why),
    }
}

/// Returns the bytes of a checkpoint file, and says how far it is.
pub fn to_bytes(saved: &Saved, progress: &Job) -> Result<Vec<u8>, StoreError> {
    let Saved { about, history, state } = saved;
    let text = |value: serde_json::Result<String>| {
        value.map_err(|e| StoreError::unreadable("description", e))
    };
    let texts = Texts::from([
        (ABOUT.to_owned(), text(serde_json::to_string(about))?),
        (HISTORY.to_owned(), text(serde_json::to_string(history))?),
    ]);
    let state = crate::store::to_bytes(state).map_err(|e| StoreError::unreadable("state", e))?;
    Ok(content::to_bytes(&texts, &state, progress))
}

fn write(to: &SaveTo, bytes: &[u8]) -> std::io::Result<PathBuf> {
    if let SaveTo::Replace(path) = to {
        // Another program that has resumed the same file may be about to replace it too.
        let replaced = files::while_locked(path, || {
            if is_foreign(path) {
                return Ok::<_, std::io::Error>(false);
            }
            files::write_atomically(path, bytes)?;
            remember(path, FileFacts::of(path), bytes);
            Ok(true)
        });
        if replaced.transpose()? == Some(true) {
            return Ok(path.clone());
        }
    }
    let path = files::write_to_unused(to.path(), bytes)?;
    remember(&path, FileFacts::of(&path), bytes);
    Ok(path)
}

const LOAD_STAGES: usize = 3;

pub fn load(path: &Path, registry: &Arc<Registry>, threads: impl Into<Threads>) -> Result<Trainer> {
    load_with(path, registry, threads, &Job::default())
}

/// Like [`load`], and says how far it is.
pub fn load_with(
    path: &Path,
    registry: &Arc<Registry>,
    threads: impl Into<Threads>,
    progress: &Job,
) -> Result<Trainer> {
    progress.begin(0, LOAD_STAGES);
    let facts = FileFacts::of(path);
    let threads = threads.into();
    let bytes = files::read(path, most_bytes())
        .map_err(|e| unreadable(path, &format!("cannot be read: {e}")))?;
    let parse = || {
        progress.begin(1, LOAD_STAGES);
        let saved = read_saved(&bytes)?;
        progress.begin(2, LOAD_STAGES);
        Trainer::load(saved, registry, threads, progress)
    };
    match parse() {
        Ok(trainer) => {
            remember(path, facts, &bytes);
            Ok(trainer)
        }
        Err(TrainError::Env(error)) => Err(CheckpointError {
            file: path.to_owned(),
            problem: format!("cannot be resumed here: {error}"),
            help: "the checkpoint itself is sound: resume it where its environment works"
                .to_owned(),
        }),
        Err(error) => Err(unreadable(path, &error.to_string())),
    }
}

pub fn from_bytes(
    bytes: &[u8],
    registry: &Arc<Registry>,
    threads: impl Into<Threads>,
) -> Result<Trainer, TrainError> {
    Trainer::load(read_saved(bytes)?, registry, threads, &Job::default())
}

pub fn read_saved(bytes: &[u8]) -> Result<Saved, StoreError> {
    let (texts, state) = content::from_bytes(bytes, most_bytes())?;
    let state = postcard::from_bytes(&state).map_err(|e| StoreError::unreadable("state", e))?;
    Ok(Saved { about: parsed(&texts, ABOUT)?, history: parsed(&texts, HISTORY)?, state })
}

/// Returns the checkpoint with its unpacked state changed, as an attacker would, for tests of what
/// reads it; `None` if it is not a checkpoint.
pub fn with_changed_state(bytes: &[u8], change: impl FnOnce(&mut Vec<u8>)) -> Option<Vec<u8>> {
    let (mut texts, mut state) = content::from_bytes(bytes, most_bytes()).ok()?;
    change(&mut state);
    texts.retain(|name, _| name == ABOUT || name == HISTORY);
    Some(content::to_bytes(&texts, &state, &Job::default()))
}
