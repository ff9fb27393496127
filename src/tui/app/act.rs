//! Executes actions.

use crossterm::event::KeyEvent;

use super::saving::{Saver, is_worth_saving};
use super::{App, files, settings, time, view};
use crate::host::runs::SAVES;
use crate::tui::action::{Action, Mode, bindings};
use crate::tui::clock;
use crate::tui::dialog::{Choice, Dialog, Help, Prompt, Question};
use crate::tui::interface::TerminalRequest;
use crate::tui::link::Link;
use crate::tui::lists;
use crate::tui::output::ExportKind;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;

/// A command that compares two methods.
const COMPARISON: &str = "gdg-tui compare gdg-bridge gdg";

impl App {
    /// Performs an action.
    pub fn act(&mut self, action: Action) {
        if !self.scene.offers(action) {
            return refuse(action, &self.scene, &mut self.screen);
        }
        if matches!(action, Action::NewGoal | Action::Move(..) | Action::GoalHere | Action::Help) {
            self.screen.on_first_use();
        }
        if is_about_present(action) {
            self.in_scene(|_, screen, link| time::leave_past(screen, link));
        }
        let (began, dialogs) = (clock::now(), self.screen.dialogs.len());
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
        if is_done {
            return;
        }
        let Self { saver, guide, scene, screen, link, .. } = self;
        if let Some(dialog) = dialog_for(action, saver, scene, screen) {
            return screen.open(dialog);
        }
        match action {
            Action::ResetSetting => settings::reset(saver, scene, screen, link),
            Action::OpenMap => files::pick_map(None, scene, screen),
            Action::Save => drop(saver.save(scene, screen, link)),
            Action::Load => files::pick_checkpoint(saver.to.path(), scene, screen),
            Action::LayUnder => files::pick_under(saver.to.path(), scene, screen),
            Action::Resume => match screen.offer.take() {
                Some(found) => self.choose(Choice::Load(found.file)),
                None => self.act(Action::Load),
            },
            Action::ExportFilm => self.exports.request(ExportKind::Film),
            Action::Compare => {
                screen.notify(&format!("in a shell: {COMPARISON} shows both on the same map"));
            }
            Action::NextTourStep => guide.next_step(scene, screen, link),
            Action::EndTour => guide.end(scene, screen, link),
            Action::SearchHelp => {
                if let Some(Dialog::Help(help)) = screen.dialogs.last_mut() {
                    help.searching = true;
                }
            }
            Action::Close => self.in_scene(close_top),
            Action::Redraw => self.terminal_request = Some(TerminalRequest::Redraw),
            Action::Suspend => self.terminal_request = Some(TerminalRequest::Suspend),
            Action::Quit => {
                self.catch_up();
                self.saver.quit(&self.scene, &mut self.screen, &self.link);
            }
            _ => self.in_scene(|scene, screen, link| scene.act(action, screen, link)),
        }
    }

    /// Handles a key in the help, where the usual keys scroll and close.
    pub(super) fn on_key_in_help(&mut self, key: KeyEvent) {
        let action = self.screen.keymap.action(key, self.scene.mode(&self.screen));
        let own = self.screen.keymap.action(key, Mode::Help);
        let Some(Dialog::Help(help)) = self.screen.dialogs.last_mut() else { return };
        if help.on_key(key, action, own) {
            self.screen.dialogs.pop();
        }
    }
}

/// Returns the dialog that an action opens, if it does.
fn dialog_for(action: Action, saver: &Saver, scene: &Scene, screen: &Screen) -> Option<Dialog> {
    Some(match action {
        Action::NewSeed => {
            let next = screen.run().seed.wrapping_add(1).to_string();
            let hint = "an integer: same seed, same run";
            Prompt::new(Question::Seed, "restart with seed", hint, next).into()
        }
        Action::Settings => lists::settings(screen).into(),
        Action::Method => lists::methods(&screen.run().method, &screen.snapshot.registry).into(),
        Action::Preset => lists::presets(screen.run().preset).into(),
        Action::Theme => lists::themes(screen.theme.name).into(),
        Action::RandomMap => lists::random_maps().into(),
        Action::SaveAs => {
            let hint = format!("a name, saved as {SAVES}/NAME.safetensors, or a path");
            Prompt::new(Question::SaveAs, "save the checkpoint as", hint, saver.stem()).into()
        }
        Action::Autosave => {
            let now = saver.autosave.minutes.to_string();
            let hint = "minutes; 0 turns autosave off";
            Prompt::new(Question::Autosave, "autosave interval in minutes", hint, now).into()
        }
        Action::Export => lists::exports(&ExportKind::ALL, scene.noun()).into(),
        Action::Tour => lists::tour_choices(&screen.latest, is_worth_saving(scene, screen)).into(),
        Action::Palette => lists::actions(screen, scene).into(),
        Action::Help => Dialog::Help(Help::default()),
        _ => return None,
    })
}

/// Says why an action does nothing here.
fn refuse(action: Action, scene: &Scene, screen: &mut Screen) {
    let name = bindings().find(|b| b.action == action).map_or("", |b| b.name);
    let (title, other) = (scene.title(&screen.snapshot), scene.other_noun());
    let text = format!("{title} has no {other}, which \"{name}\" is for");
    screen.notify(&text);
}

/// Leaves what is on top: the past, something enlarged, an offer or a followed agent.
fn close_top(scene: &mut Scene, screen: &mut Screen, link: &mut Link) {
    if link.return_to_present(screen)
        || scene.close(link)
        || std::mem::take(&mut screen.maximised)
        || screen.offer.take().is_some()
    {
        return;
    }
    if screen.following.is_some() {
        view::follow(None, screen, link);
    } else if screen.first_run && screen.banner.is_some() {
        screen.on_first_use();
    } else {
        scene.act(Action::ZoomOff, screen, link);
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
