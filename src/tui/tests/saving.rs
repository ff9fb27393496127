//! Checkpoints and maps are written.

use super::staged::staged_app;
use super::*;
use crate::tui::dialog::Choice;
use crate::tui::export::contents;
use crate::tui::graphics::{Graphics, Protocol, Redraw};
use crate::tui::output::ExportKind;

#[test]
fn autosaves_use_their_own_files_and_only_the_newest_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("kept.safetensors");
    let mut app = app_saving_to(rooms(), Method::default(), Limits::default(), Some(path.clone()));
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > 0);
    app.on_tick();
    assert!(app.screen.snapshot.autosaves.is_empty(), "not yet");
    app.saver.autosave.minutes = 1e-6;
    let mut all = std::collections::BTreeSet::new();
    while all.len() < 5 {
        let updates = app.screen.snapshot.counters.updates;
        app.on_tick();
        wait_until(&mut app, |app| app.screen.snapshot.counters.updates > updates);
        all.extend(app.screen.snapshot.autosaves.iter().map(|(_, path)| path.clone()));
    }
    let there: Vec<_> = all.iter().filter(|path| path.is_file()).collect();
    assert!((1..=4).contains(&there.len()), "the newest are kept: {there:?}");
    assert!(
        !path.exists() && app.screen.snapshot.saved.is_none(),
        "the user's own file is left alone"
    );
}

#[test]
fn saving_keeps_another_runs_file_and_replaces_the_runs_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mine.safetensors");
    std::fs::write(&path, b"another run's").expect("written");
    let mut app = app_saving_to(rooms(), Method::default(), Limits::default(), Some(path.clone()));
    let own = folder.path().join("mine-2.safetensors");
    for _ in 0..2 {
        let (before, updates) =
            (app.screen.snapshot.saved.clone(), app.screen.snapshot.counters.updates);
        wait_until(&mut app, |app| app.screen.snapshot.counters.updates > updates);
        app.act(Action::Save);
        wait_until(&mut app, |app| app.screen.snapshot.saved != before);
        let (_, saved) = app.screen.snapshot.saved.clone().expect("saved");
        assert_eq!(*saved, own);
    }
    assert_eq!(std::fs::read(&path).expect("there"), b"another run's");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 2);
}

#[test]
fn a_failed_save_before_quitting_asks_for_another_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, b"").expect("written");
    let path = blocked.join("below.safetensors");
    let mut app = app_saving_to(rooms(), Method::default(), Limits::default(), Some(path));
    wait_until(&mut app, |app| app.screen.snapshot.counters.updates > 0);
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
fn writing_a_map_asks_before_replacing_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("kept.txt");
    std::fs::write(&file, "something else").expect("a file");
    let mut app = still();
    draw(&mut app, 80, 24);
    press_with(&mut app, KeyCode::Char('w'), KeyModifiers::CONTROL);
    enter(&mut app, &file.to_string_lossy());
    let shown = shown_by(&mut app, 80, 24);
    assert!(shown.contains("the file exists: Enter again"), "{shown}");
    assert_eq!(std::fs::read_to_string(&file).expect("the file"), "something else");
    press(&mut app, KeyCode::Enter);
    assert!(app.screen.dialogs.is_empty());
    let written = gdg::map::load_map(&file).expect("a map");
    assert_eq!((written.free(), written.goals()), (rooms().free(), rooms().goals()));
    // So does the image beside a map.
    let image = folder.path().join("scan.pgm");
    std::fs::write(&image, "something else").expect("a file");
    app.act(Action::SaveMap);
    enter(&mut app, &folder.path().join("scan.yaml").to_string_lossy());
    let shown = shown_by(&mut app, 200, 24);
    assert!(shown.contains("scan.pgm exists: Enter again"), "{shown}");
    assert_eq!(std::fs::read_to_string(&image).expect("the file"), "something else");
    press(&mut app, KeyCode::Enter);
    assert!(app.screen.dialogs.is_empty() && gdg::map::load_map(&image).is_ok());
}

