//! The runs of folders: a list, the curves of those that are marked, and what they differ in.
//!
//! * `reading`: reads the folders on a thread of its own.
//! * `list`: filter, order, marks and selection; `settings`: what runs differ in.
//! * `act`: user input; `files`: what it does with files; `working`: the thread that does it.
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
mod working;

use std::path::PathBuf;
use std::sync::Arc;

use crossterm::event::Event;
use miette::{IntoDiagnostic, Report, miette};
use ratatui::Frame;
use ratatui::style::Style;
use tui_input::Input;

use super::PreparedInterface;
use super::compare::{Contestants, LETTERS};
use super::config::UiConfig;
use super::dialog::Help;
use super::graphics::{Graphics, Picture, Redraw};
use super::interface::{ClosedRun, Interface, TerminalRequest};
use super::keymap::Keymap;
use super::log::Log;
use super::render::curves as lines;
use super::style::BOLD;
use super::theme::{ColourDepth, Theme};
use crate::experiment::plot::{Axis, Measure};
use crate::experiment::runs::Found;
use crate::host::setup::Setup;
use draw::Places;
use files::Question;
use gdg::pulse::Progress;
use list::List;
use reading::Reading;
use working::Work;

/// What curves show.
#[derive(Clone, Copy, Debug)]
pub struct Curves {
    /// What is drawn.
    pub measure: Measure,
    /// What it is drawn over.
    pub axis: Axis,
}

/// A saved run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Saved {
    /// Its checkpoint.
    pub file: PathBuf,
    /// Whether another program still trains it.
    pub goes_on: bool,
}

/// What the user wishes to see instead of the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wish {
    /// A run, resumed.
    Resume(Saved),
    /// Two runs side by side.
    Compare([Saved; 2]),
}

impl Wish {
    /// Returns what is to be said of runs that other programs still train.
    pub fn warning(&self) -> Option<String> {
        match self {
            Self::Resume(saved) => saved.goes_on.then(|| {
                "another program still trains this run: this is a copy, as last saved; of the two, \
                 the one that saves second does so to another name"
                    .to_owned()
            }),
            Self::Compare(both) => {
                let going_on = LETTERS.iter().zip(both).filter(|(_, saved)| saved.goes_on);
                let sides: Vec<String> = going_on.map(|(side, _)| side.to_string()).collect();
                (!sides.is_empty()).then(|| {
                    let sides = sides.join(" and ");
                    format!("other programs still train {sides}: shown as last saved")
                })
            }
        }
    }
}

/// What has been opened.
pub enum Opened {
    /// A run.
    Run(Box<Setup>),
    /// Two runs.
    Comparison(Box<Contestants>),
}

/// Opens what the user wishes, and says how far it is.
pub type Opener = Arc<dyn Fn(Wish, &Progress) -> Result<Opened, Report> + Send + Sync>;

/// What comes after the list.
pub enum Next {
    /// Nothing.
    Quit,
    /// What has been opened.
    Show(Opened),
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
    opener: Opener,
    wish: Option<Wish>,
    work: Option<Work>,
    /// What could not be opened.
    pub failures: Vec<Report>,
    next: Option<Next>,
    terminal_request: Option<TerminalRequest>,
}

impl RunsScreen {
    /// Begins to read the runs of folders, which `opener` opens.
    ///
    /// # Errors
    /// The folders cannot be read on a thread of their own.
    pub fn open(
        folders: &[PathBuf],
        opener: Opener,
        interface: &PreparedInterface,
    ) -> Result<Self, Report> {
        let reading = Reading::start(folders).into_diagnostic()?;
        let names: Vec<String> = folders.iter().map(|path| path.display().to_string()).collect();
        let PreparedInterface { config, keymap, .. } = interface;
        Ok(Self::new(&names.join(" "), reading, opener, config, keymap.clone()))
    }

    /// Shows the list, as it was left, with what there is to say of what has been shown since, or
    /// the problem with it; returns it, what comes next, and the exit status.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn show(
        mut self,
        interface: &mut PreparedInterface,
        since: &Result<String, String>,
    ) -> Result<(Self, Next, u8), Report> {
        self.reading.look_again();
        match since {
            Ok(notice) if notice.is_empty() => {}
            Ok(notice) => self.log.show(notice, false),
            Err(problem) => self.log.show(problem, true),
        }
        let mut left = None;
        let (status, _) = interface.stage.show(self, |mut screen| {
            screen.finish_work();
            let next = screen.next.take().unwrap_or(Next::Quit);
            left = Some((screen, next));
            ClosedRun::default()
        })?;
        let (screen, next) = left.ok_or_else(|| miette!("the list was not closed"))?;
        Ok((screen, next, status))
    }
}

impl RunsScreen {
    fn new(
        title: &str,
        reading: Reading,
        opener: Opener,
        config: &UiConfig,
        keymap: Keymap,
    ) -> Self {
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
            opener,
            wish: None,
            work: None,
            failures: Vec::new(),
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
        self.begin_to_open();
        self.follow_work() | self.log.on_tick()
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
