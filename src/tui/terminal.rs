//! The terminal: set up at the start and always restored, and the loop that forwards its events and
//! draws frames.

use std::cell::RefCell;
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossterm::event::{
    DisableBracketedPaste, DisableMouseCapture, EnableBracketedPaste, EnableMouseCapture, Event,
    MouseEvent, MouseEventKind,
};
use crossterm::terminal::{
    BeginSynchronizedUpdate, Clear, ClearType, EndSynchronizedUpdate, EnterAlternateScreen,
    LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use crossterm::{cursor, queue};
use miette::{IntoDiagnostic, Report};
use nix::sys::signal::{Signal, killpg};
use nix::sys::termios::{OutputFlags, tcgetattr};
use nix::unistd::{Pid, getpgid, getpgrp, getppid, getsid};
use ratatui::backend::CrosstermBackend;
use ratatui::layout::Rect;
use ratatui::{TerminalOptions, Viewport};
use tokio::runtime::Runtime;
use tokio::signal::unix::{self, SignalKind, signal};

use super::graphics::patches::{DELETE_ALL, Patches};
use super::graphics::{self, Answer, Graphics, Redraw};
use super::input::{Input, InputStream};
use super::interface::{ClosedRun, Interface, TerminalRequest};
use crate::process::signals::TerminationSignal;
use crate::process::waiting::is_in_foreground;
use crate::tui::choices::Marker;
use gdg::printing;
use gdg::text::sanitized_lines;

/// Minimum time between frames: after user input (`INPUT_FRAME_INTERVAL`), after any other change
/// (`FRAME_INTERVAL`), and while training does not run and only the walking agent moves: an idle
/// program should use little CPU.
pub const INPUT_FRAME_INTERVAL: Duration = Duration::from_millis(16);
const FRAME_INTERVAL: Duration = Duration::from_millis(66);
const IDLE_FRAME_INTERVAL: Duration = Duration::from_millis(130);

/// Polling interval for signals and expiring notices.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Timeout of the capability query, before the first frame and again before the terminal is
/// restored: a late answer would appear at the shell's prompt.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(250);

/// Columns and rows of the largest screen that is drawn, more than any real terminal has.
const LARGEST_SCREEN: (u16, u16) = (1000, 500);

/// Events before the first frame; the rest follows after it.
const MAX_EVENTS_BEFORE: usize = 1000;

/// Where interfaces are shown, one after the other: the terminal is set up for the first one and
/// restored after the last, when the stage is dropped.
pub struct TerminalStage {
    marker: Marker,
    termination: TerminationSignal,
    open: Option<(Terminal, Runtime)>,
    /// The texts left on the terminal.
    summaries: String,
}

impl TerminalStage {
    /// A panic restores the terminal before it prints its message.
    pub fn new(marker: Marker, termination: TerminationSignal) -> Self {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            // When another thread panics, the interface keeps running and reports it.
            if std::thread::current().name() == Some("main") {
                restore();
            }
            before(info);
        }));
        Self { marker, termination, open: None, summaries: String::new() }
    }

    /// Shows `interface` until the user or a signal ends it, lets `close` end training, and returns
    /// the exit status with the summary of its files.
    pub fn show<I: Interface>(
        &mut self,
        mut interface: I,
        close: impl FnOnce(I) -> ClosedRun,
    ) -> Result<(u8, String), Report> {
        let (terminal, runtime) = match &mut self.open {
            Some(open) => {
                open.0.hand_over();
                open
            }
            none => {
                let runtime = tokio::runtime::Builder::new_current_thread();
                let runtime = { runtime }.enable_all().build().into_diagnostic()?;
                let terminal = {
                    let _context = runtime.enter();
                    Terminal::enter(self.marker).into_diagnostic()?
                };
                none.insert((terminal, runtime))
            }
        };
        let draw = || runtime.block_on(event_loop(&mut interface, terminal, &self.termination));
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
                help = crate::process::logging::hint(),
                "an internal error ended the interface"
            )),
            Ok(shown) => shown.into_diagnostic().map(|()| (u8::from(closed.failed), closed.files)),
        }
    }

    /// Restores the terminal, and leaves the texts on it.
    fn leave(&mut self) {
        if let Some((mut terminal, runtime)) = self.open.take() {
            // Keys typed meanwhile are discarded.
            let _ = runtime.block_on(terminal.answered());
        }
        let _ = printing::stdout().print(std::mem::take(&mut self.summaries).as_bytes());
    }
}

