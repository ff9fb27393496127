//! Lists of runs on a buffer instead of a terminal.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::SystemTime;

use super::*;
use crate::experiment::runs::{Ending, Kind, SavedRun, Skipped};
use crate::experiment::spec::EvaluationAt;
use crate::tui::tests::{click, draw, place_of, press, shown_by, type_text};
use crate::tui::theme::ThemeName;
use gdg::train::{Evaluation, Score};

/// Returns a saved run with these success rates, evaluated every 1,000 updates.
pub fn saved(file: &str, map: &str, method: &str, seed: u64, success: &[f64]) -> SavedRun {
    let score = |success| Score {
        success: Some(success),
        spl: None,
        steps_ratio: None,
        by_distance: Vec::new(),
    };
    let plans = method == "gdg-bridge";
    let evaluation = |(i, success): (usize, &f64)| EvaluationAt {
        updates: 1_000 * (i as u64 + 1),
        env_steps: None,
        seconds: Some(2.0 * (i as f64 + 1.0)),
        evaluation: Evaluation {
            greedy: score(if plans { success / 2.0 } else { *success }),
            planned: plans.then(|| score(*success)),
            straight: None,
            distance_error: None,
            bridges: None,
            coverage: Some(0.5),
            marked: None,
        },
    };
    SavedRun {
        source: file.into(),
        kind: Kind::Checkpoint,
        map: map.to_owned(),
        fingerprint: None,
        method: method.to_owned(),
        variant: None,
        settings: ["preset=default", "hidden=16"].map(str::to_owned).to_vec(),
        seed,
        begun: 0,
        resumed: None,
        updates: 1_000 * success.len() as u64,
        evaluations: success.iter().enumerate().map(evaluation).collect(),
        checkpoint: Some(file.into()),
        others: Vec::new(),
        skipped: Skipped::default(),
    }
}

/// Returns runs as they are found, written one after the other.
pub fn found(runs: &[SavedRun]) -> Found {
    let day = |i: usize| SystemTime::UNIX_EPOCH + Duration::from_hours(36 + 24 * i as u64);
    let runs = runs.iter().enumerate();
    let runs = runs.map(|(i, run)| (Arc::new(run.clone()), Some(day(i))));
    Found { runs: runs.collect(), ..Found::default() }
}

/// Returns a list with runs of several kinds, one of which cannot be read.
pub fn screen() -> RunsScreen {
    let keymap = Keymap::new(&BTreeMap::new()).expect("the table's keys");
    let opener: Opener = Arc::new(|_, _| Err(miette!("is cut off at 12 bytes")));
    let config = UiConfig::default();
    let nothing = (watch::channel(Arc::default()).1, channel().0);
    let mut screen = RunsScreen::new("saves", nothing, opener, &config, keymap);
    screen.theme = Theme::new(ThemeName::Dark, ColourDepth::True);
    let records = |seed, success: &[f64]| SavedRun {
        kind: Kind::Records(Ending::Interrupted),
        checkpoint: None,
        ..saved("records/rooms.jsonl", "rooms", "her", seed, success)
    };
    let result = SavedRun {
        kind: Kind::Result,
        variant: Some("small".to_owned()),
        settings: ["preset=tuned", "hidden=8"].map(str::to_owned).to_vec(),
        checkpoint: None,
        ..saved("suite/jobs/trap-her-3.json", "trap", "her", 3, &[0.3, 0.4, 0.5])
    };
    let mut all = found(&[
        saved("saves/fourrooms.safetensors", "fourrooms", "gdg-bridge", 0, &[0.3, 0.7, 0.9, 1.0]),
        saved("saves/fourrooms-2.safetensors", "fourrooms", "gdg", 1, &[0.2, 0.4, 0.5]),
        records(1, &[0.1, 0.3]),
        records(2, &[]),
        result,
    ]);
    all.problems = vec![("saves/damaged.safetensors".into(), "is cut off at 12 bytes".to_owned())];
    all.read = [6, 6];
    screen.list(&all);
    screen
}

/// Returns runs that have just been written.
fn found_now(runs: impl IntoIterator<Item = SavedRun>) -> Found {
    let now = Some(SystemTime::now());
    let runs = runs.into_iter().map(|run| (Arc::new(run), now)).collect();
    Found { runs, ..Found::default() }
}

