//! Reads what evaluations of runs found: from results of experiments, checkpoints and records.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::path::{Path, PathBuf};

use miette::{Report, miette};
use serde::Deserialize;
use serde_json::{Map, Value};

use crate::experiment::folder::{Folder, read_result};
use crate::experiment::job::{EvaluationAt, JobResult, evaluations, setting_text};
use crate::host::report::from_checkpoint_error;
use crate::host::runs::files_in;
use gdg::files::{has_extension, is_hidden, open};
use gdg::text::{counted, sanitized};
use gdg::train::{is_checkpoint, read_history};

/// What can be given.
const HELP: &str = "give a folder of gdg-tui suite, reproduce or ablate, a folder of checkpoints, \
                    a checkpoint, or the records of gdg-tui --no-ui in a file";

/// A run's evaluations, and what it is.
#[derive(Clone, Debug)]
pub struct PlottedRun {
    /// Where it was read.
    pub source: PathBuf,
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
    /// Its evaluations, oldest first.
    pub evaluations: Vec<EvaluationAt>,
}

impl PlottedRun {
    /// Returns the run of a result in `source`.
    pub fn of_result(result: JobResult, source: PathBuf) -> Self {
        Self {
            source,
            map: result.world,
            method: result.method.name(),
            variant: result.variant,
            settings: with_preset(result.preset.name(), result.settings),
            seed: result.seed,
            evaluations: result.evaluations,
        }
    }
}

fn with_preset(preset: &str, settings: impl IntoIterator<Item = String>) -> Vec<String> {
    [format!("preset={preset}")].into_iter().chain(settings).collect()
}

/// Reads all runs at `paths`, and says what in folders cannot be used.
///
/// # Errors
/// A file cannot be read or is nothing of the kind, or a folder has no runs.
pub fn runs(paths: &[PathBuf]) -> Result<(Vec<PlottedRun>, Vec<String>), Report> {
    let (mut runs, mut notes) = (Vec::new(), Vec::new());
    for path in paths {
        if !path.is_dir() {
            runs.extend(file(path)?);
            continue;
        }
        let found = folder(path, &mut notes)?;
        if found.is_empty() {
            let left_out: String = notes.iter().map(|note| format!("\n{note}")).collect();
            return Err(miette!(help = HELP, "{}: no runs here{left_out}", path.display()));
        }
        runs.extend(found);
    }
    let evaluated = runs.iter().filter(|run| !run.evaluations.is_empty()).count();
    if evaluated == 0 {
        let source = runs.first().map_or(String::new(), |run| run.source.display().to_string());
        let help = "runs are evaluated on the way with --eval-every-updates N, and at the end";
        return Err(miette!(help = help, "{source}: no evaluation yet"));
    }
    if evaluated < runs.len() {
        let without = counted((runs.len() - evaluated) as u64, "run");
        notes.push(format!("{without} without an evaluation yet: left out"));
        runs.retain(|run| !run.evaluations.is_empty());
    }
    Ok((runs, notes))
}

/// Reads the runs of an experiment's folder, or of a folder of checkpoints and records.
fn folder(path: &Path, notes: &mut Vec<String>) -> Result<Vec<PlottedRun>, Report> {
    let listed = |path: &Path| {
        let entries = std::fs::read_dir(path).map_err(|error| unreadable(path, &error))?;
        let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
        files.retain(|file| has_extension(file, "jsonl") && !is_hidden(file));
        files.extend(files_in(path).map_err(|error| unreadable(path, &error))?);
        files.sort();
        Ok::<_, Report>(files)
    };
    let jobs = path.join("jobs");
    let (results, problems) = Folder::new(path).results();
    notes.extend(problems.into_iter().map(|problem| format!("{problem}: left out")));
    let finished: Vec<String> = results.iter().map(|result| result.name.clone()).collect();
    let of_result = |result: JobResult| {
        let source = jobs.join(&result.name).with_extension("json");
        PlottedRun::of_result(result, source)
    };
    let mut runs: Vec<PlottedRun> = results.into_iter().map(of_result).collect();
    let mut files = listed(path)?;
    if jobs.is_dir() {
        let is_open = |file: &PathBuf| {
            file.file_stem().is_none_or(|stem| finished.iter().all(|name| **name != *stem))
        };
        files.extend(listed(&jobs)?.into_iter().filter(is_open));
    }
    for file_path in files {
        match file(&file_path) {
            Ok(found) => runs.extend(found),
            Err(problem) => notes.push(format!("{problem}: left out")),
        }
    }
    Ok(runs)
}

