//! Executes actions.

use std::sync::Arc;

use crossterm::event::{KeyCode, KeyEvent};

use super::App;
use crate::bridge::EdgeStatus;
use crate::map::{Cell, Grid};
use crate::train::{Command, Step};
use crate::tui::action::{Action, Mode};
use crate::tui::dialog::{Dialog, Help, Picker, Prompt, Question, lists};
use crate::tui::editor::offset_cell;
use crate::tui::layers::{Overlay, Overlays};
use crate::tui::panes::Pane;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Theme, ThemeName};
use crate::view::{Field, Request};

/// Selectable speed limits, in updates per second; beyond the last one there is no limit.
const SPEEDS: [f64; 9] = [1.0, 3.0, 10.0, 30.0, 100.0, 200.0, 400.0, 800.0, 1600.0];

impl App {
    /// Performs an action.
    pub fn act(&mut self, action: Action) {
        if matches!(action, Action::NewGoal | Action::Move(..) | Action::GoalHere | Action::Help) {
            self.on_first_use();
        }
        match action {
            Action::TogglePause => self.toggle_pause(),
            Action::StepUpdate => self.step(Step::Update),
            Action::StepEpisode => self.step(Step::Episode),
            Action::Slower => self.change_speed(false),
            Action::Faster => self.change_speed(true),
            Action::Freeze => self.freeze(!self.screen.frozen),
            Action::Evaluate => drop(self.command(Command::Evaluate)),
            Action::NewSeed => self.ask_seed(),
            Action::Settings => self.open_picker(lists::settings(self.screen.run())),
            Action::ResetSetting => self.reset_setting(),
            Action::Method => self.open_picker(lists::methods(&self.screen.run().method)),
            Action::Preset => self.open_picker(lists::presets(self.screen.run().preset)),
            Action::NewGoal => {
                let cell = self.random_cell();
                self.set_goal(cell);
            }
            Action::Move(dx, dy) => self.move_by(dx, dy),
            Action::GoalHere => self.set_goal(self.screen.inspecting.unwrap_or(self.screen.goal)),
            Action::StartHere => self.place_walker(Some(self.screen.inspecting.unwrap_or(self.screen.goal))),
            Action::NewStart => self.place_walker(None),
            Action::OnArrival => {
                self.set_on_arrival(self.screen.on_arrival.next());
                self.notify(&format!("at the goal @ will {}", self.screen.on_arrival.name()));
            }
            Action::Follow => self.follow_next(),
            Action::Field(forward) => self.show_field(self.screen.field.cycle(forward, &self.screen.run().method)),
            Action::Toggle(overlay) => {
                let shown = self.screen.overlays.toggle(overlay);
                if overlay == Overlay::Directions {
                    self.viewer.request(Request::Directions(shown));
                }
                let tried = self.screen.view.edges.iter().any(|(_, status)| *status != EdgeStatus::Untried);
                let none = overlay == Overlay::Edges && shown && !tried;
                let more = if none { ", but agents have not tried any yet" } else { "" };
                self.notify(&format!("{} {}{more}", overlay.name(), if shown { "shown" } else { "hidden" }));
            }
            Action::Marker => {
                let all = crate::tui::raster::Marker::ALL;
                let at = all.iter().position(|m| *m == self.screen.marker).unwrap_or(0);
                self.screen.marker = all[(at + 1) % all.len()];
                self.notify(&format!("marker: {}", self.screen.marker.name()));
            }
            Action::ZoomIn => self.zoom(1.5, None),
            Action::ZoomOut => self.zoom(1.0 / 1.5, None),
            Action::ZoomOff => self.zoom(0.0, None),
            Action::Pan(dx, dy) => self.pan(dx, dy),
            Action::Inspect => {
                let at = self.screen.inspecting.is_none().then_some(self.screen.goal);
                self.inspect(at);
            }
            Action::Theme => self.open_picker(lists::themes(self.screen.theme.name)),
            Action::Show(pane) => self.show(pane),
            Action::NextPane => self.show_next(),
            Action::Maximise => self.screen.maximised = !self.screen.maximised,
            Action::Scroll(by) => self.screen.scrolled = self.screen.scrolled.saturating_add_signed(-by),
            Action::LogScale => self.screen.log_scale = !self.screen.log_scale,
            Action::ToggleEdit
            | Action::Tool(_)
            | Action::Apply
            | Action::Undo
            | Action::Redo
            | Action::SaveMap
            | Action::OpenMap
            | Action::RandomMap
            | Action::NewMap
            | Action::ResizeMap => self.act_on_map(action),
            Action::Save => {
                self.save();
            }
            Action::SaveAs => self.ask_save_as(),
            Action::Load => self.pick_checkpoint(),
            Action::Resume => self.resume_offered(),
            Action::Autosave => {
                let (now, hint) = (self.autosave_minutes.to_string(), "minutes; 0 turns autosave off");
                self.open_prompt(Prompt::new(Question::Autosave, "autosave interval in minutes", hint, now));
            }
            Action::Export => self.open_picker(lists::exports()),
            Action::Palette => self.open_picker(lists::actions(&self.screen.keymap, self.screen.offer.is_some())),
            Action::Help => self.screen.dialogs.push(Dialog::Help(Help::default())),
            Action::SearchHelp => {
                if let Some(Dialog::Help(help)) = self.screen.dialogs.last_mut() {
                    help.searching = true;
                }
            }
            Action::Close => self.close_top(),
            Action::Suspend => self.suspending = true,
            Action::Quit => self.quit(),
            // Only a comparison has sides and an axis to choose.
            Action::NextLarger | Action::Larger(_) | Action::Axis => {}
        }
    }

