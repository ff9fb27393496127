//! The application: the terminal's events go to the topmost layer, which is a dialog, or else a run
//! or a comparison of two.

use std::slice;

use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use ratatui::Frame;
use ratatui::layout::Position;

use super::action::{Action, Binding, Mode, binding_of};
use super::compare::Comparison;
use super::dialog::Dialog;
use super::graphics::{Graphics, Redraw, TerminalPicture};
use super::interface::{ClosedRun, Interface, TerminalRequest};
use super::keymap;
use super::layout::{Click, ScreenLayout};
use super::session::{Session, watching};
use gdg::engine::Engine;

/// What fills the screen below the dialogs.
pub enum Base {
    Run(Box<Session>),
    Comparison(Box<Comparison>),
}

pub struct App {
    pub base: Base,
    /// Whether the mouse button that is down has had its effect, so that dragging on does nothing.
    press_is_spent: bool,
}

impl App {
    pub fn new(session: Session) -> Self {
        Self { base: Base::Run(Box::new(session)), press_is_spent: false }
    }

    pub fn of(comparison: Comparison) -> Self {
        Self { base: Base::Comparison(Box::new(comparison)), press_is_spent: false }
    }

    pub fn sessions(&self) -> &[Session] {
        match &self.base {
            Base::Run(session) => slice::from_ref(&**session),
            Base::Comparison(comparison) => &comparison.sessions,
        }
    }

    fn sessions_mut(&mut self) -> &mut [Session] {
        match &mut self.base {
            Base::Run(session) => slice::from_mut(&mut **session),
            Base::Comparison(comparison) => &mut comparison.sessions,
        }
    }

    pub fn first(&self) -> &Session {
        &self.sessions()[0]
    }

    pub fn first_mut(&mut self) -> &mut Session {
        &mut self.sessions_mut()[0]
    }

    pub fn close(self, engines: Vec<Engine>) -> ClosedRun {
        let mut engines = engines.into_iter();
        match self.base {
            Base::Run(session) => {
                engines.next().map_or_else(ClosedRun::default, |engine| session.close(engine))
            }
            Base::Comparison(comparison) => comparison.close(engines),
        }
    }

    fn mode(&self) -> Mode {
        match &self.base {
            Base::Run(session) => session.mode(),
            Base::Comparison(comparison) => comparison.mode(),
        }
    }

    fn layout(&self) -> &ScreenLayout {
        match &self.base {
            Base::Run(session) => &session.screen.layout,
            Base::Comparison(comparison) => &comparison.layout,
        }
    }

    fn has_dialogs(&self) -> bool {
        !self.first().screen.dialogs.is_empty()
    }

    /// Shows a notice, unless there is an error.
    fn say(&mut self, text: &str) {
        match &mut self.base {
            Base::Run(session) if session.screen.log.notice().is_none() => session.screen.say(text),
            Base::Run(_) => {}
            Base::Comparison(comparison) => comparison.notify(text),
        }
    }

    pub fn act(&mut self, action: Action) {
        binding_of(action).into_iter().for_each(|binding| self.perform(binding));
    }

    fn perform(&mut self, binding: &Binding) {
        match &mut self.base {
            Base::Run(session) => binding.perform(session),
            Base::Comparison(comparison) => comparison.perform(binding),
        }
    }

    fn on_key(&mut self, key: KeyEvent) {
        self.sessions_mut().iter_mut().for_each(|session| session.screen.log.dismiss());
        let mode = self.mode();
        let mut single = None;
        if let Base::Comparison(comparison) = &mut self.base {
            comparison.log.dismiss();
            // What a run alone has is refused.
            single = Some(if comparison.is_editing() { Mode::Editing } else { Mode::Watching });
        }
        let keymap = &self.first().screen.keymap;
        let of = |mode| keymap.binding(key, mode);
        if let Some(binding) = of(mode).or_else(|| single.and_then(of)) {
            return self.perform(binding);
        }
        let is_editing = matches!(mode, Mode::Editing | Mode::EditingBoth);
        let place = if is_editing { "in the editor" } else { "here" };
        let help = keymap.key_of(Action::Help);
        let key = keymap::name_of(key);
        self.say(&format!("{key} does nothing {place}: {help} lists all keys"));
    }