#[test]
fn every_size_can_be_drawn() {
    let mut screen = screen();
    for (width, height) in [(1, 1), (59, 16), (60, 16), (61, 17), (80, 24), (300, 100)] {
        for keys in [" ", "?", "?", "/x", "\n", "j", "D", "n"] {
            type_text(&mut screen, keys);
            draw(&mut screen, width, height);
        }
    }
    // Names as long as names get.
    let long = "x".repeat(300);
    let run = saved(&format!("own-{long}"), &long, &long, u64::MAX, &[0.375]);
    screen.list(&found(&[run, saved("other", "\u{8ff7}\u{5bae}", "gdg", 0, &[])]));
    for (width, height) in [(60, 16), (80, 24), (300, 100)] {
        for keys in [" ", "j", " ", "D", "n"] {
            type_text(&mut screen, keys);
            draw(&mut screen, width, height);
        }
    }
}

#[test]
fn files_that_cannot_be_read_are_rows_that_tell_all() {
    let mut screen = screen();
    let bad =
        |i| (format!("many/bad-{i}.jsonl").into(), format!("line 7: {} {i}", "no ".repeat(30)));
    let problems: Vec<_> = (0..30).map(bad).collect();
    screen.list(&Found { problems, ..found(&[saved("good", "own", "gdg", 0, &[])]) });
    press(&mut screen, KeyCode::End);
    let shown = shown_by(&mut screen, 80, 24);
    for part in ["many/bad-29.jsonl: line 7:", " no 29 ", " 23 to 31 of 31 "] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    press(&mut screen, KeyCode::Enter);
    assert!(screen.wish.is_none() && shown_by(&mut screen, 80, 24).contains("cannot be resumed"));
}

#[test]
fn the_mouse_sorts_selects_and_marks() {
    let mut screen = screen();
    let shown = shown_by(&mut screen, 120, 40);
    click(&mut screen, MouseButton::Left, place_of(&shown, "success "));
    assert_eq!(screen.list.order, (4, false));
    let shown = shown_by(&mut screen, 120, 40);
    let at = place_of(&shown, "fourrooms-2.safetensors");
    click(&mut screen, MouseButton::Left, at);
    assert!(screen.list.marked().is_empty());
    click(&mut screen, MouseButton::Left, at);
    assert_eq!(screen.list.marked()[&0].run().map(|run| run.seed), Some(1));
    let at = place_of(&shown, "success rate over");
    click(&mut screen, MouseButton::Left, at);
    assert_eq!(screen.curves.1, Axis::Steps);
}

#[test]
fn only_runs_with_a_checkpoint_can_be_resumed() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("own.safetensors");
    std::fs::write(&file, "a checkpoint").expect("a file");
    let mut screen = screen();
    let own = |path: &Path| saved(&path.to_string_lossy(), "own", "gdg", 7, &[]);
    screen.list(&found(&[own(&folder.path().join("gone.safetensors")), own(&file)]));
    press(&mut screen, KeyCode::End);
    press(&mut screen, KeyCode::Enter);
    let shown = shown_by(&mut screen, 200, 40);
    assert!(screen.wish.is_none() && shown.contains("is gone"), "{shown}");
    press(&mut screen, KeyCode::Home);
    press(&mut screen, KeyCode::Enter);
    assert_eq!(screen.wish, Some(Wish { file, beside: None, warning: None }));
}

#[test]
fn a_run_that_another_program_still_trains_is_opened_as_a_copy() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("own.safetensors");
    std::fs::write(&file, "a checkpoint").expect("a file");
    // Its checkpoint is of the same run, as it is the one that its records name.
    let own = saved(&file.to_string_lossy(), "own", "gdg", 7, &[]);
    let mut screen = screen();
    screen.list(&found_now([SavedRun { kind: Kind::Records(Ending::Open), ..own }]));
    press(&mut screen, KeyCode::Enter);
    let told = screen.wish.and_then(|wish| wish.warning).expect("a warning");
    assert!(told.contains("as last saved") && told.contains("to another name"), "{told}");
}

