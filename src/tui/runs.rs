//! The list of runs: a table of the runs of folders, the curves of those that are marked, and what
//! they differ in.
//!
//! * `list`: the rows: filter, order, marks and selection; resumes, compares and deletes them.
//! * `list_view`: the screen.

mod list;
mod list_view;
#[cfg(test)]
pub(super) mod tests;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use miette::{IntoDiagnostic, Report, miette};
use ratatui::Frame;
use ratatui::layout::Position;
use tokio::sync::watch;
use tui_input::Input;
use tui_input::backend::crossterm::EventHandler;

use super::PreparedInterface;
use super::action::{Action, ListAction, Mode};
use super::compare::Contestants;
use super::config::UiConfig;
use super::dialog::{Choice, Dialog, Reply};
use super::interface::{ClosedRun, Interface, TerminalRequest};
use super::keymap::{self, Keymap};
use super::layout::Click;
use super::lists;
use super::log::Log;
use super::screen::PATIENCE;
use super::session::elsewhere::TrainedElsewhere;
use super::theme::{ColourDepth, Theme};
use crate::experiment::plot::{Drawable, Measure, XAxis};
use crate::experiment::saved_runs::{COLUMNS, FoundRuns, RunReader, name};
use crate::setup::Setup;
use gdg::job::{Job, Running};
use list::{List, Written, delete};
use list_view::ClickAreas;

/// The pause before folders are read again: at least this, and as a multiple of the time that
/// reading took, so that large folders do not keep a core busy.
const PAUSE: Duration = Duration::from_secs(2);
const PAUSE_FACTOR: u32 = 10;

const SHOW_INTERVAL: Duration = Duration::from_millis(100);

const WHEEL: isize = 3;

/// What is said where there are none, in pipes, too.
pub const NO_RUNS: &str = "no runs here yet: train with --save FILE, or press s in the interface";

/// What the user wishes to see instead of the list: a run, resumed or watched, or two side by side.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wish {
    pub file: PathBuf,
    pub beside: Option<PathBuf>,
    pub warning: Option<String>,
    /// The records of a run to watch, which another program trains; else its checkpoint.
    pub watches: Option<PathBuf>,
}

pub enum Opened {
    /// One run, perhaps trained by another program.
    Run(Box<Setup>, Option<TrainedElsewhere>),
    Comparison(Box<Contestants>),
}

/// Opens what the user wishes, and says how far it is.
pub type Opener = Arc<dyn Fn(Wish, &Job) -> Result<Opened, Report> + Send + Sync>;

pub struct RunsScreen {
    title: String,
    /// What the thread that reads them has found.
    found: watch::Receiver<Arc<FoundRuns>>,
    /// Asks that thread for another look; it ends with this sender.
    again: Sender<()>,
    /// Files read, of how many, once any has been.
    read: Option<[usize; 2]>,
    list: List,
    /// The words that runs must have, and whether they are being typed.
    words: Input,
    is_typing: bool,
    curves: (Measure, XAxis),
    /// The files that are deleted if the user agrees.
    deletion: Option<Written>,
    /// The help, or the question whether to delete files.
    dialog: Option<Dialog>,
    log: Log,
    theme: Theme,
    keymap: Keymap,
    places: ClickAreas,
    opener: Opener,
    wish: Option<Wish>,
    /// The records of a run that is watched once it is saved, and the text to show until then.
    awaited: Option<(PathBuf, String)>,
    opening: Option<Running<Result<Opened, Report>>>,
    opened: Option<Opened>,
    quits: bool,
    terminal_request: Option<TerminalRequest>,
}

