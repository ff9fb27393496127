//! Reads records of runs, one JSON object per line.

use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use miette::{Report, miette};
use serde_json::Value;

use super::join::merged;
use super::{
    BEGINS, HELP, RunState, SavedRun, Stamp, UNKNOWN, checksum, facts, is_recent, stamp, unreadable,
};
use crate::experiment::spec::setting_text;
use crate::headless::records::{Progress, Record, Start};
use gdg::files::{FileFormat, Mismatch, Wanted, open};
use gdg::text::sanitized;
use gdg::train::EndReason;

/// The longest line of records: none that this program writes is nearly as long.
const MOST_OF_A_LINE: u64 = 16 << 20;

/// Records begin within this many bytes; other output may come first.
const MOST_BEFORE_RUNS: u64 = 1 << 20;

const RECORDS: Wanted =
    Wanted { name: "records of a run", help: HELP, own: &[FileFormat::Json, FileFormat::Text] };

const START: &[u8] = b"\"event\":\"start\"";

const OF_ANOTHER: &str = ": of another run, as this one has ended or is further on";

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

impl SavedRun {
    fn begun(start: Start, source: &Path) -> Self {
        let Start {
            world, fingerprint, facts: about, data, method, preset, settings, seed, ..
        } = start;
        let named = |of, key| Some(about.get(of)?.get(key)?.as_str()?.to_owned());
        let (data, scenario) = (data.map(|data| data.checksum), named("map", "scenario"));
        let map = named("map", "name").or_else(|| named("gym", "id"));
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
            saves: start.save.map(|path| (path.into(), start.save_every)),
            updates: start.updates,
            ..Self::default()
        }
    }

    /// Adds a record, written `at` a time, unless it cannot be of this run: another may write to the
    /// same file. Older records do not say when: 0.
    fn add(&mut self, record: Record, at: &Progress) -> Result<(), String> {
        let before = match &record {
            Record::Progress(_) => self.progress.updates,
            Record::Evaluation(_) => self.evaluations.last().map_or(0, |at| at.updates),
            _ => 0,
        };
        let is_next = at.updates == 0 || at.updates > before && at.updates >= self.updates;
        let is_back = at.seconds > 0.0 && at.seconds < self.progress.seconds;
        if self.end.is_some() || is_back || !is_next {
            return Err(OF_ANOTHER.to_owned());
        }
        self.updates = self.updates.max(at.updates);
        self.progress.seconds = self.progress.seconds.max(at.seconds);
        match record {
            Record::Progress(now) => self.progress = now,
            Record::Evaluation(at) => self.evaluations.push(*at),
            Record::Edit { updates, fingerprint, change, .. } => {
                let map = || Some(change.facts.get("map")?.as_str()?.to_owned());
                let to = fingerprint.map(|own| checksum(&own)).or_else(map);
                // Of several at once, the last.
                self.edits.retain(|(at, _)| *at != updates);
                self.edits.push((updates, to.unwrap_or_else(|| UNKNOWN.to_owned())));
            }
            Record::Saved { path, updates } => {
                self.checkpoint = Some(found_from(&self.source, path));
                self.saved_at = Some(updates);
            }
            Record::End { reason, .. } => {
                let interrupted = reason == EndReason::Interrupted;
                self.end = Some(if interrupted { RunState::Interrupted } else { RunState::Ended });
            }
            Record::Start(_) | Record::Recovery(_) | Record::Warning(_) | Record::Other => {}
        }
        Ok(())
    }
}

/// Returns where a file is that `records` name: beside them, as their folder may be a copy; or else its
/// path is relative to the folder in which the run was started, one above them or the present one.
fn found_from(records: &Path, path: String) -> PathBuf {
    let path = PathBuf::from(path);
    let beside = path.file_name().map(|name| records.with_file_name(name));
    let above = records.ancestors().skip(1).map(|folder| folder.join(&path));
    beside.into_iter().chain(above).find(|path| path.is_file()).unwrap_or(path)
}

/// Reads the runs in a file of records, one JSON object per line: each begins with its `start`. What
/// has been read before is not read again.
///
/// Leaves out lines that are no records, as a full disk or a second writer may have damaged them.
#[derive(Default)]
pub struct RecordsReader {
    path: PathBuf,
    runs: Vec<SavedRun>,
    problem: Option<String>,
    /// Whether what follows may be another run's, up to the next start.
    is_mixed: bool,
    /// Lines and bytes read.
    lines: u64,
    read: u64,
    /// The line that the file begins with.
    first: Vec<u8>,
}

impl RecordsReader {
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned(), ..Self::default() }
    }

    /// Reads what is new; all of a file that has shrunk or begins otherwise than before.
    pub fn read(&mut self) -> Result<Vec<SavedRun>, Report> {
        let path = self.path.clone();
        self.read_on().map_err(|error| unreadable(&path, &error))?;
        let Some(run) = self.runs.first_mut() else {
            // A run that has just begun tells nothing yet.
            let is_new =
                |(at, bytes): Stamp| bytes == 0 && at.is_some_and(|at| is_recent(at, BEGINS));
            if stamp(&path).is_some_and(is_new) {
                return Ok(vec![SavedRun { source: path, ..SavedRun::default() }]);
            }
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
                    // A line that was cut off may have the next run's start within.
                    self.is_mixed =
                        found == OF_ANOTHER || line.windows(START.len()).any(|part| part == START);
                    let rest = if self.is_mixed { ", and what follows in this run" } else { "" };
                    let problem = format!(":{}{found}{rest}", self.lines + 1);
                    *own = own.take().filter(|_| !self.is_mixed).or(Some(problem));
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
            (Ok(Record::Start(start)), _) => {
                self.is_mixed = false;
                self.runs.push(SavedRun::begun(*start, &self.path));
            }
            _ if self.is_mixed => {}
            (Ok(Record::Evaluation(at)), _) if !at.is_possible() => {
                return Err(": not a record: impossible numbers".into());
            }
            (Ok(record), Some(run)) => {
                return run.add(record, &serde_json::from_slice(text).unwrap_or_default());
            }
            (Ok(Record::Evaluation(_)), None) => {
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
