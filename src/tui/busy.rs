//! What the trainer is doing instead of training, once that takes long.

use std::fmt;
use std::time::{Duration, Instant};

use gdg::engine::EngineLink;
use gdg::pulse::Progress;

/// Time after which it is shown.
const PATIENCE: Duration = Duration::from_millis(500);

/// What a trainer waits for, by the name of the activity, and what it is doing then.
const ACTIVITIES: [(&str, &str); 6] = [
    ("the edit of the world", "applying the edit"),
    ("the environment to step", "waiting for the environment"),
    ("the change of settings", "changing settings"),
    ("the checkpoint to be written", "saving"),
    ("the run to be opened", "opening the run"),
    ("the bridge graph to be built", "building the graph"),
];

/// For how long something has been going on, and how far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lasting {
    /// Whole seconds.
    pub seconds: u64,
    /// What is done, if that is known.
    percent: Option<u64>,
}

impl Lasting {
    /// Returns it as of now.
    pub fn now(since: Instant, progress: &Progress) -> Self {
        let percent = progress.share().map(|share| (100.0 * share) as u64);
        Self { seconds: since.elapsed().as_secs(), percent }
    }

    /// Returns how far it is, or else for how long it has been going on.
    pub fn short(&self) -> String {
        self.percent.map_or(format!("{} s", self.seconds), |percent| format!("{percent} %"))
    }
}

impl fmt::Display for Lasting {
    /// Formats as `, 3 s, 40 %`; nothing in the first second.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.seconds == 0 {
            return Ok(());
        }
        write!(f, ", {} s", self.seconds)?;
        self.percent.map_or(Ok(()), |percent| write!(f, ", {percent} %"))
    }
}

/// Returns a notice that `what` goes on, as in `reading a.map ... 3 s, 40 %`.
pub fn notice(what: &str, lasting: Lasting) -> String {
    format!("{what} ...{}", lasting.to_string().trim_start_matches(','))
}

/// What the trainer is doing, and for how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy {
    /// What it is doing.
    pub doing: &'static str,
    lasting: Lasting,
}

impl Busy {
    /// Returns what a trainer is doing instead of training, if that takes long.
    pub fn now(engine: &EngineLink) -> Option<Self> {
        let now = engine.busy().filter(|now| now.since.elapsed() >= PATIENCE)?;
        let (_, doing) = ACTIVITIES.iter().find(|(known, _)| *known == now.name)?;
        Some(Self { doing, lasting: Lasting::now(now.since, &now.progress) })
    }
}

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}{}", self.doing, self.lasting)
    }
}
