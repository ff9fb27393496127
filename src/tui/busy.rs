//! What the trainer is doing instead of training, once that takes long.

use std::fmt;
use std::time::Duration;

use gdg::engine::EngineLink;

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

/// What the trainer is doing, and for how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy {
    /// What it is doing.
    pub doing: &'static str,
    seconds: u64,
}

impl Busy {
    /// Returns what a trainer is doing instead of training, if that takes long.
    pub fn now(engine: &EngineLink) -> Option<Self> {
        let (name, time) = engine.busy().filter(|(_, time)| *time >= PATIENCE)?;
        let (_, doing) = ACTIVITIES.iter().find(|(known, _)| *known == name)?;
        Some(Self { doing, seconds: time.as_secs() })
    }
}

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.doing)?;
        if self.seconds > 0 { write!(f, ", {} s", self.seconds) } else { Ok(()) }
    }
}
