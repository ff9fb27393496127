//! Checkpoints, maps and exports are written, and nothing is lost by quitting.

use std::os::unix::fs::PermissionsExt;

use super::staged::staged_app;
use super::*;
use crate::tui::dialog::{Choice, Dialog};
use crate::tui::graphics::{Graphics, Redraw};
use crate::tui::lists;
use crate::tui::session::change_run;
use crate::tui::session::saving::about_files;

/// Returns an app that trains the rooms and saves them to a file, after its first update.
fn training(path: &Path) -> App {
    let mut app = app_saving_to(path, gdg(), None);
    wait_until(&mut app, |app| app.screen.snapshot.updates() > 0);
    app
}

fn paused(path: &Path) -> App {
    let mut app = training(path);
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| !app.screen.snapshot.phase.is_training());
    app
}

fn tick(app: &mut App) {
    app.saver.autosave_minutes = 1e-5;
    std::thread::sleep(Duration::from_millis(20));
    app.on_tick();
}

#[test]
fn autosaves_have_their_own_files_of_which_the_newest_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("kept.safetensors");
    let mut app = training(&path);
    app.on_tick();
    assert!(app.screen.snapshot.autosaves.is_empty(), "not yet");
    let mut all = std::collections::BTreeSet::new();
    while all.len() < 5 {
        let updates = app.screen.snapshot.updates();
        tick(&mut app);
        wait_until(&mut app, |app| app.screen.snapshot.updates() > updates);
        all.extend(app.screen.snapshot.autosaves.iter().map(|(_, path)| path.clone()));
    }
    // An edit while it is paused as well, once.
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| !app.screen.snapshot.phase.is_training());
    let latest = |app: &App| app.screen.snapshot.autosaves.last().cloned();
    tick(&mut app);
    let map = app.maze().map.with_marks(Vec::new(), Vec::new());
    app.maze_mut().map = Arc::new(map);
    let before = latest(&app);
    tick(&mut app);
    wait_until(&mut app, |app| latest(app) != before);
    let there: Vec<_> = all.iter().filter(|path| path.is_file()).collect();
    assert!((1..=4).contains(&there.len()), "the newest are kept: {there:?}");
    assert!(!path.exists() && app.screen.snapshot.saved.is_none(), "the user's own file is left");
}

#[test]
fn saving_keeps_another_runs_file_and_replaces_the_runs_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mine.safetensors");
    std::fs::write(&path, b"another run's").expect("written");
    let mut app = training(&path);
    let own = folder.path().join("mine-2.safetensors");
    for _ in 0..2 {
        let (before, updates) = (app.screen.snapshot.saved.clone(), app.screen.snapshot.updates());
        wait_until(&mut app, |app| app.screen.snapshot.updates() > updates);
        app.act(Action::Save);
        wait_until(&mut app, |app| app.screen.snapshot.saved != before);
        assert_eq!(*app.screen.snapshot.saved.clone().expect("saved").1, own);
    }
    assert_eq!(std::fs::read(&path).expect("there"), b"another run's");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 2);
    // New networks do not replace the file of those before.
    let before = std::fs::read(&own).expect("saved");
    set(&mut app, "hidden", "8");
    let said = "hidden 16 to 8; networks reset, replay kept";
    wait_until(&mut app, |app| app.screen.log.entries().iter().any(|entry| entry.text == said));
    app.act(Action::Save);
    wait_until(&mut app, |app| {
        app.screen.snapshot.saved.as_ref().is_some_and(|(_, saved)| **saved != own)
    });
    assert_eq!(std::fs::read(&own).expect("still there"), before);
}

#[test]
fn a_failed_save_before_quitting_asks_for_another_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, b"").expect("written");
    let path = blocked.join("below.safetensors");
    let mut app = training(&path);
    app.act(Action::Quit);
    let has_failed = |app: &App| matches!(app.screen.dialogs.last(), Some(Dialog::Ask(prompt)) if prompt.error.is_some());
    wait_until(&mut app, has_failed);
    assert!(!app.is_done(), "it stays");
    press(&mut app, KeyCode::Esc);
    wait_until(&mut app, |app| app.screen.snapshot.phase.is_training());
    app.act(Action::Quit);
    wait_until(&mut app, has_failed);
    let elsewhere = folder.path().join("elsewhere");
    enter(&mut app, &elsewhere.to_string_lossy());
    wait_until(&mut app, App::is_done);
    assert!(elsewhere.with_extension("safetensors").is_file());
}