#[test]
fn unsaved_training_is_asked_about_on_quit_and_saved_on_a_signal() {
    let mut app = staged_app(80, 24);
    app.act(Action::Quit);
    assert!(!app.is_done() && app.screen.dialogs.len() == 1, "twelve seconds are asked about");
    press_with(&mut app, KeyCode::Char('c'), KeyModifiers::CONTROL);
    assert!(app.is_done() && app.saver.named.is_none(), "twice leaves without saving");
    app.on_signal();
    assert!(app.saver.named.as_ref().is_some_and(|path| path.starts_with("saves")));
}

#[test]
fn a_checkpoint_that_is_not_written_yet_is_written_on_closing() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.safetensors");
    for ask in [&[Action::Save][..], &[Action::Quit]] {
        let named = (ask == [Action::Quit]).then(|| path.clone());
        let mut app = app_saving_to(rooms(), Method::default(), Limits::default(), named);
        app.saver.to = SaveTo::CreateNew(path.clone());
        // The trainer's answer is not looked at, as if it hung.
        ask.iter().for_each(|action| app.act(*action));
        assert!(!app.is_done());
        app.act(Action::Quit);
        assert!(app.is_done() && app.saver.named.as_ref() == Some(&path));
    }
}

/// Enters a value for a setting.
fn set(app: &mut App, name: &str, value: &str) {
    app.choose(Choice::Setting(name.to_owned()));
    type_text(app, value);
    press(app, KeyCode::Enter);
}

#[test]
fn what_resets_trained_networks_is_asked_about_and_can_save_first() {
    let mut app = staged_app(80, 24);
    let asks = |app: &mut Still| {
        let asked = text(&draw(app, 80, 24)).contains("this resets the networks");
        assert_eq!(app.screen.dialogs.len(), usize::from(asked));
        asked.then(|| press(app, KeyCode::Esc));
        let sent = app.commands.try_iter().any(|command| matches!(command, Command::Change(_)));
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
    app.act(Action::Settings);
    let Some(Dialog::Pick(list)) = app.screen.dialogs.last_mut() else { panic!("a list") };
    list.search_names("hidden");
    app.act(Action::ResetSetting);
    assert_eq!(app.screen.dialogs.len(), 2, "its default resets them as well");
    app.screen.dialogs.clear();
    set(&mut app, "hidden", "8");
    press(&mut app, KeyCode::Char('s'));
    let sent: Vec<Command> = app.commands.try_iter().collect();
    assert!(matches!(sent[..], [Command::Save(..)]), "the change waits for the checkpoint");
    app.change_snapshot(|snapshot| snapshot.saved = Some((10_000, Arc::new("own".into()))));
    assert!(
        matches!(app.commands.try_recv(), Ok(Command::Change(run)) if run.settings.learn.hidden == 8)
    );
    // A run that has hardly been trained is changed at once.
    let mut app = still();
    set(&mut app, "hidden", "8");
    assert!(matches!(app.commands.try_recv(), Ok(Command::Change(_))));
}

#[test]
fn new_networks_do_not_replace_the_checkpoint_of_those_before() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.safetensors");
    let mut app = app_saving_to(rooms(), gdg(), Limits::default(), Some(path.clone()));
    wait_until(&mut app, |app| app.screen.snapshot.updates() > 0);
    app.act(Action::Save);
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some());
    let before = std::fs::read(&path).expect("saved");
    set(&mut app, "hidden", "8");
    let said = "hidden 16 -> 8; networks reset, replay kept";
    wait_until(&mut app, |app| app.screen.log.entries().iter().any(|entry| entry.text == said));
    app.act(Action::Save);
    wait_until(&mut app, |app| {
        app.screen.snapshot.saved.as_ref().is_some_and(|(_, saved)| **saved != path)
    });
    assert!(folder.path().join("own-2.safetensors").is_file());
    assert_eq!(std::fs::read(&path).expect("still there"), before);
}

