//! Updates from trainer and viewer.

use std::sync::Arc;

use super::saving::Saver;
use super::{App, Feed};
use crate::tui::action::Action;
use crate::tui::dialog::{Choice, Dialog, Item, Picker};
use crate::tui::lists;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use gdg::engine::{Phase, Snapshot};
use gdg::text::grouped;
use gdg::viewer::View;

impl App {
    /// Handles a new snapshot.
    pub fn on_snapshot(&mut self, snapshot: Arc<Snapshot>) {
        let before = std::mem::replace(&mut self.screen.latest, snapshot);
        self.show_snapshot(&before);
        update_quit_question(&self.saver, &self.scene, &mut self.screen);
        let then = self.saver.on_snapshot(&before, &mut self.scene, &mut self.screen);
        then.into_iter().for_each(|then| self.choose(then));
        let Self { saver, guide, scene, screen, link, .. } = self;
        let latest = screen.latest.clone();
        screen.pausing &= latest.phase.is_training();
        let notice = &latest.notice;
        if notice.number > before.notice.number {
            if notice.is_error {
                saver.autosave.failed();
            }
            // A run that cannot be started is no tour.
            guide.is_requested &= !notice.is_error;
            if notice.is_error { screen.report(&notice.text) } else { screen.notify(&notice.text) }
        }
        match &latest.phase {
            Phase::Failed(error) if before.phase != latest.phase => {
                saver.on_training_failed(error, screen);
            }
            Phase::Done if before.phase.is_training() => {
                let key = screen.keymap.key_of(Action::TogglePause);
                screen.notify(&format!("done: limit reached; {key} continues without it"));
                saver.save_at_limit(scene, screen, link);
            }
            _ => {}
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
                log_evaluation(&mut self.screen);
            }
        }
        if self.screen.latest.run != before.run {
            self.screen.update_changed_settings();
            update_settings_list(&mut self.screen);
        }
    }

    /// Handles the latest snapshot if it has not been handled yet.
    pub(super) fn catch_up(&mut self) {
        if self.feed.snapshots.has_changed().unwrap_or(true) {
            let snapshot = self.feed.snapshots.borrow_and_update().clone();
            self.on_snapshot(snapshot);
        }
    }

    /// Freezes the screen, or unfreezes it and shows the current state.
    pub(in crate::tui) fn freeze(&mut self, frozen: bool) {
        self.screen.frozen = frozen;
        if !frozen {
            let Feed { snapshots, views } = &self.feed;
            let (snapshot, view) = (snapshots.borrow().clone(), views.borrow().clone());
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
}

/// Refreshes open lists of settings.
fn update_settings_list(screen: &mut Screen) {
    let items = lists::setting_items(screen);
    for dialog in &mut screen.dialogs {
        if let Dialog::Pick(picker) = dialog
            && picker.button.is_some()
        {
            picker.update(items.clone());
        }
    }
}

/// Refreshes the open quit prompt.
fn update_quit_question(saver: &Saver, scene: &Scene, screen: &mut Screen) {
    let asks =
        |picker: &Picker| picker.items().any(|item| item.choice == Choice::Quit { save: false });
    let is_open = |dialog: &Dialog| matches!(dialog, Dialog::Pick(picker) if asks(picker));
    let Some(open) = screen.dialogs.iter().position(is_open) else { return };
    let items: Vec<Item> = saver.quit_question(scene, screen).items().cloned().collect();
    if let Dialog::Pick(picker) = &mut screen.dialogs[open] {
        picker.update(items);
    }
}

fn log_evaluation(screen: &mut Screen) {
    let snapshot = &screen.snapshot;
    let Some((updates, e)) = snapshot.evaluations.last() else { return };
    let updates = snapshot.learned(*updates);
    let error =
        e.distance_error.map_or(String::new(), |e| format!(", error of D {:.0} %", 100.0 * e.mape));
    // Training goes on while tasks are walked.
    let at = if updates == snapshot.updates() {
        String::new()
    } else {
        format!(" at {}", grouped(updates))
    };
    let text = format!("evaluated{at}: {}{error}", e.success(updates));
    screen.log.record(&text, snapshot.seconds, snapshot.updates());
}
