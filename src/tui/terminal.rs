//! The terminal: set up at the start, and always restored.

mod guard;

use std::cell::Cell;
use std::io::{Stdout, Write, stdout};
use std::rc::Rc;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crossterm::event::{DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture, Event};
use crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen,
    disable_raw_mode, enable_raw_mode,
};
use crossterm::{cursor, execute};
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{TerminalOptions, Viewport};

use super::event_loop::Interface;
use super::graphics::patches::Patches;
use super::graphics::query::{self, Answer, LateAnswer};
use super::graphics::{self, Graphics, Protocol, Redraw, encode};
use super::raster::Marker;
use super::record::{LARGEST_SCREEN, Recorder};
use guard::Guard;
pub use guard::{GUARD_COMMAND, run_guard};

/// A terminal in raw mode on its alternate screen; dropping it restores the previous state.
pub struct Terminal {
    inner: ratatui::Terminal<CrosstermBackend<Output>>,
    size: (u16, u16),
    recorder: Option<Recorder>,
    /// What the terminal has answered, if it was asked what it can show.
    answer: Answer,
    late_answer: LateAnswer,
    graphics: Option<Graphics>,
    /// The pictures on the screen, if it shows any.
    patches: Option<Patches>,
    /// Whether all further output is discarded.
    closed: Rc<Cell<bool>>,
    shows_cursor: Rc<Cell<bool>>,
    /// Dismissed last, after everything has been restored.
    guard: Option<Guard>,
}

/// Standard output, until it is closed.
pub struct Output {
    terminal: Stdout,
    closed: Rc<Cell<bool>>,
    /// Whether the text cursor has been shown: pictures must not move it, and the library does not tell.
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
        if self.closed.get() { Ok(bytes.len()) } else { self.terminal.write(bytes) }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        if self.closed.get() { Ok(()) } else { self.terminal.flush() }
    }
}

impl Terminal {
    /// Sets up the terminal, and records it if `recorder` is given. A panic restores it before printing its message. Asks
    /// it what pictures it shows, unless it is not worth it with `marker`, or is recorded: recordings are of characters.
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
        let (closed, shows_cursor, guard) = (Rc::default(), Rc::default(), Guard::start());
        let asks = recorder.is_none() && graphics::is_worth_asking(marker, |name| std::env::var(name).ok());
        let enter = || {
            set_up_modes()?;
            let answer = if asks { query::ask(&mut stdout())? } else { Answer::default() };
            Ok((screen(&closed, &shows_cursor)?, answer))
        };
        match enter() {
            Ok((inner, answer)) => {
                crate::faults::show_in_interface(true);
                let late_answer = if asks { LateAnswer::after(&answer) } else { LateAnswer::default() };
                let graphics = asks.then(|| choose(&answer)).flatten();
                if let Some(graphics) = graphics {
                    tracing::info!(?graphics, "the terminal shows pictures");
                }
                let patches = graphics.map(|graphics| Patches::new(graphics.protocol));
                let size = (0, 0);
                Ok(Self { inner, size, recorder, answer, late_answer, graphics, patches, closed, shows_cursor, guard })
            }
            Err(error) => {
                restore();
                Err(error)
            }
        }
    }

    /// Returns what the user typed while the terminal was asked what it can show.
    pub fn take_typed(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.answer).events()
    }

    /// Returns whether an event is not the user's, but a part of the terminal's answer that comes late.
    pub fn is_late_answer(&mut self, event: &Event) -> bool {
        self.late_answer.has(event)
    }

    /// Has the next frame show the pictures as they are, and be recorded: the user has done something.
    pub fn expect_answer(&mut self) {
        self.patches.iter_mut().for_each(Patches::wake);
        self.recorder.iter_mut().for_each(Recorder::expect_answer);
    }

    /// Returns whether the pictures on the screen are out of date, as the terminal could not follow.
    pub fn is_behind(&self) -> bool {
        self.patches.as_ref().is_some_and(Patches::is_behind)
    }

    /// Draws one frame, shown all at once if the terminal supports it.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn draw(&mut self, interface: &mut impl Interface) -> std::io::Result<()> {
        let (columns, rows) = crossterm::terminal::size()?;
        // On a larger terminal the rest stays empty.
        let size = (columns.min(LARGEST_SCREEN.0), rows.min(LARGEST_SCREEN.1));
        if std::mem::replace(&mut self.size, size) != size {
            self.clear_pictures()?;
            self.inner.resize(Rect::new(0, 0, size.0, size.1))?;
        }
        if let Some(graphics) = &mut self.graphics {
            // The user may have chosen another font.
            graphics.character = character_size().unwrap_or(graphics.character);
        }
        let is_training = interface.is_training();
        let redraw = self.patches.as_ref().map_or(Redraw::All, |patches| patches.redraw(is_training));
        interface.set_graphics(self.graphics, redraw);
        execute!(stdout(), BeginSynchronizedUpdate)?;
        let drawn = self.draw_within_update(interface);
        execute!(stdout(), EndSynchronizedUpdate)?;
        drawn
    }

    fn draw_within_update(&mut self, interface: &mut impl Interface) -> std::io::Result<()> {
        let began = Instant::now();
        let frame = self.inner.draw(|frame| interface.draw(frame))?;
        if let Some(recorder) = &mut self.recorder
            && let Err(error) = recorder.frame(frame.buffer)
        {
            let problem = format!("the recording has stopped: {}: {error}", recorder.path().display());
            self.recorder = None;
            interface.report(&problem);
        }
        let (Some(patches), Some(graphics)) = (&mut self.patches, self.graphics) else { return Ok(()) };
        let bytes = patches.update(&interface.pictures(), frame.buffer, graphics)?;
        if !bytes.is_empty() {
            if graphics.protocol == Protocol::Kitty {
                SHOWS_KITTY_PICTURES.store(true, Ordering::Relaxed);
                self.guard.iter_mut().for_each(Guard::expect_pictures);
            }
            let mut out = stdout().lock();
            // Hidden, and back to where it was.
            out.write_all(&[HIDE_CURSOR, SAVE_CURSOR].concat())?;
            out.write_all(&bytes)?;
            out.write_all(RESTORE_CURSOR)?;
            if self.shows_cursor.get() {
                out.write_all(SHOW_CURSOR)?;
            }
            out.flush()?;
            patches.rest(began.elapsed(), interface.is_training());
        }
        Ok(())
    }

    /// Deletes all pictures, before the screen is cleared.
    fn clear_pictures(&mut self) -> std::io::Result<()> {
        let Some(patches) = &mut self.patches else { return Ok(()) };
        stdout().write_all(patches.clear())
    }

    /// Restores the terminal, stops this program until it is resumed, and sets the terminal up again.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn suspend(&mut self) -> std::io::Result<()> {
        restore();
        #[cfg(unix)]
        signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGTSTP)?;
        self.reopen()
    }

    /// Sets the terminal up again and has the next frame draw everything, whatever is on the screen.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn reopen(&mut self) -> std::io::Result<()> {
        // The library would not set what it believes to be set.
        let _ = disable_raw_mode();
        set_up_modes()?;
        // A new instance knows nothing of the old screen, so it redraws everything without querying the terminal.
        self.closed.set(true);
        self.closed = Rc::default();
        self.inner = screen(&self.closed, &self.shows_cursor)?;
        self.patches.iter_mut().for_each(Patches::forget);
        self.size = (0, 0);
        Ok(())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        restore();
        crate::faults::show_in_interface(false);
        // Everything is restored: discard what the library would still write, as it complains if it cannot.
        self.closed.set(true);
    }
}

