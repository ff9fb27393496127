//! Saving the run, by the user and automatically; quitting without losing it, and closing it, after
//! which the terminal says what is left.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use miette::Report;

use super::{Cx, Session};
use crate::process::errors::from_checkpoint_error;
use crate::process::logging;
use crate::process::waiting::{TWICE, Waiting};
use crate::setup::outputs::{belongs_to_result, elsewhere, is_same_file, to_elsewhere};
use crate::setup::saves::{SAVES, newest_first, resume_command};
use crate::tui::dialog::{Choice, Dialog, Prompt, Question};
use crate::tui::interface::ClosedRun;
use crate::tui::lists;
use crate::tui::screen::{Screen, summary_of};
use crate::tui::terminal;
use gdg::engine::{Engine, EngineCommand, Phase, Snapshot};
use gdg::files::{named, unused_path};
use gdg::job::Running;
use gdg::map::Grid;
use gdg::text::grouped;
use gdg::train::{self, Notes, SaveTo, Trainer};

/// Unsaved training that quitting may discard without asking.
const MAX_DISCARDED_SECS: f64 = 10.0;

/// How long quitting waits for its checkpoint: an environment may hang. Then it closes.
const LONGEST_WAIT_TO_QUIT: Duration = Duration::from_secs(5);

/// Saves the run, and knows whether the program quits.
pub struct Saver {
    /// The run's own file, or the one it will be saved to.
    pub to: SaveTo,
    /// The path given on the command line; closing saves to it.
    pub named: Option<PathBuf>,
    /// The file named on the command line, for the first run.
    first: Option<SaveTo>,
    /// The folder of runs without a file of their own.
    pub folder: PathBuf,
    /// Minutes between two autosaves; 0 for none.
    pub autosave_minutes: f64,
    autosaved_at: Instant,
    /// The map when a checkpoint was last saved automatically.
    autosaved_map: Option<Arc<Grid>>,
    /// The checkpoint that is asked for and not written yet: since when, and the map in it.
    pub awaited: Option<(Instant, Option<Arc<Grid>>)>,
    pub is_done: bool,
    /// What to do once the checkpoint is written. If it cannot be written and that is to quit, the
    /// user is asked for another file.
    then: Option<Choice>,
    /// Whether training was running when it was paused to save before quitting.
    was_training: bool,
    /// Whether there was an internal error.
    pub has_failed: bool,
    /// Whether the run has been saved here, and was not only loaded.
    has_saved: bool,
    /// Whether failures and quitting offer to save: not in a comparison, which has its own question.
    pub offers: bool,
}

const QUIT: Choice = Choice::Quit { save: false };

impl Saver {
    /// Creates a saver to the file named on the command line; 0 minutes switch autosaves off.
    pub fn new(first: Option<SaveTo>, autosave_minutes: f64) -> Self {
        let named = first.as_ref().map(|to| to.path().to_owned());
        Self {
            to: SaveTo::CreateNew(PathBuf::new()),
            named,
            first,
            folder: SAVES.into(),
            autosave_minutes,
            autosaved_at: Instant::now(),
            autosaved_map: None,
            awaited: None,
            is_done: false,
            then: None,
            was_training: false,
            has_failed: false,
            has_saved: false,
            offers: true,
        }
    }

    /// Chooses the file of the run in `snapshot`: a file belongs to who wrote or loaded it.
    pub fn start_run(&mut self, snapshot: &Snapshot) {
        let Snapshot { title, run, saved, .. } = snapshot;
        let saved = saved.as_ref().filter(|(_, path)| !belongs_to_result(path));
        self.then = None;
        let end = format!("-{}-seed{}.safetensors", run.method.name(), run.seed);
        self.to = match (self.first.take(), saved, &self.named) {
            (Some(to), ..) => to,
            (None, Some((_, path)), _) => SaveTo::Replace(path.to_path_buf()),
            (None, None, Some(path)) => SaveTo::CreateNew(path.clone()),
            (None, None, None) => SaveTo::CreateNew(named(&self.folder, &**title, &end)),
        };
    }

    /// Leaves the run's file as it is from now on, as the run goes on with new networks or, where there
    /// is no file yet, under the name of a new method.
    pub fn leave_file(&mut self, [before, now]: [&str; 2]) {
        let name = self.to.path().file_name().unwrap_or_default().to_string_lossy();
        let name = name.replace(&format!("-{before}-seed"), &format!("-{now}-seed"));
        self.to = SaveTo::CreateNew(self.to.path().with_file_name(name));
    }

