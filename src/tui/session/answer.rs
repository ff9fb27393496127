//! Dialogs: what the user does in them, and what the answers do.

use std::path::Path;

use crossterm::event::{Event, KeyCode, KeyModifiers};
use rand::RngExt;
use ratatui::layout::Position;

use super::files::{self, checkpoint_file, remember_map};
use super::saving::is_worth_saving;
use super::{Cx, Session, runs, time, view};
use crate::tui::dialog::{Choice, Dialog, Prompt, Question, Warning};
use crate::tui::layer::Reply;
use crate::tui::lists;
use gdg::files::check_name;
use gdg::map::{Grid, format_for, is_size, size_limits};
use gdg::text::{NumberError, parse_count, parse_real};
use gdg::train::{Run, is_checkpoint, with_setting};

impl Session {
    /// Handles an event while a dialog is open; returns what the user has picked in it.
    pub fn on_event_in_dialog(&mut self, event: &Event) -> Option<Choice> {
        let mode = self.mode();
        let screen = &mut self.cx.screen;
        let layer = screen.dialogs.last_mut()?;
        let reply = match event {
            Event::Key(key) if !key.is_release() => {
                screen.log.dismiss();
                if key.code == KeyCode::Char('c') && key.modifiers == KeyModifiers::CONTROL {
                    // A second Ctrl-C quits without further questions.
                    self.saver.is_done = true;
                    return None;
                }
                layer.key(*key, &screen.keymap, mode)
            }
            Event::Mouse(mouse) => {
                layer.mouse(mouse.kind, Position::new(mouse.column, mouse.row), &screen.layout)
            }
            Event::Paste(text) => {
                layer.paste(text);
                Reply::Stays
            }
            _ => return None,
        };
        match reply {
            Reply::Stays => self.preview(),
            Reply::Closes => self.dismiss(),
            Reply::Accepts => return self.answer(),
            Reply::Picks(choice) => return Some(choice),
        }
        None
    }

    fn dismiss(&mut self) {
        self.screen.dialogs.pop();
        if let Some(name) = self.previewed_over.take() {
            view::set_theme(&mut self.screen, name);
        }
        self.saver.cancel_quit(&mut self.cx);
    }

    fn preview(&mut self) {
        if let Some(Dialog::Pick(picker)) = self.screen.dialogs.last()
            && let Some(Choice::Theme(name)) = picker.choice().cloned()
        {
            self.previewed_over.get_or_insert(self.cx.screen.theme.name);
            view::set_theme(&mut self.screen, name);
        }
    }

    /// Accepts the answer to the topmost dialog; returns what has been picked from a list.
    fn answer(&mut self) -> Option<Choice> {
        match self.screen.dialogs.pop()? {
            Dialog::Pick(picker) => {
                picker.typed().0.clone_into(&mut self.typed);
                let choice = picker.choice().cloned();
                if choice.is_none() {
                    let text = format!("nothing in the list fits \"{}\"", self.typed);
                    self.screen.notify(&text);
                }
                // The list of settings stays, for the next one.
                if matches!(choice, None | Some(Choice::Setting(_))) {
                    self.open(picker);
                }
                return choice;
            }
            Dialog::Ask(prompt) => self.accept(prompt),
            Dialog::Help(_) => {}
        }
        None
    }

    /// Carries out the answer to a question, or says what is wrong with it.
    fn accept(&mut self, mut prompt: Prompt) {
        let typed = prompt.typed().0.trim().to_owned();
        let done = warning(&prompt.question, &typed, &self.cx).and_then(|warning| match warning {
            Some(warning) if prompt.warned_of.as_ref() != Some(&warning) => {
                let text = warning.to_string();
                prompt.warned_of = Some(warning);
                Err(text)
            }
            _ => self.apply(&prompt.question, &typed),
        });
        if let Err(problem) = done {
            prompt.error = Some(problem);
            self.screen.dialogs.push(Dialog::Ask(prompt));
        }
    }

