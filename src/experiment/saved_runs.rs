//! Reads runs, with what their evaluations found: from results of experiments, checkpoints and
//! records.

mod columns;
mod join;
mod read_records;
mod reader;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use jiff::Timestamp;
use miette::{Report, miette};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::folder::{picture_name, read_result};
use super::spec::{EvaluationAt, JobResult, evaluations, setting_text};
use crate::headless::PROGRESS_EVERY_UPDATES;
use crate::headless::records::Progress;
use crate::process::errors::from_checkpoint_error;
use crate::setup::saves::files_in;
pub use columns::{COLUMNS, RunCells, WRITTEN, changed, differing, name, table};
use gdg::files::{has_extension, is_hidden, is_in_use};
use gdg::job::Job;
use gdg::text::{counted, sanitized};
use gdg::train::{Evaluation, is_checkpoint, read_history};
pub use join::whole;
pub use read_records::RecordsReader;
pub use reader::{FoundRuns, RunReader, checkpoints_below};

/// Records that have not grown for this long are not of a running run.
const QUIET: Duration = Duration::from_mins(1);

/// A file that has been empty for this long is no run that has just begun.
const BEGINS: Duration = Duration::from_secs(10);

/// Jobs save more often than this, and so do interfaces by themselves.
const MOST_BETWEEN_SAVES: Duration = Duration::from_mins(15);

const HELP: &str = "give a folder of gdg-tui suite or reproduce, a folder of checkpoints, a \
                    checkpoint, or the records of gdg-tui --no-ui in a file";

/// What seeds of one thing have in common besides method and settings, but parts of one run need
/// not: edits of the map, tasks at each distance in evaluations, and the program's version.
pub const CIRCUMSTANCES: [&str; 3] = ["edit", "eval-tasks", "version"];

/// Most edits that are listed one by one.
const MAX_EDITS: usize = 4;

/// A map after an edit of which nothing is known.
const UNKNOWN: &str = "?";

/// A run with its evaluations, or a file that has none that can be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SavedRun {
    pub source: PathBuf,
    pub kind: RunKind,
    pub written: Option<SystemTime>,
    /// What has become of it; unknown of records without an end.
    pub end: Option<RunState>,
    /// Its map, or the world if there is none.
    pub map: String,
    /// What tells that apart from others of its name, if it is known, as it was before all edits.
    pub fingerprint: Option<String>,
    /// Updates at which its map was edited, and checksum or name of the map from then on, if known.
    pub edits: Vec<(u64, String)>,
    pub method: String,
    pub variant: Option<String>,
    /// The preset, and the settings that differ from it.
    pub settings: Vec<String>,
    pub seed: u64,
    /// The program's version, and tasks at each distance in evaluations, if they are known.
    pub version: Option<String>,
    pub eval_tasks: Option<u32>,
    /// Updates from which these records go on; 0 for a run from its beginning.
    pub begun: u64,
    /// The checkpoint that they go on from, if they say so.
    pub resumed: Option<PathBuf>,
    pub updates: u64,
    pub progress: Progress,
    /// The file that it is going to be saved to, and how often, in seconds: otherwise at the end.
    pub saves: Option<(PathBuf, Option<f64>)>,
    pub evaluations: Vec<EvaluationAt>,
    /// Its checkpoint, if it is known to have had one.
    pub checkpoint: Option<PathBuf>,
    /// Updates at which its records say that it was saved last.
    pub saved_at: Option<u64>,
    /// Its other files, which are not listed besides.
    pub others: Vec<PathBuf>,
    /// What of it cannot be read, as it follows the name of the file: `:3: not a record`.
    pub problem: Option<String>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RunKind {
    #[default]
    Records,
    Result,
    Checkpoint,
    /// Nothing: the file, or the folder, cannot be read.
    Damaged,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunState {
    /// Nobody trains it any more: it can go on if it was saved.
    Ended,
    /// A checkpoint alone does not tell whether a program trains it.
    Saved,
    Interrupted,
    /// It goes on: its records grow, or a program has its checkpoint open.
    Running,
    /// Its records have neither an end nor grown lately.
    CutOff,
}

impl RunState {
    pub fn name(self) -> &'static str {
        match self {
            Self::Ended => "ended",
            Self::Saved => "saved",
            Self::Interrupted => "stopped",
            Self::Running => "training",
            Self::CutOff => "cut off",
        }
    }
}