/// Reads the runs of a file.
fn file(path: &Path) -> Result<Vec<PlottedRun>, Report> {
    if is_checkpoint(path) {
        return checkpoint(path).map(|run| vec![run]);
    }
    if has_extension(path, "json")
        && let Ok(result) = read_result(path)
    {
        return Ok(vec![PlottedRun::of_result(result, path.to_owned())]);
    }
    records(path)
}

fn unreadable(path: &Path, error: &std::io::Error) -> Report {
    miette!(help = HELP, "{}: cannot be read: {error}", path.display())
}

fn checkpoint(path: &Path) -> Result<PlottedRun, Report> {
    let (found, history) = read_history(path).map_err(from_checkpoint_error)?;
    let changed = found.run.changed_settings();
    let settings = changed.iter().map(|(name, value)| setting_text(name, value));
    let mut evaluations = evaluations(&history);
    // What other methods reached before is not this method's.
    evaluations.retain(|at| history.methods().is_current(at.updates));
    Ok(PlottedRun {
        source: path.to_owned(),
        map: if found.title.is_empty() { found.world } else { found.title },
        method: found.run.method.name(),
        variant: None,
        settings: with_preset(found.run.preset.name(), settings),
        seed: found.run.seed,
        evaluations,
    })
}

/// What of the records is read.
#[derive(Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
enum Record {
    Start(Box<Start>),
    Evaluation(Box<EvaluationAt>),
    #[serde(other)]
    Other,
}

/// The first record of a run.
#[derive(Deserialize)]
struct Start {
    world: String,
    map: Option<Value>,
    method: String,
    preset: String,
    settings: Map<String, Value>,
    seed: u64,
}

impl PlottedRun {
    /// Returns the run that begins with `start` in `source`, without evaluations.
    fn begun(start: Start, source: &Path) -> Self {
        let Start { world, map, method, preset, settings, seed } = start;
        let map = map.and_then(|map| Some(map.get("name")?.as_str()?.to_owned()));
        let settings = settings.iter().map(|(name, value)| setting_text(name, value));
        Self {
            source: source.to_owned(),
            map: map.unwrap_or(world),
            method,
            variant: None,
            settings: with_preset(&preset, settings),
            seed,
            evaluations: Vec::new(),
        }
    }
}

/// Reads the runs in a file of records, one JSON object per line: each begins with its `start`.
fn records(path: &Path) -> Result<Vec<PlottedRun>, Report> {
    let file = open(path).map_err(|error| unreadable(path, &error))?;
    let mut reader = std::io::BufReader::new(file);
    let (mut runs, mut line, mut number) = (Vec::<PlottedRun>::new(), Vec::new(), 0);
    loop {
        line.clear();
        if reader.read_until(b'\n', &mut line).map_err(|error| unreadable(path, &error))? == 0 {
            break;
        }
        number += 1;
        if line.trim_ascii().is_empty() {
            continue;
        }
        let record = match serde_json::from_slice(&line) {
            Ok(record) => record,
            // The last line of a run that goes on may be incomplete.
            Err(_) if !runs.is_empty() && !line.ends_with(b"\n") => break,
            Err(error) => {
                // The parser sees this line only, so its line number is always 1.
                let (column, error) = (error.column(), sanitized(&error.to_string()));
                let error = error.split(" at line ").next().unwrap_or_default();
                let at = format!("{}:{number}:{column}", path.display());
                return Err(miette!(help = HELP, "{at}: not a record: {error}"));
            }
        };
        match (record, runs.last_mut()) {
            (Record::Start(start), _) => runs.push(PlottedRun::begun(*start, path)),
            (Record::Evaluation(at), Some(run)) => run.evaluations.push(*at),
            (Record::Evaluation(_), None) => {
                let at = format!("{}:{number}:1", path.display());
                return Err(miette!(help = HELP, "{at}: an evaluation before any start record"));
            }
            (Record::Other, _) => {}
        }
    }
    if runs.is_empty() {
        return Err(miette!(help = HELP, "{}: no records", path.display()));
    }
    Ok(merged(runs))
}

/// Joins the parts of a run that was resumed.
fn merged(runs: Vec<PlottedRun>) -> Vec<PlottedRun> {
    let mut parts: BTreeMap<_, PlottedRun> = BTreeMap::new();
    for run in runs {
        let key = (run.map.clone(), run.method.clone(), run.settings.clone(), run.seed);
        match parts.get_mut(&key) {
            Some(earlier) => earlier.evaluations.extend(run.evaluations),
            None => {
                parts.insert(key, run);
            }
        }
    }
    parts.into_values().collect()
}