#[test]
fn two_runs_on_the_same_map_are_compared() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let own = |name: &str, map: &str| {
        std::fs::write(path(name), "a checkpoint").expect("a file");
        saved(&path(name).to_string_lossy(), map, "gdg", 7, &[])
    };
    let mut screen = screen();
    screen.list(&found(&[own("c", "own"), own("b", "other"), own("a", "own")]));
    press(&mut screen, KeyCode::Char(' '));
    press(&mut screen, KeyCode::Down);
    press(&mut screen, KeyCode::Char('c'));
    assert!(
        shown_by(&mut screen, 120, 40).contains("different maps cannot be compared: own and other")
    );
    press(&mut screen, KeyCode::Down);
    press(&mut screen, KeyCode::Char('c'));
    let wish = Wish { file: path("a"), beside: Some(path("c")), warning: None };
    assert_eq!(screen.wish, Some(wish));
}

#[test]
fn deleting_asks_and_removes_only_the_files_of_marked_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let own = |name: &str| {
        std::fs::write(path(name), "a checkpoint").expect("a file");
        saved(&path(name).to_string_lossy(), "own", "gdg", 7, &[])
    };
    let runs = ["a", "b", "c"].map(own);
    let mut screen = screen();
    screen.list(&found(&runs));
    type_text(&mut screen, " j D");
    let asked = shown_by(&mut screen, 200, 40);
    for part in ["delete 2 files for good?", "y: yes  n: no", "/c ", "/b "] {
        assert!(asked.contains(part), "{part}: {asked}");
    }
    press(&mut screen, KeyCode::Enter);
    assert!(path("c").exists() && screen.deletion.is_none(), "only y deletes");
    type_text(&mut screen, "Dy");
    assert_eq!(["a", "b", "c"].map(|name| path(name).exists()), [true, false, false]);
    assert!(shown_by(&mut screen, 120, 40).contains("deleted 2 files"));
    let problems = vec![(path("a"), "line 1: not a record".to_owned())];
    screen.list(&Found { problems, ..Found::default() });
    type_text(&mut screen, "Dy");
    assert!(!path("a").exists(), "a file that is no run");
    // A run of two files, one of which has another run, or is removed meanwhile.
    let records = SavedRun { kind: Kind::Records(Ending::Finished), ..own("d") };
    let joined = SavedRun { others: vec![path("e")], ..records.clone() };
    let other = SavedRun { seed: 8, ..records.clone() };
    let checkpoint = own("e");
    screen.list(&found(&[joined.clone(), other]));
    press(&mut screen, KeyCode::End);
    type_text(&mut screen, "D");
    let asked = shown_by(&mut screen, 120, 40);
    assert!(asked.contains("delete 2 files with 1 run not chosen for good?"), "{asked}");
    std::fs::remove_file(checkpoint.source).expect("a file");
    type_text(&mut screen, "y");
    assert!(!path("d").exists(), "all files of the run");
    // A file with a run that has ended, and one that goes on.
    let grows = SavedRun { kind: Kind::Records(Ending::Open), seed: 9, ..own("d") };
    screen.list(&found_now([records, grows]));
    press(&mut screen, KeyCode::Home);
    press(&mut screen, KeyCode::Delete);
    assert!(shown_by(&mut screen, 120, 40).contains("d still grows"));
    type_text(&mut screen, "y");
    assert!(path("d").exists());
}

#[test]
fn the_list_stays_while_a_run_is_opened() {
    let mut screen = screen();
    let (go_on, waits) = channel();
    let waits = parking_lot::Mutex::new(waits);
    screen.opener = Arc::new(move |_, progress| {
        progress.begin(1, 2);
        let _ = waits.lock().recv();
        Err(miette!("is cut off at 12 bytes"))
    });
    for gives_up in [true, false] {
        let file = "saves/large.safetensors".into();
        screen.wish = Some(Wish { file, beside: None, warning: None });
        screen.on_tick();
        let shown = shown_by(&mut screen, 80, 24);
        assert!(shown.contains("opening large.safetensors ...") && shown.contains("5 runs"));
        if gives_up {
            press(&mut screen, KeyCode::Esc);
            assert!(screen.opening.is_none());
        }
        go_on.send(()).expect("it waits");
        while screen.opening.is_some() {
            screen.on_tick();
        }
    }
    assert!(!screen.is_done() && shown_by(&mut screen, 80, 24).contains("is cut off at 12 bytes"));
}
