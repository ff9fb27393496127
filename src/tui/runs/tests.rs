//! Lists of runs on a buffer instead of a terminal.

use std::collections::BTreeMap;
use std::time::SystemTime;

use super::*;
use crate::experiment::saved_runs::{RunKind, RunState, SavedRun};
use crate::experiment::spec::EvaluationAt;
use crate::tui::tests::{click, draw, place_of, press, press_with, shown_by, type_text};
use crate::tui::theme::ThemeName;
use gdg::train::{Evaluation, Score};

/// Returns a saved run with these success rates, evaluated every 1,000 updates.
pub fn saved(file: &str, map: &str, method: &str, seed: u64, success: &[f64]) -> SavedRun {
    let score = |success| Score { success: Some(success), ..Score::default() };
    let plans = method == "gdg-bridge";
    let evaluation = |(i, success): (usize, &f64)| EvaluationAt {
        updates: 1_000 * (i as u64 + 1),
        env_steps: 16_000 * (i as u64 + 1),
        seconds: 2.0 * (i as f64 + 1.0),
        evaluation: Evaluation {
            alone: score(if plans { success / 2.0 } else { *success }),
            planned: plans.then(|| score(*success)),
            explored: Some(0.5),
            ..Evaluation::default()
        },
    };
    SavedRun {
        source: file.into(),
        kind: RunKind::Checkpoint,
        end: Some(RunState::Ended),
        map: map.to_owned(),
        method: method.to_owned(),
        settings: ["preset=default", "hidden=16"].map(str::to_owned).to_vec(),
        seed,
        updates: 1_000 * success.len() as u64,
        evaluations: success.iter().enumerate().map(evaluation).collect(),
        checkpoint: Some(file.into()),
        ..SavedRun::default()
    }
}

/// Returns runs as they are found, written one after the other.
pub fn found(runs: &[SavedRun]) -> Vec<Arc<SavedRun>> {
    let day = |i: usize| SystemTime::UNIX_EPOCH + Duration::from_hours(36 + 24 * i as u64);
    let dated = |(i, run): (usize, &SavedRun)| SavedRun { written: Some(day(i)), ..run.clone() };
    runs.iter().enumerate().map(dated).map(Arc::new).collect()
}

fn damaged(file: impl Into<PathBuf>, problem: &str) -> SavedRun {
    let problem = Some(problem.to_owned());
    SavedRun { source: file.into(), kind: RunKind::Damaged, problem, ..SavedRun::default() }
}

impl RunsScreen {
    fn show_runs(&mut self, runs: &[SavedRun]) {
        self.list(&FoundRuns { runs: found(runs), read: [1, 1] });
    }
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
        kind: RunKind::Records,
        end: Some(RunState::Interrupted),
        checkpoint: None,
        ..saved("records/rooms.jsonl", "rooms", "her", seed, success)
    };
    let result = SavedRun {
        kind: RunKind::Result,
        end: Some(RunState::Ended),
        variant: Some("small".to_owned()),
        settings: ["preset=tuned", "hidden=8"].map(str::to_owned).to_vec(),
        checkpoint: None,
        ..saved("suite/jobs/trap-her-3.json", "trap", "her", 3, &[0.3, 0.4, 0.5])
    };
    screen.show_runs(&[
        saved("saves/fourrooms.safetensors", "fourrooms", "gdg-bridge", 0, &[0.3, 0.7, 0.9, 1.0]),
        saved("saves/fourrooms-2.safetensors", "fourrooms", "gdg", 1, &[0.2, 0.4, 0.5]),
        records(1, &[0.1, 0.3]),
        records(2, &[]),
        result,
        damaged("saves/damaged.safetensors", ": is cut off at 12 bytes"),
    ]);
    screen
}

#[test]
fn every_size_can_be_drawn() {
    let mut screen = screen();
    let long = "x".repeat(300);
    let run = saved(&format!("own-{long}"), &long, &long, u64::MAX, &[0.375]);
    for all in [None, Some([run, saved("other", "\u{8ff7}\u{5bae}", "gdg", 0, &[])])] {
        all.iter().for_each(|runs| screen.show_runs(runs));
        for (width, height) in [(1, 1), (59, 16), (60, 16), (61, 17), (80, 24), (300, 100)] {
            for keys in ["m", "?", "?", "/x", "\n", "j", "D", "n"] {
                type_text(&mut screen, keys);
                draw(&mut screen, width, height);
            }
        }
    }
}

