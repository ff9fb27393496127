//! The connection from the interface to trainer and viewer.

use std::time::Duration;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::screen::Screen;
use gdg::engine::{EngineCommand, EngineLink, Snapshot};
use gdg::job::Job;
use gdg::viewer::{Request, Viewer};

/// Time after which it is shown what the trainer does instead of training.
const SHOWN_AFTER: Duration = Duration::from_millis(500);

pub struct TrainerLink {
    pub engine: EngineLink,
    pub viewer: Viewer,
    /// The number of the latest request for a goal.
    pub goal_request: u64,
    /// Separate, so that training does not depend on user input.
    pub rng: ChaCha8Rng,
}

impl TrainerLink {
    /// Connects a screen that shows `snapshot` at first.
    pub fn new(engine: EngineLink, viewer: Viewer, snapshot: &Snapshot) -> Self {
        let rng = ChaCha8Rng::seed_from_u64(snapshot.run.seed);
        Self { engine, viewer, goal_request: 0, rng }
    }

    /// Returns what the trainer does instead of training, if that takes long.
    pub fn busy(&self) -> Option<Job> {
        self.engine.busy().filter(|job| job.since().elapsed() >= SHOWN_AFTER)
    }

    /// Sends a command to the trainer. If too many are queued, shows a notice and returns `false`.
    pub fn command(&self, command: EngineCommand, screen: &mut Screen) -> bool {
        let sent = self.engine.send(command);
        if !sent {
            screen.notify("the trainer is busy: try again");
        } else if let Some(job) = self.busy() {
            screen.say(&format!("taken: it follows, the trainer is {}", job.what()));
        }
        sent
    }

    pub fn request(&self, request: Request) {
        self.viewer.request(request);
    }

    pub fn next_goal_request(&mut self) -> u64 {
        self.goal_request += 1;
        self.goal_request
    }

    /// Returns to the present; returns whether the past was shown. A frozen screen is unfrozen, as
    /// its view is gone.
    pub fn return_to_present(&self, screen: &mut Screen) -> bool {
        let was_past = screen.past.take().is_some();
        if was_past {
            self.request(Request::Past(None));
            screen.frozen = false;
        }
        was_past
    }
}
