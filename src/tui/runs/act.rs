//! Reacts to keys and the mouse.

use crossterm::event::{Event, KeyCode, KeyEvent, MouseButton, MouseEvent, MouseEventKind};
use ratatui::layout::Position;
use tui_input::backend::crossterm::EventHandler;

use super::{Next, Question, RunsScreen, Wish, files};
use crate::tui::action::{Action, ListAction, Mode};
use crate::tui::dialog::Help;
use crate::tui::interface::TerminalRequest;
use crate::tui::keymap;
use crate::tui::layout::Click;

/// Rows that the wheel moves the selection by.
const WHEEL: isize = 3;

impl RunsScreen {
    /// Handles a key.
    pub(super) fn on_key(&mut self, key: KeyEvent) {
        self.log.dismiss();
        let action = self.keymap.action(key, Mode::Listing);
        if let Some(help) = &mut self.help {
            if help.on_key(key, action, self.keymap.action(key, Mode::Help)) {
                self.help = None;
            }
        } else if let Some(question) = self.question.take() {
            if matches!(key.code, KeyCode::Char('y' | 'Y')) {
                self.begin_to_delete(question);
            }
        } else if self.is_typing {
            self.on_key_in_words(key);
        } else if let Some(action) = action {
            self.act(action);
        } else {
            let page = isize::from(self.places.rows.0.height as i16).max(1);
            match key.code {
                KeyCode::PageUp => self.list.step(-page),
                KeyCode::PageDown => self.list.step(page),
                KeyCode::Home | KeyCode::Char('g') => self.list.select(0),
                KeyCode::End | KeyCode::Char('G') => self.list.select(usize::MAX),
                _ => {
                    let help = self.keymap.key_of(Action::Help);
                    let text = format!(
                        "{} does nothing here: {help} lists all keys",
                        keymap::name_of(key)
                    );
                    self.log.show(&text, false);
                }
            }
        }
    }

    /// Handles a key while words are typed: Enter keeps them, Esc removes them.
    fn on_key_in_words(&mut self, key: KeyEvent) {
        match key.code {
            KeyCode::Enter => self.is_typing = false,
            KeyCode::Esc => {
                self.is_typing = false;
                self.words.reset();
            }
            KeyCode::Up => self.list.step(-1),
            KeyCode::Down => self.list.step(1),
            _ => drop(self.words.handle_event(&Event::Key(key))),
        }
        self.list.filter(self.words.value());
    }

    /// Performs an action.
    pub(super) fn act(&mut self, action: Action) {
        match action {
            Action::Move(_, rows) => self.list.step(rows),
            Action::Help => self.help = Some(Help::default()),
            Action::SearchHelp => {
                if let Some(help) = &mut self.help {
                    help.searching = true;
                }
            }
            Action::Close => self.close_top(),
            Action::Redraw => self.terminal_request = Some(TerminalRequest::Redraw),
            Action::Suspend => self.terminal_request = Some(TerminalRequest::Suspend),
            Action::Quit => self.next = Some(Next::Quit),
            Action::List(action) => self.act_on_list(action),
            _ => {}
        }
    }

    fn act_on_list(&mut self, action: ListAction) {
        match action {
            ListAction::Mark => {
                if !self.list.toggle_mark() {
                    self.log.show("each letter marks a run already: unmark one first", true);
                }
            }
            ListAction::Filter => self.is_typing = true,
            ListAction::Sort => self.list.sort_by_next(),
            ListAction::Reverse => self.list.sort_by(self.list.order().0),
            ListAction::Measure => self.curves.measure = self.curves.measure.next(),
            ListAction::Axis => self.curves.axis = self.curves.axis.next(),
            ListAction::Resume => self.resume(),
            ListAction::Compare => match files::pair(&self.list) {
                Ok(pair) => self.wish = Some(Wish::Compare(pair)),
                Err(problem) => self.log.show(&problem, true),
            },
            ListAction::Plot => self.begin_to_plot(self.curves),
            ListAction::Delete => match Question::new(&self.list) {
                Ok(question) => self.question = question,
                Err(problem) => self.log.show(&problem, true),
            },
        }
    }

    /// Closes the help, or else opens nothing any more, or else shows all runs, or else unmarks
    /// them.
    fn close_top(&mut self) {
        if self.help.take().is_some() || self.cancel_opening() {
            return;
        }
        if self.words.value().is_empty() {
            self.list.clear_marks();
        }
        self.words.reset();
        self.list.filter("");
    }

    /// Resumes the selected run, unless it has no checkpoint.
    fn resume(&mut self) {
        let Some(entry) = self.list.selected() else {
            if self.list.selected_damage().is_some() {
                self.log.show("this file cannot be resumed, as it cannot be loaded", true);
            }
            return;
        };
        match files::saved(entry) {
            Ok(saved) => self.wish = Some(Wish::Resume(saved)),
            Err(problem) => self.log.show(&problem, true),
        }
    }

    /// Handles the mouse: a click selects a run, one on the selected run marks it, and one on a
    /// column's name sorts.
    pub(super) fn on_mouse(&mut self, mouse: MouseEvent) {
        let at = Position::new(mouse.column, mouse.row);
        let wheel = match mouse.kind {
            MouseEventKind::ScrollUp => -WHEEL,
            MouseEventKind::ScrollDown => WHEEL,
            MouseEventKind::Down(MouseButton::Left) => return self.on_click(at),
            _ => return,
        };
        match &mut self.help {
            Some(help) => help.scroll(wheel),
            None => self.list.step(wheel),
        }
    }

    fn on_click(&mut self, at: Position) {
        self.log.dismiss();
        match self.places.layout.click(at) {
            Some(Click::Act(action)) => return self.act(action),
            Some(Click::Close) => return self.close_top(),
            _ if self.help.is_some() || self.question.is_some() => return,
            _ => {}
        }
        if let Some((_, column)) = self.places.columns.iter().find(|(area, _)| area.contains(at)) {
            return self.list.sort_by(*column);
        }
        let (rows, first) = self.places.rows;
        let place = first + usize::from(at.y.saturating_sub(rows.y));
        if !rows.contains(at) || place >= self.list.rows() {
            return;
        }
        if place == self.list.position() {
            self.list.toggle_mark();
        }
        self.list.select(place);
    }
}
