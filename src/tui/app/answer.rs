//! Executes the answers to dialogs.

use std::path::Path;
use std::sync::Arc;

use rand::RngExt;

use super::answer_error::{AnswerError, FILE_EXISTS};
use super::files::{checkpoint_file, remember_map};
use super::{App, time, view};
use crate::tui::action::Action;
use crate::tui::dialog::{Choice, Dialog, Prompt, Question};
use crate::tui::lists;
use crate::tui::scene::Scene;
use crate::tui::scene::maze::maze_on;
use gdg::engine::{Command, MakeWorld};
use gdg::env::{WorldKind, maze};
use gdg::files::check_name;
use gdg::map::{Grid, is_size};
use gdg::text::{NumberError, parse_count, parse_real};
use gdg::train::{
    Effect, Run, Setting, is_checkpoint, list_settings, settings_in_world, with_setting,
};

impl App {
    /// Accepts the answer to the topmost dialog.
    pub(super) fn answer(&mut self) {
        match self.screen.dialogs.pop() {
            Some(Dialog::Pick(picker)) => {
                let Some(choice) = picker.choice().cloned() else {
                    self.notify(&format!("nothing in the list fits \"{}\"", picker.typed().0));
                    return self.screen.open(picker);
                };
                let typed = picker.typed().0.to_owned();
                if matches!(choice, Choice::Setting(_)) {
                    // The list stays, for the next setting.
                    self.screen.dialogs.push(Dialog::Pick(picker));
                }
                let opens_settings = choice == Choice::Act(Action::Settings);
                self.choose(choice);
                if let (true, Some(Dialog::Pick(settings))) =
                    (opens_settings, self.screen.dialogs.last_mut())
                {
                    // Its words may name a setting.
                    settings.search_names(&typed);
                }
            }
            Some(Dialog::Ask(mut prompt)) => {
                let (typed, _) = prompt.typed();
                let typed = typed.trim().to_owned();
                let warned = prompt.error.as_deref() == Some(FILE_EXISTS);
                let safe = if warned { Ok(()) } else { check_new_file(&prompt.question, &typed) };
                if let Err(error) =
                    safe.and_then(|()| self.apply_answer(&prompt.question.clone(), &typed))
                {
                    prompt.error = Some(error.to_string());
                    self.screen.dialogs.push(Dialog::Ask(prompt));
                }
            }
            _ => {}
        }
    }

    pub(in crate::tui) fn choose(&mut self, choice: Choice) {
        match choice {
            Choice::SaveFirst(then) => self.save_then(*then),
            Choice::Act(action) => self.act(action),
            Choice::Setting(name) => self.ask_setting(name),
            Choice::Theme(name) => {
                self.previewed_over = None;
                view::set_theme(name, &mut self.screen);
            }
            Choice::Folder(folder) => self.pick_map(Some(&folder)),
            Choice::OpenMap(path) => self.open_map(&path),
            Choice::OpenBuiltin(name) => {
                if let Some(map) = gdg::map::builtin(name) {
                    self.offer_map(&Arc::new(map), None);
                }
            }
            Choice::OpenRandom(kind) => {
                let seed = self.link.rng.random_range(0..1_000);
                self.offer_map(&Arc::new(gdg::map::random(kind, None, seed)), None);
            }
            Choice::OpenWorld(name) => {
                self.screen.open(lists::world_switch_choices(name, self.is_worth_saving()));
            }
            Choice::Field(field) => {
                self.in_scene(|_, screen, link| time::leave_past(screen, link));
                self.show_field(field);
            }
            Choice::Export(kind) => self.exports.request(kind),
            Choice::Quit { save: true } => self.save_and_quit(),
            Choice::Quit { save: false } => self.done = true,
            Choice::Nothing => {}
            _ => self.choose_run(choice),
        }
    }