    /// Returns the file of the next checkpoint: a new file, unless the run already has its own.
    fn next_file(&self) -> PathBuf {
        match &self.to {
            SaveTo::Replace(path) => path.clone(),
            SaveTo::CreateNew(path) => unused_path(path),
        }
    }

    pub fn ask_file(&self, title: &str) -> Prompt {
        let stem = self.next_file().file_stem().map(|s| s.to_string_lossy().into_owned());
        let hint = format!("a name, saved as {SAVES}/NAME.safetensors, or a path");
        Prompt::new(Question::SaveAs, title, hint, stem.unwrap_or_default())
    }

    /// Saves the run; returns whether the trainer accepted the command.
    pub fn save(&mut self, cx: &mut Cx) -> bool {
        cx.screen.say(&format!("saving {} ...", self.next_file().display()));
        self.request_save(cx)
    }

    pub fn request_save(&mut self, cx: &mut Cx) -> bool {
        let is_asked = cx.screen.command(EngineCommand::Save(self.to.clone(), notes(cx)));
        let map = cx.scene.maze().map(|maze| maze.map.clone());
        self.awaited = is_asked.then(|| (Instant::now(), map));
        is_asked
    }

    /// Saves the run, and then does something else unless that fails; to another file if the run's own
    /// is to be loaded as it was.
    pub fn save_then(&mut self, then: Choice, cx: &mut Cx) {
        let own = self.to.path();
        if let Choice::LoadUnsaved(path) = &then
            && is_same_file(path, own)
        {
            self.to = SaveTo::CreateNew(unused_path(own));
        }
        self.then = Some(then).filter(|_| self.save(cx));
    }

    /// Saves automatically, to a file next to the user's own.
    fn autosave(&mut self, cx: &mut Cx) {
        let (own, others) = (self.to.path().to_owned(), elsewhere(self.to.path()).split_off(1));
        cx.screen.command(EngineCommand::Autosave(own, others, notes(cx)));
    }

    /// Handles a request to quit. A checkpoint that is still awaited is written on closing.
    pub fn quit(&mut self, cx: &mut Cx) {
        if self.awaited.is_some() {
            self.is_done = true;
        } else if self.named.is_some() {
            self.save_and_quit(cx);
        } else if let Some(lost) = unsaved(cx) {
            cx.screen.open(lists::quit_choices(lost, self.next_file().display()));
        } else {
            self.is_done = true;
        }
    }

    pub fn save_and_quit(&mut self, cx: &mut Cx) {
        if cx.screen.snapshot.saved.is_some() && !is_unsaved(cx) {
            self.is_done = true;
            return;
        }
        self.was_training = cx.screen.snapshot.phase.is_training();
        cx.screen.command(EngineCommand::Pause);
        self.save_then(QUIT, cx);
    }

    /// Handles a closed dialog: quitting is cancelled, and training paused for it resumes.
    pub fn cancel_quit(&mut self, cx: &mut Cx) {
        if self.then.take_if(|then| *then == QUIT).is_some() && self.was_training {
            cx.screen.command(EngineCommand::Resume);
        }
    }
}

/// What happens to the run.
impl Saver {
    /// Handles the outcome of saves since `before`; returns what to do after one.
    pub fn on_snapshot(&mut self, before: &Snapshot, cx: &mut Cx) -> Option<Choice> {
        let now = cx.screen.snapshot.clone();
        // What quitting would lose grows while it is asked about.
        let top = cx.screen.dialogs.last_mut().filter(|top| self.offers && top.asks_to_quit());
        if let Some(Dialog::Pick(list)) = top {
            let lost = lists::lost(&now, cx.scene.has_unsaved_map());
            let asked = lists::quit_choices(lost, self.next_file().display());
            list.update(asked.items().cloned().collect());
        }
        let mut then = None;
        if let Some((_, path)) = &now.saved
            && before.saved.as_ref().is_none_or(|(_, earlier)| !Arc::ptr_eq(earlier, path))
        {
            self.to = SaveTo::Replace(path.to_path_buf());
            self.has_saved = now.generation == before.generation;
            // Edits that came later are not in it.
            if let (Some((_, Some(map))), Some(maze)) = (self.awaited.take(), cx.scene.maze_mut()) {
                maze.kept_map = map;
            }
            then = self.then.take();
        }
        if now.save_failed.0 > before.save_failed.0 {
            self.awaited = None;
            self.then.take_if(|then| *then != QUIT);
            if self.then.is_some() {
                let mut prompt = self.ask_file("another name, to save and quit");
                prompt.error = Some(now.save_failed.1.clone());
                cx.screen.open(prompt);
            }
        }
        then
    }