#[test]
fn what_a_map_file_would_replace_or_lose_is_asked_about() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let save_as = |app: &mut App, name: &str| {
        app.act(Action::SaveMap);
        enter(app, &file(name).to_string_lossy());
        shown_by(app, 200, 40)
    };
    let marks = |name: &str| {
        let map = gdg::map::load_map(&file(name)).expect("a map");
        map.starts().len() + map.goals().len()
    };
    let mut app = still();
    // A file, and the image beside a map.
    for (name, replaced, warning) in [
        ("kept.txt", "kept.txt", "size of 2 x 1 cells would be lost"),
        ("scan.yaml", "scan.pgm", "/scan.pgm"),
        ("scan.yaml", "scan.pgm", "scan.yaml and "),
    ] {
        let text = if replaced == "kept.txt" { "..\n" } else { "P2 2 1 9 9 0" };
        std::fs::write(file(replaced), text).expect("a file");
        let shown = save_as(&mut app, name);
        assert!(shown.contains(warning), "{shown}");
        assert_eq!(std::fs::read_to_string(file(replaced)).expect("the file"), text);
        press(&mut app, KeyCode::Char('n'));
        assert_eq!(app.screen.dialogs.len(), 1, "another name can be typed");
        press(&mut app, KeyCode::Enter);
        press(&mut app, KeyCode::Char('d'));
        assert!(app.screen.dialogs.is_empty() && gdg::map::load_map(&file(replaced)).is_ok());
    }
    assert_eq!(marks("kept.txt"), 1, "with its goal");
    // Neither of two files if one of them cannot be.
    std::fs::write(file("scan.pgm"), "P2 2 1 9 9 0").expect("a file");
    std::fs::set_permissions(file("scan.yaml"), PermissionsExt::from_mode(0o444)).expect("a file");
    save_as(&mut app, "scan.yaml");
    press(&mut app, KeyCode::Char('d'));
    assert!(shown_by(&mut app, 200, 40).contains("is write-protected"));
    assert_eq!(std::fs::read_to_string(file("scan.pgm")).expect("a file"), "P2 2 1 9 9 0");
    press(&mut app, KeyCode::Esc);
    // Starts and goals that the format does not have.
    let shown = save_as(&mut app, "rooms.map");
    let said = ["the format movingai has no goals", "rooms.txt"];
    assert!(said.iter().all(|text| shown.contains(text)), "{shown}");
    assert!(!file("rooms.map").exists(), "nothing is written yet");
    press(&mut app, KeyCode::Enter);
    assert_eq!((app.screen.dialogs.len(), marks("rooms.txt")), (0, 1), "first what loses nothing");
    save_as(&mut app, "rooms.map");
    press(&mut app, KeyCode::Char('d'));
    assert_eq!((app.screen.dialogs.len(), marks("rooms.map")), (0, 0));
    let shown = save_as(&mut app, "rooms.map");
    assert!(shown.contains("save under another name?"), "{shown}");
    (0..2).for_each(|_| press(&mut app, KeyCode::Esc));
    // A checkpoint, or what else is no map, is never replaced.
    saved_run(folder.path(), &app);
    std::fs::write(file("notes.txt"), "mine").expect("a file");
    for name in ["saved.safetensors", "saved.safetensors", "notes.txt"] {
        let before = std::fs::read(file(name)).expect("a file");
        let shown = save_as(&mut app, name);
        assert!(shown.contains("cannot be read as a map"), "{shown}");
        assert!(std::fs::read(file(name)).expect("still there") == before);
    }
}

fn saved_app() -> Still {
    let mut app = staged_app(80, 24);
    app.change_snapshot(|saved| {
        saved.set_saved(Arc::new("saves/kept.safetensors".into()));
    });
    app
}

#[test]
fn a_setting_changed_since_the_last_save_is_asked_about_and_saved_on_a_signal() {
    let mut app = saved_app();
    app.change_snapshot(|latest| Arc::make_mut(&mut latest.run).settings.learn.tau *= 2.0);
    app.act(Action::Quit);
    assert_eq!(app.screen.dialogs.len(), 1);
    app.on_signal();
    assert!(app.saver.named.is_some());
}

