//! The runs of folders: a list, the curves of those that are marked, and what they differ in.
//!
//! * `reading`: reads the folders on a thread of its own.
//! * `list`: filter, order, marks and selection; `settings`: what runs differ in.
//! * `act`: user input; `files`: what it does with files.
//! * `draw`, `curves`: the screen.

mod act;
mod curves;
mod draw;
mod files;
mod list;
mod reading;
mod settings;
#[cfg(test)]
pub(super) mod tests;

use std::path::PathBuf;

use crossterm::event::Event;
use miette::{IntoDiagnostic, Report, miette};
use ratatui::Frame;
use ratatui::style::Style;
use tui_input::Input;

use super::config::UiConfig;
use super::dialog::Help;
use super::graphics::{Graphics, Picture, Redraw};
use super::interface::{ClosedRun, Interface, TerminalRequest};
use super::keymap::Keymap;
use super::log::Log;
use super::render::curves as lines;
use super::style::BOLD;
use super::theme::{ColourDepth, Theme};
use super::{PreparedInterface, event_loop};
use crate::experiment::plot::{Axis, Measure};
use crate::experiment::runs::Found;
use draw::Places;
use files::Question;
use list::List;
use reading::Reading;

/// What curves show.
#[derive(Clone, Copy, Debug)]
pub struct Curves {
    /// What is drawn.
    pub measure: Measure,
    /// What it is drawn over.
    pub axis: Axis,
}

/// What the user does after the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Next {
    /// Nothing.
    Quit,
    /// Resume the run of a checkpoint.
    Resume(PathBuf),
    /// Compare the runs of two checkpoints.
    Compare([PathBuf; 2]),
}

/// The screen.
pub struct RunsScreen {
    /// The folders.
    title: String,
    reading: Reading,
    /// Files read, of how many.
    read: [usize; 2],
    /// Whether anything has been read.
    has_read: bool,
    list: List,
    /// The words that runs must have, and whether they are being typed.
    words: Input,
    is_typing: bool,
    curves: Curves,
    question: Option<Question>,
    help: Option<Help>,
    log: Log,
    theme: Theme,
    keymap: Keymap,
    places: Places,
    next: Option<Next>,
    terminal_request: Option<TerminalRequest>,
}

impl RunsScreen {
    /// Begins to read the runs of folders.
    ///
    /// # Errors
    /// The folders cannot be read on a thread of their own.
    pub fn open(folders: &[PathBuf], interface: &PreparedInterface) -> Result<Self, Report> {
        let reading = Reading::start(folders).into_diagnostic()?;
        let names: Vec<String> = folders.iter().map(|path| path.display().to_string()).collect();
        let PreparedInterface { config, keymap, .. } = interface;
        Ok(Self::new(&names.join(" "), reading, config, keymap.clone()))
    }

    /// Shows the list, as it was left, with a `problem` that there has been since; returns it, what
    /// the user does next, and the exit status.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn show(
        mut self,
        interface: PreparedInterface,
        problem: Option<&str>,
    ) -> Result<(Self, Next, u8), Report> {
        let PreparedInterface { config, recorder, termination, .. } = interface;
        self.reading.look_again();
        problem.inspect(|problem| self.log.show(problem, true));
        let mut left = None;
        let status =
            event_loop::show(self, recorder, config.marker, &termination, |mut screen| {
                let next = screen.next.take().unwrap_or(Next::Quit);
                left = Some((screen, next));
                ClosedRun { summary: String::new(), saved: Ok(()), failed: false }
            })?;
        let (screen, next) = left.ok_or_else(|| miette!("the list was not closed"))?;
        Ok((screen, next, status))
    }
}

impl RunsScreen {
    fn new(title: &str, reading: Reading, config: &UiConfig, keymap: Keymap) -> Self {
        Self {
            title: gdg::text::sanitized(title),
            reading,
            read: [0; 2],
            has_read: false,
            list: List::default(),
            words: Input::default(),
            is_typing: false,
            curves: Curves { measure: Measure::Success, axis: Axis::Updates },
            question: None,
            help: None,
            log: Log::default(),
            theme: Theme::new(config.theme, ColourDepth::detect()),
            keymap,
            places: Places::default(),
            next: None,
            terminal_request: None,
        }
    }

    /// Shows what has been read.
    fn list(&mut self, found: &Found) {
        (self.read, self.has_read) = (found.read, true);
        self.list.update(found);
    }
}

/// Returns the letter of a marked run, or the sign of the selected one.
fn sign(mark: Option<usize>) -> char {
    mark.map_or('>', |mark| char::from(b'A' + mark as u8))
}

/// Returns the style of a marked run's letter and curve.
fn style(mark: Option<usize>, theme: &Theme) -> Style {
    mark.map_or(Style::new(), |mark| lines::colour(theme, mark).patch(BOLD))
}

impl Interface for RunsScreen {
    async fn update(&mut self) {
        if self.reading.found.changed().await.is_err() {
            // The thread has ended: nothing new will come.
            return std::future::pending().await;
        }
        let found = self.reading.found.borrow_and_update().clone();
        self.list(&found);
    }

    fn on_event(&mut self, event: &Event) {
        match event {
            Event::Key(key) if !key.is_release() => self.on_key(*key),
            Event::Mouse(mouse) => self.on_mouse(*mouse),
            Event::Paste(text) if self.is_typing => {
                let line = text.lines().next().unwrap_or_default();
                let all = format!("{}{line}", self.words.value());
                self.words = Input::new(gdg::text::sanitized(&all));
                self.list.filter(self.words.value());
            }
            _ => {}
        }
    }

    fn on_tick(&mut self) -> bool {
        self.log.on_tick()
    }

    fn take_terminal_request(&mut self) -> Option<TerminalRequest> {
        self.terminal_request.take()
    }

    fn is_training(&self) -> bool {
        false
    }

    fn is_done(&self) -> bool {
        self.next.is_some()
    }

    fn set_graphics(&mut self, _: Option<Graphics>, _: Redraw) {}

    fn draw(&mut self, frame: &mut Frame) {
        self.places = draw::draw(frame, self);
        if let (Some(help), Some(lines)) = (&mut self.help, &self.places.layout.help_lines) {
            (help.first, help.page) = (lines.start, lines.len());
        }
    }

    fn report(&mut self, problem: &str) {
        self.log.show(problem, true);
    }

    fn pictures(&self) -> Vec<&Picture> {
        Vec::new()
    }

    fn on_signal(&mut self) {
        // Nothing is lost.
    }
}
