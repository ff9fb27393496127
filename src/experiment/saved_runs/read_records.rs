//! Reads records of runs, one JSON object per line; and joins what was read from several files of
//! one run.

use std::collections::{HashMap, HashSet};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf, absolute};
use std::sync::Arc;

use miette::{Report, miette};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::{HELP, RunKind, RunState, SavedRun, UNKNOWN, checksum, facts, unreadable};
use crate::experiment::spec::{EvaluationAt, setting_text};
use gdg::files::{FileFormat, Mismatch, Wanted, open};
use gdg::text::{safe_file_name, sanitized};
use gdg::train::DataSource;

/// The longest line of records: none that this program writes is nearly as long.
const MOST_OF_A_LINE: u64 = 16 << 20;

/// Records begin within this many bytes; other output may come first.
const MOST_BEFORE_RUNS: u64 = 1 << 20;

const RECORDS: Wanted =
    Wanted { name: "records of a run", help: HELP, own: &[FileFormat::Json, FileFormat::Text] };

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

#[derive(Deserialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
enum ReadRecord {
    Start(Box<Start>),
    Progress(Progress),
    Evaluation(Box<EvaluationAt>),
    Saved {
        path: PathBuf,
    },
    Edit {
        updates: u64,
        map: Option<String>,
        fingerprint: Option<String>,
    },
    End {
        reason: String,
        updates: u64,
    },
    #[serde(other)]
    Other,
}

/// How far a run was when it last told.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default)]
pub struct Progress {
    pub updates: u64,
    pub env_steps: u64,
    pub episodes: u64,
    pub seconds: f64,
    pub updates_per_second: Option<f64>,
    /// Estimated seconds until the run ends.
    pub left: Option<f64>,
}

#[derive(Deserialize)]
struct Start {
    version: Option<String>,
    world: String,
    fingerprint: Option<String>,
    map: Option<Value>,
    gym: Option<Value>,
    data: Option<DataSource>,
    method: String,
    preset: String,
    settings: Map<String, Value>,
    seed: u64,
    #[serde(default)]
    updates: u64,
    resumed: Option<PathBuf>,
    save: Option<PathBuf>,
    save_every: Option<f64>,
}

impl SavedRun {
    fn begun(start: Start, source: &Path) -> Self {
        let Start { world, fingerprint, map, gym, data, method, preset, settings, seed, .. } =
            start;
        let named =
            |known: &Option<Value>, key| Some(known.as_ref()?.get(key)?.as_str()?.to_owned());
        let (data, scenario) = (data.map(|data| data.checksum), named(&map, "scenario"));
        let map = named(&map, "name").or_else(|| named(&gym, "id"));
        let settings = settings.iter().map(|(name, value)| setting_text(name, value));
        Self {
            source: source.to_owned(),
            map: map.unwrap_or(world),
            fingerprint,
            method,
            settings: facts(&preset, settings, data, scenario),
            seed,
            version: start.version,
            begun: start.updates,
            resumed: start.resumed.map(|path| found_from(source, path)),
            saves: start.save.map(|path| (path, start.save_every)),
            updates: start.updates,
            ..Self::default()
        }
    }

