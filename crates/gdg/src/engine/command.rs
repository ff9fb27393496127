//! Commands from a front end to an engine, and their execution.

use std::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::snapshot::{Phase, Snapshot, Step};
use super::{TrainingThread, training_loop};
use crate::env::{EnvError, Environment};
use crate::files;
use crate::job::Job;
use crate::text::{counted, grouped, sanitized};
use crate::train::{
    self, Dataset, Limits, Notes, Run, SaveTo, TrainError, Trainer, WorldChange, list_settings,
    memory,
};

const MAX_AUTOSAVES: usize = 3;

const MAX_NAMED_CHANGES: usize = 3;

/// Makes a world from the run's, on the trainer's thread, as preparing a large map is slow.
pub type MakeWorld =
    Box<dyn FnOnce(&dyn Environment) -> Result<Box<dyn Environment>, EnvError> + Send>;

pub enum EngineCommand {
    Pause,
    /// Resume training; lifts the limits if they have been reached.
    Resume,
    Step(Step),
    /// Limit the updates per second; `None` removes the limit.
    LimitSpeed(Option<f64>),
    Evaluate,
    /// Pause after each evaluation for this many times its duration.
    PauseEvaluations(u32),
    /// Save a checkpoint with what the front end keeps in it.
    Save(SaveTo, Notes),
    /// Save to a separate file beside this one, else beside the next that works; keeps the newest few.
    Autosave(PathBuf, Vec<PathBuf>, Notes),
    /// Continue in an edited world; the notice of what has changed begins with this text.
    ChangeWorld(MakeWorld, &'static str),
    /// Continue with other settings, method or preset; keeps data and, where they fit, networks.
    Change(Box<Run>),
    StartRun(Box<Run>, MakeWorld),
    Load(PathBuf),
}

type CommandResult = Result<String, Box<dyn Error>>;

/// Parts of starting a run: its world is made, then its trainer, data are learned from, and its
/// state is captured.
const START_STAGES: usize = 4;

/// Returns a file's stem without what an autosave added: a run resumed from `rooms-auto-5000`
/// autosaves to `rooms-auto-9000`.
fn without_autosave_suffix(stem: &str) -> &str {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    match stem.rsplit_once("-auto-") {
        Some((own, updates)) if updates.split('-').all(is_number) => own,
        _ => stem,
    }
}

fn changes(before: &Run, after: &Run) -> String {
    let (old, new) = (list_settings(&before.settings), list_settings(&after.settings));
    let settings = old.iter().zip(&new).filter(|(old, new)| old != new);
    let mut settings: Vec<String> =
        settings.map(|((name, old), (_, new))| format!("{name} {old} to {new}")).collect();
    if settings.len() > MAX_NAMED_CHANGES {
        settings = vec![counted(settings.len() as u64, "setting")];
    }
    let method = (before.method != after.method).then(|| format!("method {}", after.method.name()));
    let preset = (before.preset != after.preset).then(|| format!("preset {}", after.preset.name()));
    let all: Vec<String> = method.into_iter().chain(preset).chain(settings).collect();
    if all.is_empty() { "changed".to_owned() } else { all.join(", ") }
}

fn activity(command: &EngineCommand) -> &'static str {
    match command {
        EngineCommand::Save(..) | EngineCommand::Autosave(..) => "saving",
        EngineCommand::ChangeWorld(..) => "applying the edit",
        EngineCommand::Change(..) => "changing settings",
        EngineCommand::StartRun(..) | EngineCommand::Load(..) => "opening the run",
        _ => "following a command",
    }
}

impl TrainingThread {
    pub(super) fn make_edit(&mut self) -> Result<(), TrainError> {
        let Some(change) = self.trainer.make_edit()? else { return Ok(()) };
        self.current.made_edits += 1;
        let what = self.changed_world(change, "edited as planned: ")?;
        self.notify(what);
        Ok(())
    }

    fn changed_world(&mut self, change: WorldChange, done: &str) -> Result<String, TrainError> {
        self.current.title = self.trainer.world().title().into();
        self.current.edits = Arc::new(self.trainer.history().edits().to_vec());
        // A running evaluation of the old world says nothing about the new one.
        (self.evaluation, self.next_evaluation_at) = (None, None);
        self.refresh_snapshot(true)?;
        let warning = change.warning.map_or(String::new(), |warning| format!("; {warning}"));
        let removed = match change.transitions_removed as u64 {
            0 => String::new(),
            removed => {
                format!("; forgot {} that would now end elsewhere", counted(removed, "transition"))
            }
        };
        Ok(format!("{done}{}{removed}{warning}", change.summary))
    }