impl Drop for TerminalStage {
    fn drop(&mut self) {
        self.leave();
    }
}

/// Handles events and draws frames until the user or a signal ends the loop.
async fn event_loop(
    app: &mut impl Interface,
    terminal: &mut Terminal,
    termination: &TerminationSignal,
) -> std::io::Result<()> {
    let mut timer = FrameTimer { immediate: true, ..FrameTimer::default() };
    terminal.answered().await.iter().for_each(|event| app.on_event(event));
    while !app.is_done() && termination.number().is_none() {
        let mut request = None;
        tokio::select! {
            input = terminal.input.next() => match input? {
                Input::Reply(reply) => terminal.take_reply(&reply),
                Input::Event(event) => {
                    app.on_event(&event);
                    timer.immediate = true;
                    let is_moving = |mouse: MouseEvent| mouse.kind == MouseEventKind::Moved;
                    if !event.as_mouse_event().is_some_and(is_moving) {
                        // The next frame updates all pictures.
                        terminal.patches.iter_mut().for_each(Patches::wake);
                    }
                }
            },
            Some(()) = terminal.stop.recv() => request = Some(TerminalRequest::Suspend),
            // After a stop that the program could not prepare for.
            Some(()) = terminal.continued.recv() => request = Some(TerminalRequest::Redraw),
            Some(()) = terminal.resized.recv() => request = Some(TerminalRequest::Resize),
            () = app.update() => timer.changed = true,
            () = tokio::time::sleep(timer.until_due()) => {}
        }
        if let Some(request) = request.or(app.take_terminal_request()) {
            match request {
                TerminalRequest::Suspend if !terminal.suspend().await? => {
                    app.report("not suspended: no shell is waiting that could resume the program");
                }
                TerminalRequest::Redraw => terminal.is_given_back = true,
                TerminalRequest::Suspend | TerminalRequest::Resize => {}
            }
            timer.immediate = true;
        }
        timer.changed |= app.on_tick();
        timer.idle = !app.is_training();
        if timer.is_due() {
            gdg::faults::point("interface");
            // A slow terminal, or the shell's, skips frames, which are due again.
            if terminal.draw(app)? {
                timer.drawn(terminal.patches.as_ref().is_some_and(Patches::is_behind));
            }
        }
    }
    Ok(())
}

/// Decides when to draw: at once after user input, less often for other changes.
#[derive(Default)]
pub struct FrameTimer {
    /// A frame is needed at once, as after user input.
    immediate: bool,
    pub changed: bool,
    /// Training is not running.
    idle: bool,
    /// When a frame was last due, whether or not it could be drawn.
    last_due: Option<Instant>,
}