impl RunsScreen {
    /// Begins to read the runs of folders, of which that of `awaited` records is opened once it is saved.
    pub fn open(
        folders: &[PathBuf],
        awaited: Option<PathBuf>,
        opener: Opener,
        interface: &PreparedInterface,
    ) -> Result<Self, Report> {
        // Not what an empty folder has.
        let (publish, found) =
            watch::channel(Arc::new(FoundRuns { read: [0, 1], ..FoundRuns::default() }));
        let (again, asked) = channel();
        let mut reader = RunReader::new(folders);
        let follow = move || {
            let mut began = Instant::now();
            while !publish.is_closed() {
                read(&mut reader, &publish);
                let pause = PAUSE.max(PAUSE_FACTOR * began.elapsed());
                if asked.recv_timeout(pause) == Err(RecvTimeoutError::Disconnected) {
                    return;
                }
                began = Instant::now();
            }
        };
        std::thread::Builder::new().name("runs".to_owned()).spawn(follow).into_diagnostic()?;
        let names: Vec<String> = folders.iter().map(|path| path.display().to_string()).collect();
        let PreparedInterface { config, keymap, .. } = interface;
        let list = Self::new(&names.join(" "), (found, again), opener, config, keymap.clone());
        Ok(Self { awaited: awaited.map(|records| (records, String::new())), ..list })
    }

    fn new(
        title: &str,
        (found, again): (watch::Receiver<Arc<FoundRuns>>, Sender<()>),
        opener: Opener,
        config: &UiConfig,
        keymap: Keymap,
    ) -> Self {
        Self {
            title: gdg::text::sanitized(title),
            found,
            again,
            read: None,
            list: List::default(),
            words: Input::default(),
            is_typing: false,
            curves: Default::default(),
            deletion: None,
            dialog: None,
            log: Log::default(),
            theme: Theme::new(config.theme, ColourDepth::detect()),
            keymap,
            places: ClickAreas::default(),
            opener,
            wish: None,
            awaited: None,
            opening: None,
            opened: None,
            quits: false,
            terminal_request: None,
        }
    }

    /// Shows the list as it was left, below a notice if there is one; returns it, what the user has
    /// opened instead, and the exit status.
    pub fn show(
        mut self,
        interface: &mut PreparedInterface,
        notice: &str,
    ) -> Result<(Self, Option<Opened>, u8), Report> {
        self.look_again();
        if !notice.is_empty() {
            self.log.show(notice, false);
        }
        let mut left = None;
        let (status, _) = interface.stage.show(self, |mut screen| {
            screen.opening = None;
            let opened = screen.opened.take();
            left = Some((screen, opened));
            ClosedRun::default()
        })?;
        let (screen, opened) = left.ok_or_else(|| miette!("the list was not closed"))?;
        Ok((screen, opened, status))
    }

    fn look_again(&self) {
        // A thread that has ended reads nothing any more.
        let _ = self.again.send(());
    }

    fn list(&mut self, found: &FoundRuns) {
        self.read = Some(found.read);
        self.list.update(&found.runs);
        if let Some((records, _)) = self.awaited.take() {
            self.await_save(records);
        }
    }

    /// Watches the run of these records once it is saved.
    fn await_save(&mut self, records: PathBuf) {
        match self.list.select_growing(&records) {
            Some(Ok(wish)) => self.wish = Some(wish),
            Some(Err(text)) => self.awaited = Some((records, text)),
            None => {}
        }
    }
}

