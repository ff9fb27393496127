//! The interface as the event loop and the terminal see it.

use crossterm::event::Event;
use miette::Report;
use ratatui::Frame;

use super::graphics::{Graphics, Redraw, TerminalPicture};

/// A request to the terminal by the interface or by another process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TerminalRequest {
    /// Give the terminal back and stop the program until it is resumed.
    Suspend,
    Redraw,
    /// Draw in the new size.
    Resize,
}

/// An interface that fills the screen: the trainer, a comparison, or a list of runs.
pub trait Interface {
    /// Waits for the next snapshot or view, and shows it. Nothing is lost if the future is dropped.
    async fn update(&mut self);

    fn on_event(&mut self, event: &Event);

    /// Handles the passing of time; returns whether the screen changes.
    fn on_tick(&mut self) -> bool;

    /// Returns what the terminal is to do, and clears the request.
    fn take_terminal_request(&mut self) -> Option<TerminalRequest>;

    fn is_training(&self) -> bool {
        false
    }

    fn is_done(&self) -> bool;

    /// Sets the terminal's graphics, and how much of the pictures the next frame redraws.
    fn set_graphics(&mut self, _graphics: Option<Graphics>, _redraw: Redraw) {}

    fn draw(&mut self, frame: &mut Frame);

    fn report(&mut self, problem: &str);

    fn pictures(&self) -> Vec<&TerminalPicture> {
        Vec::new()
    }

    /// Handles a signal, or an internal error, that ends the program.
    fn on_signal(&mut self) {}
}

/// What remains of a run after the interface is closed.
pub struct ClosedRun {
    /// The text left on the terminal.
    pub summary: String,
    /// The part of it about files: what is saved, and what is not.
    pub files: String,
    /// Result of the final save, if one was requested.
    pub saved: Result<(), Report>,
    /// Whether there was an internal error or training failed.
    pub failed: bool,
}

impl Default for ClosedRun {
    /// Nothing was to be saved, and nothing has failed.
    fn default() -> Self {
        Self { summary: String::new(), files: String::new(), saved: Ok(()), failed: false }
    }
}
