//! Checkpoints: one safetensors file with everything a run needs to go on as if it had never stopped.
//!
//! Tensors hold networks (with their optimiser's moments and averages), replay and bridge candidates; the metadata
//! holds the run, its world (a map as plain ASCII), counters, random states and history as JSON, and a checksum over
//! all. What [`Trainer::save`] writes and [`Trainer::load`] reads becomes a file here.

mod content;

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use parking_lot::Mutex;

use super::error::TrainError;
use super::memory;
use super::registry::Registry;
use super::run::Run;
use super::score::Success;
use super::trainer::{Trainer, TrainerState};
use crate::files;
use crate::text::{file_name, plain, shortened};
pub use content::resealed;
use content::{ContentError, texts_from_header};

/// The most characters of a reason that are shown: it may quote the file.
const SHOWN: usize = 400;

/// A checkpoint that cannot be written or loaded.
#[derive(Debug, thiserror::Error)]
#[error("{}: {what}", plain(&file.to_string_lossy()))]
pub struct CheckpointError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    pub what: String,
    /// What would be right.
    pub right: String,
}

/// What a checkpoint is of, without its contents.
#[derive(Clone, Debug)]
pub struct Description {
    /// The file.
    pub file: PathBuf,
    /// What its world is called: the map's name.
    pub title: String,
    /// Method, preset, seed and settings.
    pub run: Run,
    /// Updates done.
    pub updates: u64,
    /// How it did, if it was evaluated before it was saved.
    pub success: Option<Success>,
    /// Size of the file in bytes.
    pub bytes: u64,
    /// When it was written.
    pub written: Option<SystemTime>,
}

/// The longest header that is read: far more than any checkpoint of this program has.
const MOST_HEADER_BYTES: u64 = 64 << 20;

/// Reads what a checkpoint is of; its tensors are left alone.
///
/// # Errors
/// A file that cannot be read or is no checkpoint of this program.
pub fn describe(path: &Path) -> Result<Description, CheckpointError> {
    let read = || {
        let mut file = files::open(path)?;
        let facts = file.metadata()?;
        let mut length = [0; 8];
        file.read_exact(&mut length)?;
        let mut header = Vec::new();
        file.take(u64::from_le_bytes(length).min(MOST_HEADER_BYTES)).read_to_end(&mut header)?;
        Ok::<_, std::io::Error>((header, facts))
    };
    let (header, facts) = read().map_err(|e| unreadable(path, &format!("cannot be read: {e}")))?;
    let describe = || {
        let store = texts_from_header(&header)?;
        Ok::<_, ContentError>(Description {
            file: path.to_owned(),
            // Former formats had maps alone.
            title: file_name(store.text("title").or_else(|_| store.text("map_name"))?),
            run: store.json("run")?,
            updates: store.json::<TrainerState>("trainer")?.counters.updates,
            success: store.json("success")?,
            bytes: facts.len(),
            written: facts.modified().ok(),
        })
    };
    describe().map_err(|e| unreadable(path, &e.to_string()))
}

fn unreadable(path: &Path, what: &str) -> CheckpointError {
    let right = "give a checkpoint that gdg-tui saved: saves/NAME.safetensors".to_owned();
    CheckpointError { file: path.to_owned(), what: shortened(what, SHOWN), right }
}

/// Where a checkpoint goes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SaveTo {
    /// Replaces what is there: the run's own file, or one that the user said to replace. If another program has
    /// replaced it meanwhile, the same as `Fresh`.
    Own(PathBuf),
    /// At this path, or where something is there already, at `-2`, `-3` ... of it: that belongs to another run.
    Fresh(PathBuf),
}

impl SaveTo {
    /// The path as it was asked for.
    pub fn path(&self) -> &Path {
        match self {
            Self::Own(path) | Self::Fresh(path) => path,
        }
    }
}

/// Files that this program has read or written, as they were then: what has changed since is another program's.
static KNOWN: Mutex<BTreeMap<PathBuf, Identity>> = Mutex::new(BTreeMap::new());

