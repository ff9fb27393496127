//! The terminal: set up at the start, and always restored.

use std::cell::{Cell, RefCell};
use std::io::Write;
use std::rc::Rc;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossterm::event::{
    DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture, Event,
};
use crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen,
    LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use crossterm::{cursor, queue};
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{TerminalOptions, Viewport};

use super::graphics::patches::Patches;
use super::graphics::query::{self, Answer};
use super::graphics::{self, Graphics, Protocol, Redraw, encode};
use super::input::{Input, InputStream};
use super::interface::Interface;
use super::job_control::{self, is_in_foreground, is_raw};
use super::record::{LARGEST_SCREEN, Recorder};
use crate::tui::marker::Marker;
use gdg::printing;

/// Timeout of the capability query, before the first frame and again before the terminal is
/// restored: a late answer would appear at the shell's prompt.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(250);

/// Events before the first frame; the rest follows after it.
const MAX_EVENTS_BEFORE: usize = 1000;

/// A terminal in raw mode on its alternate screen; dropping it restores the previous state.
pub struct Terminal {
    inner: ratatui::Terminal<CrosstermBackend<Output>>,
    size: (u16, u16),
    input: InputStream,
    recorder: Option<Recorder>,
    /// The answer to the capability query, if it was sent.
    answer: Option<Answer>,
    graphics: Option<Graphics>,
    /// The pictures on the screen, if it shows any.
    patches: Option<Patches>,
    /// How long the latest pictures took to draw, and whether training ran, until they are written.
    pictures_sent: Option<(Duration, bool)>,
    output: Output,
    /// Whether to set it up again once this program is in the foreground.
    is_given_back: bool,
}

/// Buffers output, until it is closed.
#[derive(Clone, Default)]
pub struct Output {
    bytes: Rc<RefCell<Vec<u8>>>,
    /// Whether all further output is discarded.
    closed: Rc<Cell<bool>>,
    /// Whether the text cursor has been shown: pictures must not move it, and ratatui does not
    /// expose it.
    shows_cursor: Rc<Cell<bool>>,
}

/// Shows and hides the text cursor.
const SHOW_CURSOR: &[u8] = b"\x1b[?25h";
const HIDE_CURSOR: &[u8] = b"\x1b[?25l";

