//! Reports what the program still waits for before it ends.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use gdg::printing::eprint_line;
use gdg::pulse::Pulse;

/// Time before the first report: to somebody who waits, and to a log.
const PATIENCE: Duration = Duration::from_millis(500);
const PATIENCE_OF_LOGS: Duration = Duration::from_secs(2);

/// Polling interval, ...
const POLL_INTERVAL: Duration = Duration::from_secs(1);

/// ... and time between reports while the activity stays the same.
const REPEAT_AFTER: Duration = Duration::from_mins(1);

/// ... or until it is farther by this share.
const TOLD_SHARE: f64 = 0.1;

/// How to end the program at once if no Ctrl-C has been received yet.
pub const TWICE: &str = "Ctrl-C twice";

/// Reports on standard error what a long wait is for, until dropped.
pub struct Waiting {
    _ended: Sender<()>,
}

impl Waiting {
    /// Starts to report what `pulse` is doing, and that `ends_at_once` ends the program at once.
    /// `before` runs before the first report, for instance to leave the alternate screen.
    pub fn begin(pulse: &Pulse, ends_at_once: &'static str, before: fn()) -> Self {
        let ((ended, end), pulse) = (channel(), pulse.clone());
        let say = move || {
            let (began, mut said) = (Instant::now(), None);
            let is_seen = std::io::stderr().is_terminal();
            let mut pause = if is_seen { PATIENCE } else { PATIENCE_OF_LOGS };
            while end.recv_timeout(pause) == Err(RecvTimeoutError::Timeout) {
                pause = POLL_INTERVAL;
                let activity = pulse.activity();
                let share = pulse.busy().and_then(|doing| doing.progress.share());
                if said.is_some_and(|(same, at, before): (_, Instant, Option<f64>)| {
                    let moved = share.unwrap_or(0.0) - before.unwrap_or(0.0);
                    same == activity && at.elapsed() < REPEAT_AFTER && moved < TOLD_SHARE
                }) {
                    continue;
                }
                if said.is_none() {
                    before();
                }
                let part = share.map_or(String::new(), |share| format!(", {:.0} %", 100.0 * share));
                let seconds = began.elapsed().as_secs();
                let mut line = format!("waiting for {activity} ({seconds} s so far{part})");
                if said.is_none() {
                    line += &format!("; {ends_at_once} ends at once, without what is not saved");
                }
                said = Some((activity, Instant::now(), share));
                eprint_line(&line);
            }
        };
        // Without a thread, nothing is reported.
        let _ = std::thread::Builder::new().name("waiting".to_owned()).spawn(say);
        Self { _ended: ended }
    }
}
