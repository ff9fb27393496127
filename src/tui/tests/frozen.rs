//! A frozen screen shows an earlier moment, on which no decision is based.

use super::staged::staged_app;
use super::*;

/// Freezes the screen and continues training for `seconds` behind it.
fn train_frozen(app: &mut App, seconds: f64, change: impl FnOnce(&mut Snapshot)) {
    press(app, KeyCode::Char('F'));
    assert!(app.screen.frozen);
    let mut latest = (*app.screen.snapshot).clone();
    latest.counters.updates += (100.0 * seconds) as u64;
    latest.seconds += seconds;
    change(&mut latest);
    app.on_snapshot(Arc::new(latest));
}

/// Returns an app whose run has just been saved.
fn saved_app() -> Still {
    let mut app = staged_app(80, 24);
    let mut saved = (*app.screen.snapshot).clone();
    saved.saved = Some((saved.counters.updates, Arc::new(PathBuf::from("saves/kept.safetensors"))));
    saved.saved_seconds = saved.seconds;
    app.on_snapshot(Arc::new(saved));
    app
}

#[test]
fn what_is_unsaved_behind_a_frozen_screen_is_asked_about_and_saved_on_a_signal() {
    let mut app = saved_app();
    let shown = app.screen.snapshot.counters.updates;
    train_frozen(&mut app, 60.0, |_| {});
    assert_eq!(app.screen.snapshot.counters.updates, shown, "the screen stays");
    press(&mut app, KeyCode::Char('q'));
    assert!(!app.is_done());
    let asked = shown_by(&mut app, 80, 24);
    assert!(asked.contains("6,000 unsaved updates"), "{asked}");
    app.on_signal();
    assert!(app.saver.named.as_ref().is_some_and(|path| path.ends_with("kept.safetensors")));
}

#[test]
fn a_resumed_run_is_asked_about_after_ten_seconds_however_fast_it_was_before() {
    for (seconds, is_asked) in [(11.0, true), (9.0, false)] {
        let mut app = saved_app();
        let mut latest = (*app.screen.snapshot).clone();
        // Much slower than before: another machine, or other work on it.
        latest.counters.updates += 3;
        latest.seconds += seconds;
        app.on_snapshot(Arc::new(latest));
        press(&mut app, KeyCode::Char('q'));
        assert_eq!(app.is_done(), !is_asked, "{seconds} s");
    }
}

#[test]
fn a_signal_saves_what_quitting_would_discard() {
    let mut app = saved_app();
    app.on_signal();
    assert!(app.saver.named.is_none(), "all is saved");
    let mut latest = (*app.screen.snapshot).clone();
    latest.counters.updates += 3;
    latest.seconds += 0.1;
    app.on_snapshot(Arc::new(latest));
    app.on_signal();
    assert!(app.saver.named.as_ref().is_some_and(|path| path.ends_with("kept.safetensors")));
}

#[test]
fn nothing_is_asked_about_where_nothing_is_unsaved() {
    let mut app = staged_app(80, 24);
    train_frozen(&mut app, 0.0, |latest| {
        latest.saved =
            Some((latest.counters.updates, Arc::new(PathBuf::from("saves/kept.safetensors"))));
    });
    press(&mut app, KeyCode::Char('q'));
    assert!(app.is_done());
}

#[test]
fn a_frozen_screen_says_what_was_saved_and_that_the_limit_is_reached() {
    let mut app = staged_app(80, 24);
    train_frozen(&mut app, 1.0, |latest| {
        latest.notice.number += 1;
        latest.notice.text = "autosaved kept-auto.safetensors".to_owned();
        latest.autosaves = Arc::new(vec![(0, PathBuf::from("kept-auto.safetensors"))]);
    });
    assert!(shown_by(&mut app, 80, 24).contains("autosaved kept-auto"));
    let mut done = (*app.screen.latest).clone();
    done.phase = Phase::Done;
    app.on_snapshot(Arc::new(done));
    assert!(shown_by(&mut app, 80, 24).contains("limit reached"));
}

#[test]
fn autosaves_go_on_behind_a_frozen_screen() {
    let mut app = saved_app();
    assert!(!app.saver.has_something_to_autosave(&app.scene, &app.screen));
    train_frozen(&mut app, 60.0, |_| {});
    assert!(app.saver.has_something_to_autosave(&app.scene, &app.screen));
}

#[test]
fn settings_changed_one_after_the_other_on_a_frozen_screen_are_all_kept() {
    let mut app = still();
    press(&mut app, KeyCode::Char('F'));
    for (name, value) in [("expectile", "0.7"), ("tau", "0.01")] {
        app.choose(super::super::dialog::Choice::Setting(name.to_owned()));
        enter(&mut app, value);
        let is_set = |app: &App| {
            let settings = train::list_settings(&app.screen.run().settings);
            settings.iter().any(|(known, now)| known == name && now == value)
        };
        app.obey();
        assert!(is_set(&app));
    }
    let settings = train::list_settings(&app.screen.run().settings);
    assert!(
        settings.contains(&("expectile".to_owned(), "0.7".to_owned())),
        "the first change is kept"
    );
}