#[test]
fn files_that_cannot_be_read_are_rows_that_tell_all() {
    let mut screen = screen();
    let bad = |i| damaged(format!("many/bad-{i}.jsonl"), &format!(":7: {} {i}", "no ".repeat(30)));
    let runs: Vec<_> =
        [saved("good", "own", "gdg", 0, &[])].into_iter().chain((0..30).map(bad)).collect();
    screen.show_runs(&runs);
    press(&mut screen, KeyCode::End);
    let shown = shown_by(&mut screen, 80, 24);
    for part in ["   bad-0.jsonl:7: no no", " no 0 ", " 22 to 31 of 31 "] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    press(&mut screen, KeyCode::Enter);
    assert!(screen.wish.is_none() && shown_by(&mut screen, 80, 24).contains("cannot be resumed"));
}

#[test]
fn ctrl_c_quits_wherever_it_is_pressed() {
    for keys in ["", "?", "/c", "D"] {
        let mut screen = screen();
        type_text(&mut screen, keys);
        press_with(&mut screen, KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert!(screen.is_done(), "after {keys:?}");
    }
}

#[test]
fn the_mouse_sorts_selects_and_marks() {
    let mut screen = screen();
    let shown = shown_by(&mut screen, 120, 40);
    click(&mut screen, MouseButton::Left, place_of(&shown, "planned "));
    assert_eq!(screen.list.order, (4, false));
    let shown = shown_by(&mut screen, 120, 40);
    let at = place_of(&shown, "fourrooms-2");
    click(&mut screen, MouseButton::Left, at);
    assert!(screen.list.marked().is_empty());
    click(&mut screen, MouseButton::Left, at);
    assert_eq!(screen.list.marked()[&0].seed, 1);
    let at = place_of(&shown, "success over");
    click(&mut screen, MouseButton::Left, at);
    assert_eq!(screen.curves.1, XAxis::Steps);
}

#[test]
fn runs_with_a_checkpoint_are_resumed_and_two_compared() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let own = |name: &str, map: &str| {
        std::fs::write(path(name), "a checkpoint").expect("a file");
        saved(&path(name).to_string_lossy(), map, "gdg", 7, &[])
    };
    let mut screen = screen();
    let grows = SavedRun { kind: RunKind::Records, end: None, ..own("a", "own") };
    let grows = Arc::new(SavedRun { written: Some(SystemTime::now()), ..grows });
    screen.list(&FoundRuns { runs: vec![grows.clone()], read: [1, 1] });
    assert!(shown_by(&mut screen, 200, 40).contains("Enter watch"));
    screen.show_runs(&[own("c", "own"), own("b", "own"), own("a", "own")]);
    type_text(&mut screen, "mjjm");
    press(&mut screen, KeyCode::Enter);
    let wish = Wish { file: path("a"), beside: Some(path("c")), warning: None, watches: None };
    assert_eq!(screen.wish.take(), Some(wish));
    std::fs::remove_file(path("c")).expect("a file");
    // Two that are marked go before the selected one.
    press(&mut screen, KeyCode::Enter);
    assert!(screen.wish.is_none() && shown_by(&mut screen, 200, 40).contains("is gone"));
    press(&mut screen, KeyCode::Esc);
    press(&mut screen, KeyCode::Home);
    press(&mut screen, KeyCode::Enter);
    let wish = Wish { file: path("a"), beside: None, warning: None, watches: None };
    assert_eq!(screen.wish.take(), Some(wish));
    // Another program still trains it.
    screen.list(&FoundRuns { runs: vec![grows.clone()], read: [1, 1] });
    press(&mut screen, KeyCode::Enter);
    let wish = screen.wish.take().expect("to watch it");
    assert_eq!((wish.watches, wish.warning), (Some(path("a")), None));
    screen
        .list(&FoundRuns { runs: [found(&[own("b", "own")]), vec![grows]].concat(), read: [1, 1] });
    type_text(&mut screen, "mjm");
    press(&mut screen, KeyCode::Enter);
    let told = screen.wish.take().and_then(|wish| wish.warning).expect("a warning");
    assert!(told.contains("as last saved") && told.contains("to another name"), "{told}");
}

