//! Reads records of runs, one JSON object per line.

use std::collections::HashMap;
use std::fmt;
use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};

use miette::{Report, miette};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::{EDITED, HELP, Kind, SavedRun, unreadable, with_preset};
use crate::experiment::spec::{EvaluationAt, setting_text};
use gdg::files::{Format, Mismatch, Wanted, open};
use gdg::text::sanitized;
use gdg::train::DataSource;

/// The longest line of records: none that this program writes is nearly as long.
const MOST_OF_A_LINE: u64 = 16 << 20;

const RECORDS: Wanted =
    Wanted { name: "records of a run", help: HELP, own: &[Format::Json, Format::Text] };

/// Some editors begin files with it.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// They go on, or were cut off.
    Open,
    /// A signal has interrupted the run.
    Interrupted,
    Finished,
    /// Its checkpoint has been resumed since, elsewhere.
    Continued,
}

/// Lines of records that cannot be read and are left out.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Skipped {
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
    Edit {},
    End {
        reason: String,
        updates: u64,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
struct Start {
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
}

impl SavedRun {
    fn begun(start: Start, source: &Path) -> Self {
        let Start { world, fingerprint, map, gym, data, method, preset, settings, seed, .. } =
            start;
        let named =
            |facts: &Option<Value>, key| Some(facts.as_ref()?.get(key)?.as_str()?.to_owned());
        // Seeds are those of one thing only if they learned and were evaluated on the same.
        let data = data.map(|data| format!("data={:08x}", data.checksum));
        let scenario = named(&map, "scenario").map(|tasks| format!("scenario={tasks}"));
        let map = named(&map, "name").or_else(|| named(&gym, "id"));
        let settings = settings.iter().map(|(name, value)| setting_text(name, value));
        let settings = settings.chain(data).chain(scenario);
        Self {
            source: source.to_owned(),
            kind: Kind::Records(Ending::Open),
            map: map.unwrap_or(world),
            fingerprint,
            method,
            variant: None,
            settings: with_preset(&preset, settings),
            seed,
            begun: start.updates,
            resumed: start.resumed.map(|path| found_from(source, path)),
            updates: start.updates,
            evaluations: Vec::new(),
            checkpoint: None,
            others: Vec::new(),
            skipped: Skipped::default(),
        }
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
        self.evaluations.splice(0..0, before.evaluations);
        (self.begun, self.resumed) = (before.begun, before.resumed);
        self.checkpoint = self.checkpoint.take().or(before.checkpoint);
        before.skipped.add(std::mem::take(&mut self.skipped));
        self.skipped = before.skipped;
    }

    fn add(&mut self, record: Record) {
        match record {
            Record::Progress { updates } => self.updates = updates,
            Record::Evaluation(at) => {
                self.updates = at.updates;
                self.evaluations.push(*at);
            }
            Record::Edit {} => self.fingerprint = Some(EDITED.to_owned()),
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
pub fn read(path: &Path) -> Result<Vec<SavedRun>, Report> {
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
        let text = line.trim_ascii_end();
        let text =
            if number == 1 { text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text) } else { text };
        if text.trim_ascii_start().is_empty() {
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
        if let Some(Mismatch { problem, help }) = RECORDS.mismatch(path) {
            return Err(miette!(help = help, "{}: {problem}", path.display()));
        }
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
        Err(error) => {
            let before = &line[..line.len().min(error.column().saturating_sub(1))];
            let column = String::from_utf8_lossy(before).chars().count() + 1;
            format!(":{column}: not a record: not JSON")
        }
    }
}

/// Joins the parts of a run that was resumed, or begun again; the runs are in the order in which they
/// began.
fn merged(parts: Vec<SavedRun>) -> Vec<SavedRun> {
    let mut runs: Vec<SavedRun> = Vec::new();
    let mut places: HashMap<_, Vec<usize>> = HashMap::new();
    for part in parts {
        let facts = (part.map.clone(), part.method.clone(), part.settings.clone(), part.seed);
        let alike = places.entry(facts).or_default();
        let is_before = |before: &SavedRun| {
            before.fingerprint == part.fingerprint || part.begun > 0 && before.is_same(&part)
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