impl SavedRun {
    pub fn of_result(result: JobResult, source: PathBuf) -> Self {
        let checkpoint = Some(source.with_extension("safetensors")).filter(|path| path.is_file());
        let out = source.parent().and_then(Path::parent);
        let picture = out.map(|out| out.join(picture_name(&result.name)));
        let picture = picture.filter(|path| path.is_file());
        let data = result.data.map(|data| data.checksum);
        // As records and checkpoints call it.
        let id = result.world.strip_prefix("gym:").and_then(|address| address.rsplit(':').next());
        Self {
            source,
            kind: RunKind::Result,
            end: Some(RunState::Ended),
            fingerprint: result.fingerprint,
            map: id.unwrap_or(&result.world).to_owned(),
            method: result.method.name(),
            variant: result.variant,
            settings: facts(result.preset.name(), result.settings, data, None),
            seed: result.seed,
            version: Some(result.version),
            eval_tasks: result.eval_tasks,
            updates: result.updates,
            evaluations: result.evaluations,
            others: checkpoint.iter().cloned().chain(picture).collect(),
            checkpoint,
            ..Self::default()
        }
    }

    fn damaged(source: &Path, problem: &Report) -> Self {
        let (text, name) = (problem.to_string(), source.display().to_string());
        let problem = text.strip_prefix(&name).map_or(format!(": {text}"), str::to_owned);
        let problem = Some(sanitized(&problem));
        Self { source: source.to_owned(), kind: RunKind::Damaged, problem, ..Self::default() }
    }

    pub fn is_damaged(&self) -> bool {
        self.kind == RunKind::Damaged
    }

    pub fn state(&self) -> RunState {
        let is_within = |limit| self.written.is_some_and(|at| is_recent(at, limit));
        // The process of a job holds a file beside its checkpoint, which one that was killed leaves behind.
        let is_held = || self.source.with_extension("lock").is_file();
        // Some times the time between two of its records.
        let seconds = 3.0 * PROGRESS_EVERY_UPDATES as f64 / self.progress.updates_per_second;
        let pause = Duration::try_from_secs_f64(seconds).unwrap_or_default();
        let (is_job, is_new) = (self.kind == RunKind::Checkpoint, is_within(MOST_BETWEEN_SAVES));
        let is_open = || self.others.iter().chain([&self.source]).any(|file| is_in_use(file));
        match self.end {
            Some(_) if is_new && (is_job && is_held() || is_open()) => RunState::Running,
            Some(end) => end,
            None if self.method.is_empty() && !is_within(BEGINS) => RunState::CutOff,
            None if is_within(QUIET.max(pause)) || is_in_use(&self.source) => RunState::Running,
            None => RunState::CutOff,
        }
    }

    /// Returns its checkpoint if it is there: the one that it names, or the one beside its records.
    pub fn kept(&self) -> Option<PathBuf> {
        let beside = self.source.with_extension("safetensors");
        let beside = (self.kind == RunKind::Records).then_some(beside);
        [self.checkpoint.clone(), beside].into_iter().flatten().find(|path| path.is_file())
    }

    /// Returns what of it is left out, for a line of its own.
    pub fn note(&self) -> Option<String> {
        let (source, problem) = (self.source.display().to_string(), self.problem.as_ref()?);
        Some(format!("{}{problem}: left out", sanitized(&source)))
    }

    /// Returns what distinguishes it from the other runs of its file.
    pub fn identity(&self) -> (&str, Option<&str>, &str, &[String], u64) {
        (&self.map, self.fingerprint.as_deref(), &self.method, &self.settings, self.seed)
    }

    /// Returns its [`CIRCUMSTANCES`]; `None` if one is unknown.
    pub fn circumstances(&self) -> [Option<String>; 3] {
        let edit = |(at, to): &(u64, String)| format!("{at}:{to}");
        let mut edits = self.edits.iter().map(edit).collect::<Vec<_>>().join(",");
        if self.edits.len() > MAX_EDITS {
            let checksum = crc32fast::hash(edits.as_bytes());
            edits = format!("{} times:{checksum:08x}", self.edits.len());
        }
        [Some(edits), self.eval_tasks(), self.version.clone()]
    }