/// Distinguishes a file from another one at the same path.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Identity {
    bytes: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl Identity {
    fn of(path: &Path) -> Option<Self> {
        let facts = std::fs::metadata(path).ok()?;
        #[cfg(unix)]
        let inode = std::os::unix::fs::MetadataExt::ino(&facts);
        #[cfg(not(unix))]
        let inode = 0;
        Some(Self { bytes: facts.len(), modified: facts.modified().ok(), inode })
    }

    /// Records the current identity of the file at `path`.
    fn remember(path: &Path) {
        if let (Ok(path), Some(identity)) = (path.canonicalize(), Self::of(path)) {
            KNOWN.lock().insert(path, identity);
        }
    }

    /// Whether the file at `path` was this program's and has been replaced by another's since.
    fn is_foreign(path: &Path) -> bool {
        let known = path.canonicalize().ok().and_then(|path| KNOWN.lock().get(&path).copied());
        known.is_some_and(|known| Self::of(path) != Some(known))
    }
}

/// Writes a checkpoint; where it went. A crash leaves the old file or the new one, and the old one is kept until the
/// new one has been read back.
///
/// # Errors
/// What the file system or the learner report; numbers that are not finite.
pub fn save(trainer: &Trainer, to: &SaveTo) -> Result<PathBuf, CheckpointError> {
    let failed = |what: String| CheckpointError {
        file: to.path().to_owned(),
        what: format!("not saved: {what}"),
        right: "give a file in a folder that can be written to, with room for it".to_owned(),
    };
    if crate::faults::point("save") {
        return Err(failed("a fault on demand".to_owned()));
    }
    let store = trainer.save().map_err(|e| failed(e.to_string()))?;
    let bytes = content::to_bytes(store).map_err(|e| failed(e.to_string()))?;
    let written = match to {
        SaveTo::Own(path) if Identity::is_foreign(path) => files::write_fresh(path, &bytes),
        SaveTo::Own(path) => {
            let whole = |found: &[u8]| found == bytes && content::from_bytes(found).is_ok();
            files::write_verified(path, &bytes, whole).map(|()| path.clone())
        }
        SaveTo::Fresh(path) => files::write_fresh(path, &bytes),
    };
    let path = written.map_err(|e| failed(e.to_string()))?;
    Identity::remember(&path);
    tracing::info!("saved {} at update {}", path.display(), trainer.counters().updates);
    Ok(path)
}

/// A run loaded from a checkpoint.
pub struct Loaded {
    /// The run.
    pub trainer: Trainer,
    /// What the user should know: that the file was damaged and the one before it was taken.
    pub warning: Option<String>,
}

/// Loads the run of a checkpoint, or of its backup if the file is damaged and there is one.
///
/// # Errors
/// A file that cannot be read or is no checkpoint of this program.
pub fn load(path: &Path, registry: &Arc<Registry>, threads: usize) -> Result<Loaded, CheckpointError> {
    let load = |file: &Path| {
        // Its contents are held twice for a moment, as bytes and as numbers.
        let bytes = files::read(file, memory::available() / 3).map_err(|e| format!("cannot be read: {e}"))?;
        from_bytes(&bytes, registry, threads).map_err(|e| e.to_string())
    };
    let backup = files::backup_of(path);
    Identity::remember(path);
    match load(path) {
        Ok(trainer) => Ok(Loaded { trainer, warning: None }),
        Err(what) => match backup.is_file().then(|| load(&backup)) {
            Some(Ok(trainer)) => {
                let (what, name) = (shortened(&what, SHOWN), plain(&path.to_string_lossy()));
                let warning = format!("{name} {what}; the save before it was taken: {name}.bak");
                tracing::warn!("{warning}");
                Ok(Loaded { trainer, warning: Some(warning) })
            }
            _ => Err(unreadable(path, &what)),
        },
    }
}

/// Why bytes are not taken as a checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// They are none, or damaged.
    #[error(transparent)]
    Content(#[from] ContentError),
    /// The run in them cannot go on.
    #[error(transparent)]
    Train(#[from] TrainError),
}

/// Loads the run from a checkpoint's bytes.
///
/// # Errors
/// What is wrong with them.
pub fn from_bytes(bytes: &[u8], registry: &Arc<Registry>, threads: usize) -> Result<Trainer, LoadError> {
    Ok(Trainer::load(&content::from_bytes(bytes)?, registry, threads)?)
}