    /// Handles the passing of time: reports internal errors, saves the run after the first one, and
    /// saves it automatically.
    pub fn on_tick(&mut self, cx: &mut Cx) {
        let waits = |(since, _): &(Instant, _)| since.elapsed() > LONGEST_WAIT_TO_QUIT;
        if self.then == Some(QUIT) && self.awaited.as_ref().is_some_and(waits) {
            self.quit(cx);
        }
        for failure in gdg::faults::take_failures() {
            let text = failure.to_string();
            cx.screen.report(&text);
            if !std::mem::replace(&mut self.has_failed, true) {
                self.autosave(cx);
                self.show_failure("internal error", &text, &mut cx.screen);
            }
        }
        let minutes = self.autosaved_at.elapsed().as_secs_f64() / 60.0;
        if self.autosave_minutes > 0.0 && minutes > self.autosave_minutes {
            self.autosaved_at = Instant::now();
            // What has not changed needs no other copy, which would take the place of an older one.
            let map = cx.scene.maze().map(|maze| maze.map.clone());
            let is_edited = cx.scene.has_unsaved_map() && map != self.autosaved_map;
            if cx.screen.snapshot.lost_updates() > 0 || is_edited {
                self.autosaved_map = map;
                self.autosave(cx);
            }
        }
    }

    pub fn show_failure(&self, title: &str, problem: &str, screen: &mut Screen) {
        if self.offers {
            screen.open(lists::failure(title, problem, &self.next_file(), &logging::hint()));
        }
    }

    /// Makes closing save whatever is unsaved, as after a signal, which cannot ask.
    pub fn save_on_closing(&mut self, cx: &Cx) {
        if is_unsaved(cx) && self.named.is_none() {
            self.named = Some(self.to.path().to_owned());
        }
    }
}

pub fn notes(cx: &Cx) -> Notes {
    Notes { log: cx.screen.log.entries().to_vec(), goal: cx.scene.goal() }
}

fn is_unsaved(cx: &Cx) -> bool {
    cx.screen.snapshot.unsaved_seconds() > 0.0 || has_unsaved_changes(cx)
}

fn has_unsaved_changes(cx: &Cx) -> bool {
    let snapshot = &cx.screen.snapshot;
    snapshot.has_unsaved_settings()
        || snapshot.has_unsaved_evaluation()
        || cx.scene.has_unsaved_map()
}

/// Whether enough is unsaved to ask about it: training, or any change of what was saved.
pub fn is_worth_saving(cx: &Cx) -> bool {
    cx.screen.snapshot.unsaved_seconds() > MAX_DISCARDED_SECS || has_unsaved_changes(cx)
}

/// Says what leaving the run would lose, if it is worth saving.
pub fn unsaved(cx: &Cx) -> Option<String> {
    is_worth_saving(cx).then(|| lists::lost(&cx.screen.snapshot, cx.scene.has_unsaved_map()))
}