    /// Tasks at each distance: `10`, or `10,3` if a resumed run had others, with their scenarios if
    /// these differ; of the last, jobs may have more.
    fn eval_tasks(&self) -> Option<String> {
        let all = self.evaluations.iter().map(|EvaluationAt { evaluation, .. }| {
            Some((evaluation.alone.tasks_per_distance()?, evaluation.scenario.as_deref()))
        });
        let all: Option<Vec<_>> = all.collect();
        let mut all = self.eval_tasks.map(|own| vec![(own, None)]).or(all)?;
        all.dedup();
        let differ = all.iter().any(|(_, scenario)| *scenario != all[0].1);
        let text = |(tasks, scenario): &(u32, Option<&str>)| match scenario {
            Some(scenario) if differ => format!("{tasks} of {scenario}"),
            _ => tasks.to_string(),
        };
        let all = all.iter().map(text).collect::<Vec<_>>().join(",");
        (!all.is_empty()).then_some(all)
    }

    pub fn plans(&self) -> bool {
        self.evaluations.iter().any(|at| at.evaluation.planned.is_some())
    }

    fn of_last<T>(&self, value: impl Fn(&Evaluation) -> Option<T>) -> Option<T> {
        value(&self.evaluations.last()?.evaluation)
    }

    pub fn json(&self) -> Value {
        let number = |text: &str| serde_json::from_str(text).unwrap_or_else(|_| text.into());
        let setting = |(name, value): (&str, &str)| (name.to_owned(), number(value));
        let settings = self.settings.iter().filter_map(|text| text.split_once('=')).map(setting);
        let written = self.written.and_then(|at| Some(Timestamp::try_from(at).ok()?.to_string()));
        // It may have been deleted since. JSON has no bytes that are not text.
        let checkpoint = self.checkpoint.as_deref().filter(|path| path.is_file());
        json!({
            "file": self.source.to_string_lossy(),
            "kind": self.kind,
            "state": self.state().name(),
            "map": self.map,
            "fingerprint": self.fingerprint,
            "method": self.method,
            "variant": self.variant,
            "seed": self.seed,
            "version": self.version,
            "eval_tasks": self.eval_tasks().map(|own| number(&own)),
            "edits": self.edits,
            "settings": settings.collect::<Map<_, _>>(),
            "updates": self.updates,
            "evaluated_at": self.evaluations.last().map(|at| at.updates),
            "success": self.of_last(Evaluation::success_rate),
            "alone": self.of_last(|last| last.alone.success),
            "error": self.of_last(|last| Some(last.error?.mape)),
            "explored": self.of_last(|last| last.explored),
            "written": written,
            "checkpoint": checkpoint.map(Path::to_string_lossy),
        })
    }
}

/// Returns the preset, the settings that differ from it, and what else runs differ in: seeds are
/// those of one thing only if they learned from the same data and were evaluated on the same tasks.
fn facts(
    preset: &str,
    settings: impl IntoIterator<Item = String>,
    data: Option<u32>,
    scenario: Option<String>,
) -> Vec<String> {
    let data = data.map(|checksum| format!("data={checksum:08x}"));
    let scenario = scenario.map(|tasks| format!("scenario={tasks}"));
    let preset = [format!("preset={preset}")].into_iter();
    preset.chain(settings).chain(data).chain(scenario).collect()
}