    fn on_mouse(&mut self, mouse: MouseEvent) {
        let (kind, at) = (mouse.kind, Position::new(mouse.column, mouse.row));
        match kind {
            MouseEventKind::Down(_) => self.press_is_spent = self.has_dialogs(),
            MouseEventKind::Drag(_) if self.press_is_spent => return,
            MouseEventKind::Up(_) if std::mem::take(&mut self.press_is_spent) => return,
            _ => {}
        }
        if self.has_dialogs() {
            return self.on_event_in_dialog(&Event::Mouse(mouse));
        }
        let is_press = kind == MouseEventKind::Down(MouseButton::Left);
        let sides = self.sessions().iter().map(|session| &session.screen.layout);
        let clicked = std::iter::once(self.layout()).chain(sides).find_map(|l| l.click(at));
        if is_press && let Some(Click::Act(action)) = clicked {
            self.press_is_spent = true;
            return self.act(action);
        }
        let is_held = is_press || kind == MouseEventKind::Drag(MouseButton::Left);
        let moment = self.layout().charts.iter().find_map(|chart| chart.value_at(at));
        let moment = moment.filter(|_| is_held);
        match &mut self.base {
            Base::Run(session) => match moment.filter(|_| !session.scene.is_drawing()) {
                Some(moment) => watching::look_at_curves(session, moment),
                None => session.on_mouse(kind, at),
            },
            Base::Comparison(comparison) => comparison.on_mouse(kind, at),
        }
    }

    /// Quits, which may ask, in place of open dialogs; if that question is open, without an answer.
    fn interrupt(&mut self) {
        let session = self.first_mut();
        if session.screen.dialogs.last().is_some_and(Dialog::asks_to_quit) {
            session.saver.is_done = true;
            return;
        }
        while !session.screen.dialogs.is_empty() {
            session.dismiss();
        }
        self.act(Action::Quit);
    }

    /// Has the topmost dialog handle an event, and does what the user picks in it.
    fn on_event_in_dialog(&mut self, event: &Event) {
        if let Base::Comparison(comparison) = &mut self.base {
            comparison.sessions[0].screen.log.dismiss();
        }
        if let Event::Key(key) = event
            && !key.is_release()
            && (key.code, key.modifiers) == (KeyCode::Char('c'), KeyModifiers::CONTROL)
        {
            return self.interrupt();
        }
        let choice = self.first_mut().on_event_in_dialog(event);
        match &mut self.base {
            Base::Run(session) => choice.into_iter().for_each(|choice| session.choose(choice)),
            Base::Comparison(comparison) => comparison.choose(choice.as_ref()),
        }
    }
}

impl Interface for App {
    async fn update(&mut self) {
        match &mut self.base {
            Base::Run(session) => session.update().await,
            Base::Comparison(comparison) => comparison.update().await,
        }
    }

    fn on_event(&mut self, event: &Event) {
        match event {
            Event::Mouse(mouse) => self.on_mouse(*mouse),
            event if self.has_dialogs() => self.on_event_in_dialog(event),
            Event::Key(key) if !key.is_release() => self.on_key(*key),
            _ => {}
        }
    }

    fn on_tick(&mut self) -> bool {
        match &mut self.base {
            Base::Run(session) => session.on_tick(),
            Base::Comparison(comparison) => comparison.on_tick(),
        }
    }

    fn take_terminal_request(&mut self) -> Option<TerminalRequest> {
        self.first_mut().terminal_request.take()
    }

    fn is_training(&self) -> bool {
        self.sessions().iter().any(Session::is_training)
    }

    fn is_done(&self) -> bool {
        self.first().saver.is_done
    }

    fn set_graphics(&mut self, graphics: Option<Graphics>, redraw: Redraw) {
        self.sessions_mut().iter_mut().for_each(|session| {
            (session.screen.graphics, session.screen.redraw) = (graphics, redraw);
        });
    }

    fn report(&mut self, problem: &str) {
        match &mut self.base {
            Base::Run(session) => session.screen.report(problem),
            Base::Comparison(comparison) => comparison.log.add(problem, 0.0, 0, true),
        }
    }

    fn pictures(&self) -> Vec<&TerminalPicture> {
        self.sessions().iter().filter_map(|session| session.cache.picture()).collect()
    }

    fn draw(&mut self, frame: &mut Frame) {
        match &mut self.base {
            Base::Run(session) => session.draw(frame),
            Base::Comparison(comparison) => comparison.draw(frame),
        }
    }

    fn on_signal(&mut self) {
        // Comparisons save only when asked.
        if let Base::Run(session) = &mut self.base {
            session.catch_up();
            session.saver.save_on_closing(&session.cx);
        }
    }
}
