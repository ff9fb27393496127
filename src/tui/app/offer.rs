//! The line over the map: the newest saved run of the map, or, the first time, what there is to
//! see.

use crate::tui::offer::Search;
use crate::tui::screen::Screen;
use gdg::text::grouped;
use gdg::train::Description;

/// Offers a saved run, and logs it for later.
pub fn offer(found: Description, screen: &mut Screen) {
    let updates = grouped(found.updates);
    let text = format!(
        "a run of {updates} updates, seed {}, is saved in {}",
        found.run.seed,
        found.file.display()
    );
    screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
    screen.offer = Some(found);
    screen.show_banner();
}

/// Collects what the search has found, and withdraws an old line over the map; returns whether the
/// screen changes.
pub fn on_tick(search: &mut Option<Search>, screen: &mut Screen) -> bool {
    if let Some(search) = search.take_if(|search| search.is_finished()) {
        // A search that failed has nothing to offer.
        let found = search.join().ok().flatten();
        let shown = found.is_some();
        found.into_iter().for_each(|found| offer(found, screen));
        return shown;
    }
    screen.drop_old_banner()
}
