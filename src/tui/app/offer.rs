//! The line over the map: the newest saved run of the map, or, the first time, what there is to
//! see.

use super::App;
use crate::tui::action::Action;
use crate::tui::dialog::Choice;
use crate::tui::offer::Offer;
use gdg::text::grouped;
use gdg::train::Description;

impl App {
    /// Offers a saved run, and logs it for later.
    pub fn offer(&mut self, found: Description) {
        let updates = grouped(found.updates);
        let text = format!(
            "a run of {updates} updates, seed {}, is saved in {}",
            found.run.seed,
            found.file.display()
        );
        let snapshot = &self.screen.snapshot;
        self.screen.log.record(&text, snapshot.seconds, snapshot.updates());
        self.screen.offer = Some(Offer::new(found));
    }

    /// Resumes the offered run; without an offer, lists the saved runs.
    pub(super) fn resume_offered(&mut self) {
        match self.screen.offer.take() {
            Some(Offer { found, .. }) => self.choose(Choice::Load(found.file)),
            None => self.act(Action::Load),
        }
    }

    /// Collects what the search has found and withdraws an old offer; returns whether the screen
    /// changes.
    pub(super) fn on_offer_tick(&mut self) -> bool {
        if let Some(search) = self.search.take_if(|search| search.is_finished()) {
            // A search that failed has nothing to offer.
            let found = search.join().ok().flatten();
            let shown = found.is_some();
            found.into_iter().for_each(|found| self.offer(found));
            return shown;
        }
        self.screen.offer.take_if(|offer| offer.is_over()).is_some()
    }
}
