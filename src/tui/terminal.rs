//! The terminal: set up at the start, and always restored.

mod guard;

use std::cell::Cell;
use std::io::{Stdout, Write, stdout};
use std::rc::Rc;
use std::sync::Once;

use crossterm::event::{DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture};
use crossterm::terminal::{
    BeginSynchronizedUpdate, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode,
    enable_raw_mode,
};
use crossterm::{cursor, execute};
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{Frame, TerminalOptions, Viewport};

use super::record::{LARGEST_SCREEN, Recorder};
use guard::Guard;
pub use guard::run_guard;

/// A terminal in raw mode on its alternate screen; dropping it restores the previous state.
pub struct Terminal {
    inner: ratatui::Terminal<CrosstermBackend<Output>>,
    size: (u16, u16),
    recorder: Option<Recorder>,
    /// Whether all further output is discarded.
    closed: Rc<Cell<bool>>,
    /// Dismissed last, after everything has been restored.
    _guard: Option<Guard>,
}

/// Standard output, until it is closed.
pub struct Output {
    terminal: Stdout,
    closed: Rc<Cell<bool>>,
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        if self.closed.get() { Ok(bytes.len()) } else { self.terminal.write(bytes) }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        if self.closed.get() { Ok(()) } else { self.terminal.flush() }
    }
}

impl Terminal {
    /// Sets up the terminal, and records it if `recorder` is given. A panic restores it before printing its message.
    ///
    /// # Errors
    /// Errors of the terminal, which is restored in that case too.
    pub fn enter(recorder: Option<Recorder>) -> std::io::Result<Self> {
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
        let (closed, guard) = (Rc::new(Cell::new(false)), Guard::start());
        let enter = || {
            set_up_modes()?;
            screen(closed.clone())
        };
        match enter() {
            Ok(inner) => {
                crate::faults::show_in_interface(true);
                Ok(Self { inner, size: (0, 0), recorder, closed, _guard: guard })
            }
            Err(error) => {
                restore();
                Err(error)
            }
        }
    }

    /// Draws one frame, shown all at once if the terminal supports it.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn draw(&mut self, render: impl FnOnce(&mut Frame)) -> std::io::Result<()> {
        let (columns, rows) = crossterm::terminal::size()?;
        // On a larger terminal the rest stays empty.
        let size = (columns.min(LARGEST_SCREEN.0), rows.min(LARGEST_SCREEN.1));
        if std::mem::replace(&mut self.size, size) != size {
            self.inner.resize(Rect::new(0, 0, size.0, size.1))?;
        }
        execute!(stdout(), BeginSynchronizedUpdate)?;
        let drawn = self.inner.draw(render);
        execute!(stdout(), EndSynchronizedUpdate)?;
        let frame = drawn?;
        self.recorder.as_mut().map_or(Ok(()), |recorder| recorder.frame(frame.buffer))
    }

    /// Restores the terminal, stops this program until it is resumed, and sets the terminal up again.
    ///
    /// # Errors
    /// Errors of the terminal.
    pub fn suspend(&mut self) -> std::io::Result<()> {
        restore();
        #[cfg(unix)]
        signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGTSTP)?;
        set_up_modes()?;
        // A new instance knows nothing of the old screen, so it redraws everything without querying the terminal.
        self.closed.set(true);
        self.closed = Rc::default();
        self.inner = screen(self.closed.clone())?;
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

fn screen(closed: Rc<Cell<bool>>) -> std::io::Result<ratatui::Terminal<CrosstermBackend<Output>>> {
    let backend = CrosstermBackend::new(Output { terminal: stdout(), closed });
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

/// Restores everything except the terminal's modes.
fn leave_screen() {
    let _ = execute!(
        stdout(),
        EndSynchronizedUpdate,
        DisableBracketedPaste,
        DisableMouseCapture,
        LeaveAlternateScreen,
        cursor::Show
    );
}