    /// Continues with another run, or this one changed.
    fn choose_run(&mut self, choice: Choice) {
        match choice {
            Choice::Method(method)
                if method.learner != self.screen.run().method.learner && self.is_worth_saving() =>
            {
                let unsaved = self.screen.latest.unsaved_updates();
                self.screen.open(lists::method_choices(unsaved, method));
            }
            Choice::Method(method) | Choice::MethodUnsaved(method) => {
                let registry = self.screen.latest.registry.clone();
                self.change_run(|run| run.set_method(method, &registry));
            }
            Choice::Preset(preset) => {
                let settings = self.screen.settings_of(preset);
                self.change_run(|run| (run.preset, run.settings) = (preset, settings));
            }
            Choice::StartIn(name) => self.start_run_in(name),
            Choice::Restart(seed) => self.restart(seed),
            Choice::StartOn(map, file) => {
                file.as_deref().inspect(|file| remember_map(file));
                self.start_run_on(map);
            }
            Choice::ContinueOn(map, file) => {
                file.as_deref().inspect(|file| remember_map(file));
                self.in_maze(|maze, screen, link| {
                    let new = maze.editor.record(&maze.map.clone(), (*map).clone());
                    maze.change_map_or_say(new, Some("the map stays as it is"), screen, link);
                });
            }
            Choice::Load(path) if self.is_worth_saving() => {
                let unsaved = self.screen.latest.unsaved_updates();
                self.screen.open(lists::load_choices(unsaved, path));
            }
            Choice::Load(path) | Choice::LoadUnsaved(path) => {
                self.notify(&format!("loading {} ...", path.display()));
                self.command(Command::Load(path));
            }
            Choice::Tour => self.start_tour_run(),
            _ => {}
        }
    }

    /// Continues with the run as modified by `change`.
    fn change_run(&mut self, change: impl FnOnce(&mut Run)) {
        let mut run = self.screen.run().clone();
        change(&mut run);
        if run != *self.screen.run() {
            self.command(Command::Change(Box::new(run)));
        }
    }

    /// Starts a new run in the world called `name`, with the preset's settings for it.
    fn start_run_in(&mut self, name: &str) {
        let registry = self.screen.latest.registry.clone();
        if let Some(kind) = registry.world(name)
            && let Some(create) = kind.create
        {
            let run = self.run_adapted_to(kind);
            self.command(Command::StartRun(Box::new(run), Box::new(move |_| create())));
        }
    }

    /// Starts a new run on `map`: with the settings of this run, if its world is a map too.
    fn start_run_on(&mut self, map: Arc<Grid>) {
        let run = match self.scene {
            Scene::Maze(_) => self.screen.run().clone(),
            Scene::Arm(_) => self.run_adapted_to(&maze::KIND),
        };
        self.command(Command::StartRun(Box::new(run), maze_on(map)));
    }

    /// Starts the run again with another seed.
    fn restart(&mut self, seed: u64) {
        let run = Run { seed, ..self.screen.run().clone() };
        let world: MakeWorld = match &self.scene {
            Scene::Maze(maze) => maze_on(maze.map.clone()),
            Scene::Arm(_) => Box::new(|world| world.fork(0)),
        };
        self.command(Command::StartRun(Box::new(run), world));
    }

    /// Returns this run with the settings that its preset has in another kind of world.
    fn run_adapted_to(&self, kind: &WorldKind) -> Run {
        let run = self.screen.run().clone();
        Run { settings: settings_in_world(run.preset, kind.defaults), ..run }
    }

    /// Asks the user how to switch to another map.
    pub(super) fn offer_map(&mut self, map: &Arc<Grid>, file: Option<&Path>) {
        let is_worth_saving = self.is_worth_saving();
        let now = self.scene.maze().map(|maze| maze.map.clone());
        // Cells beyond the new map become walls, to keep agents out.
        let fitted = now.as_ref().and_then(|now| {
            let fitted = map.resized(now.width(), now.height())?;
            let walls: Vec<_> =
                fitted.free_cells().filter(|c| !map.contains(*c)).map(|c| (c, false)).collect();
            fitted.with_cells(walls)
        });
        let now = now.as_deref();
        self.screen.open(lists::map_switch_choices(map, file, now, fitted, is_worth_saving));
    }