    pub fn choose(&mut self, choice: Choice) {
        let Self { saver, guide, cx, .. } = self;
        match choice {
            Choice::SaveFirst(then) => saver.save_then(*then, cx),
            Choice::Act(action) => self.act(action),
            Choice::Setting(name) => runs::ask_setting(name, saver, cx),
            Choice::Method(method) => {
                let registry = cx.screen.latest.registry.clone();
                runs::change(|run| run.set_method(method, &registry), saver, cx);
            }
            Choice::Preset(preset) => {
                let settings = cx.screen.settings_of(preset);
                let change = |run: &mut Run| (run.preset, run.settings) = (preset, settings);
                runs::change(change, saver, cx);
            }
            Choice::Change(run) => runs::change_to(*run, saver, cx),
            Choice::Theme(name) => {
                self.previewed_over = None;
                view::set_theme(&mut self.cx.screen, name);
            }
            Choice::Folder(folder) => files::pick_map(cx, Some(&folder)),
            Choice::OpenMap(path) => files::open_map(cx, &path),
            Choice::OpenBuiltin(name) => {
                if let Some(map) = gdg::map::builtin(name) {
                    files::offer_map(cx, map, None);
                }
            }
            Choice::OpenRandom(kind) => {
                let seed = cx.link.rng.random_range(0..1_000);
                files::offer_map(cx, gdg::map::random(kind, None, seed), None);
            }
            Choice::OpenWorld(name) => {
                let unsaved = is_worth_saving(cx);
                cx.screen.open(lists::world_switch_choices(name, unsaved));
            }
            Choice::StartIn(name) => runs::start_in(name, cx),
            Choice::Restart(seed) => runs::restart(seed, cx),
            Choice::StartOn(map, file) => {
                file.as_deref().inspect(|file| remember_map(file));
                runs::start_on(map, cx);
            }
            Choice::ContinueOn(map, file) => {
                file.as_deref().inspect(|file| remember_map(file));
                runs::continue_on(&map, cx);
            }
            Choice::Load(path) => runs::load(path, false, cx),
            Choice::LoadUnsaved(path) => runs::load(path, true, cx),
            Choice::Field(field) => {
                time::leave_past(cx);
                view::show_field(cx, field);
            }
            Choice::Export(kind) => self.exports.request(kind),
            Choice::Tour => guide.request(cx),
            Choice::Quit { save: true } => saver.save_and_quit(cx),
            Choice::Quit { save: false } => saver.is_done = true,
            Choice::LayUnder(path) => files::lay_under(cx, path),
            Choice::Nothing => {}
        }
        self.thaw();
    }

    /// Carries out the answer to a question, or returns what is wrong with it.
    fn apply(&mut self, question: &Question, typed: &str) -> Result<(), String> {
        let Self { saver, cx, .. } = self;
        match question {
            Question::Setting(name) => {
                let settings = with_setting(&cx.screen.run().settings, name, typed)
                    .map_err(|error| error.one_line())?;
                runs::change(|run| run.settings = settings, saver, cx);
            }
            Question::SaveAs => {
                if typed.is_empty() {
                    return Err("enter a name, e.g. rooms-at-95-percent".to_owned());
                }
                let path = checkpoint_file(typed);
                check_name(&path).map_err(|e| format!("the file cannot be written: {e}"))?;
                saver.save_under(path, cx);
            }
            Question::SaveMap => files::save_map(cx, typed)?,
            Question::NewMap => {
                let (width, height) = size(typed)?;
                files::offer_map(cx, Grid::empty("new", width, height), None);
            }
            Question::ResizeMap => {
                let (width, height) = size(typed)?;
                let resized = cx.scene.maze().and_then(|maze| maze.map.resized(width, height));
                let map = resized.ok_or("the map would have no free cell")?;
                files::offer_map(cx, map, None);
            }
            Question::Seed => {
                let seed = parse_count(typed).map_err(|error| error.to_string())?;
                if is_worth_saving(cx) {
                    cx.screen.open(lists::restart_choices(seed));
                } else {
                    runs::restart(seed, cx);
                }
            }
            Question::Autosave => {
                let no_minutes = "enter a number of minutes, 0 for none";
                let minutes = parse_real(typed).map_err(|error| match error {
                    NumberError::NoNumber => no_minutes.to_owned(),
                    error => error.to_string(),
                })?;
                if !(0.0..=1e6).contains(&minutes) {
                    return Err(no_minutes.to_owned());
                }
                saver.autosave.set_interval(minutes);
            }
        }
        Ok(())
    }
}

/// Returns what an answer would replace or lose, which has to be confirmed.
///
/// # Errors
/// It would replace a checkpoint by a map, which is never done.
fn warning(question: &Question, typed: &str, cx: &Cx) -> Result<Option<Warning>, String> {
    let file = match question {
        Question::SaveMap => Path::new(typed).to_owned(),
        Question::SaveAs => checkpoint_file(typed),
        _ => return Ok(None),
    };
    let mut replaced = file.is_file().then(|| "the file".to_owned());
    let mut lost = None;
    if *question == Question::SaveMap {
        let image = format_for(&file).image_of(&file);
        if std::iter::once(&file).chain(&image).any(|file| is_checkpoint(file)) {
            return Err("this file is a checkpoint: enter another name".to_owned());
        }
        let image = image.filter(|image| image.is_file());
        replaced = replaced.or(image.map(|image| format!("its image {}", image.display())));
        lost = files::loss(cx, typed);
    }
    let is_needed = replaced.is_some() || lost.is_some();
    Ok(is_needed.then_some(Warning { lost, replaced }))
}

fn size(typed: &str) -> Result<(usize, usize), String> {
    let numbers: Vec<usize> = typed
        .split(|c: char| !c.is_ascii_digit())
        .filter(|n| !n.is_empty())
        .filter_map(|n| n.parse().ok())
        .collect();
    match numbers[..] {
        [width, height] if is_size(width, height) => Ok((width, height)),
        [_, _] => Err(size_limits()),
        _ => Err("enter two numbers, e.g. 40 x 30".to_owned()),
    }
}
