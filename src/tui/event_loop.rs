//! The event loop: forwards events, draws frames, and restores the terminal at the end.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use crossterm::event::{Event, MouseEvent, MouseEventKind};
use miette::{IntoDiagnostic, Report};
use tokio::runtime::Runtime;

use super::interface::{ClosedRun, Interface, TerminalRequest};
use super::record::Recorder;
use super::terminal::Terminal;
use crate::host::signals::TerminationSignal;
use crate::tui::marker::Marker;
use gdg::printing;
use gdg::text::sanitized_lines;

/// Minimum time between frames: after user input (`INPUT_FRAME_INTERVAL`), and after any other
/// change (`FRAME_INTERVAL`).
pub const INPUT_FRAME_INTERVAL: Duration = Duration::from_millis(16);
const FRAME_INTERVAL: Duration = Duration::from_millis(66);

/// Polling interval for signals and expiring notices.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// `FRAME_INTERVAL` while training is not running and only the walking agent moves: an idle program
/// should use little CPU.
const IDLE_FRAME_INTERVAL: Duration = Duration::from_millis(130);

/// Where interfaces are shown, one after the other: the terminal is set up for the first one and
/// restored after the last, when the stage is dropped.
pub struct Stage {
    marker: Marker,
    /// For the terminal, once it is set up.
    recorder: Option<Recorder>,
    termination: TerminationSignal,
    open: Option<Open>,
    /// The texts left on the terminal.
    summaries: String,
}

/// A terminal that is set up.
struct Open {
    runtime: Runtime,
    job_control: JobControl,
    terminal: Terminal,
}

impl Stage {
    /// Creates a stage, which `recorder` records.
    pub fn new(recorder: Option<Recorder>, marker: Marker, termination: TerminationSignal) -> Self {
        Self { marker, recorder, termination, open: None, summaries: String::new() }
    }

    /// Shows `interface` until the user or a signal ends it, lets `close` end training, and returns
    /// the exit status with what is said about files.
    ///
    /// # Errors
    /// Errors of the terminal, of training or of saving.
    pub fn show<I: Interface>(
        &mut self,
        mut interface: I,
        close: impl FnOnce(I) -> ClosedRun,
    ) -> Result<(u8, String), Report> {
        let Open { runtime, job_control, terminal } = match &mut self.open {
            Some(open) => {
                open.terminal.hand_over();
                open
            }
            none => none.insert(Open::new(self.recorder.take(), self.marker)?),
        };
        let draw = || {
            runtime.block_on(event_loop(&mut interface, terminal, job_control, &self.termination))
        };
        let shown = catch_unwind(AssertUnwindSafe(draw));
        let is_over = self.termination.number().is_some() || !matches!(shown, Ok(Ok(())));
        if is_over {
            interface.on_signal();
        }
        // First, since writing to a terminal that is gone may block.
        let closed = close(interface);
        if !closed.summary.is_empty() {
            self.summaries += &format!("{}\n", sanitized_lines(&closed.summary));
        }
        if is_over {
            self.leave();
        }
        closed.saved?;
        if let Some(status) = self.termination.status() {
            return Ok((status, closed.files));
        }
        match shown {
            Err(_) => Err(miette::miette!(
                help = crate::host::logging::hint(),
                "an internal error ended the interface"
            )),
            Ok(shown) => shown.into_diagnostic().map(|()| (u8::from(closed.failed), closed.files)),
        }
    }

    /// Restores the terminal, and leaves the texts on it.
    fn leave(&mut self) {
        if let Some(Open { runtime, mut terminal, .. }) = self.open.take() {
            // Keys typed meanwhile are discarded.
            let _ = runtime.block_on(terminal.answered());
        }
        let _ = printing::stdout().print(std::mem::take(&mut self.summaries).as_bytes());
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.leave();
    }
}

impl Open {
    fn new(recorder: Option<Recorder>, marker: Marker) -> Result<Self, Report> {
        let runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = { runtime }.enable_all().build().into_diagnostic()?;
        // Before the terminal's modes change: the signal's default action would stop the program
        // without restoring them.
        let job_control = {
            let _context = runtime.enter();
            JobControl::listen().into_diagnostic()?
        };
        let terminal = Terminal::enter(recorder, marker).into_diagnostic()?;
        Ok(Self { runtime, job_control, terminal })
    }
}

/// Handles events and draws frames until the user or a signal ends the loop.
async fn event_loop(
    app: &mut impl Interface,
    terminal: &mut Terminal,
    job_control: &mut JobControl,
    termination: &TerminationSignal,
) -> std::io::Result<()> {
    let mut timer = FrameTimer { immediate: true, ..FrameTimer::default() };
    terminal.answered().await.iter().for_each(|event| app.on_event(event));
    while !app.is_done() && termination.number().is_none() {
        let mut request = None;
        tokio::select! {
            event = terminal.next_event() => {
                let event = event?;
                app.on_event(&event);
                timer.immediate = true;
                if !is_hovering(&event) {
                    terminal.expect_answer();
                }
            }
            () = app.update() => timer.changed = true,
            signalled = job_control.next() => request = Some(signalled),
            () = tokio::time::sleep(timer.until_due()) => {}
        }
        if let Some(request) = request.or(app.take_terminal_request()) {
            meet(request, app, terminal).await?;
            timer.immediate = true;
        }
        timer.changed |= app.on_tick();
        timer.idle = !app.is_training();
        if timer.is_due() {
            gdg::faults::point("interface");
            // A slow terminal gets fewer frames, and the shell's terminal none; skipped frames are
            // due again.
            if terminal.draw(app)? {
                timer.drawn(terminal.is_behind());
            }
        }
    }
    Ok(())
}

