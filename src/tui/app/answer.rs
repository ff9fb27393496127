//! Executes the answers to dialogs.

use std::path::Path;
use std::sync::Arc;

use rand::RngExt;

use super::answer_error::AnswerError;
use super::files::checkpoint_file;
use super::saving::is_worth_saving;
use super::{App, files, runs, settings, time, view};
use crate::tui::action::Action;
use crate::tui::dialog::{Choice, Dialog, Question};
use crate::tui::lists;
use crate::tui::scene::Scene;
use gdg::files::check_name;
use gdg::map::{Grid, format_for, is_size};
use gdg::text::{NumberError, parse_count, parse_real};
use gdg::train::{Run, is_checkpoint, with_setting};

impl App {
    /// Accepts the answer to the topmost dialog.
    pub(super) fn answer(&mut self) {
        match self.screen.dialogs.pop() {
            Some(Dialog::Pick(picker)) => {
                let Some(choice) = picker.choice().cloned() else {
                    let text = format!("nothing in the list fits \"{}\"", picker.typed().0);
                    self.screen.notify(&text);
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
                let warned = |error: &AnswerError| {
                    error.is_warning() && prompt.error.as_ref() == Some(&error.to_string())
                };
                let safe = match check_new_file(&prompt.question, &typed, &self.scene) {
                    Err(error) if !warned(&error) => Err(error),
                    _ => Ok(()),
                };
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
        if self.hands_over {
            self.picked = Some(choice);
            return;
        }
        let Self { saver, guide, scene, screen, link, .. } = self;
        match choice {
            Choice::SaveFirst(then) => saver.save_then(*then, scene, screen, link),
            Choice::Act(action) => self.act(action),
            Choice::Setting(name) => settings::ask(name, saver, scene, screen, link),
            Choice::Method(method) => {
                let registry = screen.latest.registry.clone();
                runs::change(|run| run.set_method(method, &registry), saver, scene, screen, link);
            }
            Choice::Preset(preset) => {
                let settings = screen.settings_of(preset);
                let change = |run: &mut Run| (run.preset, run.settings) = (preset, settings);
                runs::change(change, saver, scene, screen, link);
            }
            Choice::Change(run) => runs::change_to(*run, saver, screen, link),
            Choice::Theme(name) => {
                self.previewed_over = None;
                view::set_theme(name, screen);
            }
            Choice::Folder(folder) => files::pick_map(Some(&folder), scene, screen),
            Choice::OpenMap(path) => files::open_map(&path, scene, screen),
            Choice::OpenBuiltin(name) => {
                if let Some(map) = gdg::map::builtin(name) {
                    files::offer_map(&Arc::new(map), None, scene, screen);
                }
            }
            Choice::OpenRandom(kind) => {
                let seed = link.rng.random_range(0..1_000);
                let map = gdg::map::random(kind, None, seed);
                files::offer_map(&Arc::new(map), None, scene, screen);
            }
            Choice::OpenWorld(name) => {
                let unsaved = is_worth_saving(scene, screen);
                screen.open(lists::world_switch_choices(name, unsaved));
            }
            Choice::Field(field) => {
                self.in_scene(|_, screen, link| time::leave_past(screen, link));
                view::show_field(field, &mut self.screen, &self.link);
            }
            Choice::Export(kind) => self.exports.request(kind),
            Choice::Tour => guide.request(screen, link),
            Choice::Quit { save: true } => saver.save_and_quit(scene, screen, link),
            Choice::Quit { save: false } => saver.is_done = true,
            Choice::LayUnder(path) => files::lay_under(path, scene, screen),
            Choice::Nothing => {}
            _ => self.in_scene(|scene, screen, link| runs::choose(choice, scene, screen, link)),
        }
    }

    /// Carries out an answer, or returns what is wrong with it.
    fn apply_answer(&mut self, question: &Question, typed: &str) -> Result<(), AnswerError> {
        let Self { saver, scene, screen, link, .. } = self;
        match question {
            Question::Setting(name) => {
                let settings = with_setting(&screen.run().settings, name, typed)?;
                runs::change(|run| run.settings = settings, saver, scene, screen, link);
            }
            Question::SaveAs => {
                if typed.is_empty() {
                    return Err(AnswerError::NoName);
                }
                let path = checkpoint_file(typed);
                check_name(&path)
                    .map_err(|error| AnswerError::Unwritable("the file".to_owned(), error))?;
                saver.save_under(path, scene, screen, link);
            }
            Question::SaveMap => files::save_map(typed, scene, screen)?,
            Question::NewMap => {
                let (width, height) = size(typed)?;
                files::offer_map(&Arc::new(Grid::empty("new", width, height)), None, scene, screen);
            }
            Question::ResizeMap => {
                let (width, height) = size(typed)?;
                let resized = scene.maze().and_then(|maze| maze.map.resized(width, height));
                let map = resized.ok_or(AnswerError::NoFreeCell)?;
                files::offer_map(&Arc::new(map), None, scene, screen);
            }
            Question::Seed => {
                let seed = parse_count(typed)?;
                if is_worth_saving(scene, screen) {
                    screen.open(lists::restart_choices(seed));
                } else {
                    runs::restart(seed, scene, screen, link);
                }
            }
            Question::Autosave => {
                let minutes = match parse_real(typed) {
                    Err(NumberError::NoNumber) => Err(AnswerError::NoMinutes),
                    minutes => Ok(minutes?),
                }?;
                let is_valid = (0.0..=1e6).contains(&minutes);
                let minutes = is_valid.then_some(minutes).ok_or(AnswerError::NoMinutes)?;
                saver.autosave.set_interval(minutes);
            }
        }
        Ok(())
    }
}

/// Checks that an answer does not name an existing file, and for a map neither a checkpoint nor a
/// format that lacks something of it.
fn check_new_file(question: &Question, typed: &str, scene: &Scene) -> Result<(), AnswerError> {
    let file = match question {
        Question::SaveMap => Path::new(typed).to_owned(),
        Question::SaveAs => checkpoint_file(typed),
        _ => return Ok(()),
    };
    let mut existing = file.is_file().then(|| "the file".to_owned());
    if *question == Question::SaveMap {
        let image = format_for(&file).image_of(&file);
        if std::iter::once(&file).chain(&image).any(|file| is_checkpoint(file)) {
            return Err(AnswerError::IsCheckpoint);
        }
        let image = image.filter(|image| image.is_file());
        existing = existing.or(image.map(|image| format!("its image {}", image.display())));
        if let Some(lost) = files::loss(typed, scene) {
            let also = existing.map(|what| format!(", and {what} exists")).unwrap_or_default();
            return Err(AnswerError::Loses { lost, also });
        }
    }
    existing.map_or(Ok(()), |what| Err(AnswerError::Exists(what)))
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