/// Saves and restores its position.
const SAVE_CURSOR: &[u8] = b"\x1b7";
const RESTORE_CURSOR: &[u8] = b"\x1b8";

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if [SHOW_CURSOR, HIDE_CURSOR].contains(&bytes) {
            self.shows_cursor.set(bytes == SHOW_CURSOR);
        }
        if !self.closed.get() {
            self.bytes.borrow_mut().extend(bytes);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Terminal {
    /// Sets up the terminal, and records it if `recorder` is given. A panic restores it before
    /// printing its message. Queries its graphics capabilities unless `marker` makes that pointless
    /// or it is recorded: recordings contain only characters.
    ///
    /// # Errors
    /// Errors of the terminal, which is restored in that case too.
    pub fn enter(recorder: Option<Recorder>, marker: Marker) -> std::io::Result<Self> {
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |info| {
                // When another thread panics, the interface keeps running and reports it.
                if std::thread::current().name() == Some("main") {
                    restore();
                }
                before(info);
            }));
        });
        let asks = recorder.is_none()
            && graphics::is_worth_asking(marker, |name| std::env::var(name).ok());
        let output = Output::default();
        let enter = || {
            set_up_modes()?;
            if asks {
                printing::stdout().send(query::QUESTIONS)?;
            }
            Ok((screen(&output)?, InputStream::start()?))
        };
        match enter() {
            Ok((inner, input)) => {
                gdg::faults::show_in_interface(true);
                Ok(Self {
                    inner,
                    size: (0, 0),
                    input,
                    recorder,
                    answer: asks.then(Answer::default),
                    graphics: None,
                    patches: None,
                    pictures_sent: None,
                    output,
                    is_given_back: false,
                })
            }
            Err(error) => {
                restore();
                Err(error)
            }
        }
    }

    /// Waits for the next event of the user. Nothing is lost if the future is dropped.
    ///
    /// # Errors
    /// The terminal is gone.
    pub async fn next_event(&mut self) -> std::io::Result<Event> {
        loop {
            match self.input.next().await? {
                Input::Event(event) => return Ok(event),
                Input::Reply(reply) => self.take_reply(&reply),
            }
        }
    }

    /// Handles a reply of the terminal, and shows pictures from then on if it supports them.
    fn take_reply(&mut self, reply: &[u8]) {
        let Some(answer) = &mut self.answer else { return };
        answer.take(reply);
        if answer.is_complete && self.graphics.is_none() {
            self.graphics = choose(answer);
            if let Some(graphics) = self.graphics {
                log::info!("the terminal shows pictures: {graphics:?}");
                self.patches = Some(Patches::new(graphics.protocol));
            }
        }
    }

    /// Makes way for another interface, which is drawn from scratch: keys pressed before are
    /// discarded.
    pub fn hand_over(&mut self) {
        while let Some(input) = self.input.read_already() {
            if let Input::Reply(reply) = input {
                self.take_reply(&reply);
            }
        }
        // It has had its time.
        self.answer = None;
        self.size = (0, 0);
        if !ON_SCREEN.load(Ordering::Relaxed) {
            self.reopen();
        }
    }

    /// Waits briefly for the answer to the capability query; returns the user's events meanwhile.
    pub async fn answered(&mut self) -> Vec<Event> {
        let mut events = Vec::new();
        let end = tokio::time::Instant::now() + ANSWER_TIMEOUT;
        while self.answer.as_ref().is_some_and(|answer| !answer.is_complete)
            && events.len() < MAX_EVENTS_BEFORE
        {
            match tokio::time::timeout_at(end, self.input.next()).await {
                Ok(Ok(Input::Event(event))) => events.push(event),
                Ok(Ok(Input::Reply(reply))) => self.take_reply(&reply),
                Ok(Err(_)) | Err(_) => break,
            }
        }
        events
    }

    /// Handles user input: the next frame updates all pictures and is recorded.
    pub fn expect_answer(&mut self) {
        self.patches.iter_mut().for_each(Patches::wake);
        self.recorder.iter_mut().for_each(Recorder::expect_answer);
    }

    /// Returns whether the pictures on the screen are out of date, as the terminal could not keep
    /// up.
    pub fn is_behind(&self) -> bool {
        self.patches.as_ref().is_some_and(Patches::is_behind)
    }

    /// Draws one frame, shown all at once if the terminal supports it; returns whether it has. It
    /// has not if the terminal has not read the previous one, or is the shell's while this program
    /// runs in the background.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn draw(&mut self, interface: &mut impl Interface) -> std::io::Result<bool> {
        let writer = printing::stdout();
        if writer.is_behind() || !is_in_foreground(std::io::stdout()) {
            return Ok(false);
        }
        if std::mem::take(&mut self.is_given_back) {
            self.open_again()?;
        }
        let (columns, rows) = crossterm::terminal::size()?;
        // On a larger terminal the rest stays empty.
        let size = (columns.min(LARGEST_SCREEN.0), rows.min(LARGEST_SCREEN.1));
        if std::mem::replace(&mut self.size, size) != size {
            self.clear_pictures();
            self.inner.resize(Rect::new(0, 0, size.0, size.1))?;
        }
        if let Some(graphics) = &mut self.graphics {
            // The user may have chosen another font.
            graphics.character = character_size().unwrap_or(graphics.character);
        }
        let is_training = interface.is_training();
        if let (Some(patches), Some((took, training)), Some((end, sending))) =
            (&mut self.patches, self.pictures_sent.take(), writer.latest())
        {
            patches.rest(end, took + sending, training);
        }
        let redraw =
            self.patches.as_ref().map_or(Redraw::All, |patches| patches.redraw(is_training));
        interface.set_graphics(self.graphics, redraw);
        queue!(self.output, BeginSynchronizedUpdate)?;
        self.draw_within_update(interface)?;
        queue!(self.output, EndSynchronizedUpdate)?;
        writer.send(&self.output.bytes.take())?;
        Ok(true)
    }

    fn draw_within_update(&mut self, interface: &mut impl Interface) -> std::io::Result<()> {
        let began = Instant::now();
        let frame = self.inner.draw(|frame| interface.draw(frame))?;
        if let Some(recorder) = &mut self.recorder
            && let Err(error) = recorder.frame(frame.buffer)
        {
            let problem =
                format!("the recording has stopped: {}: {error}", recorder.path().display());
            self.recorder = None;
            interface.report(&problem);
        }
        let (Some(patches), Some(graphics)) = (&mut self.patches, self.graphics) else {
            return Ok(());
        };
        let bytes = patches.update(&interface.pictures(), frame.buffer, graphics)?;
        if !bytes.is_empty() {
            if graphics.protocol == Protocol::Kitty {
                SHOWS_KITTY_PICTURES.store(true, Ordering::Relaxed);
            }
            // Hide the cursor meanwhile, and put it back.
            let cursor = if self.output.shows_cursor.get() { SHOW_CURSOR } else { b"" };
            let mut out = self.output.bytes.borrow_mut();
            [HIDE_CURSOR, SAVE_CURSOR, &bytes, RESTORE_CURSOR, cursor]
                .iter()
                .for_each(|part| out.extend(*part));
            self.pictures_sent = Some((began.elapsed(), interface.is_training()));
        }
        Ok(())
    }

    /// Deletes all pictures, before the screen is cleared.
    fn clear_pictures(&mut self) {
        if let Some(patches) = &mut self.patches {
            self.output.bytes.borrow_mut().extend(patches.clear());
        }
    }

    /// Restores the terminal and stops this program until it is resumed. Returns whether it did: it
    /// does not stop where nothing would resume it.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub async fn suspend(&mut self) -> std::io::Result<bool> {
        if !job_control::is_resumable() {
            return Ok(false);
        }
        self.answered().await;
        // What is typed as soon as the shell's screen is back is meant for the shell.
        self.input.pause(true);
        restore();
        let stopped = job_control::stop();
        self.input.pause(false);
        stopped?;
        self.reopen();
        Ok(true)
    }

    /// Requests that the next frame sets the terminal up again and redraws everything.
    pub fn reopen(&mut self) {
        self.is_given_back = true;
    }

    /// Sets the terminal up again.
    fn open_again(&mut self) -> std::io::Result<()> {
        // crossterm skips modes that it believes to be set.
        let _ = disable_raw_mode();
        set_up_modes()?;
        // A new instance knows nothing of the old screen, so it redraws everything without querying
        // the terminal.
        self.output.closed.set(true);
        self.output =
            Output { shows_cursor: self.output.shows_cursor.clone(), ..Output::default() };
        self.inner = screen(&self.output)?;
        self.patches.iter_mut().for_each(Patches::forget);
        self.size = (0, 0);
        Ok(())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        if !give_back() {
            // Nothing waits for it any more.
            printing::hurry();
        }
        gdg::faults::show_in_interface(false);
        // Everything is restored: discard what ratatui would still write.
        self.output.closed.set(true);
    }
}

