//! The terminal itself: taken over at the start and given back as it was found, whatever happens.

use std::cell::RefCell;
use std::io::{Stdout, Write, stdout};
use std::rc::Rc;
use std::sync::Once;

use crossterm::event::{DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture};
use crossterm::terminal::{
    BeginSynchronizedUpdate, EndSynchronizedUpdate, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode,
    enable_raw_mode,
};
use crossterm::{cursor, execute};
use ratatui::Frame;
use ratatui::backend::CrosstermBackend;

use super::record::Recorder;

/// A terminal in raw mode on its alternate screen; dropping it restores what was there.
pub struct Terminal {
    inner: ratatui::Terminal<CrosstermBackend<Output>>,
    size: (u16, u16),
    recorder: Option<Rc<RefCell<Recorder>>>,
}

/// Standard output, and a recording of what goes there.
pub struct Output {
    terminal: Stdout,
    recorder: Option<Rc<RefCell<Recorder>>>,
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = self.terminal.write(bytes)?;
        if let Some(recorder) = &self.recorder {
            recorder.borrow_mut().add(&bytes[..written]);
        }
        Ok(written)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.terminal.flush()?;
        // A frame is over: in a recording it comes all at once.
        self.recorder.as_ref().map_or(Ok(()), |recorder| recorder.borrow_mut().end_frame())
    }
}

impl Terminal {
    /// Takes the terminal over, and records it if that is wanted. A panic gives it back before its message is printed.
    ///
    /// # Errors
    /// What the terminal reports; it is given back then too.
    pub fn enter(recorder: Option<Recorder>) -> std::io::Result<Self> {
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |info| {
                restore();
                before(info);
            }));
        });
        let recorder = recorder.map(|recorder| Rc::new(RefCell::new(recorder)));
        let enter = || {
            take_over()?;
            screen(recorder.clone())
        };
        match enter() {
            Ok(inner) => Ok(Self { inner, size: (0, 0), recorder }),
            Err(error) => {
                restore();
                Err(error)
            }
        }
    }

    /// Draws one frame, shown all at once where the terminal can do that.
    ///
    /// # Errors
    /// What the terminal reports.
    pub fn draw(&mut self, render: impl FnOnce(&mut Frame)) -> std::io::Result<()> {
        execute!(stdout(), BeginSynchronizedUpdate)?;
        let drawn = self.inner.draw(render).map(|frame| frame.area.as_size());
        execute!(stdout(), EndSynchronizedUpdate)?;
        let size = drawn.map(|size| (size.width, size.height))?;
        if std::mem::replace(&mut self.size, size) != size
            && let Some(recorder) = &self.recorder
        {
            recorder.borrow_mut().resize(size)?;
        }
        Ok(())
    }

    /// Gives the terminal back, stops this program until it is told to go on, and takes the terminal over again.
    ///
    /// # Errors
    /// What the terminal reports.
    pub fn suspend(&mut self) -> std::io::Result<()> {
        restore();
        #[cfg(unix)]
        signal_hook::low_level::emulate_default_handler(signal_hook::consts::SIGTSTP)?;
        take_over()?;
        // A new one knows nothing of what was on the screen and draws everything anew, without asking the terminal.
        self.inner = screen(self.recorder.clone())?;
        Ok(())
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        restore();
    }
}

fn screen(recorder: Option<Rc<RefCell<Recorder>>>) -> std::io::Result<ratatui::Terminal<CrosstermBackend<Output>>> {
    ratatui::Terminal::new(CrosstermBackend::new(Output { terminal: stdout(), recorder }))
}

fn take_over() -> std::io::Result<()> {
    enable_raw_mode()?;
    execute!(stdout(), EnterAlternateScreen, EnableMouseCapture, EnableBracketedPaste, cursor::Hide)
}

/// Undoes what [`take_over`] does; failures have nobody left to be told to.
fn restore() {
    let _ = execute!(
        stdout(),
        EndSynchronizedUpdate,
        DisableBracketedPaste,
        DisableMouseCapture,
        LeaveAlternateScreen,
        cursor::Show
    );
    let _ = disable_raw_mode();
}
