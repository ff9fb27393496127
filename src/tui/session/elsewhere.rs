//! A run that another program trains, here or on another machine that sees the folder: its checkpoint
//! and its records are read again whenever they change, or others if it goes on in those. Nothing is
//! locked or written.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::watch;

use super::Session;
use crate::experiment::saved_runs::{
    RecordsReader, RunKind, RunReader, RunState, SavedRun, Stamp, stamp, whole,
};
use crate::setup::outputs::is_same_file;
use crate::setup::saves::ago;
use gdg::engine::{EngineCommand, EngineNotice, Snapshot};

const LOOK_INTERVAL: Duration = Duration::from_secs(1);

/// When a checkpoint that could not be read is tried again.
const RETRY_INTERVAL: Duration = Duration::from_secs(5);

/// Such a run, from before its checkpoint is opened, so that no later version is missed.
pub struct TrainedElsewhere {
    checkpoint: PathBuf,
    /// The version of the checkpoint that is shown, or being opened.
    shown: Option<Stamp>,
    opened: Instant,
    seen: watch::Receiver<SeenFiles>,
}

#[derive(Clone, Default)]
struct SeenFiles {
    checkpoint: Option<Stamp>,
    /// The version of the records; none if they are gone, or cannot be read.
    records: Option<Stamp>,
    told: Arc<Vec<SavedRun>>,
}

impl TrainedElsewhere {
    /// Begins to look at its files, on a thread of its own, as a network may hang.
    pub fn look(checkpoint: PathBuf, records: PathBuf) -> std::io::Result<Self> {
        let shown = stamp(&checkpoint);
        let (publish, seen) =
            watch::channel(SeenFiles { checkpoint: shown, ..SeenFiles::default() });
        let path = checkpoint.clone();
        let (mut reader, mut records) = (RecordsReader::new(&records), records);
        let look = move || {
            while !publish.is_closed() {
                let before = publish.borrow().clone();
                let mut now = SeenFiles { checkpoint: stamp(&path), ..before.clone() };
                // Without records, it is the checkpoint.
                let written = stamp(&records).filter(|_| records != path);
                // Saved by a program that writes other records.
                if now.checkpoint != before.checkpoint
                    && written == before.records
                    && let Some(others) = growing_records(&path)
                {
                    (reader, records) = (RecordsReader::new(&others), others);
                }
                if written != before.records {
                    let runs = written.and_then(|_| reader.read().ok());
                    now.records = written.filter(|_| runs.is_some());
                    let dated = |run| SavedRun { written: written.and_then(|(at, _)| at), ..run };
                    let runs = runs.map(|runs| Arc::new(runs.into_iter().map(dated).collect()));
                    now.told = runs.unwrap_or(now.told);
                }
                if (now.checkpoint, now.records) != (before.checkpoint, before.records) {
                    publish.send_replace(now);
                }
                std::thread::sleep(LOOK_INTERVAL);
            }
        };
        std::thread::Builder::new().name("files".to_owned()).spawn(look)?;
        Ok(Self { checkpoint, shown, opened: Instant::now(), seen })
    }

    /// Returns what the records tell of the run in `snapshot`, the latest of several like it.
    fn told(&self, snapshot: &Snapshot) -> Option<SavedRun> {
        let (method, seed) = (snapshot.run.method.name(), snapshot.run.seed);
        let is_own = |told: &&SavedRun| {
            told.kind == RunKind::Records && (&told.method, told.seed) == (&method, seed)
        };
        self.seen.borrow().told.iter().rfind(is_own).cloned()
    }

    /// Returns the run as last saved, with what its records tell of it since: how far it is, and its
    /// evaluations. It goes on from what was shown `before` unless its map is another.
    pub fn with_records(&self, saved: &Snapshot, before: &Snapshot) -> Snapshot {
        let mut now = saved.clone();
        let is_same = (&now.title, now.run.seed, &now.edits)
            == (&before.title, before.run.seed, &before.edits);
        now.generation = before.generation + u64::from(!is_same);
        if !now.notice.is_error {
            now.notice = EngineNotice::default();
        }
        if (&saved.title, saved.run.seed, &saved.run.method)
            != (&before.title, before.run.seed, &before.run.method)
        {
            let (title, method, seed) = (&saved.title, saved.run.method.name(), saved.run.seed);
            let text = format!("the file has another run now: {title}, {method}, seed {seed}");
            let number = before.notice.number + 1;
            now.notice = EngineNotice { number, text, is_error: false };
        }
        if let Some(told) = self.told(saved) {
            let last = now.evaluations.last().map_or(0, |(updates, _)| *updates);
            let later = told.evaluations.iter().filter(|at| at.updates > last);
            let later = later.map(|at| (at.updates, at.evaluation.clone()));
            Arc::make_mut(&mut now.evaluations).extend(later);
            let progress = &told.progress;
            if progress.updates > now.counters.updates {
                now.counters.updates = progress.updates;
                now.counters.env_steps = progress.env_steps;
                now.counters.episodes = progress.episodes;
                now.seconds = progress.seconds;
            }
            if told.state() == RunState::Running {
                now.rates.0 = progress.updates_per_second;
                now.rates.1 = progress.env_steps as f64 / progress.seconds.max(1.0);
                let since = told.written.and_then(|at| at.elapsed().ok()).unwrap_or_default();
                now.seconds_left = progress.left.map(|left| (left - since.as_secs_f64()).max(0.0));
            }
        }
        // Nothing of it is this program's to save.
        now.saved.take().into_iter().for_each(|(_, file)| now.set_saved(file));
        now
    }