#[test]
fn an_evaluation_after_the_last_save_is_asked_about() {
    let mut app = saved_app();
    app.change_snapshot(|latest| {
        let again = latest.evaluations.last().expect("one").clone();
        Arc::make_mut(&mut latest.evaluations).push(again);
    });
    assert!(!app.screen.snapshot.has_unsaved_evaluation(), "the file has one of this update");
    app.change_snapshot(|latest| latest.saved_evaluation = None);
    app.act(Action::Quit);
    assert!(shown_by(&mut app, 80, 24).contains("an evaluation is lost"));
}

#[test]
fn what_is_unsaved_is_asked_about_on_quit_and_saved_on_a_signal() {
    let is_named = |app: &Still| app.saver.named.is_some();
    let mut app = staged_app(80, 24);
    app.act(Action::Quit);
    assert!(!app.is_done() && app.screen.dialogs.len() == 1, "twelve seconds are asked about");
    press_with(&mut app, KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert!(app.is_done() && !is_named(&app), "twice leaves without saving");
    let mut other = staged_app(80, 24);
    for (is_done, asks) in [(false, false), (false, true), (true, true)] {
        let is_asked = other.screen.dialogs.last().is_some_and(Dialog::asks_to_quit);
        assert_eq!((other.is_done(), is_asked), (is_done, asks), "not in other dialogs");
        if !asks {
            press(&mut other, KeyCode::Char('o'));
        }
        press_with(&mut other, KeyCode::Char('c'), KeyModifiers::CONTROL);
    }
    app.on_signal();
    assert!(app.saver.named.as_ref().is_some_and(|path| path.starts_with("saves")));
    // From ten seconds on, however fast it was before.
    for (seconds, updates, asks) in
        [(0.0, 0, false), (9.0, 3, false), (11.0, 3, true), (60.0, 6_000, true)]
    {
        let mut app = saved_app();
        app.change_snapshot(|latest| {
            latest.counters.updates += updates;
            latest.seconds += seconds;
        });
        press(&mut app, KeyCode::Char('q'));
        assert_eq!(app.is_done(), !asks, "{seconds} s");
        let asked = shown_by(&mut app, 80, 24);
        let lost = format!("{} unsaved updates", gdg::text::grouped(updates));
        assert_eq!(asked.contains(&lost), asks);
        app.on_signal();
        assert_eq!(is_named(&app), updates > 0, "a signal saves what quitting would discard");
    }
}

#[test]
fn an_edited_map_is_not_discarded_without_a_question() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = paused(&folder.path().join("own.safetensors"));
    app.saver.named = None;
    let save_as = |app: &mut App, action: Action, name: &str| {
        app.act(action);
        enter(app, &folder.path().join(name).to_string_lossy());
    };
    let asks = |app: &mut App| {
        press(app, KeyCode::Char('q'));
        let asked = app.screen.dialogs.len() == 1;
        press(app, KeyCode::Esc);
        asked
    };
    let cell = app.maze().map.free_cells().next().expect("a free cell");
    app.change_cell(cell, false);
    assert!(asks(&mut app), "although it has hardly been trained");
    save_as(&mut app, Action::SaveMap, "edited");
    assert!(folder.path().join("edited.txt").is_file(), "an ending of its own");
    assert!(!app.scene.has_unsaved_map());
    app.change_cell(cell, true);
    assert!(asks(&mut app));
    save_as(&mut app, Action::SaveAs, "run");
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some());
    assert!(!app.scene.has_unsaved_map(), "a checkpoint has the map too");
    // What is drawn while a save is being written is not in it.
    let saved = |app: &App| app.screen.snapshot.saved.as_ref().map(|(_, path)| Arc::as_ptr(path));
    let before = saved(&app);
    app.act(Action::Save);
    app.change_cell(cell, false);
    wait_until(&mut app, |app| saved(app) != before);
    assert!(app.scene.has_unsaved_map());
    change_run::restart(7, &mut app.cx);
    wait_until(&mut app, |app| app.screen.run().seed == 7);
    assert!(!app.maze().map.is_free(cell) && asks(&mut app), "a new run on the drawn map");
}