/// Returns an empty screen.
fn screen(output: &Output) -> std::io::Result<ratatui::Terminal<CrosstermBackend<Output>>> {
    let backend = CrosstermBackend::new(output.clone());
    // Its size is set before each frame.
    ratatui::Terminal::with_options(
        backend,
        TerminalOptions { viewport: Viewport::Fixed(Rect::default()) },
    )
}

/// Sets the modes of the terminal and its driver.
fn set_up_modes() -> std::io::Result<()> {
    enable_raw_mode()?;
    let mut bytes = Vec::new();
    queue!(bytes, EnterAlternateScreen, EnableMouseCapture, EnableBracketedPaste, cursor::Hide)?;
    ON_SCREEN.store(true, Ordering::Relaxed);
    printing::stdout().send(&bytes)
}

/// Whether the program is on its own screen. It is left only once: leaving it again would restore
/// the cursor's position, over later output.
static ON_SCREEN: AtomicBool = AtomicBool::new(false);

/// Restores the terminal. Ignores errors, which cannot be reported any more.
pub fn restore() {
    give_back();
}

/// Restores the terminal; returns whether it has read all of the output.
fn give_back() -> bool {
    let leaves = ON_SCREEN.swap(false, Ordering::Relaxed);
    // First, as what is typed on the shell's screen is a line of the shell's. A shell in the foreground
    // sets its own modes.
    if is_in_foreground(std::io::stdout()) || is_raw(std::io::stdout()) {
        let _ = disable_raw_mode();
    }
    let bytes =
        if leaves { leaving(SHOWS_KITTY_PICTURES.load(Ordering::Relaxed)) } else { Vec::new() };
    printing::stdout().send(&bytes).is_ok() && printing::stdout().flush_briefly()
}

/// Whether kitty pictures have been sent, which stay when the text is cleared.
static SHOWS_KITTY_PICTURES: AtomicBool = AtomicBool::new(false);

/// Chooses how to send pictures to the terminal, if it shows them.
fn choose(answer: &Answer) -> Option<Graphics> {
    let name = ["TERM_PROGRAM", "LC_TERMINAL"]
        .map(|name| std::env::var(name).unwrap_or_default())
        .concat();
    Graphics::choose(answer, &name, character_size())
}

/// Returns the size of a character in pixels, if the terminal's driver knows it.
fn character_size() -> Option<(u16, u16)> {
    let size = crossterm::terminal::window_size().ok()?;
    let of =
        |pixels: u16, characters: u16| pixels.checked_div(characters).filter(|pixels| *pixels > 0);
    Some((of(size.width, size.columns)?, of(size.height, size.rows)?))
}

/// Returns the bytes that restore everything except the driver's modes. `pictures` deletes kitty's;
/// others vanish with the screen.
fn leaving(pictures: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail.
    if pictures {
        bytes.extend(encode::DELETE_ALL);
        let _ = queue!(bytes, Clear(ClearType::All));
    }
    let _ = queue!(
        bytes,
        EndSynchronizedUpdate,
        DisableBracketedPaste,
        DisableMouseCapture,
        LeaveAlternateScreen,
        cursor::Show
    );
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_deleted_before_the_screen_is_left() {
        let text = String::from_utf8(leaving(true)).expect("text");
        let (deleted, left) = (text.find("\x1b_Ga=d,d=A"), text.find("\x1b[?1049l"));
        assert!(deleted == Some(0) && left.is_some() && text.contains("\x1b[2J"), "{text:?}");
        assert!(!String::from_utf8(leaving(false)).expect("text").contains("\x1b_G"));
    }
}
