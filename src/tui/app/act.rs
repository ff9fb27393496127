//! What actions do.

use crossterm::event::{KeyCode, KeyEvent};

use super::App;
use crate::map::Cell;
use crate::train::{Command, Phase, Step};
use crate::tui::action::Action;
use crate::tui::dialog::{Dialog, Picker, Prompt, Question, lists};
use crate::tui::editor::beside;
use crate::tui::layers::Overlay;
use crate::tui::panes::Pane;
use crate::tui::theme::{Theme, ThemeName};
use crate::tui::viewer::Request;

/// Speeds that can be chosen, in updates a second; beyond the last one there is no limit.
const SPEEDS: [f64; 9] = [1.0, 3.0, 10.0, 30.0, 100.0, 200.0, 400.0, 800.0, 1600.0];

/// Lines that Page Up and Page Down move the help by.
const PAGE: usize = 10;

impl App {
    /// Does what was asked for.
    pub fn act(&mut self, action: Action) {
        match action {
            Action::TogglePause => self.toggle_pause(),
            Action::StepUpdate => self.step(Step::Update),
            Action::StepEpisode => self.step(Step::Episode),
            Action::Slower => self.change_speed(false),
            Action::Faster => self.change_speed(true),
            Action::Freeze => self.freeze(!self.frozen),
            Action::NewSeed => self.ask_seed(),
            Action::Settings => self.pick(lists::settings(&self.run().settings)),
            Action::Method => self.pick(lists::methods(&self.run().method)),
            Action::Preset => self.pick(lists::presets(self.run().preset)),
            Action::NewGoal => {
                let cell = self.random_cell();
                self.set_goal(cell);
            }
            Action::Move(dx, dy) => self.move_by(dx, dy),
            Action::GoalHere => self.set_goal(self.inspecting.unwrap_or(self.goal)),
            Action::StartHere => self.viewer.ask(Request::Start(Some(self.inspecting.unwrap_or(self.goal)))),
            Action::NewStart => self.viewer.ask(Request::Start(None)),
            Action::Tour => {
                self.tour = self.tour.next();
                self.viewer.ask(Request::Tour(self.tour));
                self.notify(&format!("at the goal @ will {}", self.tour.name()));
            }
            Action::Follow => self.follow_next(),
            Action::Field(forward) => {
                self.field = self.field.turn(forward, &self.run().method);
                self.viewer.ask(Request::Field(self.field));
            }
            Action::Toggle(overlay) => {
                let shown = self.overlays.toggle(overlay);
                if overlay == Overlay::Directions {
                    self.viewer.ask(Request::Directions(shown));
                }
                self.notify(&format!("{} {}", overlay.name(), if shown { "shown" } else { "hidden" }));
            }
            Action::Marker => {
                let all = crate::tui::raster::Marker::ALL;
                let at = all.iter().position(|m| *m == self.marker).unwrap_or(0);
                self.marker = all[(at + 1) % all.len()];
                self.notify(&format!("drawn with: {}", self.marker.name()));
            }
            Action::ZoomIn => self.zoom(1.5, None),
            Action::ZoomOut => self.zoom(1.0 / 1.5, None),
            Action::ZoomOff => self.zoom(0.0, None),
            Action::Pan(dx, dy) => self.pan(dx, dy),
            Action::Inspect => {
                let at = self.inspecting.is_none().then_some(self.goal);
                self.inspect(at);
            }
            Action::Theme => self.pick(lists::themes(self.theme.name)),
            Action::Show(pane) => self.show(pane),
            Action::NextPane => self.show(self.pane.next()),
            Action::Maximise => self.maximised = !self.maximised,
            Action::Scroll(by) => self.scrolled = self.scrolled.saturating_add_signed(-by),
            Action::LogScale => self.log_scale = !self.log_scale,
            Action::ToggleEdit => self.toggle_edit(),
            Action::Tool(tool) => self.editor.take(tool),
            Action::Apply => {
                let new = self.editor.apply(&self.map.clone());
                self.change_map(new);
            }
            Action::Undo => {
                let new = self.editor.undo(&self.map.clone());
                self.change_map(new);
            }
            Action::Redo => {
                let new = self.editor.redo(&self.map.clone());
                self.change_map(new);
            }
            Action::SaveMap => self.ask_map_file(),
            Action::OpenMap => self.pick_map(None),
            Action::NewMap => self.ask_size(Question::NewMap),
            Action::ResizeMap => self.ask_size(Question::ResizeMap),
            Action::Save => {
                self.save();
            }
            Action::SaveAs => self.ask_save_as(),
            Action::Load => self.pick_checkpoint(),
            Action::Autosave => {
                let (now, hint) = (self.autosave_minutes.to_string(), "minutes; 0 for never");
                self.ask(Prompt::new(Question::Autosave, "save by itself every ... minutes", hint, now));
            }
            Action::Export => self.pick(lists::exports()),
            Action::Palette => self.pick(lists::actions(&self.keymap)),
            Action::Help => self.dialogs.push(Dialog::Help(0)),
            Action::Close => self.close_top(),
            Action::Suspend => self.suspending = true,
            Action::Quit => self.quit(),
        }
    }