#[test]
fn a_checkpoint_that_is_not_written_yet_is_written_on_closing() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.safetensors");
    for ask in [&[Action::Save][..], &[Action::Quit]] {
        let mut app = app_saving_to(&path, Method::default(), None);
        app.saver.named.take_if(|_| ask == [Action::Save]);
        // The trainer's answer is not looked at, as if it hung.
        ask.iter().for_each(|action| app.act(*action));
        assert!(!app.is_done());
        app.act(Action::Quit);
        assert!(app.is_done() && app.saver.awaited.is_some() && app.saver.to.path() == path);
    }
}

fn set(app: &mut App, name: &str, value: &str) {
    app.choose(Choice::Setting(name.to_owned()));
    type_text(app, value);
    press(app, KeyCode::Enter);
}

#[test]
fn what_resets_trained_networks_is_asked_about_and_can_save_first() {
    let mut app = staged_app(80, 24);
    let asks = |app: &mut Still| {
        let asked = text(&draw(app, 80, 24)).contains("save before the networks are reset?");
        assert_eq!(app.screen.dialogs.len(), usize::from(asked));
        asked.then(|| press(app, KeyCode::Esc));
        let sent = app.commands.try_iter().any(|sent| matches!(sent, EngineCommand::Change(_)));
        assert_ne!(asked, sent, "nothing changes without the answer");
        asked
    };
    set(&mut app, "hidden", "8");
    assert!(asks(&mut app));
    app.choose(Choice::Preset(Preset::Paper));
    assert!(asks(&mut app));
    app.choose(Choice::Method("her".parse().expect("a method")));
    assert!(asks(&mut app));
    set(&mut app, "learning_rate", "0.002");
    assert!(!asks(&mut app), "the networks stay");
    set(&mut app, "hidden", "8");
    press(&mut app, KeyCode::Char('y'));
    let sent: Vec<EngineCommand> = app.commands.try_iter().collect();
    assert!(matches!(sent[..], [EngineCommand::Save(..)]), "the change waits for the checkpoint");
    app.change_snapshot(|snapshot| snapshot.saved = Some((10_000, Arc::new("own".into()))));
    assert!(
        matches!(app.commands.try_recv(), Ok(EngineCommand::Change(run)) if run.settings.learn.hidden == 8)
    );
    // A run that has hardly been trained is changed at once.
    let mut app = still();
    set(&mut app, "hidden", "8");
    assert!(matches!(app.commands.try_recv(), Ok(EngineCommand::Change(_))));
}

#[test]
fn a_runs_own_file_is_not_replaced_before_it_is_loaded() {
    let folder = tempfile::tempdir().expect("a folder");
    let [own, other] = ["own", "other"].map(|name| folder.path().join(name));
    for (loaded, is_replaced) in [(&own, false), (&other, true)] {
        std::fs::write(loaded, "").expect("written");
        let mut app = staged_app(80, 24);
        app.saver.to = SaveTo::Replace(own.clone());
        app.choose(Choice::SaveFirst(Box::new(Choice::LoadUnsaved(loaded.clone()))));
        let sent: Vec<EngineCommand> = app.commands.try_iter().collect();
        let [EngineCommand::Save(to, _)] = &sent[..] else { panic!("a save first") };
        assert_eq!(to.path() == own, is_replaced);
    }
}

#[test]
fn the_checkpoint_of_a_finished_job_is_not_replaced_by_what_is_trained_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut app = staged_app(80, 24);
    std::fs::create_dir(folder.path().join("jobs")).expect("a folder");
    let path = Arc::new(folder.path().join("jobs/trap-gdg-seed1.safetensors"));
    app.change_snapshot(|snapshot| snapshot.saved = Some((10, path.clone())));
    for is_job in [false, true] {
        if is_job {
            std::fs::write(path.with_extension("json"), "{}").expect("written");
        }
        let snapshot = app.screen.snapshot.clone();
        app.saver.start_run(&snapshot);
        assert_eq!(app.saver.to.path() == *path, !is_job, "{}", app.saver.to.path().display());
    }
}

