//! Reads runs, with what their evaluations found: from results of experiments, checkpoints and
//! records.

mod columns;
mod join;
mod reader;
mod records;

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use jiff::Timestamp;
use miette::{Report, miette};
use serde::Serialize;
use serde_json::{Map, Value};

use super::folder::read_result;
use super::spec::{EvaluationAt, JobResult, evaluations, setting_text};
use crate::host::report::from_checkpoint_error;
use crate::host::runs::files_in;
pub use columns::{COLUMNS, WRITTEN, name, table};
use gdg::files::{has_extension, is_hidden};
use gdg::job::Job;
use gdg::text::{counted, sanitized};
use gdg::train::{Evaluation, is_checkpoint, read_history};
pub use join::{Dated, join_resumed};
use join::{join, whole};
pub use reader::{Found, Reader};
pub use records::{Ending, Skipped};

/// Records that have not grown for this long are not of a running run.
const QUIET: Duration = Duration::from_mins(1);

/// The fingerprint of the world of a run whose map was edited: there were several.
pub const EDITED: &str = "edited";

const HELP: &str = "give a folder of gdg-tui suite or reproduce, a folder of checkpoints, a \
                    checkpoint, or the records of gdg-tui --no-ui in a file";

/// A run's evaluations, and what it is.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedRun {
    pub source: PathBuf,
    pub kind: Kind,
    /// Its map, or the world if there is none.
    pub map: String,
    /// What tells that apart from others of its name, if it is known; [`EDITED`] if it changed.
    pub fingerprint: Option<String>,
    pub method: String,
    pub variant: Option<String>,
    /// The preset, and the settings that differ from it.
    pub settings: Vec<String>,
    pub seed: u64,
    /// Updates from which these records go on; 0 for a run from its beginning.
    pub begun: u64,
    /// The checkpoint that they go on from, if they say so.
    pub resumed: Option<PathBuf>,
    pub updates: u64,
    /// Its evaluations, oldest first.
    pub evaluations: Vec<EvaluationAt>,
    /// Its checkpoint, if it is known to have had one.
    pub checkpoint: Option<PathBuf>,
    /// Its other files, which are not listed besides.
    pub others: Vec<PathBuf>,
    /// What of its records cannot be read.
    pub skipped: Skipped,
}

/// What distinguishes a run from others: its map with its fingerprint, method, settings and seed.
pub type Identity = (String, Option<String>, String, Vec<String>, u64);

/// What a run was read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Result,
    Checkpoint,
    Records(Ending),
}

/// What has become of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    Done,
    /// It was saved, and can go on.
    Saved,
    Interrupted,
    /// It goes on: its records grow.
    Running,
    /// Its records have neither an end nor grown lately.
    CutOff,
}

impl State {
    pub fn name(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Saved => "saved",
            Self::Interrupted => "stopped",
            Self::Running => "running",
            Self::CutOff => "cut off",
        }
    }
}

impl SavedRun {
    /// Returns what has become of it, given when its file was `written`.
    pub fn state(&self, written: Option<SystemTime>) -> State {
        let grows = || {
            // Another machine's clock may be ahead.
            let age = written.map(|at| at.elapsed().unwrap_or_default());
            age.is_some_and(|age| age < QUIET)
        };
        match self.kind {
            Kind::Result | Kind::Records(Ending::Finished) => State::Done,
            Kind::Checkpoint | Kind::Records(Ending::Continued) => State::Saved,
            Kind::Records(Ending::Interrupted) => State::Interrupted,
            Kind::Records(Ending::Open) if grows() => State::Running,
            Kind::Records(Ending::Open) => State::CutOff,
        }
    }

    pub fn of_result(result: JobResult, source: PathBuf) -> Self {
        let checkpoint = Some(source.with_extension("safetensors")).filter(|path| path.is_file());
        Self {
            source,
            kind: Kind::Result,
            fingerprint: result.fingerprint().map(str::to_owned),
            map: result.world,
            method: result.method.name(),
            variant: result.variant,
            settings: with_preset(result.preset.name(), result.settings),
            seed: result.seed,
            begun: 0,
            resumed: None,
            updates: result.updates,
            evaluations: result.evaluations,
            others: checkpoint.iter().cloned().collect(),
            checkpoint,
            skipped: Skipped::default(),
        }
    }

