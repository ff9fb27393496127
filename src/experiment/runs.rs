//! Reads runs, with what their evaluations found: from results of experiments, checkpoints and
//! records.

mod join;
mod line;
mod reader;

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fmt;
use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use miette::{Report, miette};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::folder::read_result;
use super::job::{EvaluationAt, JobResult, evaluations, setting_text};
use crate::host::report::from_checkpoint_error;
use crate::host::runs::files_in;
use gdg::files::{has_extension, is_hidden, open};
use gdg::pulse::Progress;
use gdg::text::{counted, sanitized};
use gdg::train::{Evaluation, is_checkpoint, read_history};
use join::join;
pub use line::RunLine;
pub use reader::{Found, Reader};

/// Records that have not grown for this long are not of a running run.
const QUIET: Duration = Duration::from_mins(1);

/// The longest line of records: none that this program writes is nearly as long.
const MOST_OF_A_LINE: u64 = 16 << 20;

/// Some editors begin files with it.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// What can be given.
const HELP: &str = "give a folder of gdg-tui suite, reproduce or ablate, a folder of checkpoints, \
                    a checkpoint, or the records of gdg-tui --no-ui in a file";

/// A run's evaluations, and what it is.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedRun {
    /// Where it was read.
    pub source: PathBuf,
    /// What that is.
    pub kind: Kind,
    /// Its map, or the world if there is none.
    pub map: String,
    /// Its method.
    pub method: String,
    /// Name of the variant, if its settings have one.
    pub variant: Option<String>,
    /// The preset, and the settings that differ from it.
    pub settings: Vec<String>,
    /// Its seed.
    pub seed: u64,
    /// Updates from which these records go on; 0 for a run from its beginning.
    pub begun: u64,
    /// Updates done.
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

/// What distinguishes a run from others: its map, method, settings and seed.
pub type Identity = (String, String, Vec<String>, u64);

/// Lines of records that cannot be read and are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Skipped {
    /// How many.
    pub lines: u64,
    /// What is wrong with the first one, and its number.
    first: String,
}

impl Skipped {
    fn add(&mut self, other: Self) {
        if self.lines == 0 {
            self.first = other.first;
        }
        self.lines += other.lines;
    }
}

impl fmt::Display for Skipped {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.lines {
            0 => Ok(()),
            1 => f.write_str(&self.first),
            lines => write!(f, "{}, the first of {lines} lines", self.first),
        }
    }
}

/// What a run was read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The result of a job.
    Result,
    /// A checkpoint.
    Checkpoint,
    /// Records, and how they end.
    Records(Ending),
}

/// How the records of a run end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// They go on, or were cut off.
    Open,
    /// A signal has interrupted the run.
    Interrupted,
    /// The run has reached its limit.
    Finished,
    /// Its checkpoint has been resumed since, elsewhere.
    Continued,
}

/// What has become of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It has reached its end.
    Done,
    /// It was saved, and can go on.
    Saved,
    /// A signal has interrupted it.
    Interrupted,
    /// It goes on: its records grow.
    Running,
    /// Its records have neither an end nor grown lately.
    CutOff,
}

impl State {
    /// Returns its name on the screen and in JSON.
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

    /// Returns the run of a result in `source`.
    pub fn of_result(result: JobResult, source: PathBuf) -> Self {
        // Only kept if that was asked for.
        let checkpoint = Some(source.with_extension("safetensors")).filter(|path| path.is_file());
        Self {
            source,
            kind: Kind::Result,
            map: result.world,
            method: result.method.name(),
            variant: result.variant,
            settings: with_preset(result.preset.name(), result.settings),
            seed: result.seed,
            begun: 0,
            updates: result.updates,
            evaluations: result.evaluations,
            checkpoint,
            others: Vec::new(),
            skipped: Skipped::default(),
        }
    }

    /// Returns what of its records is left out, for a line of its own.
    pub fn note(&self) -> Option<String> {
        let Self { source, skipped, .. } = self;
        (skipped.lines > 0).then(|| sanitized(&format!("{}:{skipped}: left out", source.display())))
    }

    /// Returns the last evaluation.
    pub fn last(&self) -> Option<&Evaluation> {
        self.evaluations.last().map(|at| &at.evaluation)
    }
}

fn with_preset(preset: &str, settings: impl IntoIterator<Item = String>) -> Vec<String> {
    [format!("preset={preset}")].into_iter().chain(settings).collect()
}

