//! Leaving a long update unfinished when training is to stop: what it has changed is undone, so that the run continues as
//! if it had not begun.

use std::time::Duration;

use rand_chacha::ChaCha8Rng;

use super::{Result, Trainer};
use crate::store::Store;
use crate::train::run::Counters;

/// An update is long if the latest one took at least this long. Others are finished: it takes less time than copying the
/// networks before each.
const LONG_UPDATE: Duration = Duration::from_millis(500);

/// What an update changes, as it was before.
pub(super) struct Undo {
    counters: Counters,
    batch_rng: ChaCha8Rng,
    learner: Store,
}

impl Trainer {
    /// Returns what is needed to undo the next update; nothing if it is to be finished: it is short, or changes the bridge
    /// graph and the plans too, as few do.
    pub(super) fn undo_for_update(&self) -> Result<Option<Undo>> {
        let is_long = self.update_took.is_none_or(|took| took >= LONG_UPDATE);
        if !is_long || self.changes_graph_at(self.counters.updates + 1) || !self.learns() {
            return Ok(None);
        }
        let mut learner = Store::default();
        self.learner.save(&mut learner)?;
        Ok(Some(Undo { counters: self.counters, batch_rng: self.batch_rng.clone(), learner }))
    }

    /// Undoes the update in progress.
    pub(super) fn undo(&mut self, Undo { counters, batch_rng, learner }: Undo) -> Result<()> {
        self.learner.load(&learner)?;
        (self.counters, self.batch_rng, self.in_update) = (counters, batch_rng, false);
        Ok(())
    }
}