#[test]
fn closing_says_of_one_moment_what_is_saved_and_what_is_not() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("own.safetensors");
    let trainer = trainer_in(&PointMaze::new(Arc::new(rooms()), 0), gdg(), &Registry::builtin());
    let engine = Engine::start(trainer, Limits::default()).expect("an engine");
    let viewer = Viewer::start(&engine).expect("a viewer");
    let mut app = App::new(engine.link(), viewer, &UiConfig::default(), keymap(), Files::default());
    app.saver.to = SaveTo::CreateNew(path.clone());
    let further = |app: &mut App| {
        let now = app.screen.snapshot.updates();
        wait_until(app, |app| app.screen.snapshot.updates() > now);
    };
    further(&mut app);
    app.act(Action::Save);
    wait_until(&mut app, |app| app.screen.snapshot.saved.is_some());
    further(&mut app);
    app.command(Command::Autosave(path, train::Notes::default()));
    wait_until(&mut app, |app| !app.screen.snapshot.autosaves.is_empty());
    further(&mut app);
    // Worth keeping: an edit.
    let cell = app.maze().map.free_cells().next().expect("a free cell");
    app.change_map(app.maze().map.with_cells([(cell, false)]).map(Arc::new));
    let (saved, autosaved) =
        (app.screen.snapshot.saved.clone().expect("saved").0, app.screen.snapshot.autosaves[0].0);
    let summary = app.close(engine, true).summary.replace(',', "");
    let number = |before: &str| {
        let digits = summary.split(before).nth(1).unwrap_or_else(|| panic!("{before}: {summary}"));
        let end = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        digits[..end].parse::<u64>().unwrap_or_else(|_| panic!("{before}: {summary}"))
    };
    assert_eq!(number("own.safetensors at update "), saved);
    assert_eq!(number(".safetensors at update ").max(autosaved), autosaved);
    assert!(summary.contains(&format!("auto-{autosaved}.safetensors at update {autosaved}")));
    assert_eq!(number("seed 1: ") - autosaved, number("not saved: the last "), "{summary}");
}

#[test]
fn everything_can_be_exported() {
    let mut app = staged_app(80, 24);
    let app = &mut app.app;
    press(app, KeyCode::Char('?'));
    for kind in ExportKind::ALL {
        let made = contents(kind, &mut app.screen, &app.scene);
        if matches!(kind, ExportKind::Still | ExportKind::Film) {
            assert!(made.expect_err("no film").to_string().contains("no film"));
            continue;
        }
        let bytes = made.expect("a file");
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
                let part = if is_chart { "relative error of D" } else { "\nG\n" };
                assert!(text.contains(part), "{kind:?} shows {part:?}");
                assert!(!text.contains("get no reward"), "the dialog on top is left out");
            }
            _ => {
                let (head, last) = (text.lines().next(), text.lines().last());
                let columns = head.expect("a head").split(',').count();
                assert!(text.starts_with("updates,critic_loss,") && columns > 10, "{text}");
                let last: Vec<&str> = last.expect("lines").split(',').collect();
                assert_eq!((last[0], last.len()), ("10000", columns));
            }
        }
    }
    assert_eq!(app.screen.dialogs.len(), 1, "the help is still open");
}

#[test]
fn exports_have_all_colours_and_characters_whatever_the_terminal_has() {
    let export = |depth, graphics| {
        let mut app = staged_app(80, 24);
        app.screen.theme = Theme::new(ThemeName::Dark, depth);
        app.set_graphics(graphics, Redraw::All);
        draw(&mut app, 80, 24);
        let app = &mut app.app;
        let svg = contents(ExportKind::MapSvg, &mut app.screen, &app.scene).expect("an export");
        assert_eq!(app.screen.theme.depth, depth, "the screen keeps its colours");
        svg
    };
    let pixels = Graphics { protocol: Protocol::Kitty, character: (8, 16) };
    let own = export(ColourDepth::True, None);
    assert!(own == export(ColourDepth::Basic, None));
    assert!(own == export(ColourDepth::True, Some(pixels)));
}