    /// Returns what of its records is left out, for a line of its own.
    pub fn note(&self) -> Option<String> {
        let Self { source, skipped, .. } = self;
        (skipped.lines > 0).then(|| sanitized(&format!("{}:{skipped}: left out", source.display())))
    }

    /// Returns what distinguishes it from the other runs of its file.
    pub fn identity(&self) -> Identity {
        let world = (self.map.clone(), self.fingerprint.clone());
        (world.0, world.1, self.method.clone(), self.settings.clone(), self.seed)
    }

    pub fn last(&self) -> Option<&Evaluation> {
        self.evaluations.last().map(|at| &at.evaluation)
    }
}

/// A run as a line of JSON.
#[derive(Debug, Serialize)]
pub struct RunLine<'a> {
    file: Cow<'a, str>,
    /// What the file is: `checkpoint`, `result` or `records`.
    kind: &'static str,
    state: &'static str,
    map: &'a str,
    /// What tells that apart from others of its name, if it is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    fingerprint: Option<&'a str>,
    method: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    variant: Option<&'a str>,
    seed: u64,
    /// The preset, and settings that differ from it.
    settings: Map<String, Value>,
    updates: u64,
    /// Updates at the last evaluation, and its results.
    evaluated_at: Option<u64>,
    success: Option<f64>,
    greedy: Option<f64>,
    distance_error: Option<f64>,
    coverage: Option<f64>,
    written: Option<String>,
    checkpoint: Option<Cow<'a, str>>,
}

impl SavedRun {
    /// Returns it as a line of JSON, given when its file was `written`.
    pub fn line(&self, written: Option<SystemTime>) -> RunLine<'_> {
        let last = self.evaluations.last();
        let evaluation = last.map(|at| &at.evaluation);
        let setting = |text: &String| {
            let (name, value) = text.split_once('=')?;
            let value = serde_json::from_str(value).unwrap_or_else(|_| value.into());
            Some((name.to_owned(), value))
        };
        RunLine {
            // JSON has no bytes that are not text.
            file: self.source.to_string_lossy(),
            kind: match self.kind {
                Kind::Result => "result",
                Kind::Checkpoint => "checkpoint",
                Kind::Records(_) => "records",
            },
            state: self.state(written).name(),
            map: &self.map,
            fingerprint: self.fingerprint.as_deref(),
            method: &self.method,
            variant: self.variant.as_deref(),
            seed: self.seed,
            settings: self.settings.iter().filter_map(setting).collect(),
            updates: self.updates,
            evaluated_at: last.map(|at| at.updates),
            success: evaluation.and_then(Evaluation::success_rate),
            greedy: evaluation.and_then(|last| last.greedy.success),
            distance_error: evaluation.and_then(|last| Some(last.distance_error?.mape)),
            coverage: evaluation.and_then(|last| last.coverage),
            written: written.and_then(|at| Some(Timestamp::try_from(at).ok()?.to_string())),
            // It may have been deleted since.
            checkpoint: self
                .checkpoint
                .as_deref()
                .filter(|path| path.is_file())
                .map(Path::to_string_lossy),
        }
    }
}

fn with_preset(preset: &str, settings: impl IntoIterator<Item = String>) -> Vec<String> {
    [format!("preset={preset}")].into_iter().chain(settings).collect()
}

/// Reads all runs at `paths`, says how far it is, and what in folders cannot be used.
pub fn runs(paths: &[PathBuf], progress: &Job) -> Result<(Vec<SavedRun>, Vec<String>), Report> {
    let (mut runs, mut notes) = (Vec::new(), Vec::new());
    for (i, path) in paths.iter().enumerate() {
        progress.begin(i, paths.len());
        if !path.is_dir() {
            runs.extend(file(path)?);
            continue;
        }
        let (before, files) = (runs.len(), files_of(path)?);
        for (i, path) in files.iter().enumerate() {
            progress.set(i, files.len());
            match file(path) {
                Ok(found) => runs.extend(found),
                Err(problem) => notes.push(format!("{problem}: left out")),
            }
        }
        if runs.len() == before {
            return Err(miette!(help = HELP, "{}: no runs here{}", path.display(), lines(&notes)));
        }
    }
    // A file may be named twice, or be in a folder that is.
    let mut known = HashSet::new();
    runs.retain(|run| known.insert((whole(&run.source), run.identity())));
    // The checkpoints may be in another folder than the records.
    let joined = join(runs.into_iter().map(|run| (Arc::new(run), None)).collect());
    let mut runs: Vec<_> = joined.into_iter().map(|(run, _)| Arc::unwrap_or_clone(run)).collect();
    notes.extend(runs.iter().filter_map(SavedRun::note));
    let evaluated = runs.iter().filter(|run| !run.evaluations.is_empty()).count();
    if evaluated == 0 {
        let source = runs.first().map_or(String::new(), |run| run.source.display().to_string());
        let help = "runs are evaluated on the way with --eval-every-updates N, and at the end";
        return Err(miette!(help = help, "{source}: no evaluation yet{}", lines(&notes)));
    }
    if evaluated < runs.len() {
        let without = counted((runs.len() - evaluated) as u64, "run");
        notes.push(format!("{without} without an evaluation yet: left out"));
        runs.retain(|run| !run.evaluations.is_empty());
    }
    Ok((runs, notes))
}