#[test]
fn a_run_is_saved_before_another_begins_and_kept_if_that_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    let start =
        |app: &App| Choice::StartOn(Arc::new(Grid::empty("hall", 30, app.maze().map.height())));
    std::fs::write(folder.path().join("file"), b"").expect("written");
    for (place, works) in [("run.safetensors", true), ("file/run.safetensors", false)] {
        let path = folder.path().join(place);
        let mut app = training(&path);
        let (then, generation) = (start(&app), app.screen.snapshot.generation);
        let Choice::StartOn(map) = &then else { unreachable!("it starts a run") };
        app.screen.open(lists::map_switch(map, None, None, Some(String::new())));
        press(&mut app, KeyCode::Char('y'));
        if works {
            wait_until(&mut app, |app| app.screen.snapshot.generation > generation);
            let updates = train::describe(&path).expect("a checkpoint").updates;
            assert!(updates > 0 && app.scene.title(&app.screen.snapshot) == "hall", "{updates}");
        } else {
            wait_until(&mut app, |app| app.screen.snapshot.save_failed.0 > 0);
            let updates = app.screen.snapshot.updates();
            wait_until(&mut app, |app| app.screen.snapshot.updates() > updates);
            assert_eq!(
                (app.screen.snapshot.generation, app.scene.title(&app.screen.snapshot)),
                (generation, "rooms")
            );
        }
    }
}

#[test]
fn closing_says_what_is_saved_and_what_is_not() {
    let mut snapshot = Snapshot::clone(&staged_app(80, 24).screen.snapshot);
    snapshot.saved = Some((6_000, Arc::new("own".into())));
    snapshot.autosaves = Arc::new(vec![(8_000, "own-auto".into())]);
    let said = "\nlast saved own at update 6,000\nautosaved own-auto at update 8,000";
    assert_eq!(about_files(&snapshot, false, false), said);
    assert_eq!(
        about_files(&snapshot, true, true),
        format!("{said}\nnot saved: the last 2,000 updates")
    );
    snapshot.counters.updates = 6_000;
    snapshot.autosaves = Arc::default();
    assert_eq!(about_files(&snapshot, false, true), "\nunchanged own at update 6,000");
}

#[test]
fn everything_can_be_exported() {
    let mut app = staged_app(80, 24);
    let app = &mut app.app;
    press(app, KeyCode::Char('?'));
    for kind in ExportKind::ALL {
        let bytes = export(kind, app).expect("a file");
        let text = String::from_utf8_lossy(&bytes);
        match kind.file_type() {
            "pdf" => assert!(bytes.starts_with(b"%PDF-") && bytes.ends_with(b"%%EOF")),
            "png" => {
                let reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info();
                assert!(reader.expect("a PNG").info().width >= 400, "{kind:?}");
            }
            "svg" => {
                assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
                let is_chart = kind == ExportKind::CurvesSvg;
                let part = if is_chart { "error of D" } else { "\nG\n" };
                assert!(text.contains(part), "{kind:?} shows {part:?}");
                assert!(!text.contains("get no reward"), "the dialog on top is left out");
            }
            _ => {
                let columns = |line: &str| line.split(',').count();
                assert!(text.starts_with("event,seconds,updates,") && columns(&text) > 10);
                let head = text.lines().next().map_or(0, columns);
                assert!(text.lines().all(|line| columns(line) == head), "{text}");
                assert!(text.lines().last().is_some_and(|last| last.contains(",10000,")));
            }
        }
    }
    assert_eq!(app.screen.dialogs.len(), 1, "the help is still open");
}

#[test]
fn exports_have_all_colours_and_characters_whatever_the_terminal_has() {
    let exported = |depth, graphics| {
        let mut app = staged_app(80, 24);
        app.screen.theme = Theme::new(ThemeName::Dark, depth);
        app.set_graphics(graphics, Redraw::All);
        draw(&mut app, 80, 24);
        let svg = export(ExportKind::MapSvg, &mut app).expect("an export");
        assert_eq!(app.screen.theme.depth, depth, "the screen keeps its colours");
        svg
    };
    let pixels = Graphics { character: (8, 16) };
    let own = exported(ColourDepth::True, None);
    assert!(own == exported(ColourDepth::Indexed, None));
    assert!(own == exported(ColourDepth::True, Some(pixels)));
}