impl FrameTimer {
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

/// A terminal in raw mode on its alternate screen; dropping it restores the previous state.
struct Terminal {
    inner: ratatui::Terminal<CrosstermBackend<FrameBytes>>,
    size: (u16, u16),
    input: InputStream,
    /// Another process's request to stop, a resumption and a new size: SIGTSTP, SIGCONT, SIGWINCH.
    stop: unix::Signal,
    continued: unix::Signal,
    resized: unix::Signal,
    /// The answer to the capability query, if it was sent.
    answer: Option<Answer>,
    graphics: Option<Graphics>,
    /// The pictures on the screen, if it shows any.
    patches: Option<Patches>,
    /// How long the latest pictures took to draw, and whether training ran, until they are written.
    pictures_sent: Option<(Duration, bool)>,
    output: FrameBytes,
    /// Whether to set it up again once this program is in the foreground.
    is_given_back: bool,
}

/// What is drawn, until it is sent.
#[derive(Clone, Default)]
struct FrameBytes(Rc<RefCell<Vec<u8>>>);

/// Saves and restores the position of the text cursor, which pictures must not move.
const SAVE_CURSOR: &[u8] = b"\x1b7";
const RESTORE_CURSOR: &[u8] = b"\x1b8";

impl Write for FrameBytes {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.borrow_mut().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Terminal {
    /// Sets up the terminal, and queries its graphics unless `marker` makes that pointless.
    fn enter(marker: Marker) -> std::io::Result<Self> {
        let asks = graphics::is_worth_asking(marker, |name| std::env::var(name).ok());
        let output = FrameBytes::default();
        let enter = || {
            // Before the terminal's modes change: the default action of a signal would stop the
            // program without restoring them.
            let listen = |number| signal(SignalKind::from_raw(number));
            let [stop, continued, resized] =
                [Signal::SIGTSTP, Signal::SIGCONT, Signal::SIGWINCH].map(|s| listen(s as i32));
            set_up_modes()?;
            if asks {
                printing::stdout().send(graphics::QUESTIONS)?;
            }
            Ok(Self {
                inner: screen(&output)?,
                size: (0, 0),
                input: InputStream::start()?,
                stop: stop?,
                continued: continued?,
                resized: resized?,
                answer: asks.then(Answer::default),
                graphics: None,
                patches: None,
                pictures_sent: None,
                output,
                is_given_back: false,
            })
        };
        let entered = enter();
        match &entered {
            Ok(_) => gdg::faults::show_in_interface(true),
            Err(_) => restore(),
        }
        entered
    }

    /// Handles a reply of the terminal, and shows pictures from then on if it supports them.
    fn take_reply(&mut self, reply: &[u8]) {
        let Some(answer) = &mut self.answer else { return };
        answer.take(reply);
        if answer.is_complete && self.graphics.is_none() {
            self.graphics = Graphics::choose(answer, character_size());
            if let Some(graphics) = self.graphics {
                log::info!("the terminal shows pictures: {graphics:?}");
                self.patches = Some(Patches::default());
            }
        }
    }

    /// Makes way for another interface, drawn from scratch: keys pressed before are discarded.
    fn hand_over(&mut self) {
        while let Some(input) = self.input.read_already() {
            if let Input::Reply(reply) = input {
                self.take_reply(&reply);
            }
        }
        // It has had its time.
        self.answer = None;
        self.size = (0, 0);
        self.is_given_back |= !ON_SCREEN.load(Ordering::Relaxed);
    }

