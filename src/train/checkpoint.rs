//! Checkpoints: one safetensors file with everything a run needs to go on as if it had never stopped.
//!
//! Tensors hold networks (with their optimiser's moments and averages), replay and bridge candidates; the metadata
//! holds the run, its map as plain ASCII, counters and random states as JSON.

use std::collections::HashMap;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::graphs::StoredGraph;
use super::run::Run;
use super::score::Success;
use super::trainer::{Trainer, TrainerState};
use crate::bridge::{ExperienceState, GraphState};
use crate::learn::ReplayState;
use crate::map::{parse_map, print_ascii};

/// What the metadata calls this kind of file.
const FORMAT: &str = "gdg-tui checkpoint 1";

/// The bridge graph in use, and the one to come.
const GRAPHS: [&str; 2] = ["graph", "next_graph"];

/// A checkpoint that cannot be written or taken up.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{}: {what}", file.display())]
#[diagnostic(help("{right}"))]
pub struct CheckpointError {
    /// The file.
    pub file: PathBuf,
    /// What is wrong with it.
    pub what: String,
    /// What would be right.
    pub right: String,
}

/// Tensors on their way to or from a file: name, type and bytes.
#[derive(Default)]
struct Tensors(Vec<(String, Dtype, Vec<u8>)>);