/// Handles a request to the terminal.
async fn meet(
    request: TerminalRequest,
    app: &mut impl Interface,
    terminal: &mut Terminal,
) -> std::io::Result<()> {
    match request {
        TerminalRequest::Suspend => {
            if !terminal.suspend().await? {
                app.report("not suspended: no shell is waiting that could resume the program");
            }
        }
        TerminalRequest::Redraw => terminal.reopen(),
        TerminalRequest::Resize => {}
    }
    Ok(())
}

/// Returns whether an event is the mouse moving without a button.
fn is_hovering(event: &Event) -> bool {
    matches!(event, Event::Mouse(MouseEvent { kind: MouseEventKind::Moved, .. }))
}

/// Signals of the terminal: a request to stop from another process (SIGTSTP), a resumption after a
/// stop that the program could not prepare for (SIGCONT), and a resize (SIGWINCH).
struct JobControl {
    #[cfg(unix)]
    stop: tokio::signal::unix::Signal,
    #[cfg(unix)]
    continued: tokio::signal::unix::Signal,
    #[cfg(unix)]
    resized: tokio::signal::unix::Signal,
}

impl JobControl {
    #[cfg(unix)]
    fn listen() -> std::io::Result<Self> {
        use signal_hook::consts::{SIGCONT, SIGTSTP, SIGWINCH};
        use tokio::signal::unix::{SignalKind, signal};

        let listen = |number| signal(SignalKind::from_raw(number));
        Ok(Self { stop: listen(SIGTSTP)?, continued: listen(SIGCONT)?, resized: listen(SIGWINCH)? })
    }

    #[cfg(not(unix))]
    fn listen() -> std::io::Result<Self> {
        Ok(Self {})
    }

    /// Waits for the next signal; returns what it asks for.
    #[cfg(unix)]
    async fn next(&mut self) -> TerminalRequest {
        tokio::select! {
            Some(()) = self.stop.recv() => TerminalRequest::Suspend,
            Some(()) = self.continued.recv() => TerminalRequest::Redraw,
            Some(()) = self.resized.recv() => TerminalRequest::Resize,
            else => std::future::pending().await,
        }
    }

    #[cfg(not(unix))]
    async fn next(&mut self) -> TerminalRequest {
        std::future::pending().await
    }
}

/// Decides when to draw: at once after user input, less often for other changes.
#[derive(Default)]
pub struct FrameTimer {
    /// A frame is needed at once, as after user input.
    immediate: bool,
    /// What is shown has changed.
    pub changed: bool,
    /// Training is not running.
    idle: bool,
    /// When a frame was last due, whether or not it could be drawn.
    last_due: Option<Instant>,
}

impl FrameTimer {
    /// Returns the time until the next frame or poll.
    fn until_due(&self) -> Duration {
        let interval = match self {
            Self { immediate: true, .. } => INPUT_FRAME_INTERVAL,
            Self { changed: true, idle: false, .. } => FRAME_INTERVAL,
            Self { changed: true, idle: true, .. } => IDLE_FRAME_INTERVAL,
            _ => return POLL_INTERVAL,
        };
        self.last_due.map_or(Duration::ZERO, |at| interval.saturating_sub(at.elapsed()))
    }

    /// Returns whether a frame is due. One that is not drawn is due again after the same time.
    pub fn is_due(&mut self) -> bool {
        let due = (self.immediate || self.changed) && self.until_due().is_zero();
        if due {
            self.last_due = Some(Instant::now());
        }
        due
    }

    /// Counts a frame as drawn, which may be `behind`: then another follows.
    pub fn drawn(&mut self, behind: bool) {
        (self.immediate, self.changed) = (false, behind);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_that_could_not_be_drawn_stays_due_after_its_interval() {
        let mut timer = FrameTimer { immediate: true, ..FrameTimer::default() };
        assert!(timer.is_due());
        assert!(
            !timer.is_due() && timer.until_due() <= INPUT_FRAME_INTERVAL,
            "not drawn: soon again, but not at once"
        );
        std::thread::sleep(INPUT_FRAME_INTERVAL);
        assert!(timer.is_due());
        timer.drawn(true);
        assert!(!timer.immediate && timer.changed, "what was left out of it follows");
        timer.drawn(false);
        assert!(!timer.is_due() && timer.until_due() > FRAME_INTERVAL, "nothing to draw");
    }
}