fn lines(notes: &[String]) -> String {
    notes.iter().map(|note| format!("\n{note}")).collect()
}

/// Returns the files with runs in a folder: results, records and checkpoints of its jobs if it is
/// an experiment's, then its own records and checkpoints.
pub fn files_of(folder: &Path) -> Result<Vec<PathBuf>, Report> {
    let listed = |folder: &Path, extensions: &[&str]| {
        let entries = std::fs::read_dir(folder).map_err(|error| unreadable(folder, &error))?;
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        let is_listed = |file: &Path| extensions.iter().any(|known| has_extension(file, known));
        files.retain(|file| is_listed(file) && !is_hidden(file) && !file.is_dir());
        files.extend(files_in(folder).map_err(|error| unreadable(folder, &error))?);
        files.sort();
        Ok::<_, Report>(files)
    };
    let jobs = folder.join("jobs");
    let mut of_jobs = if jobs.is_dir() { listed(&jobs, &["json", "jsonl"])? } else { Vec::new() };
    // Results replace checkpoints, which take longer to read.
    let results: HashSet<PathBuf> =
        of_jobs.iter().filter(|file| has_extension(file, "json")).cloned().collect();
    of_jobs.retain(|file| {
        !has_extension(file, "safetensors") || !results.contains(&file.with_extension("json"))
    });
    Ok(of_jobs.into_iter().chain(listed(folder, &["jsonl"])?).collect())
}

pub fn file(path: &Path) -> Result<Vec<SavedRun>, Report> {
    if is_checkpoint(path) || has_extension(path, "safetensors") {
        return checkpoint(path).map(|run| vec![run]);
    }
    if has_extension(path, "json") {
        match read_result(path) {
            Ok(result) => return Ok(vec![SavedRun::of_result(result, path.to_owned())]),
            Err(problem) if is_of_job(path) => {
                return Err(miette!("{}", sanitized(&format!("{}: {problem}", path.display()))));
            }
            Err(_) => {}
        }
    }
    records::read(path)
}

fn is_of_job(path: &Path) -> bool {
    path.parent().is_some_and(|parent| parent.ends_with("jobs"))
}

fn unreadable(path: &Path, error: &std::io::Error) -> Report {
    miette!(help = HELP, "{}: cannot be read: {error}", path.display())
}

fn checkpoint(path: &Path) -> Result<SavedRun, Report> {
    let (found, history) = read_history(path).map_err(from_checkpoint_error)?;
    let changed = found.run.changed_settings();
    let settings = changed.iter().map(|(name, value)| setting_text(name, value));
    let mut evaluations = evaluations(&history);
    // What other methods reached before is not this method's.
    evaluations.retain(|at| history.methods().is_current(at.updates));
    Ok(SavedRun {
        source: path.to_owned(),
        kind: Kind::Checkpoint,
        map: if found.title.is_empty() { found.world.clone() } else { found.title.clone() },
        fingerprint: match history.edits() {
            [] => found.fingerprint.clone(),
            _ => Some(EDITED.to_owned()),
        },
        method: found.run.method.name(),
        variant: None,
        settings: with_preset(found.run.preset.name(), settings),
        seed: found.run.seed,
        begun: 0,
        resumed: None,
        updates: found.updates,
        evaluations,
        checkpoint: Some(path.to_owned()),
        others: Vec::new(),
        skipped: Skipped::default(),
    })
}