    /// Says in a word or two what the run does, and when what is shown of it was saved.
    fn state(&self, snapshot: &Snapshot) -> [String; 2] {
        let what = match self.told(snapshot).map(|told| told.state()) {
            Some(_) if self.seen.borrow().records.is_none() => {
                "watching: records are gone".to_owned()
            }
            None | Some(RunState::Running) => "watching".to_owned(),
            Some(state) => format!("watching: {}", state.name()),
        };
        let saved = match self.seen.borrow().checkpoint {
            None => "file is gone".to_owned(),
            Some(_) if snapshot.notice.is_error => "cannot be read".to_owned(),
            Some((written, _)) => written.and_then(ago).unwrap_or_default(),
        };
        [what, saved]
    }
}

/// Returns the records that grow of the run saved to `checkpoint`, in its folder or below.
fn growing_records(checkpoint: &Path) -> Option<PathBuf> {
    let mut reader = RunReader::new(&[whole(checkpoint).parent()?.to_owned()]);
    let is_own = |run: &&Arc<SavedRun>| {
        let is_saved_there = || run.kept().is_some_and(|kept| is_same_file(&kept, checkpoint));
        (run.kind, run.state()) == (RunKind::Records, RunState::Running) && is_saved_there()
    };
    let runs = reader.read(|_, _| ControlFlow::Continue(())).runs;
    runs.iter().find(is_own).map(|run| run.source.clone())
}

impl Session {
    pub fn watch(&mut self, files: TrainedElsewhere) {
        (self.elsewhere, self.saver.offers) = (Some(files), false);
        self.follow_files();
        self.screen.refuse_to_train();
    }

    /// Opens the checkpoint again if it has changed, and shows what is new; returns whether anything is.
    pub fn follow_files(&mut self) -> bool {
        let Some(run) = &mut self.elsewhere else { return false };
        let is_new = run.seen.has_changed().unwrap_or_default();
        let now = run.seen.borrow_and_update().checkpoint;
        let load = || EngineCommand::Load(run.checkpoint.clone());
        // It may have been read while it was replaced, or on a network that failed.
        let failed = self.cx.screen.snapshot.notice.is_error;
        let is_due = now != run.shown || failed && run.opened.elapsed() > RETRY_INTERVAL;
        if now.is_some() && is_due && self.cx.screen.engine.send(load()) {
            (run.shown, run.opened) = (now, Instant::now());
        }
        let state = Some(run.state(&self.cx.screen.snapshot));
        let is_newer = state != self.cx.screen.elsewhere;
        self.screen.elsewhere = state;
        if is_new {
            self.show_latest();
        }
        is_new || is_newer
    }

    pub fn ask_for_copy(&mut self) {
        self.saver.leave_file([""; 2]);
        self.open(self.saver.ask_file("name of the copy"));
    }

    /// Leaves the run to the other program, for a copy in the file `copy`; returns whether there was
    /// such a run, or why the copy cannot be there.
    pub fn leave_to_other(&mut self, copy: &Path) -> Result<bool, String> {
        if self.elsewhere.as_ref().is_some_and(|run| is_same_file(&run.checkpoint, copy)) {
            return Err("another program trains that file: enter another name".to_owned());
        }
        let was_elsewhere = self.elsewhere.take().is_some();
        if was_elsewhere {
            (self.screen.elsewhere, self.saver.offers) = (None, true);
            // What is shown stays: it is the same run, however often it was opened.
            let generation = self.snapshots.borrow().generation;
            Arc::make_mut(&mut self.screen.snapshot).generation = generation;
            self.show_latest();
        }
        Ok(was_elsewhere)
    }
}