/// Reads what is new and publishes it, on the way too.
fn read(reader: &mut RunReader, publish: &watch::Sender<Arc<FoundRuns>>) {
    let mut shown = Instant::now();
    let found = reader.read(|_, so_far| {
        if shown.elapsed() > SHOW_INTERVAL {
            publish.send_replace(Arc::new(so_far()));
            shown = Instant::now();
        }
        if publish.is_closed() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    if **publish.borrow() != found {
        publish.send_replace(Arc::new(found));
    }
}

impl RunsScreen {
    fn tell<T>(&mut self, done: Result<T, String>) -> Option<T> {
        done.map_err(|problem| self.log.show(&problem, true)).ok()
    }

    fn on_key(&mut self, key: KeyEvent) {
        // What a key was refused for is no longer of interest.
        self.log.take();
        let action = self.keymap.action(key, Mode::Listing);
        if action == Some(Action::Quit) && key.modifiers.contains(KeyModifiers::CONTROL) {
            return self.act(Action::Quit);
        }
        if let Some(dialog) = &mut self.dialog {
            let reply = dialog.key(key);
            self.follow_dialog(reply);
        } else if self.is_typing {
            self.on_key_in_words(key);
        } else if let Some(action) = action {
            self.act(action);
        } else {
            let (key, help) = (keymap::name_of(key), self.keymap.key_of(Action::Help));
            self.log.show(&format!("{key} does nothing here: {help} lists all keys"), false);
        }
    }

    /// Closes the dialog, or does what has been picked in it.
    fn follow_dialog(&mut self, reply: Reply) {
        if matches!(reply, Reply::Stays) {
            return;
        }
        let (asked, choice) = match self.dialog.take() {
            Some(Dialog::Pick(list)) => (self.deletion.take(), list.choice().cloned()),
            _ => (None, None),
        };
        match (reply, choice, asked) {
            (Reply::Accepts, Some(Choice::Act(_)), Some(files)) => self.delete(&files),
            (Reply::Accepts, Some(Choice::Act(action)), None) => self.act(action),
            _ => {}
        }
    }

    fn delete(&mut self, files: &Written) {
        self.list.clear_marks();
        if let Some(done) = self.tell(delete(files)) {
            self.log.show(&done, false);
        }
        self.look_again();
    }

    /// Handles a key while words are typed: Enter keeps them, Esc removes them.
    fn on_key_in_words(&mut self, key: KeyEvent) {
        match key.code {
            KeyCode::Enter => self.is_typing = false,
            KeyCode::Esc => (self.is_typing, self.words) = (false, Input::default()),
            KeyCode::Up => self.list.step(-1),
            KeyCode::Down => self.list.step(1),
            _ => drop(self.words.handle_event(&Event::Key(key))),
        }
        self.list.filter(self.words.value());
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::Move(_, rows) => self.list.step(rows),
            Action::Help => self.dialog = Some(lists::help_of_lists(&self.keymap).into()),
            Action::Close => self.close_top(),
            Action::Redraw => self.terminal_request = Some(TerminalRequest::Redraw),
            Action::Suspend => self.terminal_request = Some(TerminalRequest::Suspend),
            Action::Quit => self.quits = true,
            Action::List(action) => self.act_on_list(action),
            _ => {}
        }
    }

    fn act_on_list(&mut self, action: ListAction) {
        let (measure, axis) = self.curves;
        match action {
            ListAction::Select(row) => self.list.select(row),
            ListAction::Page(pages) => {
                let rows = isize::try_from(self.places.layout.rows.0.height).unwrap_or(1).max(1);
                self.list.step(pages * rows);
            }
            ListAction::Mark if self.list.toggle_mark() => {}
            ListAction::Mark => self.log.show("all letters are taken: unmark a run first", true),
            ListAction::Filter => self.is_typing = true,
            ListAction::Sort(forth) => {
                let by = if forth { 1 } else { COLUMNS.len() - 1 };
                self.list.sort_by((self.list.order.0 + by) % COLUMNS.len());
            }
            ListAction::Reverse => self.list.sort_by(self.list.order.0),
            ListAction::Measure => self.curves.0 = measure.next(),
            ListAction::Axis => self.curves.1 = axis.next(),
            ListAction::Open => {
                let alone = self.list.selected().filter(|_| self.list.pair().is_none());
                let records = alone.map(|run| run.source.clone());
                records.into_iter().for_each(|records| self.await_save(records));
                if self.wish.is_none() && self.awaited.is_none() {
                    self.wish = self.tell(self.list.to_open());
                }
            }
            ListAction::Delete => {
                let asked = self.tell(self.list.to_delete());
                (self.dialog, self.deletion) =
                    asked.map(|(question, files)| (question.into(), files)).unzip();
            }
        }
    }

    /// Opens nothing any more, or else shows all runs, or else unmarks them.
    fn close_top(&mut self) {
        // The thread of what is being opened ends by itself.
        if self.opening.take().is_some() || self.awaited.take().is_some() {
            return self.log.dismiss();
        }
        if self.words.value().is_empty() {
            self.list.clear_marks();
        }
        self.words.reset();
        self.list.filter("");
    }

    /// A click selects a run, marks or unmarks the selected one, or sorts by a column.
    fn on_mouse(&mut self, mouse: MouseEvent) {
        let at = Position::new(mouse.column, mouse.row);
        if let Some(dialog) = &mut self.dialog {
            let reply = dialog.mouse(mouse.kind, at, &self.places.layout);
            return self.follow_dialog(reply);
        }
        match mouse.kind {
            MouseEventKind::ScrollUp => self.list.step(-WHEEL),
            MouseEventKind::ScrollDown => self.list.step(WHEEL),
            MouseEventKind::Down(MouseButton::Left) => self.on_click(at),
            _ => {}
        }
    }

    fn on_click(&mut self, at: Position) {
        self.log.take();
        if let Some(Click::Act(action)) = self.places.layout.click(at) {
            return self.act(action);
        }
        if let Some((_, column)) = self.places.columns.iter().find(|(area, _)| area.contains(at)) {
            return self.list.sort_by(*column);
        }
        let (rows, first) = self.places.layout.rows;
        let row = first + usize::from(at.y.saturating_sub(rows.y));
        if !rows.contains(at) || row >= self.list.shown().len() {
            return;
        }
        if row == self.list.position() {
            self.list.toggle_mark();
        }
        self.list.select(row);
    }

    /// Opens what the user wishes, on a thread of its own; returns whether the screen changes.
    fn follow_opening(&mut self) -> bool {
        if let Some(wish) = self.wish.take() {
            let other = wish.beside.as_ref().map(|other| format!(" and {}", name(other)));
            let what = format!("opening {}{}", name(&wish.file), other.unwrap_or_default());
            let opener = self.opener.clone();
            let open = move |progress: &Job| opener(wish, progress);
            let opening = Running::start("opening", Job::new(what), open);
            opening.wait(PATIENCE);
            self.opening = Some(opening);
        }
        let Some(opening) = self.opening.take_if(|opening| opening.is_finished()) else {
            let notice = self.opening.as_mut().and_then(Running::notice);
            notice.iter().for_each(|notice| self.log.show(notice, false));
            return notice.is_some();
        };
        match opening.finish().unwrap_or_else(|failure| Err(miette!("{failure}"))) {
            Ok(opened) => self.opened = Some(opened),
            Err(problem) => self.log.show(&problem.to_string(), true),
        }
        true
    }
}

impl Interface for RunsScreen {
    async fn update(&mut self) {
        if self.found.changed().await.is_err() {
            // The thread has ended: nothing new will come.
            return std::future::pending().await;
        }
        let found = self.found.borrow_and_update().clone();
        self.list(&found);
    }

    fn on_event(&mut self, event: &Event) {
        match event {
            Event::Key(key) if !key.is_release() => self.on_key(*key),
            Event::Mouse(mouse) => self.on_mouse(*mouse),
            Event::Paste(text) if self.dialog.is_some() => {
                self.dialog.iter_mut().for_each(|dialog| dialog.paste(text));
            }
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
        self.follow_opening() | self.log.on_tick()
    }

    fn take_terminal_request(&mut self) -> Option<TerminalRequest> {
        self.terminal_request.take()
    }

    fn is_done(&self) -> bool {
        self.quits || self.opened.is_some()
    }

    fn draw(&mut self, frame: &mut Frame) {
        self.places = list_view::draw(frame, self);
    }

    fn report(&mut self, problem: &str) {
        self.log.show(problem, true);
    }
}