/// Reads all runs at `paths`, says how far it is, and what in folders cannot be used.
///
/// # Errors
/// A file cannot be read or is nothing of the kind, or a folder has no runs.
pub fn runs(
    paths: &[PathBuf],
    progress: &Progress,
) -> Result<(Vec<SavedRun>, Vec<String>), Report> {
    let (mut runs, mut notes) = (Vec::new(), Vec::new());
    for (i, path) in paths.iter().enumerate() {
        progress.begin(i, paths.len());
        if !path.is_dir() {
            runs.extend(file(path)?);
            continue;
        }
        let found = folder(path, &mut notes, progress)?;
        if found.is_empty() {
            return Err(miette!(help = HELP, "{}: no runs here{}", path.display(), lines(&notes)));
        }
        runs.extend(found);
    }
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

/// Returns notes as further lines of an error.
fn lines(notes: &[String]) -> String {
    notes.iter().map(|note| format!("\n{note}")).collect()
}

/// Reads the runs of an experiment's folder, or of a folder of checkpoints and records.
fn folder(
    path: &Path,
    notes: &mut Vec<String>,
    progress: &Progress,
) -> Result<Vec<SavedRun>, Report> {
    let (mut runs, files) = (Vec::new(), files_of(path)?);
    for (i, path) in files.iter().enumerate() {
        progress.set(i, files.len());
        match file(path) {
            Ok(found) => runs.extend(found),
            Err(problem) => notes.push(format!("{problem}: left out")),
        }
    }
    Ok(runs)
}

/// Returns the files with runs in a folder: results, records and checkpoints of its jobs if it is
/// an experiment's, then its own records and checkpoints.
///
/// # Errors
/// The folder cannot be read.
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
    let of_jobs = if jobs.is_dir() { listed(&jobs, &["json", "jsonl"])? } else { Vec::new() };
    Ok(of_jobs.into_iter().chain(listed(folder, &["jsonl"])?).collect())
}

/// Reads the runs of a file.
///
/// # Errors
/// It cannot be read, or is nothing of the kind.
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
    records(path)
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
        map: if found.title.is_empty() { found.world } else { found.title },
        method: found.run.method.name(),
        variant: None,
        settings: with_preset(found.run.preset.name(), settings),
        seed: found.run.seed,
        begun: 0,
        updates: found.updates,
        evaluations,
        checkpoint: Some(path.to_owned()),
        others: Vec::new(),
        skipped: Skipped::default(),
    })
}

/// What of the records is read.
#[derive(Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
enum Record {
    Start(Box<Start>),
    Progress {
        updates: u64,
    },
    Evaluation(Box<EvaluationAt>),
    Saved {
        path: PathBuf,
    },
    End {
        reason: String,
        updates: u64,
    },
    #[serde(other)]
    Other,
}

/// The first record of a run.
#[derive(Deserialize)]
struct Start {
    world: String,
    map: Option<Value>,
    gym: Option<Value>,
    method: String,
    preset: String,
    settings: Map<String, Value>,
    seed: u64,
    #[serde(default)]
    updates: u64,
}

impl SavedRun {
    /// Returns the run that begins with `start` in `source`, without evaluations.
    fn begun(start: Start, source: &Path) -> Self {
        let Start { world, map, gym, method, preset, settings, seed, updates } = start;
        let named =
            |facts: Option<Value>, key| Some(facts.as_ref()?.get(key)?.as_str()?.to_owned());
        let map = named(map, "name").or_else(|| named(gym, "id"));
        let settings = settings.iter().map(|(name, value)| setting_text(name, value));
        Self {
            source: source.to_owned(),
            kind: Kind::Records(Ending::Open),
            map: map.unwrap_or(world),
            method,
            variant: None,
            settings: with_preset(&preset, settings),
            seed,
            begun: updates,
            updates,
            evaluations: Vec::new(),
            checkpoint: None,
            others: Vec::new(),
            skipped: Skipped::default(),
        }
    }

    /// Adds what a record other than the first says.
    fn add(&mut self, record: Record) {
        match record {
            Record::Progress { updates } => self.updates = updates,
            Record::Evaluation(at) => {
                self.updates = at.updates;
                self.evaluations.push(*at);
            }
            Record::Saved { path } => self.checkpoint = Some(found_from(&self.source, path)),
            Record::End { reason, updates } => {
                let interrupted = reason == "interrupted";
                self.updates = updates;
                self.kind =
                    Kind::Records(if interrupted { Ending::Interrupted } else { Ending::Finished });
            }
            Record::Start(_) | Record::Other => {}
        }
    }
}

/// Returns where a file is that `records` name: its path is relative to the folder in which the
/// run was started, which is the present one, or else that of the records or one above it.
fn found_from(records: &Path, path: PathBuf) -> PathBuf {
    let above = || records.ancestors().skip(1).map(|folder| folder.join(&path));
    let found = if path.is_file() { None } else { above().find(|path| path.is_file()) };
    found.unwrap_or(path)
}