    fn toggle_pause(&mut self) {
        // What is shown may be frozen.
        let trains = self.snapshots().borrow().phase.trains();
        if self.command(if trains { Command::Pause } else { Command::Resume }) {
            self.pausing = trains;
        }
    }

    /// Steps where training is paused; else it is paused first.
    fn step(&mut self, step: Step) {
        if self.snapshot.phase.trains() && self.command(Command::Pause) {
            self.pausing = true;
        }
        self.command(Command::Step(step));
    }

    fn change_speed(&mut self, faster: bool) {
        // From no limit on, the first slower one is slower than it goes by itself.
        let rate = Some(self.snapshot.rates.0).filter(|rate| !faster && *rate > 0.0);
        let now = self.snapshot.speed.or(rate).unwrap_or(f64::INFINITY);
        let speed = if faster {
            SPEEDS.into_iter().find(|speed| *speed > now)
        } else {
            SPEEDS.into_iter().rev().find(|speed| *speed < now).or(Some(SPEEDS[0]))
        };
        if self.command(Command::LimitSpeed(speed)) {
            self.notify(&match speed {
                Some(speed) => format!("at most {speed:.0} updates a second"),
                None => "as fast as it can".to_owned(),
            });
        }
    }

    fn follow_next(&mut self) {
        let agents = self.snapshot.agents.len() / 2;
        self.following = match self.following {
            None => Some(0),
            Some(agent) if agent + 1 < agents => Some(agent + 1),
            Some(_) => None,
        };
        self.command(Command::Follow(self.following));
        let who = self.following.map_or("the walking agent @".to_owned(), |agent| format!("exploring agent {agent}"));
        self.notify(&format!("following {who}"));
        self.pane = Pane::Walk;
    }

    fn show(&mut self, pane: Pane) {
        (self.pane, self.scrolled) = (pane, 0);
    }

    fn toggle_edit(&mut self) {
        if self.editor.is_open() {
            self.editor.close();
        } else {
            self.editor.cursor = Some(self.inspecting.unwrap_or(self.goal));
            self.inspect(None);
        }
    }

    fn move_by(&mut self, dx: isize, dy: isize) {
        if self.editor.is_open() {
            self.editor.move_cursor((dx, dy), &self.map.clone());
        } else if let Some(at) = self.inspecting {
            self.inspect(Some(beside(at, (dx, dy), &self.map)));
        } else {
            self.move_goal(dx, dy);
        }
        self.keep_in_sight();
    }

    /// The next free cell in that direction, beyond walls too.
    fn move_goal(&mut self, dx: isize, dy: isize) {
        let mut at = self.goal;
        loop {
            at = Cell::new(at.x.wrapping_add_signed(dx), at.y.wrapping_add_signed(dy));
            if at.x >= self.map().width() || at.y >= self.map().height() {
                return;
            }
            if self.map().is_free(at) {
                return self.set_goal(at);
            }
        }
    }

    fn close_top(&mut self) {
        if self.editor.is_open() {
            self.editor.close();
        } else if self.inspecting.is_some() {
            self.inspect(None);
        } else if self.maximised {
            self.maximised = false;
        } else if self.viewport.zoom > 1.0 {
            self.zoom(0.0, None);
        }
    }

    pub(super) fn pick(&mut self, picker: Picker) {
        self.dialogs.push(Dialog::Pick(picker));
    }

    pub(super) fn ask(&mut self, prompt: Prompt) {
        self.dialogs.push(Dialog::Ask(prompt));
    }

    /// Takes other colours.
    pub fn set_theme(&mut self, name: ThemeName) {
        self.theme = Theme::new(name, crate::tui::theme::Depth::detect());
    }

    fn ask_seed(&mut self) {
        let next = self.run().seed.wrapping_add(1).to_string();
        let hint = "a whole number: same seed, same run. What was learned so far is lost unless it is saved";
        self.ask(Prompt::new(Question::Seed, "begin anew with seed", hint, next));
    }

    pub(super) fn on_key_in_help(&mut self, key: KeyEvent) {
        let action = self.keymap.action(key, self.editor.is_open());
        let Some(Dialog::Help(first)) = self.dialogs.last_mut() else { return };
        match (key.code, action) {
            (_, Some(Action::Help | Action::Close | Action::Quit)) => {
                self.dialogs.pop();
            }
            (KeyCode::Up, _) | (_, Some(Action::Move(0, -1))) => *first = first.saturating_sub(1),
            (KeyCode::Down, _) | (_, Some(Action::Move(0, 1))) => *first += 1,
            (KeyCode::PageUp, _) => *first = first.saturating_sub(PAGE),
            (KeyCode::PageDown | KeyCode::Char(' '), _) => *first += PAGE,
            (KeyCode::Home, _) => *first = 0,
            (KeyCode::End, _) => *first = usize::MAX,
            _ => {}
        }
    }

    /// What the phase is called.
    pub fn phase(&self) -> String {
        match &self.snapshot.phase {
            _ if self.frozen => "screen frozen".to_owned(),
            Phase::Running | Phase::Stepping(_) if self.pausing => "pausing".to_owned(),
            Phase::Running => "training".to_owned(),
            Phase::Stepping(_) => "stepping".to_owned(),
            Phase::Paused => "paused".to_owned(),
            Phase::Done => "done".to_owned(),
            Phase::Failed(error) => format!("stopped: {error}"),
        }
    }
}