    /// Gives the setting selected in the list the value of the run's preset.
    pub(super) fn reset_setting(&mut self) {
        let Some(Dialog::Pick(picker)) = self.screen.dialogs.last() else { return };
        let Some(Choice::Setting(name)) = picker.choice().cloned() else { return };
        let defaults = list_settings(&self.screen.settings_of(self.screen.run().preset));
        let Some((_, value)) = defaults.into_iter().find(|(known, _)| *known == name) else {
            return;
        };
        match with_setting(&self.screen.run().settings, &name, &value) {
            Ok(settings) if settings == self.screen.run().settings => {
                self.notify(&format!("{name} has its default already"));
            }
            Ok(settings) => self.change_run(|run| run.settings = settings),
            Err(error) => self.report(&error.one_line()),
        }
    }

    /// Asks for a setting's new value; a switch that costs nothing is turned over at once.
    fn ask_setting(&mut self, name: String) {
        let value = list_settings(&self.screen.run().settings)
            .into_iter()
            .find(|(known, _)| *known == name);
        let value = value.map(|(_, value)| value).unwrap_or_default();
        let setting = Setting::named(&name);
        if setting.is_some_and(|setting| {
            setting.values.are_switch() && setting.effect == Effect::Immediate
        }) {
            let other = if value == "true" { "false" } else { "true" };
            if let Ok(settings) = with_setting(&self.screen.run().settings, &name, other) {
                self.change_run(|run| run.settings = settings);
            }
            return;
        }
        let hint = setting.map_or(String::new(), |setting| {
            format!("{}: {}; {}", setting.about, setting.values, setting.effect.about())
        });
        self.screen.open(Prompt::new(Question::Setting(name.clone()), name, hint, value));
    }

    /// Carries out an answer, or returns what is wrong with it.
    fn apply_answer(&mut self, question: &Question, typed: &str) -> Result<(), AnswerError> {
        match question {
            Question::Setting(name) => {
                let settings = with_setting(&self.screen.run().settings, name, typed)?;
                self.change_run(|run| run.settings = settings);
            }
            Question::SaveAs => {
                if typed.is_empty() {
                    return Err(AnswerError::NoName);
                }
                let path = checkpoint_file(typed);
                check_name(&path)
                    .map_err(|error| AnswerError::Unwritable("the file".to_owned(), error))?;
                self.save_under(path);
            }
            Question::SaveMap => self.save_map(typed)?,
            Question::NewMap => {
                let (width, height) = size(typed)?;
                self.offer_map(&Arc::new(Grid::empty("new", width, height)), None);
            }
            Question::ResizeMap => {
                let (width, height) = size(typed)?;
                let resized = self.scene.maze().and_then(|maze| maze.map.resized(width, height));
                let map = resized.ok_or(AnswerError::NoFreeCell)?;
                self.offer_map(&Arc::new(map), None);
            }
            Question::Seed => {
                let seed = parse_count(typed)?;
                if self.is_worth_saving() {
                    self.screen.open(lists::restart_choices(seed));
                } else {
                    self.restart(seed);
                }
            }
            Question::Autosave => {
                let minutes = match parse_real(typed) {
                    Err(NumberError::NoNumber) => Err(AnswerError::NoMinutes),
                    minutes => Ok(minutes?),
                }?;
                let is_valid = (0.0..=1e6).contains(&minutes);
                let minutes = is_valid.then_some(minutes).ok_or(AnswerError::NoMinutes)?;
                self.autosave.set_interval(minutes);
            }
        }
        Ok(())
    }
}

/// Checks that an answer does not name an existing file, nor a checkpoint for a map.
fn check_new_file(question: &Question, typed: &str) -> Result<(), AnswerError> {
    let file = match question {
        Question::SaveMap => Path::new(typed).to_owned(),
        Question::SaveAs => checkpoint_file(typed),
        _ => return Ok(()),
    };
    match question {
        Question::SaveMap if is_checkpoint(&file) => Err(AnswerError::IsCheckpoint),
        _ if file.is_file() => Err(AnswerError::Exists),
        _ => Ok(()),
    }
}

/// Parses the columns and rows of a map.
fn size(typed: &str) -> Result<(usize, usize), AnswerError> {
    let numbers: Vec<usize> = typed
        .split(|c: char| !c.is_ascii_digit())
        .filter(|n| !n.is_empty())
        .filter_map(|n| n.parse().ok())
        .collect();
    match numbers[..] {
        [width, height] if is_size(width, height) => Ok((width, height)),
        [_, _] => Err(AnswerError::NoMapSize),
        _ => Err(AnswerError::NoSize),
    }
}