/// Reads the runs in a file of records, one JSON object per line: each begins with its `start`.
/// Leaves out lines that are no records, as a full disk or a second writer may have damaged them.
fn records(path: &Path) -> Result<Vec<SavedRun>, Report> {
    let file = open(path).map_err(|error| unreadable(path, &error))?;
    let mut reader = std::io::BufReader::new(file);
    let (mut runs, mut line, mut number) = (Vec::<SavedRun>::new(), Vec::new(), 0_u64);
    let mut skipped = Skipped::default();
    loop {
        line.clear();
        let mut part = reader.by_ref().take(MOST_OF_A_LINE);
        if part.read_until(b'\n', &mut line).map_err(|error| unreadable(path, &error))? == 0 {
            break;
        }
        number += 1;
        let is_whole = line.ends_with(b"\n");
        if is_too_long(&line) && !is_whole {
            reader.skip_until(b'\n').map_err(|error| unreadable(path, &error))?;
        }
        let text = line.trim_ascii();
        let text =
            if number == 1 { text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text) } else { text };
        if text.is_empty() {
            continue;
        }
        let problem = match (serde_json::from_slice(text), runs.last_mut()) {
            (Ok(Record::Start(start)), _) => {
                runs.push(SavedRun::begun(*start, path));
                continue;
            }
            (Ok(Record::Evaluation(_)), None) => {
                ":1: an evaluation before any start record".to_owned()
            }
            (Ok(record), Some(run)) => {
                run.add(record);
                continue;
            }
            (Ok(_), None) => continue,
            // The last line of a run that goes on may be incomplete.
            (Err(_), Some(_)) if !is_whole && !is_too_long(&line) => break,
            (Err(error), _) => not_a_record(text, &error),
        };
        let one = Skipped { lines: 1, first: format!("{number}{problem}") };
        runs.last_mut().map_or(&mut skipped, |run| &mut run.skipped).add(one);
    }
    let Some(run) = runs.first_mut() else {
        let problem = if skipped.lines == 0 { " no records".to_owned() } else { skipped.first };
        return Err(miette!(help = HELP, "{}:{problem}", path.display()));
    };
    skipped.add(std::mem::take(&mut run.skipped));
    run.skipped = skipped;
    Ok(merged(runs))
}

fn is_too_long(line: &[u8]) -> bool {
    line.len() as u64 >= MOST_OF_A_LINE
}

/// Says what is wrong with a line, after its number.
fn not_a_record(line: &[u8], error: &serde_json::Error) -> String {
    if is_too_long(line) {
        return format!(": not a record: longer than {} MB", MOST_OF_A_LINE >> 20);
    }
    match serde_json::from_slice::<Value>(line) {
        Ok(Value::Object(fields)) if fields.contains_key("event") => {
            let error = sanitized(&error.to_string());
            // The parser sees this line only, so its line number is always 1.
            format!(": not a record: {}", error.split(" at line ").next().unwrap_or_default())
        }
        Ok(_) => ": not a record: no object with an \"event\"".to_owned(),
        Err(error) => format!(":{}: not a record: not JSON", error.column()),
    }
}

/// Joins the parts of a run that was resumed; the runs are in the order in which they began.
fn merged(parts: Vec<SavedRun>) -> Vec<SavedRun> {
    let mut runs: Vec<SavedRun> = Vec::new();
    let mut places: HashMap<Identity, usize> = HashMap::new();
    for part in parts {
        match places.entry(part.identity()) {
            Entry::Occupied(place) => {
                let before = std::mem::replace(&mut runs[*place.get()], part);
                runs[*place.get()].continue_from(before);
            }
            Entry::Vacant(place) => {
                place.insert(runs.len());
                runs.push(part);
            }
        }
    }
    runs
}

impl SavedRun {
    /// Returns what distinguishes it from the other runs of its file.
    pub fn identity(&self) -> Identity {
        (self.map.clone(), self.method.clone(), self.settings.clone(), self.seed)
    }

    /// Adds the part that it was resumed from.
    fn continue_from(&mut self, mut before: Self) {
        // It may have been resumed from before that one's end.
        let from = self.evaluations.first().map(|at| at.updates);
        let from = from.or((self.begun > 0).then_some(self.begun + 1));
        before.evaluations.retain(|at| from.is_none_or(|from| at.updates < from));
        self.evaluations.splice(0..0, before.evaluations);
        self.begun = before.begun;
        self.checkpoint = self.checkpoint.take().or(before.checkpoint);
        before.skipped.add(std::mem::take(&mut self.skipped));
        self.skipped = before.skipped;
    }
}