#[test]
fn deleting_asks_and_removes_only_the_files_of_marked_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let own = |name: &str| {
        std::fs::write(path(name), "a checkpoint").expect("a file");
        saved(&path(name).to_string_lossy(), "own", "gdg", 7, &[])
    };
    let mut screen = screen();
    screen.show_runs(&["a", "b", "c"].map(own));
    type_text(&mut screen, "mjmD");
    let asked = shown_by(&mut screen, 200, 40);
    let parts = ["delete 2 files?", "/b, ", "/c; written just now", "n keep", "d delete"];
    assert!(parts.iter().all(|part| asked.contains(part)), "{asked}");
    press(&mut screen, KeyCode::Enter);
    assert!(path("c").exists() && screen.deletion.is_none(), "only d deletes");
    // Another program may have resumed one, and saved it.
    type_text(&mut screen, "D");
    let later = SystemTime::now() + Duration::from_secs(9);
    std::fs::File::open(path("b")).and_then(|file| file.set_modified(later)).expect("a file");
    type_text(&mut screen, "d");
    assert!(shown_by(&mut screen, 120, 40).contains("b has just been written: nothing is deleted"));
    screen.show_runs(&["a", "b", "c"].map(own));
    press(&mut screen, KeyCode::Home);
    type_text(&mut screen, "mjmDd");
    assert_eq!(["a", "b", "c"].map(|name| path(name).exists()), [true, false, false]);
    assert!(shown_by(&mut screen, 120, 40).contains("deleted 2 files"));
    screen.show_runs(&[damaged(path("a"), ":1: not a record")]);
    type_text(&mut screen, "Dd");
    assert!(!path("a").exists(), "a file that is no run");
    // A run of two files, one of which has another run, or is removed meanwhile.
    let records = SavedRun { kind: RunKind::Records, end: Some(RunState::Ended), ..own("d") };
    let joined = SavedRun { others: vec![path("e")], ..records.clone() };
    let other = SavedRun { seed: 8, ..records.clone() };
    screen.show_runs(&[joined, other]);
    press(&mut screen, KeyCode::End);
    type_text(&mut screen, "D");
    let asked = shown_by(&mut screen, 120, 40);
    assert!(asked.contains("delete 2 files with 1 run not chosen?"), "{asked}");
    type_text(&mut screen, "d");
    assert!(!path("d").exists(), "all files of the run");
    // A run whose beginning is in the file of another, and a checkpoint that another names.
    let [first, last] = ["d", "e"].map(|name| SavedRun { kind: RunKind::Records, ..own(name) });
    let kept = own("c");
    let goes_on =
        SavedRun { others: vec![path("d")], checkpoint: Some(path("c")), seed: 8, ..last };
    screen.show_runs(&[SavedRun { others: vec![path("c")], ..first }, goes_on, kept]);
    press(&mut screen, KeyCode::End);
    type_text(&mut screen, "D");
    let asked = shown_by(&mut screen, 120, 40);
    assert!(asked.contains("delete 1 file with 1 run not chosen?"), "{asked}");
    type_text(&mut screen, "n");
    // A file with a run that has ended, and one that goes on.
    let now = |run| Arc::new(SavedRun { written: Some(SystemTime::now()), ..run });
    let grows = SavedRun { end: None, seed: 9, kind: RunKind::Records, ..own("d") };
    screen.list(&FoundRuns { runs: vec![now(records), now(grows)], read: [1, 1] });
    press(&mut screen, KeyCode::Home);
    press(&mut screen, KeyCode::Delete);
    assert!(shown_by(&mut screen, 120, 40).contains("d still grows"));
    type_text(&mut screen, "D");
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
        screen.wish = Some(Wish { file, beside: None, warning: None, watches: None });
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
