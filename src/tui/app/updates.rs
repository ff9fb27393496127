//! Updates from trainer and viewer, and timed events.

use std::sync::Arc;

use super::App;
use crate::tui::action::Action;
use crate::tui::dialog::{Choice, Dialog, Item, Picker};
use crate::tui::lists;
use gdg::engine::{Phase, Snapshot};
use gdg::text::grouped;
use gdg::viewer::View;

impl App {
    /// Handles a new snapshot.
    pub fn on_snapshot(&mut self, snapshot: Arc<Snapshot>) {
        let before = std::mem::replace(&mut self.screen.latest, snapshot);
        self.show_snapshot(&before);
        self.update_quit_question();
        self.on_saving(&before);
        if !Arc::ptr_eq(&self.screen.latest.autosaves, &before.autosaves) {
            self.autosave.done();
        }
        self.screen.pausing &= self.screen.latest.phase.is_training();
        let notice = self.screen.latest.notice.clone();
        if notice.number > before.notice.number {
            if notice.is_error {
                self.autosave.failed();
            }
            // A run that cannot be started is no tour.
            self.tour_requested &= !notice.is_error;
            if notice.is_error { self.report(&notice.text) } else { self.notify(&notice.text) }
        }
        if let (Phase::Failed(error), true) =
            (&self.screen.latest.phase, before.phase != self.screen.latest.phase)
        {
            self.on_training_failed(&error.clone());
        }
        if before.phase.is_training() && self.screen.latest.phase == Phase::Done {
            self.notify(&format!(
                "done: limit reached; {} continues without it",
                self.screen.keymap.key_of(Action::TogglePause)
            ));
            self.save_at_limit();
        }
    }

    /// Shows the latest snapshot, which came after `before`; on a frozen screen, only what the user
    /// has decided. A new run is shown in any case.
    fn show_snapshot(&mut self, before: &Snapshot) {
        let is_new_run = self.screen.latest.generation != before.generation;
        if self.screen.frozen && !is_new_run {
            Arc::make_mut(&mut self.screen.snapshot).follow_decisions(&self.screen.latest);
        } else {
            let shown = std::mem::replace(&mut self.screen.snapshot, self.screen.latest.clone());
            if is_new_run {
                self.start_run();
            } else if self.screen.latest.evaluations.len() > shown.evaluations.len() {
                self.log_evaluation();
            }
        }
        if self.screen.latest.run != before.run {
            self.screen.update_changed_settings();
            self.update_settings_list();
        }
    }

    /// Handles the latest snapshot if it has not been handled yet.
    pub(super) fn catch_up(&mut self) {
        if self.feed.snapshots.has_changed().unwrap_or(true) {
            let snapshot = self.feed.snapshots.borrow_and_update().clone();
            self.on_snapshot(snapshot);
        }
    }

    /// Refreshes open lists of settings.
    fn update_settings_list(&mut self) {
        let items = lists::setting_items(&self.screen);
        for dialog in &mut self.screen.dialogs {
            if let Dialog::Pick(picker) = dialog
                && picker.button.is_some()
            {
                picker.update(items.clone());
            }
        }
    }

    /// Refreshes the open quit prompt.
    fn update_quit_question(&mut self) {
        let asks = |picker: &Picker| {
            picker.items().any(|item| item.choice == Choice::Quit { save: false })
        };
        let Some(open) = self
            .screen
            .dialogs
            .iter()
            .position(|d| matches!(d, Dialog::Pick(picker) if asks(picker)))
        else {
            return;
        };
        let items: Vec<Item> = self.quit_question().items().cloned().collect();
        if let Dialog::Pick(picker) = &mut self.screen.dialogs[open] {
            picker.update(items);
        }
    }

    fn log_evaluation(&mut self) {
        let snapshot = &self.screen.snapshot;
        let Some((updates, e)) = snapshot.evaluations.last() else { return };
        let updates = snapshot.learned(*updates);
        let error = e
            .distance_error
            .map_or(String::new(), |e| format!(", error of D {:.0} %", 100.0 * e.mape));
        // Training goes on while tasks are walked.
        let at = if updates == snapshot.updates() {
            String::new()
        } else {
            format!(" at {}", grouped(updates))
        };
        let text = format!("evaluated{at}: {}{error}", e.success(updates));
        self.screen.log.record(&text, snapshot.seconds, snapshot.updates());
    }

    /// Freezes the screen, or unfreezes it and shows the current state.
    pub(in crate::tui) fn freeze(&mut self, frozen: bool) {
        self.screen.frozen = frozen;
        if !frozen {
            let (snapshot, view) =
                (self.snapshots().borrow().clone(), self.views().borrow().clone());
            self.on_snapshot(snapshot);
            self.on_view(view);
        }
    }

    /// Handles a new view.
    pub fn on_view(&mut self, view: View) {
        // The past can be looked at on a frozen screen.
        if self.screen.frozen && self.screen.past.is_none() {
            return;
        }
        self.scene.show(view, &mut self.screen, &self.link);
    }

    /// Handles the passing of time; returns whether the screen changes.
    pub fn on_tick(&mut self) -> bool {
        self.on_failures();
        if self.autosave.is_due() && self.has_something_to_autosave() {
            self.autosave();
        }
        let offer_changed = self.on_offer_tick();
        let tour_changed = self.on_tour_tick();
        self.screen.log.on_tick() || offer_changed || tour_changed
    }
}