    fn change(&mut self, run: Run) -> CommandResult {
        memory::check(&run, self.trainer.world(), self.trainer.registry())?;
        let what = changes(self.trainer.run(), &run);
        let kept = self.trainer.change_run(run)?;
        if !kept.networks {
            // What has been learned before stays in the files that were written.
            self.new_file = None;
            self.autosaved.clear();
            self.current.autosaves = Arc::default();
        }
        self.current.run = Arc::new(self.trainer.run().clone());
        (self.current.methods, self.current.learns) =
            (self.trainer.history().methods().clone(), self.trainer.learns());
        (self.evaluation, self.next_evaluation_at) = (None, None);
        self.refresh_snapshot(true)?;
        let then = match (kept.networks, kept.agents) {
            _ if !self.current.learns => "; agents step at random, nothing is learned",
            (true, true) if self.current.phase == Phase::Done => {
                "; the limit of the run is reached"
            }
            (true, true) => "",
            (true, false) => "; agents restarted, networks and replay kept",
            (false, _) => "; networks reset, replay kept",
        };
        Ok(what + then)
    }

    fn switch_to(&mut self, trainer: Trainer) -> Result<(), TrainError> {
        (self.trainer, self.training_loop) = (trainer, training_loop());
        self.trainer.set_job(self.job.clone());
        (self.evaluation, self.next_evaluation_at, self.next_update_at) = (None, None, None);
        self.new_file = None;
        self.autosaved.clear();
        self.current = Snapshot {
            generation: self.current.generation + 1,
            speed: self.current.speed,
            notice: self.current.notice.clone(),
            ..Snapshot::capture(&self.trainer)?
        };
        self.refresh_snapshot(true)
    }

    fn save(&mut self, to: SaveTo, notes: Notes) -> CommandResult {
        // The front end may not know yet which file its previous save went to.
        let to = match (&self.new_file, to) {
            (Some((requested, written_to)), SaveTo::CreateNew(path)) if *requested == path => {
                SaveTo::Replace(written_to.clone())
            }
            (_, to) => to,
        };
        let path = self.write(&to, [], notes).inspect_err(|error| {
            self.current.save_failed = (self.current.save_failed.0 + 1, error.to_string());
        })?;
        let why = format!(" ({} {})", to.path().display(), to.obstacle());
        let why = if to.path() == path { "" } else { &why };
        let text = self.saved_text("saved", &path, why);
        if let SaveTo::CreateNew(requested) = to {
            self.new_file = Some((requested, path.clone()));
        }
        self.current.update(&self.trainer);
        self.current.set_saved(Arc::new(path));
        Ok(text)
    }

    fn autosave(&mut self, own: &Path, others: &[PathBuf], notes: Notes) -> CommandResult {
        let stem = own.file_stem().unwrap_or_default().to_string_lossy();
        let updates = self.trainer.counters().updates;
        let end = format!("-auto-{updates}.safetensors");
        let named = |at: &Path| {
            let folder = at.parent().unwrap_or(Path::new(""));
            SaveTo::CreateNew(files::named(folder, without_autosave_suffix(&stem), &end))
        };
        let path = self.write(&named(own), others.iter().map(|at| named(at)), notes)?;
        let text = self.saved_text("autosaved", &path, "");
        let mark = files::mark_in_use(&path);
        self.autosaved.push((updates, path, mark));
        while self.autosaved.len() > MAX_AUTOSAVES {
            let (_, oldest, mark) = self.autosaved.remove(0);
            drop(mark);
            train::remove_own(&oldest);
        }
        self.current.autosaves =
            Arc::new(self.autosaved.iter().map(|(at, path, _)| (*at, path.clone())).collect());
        Ok(text)
    }

    fn write(
        &mut self,
        to: &SaveTo,
        others: impl IntoIterator<Item = SaveTo>,
        notes: Notes,
    ) -> Result<PathBuf, Box<dyn Error>> {
        // Even when no rollbacks are left, the networks are good and can be saved.
        let diverged = self.trainer.ensure_finite().err();
        self.trainer.take_recovery().into_iter().for_each(|recovery| self.on_recovery(recovery));
        self.trainer.set_notes(notes);
        let (path, _) = train::save_or_else(&self.trainer, to, others)
            .map_err(|e| format!("{} ({})", e.problem, e.file.display()))?;
        if let Some(error) = diverged {
            self.current.phase = Phase::Failed(error.to_string());
        }
        Ok(path)
    }

    fn saved_text(&mut self, how: &str, path: &Path, why: &str) -> String {
        let at = grouped(self.trainer.learned_updates());
        let saved = format!("{how} {} at update {at}{why}", path.display());
        let all = std::iter::once(saved).chain(self.trainer.take_warnings());
        all.collect::<Vec<_>>().join("; ")
    }