    /// Performs an action of the editor or with map files.
    fn act_on_map(&mut self, action: Action) {
        match action {
            Action::ToggleEdit => self.toggle_edit(),
            Action::Tool(tool) => {
                if !self.screen.editor.is_open() {
                    self.toggle_edit();
                }
                self.screen.editor.select_tool(tool);
            }
            Action::Apply => {
                let new = self.screen.editor.apply(&self.screen.map.clone());
                self.change_map(new);
            }
            Action::Undo => {
                let new = self.screen.editor.undo(&self.screen.map.clone());
                self.change_map_or_say(new, "nothing to undo");
            }
            Action::Redo => {
                let new = self.screen.editor.redo(&self.screen.map.clone());
                self.change_map_or_say(new, "nothing to redo");
            }
            Action::SaveMap => self.ask_map_file(),
            Action::OpenMap => self.pick_map(None),
            Action::RandomMap => self.open_picker(lists::random_maps()),
            Action::NewMap => self.ask_size(Question::NewMap),
            Action::ResizeMap => self.ask_size(Question::ResizeMap),
            _ => {}
        }
    }

    /// Colours the map by a field.
    pub fn show_field(&mut self, field: Field) {
        self.screen.field = field;
        self.viewer.request(Request::Field(field));
    }

    /// Puts the walking agent at a cell, or at a random place.
    pub fn place_walker(&mut self, cell: Option<Cell>) {
        self.viewer.request(Request::Start(cell));
    }

    fn change_map_or_say(&mut self, map: Option<Arc<Grid>>, otherwise: &str) {
        if map.is_none() {
            self.notify(otherwise);
        }
        self.change_map(map);
    }

    fn toggle_pause(&mut self) {
        // The shown snapshot may be frozen.
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
        // Without a limit, the next slower speed is the first one below the actual rate. A method that does not learn has a
        // limit of its own.
        let learns = self.screen.snapshot.learns;
        let rate = Some(self.screen.snapshot.rates.0).filter(|rate| (!faster || !learns) && *rate > 0.0);
        let now = self.screen.snapshot.speed.or(rate).unwrap_or(f64::INFINITY);
        let speed = if faster {
            SPEEDS.into_iter().find(|speed| *speed > now).or(SPEEDS.last().copied().filter(|_| !learns))
        } else {
            SPEEDS.into_iter().rev().find(|speed| *speed < now).or(Some(SPEEDS[0]))
        };
        if self.command(Command::LimitSpeed(speed)) {
            self.notify(&match speed {
                Some(speed) => format!("at most {speed:.0} updates per second"),
                None => "no speed limit".to_owned(),
            });
        }
    }

    fn follow_next(&mut self) {
        let agents = self.screen.snapshot.agents.len() / 2;
        self.screen.following = match self.screen.following {
            None => Some(0),
            Some(agent) if agent + 1 < agents => Some(agent + 1),
            Some(_) => None,
        };
        self.command(Command::Follow(self.screen.following));
        let who =
            self.screen.following.map_or("the walking agent @".to_owned(), |agent| format!("exploring agent {agent}"));
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

    fn toggle_edit(&mut self) {
        if self.screen.editor.is_open() {
            self.screen.editor.close();
        } else {
            self.screen.editor.cursor = Some(self.screen.inspecting.unwrap_or(self.screen.goal));
            self.inspect(None);
        }
    }

    fn move_by(&mut self, dx: isize, dy: isize) {
        if self.screen.editor.is_open() {
            self.screen.editor.move_cursor((dx, dy), &self.screen.map.clone());
        } else if let Some(at) = self.screen.inspecting {
            self.inspect(Some(offset_cell(at, (dx, dy), &self.screen.map)));
        } else {
            self.move_goal(dx, dy);
        }
        self.scroll_into_view();
    }

    /// Moves the goal to the next free cell in that direction, jumping over walls.
    fn move_goal(&mut self, dx: isize, dy: isize) {
        let mut at = self.screen.goal;
        loop {
            at = Cell::new(at.x.wrapping_add_signed(dx), at.y.wrapping_add_signed(dy));
            if at.x >= self.screen.map().width() || at.y >= self.screen.map().height() {
                return;
            }
            if self.screen.map().is_free(at) {
                return self.set_goal(at);
            }
        }
    }

    fn close_top(&mut self) {
        if self.screen.editor.is_open() {
            self.screen.editor.close();
        } else if self.screen.inspecting.is_some() {
            self.inspect(None);
        } else if self.screen.maximised {
            self.screen.maximised = false;
        } else if self.screen.offer.take().is_some() {
            // Hidden.
        } else if self.screen.first_run {
            self.on_first_use();
        } else if self.screen.viewport.zoom > 1.0 {
            self.zoom(0.0, None);
        }
    }

    pub(super) fn open_picker(&mut self, picker: Picker) {
        self.screen.dialogs.push(Dialog::Pick(picker));
    }

    pub(super) fn open_prompt(&mut self, prompt: Prompt) {
        self.screen.dialogs.push(Dialog::Ask(prompt));
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
        let hint = "an integer: same seed, same run. Unsaved training is lost";
        self.open_prompt(Prompt::new(Question::Seed, "restart with seed", hint, next));
    }

    /// Handles a key in the help, where the usual keys scroll and close.
    pub(super) fn on_key_in_help(&mut self, key: KeyEvent) {
        let action = self.screen.keymap.action(key, self.screen.mode());
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
