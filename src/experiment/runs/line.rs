//! A run as a line of JSON.

use std::borrow::Cow;
use std::path::Path;
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

#[cfg(test)]
mod tests {
    use super::super::file;

    #[test]
    fn a_checkpoint_that_is_gone_is_null() {
        let folder = tempfile::tempdir().expect("a folder");
        let records = folder.path().join("run.jsonl");
        let start = r#"{"event":"start","world":"maze","method":"her","preset":"default","settings":{},"seed":1}"#;
        let saved = r#"{"event":"saved","updates":5,"path":"own.safetensors"}"#;
        std::fs::write(&records, format!("{start}\n{saved}\n")).expect("records");
        let line = || {
            let run = file(&records).expect("records").remove(0);
            serde_json::to_value(run.line(None)).expect("JSON")
        };
        assert!(line()["checkpoint"].is_null());
        std::fs::write(folder.path().join("own.safetensors"), "a checkpoint").expect("a file");
        assert!(
            line()["checkpoint"].as_str().is_some_and(|path| path.ends_with("own.safetensors"))
        );
    }
}
