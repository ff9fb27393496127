//! A run as a line of JSON.

use std::borrow::Cow;
use std::time::SystemTime;

use jiff::Timestamp;
use serde::Serialize;
use serde_json::{Map, Value};

use super::{Kind, SavedRun};
use gdg::train::Evaluation;

/// What is written of a run.
#[derive(Debug, Serialize)]
pub struct RunLine<'a> {
    file: Cow<'a, str>,
    /// What the file is: `checkpoint`, `result` or `records`.
    kind: &'static str,
    state: &'static str,
    map: &'a str,
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
    /// Returns what is written of it, given when its file was `written`.
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
            checkpoint: self.checkpoint.as_deref().map(std::path::Path::to_string_lossy),
        }
    }
}