    fn add(&mut self, record: ReadRecord) {
        match record {
            ReadRecord::Progress(now) => (self.updates, self.progress) = (now.updates, now),
            ReadRecord::Evaluation(at) => {
                self.updates = at.updates;
                self.evaluations.push(*at);
            }
            ReadRecord::Edit { updates, map, fingerprint } => {
                let to = fingerprint.map(|own| checksum(&own)).or(map);
                // Of several at once, the last.
                self.edits.retain(|(at, _)| *at != updates);
                self.edits.push((updates, to.unwrap_or_else(|| UNKNOWN.to_owned())));
            }
            ReadRecord::Saved { path } => self.checkpoint = Some(found_from(&self.source, path)),
            ReadRecord::End { reason, updates } => {
                let interrupted = reason == "interrupted";
                self.end = Some(if interrupted { RunState::Interrupted } else { RunState::Done });
                self.updates = updates;
            }
            ReadRecord::Start(_) | ReadRecord::Other => {}
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

/// Reads the runs in a file of records, one JSON object per line: each begins with its `start`. What
/// has been read before is not read again.
///
/// Leaves out lines that are no records, as a full disk or a second writer may have damaged them.
pub struct RecordsReader {
    path: PathBuf,
    runs: Vec<SavedRun>,
    problem: Option<String>,
    /// Lines and bytes read.
    lines: u64,
    read: u64,
    /// The line that the file begins with.
    first: Vec<u8>,
}

impl RecordsReader {
    pub fn new(path: &Path) -> Self {
        let path = path.to_owned();
        Self { path, runs: Vec::new(), problem: None, lines: 0, read: 0, first: Vec::new() }
    }

    /// Reads what is new; all of a file that has shrunk or begins otherwise than before.
    pub fn read(&mut self) -> Result<Vec<SavedRun>, Report> {
        let path = self.path.clone();
        self.read_on().map_err(|error| unreadable(&path, &error))?;
        let Some(run) = self.runs.first_mut() else {
            if let Some(Mismatch { problem, help }) = RECORDS.mismatch(&path) {
                return Err(miette!(help = help, "{}: {problem}", path.display()));
            }
            let problem = self.problem.as_deref().unwrap_or(": no records");
            return Err(miette!(help = HELP, "{}{problem}", path.display()));
        };
        run.problem = self.problem.clone().or(run.problem.take());
        Ok(merged(self.runs.clone()))
    }

    fn read_on(&mut self) -> std::io::Result<()> {
        let mut reader = BufReader::new(open(&self.path)?);
        let mut line = Vec::new();
        reader.by_ref().take(MOST_OF_A_LINE).read_until(b'\n', &mut line)?;
        if line != self.first || reader.get_ref().metadata()?.len() < self.read {
            *self = Self { first: line.clone(), ..Self::new(&self.path) };
        }
        reader.seek(SeekFrom::Start(self.read))?;
        // Other programs' files, however large, are not read to their end.
        while !self.runs.is_empty() || self.read < MOST_BEFORE_RUNS {
            line.clear();
            let mut length = reader.by_ref().take(MOST_OF_A_LINE).read_until(b'\n', &mut line)?;
            let is_whole = line.ends_with(b"\n");
            let is_too_long = !is_whole && length as u64 >= MOST_OF_A_LINE;
            if is_too_long {
                length += reader.skip_until(b'\n')?;
            }
            match self.add(&line, is_too_long) {
                // The last line of a run that goes on may be incomplete.
                Err(_) if !is_whole && !is_too_long && !self.runs.is_empty() => break,
                Err(found) => {
                    let own =
                        self.runs.last_mut().map_or(&mut self.problem, |run| &mut run.problem);
                    own.get_or_insert(format!(":{}{found}", self.lines + 1));
                }
                Ok(()) if length == 0 => break,
                Ok(()) => {}
            }
            self.read += length as u64;
            self.lines += u64::from(is_whole || is_too_long);
        }
        Ok(())
    }

    /// Adds a line, or says why it is no record.
    fn add(&mut self, line: &[u8], is_too_long: bool) -> Result<(), String> {
        let text = line.trim_ascii_end();
        let text = text.strip_prefix(BYTE_ORDER_MARK).filter(|_| self.read == 0).unwrap_or(text);
        match (serde_json::from_slice(text), self.runs.last_mut()) {
            _ if text.is_empty() => {}
            (Ok(ReadRecord::Start(start)), _) => {
                self.runs.push(SavedRun::begun(*start, &self.path));
            }
            (Ok(ReadRecord::Evaluation(at)), _) if !at.is_possible() => {
                return Err(": not a record: impossible numbers".into());
            }
            (Ok(record), Some(run)) => run.add(record),
            (Ok(ReadRecord::Evaluation(_)), None) => {
                return Err(":1: an evaluation before any start record".into());
            }
            (Ok(_), None) => {}
            (Err(_), _) if is_too_long => {
                return Err(format!(": not a record: longer than {} MB", MOST_OF_A_LINE >> 20));
            }
            (Err(error), _) => return Err(not_a_record(text, &error)),
        }
        Ok(())
    }
}

/// Says what is wrong with a line, after its number.
fn not_a_record(line: &[u8], error: &serde_json::Error) -> String {
    match serde_json::from_slice::<Value>(line) {
        Ok(Value::Object(fields)) if fields.contains_key("event") => {
            let error = sanitized(&error.to_string());
            // The parser sees this line only, so its line number is always 1.
            format!(": not a record: {}", error.split(" at line ").next().unwrap_or_default())
        }
        Ok(_) => ": not a record: no object with an \"event\"".to_owned(),
        Err(error) => {
            let before = &line[..line.len().min(error.column().saturating_sub(1))];
            let column = String::from_utf8_lossy(before).chars().count() + 1;
            format!(":{column}: not a record: not JSON")
        }
    }
}

/// Joins parts of runs that were resumed, or begun again, in the order in which they began.
fn merged(parts: Vec<SavedRun>) -> Vec<SavedRun> {
    let mut runs: Vec<SavedRun> = Vec::new();
    let mut places: HashMap<_, Vec<usize>> = HashMap::new();
    for part in parts {
        let facts = (part.map.clone(), part.method.clone(), part.settings.clone(), part.seed);
        let alike = places.entry(facts).or_default();
        // It goes on, or has begun anew with the same edits and tasks.
        let is_before = |before: &SavedRun| {
            let mut both = part.circumstances().into_iter().zip(before.circumstances());
            let is_again = both.all(|(own, other)| own == other || own.and(other).is_none());
            is_again && before.fingerprint == part.fingerprint
                || part.begun > 0 && before.is_same(&part)
        };
        if let Some(place) = alike.iter().rev().find(|place| is_before(&runs[**place])) {
            let before = std::mem::replace(&mut runs[*place], part);
            runs[*place].continue_from(before);
        } else {
            alike.push(runs.len());
            runs.push(part);
        }
    }
    runs
}

/// Leaves one of the runs that were read from several files of the same: a job's result instead of
/// its records and checkpoint, the records that go on instead of those before, and records instead
/// of the checkpoint that they name.
pub fn join(mut runs: Vec<Arc<SavedRun>>) -> Vec<Arc<SavedRun>> {
    let mut into = vec![None; runs.len()];
    let all =
        |kind: RunKind| (0..runs.len()).filter(|i| runs[*i].kind == kind).collect::<Vec<usize>>();
    let (mut records, checkpoints) = (all(RunKind::Records), all(RunKind::Checkpoint));
    records.sort_by_key(|i| (runs[*i].begun, runs[*i].updates));
    let stem = |i: usize| runs[i].source.with_extension("");
    let results: HashMap<PathBuf, usize> =
        all(RunKind::Result).into_iter().map(|i| (stem(i), i)).collect();
    for i in records.iter().chain(&checkpoints) {
        into[*i] = results.get(&stem(*i)).copied();
    }
    let mut naming: HashMap<PathBuf, Vec<usize>> = HashMap::new();
    let is_open = |into: &[Option<usize>], all: &[usize]| -> Vec<usize> {
        all.iter().copied().filter(|i| into[*i].is_none()).collect()
    };
    let open = is_open(&into, &records);
    // Of several that go on from one, the longest.
    for (n, i) in open.iter().enumerate().rev() {
        let run = &runs[*i];
        let is_before =
            |part: &&usize| into[**part].is_none() && run.is_resumed_from(&runs[**part]);
        if let Some(before) = open[..n].iter().rfind(is_before).copied() {
            into[before] = Some(*i);
        }
        run.checkpoint.iter().for_each(|path| naming.entry(whole(path)).or_default().push(*i));
    }
    for i in is_open(&into, &checkpoints) {
        let named = naming.get(&whole(&runs[i].source)).into_iter().flatten();
        // Others may have begun anew and replaced the file.
        into[i] = named.copied().find(|part| runs[*part].is_same(&runs[i]));
    }
    for i in records.into_iter().chain(checkpoints) {
        if let Some(host) = into[i] {
            let part = runs[i].clone();
            Arc::make_mut(&mut runs[host]).absorb(&part);
        }
    }
    let kept = runs.into_iter().zip(into).filter(|(_, into)| into.is_none());
    kept.map(|(run, _)| run).collect()
}

/// Returns a path in one form, as the same file may be named in several ways.
pub fn whole(path: &Path) -> PathBuf {
    absolute(path).unwrap_or_else(|_| path.to_owned())
}

impl SavedRun {
    /// Whether `other` is the same run at another time.
    pub fn is_same(&self, other: &Self) -> bool {
        // A checkpoint has its map's name as files have it.
        let fingerprints = self.fingerprint.as_ref().zip(other.fingerprint.as_ref());
        let has_same_map = safe_file_name(&self.map) == safe_file_name(&other.map)
            && fingerprints.is_none_or(|(own, other)| own == other);
        (&self.method, &self.settings, self.seed) == (&other.method, &other.settings, other.seed)
            && (has_same_map || self.is_edited() || other.is_edited())
    }

    /// Whether an evaluation of both was the same, at the same time: settings may have changed since.
    pub fn is_of_one_run(&self, other: &Self) -> bool {
        // Records round times.
        let moment = |at: &EvaluationAt| (at.updates, (1_000.0 * at.seconds).round() as u64);
        let own: HashSet<_> = self.evaluations.iter().map(moment).collect();
        other.evaluations.iter().any(|at| own.contains(&moment(at)))
    }

    pub fn is_edited(&self) -> bool {
        !self.edits.is_empty()
    }

    /// Whether these records go on from a checkpoint of `other`.
    fn is_resumed_from(&self, other: &Self) -> bool {
        // Older records name only the checkpoint that they write, which was often the same.
        let from = self.resumed.as_ref().or(self.checkpoint.as_ref()).map(|path| whole(path));
        let written = other.checkpoint.iter().chain([&other.source]).chain(&other.others);
        self.begun > other.begun
            && self.is_same(other)
            && from.is_some_and(|from| written.into_iter().any(|path| whole(path) == from))
    }

    /// Adds the part that it was resumed from.
    pub fn continue_from(&mut self, mut before: Self) {
        // It may have been resumed from before that one's end.
        let from = self.evaluations.first().map(|at| at.updates);
        let from = from.or((self.begun > 0).then_some(self.begun + 1));
        before.evaluations.retain(|at| from.is_none_or(|from| at.updates < from));
        if before.is_edited() {
            (self.map, self.fingerprint) = (before.map, before.fingerprint);
        }
        let is_own = |at: u64| self.edits.iter().all(|(own, _)| *own != at);
        before.edits.retain(|(at, _)| *at <= self.begun && is_own(*at));
        self.edits.splice(0..0, before.edits);
        self.evaluations.splice(0..0, before.evaluations);
        (self.begun, self.resumed) = (before.begun, before.resumed);
        self.checkpoint = self.checkpoint.take().or(before.checkpoint);
        self.problem = before.problem.or(self.problem.take());
    }

    /// Takes in what was read from another file of this run, and is left out besides.
    fn absorb(&mut self, part: &Self) {
        self.others.push(part.source.clone());
        self.others.extend(part.others.iter().cloned());
        self.written = self.written.max(part.written);
        if self.kind == RunKind::Result {
            return;
        }
        if part.kind != RunKind::Checkpoint {
            return self.continue_from(part.clone());
        }
        let first = self.evaluations.first().map_or(u64::MAX, |at| at.updates);
        let last = self.evaluations.last().map_or(u64::MAX, |at| at.updates);
        let of_part = part.evaluations.iter().filter(|at| at.updates < first || at.updates > last);
        self.evaluations.extend(of_part.cloned());
        self.evaluations.sort_by_key(|at| at.updates);
        if part.updates > self.updates && self.end.is_some() {
            self.end = Some(RunState::Saved);
        }
        self.updates = self.updates.max(part.updates);
        // Its records may be of its last part alone, or end before the last edit.
        if part.edits.len() > self.edits.len() {
            self.edits.clone_from(&part.edits);
            self.fingerprint.take_if(|_| self.begun > 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::spec::EvaluationAt;
    use gdg::train::{Evaluation, Score};

    const PATH: &str = "saves/a.safetensors";

    /// Returns a run that begins and was evaluated at these thousands of updates; records name a
    /// checkpoint.
    fn run(kind: RunKind, source: &str, begun: u64, evaluated: &[u64]) -> SavedRun {
        let score =
            Score { success: Some(0.5), spl: None, steps_ratio: None, by_distance: Vec::new() };
        let evaluation = |thousands: &u64| EvaluationAt {
            updates: 1_000 * thousands,
            env_steps: 0,
            // It tells the parts apart.
            seconds: begun as f64,
            evaluation: Evaluation { greedy: score.clone(), ..Evaluation::default() },
        };
        SavedRun {
            source: source.into(),
            kind,
            end: Some(RunState::Done),
            map: "room".to_owned(),
            begun: 1_000 * begun,
            updates: 1_000 * evaluated.last().copied().unwrap_or(begun),
            evaluations: evaluated.iter().map(evaluation).collect(),
            checkpoint: (kind == RunKind::Records).then(|| format!("./{PATH}").into()),
            ..SavedRun::default()
        }
    }

    /// Returns each run's file, the others that belong to it, and thousands of updates at its
    /// evaluations, with the part that they are of.
    fn joined(runs: &[&SavedRun]) -> Vec<String> {
        let runs = join(runs.iter().map(|run| Arc::new((*run).clone())).collect());
        let text = |run: &Arc<SavedRun>| {
            let others = run.others.iter().map(|path| format!("{} ", path.display()));
            let at = run.evaluations.iter();
            let at = at.map(|at| format!(" {}.{}", at.updates / 1_000, at.seconds));
            let (others, at) = (others.collect::<String>(), at.collect::<String>());
            format!("{} [{}]{at}", run.source.display(), others.trim_end())
        };
        runs.iter().map(text).collect()
    }

    #[test]
    fn what_is_in_several_files_is_one_run() {
        let checkpoint = |at: &[u64]| run(RunKind::Checkpoint, PATH, 0, at);
        let part = |source, begun, at: &[u64]| run(RunKind::Records, source, begun, at);
        let (first, saved) = (part("1.jsonl", 0, &[1, 2]), checkpoint(&[1, 2]));
        let (second, third) = (part("2.jsonl", 2, &[3, 4, 5]), part("3.jsonl", 4, &[5, 6]));
        let other = run(RunKind::Checkpoint, "saves/b.safetensors", 0, &[1]);
        let replaced = SavedRun { seed: 4, ..checkpoint(&[1]) };
        let set = SavedRun { settings: vec!["n_step=1".to_owned()], ..first.clone() };
        let of_job = |kind, end| run(kind, &format!("jobs/a.{end}"), 0, &[4]);
        let job = [
            (RunKind::Records, "jsonl"),
            (RunKind::Result, "json"),
            (RunKind::Checkpoint, "safetensors"),
        ]
        .map(|(kind, end)| of_job(kind, end));
        for (runs, expected) in [
            (&[&first, &saved][..], &["1.jsonl [saves/a.safetensors] 1.0 2.0"][..]),
            (&[&first, &checkpoint(&[1, 2, 3])], &["1.jsonl [saves/a.safetensors] 1.0 2.0 3.0"]),
            // It does not name that one; and another run has replaced the file.
            (&[&first, &other], &["1.jsonl [] 1.0 2.0", "saves/b.safetensors [] 1.0"]),
            (&[&first, &replaced], &["1.jsonl [] 1.0 2.0", "saves/a.safetensors [] 1.0"]),
            (&job.each_ref(), &["jobs/a.json [jobs/a.jsonl jobs/a.safetensors] 4.0"]),
            // One with other settings has, and is resumed.
            (
                &[&set, &part("2.jsonl", 0, &[2]), &saved, &part("3.jsonl", 2, &[3])],
                &["1.jsonl [] 1.0 2.0", "3.jsonl [2.jsonl saves/a.safetensors] 1.0 2.0 3.2"],
            ),
            // A run that began anew has replaced the file.
            (
                &[&first, &saved, &part("2.jsonl", 0, &[3])],
                &["1.jsonl [] 1.0 2.0", "2.jsonl [saves/a.safetensors] 1.0 2.0 3.0"],
            ),
            (
                &[&part("2.jsonl", 2, &[]), &saved, &first],
                &["2.jsonl [1.jsonl saves/a.safetensors] 1.0 2.0"],
            ),
            // The later part where they overlap.
            (
                &[&third, &second, &saved, &first],
                &["3.jsonl [2.jsonl 1.jsonl saves/a.safetensors] 1.0 2.0 3.2 4.2 5.4 6.4"],
            ),
        ] {
            assert_eq!(joined(runs), expected);
        }
        let end = |end, at: &[u64]| {
            let runs = vec![Arc::new(SavedRun { end, ..first.clone() }), Arc::new(checkpoint(at))];
            join(runs).remove(0).end
        };
        assert_eq!(end(Some(RunState::Done), &[1, 3]), Some(RunState::Saved), "it was resumed");
        assert_eq!(end(None, &[1, 3]), None, "a checkpoint is written between two records");
    }
}