    /// Runs a command. A panic is reported, and the run is repaired as far as possible.
    pub(super) fn execute(&mut self, command: EngineCommand) {
        let _activity = self.job.part(activity(&command));
        let saves = matches!(command, EngineCommand::Save(..));
        match catch_unwind(AssertUnwindSafe(|| self.outcome(command))) {
            Ok(Ok(Some(text))) => self.notify(sanitized(&text)),
            Ok(Ok(None)) => {}
            Ok(Err(error)) => self.report(sanitized(&error.to_string())),
            Err(_) => {
                self.repair("a command");
                if saves {
                    let text = "saving failed with an internal error".to_owned();
                    self.current.save_failed = (self.current.save_failed.0 + 1, text);
                }
            }
        }
        self.publish();
    }

    fn outcome(&mut self, command: EngineCommand) -> Result<Option<String>, Box<dyn Error>> {
        let text = match command {
            EngineCommand::Pause if self.current.phase.is_training() => {
                self.current.phase = Phase::Paused;
                self.refresh_snapshot(true)?;
                return Ok(None);
            }
            EngineCommand::Resume if !self.current.phase.is_training() => {
                if self.current.phase == Phase::Done {
                    self.current.limits = Limits::default();
                }
                self.current.phase = Phase::Running;
                return Ok(None);
            }
            EngineCommand::Step(step) if self.current.phase == Phase::Paused => {
                self.current.phase = Phase::Stepping(step);
                return Ok(None);
            }
            EngineCommand::Step(_) if self.current.phase == Phase::Done => {
                "no step: the limit is reached".to_owned()
            }
            EngineCommand::Step(_) if !self.current.phase.is_training() => {
                "no step: training has stopped".to_owned()
            }
            EngineCommand::Pause | EngineCommand::Resume | EngineCommand::Step(_) => {
                return Ok(None);
            }
            EngineCommand::LimitSpeed(speed) => {
                (self.current.speed, self.next_update_at) = (speed.filter(|s| *s > 0.0), None);
                return Ok(None);
            }
            EngineCommand::PauseEvaluations(factor) => {
                self.evaluation_pause = factor;
                return Ok(None);
            }
            EngineCommand::Evaluate if self.start_evaluation()? => "evaluating ...".to_owned(),
            EngineCommand::Evaluate => "an evaluation is already running".to_owned(),
            EngineCommand::Save(to, notes) => self.save(to, notes)?,
            EngineCommand::Autosave(own, others, notes) => self.autosave(&own, &others, notes)?,
            EngineCommand::ChangeWorld(make, done) => {
                let world = make(self.trainer.world())?;
                let change = self.trainer.change_world(&*world)?;
                self.changed_world(change, done)?
            }
            EngineCommand::Change(run) => self.change(*run)?,
            EngineCommand::StartRun(run, make) => {
                self.opening().begin(0, START_STAGES);
                let world = make(self.trainer.world())?;
                self.start_run(*run, &*world)?
            }
            EngineCommand::Load(path) => self.load(path)?,
        };
        Ok(Some(text))
    }

    fn start_run(&mut self, run: Run, world: &dyn Environment) -> CommandResult {
        let progress = self.opening();
        progress.begin(1, START_STAGES);
        let registry = self.trainer.registry();
        memory::check(&run, world, registry)?;
        let mut trainer = Trainer::new(run, world, registry, self.trainer.threads())?;
        // The same world is learned from the same data.
        if let Some(data) = self.trainer.data()
            && trainer.world().title() == self.trainer.world().title()
        {
            let data = Dataset::reread(data, registry.data.as_deref(), trainer.world(), &progress)?;
            progress.begin(2, START_STAGES);
            trainer.learn_from(&data, &progress)?;
        }
        progress.begin(3, START_STAGES);
        self.switch_to(trainer)?;
        Ok("started a new run".to_owned())
    }

    fn opening(&self) -> Job {
        self.job.latest_part().unwrap_or_default()
    }

    fn load(&mut self, path: PathBuf) -> CommandResult {
        let progress = self.opening();
        let (registry, threads) = (self.trainer.registry(), self.trainer.threads());
        let loaded = train::load_with(&path, registry, threads, &progress);
        let name = || path.file_name().unwrap_or_default().to_string_lossy();
        let trainer =
            loaded.map_err(|e| format!("not loaded: {} {}; {}", name(), e.problem, e.help))?;
        let phase = self.current.phase.clone();
        self.switch_to(trainer)?;
        if !phase.is_training() {
            self.current.phase = Phase::Paused;
        }
        let text = format!("loaded {}", path.display());
        self.current.set_saved(Arc::new(path));
        Ok(text)
    }
}