impl Session {
    /// Ends training and saves if that is due. The summary says what is lost.
    pub fn close(mut self, engine: Engine) -> ClosedRun {
        if self.elsewhere.is_some() {
            drop(self);
            engine.stop();
            return ClosedRun::default();
        }
        // A second or two; otherwise its temporary file would stay behind.
        self.writing.take().map(Running::finish);
        // Decided before: what closing itself reports changes nothing.
        self.catch_up();
        let job = engine.job().clone();
        let _waiting = Waiting::begin(&job, TWICE, terminal::restore);
        let failed =
            self.saver.has_failed || matches!(self.screen.snapshot.phase, Phase::Failed(_));
        let is_wanted = self.saver.named.is_some() || self.saver.awaited.is_some();
        let is_worth_saving = is_worth_saving(&self);
        let (notes, is_changed) = (notes(&self), has_unsaved_changes(&self));
        let Self { saver, cx, .. } = self;
        let (shown, snapshots) = (cx.screen.snapshot.clone(), engine.snapshots());
        let title = cx.scene.title(&shown).to_owned();
        // The trainer ends once nothing can send it commands any more.
        drop(cx);
        let trainer = engine.stop();
        // The summary is of one moment: the trainer may be farther than its last snapshot.
        let mut snapshot = Snapshot::clone(&snapshots.borrow());
        if let Some(trainer) = &trainer {
            (snapshot.counters, snapshot.seconds) = (trainer.counters(), trainer.seconds());
        }
        let to = match (&snapshot.saved, &shown.saved) {
            // The run was first saved after the screen's last snapshot: the file is its own.
            (Some((_, path)), None) => SaveTo::Replace(path.to_path_buf()),
            _ => saver.to,
        };
        let saved_at = snapshot.saved.as_ref().map(|(updates, _)| *updates);
        let tells_lost = !is_wanted && trainer.is_some() && (is_worth_saving || saved_at.is_some());
        let saved = match trainer {
            None if is_wanted || is_worth_saving => {
                let lost = grouped(snapshot.lost_updates());
                let problem = "the trainer hung or crashed";
                Err(miette::miette!(
                    help = logging::hint(),
                    "{problem}: {lost} updates since the last save are lost"
                ))
            }
            Some(trainer)
                if is_wanted && (is_changed || saved_at != Some(trainer.counters().updates)) =>
            {
                save_last(trainer, notes, &to, &mut snapshot)
            }
            _ => Ok(()),
        };
        // Autosaves go if what the user has saved is newer.
        let has_own = is_wanted || snapshot.saved.is_some() && !is_worth_saving;
        if saved.is_ok() && !failed && has_own {
            let autosaves = std::mem::take(&mut snapshot.autosaves);
            autosaves.iter().for_each(|(_, path)| train::remove_own(path));
        }
        let is_loaded = !saver.has_saved && snapshot.saved == shown.saved;
        let files = about_files(&snapshot, tells_lost, is_loaded);
        let own = snapshot.saved.iter().map(|(_, path)| path.to_path_buf());
        let all = own.chain(snapshot.autosaves.iter().map(|(_, path)| path.clone()));
        let newest = newest_first(all).into_iter().next();
        let mut summary = summary_of(&snapshot, &title) + &files;
        if let Some(file) = newest {
            let command = resume_command(&file, &snapshot.registry.options);
            summary += &format!("\nresume with: {command}");
        }
        if failed {
            summary += &format!("\nthere were errors; {}", logging::hint());
        }
        ClosedRun { summary, files: files.trim_start().replace('\n', "; "), saved, failed }
    }
}

/// Saves the run when the interface is closed; if that fails, to another file.
fn save_last(
    mut trainer: Trainer,
    notes: Notes,
    to: &SaveTo,
    snapshot: &mut Snapshot,
) -> Result<(), Report> {
    let _ = trainer.ensure_finite();
    trainer.set_notes(notes);
    let (path, why) = train::save_or_else(&trainer, to, to_elsewhere(to.path()))
        .map_err(from_checkpoint_error)?;
    snapshot.saved = Some((trainer.counters().updates, Arc::new(path)));
    why.map_or(Ok(()), |error| Err(from_checkpoint_error(error)))
}

/// Says which files there are, a line each, and how much is in none of them.
pub fn about_files(snapshot: &Snapshot, tells_lost: bool, is_loaded: bool) -> String {
    let mut text = String::new();
    let at = |updates| grouped(snapshot.learned(updates));
    if let Some((updates, path)) = &snapshot.saved {
        let done = match snapshot.unsaved_updates() {
            0 if is_loaded => "unchanged",
            0 => "saved",
            _ => "last saved",
        };
        text += &format!("\n{done} {} at update {}", path.display(), at(*updates));
    }
    for (updates, path) in snapshot.autosaves.iter() {
        text += &format!("\nautosaved {} at update {}", path.display(), at(*updates));
    }
    let lost = snapshot.lost_updates();
    if tells_lost && lost > 0 {
        let last = if lost < snapshot.updates() { "the last " } else { "" };
        text += &format!("\nnot saved: {last}{} updates", grouped(lost));
    }
    text
}
