//! Executes actions.

use std::time::Instant;

use crossterm::event::{KeyCode, KeyEvent};

use super::App;
use crate::tui::action::{Action, Mode, bindings};
use crate::tui::dialog::{Choice, Dialog, Help, Prompt, Question};
use crate::tui::interface::TerminalRequest;
use crate::tui::layers::{Overlay, Overlays};
use crate::tui::lists;
use crate::tui::marker::Marker;
use crate::tui::output::ExportKind;
use crate::tui::panes::Pane;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Theme, ThemeName};
use gdg::bridge::EdgeStatus;
use gdg::engine::{Command, Step};
use gdg::viewer::{Field, Request};

/// Selectable speed limits, in updates per second; beyond the last one there is no limit.
const SPEEDS: [f64; 9] = [1.0, 3.0, 10.0, 30.0, 100.0, 200.0, 400.0, 800.0, 1600.0];

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
            self.leave_past();
        }
        let (began, dialogs) = (Instant::now(), self.screen.dialogs.len());
        self.perform(action);
        if self.screen.dialogs.len() > dialogs {
            // An error that was there before says nothing about the new dialog.
            self.screen.log.dismiss_before(began);
        }
    }

    fn perform(&mut self, action: Action) {
        match action {
            Action::TogglePause => self.toggle_pause(),
            Action::StepUpdate => self.step(Step::Update),
            Action::StepEpisode => self.step(Step::Episode),
            Action::Slower => self.change_speed(false),
            Action::Faster => self.change_speed(true),
            Action::Freeze => self.freeze(!self.screen.frozen),
            Action::Evaluate => drop(self.command(Command::Evaluate)),
            Action::NewSeed => self.ask_seed(),
            Action::Settings => self.screen.open(lists::settings(&self.screen)),
            Action::ResetSetting => self.reset_setting(),
            Action::Method => {
                let snapshot = &self.screen.snapshot;
                let methods = lists::methods(&snapshot.run.method, &snapshot.registry);
                self.screen.open(methods);
            }
            Action::Preset => self.screen.open(lists::presets(self.screen.run().preset)),
            Action::OnArrival => {
                self.set_on_arrival(self.screen.on_arrival.next());
                self.say(&format!("at the goal @ will {}", self.screen.on_arrival.name()));
            }
            Action::Follow => self.follow_next(),
            Action::Field(forward) => {
                self.show_field(
                    self.screen
                        .field
                        .cycle(forward, |field| self.scene.has_field(field, &self.screen)),
                );
            }
            Action::Toggle(overlay) => self.toggle_overlay(overlay),
            Action::Marker => self.change_marker(),
            Action::Back => self.step_through_time(false),
            Action::Forth => self.step_through_time(true),
            Action::Theme => self.screen.open(lists::themes(self.screen.theme.name)),
            Action::Show(pane) => self.show(pane),
            Action::NextPane => self.show_next(),
            Action::Maximise => self.screen.maximised = !self.screen.maximised,
            Action::Scroll(by) => {
                self.screen.scrolled = self.screen.scrolled.saturating_add_signed(-by);
            }
            Action::LogScale => self.change_curve_scale(),
            Action::OpenMap => self.pick_map(None),
            Action::RandomMap => self.screen.open(lists::random_maps()),
            Action::Save => {
                self.save();
            }
            Action::SaveAs => self.ask_save_as(),
            Action::Load => self.pick_checkpoint(),
            Action::Resume => self.resume_offered(),
            Action::Autosave => self.ask_autosave(),
            Action::Export => self.screen.open(lists::exports(self.scene.noun())),
            Action::ExportFilm => self.choose(Choice::Export(ExportKind::Film)),
            Action::Compare => {
                self.notify(&format!("in a shell: {COMPARISON} shows both on the same map"));
            }
            Action::Tour => self.ask_tour(),
            Action::NextTourStep => self.next_tour_step(),
            Action::EndTour => self.end_tour(),
            Action::Palette => self.screen.open(lists::actions(&self.screen, &self.scene)),
            Action::Help => self.screen.dialogs.push(Dialog::Help(Help::default())),
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

    /// Shows or hides an overlay.
    fn toggle_overlay(&mut self, overlay: Overlay) {
        if overlay.needs_bridges() && !self.screen.run().method.plans() {
            let key = self.screen.keymap.key_of(Action::Method);
            let method = self.screen.run().method.name();
            return self.say(&format!("{method} has no bridges: {key} chooses another method"));
        }
        let shown = self.screen.overlays.toggle(overlay);
        self.in_scene(|scene, screen, link| scene.act(Action::Toggle(overlay), screen, link));
        let tried = |status| self.scene.edge_count(status) > 0;
        let none = overlay == Overlay::Edges
            && shown
            && ![EdgeStatus::Confirmed, EdgeStatus::Demoted].into_iter().any(tried);
        let more = if none { ", but agents have not tried any yet" } else { "" };
        self.say(&format!("{} {}{more}", overlay.name(), if shown { "shown" } else { "hidden" }));
    }

    /// Draws the map with the next marker.
    fn change_marker(&mut self) {
        let all = Marker::ALL;
        let at = all.iter().position(|m| *m == self.screen.marker).unwrap_or(0);
        self.screen.marker = all[(at + 1) % all.len()];
        let none =
            self.screen.marker == Marker::Pixels && self.screen.picture_character().is_none();
        let more = match self.screen.theme.depth {
            ColourDepth::Mono => {
                ", once there are colours: without them, the map is drawn in characters"
            }
            _ if none => " (not supported here: as auto)",
            _ => "",
        };
        self.say(&format!("marker: {}{more}", self.screen.marker.name()));
    }

    /// Switches the curves between linear and logarithmic scales.
    fn change_curve_scale(&mut self) {
        self.screen.log_scale = !self.screen.log_scale;
        let scale = if self.screen.log_scale { "logarithmic scales" } else { "linear scales" };
        self.say(&format!("curves of losses and distances on {scale}"));
    }

    /// Asks for the interval of autosaves.
    fn ask_autosave(&mut self) {
        let (now, hint) = (self.autosave_minutes.to_string(), "minutes; 0 turns autosave off");
        self.screen.open(Prompt::new(
            Question::Autosave,
            "autosave interval in minutes",
            hint,
            now,
        ));
    }

    /// Colours the scene by a field.
    pub fn show_field(&mut self, field: Field) {
        self.screen.field = field;
        self.link.request(Request::Field(field));
    }

    /// Says why an action does nothing here.
    fn refuse(&mut self, action: Action) {
        let name = bindings().find(|b| b.action == action).map_or("", |b| b.name);
        let title = self.scene.title(&self.screen.snapshot);
        let text = format!("{title} has no {}, which \"{name}\" is for", self.scene.other_noun());
        self.notify(&text);
    }

    fn toggle_pause(&mut self) {
        let trains = self.snapshots().borrow().phase.is_training();
        if self.command(if trains { Command::Pause } else { Command::Resume }) {
            self.screen.pausing = trains;
        }
    }

    /// Runs a step, pausing training first if necessary.
    fn step(&mut self, step: Step) {
        if self.screen.snapshot.phase.is_training() && self.command(Command::Pause) {
            self.screen.pausing = true;
        }
        self.command(Command::Step(step));
    }

    fn change_speed(&mut self, faster: bool) {
        // Without a limit, the next slower speed is the first one below the actual rate. A method
        // that does not learn has a limit of its own.
        let learns = self.screen.snapshot.learns;
        let rate =
            Some(self.screen.snapshot.rates.0).filter(|rate| (!faster || !learns) && *rate > 0.0);
        let now = self.screen.snapshot.speed.or(rate).unwrap_or(f64::INFINITY);
        let speed = if faster {
            SPEEDS
                .into_iter()
                .find(|speed| *speed > now)
                .or(SPEEDS.last().copied().filter(|_| !learns))
        } else {
            SPEEDS.into_iter().rev().find(|speed| *speed < now).or(Some(SPEEDS[0]))
        };
        if self.command(Command::LimitSpeed(speed)) {
            self.say(&match speed {
                Some(speed) => format!("at most {speed:.0} updates per second"),
                None => "no speed limit".to_owned(),
            });
        }
    }

    fn follow_next(&mut self) {
        let agents = self.screen.run().settings.train.agents;
        self.follow(match self.screen.following {
            None => Some(0),
            Some(agent) if agent + 1 < agents => Some(agent + 1),
            Some(_) => None,
        });
    }

    /// Follows an exploring agent, or the walking one again.
    fn follow(&mut self, agent: Option<usize>) {
        self.screen.following = agent;
        self.command(Command::Follow(self.screen.following));
        let who = self
            .screen
            .following
            .map_or("the walking agent @".to_owned(), |agent| format!("exploring agent {agent}"));
        self.notify(&format!("following {who}"));
        self.screen.pane = Pane::Walk;
    }

    /// Shows a pane: instead of the map if there is no room beside it.
    fn show(&mut self, pane: Pane) {
        (self.screen.pane, self.screen.scrolled) = (pane, 0);
        self.screen.maximised |= self.screen.layout.lacks_panel;
    }

    /// Shows the next pane. If there is no room beside the map, the map comes after the last one.
    fn show_next(&mut self) {
        let Screen { maximised, pane, .. } = self.screen;
        let last = pane == Pane::ALL[Pane::ALL.len() - 1];
        match (self.screen.layout.lacks_panel, maximised) {
            (true, true) if last => self.screen.maximised = false,
            (true, false) => self.show(Pane::ALL[0]),
            _ => self.show(pane.next()),
        }
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
            self.follow(None);
        } else if self.screen.first_run {
            self.screen.on_first_use();
        } else {
            self.in_scene(|scene, screen, link| scene.act(Action::ZoomOff, screen, link));
        }
    }

    /// Changes the theme.
    pub fn set_theme(&mut self, name: ThemeName) {
        let theme = Theme::new(name, ColourDepth::detect());
        // Overlays that the user has chosen are left alone.
        if self.screen.overlays == Overlays::by_default(self.screen.theme.depth) {
            self.screen.overlays = Overlays::by_default(theme.depth);
        }
        self.screen.theme = theme;
    }

    fn ask_seed(&mut self) {
        let next = self.screen.run().seed.wrapping_add(1).to_string();
        let hint = "an integer: same seed, same run";
        self.screen.open(Prompt::new(Question::Seed, "restart with seed", hint, next));
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
