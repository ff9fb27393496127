//! Reads records of runs, one JSON object per line.

use std::collections::HashMap;
use std::io::{BufRead, Read};
use std::path::{Path, PathBuf};

use miette::{Report, miette};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::{EDITED, HELP, SavedRun, State, unreadable, with_preset};
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
            map: map.unwrap_or(world),
            fingerprint,
            method,
            settings: with_preset(&preset, settings),
            seed,
            begun: start.updates,
            resumed: start.resumed.map(|path| found_from(source, path)),
            updates: start.updates,
            ..Self::default()
        }
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
                self.end = Some(if interrupted { State::Interrupted } else { State::Done });
                self.updates = updates;
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
    let (mut runs, mut line, mut problem) = (Vec::<SavedRun>::new(), Vec::new(), None);
    for number in 1_u64.. {
        line.clear();
        let mut part = reader.by_ref().take(MOST_OF_A_LINE);
        if part.read_until(b'\n', &mut line).map_err(|error| unreadable(path, &error))? == 0 {
            break;
        }
        let is_whole = line.ends_with(b"\n");
        let is_too_long = !is_whole && line.len() as u64 >= MOST_OF_A_LINE;
        if is_too_long {
            reader.skip_until(b'\n').map_err(|error| unreadable(path, &error))?;
        }
        let mut text = line.trim_ascii_end();
        if number == 1 {
            text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
        }
        let found = match (serde_json::from_slice(text), runs.last_mut()) {
            _ if text.is_empty() => continue,
            (Ok(Record::Start(start)), _) => {
                runs.push(SavedRun::begun(*start, path));
                continue;
            }
            (Ok(record), Some(run)) => {
                run.add(record);
                continue;
            }
            (Ok(Record::Evaluation(_)), None) => ":1: an evaluation before any start record".into(),
            (Ok(_), None) => continue,
            (Err(_), _) if is_too_long => {
                format!(": not a record: longer than {} MB", MOST_OF_A_LINE >> 20)
            }
            // The last line of a run that goes on may be incomplete.
            (Err(_), Some(_)) if !is_whole => break,
            (Err(error), _) => not_a_record(text, &error),
        };
        let own = runs.last_mut().map_or(&mut problem, |run| &mut run.problem);
        own.get_or_insert(format!(":{number}{found}"));
    }
    let Some(run) = runs.first_mut() else {
        if let Some(Mismatch { problem, help }) = RECORDS.mismatch(path) {
            return Err(miette!(help = help, "{}: {problem}", path.display()));
        }
        let problem = problem.unwrap_or(": no records".to_owned());
        return Err(miette!(help = HELP, "{}{problem}", path.display()));
    };
    run.problem = problem.or(run.problem.take());
    Ok(merged(runs))
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
