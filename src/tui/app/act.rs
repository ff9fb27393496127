//! Executes actions.

use std::time::Instant;

use crossterm::event::{KeyCode, KeyEvent};

use super::{App, time, view};
use crate::tui::action::{Action, Mode, bindings};
use crate::tui::dialog::{Dialog, Help, Prompt, Question};
use crate::tui::interface::TerminalRequest;
use crate::tui::lists;
use crate::tui::output::ExportKind;

/// A command that compares two methods.
const COMPARISON: &str = "gdg-tui compare gdg-bridge gdg";

impl App {
    /// Performs an action.
    pub fn act(&mut self, action: Action) {
        if !self.scene.offers(action) {
            return self.refuse(action);
        }
        if matches!(action, Action::NewGoal | Action::Move(..) | Action::GoalHere | Action::Help) {
            self.screen.on_first_use();
        }
        if is_about_present(action) {
            self.in_scene(|_, screen, link| time::leave_past(screen, link));
        }
        let (began, dialogs) = (Instant::now(), self.screen.dialogs.len());
        self.perform(action);
        if self.screen.dialogs.len() > dialogs {
            // An error that was there before says nothing about the new dialog.
            self.screen.log.dismiss_before(began);
        }
    }

    fn perform(&mut self, action: Action) {
        let is_done = self.in_scene(|scene, screen, link| {
            time::act(action, screen, link) || view::act(action, scene, screen, link)
        });
        if is_done || self.open_dialog(action) {
            return;
        }
        match action {
            Action::ResetSetting => self.reset_setting(),
            Action::OpenMap => self.pick_map(None),
            Action::Save => drop(self.save()),
            Action::Load => self.pick_checkpoint(),
            Action::Resume => self.resume_offered(),
            Action::ExportFilm => self.exports.request(ExportKind::Film),
            Action::Compare => {
                self.notify(&format!("in a shell: {COMPARISON} shows both on the same map"));
            }
            Action::NextTourStep => self.next_tour_step(),
            Action::EndTour => self.end_tour(),
            Action::SearchHelp => {
                if let Some(Dialog::Help(help)) = self.screen.dialogs.last_mut() {
                    help.searching = true;
                }
            }
            Action::Close => self.close_top(),
            Action::Redraw => self.terminal_request = Some(TerminalRequest::Redraw),
            Action::Suspend => self.terminal_request = Some(TerminalRequest::Suspend),
            Action::Quit => self.quit(),
            _ => self.in_scene(|scene, screen, link| scene.act(action, screen, link)),
        }
    }

    /// Opens the dialog that an action is for; returns whether there is one.
    fn open_dialog(&mut self, action: Action) -> bool {
        let screen = &self.screen;
        let dialog: Dialog = match action {
            Action::NewSeed => {
                let next = screen.run().seed.wrapping_add(1).to_string();
                let hint = "an integer: same seed, same run";
                Prompt::new(Question::Seed, "restart with seed", hint, next).into()
            }
            Action::Settings => lists::settings(screen).into(),
            Action::Method => {
                lists::methods(&screen.run().method, &screen.snapshot.registry).into()
            }
            Action::Preset => lists::presets(screen.run().preset).into(),
            Action::Theme => lists::themes(screen.theme.name).into(),
            Action::RandomMap => lists::random_maps().into(),
            Action::SaveAs => self.save_as_question().into(),
            Action::Autosave => {
                let now = self.autosave.minutes.to_string();
                let hint = "minutes; 0 turns autosave off";
                Prompt::new(Question::Autosave, "autosave interval in minutes", hint, now).into()
            }
            Action::Export => lists::exports(self.scene.noun()).into(),
            Action::Tour => {
                let unsaved = screen.latest.unsaved_updates();
                lists::tour_choices(unsaved, self.is_worth_saving()).into()
            }
            Action::Palette => lists::actions(screen, &self.scene).into(),
            Action::Help => Dialog::Help(Help::default()),
            _ => return false,
        };
        self.screen.open(dialog);
        true
    }

    /// Says why an action does nothing here.
    fn refuse(&mut self, action: Action) {
        let name = bindings().find(|b| b.action == action).map_or("", |b| b.name);
        let title = self.scene.title(&self.screen.snapshot);
        let text = format!("{title} has no {}, which \"{name}\" is for", self.scene.other_noun());
        self.notify(&text);
    }

    fn close_top(&mut self) {
        if self.return_to_present() {
            return;
        }
        if self.scene.close(&self.link)
            || std::mem::take(&mut self.screen.maximised)
            || self.screen.offer.take().is_some()
        {
            return;
        }
        if self.screen.following.is_some() {
            view::follow(None, &mut self.screen, &self.link);
        } else if self.screen.first_run {
            self.screen.on_first_use();
        } else {
            self.in_scene(|scene, screen, link| scene.act(Action::ZoomOff, screen, link));
        }
    }

    /// Handles a key in the help, where the usual keys scroll and close.
    pub(super) fn on_key_in_help(&mut self, key: KeyEvent) {
        let action = self.screen.keymap.action(key, self.scene.mode(&self.screen));
        let own = self.screen.keymap.action(key, Mode::Help);
        let Some(Dialog::Help(help)) = self.screen.dialogs.last_mut() else { return };
        match (key.code, action) {
            (KeyCode::Up, _) => help.scroll(-1),
            (KeyCode::Down, _) => help.scroll(1),
            (KeyCode::PageUp, _) => help.scroll_page(false),
            (KeyCode::PageDown, _) => help.scroll_page(true),
            _ if help.searching => help.on_search_key(key),
            _ if own.is_some() => own.into_iter().for_each(|action| self.act(action)),
            (_, Some(Action::Close)) if !help.search().is_empty() => help.clear_search(),
            (_, Some(Action::Help | Action::Close | Action::Quit)) => {
                self.screen.dialogs.pop();
            }
            (_, Some(Action::Move(0, dy))) => help.scroll(dy),
            (KeyCode::Char(' '), _) => help.scroll_page(true),
            (KeyCode::Home, _) => help.first = 0,
            (KeyCode::End, _) => help.first = usize::MAX,
            _ => {}
        }
    }
}

/// Whether an action shows or changes something that the past does not have: it returns to the
/// present.
fn is_about_present(action: Action) -> bool {
    use Action as A;
    matches!(
        action,
        A::NewGoal
            | A::GoalHere
            | A::StartHere
            | A::NewStart
            | A::Follow
            | A::Field(_)
            | A::ToggleEdit
            | A::Tool(_)
            | A::Apply
            | A::Undo
            | A::Redo
    )
}