fn screen(
    closed: &Rc<Cell<bool>>,
    shows_cursor: &Rc<Cell<bool>>,
) -> std::io::Result<ratatui::Terminal<CrosstermBackend<Output>>> {
    let output = Output { terminal: stdout(), closed: closed.clone(), shows_cursor: shows_cursor.clone() };
    let backend = CrosstermBackend::new(output);
    // Its size is set before each frame.
    ratatui::Terminal::with_options(backend, TerminalOptions { viewport: Viewport::Fixed(Rect::default()) })
}

fn set_up_modes() -> std::io::Result<()> {
    enable_raw_mode()?;
    execute!(stdout(), EnterAlternateScreen, EnableMouseCapture, EnableBracketedPaste, cursor::Hide)
}

/// Restores the terminal. Ignores errors, which cannot be reported any more.
pub fn restore() {
    leave_screen();
    let _ = disable_raw_mode();
}

/// Whether pictures have been sent to the terminal that it keeps elsewhere than its characters.
static SHOWS_KITTY_PICTURES: AtomicBool = AtomicBool::new(false);

/// Chooses how to send pictures to the terminal, if it shows them.
fn choose(answer: &Answer) -> Option<Graphics> {
    let name = ["TERM_PROGRAM", "LC_TERMINAL"].map(|name| std::env::var(name).unwrap_or_default()).concat();
    Graphics::choose(answer, &name, character_size())
}

/// Returns the size of a character in pixels, if the terminal's driver knows it.
fn character_size() -> Option<(u16, u16)> {
    let size = crossterm::terminal::window_size().ok()?;
    let of = |pixels: u16, characters: u16| pixels.checked_div(characters).filter(|pixels| *pixels > 0);
    Some((of(size.width, size.columns)?, of(size.height, size.rows)?))
}

/// Restores everything except the terminal's modes.
fn leave_screen() {
    if SHOWS_KITTY_PICTURES.load(Ordering::Relaxed) {
        delete_pictures(&mut stdout());
    }
    let _ = execute!(
        stdout(),
        EndSynchronizedUpdate,
        DisableBracketedPaste,
        DisableMouseCapture,
        LeaveAlternateScreen,
        cursor::Show
    );
}

/// Deletes all of kitty's pictures on the program's own screen. Those of other protocols go with the screen.
fn delete_pictures(out: &mut impl Write) {
    let _ = out.write_all(encode::DELETE_ALL);
    let _ = execute!(out, Clear(ClearType::All));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_deleted_before_the_screen_is_left() {
        let mut out = Vec::new();
        delete_pictures(&mut out);
        let text = String::from_utf8(out).expect("text");
        assert!(text.starts_with("\x1b_Ga=d,d=A") && text.ends_with("\x1b[2J"), "{text:?}");
    }
}
