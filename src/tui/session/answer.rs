//! Input to dialogs, of which the topmost one gets every event, and the effects of their answers.

use std::path::PathBuf;

use crossterm::event::Event;
use rand::RngExt;
use ratatui::layout::Position;

use super::disk;
use super::saving::unsaved;
use super::{Cx, Session, change_run, watching};
use crate::setup::saves::checkpoint_file;
use crate::tui::dialog::{Choice, Dialog, Picker, Prompt, Question, Reply};
use crate::tui::lists;
use gdg::engine::EngineCommand;
use gdg::files::{check_name, unused_path};
use gdg::map::{Grid, format_for, load_map};
use gdg::train::{Run, SaveTo, is_checkpoint, with_setting};

impl Session {
    /// Handles an event while a dialog is open; returns what the user has picked in it.
    pub fn on_event_in_dialog(&mut self, event: &Event) -> Option<Choice> {
        let screen = &mut self.cx.screen;
        let layer = screen.dialogs.last_mut()?;
        let reply = match event {
            Event::Key(key) if !key.is_release() => {
                screen.log.dismiss();
                layer.key(*key)
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
            Reply::Stays => {}
            Reply::Closes => self.dismiss(),
            Reply::Accepts => return self.answer(),
            Reply::Picks(choice) => return Some(choice),
        }
        None
    }

    pub fn dismiss(&mut self) {
        self.screen.dialogs.pop();
        if self.screen.dialogs.is_empty() {
            self.saver.cancel_quit(&mut self.cx);
        }
    }

    /// Accepts the answer to the topmost dialog; returns what has been picked from a list.
    fn answer(&mut self) -> Option<Choice> {
        match self.screen.dialogs.pop()? {
            Dialog::Pick(picker) => {
                let choice = picker.choice().cloned();
                if choice.is_none() || picker.stays {
                    self.open(picker);
                }
                return choice;
            }
            Dialog::Ask(prompt) => self.accept(prompt),
        }
        None
    }

    /// Carries out what has been typed; asks first if that would replace or lose something.
    fn accept(&mut self, prompt: Prompt) {
        let typed = prompt.typed().0.trim().to_owned();
        let done = match doubt(&prompt.question, &typed, &self.cx) {
            Ok(Some(asked)) => return self.screen.dialogs.extend([prompt.into(), asked.into()]),
            Ok(None) => self.apply(&prompt.question, &typed),
            Err(problem) => Err(problem),
        };
        self.close_if(done, prompt);
    }

    fn close_if(&mut self, done: Result<(), String>, mut prompt: Prompt) {
        prompt.error = done.err();
        if prompt.error.is_some() {
            self.open(prompt);
        }
    }

    pub fn choose(&mut self, choice: Choice) {
        let Self { saver, cx, .. } = self;
        match choice {
            Choice::SaveFirst(then) => saver.save_then(*then, cx),
            Choice::Act(action) => self.act(action),
            Choice::Answer(answer) => {
                if let Some(Dialog::Ask(prompt)) = cx.screen.dialogs.pop() {
                    let done = self.apply(&prompt.question, &answer);
                    self.close_if(done, prompt);
                }
            }
            Choice::Setting(name) => change_run::ask_setting(name, cx),
            Choice::Method(method) => {
                let registry = cx.screen.snapshot.registry.clone();
                change_run::change(|run| run.set_method(method, &registry), saver, cx);
            }
            Choice::Preset(preset) => {
                let settings = cx.screen.settings_of(preset);
                let change = |run: &mut Run| (run.preset, run.settings) = (preset, settings);
                change_run::change(change, saver, cx);
            }
            Choice::Change(run) => change_run::change_to(*run, saver, cx),
            Choice::Theme(name) => watching::set_theme(&mut cx.screen, name),
            Choice::Folder(folder) => disk::pick_map(cx, Some(&folder)),
            Choice::OpenMap(path) => disk::open_map(cx, &path),
            Choice::OpenBuiltin(name) => {
                if let Some(map) = gdg::map::builtin(name) {
                    disk::offer_map(cx, map);
                }
            }
            Choice::OpenEmpty => {
                let (width, height) = lists::EMPTY_MAP;
                disk::offer_map(cx, Grid::empty("new", width, height));
            }
            Choice::OpenRandom(kind) => {
                let seed = cx.screen.rng.random_range(0..1_000);
                disk::offer_map(cx, gdg::map::random(kind, None, seed));
            }
            Choice::OpenWorld(name) => {
                let (begin, choice) = (format!("start a new run on {name}"), Choice::StartIn(name));
                let title = format!("open {name}?");
                cx.screen.open(lists::leave(title, &begin, "new networks", choice, unsaved(cx)));
            }
            Choice::StartIn(name) => change_run::start_in(name, cx),
            Choice::Restart(seed) => change_run::restart(seed, cx),
            Choice::StartOn(map) => change_run::start_on(map, cx),
            Choice::ContinueOn(map) => change_run::continue_on(&map, cx),
            Choice::Load(path) => change_run::load(path, false, cx),
            Choice::LoadUnsaved(path) => change_run::load(path, true, cx),
            Choice::Field(field) => {
                watching::leave_past(cx);
                watching::show_field(cx, field);
            }
            Choice::Export(kind) => disk::export(kind, cx),
            Choice::Quit { save: true } => saver.save_and_quit(cx),
            Choice::Quit { save: false } => saver.is_done = true,
            Choice::Nothing => {}
        }
    }

    /// Carries out the answer to a question, or returns what is wrong with it.
    fn apply(&mut self, question: &Question, typed: &str) -> Result<(), String> {
        let Self { saver, cx, .. } = self;
        match question {
            Question::Setting(name) => {
                let settings = with_setting(&cx.screen.run().settings, name, typed)
                    .map_err(|error| error.one_line())?;
                change_run::change(|run| run.settings = settings, saver, cx);
            }
            Question::SaveAs => {
                if typed.is_empty() {
                    return Err("enter a name, e.g. rooms-at-95-percent".to_owned());
                }
                let path = checkpoint_file(typed);
                check_name(&path).map_err(|e| format!("the file cannot be written: {e}"))?;
                let is_copy = self.leave_to_other(&path)?;
                // Replacing it has been confirmed.
                self.saver.to = SaveTo::Replace(path);
                self.saver.save(&mut self.cx);
                if is_copy {
                    self.screen.command(EngineCommand::Resume);
                }
            }
            Question::SaveMap => disk::save_map(cx, typed)?,
        }
        Ok(())
    }
}

/// Returns the question to answer first if an answer would replace or lose something.
fn doubt(question: &Question, typed: &str, cx: &Cx) -> Result<Option<Picker>, String> {
    let file = match question {
        Question::SaveMap => disk::map_file(typed),
        Question::SaveAs => match checkpoint_file(typed) {
            file if file.is_file() && !is_checkpoint(&file) => {
                return Err(format!("{} is no checkpoint: give another name", file.display()));
            }
            file => file,
        },
        Question::Setting(_) => return Ok(None),
    };
    let (mut files, mut lost, mut other) = (vec![file.clone()], None, file);
    if *question == Question::SaveMap {
        files.extend(format_for(&other).image_of(&other));
        let is_other = |file: &&PathBuf| file.is_file() && load_map(file).is_err();
        if let Some(other) = files.iter().find(is_other) {
            return Err(format!("{} cannot be read as a map: give another name", other.display()));
        }
        (lost, other) = disk::loss(cx, other);
    }
    let there = files.iter().filter(|file| file.is_file()).map(|file| file.display().to_string());
    let there = there.reduce(|file, image| format!("{file} and {image}"));
    let other = unused_path(&other).display().to_string();
    let asks = there.is_some() || lost.is_some();
    Ok(asks.then(|| lists::replace(there, lost, typed, other)))
}
