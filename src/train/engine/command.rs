//! What a front end can ask of an engine, and how it is carried out.

use std::path::PathBuf;
use std::sync::Arc;

use super::Worker;
use super::snapshot::{Phase, Snapshot, Step};
use crate::map::{Grid, StepSearch};
use crate::train::checkpoint;
use crate::train::run::{Limits, Run};
use crate::train::score::Success;
use crate::train::trainer::Trainer;

/// What a front end can ask for.
#[derive(Debug)]
pub enum Command {
    /// Stop training until told otherwise.
    Pause,
    /// Go on; beyond the limits where these have been reached.
    Resume,
    /// Do one step and pause.
    Step(Step),
    /// No more than so many updates a second, or as many as there can be.
    LimitSpeed(Option<f64>),
    /// Tell how this agent fares.
    Follow(Option<usize>),
    /// Save a checkpoint.
    Save(PathBuf),
    /// Go on with another map of the same size.
    ChangeMap(Arc<Grid>),
    /// Go on with other settings, method or preset; the data and, where they fit, the networks are kept.
    Change(Box<Run>),
    /// Begin anew, perhaps on another map.
    Begin(Box<Run>, Arc<Grid>),
    /// Go on with a checkpoint's run.
    Load(PathBuf),
}

impl Worker {
    /// Changes the map; what is to be said of it, or against it.
    fn change_map(&mut self, map: Arc<Grid>) -> Result<String, String> {
        let change = self.trainer.change_map(map.clone())?;
        self.diameter = Arc::default();
        let pieces = StepSearch::new(&map).components(&map).sizes.len();
        self.current.map = map;
        // What is being found out about the map as it was says nothing of the map that there is now.
        (self.evaluation, self.rested) = (None, None);
        self.renew(true).map_err(|error| error.to_string())?;
        let apart = if pieces > 1 { format!("; {pieces} pieces that do not reach each other") } else { String::new() };
        let (walled, opened, gone) = (change.walled, change.opened, change.transitions_removed);
        Ok(format!("{walled} cells walled, {opened} opened, {gone} transitions forgotten{apart}"))
    }

    /// Goes on with other settings; what was kept.
    fn change(&mut self, run: Run) -> candle_core::Result<String> {
        let kept = self.trainer.change_run(run)?;
        self.current.run = Arc::new(self.trainer.run().clone());
        (self.evaluation, self.rested) = (None, None);
        self.renew(true)?;
        Ok(match (kept.networks, kept.agents) {
            (true, true) => "changed; training goes on".to_owned(),
            (true, false) => "changed; networks and replay go on, agents began anew".to_owned(),
            (false, _) => "changed; the networks are fresh, the replay is kept".to_owned(),
        })
    }

    /// Goes on with another run altogether.
    fn adopt(&mut self, trainer: Trainer) -> candle_core::Result<()> {
        self.diameter = Arc::default();
        self.trainer = trainer;
        (self.evaluation, self.rested, self.next_update, self.follow) = (None, None, None, None);
        self.current = Snapshot {
            generation: self.current.generation + 1,
            speed: self.current.speed,
            notice: self.current.notice.clone(),
            ..Snapshot::of(&self.trainer)?
        };
        self.renew(true)
    }

    /// The latest evaluation in brief.
    fn success(&self) -> Option<Success> {
        self.current.evaluations.last().map(|(updates, evaluation)| evaluation.success(*updates))
    }

    pub(super) fn carry_out(&mut self, command: Command) {
        let told = match command {
            Command::Pause if self.current.phase.trains() => {
                self.current.phase = Phase::Paused;
                self.renew(true).map(|()| None).map_err(|e| e.to_string())
            }
            Command::Resume if !self.current.phase.trains() => {
                if self.current.phase == Phase::Done {
                    self.current.limits = Limits::default();
                }
                self.current.phase = Phase::Running;
                Ok(None)
            }
            Command::Step(step) if self.current.phase == Phase::Paused => {
                self.current.phase = Phase::Stepping(step);
                Ok(None)
            }
            Command::Pause | Command::Resume | Command::Step(_) => Ok(None),
            Command::LimitSpeed(speed) => {
                (self.current.speed, self.next_update) = (speed.filter(|s| *s > 0.0), None);
                Ok(None)
            }
            Command::Follow(agent) => {
                self.follow = agent;
                self.renew(false).map(|()| None).map_err(|e| e.to_string())
            }
            Command::Save(path) => checkpoint::save(&self.trainer, &path, self.success())
                .map(|()| {
                    let updates = self.trainer.counters().updates;
                    let text = format!("saved {} at update {updates}", path.display());
                    self.current.saved = Some((updates, Arc::new(path)));
                    Some(text)
                })
                .map_err(|e| e.to_string()),
            Command::ChangeMap(map) => self.change_map(map).map(Some),
            Command::Change(run) => self.change(*run).map(Some).map_err(|e| e.to_string()),
            Command::Begin(run, map) => Trainer::new(*run, map, self.trainer.threads())
                .and_then(|trainer| self.adopt(trainer))
                .map(|()| Some("a new run has begun".to_owned()))
                .map_err(|e| e.to_string()),
            Command::Load(path) => self.load(path).map(Some),
        };
        match told {
            Ok(Some(text)) | Err(text) => self.notify(text),
            Ok(None) => {}
        }
        self.publish();
    }

    fn load(&mut self, path: PathBuf) -> Result<String, String> {
        let trainer = checkpoint::load(&path, self.trainer.threads()).map_err(|e| e.to_string())?;
        let phase = self.current.phase.clone();
        self.adopt(trainer).map_err(|e| e.to_string())?;
        if !phase.trains() {
            self.current.phase = Phase::Paused;
        }
        let (updates, text) = (self.trainer.counters().updates, format!("loaded {}", path.display()));
        self.current.saved = Some((updates, Arc::new(path)));
        Ok(text)
    }
}