/// Reads all runs at `paths` that were evaluated; says what in folders cannot be used.
pub fn runs(paths: &[PathBuf], progress: &Job) -> Result<(Vec<SavedRun>, Vec<String>), Report> {
    progress.begin(0, 1);
    let found = RunReader::new(paths).read(|[file, files], _| {
        progress.set(file, files);
        ControlFlow::Continue(())
    });
    let all = found.runs.into_iter().map(Arc::unwrap_or_clone);
    let (damaged, mut runs): (Vec<SavedRun>, Vec<SavedRun>) = all.partition(SavedRun::is_damaged);
    // What is named is not left out.
    let named = damaged.iter().find(|run| paths.contains(&run.source));
    if let Some(SavedRun { source, problem, .. }) = named {
        if !source.is_dir() {
            file(source)?;
        }
        let (source, problem) = (source.display(), problem.as_deref().unwrap_or_default());
        return Err(miette!(help = HELP, "{source}{problem}"));
    }
    let mut notes: Vec<String> = damaged.iter().chain(&runs).filter_map(SavedRun::note).collect();
    let lines: String = notes.iter().map(|note| format!("\n{note}")).collect();
    let first = runs.first().map_or(paths.first(), |run| Some(&run.source));
    let first = first.map_or(String::new(), |path| path.display().to_string());
    if runs.is_empty() {
        return Err(miette!(help = HELP, "{first}: no runs here{lines}"));
    }
    let all = runs.len();
    runs.retain(|run| !run.evaluations.is_empty());
    if runs.is_empty() {
        let help = "runs are evaluated on the way with --eval-every-updates N, and at the end";
        return Err(miette!(help = help, "{first}: no evaluation yet{lines}"));
    }
    if runs.len() < all {
        let without = counted((all - runs.len()) as u64, "run");
        notes.push(format!("{without} without an evaluation yet: left out"));
    }
    Ok((runs, notes))
}

/// Returns the files with runs in a folder: those of an experiment's jobs, then its own.
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
    // Results replace checkpoints, which take longer to read, unless these were trained on since.
    let written = |file: &Path| std::fs::metadata(file).ok()?.modified().ok();
    of_jobs.retain(|file| {
        !has_extension(file, "safetensors")
            || written(&file.with_extension("json")).is_none_or(|at| written(file) > Some(at))
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
            Err(problem) if path.parent().is_some_and(|parent| parent.ends_with("jobs")) => {
                return Err(problem);
            }
            Err(_) => {}
        }
    }
    RecordsReader::new(path).read()
}

/// What distinguishes versions of a file: when it was written, and its size.
pub type Stamp = (Option<SystemTime>, u64);

pub fn stamp(path: &Path) -> Option<Stamp> {
    let found = std::fs::metadata(path).ok()?;
    Some((found.modified().ok(), found.len()))
}

fn is_recent(at: SystemTime, limit: Duration) -> bool {
    // Another machine's clock may be ahead.
    at.elapsed().unwrap_or_default() < limit
}

/// Returns the last fact of a fingerprint.
fn checksum(fingerprint: &str) -> String {
    fingerprint.rsplit(", ").next().unwrap_or_default().to_owned()
}

fn unreadable(path: &Path, error: &std::io::Error) -> Report {
    miette!(help = HELP, "{}: cannot be read: {error}", path.display())
}

fn checkpoint(path: &Path) -> Result<SavedRun, Report> {
    let (found, history) = read_history(path).map_err(from_checkpoint_error)?;
    let changed = found.run.changed_settings();
    let settings = changed.iter().map(|(name, value)| setting_text(name, value));
    // Its fingerprint is of the last map.
    let last = history.edits().len().saturating_sub(1);
    let to =
        |i| found.fingerprint.as_deref().filter(|_| i == last).map_or(UNKNOWN.into(), checksum);
    let edits = history.edits().iter().enumerate().map(|(i, at)| (*at, to(i)));
    let edits: Vec<(u64, String)> = edits.collect();
    let data = found.data.as_ref().map(|data| data.checksum);
    let mut evaluations = evaluations(&history);
    // What other methods reached before is not this method's.
    evaluations.retain(|at| history.methods().is_current(at.updates));
    Ok(SavedRun {
        source: path.to_owned(),
        kind: RunKind::Checkpoint,
        end: Some(RunState::Saved),
        map: if found.title.is_empty() { found.world.clone() } else { found.title.clone() },
        fingerprint: found.fingerprint.clone().filter(|_| edits.is_empty()),
        edits,
        method: found.run.method.name(),
        settings: facts(found.run.preset.name(), settings, data, found.scenario.clone()),
        seed: found.run.seed,
        updates: found.updates,
        evaluations,
        checkpoint: Some(path.to_owned()),
        ..SavedRun::default()
    })
}