    /// Waits briefly for the answer to the capability query; returns the user's events meanwhile.
    async fn answered(&mut self) -> Vec<Event> {
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

    /// Draws one frame, shown all at once if the terminal supports it; returns whether it has. It
    /// has not if the terminal has not read the previous one, or is the shell's while this program
    /// runs in the background.
    fn draw(&mut self, interface: &mut impl Interface) -> std::io::Result<bool> {
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
            if let Some(patches) = &mut self.patches {
                self.output.0.borrow_mut().extend(patches.clear());
            }
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
        let redraw = self.patches.as_ref().map_or(Redraw::All, |own| own.redraw(is_training));
        interface.set_graphics(self.graphics, redraw);
        queue!(self.output, BeginSynchronizedUpdate)?;
        let began = Instant::now();
        let frame = self.inner.draw(|frame| interface.draw(frame))?;
        if let (Some(patches), Some(graphics)) = (&mut self.patches, self.graphics) {
            let bytes = patches.update(&interface.pictures(), frame.buffer, graphics)?;
            if !bytes.is_empty() {
                SHOWS_KITTY_PICTURES.store(true, Ordering::Relaxed);
                let parts = [SAVE_CURSOR, &bytes, RESTORE_CURSOR];
                self.output.0.borrow_mut().extend(parts.concat());
                self.pictures_sent = Some((began.elapsed(), is_training));
            }
        }
        queue!(self.output, EndSynchronizedUpdate)?;
        writer.send(&self.output.0.take())?;
        Ok(true)
    }

    /// Restores the terminal and stops this program until it is resumed. Returns whether it did: it
    /// does not stop where nothing would resume it.
    async fn suspend(&mut self) -> std::io::Result<bool> {
        if !is_resumable() {
            return Ok(false);
        }
        self.answered().await;
        // What is typed as soon as the shell's screen is back is meant for the shell.
        self.input.pause(true);
        restore();
        // The whole group, as Ctrl-Z in cooked mode does: a shell resumes a script's processes only
        // together. SIGTSTP would be handled by this program.
        let stopped = killpg(getpgrp(), Signal::SIGSTOP);
        self.input.pause(false);
        stopped?;
        self.is_given_back = true;
        Ok(true)
    }

    fn open_again(&mut self) -> std::io::Result<()> {
        // crossterm skips modes that it believes to be set.
        let _ = disable_raw_mode();
        set_up_modes()?;
        // A new instance knows nothing of the old screen, so it redraws everything without querying
        // the terminal. What the old one would still write is discarded.
        self.output = FrameBytes::default();
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
    }
}

/// Returns an empty screen, whose size is set before each frame.
fn screen(output: &FrameBytes) -> std::io::Result<ratatui::Terminal<CrosstermBackend<FrameBytes>>> {
    let viewport = Viewport::Fixed(Rect::default());
    let backend = CrosstermBackend::new(output.clone());
    ratatui::Terminal::with_options(backend, TerminalOptions { viewport })
}

fn set_up_modes() -> std::io::Result<()> {
    enable_raw_mode()?;
    let mut bytes = Vec::new();
    queue!(bytes, EnterAlternateScreen, EnableMouseCapture, EnableBracketedPaste, cursor::Hide)?;
    ON_SCREEN.store(true, Ordering::Relaxed);
    printing::stdout().send(&bytes)
}

/// Whether the program is on its own screen, which it leaves once: again, it would move the cursor.
static ON_SCREEN: AtomicBool = AtomicBool::new(false);

/// Whether kitty pictures have been sent, which stay when the text is cleared.
static SHOWS_KITTY_PICTURES: AtomicBool = AtomicBool::new(false);

/// Restores the terminal. Ignores errors, which cannot be reported any more.
pub fn restore() {
    give_back();
}

/// Restores the terminal; returns whether it has read all of the output.
fn give_back() -> bool {
    let leaves = ON_SCREEN.swap(false, Ordering::Relaxed);
    // First, as what is typed on the shell's screen is a line of the shell's. A shell in the
    // foreground sets its own modes, and none leaves the terminal in raw mode.
    let is_raw = || {
        let modes = tcgetattr(std::io::stdout());
        modes.is_ok_and(|modes| !modes.output_flags.contains(OutputFlags::OPOST))
    };
    if is_in_foreground(std::io::stdout()) || is_raw() {
        let _ = disable_raw_mode();
    }
    let bytes =
        if leaves { leaving(SHOWS_KITTY_PICTURES.load(Ordering::Relaxed)) } else { Vec::new() };
    printing::stdout().send(&bytes).is_ok() && printing::stdout().flush_briefly()
}

/// Returns the bytes that restore everything except the driver's modes. `pictures` deletes kitty's;
/// others vanish with the screen.
fn leaving(pictures: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail.
    if pictures {
        bytes.extend(DELETE_ALL);
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

/// Returns the size of a character in pixels, if the terminal's driver knows it.
fn character_size() -> Option<(u16, u16)> {
    let size = crossterm::terminal::window_size().ok()?;
    let of = |pixels: u16, characters: u16| pixels.checked_div(characters).filter(|n| *n > 0);
    Some((of(size.width, size.columns)?, of(size.height, size.rows)?))
}

/// Whether something would resume the program: an ancestor in the same session but in another
/// process group, such as a shell with job control. With `xterm -e`, there is none.
fn is_resumable() -> bool {
    let (session, group) = (getsid(None), getpgrp());
    let mut process = getppid();
    // The processes of a script share a group: the shell that started it is further up.
    while process.as_raw() > 0 && getsid(Some(process)) == session {
        if getpgid(Some(process)).is_ok_and(|its| its != group) {
            return true;
        }
        let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
        let parent = status.lines().find_map(|line| line.strip_prefix("PPid:"));
        process = Pid::from_raw(parent.and_then(|id| id.trim().parse().ok()).unwrap_or(0));
    }
    false
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