impl Tensors {
    fn f32(&mut self, name: impl Into<String>, values: &[f32]) {
        self.0.push((name.into(), Dtype::F32, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    fn u16(&mut self, name: &str, values: &[u16]) {
        self.0.push((name.to_owned(), Dtype::U16, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    fn u32(&mut self, name: &str, values: &[u32]) {
        self.0.push((name.to_owned(), Dtype::U32, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }

    fn experience(&mut self, name: &str, state: &ExperienceState) {
        self.f32(format!("{name}.spacing"), &[state.spacing]);
        self.f32(format!("{name}.states"), &state.states);
        self.u16(&format!("{name}.observed"), &state.observed);
        self.u32(&format!("{name}.visits"), &state.visits);
        self.u32(&format!("{name}.names"), &state.names);
        self.u32(&format!("{name}.practice"), &state.practice);
    }

    fn u64(&mut self, name: &str, values: &[u64]) {
        self.0.push((name.to_owned(), Dtype::U64, values.iter().flat_map(|v| v.to_le_bytes()).collect()));
    }
}

/// What a checkpoint is of, without its contents.
#[derive(Clone, Debug)]
pub struct Description {
    /// The file.
    pub file: PathBuf,
    /// The map's name.
    pub map: String,
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
        let mut file = std::fs::File::open(path)?;
        let facts = file.metadata()?;
        let mut length = [0; 8];
        file.read_exact(&mut length)?;
        let mut header = Vec::new();
        file.take(u64::from_le_bytes(length).min(MOST_HEADER_BYTES)).read_to_end(&mut header)?;
        Ok::<_, std::io::Error>((header, facts))
    };
    let (header, facts) = read().map_err(|e| unreadable(path, format!("cannot be read: {e}")))?;
    let describe = || {
        // The library wants the whole file before it reads the header.
        let header: Header = serde_json::from_slice(&header).map_err(|_| "is not a safetensors file".to_owned())?;
        let texts = Texts::of(header.metadata)?;
        Ok(Description {
            file: path.to_owned(),
            map: texts.get("map_name")?.to_owned(),
            run: json("run", texts.get("run")?)?,
            updates: json::<TrainerState>("trainer", texts.get("trainer")?)?.counters.updates,
            success: json("success", texts.get("success")?)?,
            bytes: facts.len(),
            written: facts.modified().ok(),
        })
    };
    describe().map_err(|what: String| unreadable(path, what))
}

fn unreadable(path: &Path, what: String) -> CheckpointError {
    let right = "give a checkpoint that gdg-tui saved: saves/NAME.safetensors".to_owned();
    CheckpointError { file: path.to_owned(), what, right }
}

/// What of a safetensors header is read without the tensors.
#[derive(Deserialize)]
struct Header {
    #[serde(rename = "__metadata__")]
    metadata: Option<HashMap<String, String>>,
}

/// The metadata of a checkpoint.
struct Texts(HashMap<String, String>);

impl Texts {
    fn of(metadata: Option<HashMap<String, String>>) -> Result<Self, String> {
        let texts = Self(metadata.unwrap_or_default());
        if texts.get("format")? != FORMAT {
            return Err(format!("is of another format than {FORMAT:?}"));
        }
        Ok(texts)
    }

    fn get(&self, name: &str) -> Result<&str, String> {
        self.0.get(name).map(String::as_str).ok_or_else(|| format!("holds no {name}: it is not a checkpoint"))
    }
}

/// Writes a checkpoint, replacing `path` atomically: a crash leaves the old file or the new one.
///
/// # Errors
/// What the file system or candle report.
pub fn save(trainer: &Trainer, path: &Path, success: Option<Success>) -> Result<(), CheckpointError> {
    let failed = |what: String| CheckpointError {
        file: path.to_owned(),
        what: format!("the checkpoint could not be written: {what}"),
        right: "give a file in a folder that can be written to".to_owned(),
    };
    let bytes = to_bytes(trainer, success).map_err(failed)?;
    write_whole(path, &bytes).map_err(|e| failed(e.to_string()))
}

/// Writes a file as a whole or not at all, in a folder that is made if need be.
///
/// # Errors
/// What the file system reports.
pub fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder)?;
    let mut file = with_usual_permissions().tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// Temporary files are private by default; a checkpoint is as readable as any file that the user creates.
fn with_usual_permissions() -> tempfile::Builder<'static, 'static> {
    #[cfg_attr(not(unix), expect(unused_mut, reason = "only Unix has a mode"))]
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder
}

fn to_bytes(trainer: &Trainer, success: Option<Success>) -> Result<Vec<u8>, String> {
    let mut tensors = Tensors::default();
    let learner = trainer.learner().state().map_err(|e| e.to_string())?;
    for (network, parts) in &learner.networks {
        for (part, values) in parts {
            tensors.f32(format!("{network}.{part}"), values);
        }
    }
    let replay = trainer.replay().state_of_all();
    tensors.u64("replay.written", &replay.written);
    tensors.u64("replay.episode", &replay.episode);
    tensors.f32("replay.states", &replay.states);
    tensors.f32("replay.actions", &replay.actions);
    tensors.f32("replay.goals", &replay.goals);
    tensors.u16("replay.left", &replay.left);
    tensors.experience("bridge", &trainer.experience().state());
    tensors.u32("visited", trainer.visited());
    for (name, graph) in GRAPHS.iter().zip(trainer.graph_state()) {
        let Some(StoredGraph { at, due, state }) = graph else { continue };
        tensors.u64(&format!("{name}.when"), &[at, due]);
        tensors.experience(name, &state.experience);
        tensors.u32(&format!("{name}.ends"), &state.ends);
        tensors.f32(format!("{name}.lengths"), &state.lengths);
    }
    let json = |value: Result<String, serde_json::Error>| value.map_err(|e| e.to_string());
    let metadata = HashMap::from([
        ("format".to_owned(), FORMAT.to_owned()),
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("run".to_owned(), json(serde_json::to_string(trainer.run()))?),
        ("map_name".to_owned(), trainer.map().name().to_owned()),
        ("map".to_owned(), print_ascii(trainer.map())),
        ("learner_updates".to_owned(), learner.updates.to_string()),
        ("trainer".to_owned(), json(serde_json::to_string(&trainer.state()))?),
        ("success".to_owned(), json(serde_json::to_string(&success))?),
    ]);
    let views = tensors.0.iter().map(|(name, dtype, bytes)| {
        let size = dtype.bitsize() / 8;
        TensorView::new(*dtype, vec![bytes.len() / size], bytes).map(|view| (name.as_str(), view))
    });
    let views = views.collect::<Result<Vec<_>, _>>().map_err(|e| e.to_string())?;
    safetensors::serialize(views, Some(metadata)).map_err(|e| e.to_string())
}

/// Takes up the run of a checkpoint.
///
/// # Errors
/// A file that cannot be read or is no checkpoint of this program.
pub fn load(path: &Path, threads: usize) -> Result<Trainer, CheckpointError> {
    let bytes = std::fs::read(path).map_err(|e| unreadable(path, format!("cannot be read: {e}")))?;
    from_bytes(&bytes, threads).map_err(|what| unreadable(path, what))
}

fn from_bytes(bytes: &[u8], threads: usize) -> Result<Trainer, String> {
    let not_ours = |e: safetensors::SafeTensorError| format!("is not a safetensors file: {e}");
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(not_ours)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(not_ours)?;
    let texts = Texts::of(header.metadata().clone())?;
    let run: Run = json("run", texts.get("run")?)?;
    run.settings.check().map_err(|(name, right)| format!("its setting {name} is not {right}"))?;
    let name = texts.get("map_name")?;
    let map = parse_map(name, texts.get("map")?.as_bytes()).map_err(|e| e.to_string())?.named(name);
    let state: TrainerState = json("trainer", texts.get("trainer")?)?;
    let updates = texts.get("learner_updates")?.parse();
    let updates = updates.map_err(|_| "its number of updates is no number".to_owned())?;
    let mut trainer = Trainer::new(run, Arc::new(map), threads).map_err(|e| e.to_string())?;
    let read = Reader(&tensors);
    let network = |network: &str, part: &str| read.f32(&format!("{network}.{part}")).ok();
    trainer.learner_mut().restore(updates, network).map_err(|e| format!("its networks do not fit: {e}"))?;
    trainer.replay_mut().restore(&ReplayState {
        written: read.numbers("replay.written", Dtype::U64, u64::from_le_bytes)?,
        episode: read.numbers("replay.episode", Dtype::U64, u64::from_le_bytes)?,
        states: read.f32("replay.states")?,
        actions: read.f32("replay.actions")?,
        goals: read.f32("replay.goals")?,
        left: read.numbers("replay.left", Dtype::U16, u16::from_le_bytes)?,
    })?;
    trainer.experience_mut().restore(&read.experience("bridge")?)?;
    let graphs = GRAPHS.map(|name| read.graph(name));
    let [current, next] = graphs;
    trainer.restore(state, &[current?, next?], read.u32("visited")?)?;
    Ok(trainer)
}

fn json<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, String> {
    serde_json::from_str(text).map_err(|e| format!("its {name} cannot be read: {e}"))
}

struct Reader<'a>(&'a SafeTensors<'a>);

impl Reader<'_> {
    fn f32(&self, name: &str) -> Result<Vec<f32>, String> {
        self.numbers(name, Dtype::F32, f32::from_le_bytes)
    }

    fn u32(&self, name: &str) -> Result<Vec<u32>, String> {
        self.numbers(name, Dtype::U32, u32::from_le_bytes)
    }

    fn experience(&self, name: &str) -> Result<ExperienceState, String> {
        Ok(ExperienceState {
            spacing: self.f32(&format!("{name}.spacing"))?.first().copied().unwrap_or_default(),
            states: self.f32(&format!("{name}.states"))?,
            observed: self.numbers(&format!("{name}.observed"), Dtype::U16, u16::from_le_bytes)?,
            visits: self.u32(&format!("{name}.visits"))?,
            names: self.u32(&format!("{name}.names"))?,
            practice: self.u32(&format!("{name}.practice"))?,
        })
    }

    /// The bridge graph saved under `name`, if there is one.
    fn graph(&self, name: &str) -> Result<Option<StoredGraph>, String> {
        let when = format!("{name}.when");
        if !self.0.names().iter().any(|known| **known == when) {
            return Ok(None);
        }
        let [at, due] = self.numbers(&when, Dtype::U64, u64::from_le_bytes)?[..] else {
            return Err(format!("its {when} is of another length than 2"));
        };
        let (ends, lengths) = (self.u32(&format!("{name}.ends"))?, self.f32(&format!("{name}.lengths"))?);
        Ok(Some(StoredGraph { at, due, state: GraphState { experience: self.experience(name)?, ends, lengths } }))
    }

    fn numbers<T, const N: usize>(&self, name: &str, dtype: Dtype, parse: fn([u8; N]) -> T) -> Result<Vec<T>, String> {
        let view = self.0.tensor(name).map_err(|_| format!("holds no {name}"))?;
        if view.dtype() != dtype {
            return Err(format!("its {name} is of another type than {dtype:?}"));
        }
        let (numbers, _) = view.data().as_chunks::<N>();
        Ok(numbers.iter().map(|bytes| parse(*bytes)).collect())
    }
}
