//! Lists of runs on a buffer instead of a terminal.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind};
use miette::miette;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::Position;

use super::*;
use crate::experiment::job::EvaluationAt;
use crate::experiment::runs::{Ending, Kind, SavedRun, Skipped};
use crate::tui::tests::screens::check_drawn;
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

/// Opens nothing.
fn opener() -> Opener {
    Arc::new(|_, _| Err(miette!("is cut off at 12 bytes")))
}

/// Returns a list with runs of several kinds, one of which cannot be read.
pub fn screen() -> RunsScreen {
    let keymap = Keymap::new(&BTreeMap::new()).expect("the table's keys");
    let config = UiConfig::default();
    let mut screen = RunsScreen::new("saves", Reading::nothing(), opener(), &config, keymap);
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

fn drawn(screen: &mut RunsScreen, width: u16, height: u16) -> Terminal<TestBackend> {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a buffer");
    terminal.draw(|frame| screen.draw(frame)).expect("a frame");
    terminal
}

pub fn text(screen: &mut RunsScreen, width: u16, height: u16) -> String {
    let terminal = drawn(screen, width, height);
    let buffer = terminal.backend().buffer();
    let rows = buffer.content.chunks(usize::from(width));
    rows.map(|row| row.iter().map(ratatui::buffer::Cell::symbol).collect::<String>() + "\n")
        .collect()
}

pub fn press(screen: &mut RunsScreen, code: KeyCode) {
    screen.on_event(&Event::Key(KeyEvent::new(code, KeyModifiers::NONE)));
}

/// Waits for what is being done.
pub fn settle(screen: &mut RunsScreen) {
    while screen.work.is_some() {
        screen.on_tick();
    }
}

fn type_text(screen: &mut RunsScreen, text: &str) {
    text.chars().for_each(|c| press(screen, KeyCode::Char(c)));
}

fn click(screen: &mut RunsScreen, at: Position) {
    screen.on_event(&Event::Mouse(MouseEvent {
        kind: MouseEventKind::Down(MouseButton::Left),
        column: at.x,
        row: at.y,
        modifiers: KeyModifiers::NONE,
    }));
}

/// Returns where a text begins on the screen.
fn place_of(shown: &str, text: &str) -> Position {
    let (row, line) = shown
        .lines()
        .enumerate()
        .find(|(_, line)| line.contains(text))
        .unwrap_or_else(|| panic!("{text} is missing: {shown}"));
    let before = line.split(text).next().unwrap_or_default();
    Position::new(before.chars().count() as u16, row as u16)
}

#[test]
fn lists_match_their_snapshots() {
    for (width, height) in [(80, 24), (120, 40), (200, 60)] {
        let mut screen = screen();
        check_drawn(&format!("runs-{width}x{height}"), &drawn(&mut screen, width, height));
        type_text(&mut screen, " j j ");
        check_drawn(&format!("runs-marked-{width}x{height}"), &drawn(&mut screen, width, height));
    }
    let mut screen = screen();
    type_text(&mut screen, " j j/rooms");
    check_drawn("runs-filtered-80x24", &drawn(&mut screen, 80, 24));
    press(&mut screen, KeyCode::Enter);
    press(&mut screen, KeyCode::Delete);
    screen.theme = Theme::new(ThemeName::Mono, ColourDepth::Mono);
    check_drawn("runs-delete-mono-80x24", &drawn(&mut screen, 80, 24));
    press(&mut screen, KeyCode::Char('n'));
    press(&mut screen, KeyCode::Char('?'));
    check_drawn("runs-help-80x24", &drawn(&mut screen, 80, 24));
}

#[test]
fn every_size_can_be_drawn() {
    let mut screen = screen();
    for (width, height) in [(1, 1), (59, 16), (60, 16), (61, 17), (80, 24), (300, 100)] {
        for keys in [" ", "?", "q", "/x", "\n"] {
            type_text(&mut screen, keys);
            drawn(&mut screen, width, height);
        }
        screen.next = None;
        screen.help = None;
    }
    let shown = text(&mut screen, 24, 6).split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(shown, "the list needs 60 x 16 characters: this terminal has 24 x 6");
    assert!(text(&mut screen, 24, 2).trim_end().ends_with("..."), "never cut without dots");
}

#[test]
fn the_end_of_a_long_list_says_what_cannot_be_read() {
    let mut screen = screen();
    let file = |seed: u64| format!("many-{seed}");
    let runs: Vec<SavedRun> =
        (0..50).map(|seed| saved(&file(seed), "own", "gdg", seed, &[])).collect();
    let problems = vec![("damaged.safetensors".into(), "is empty".to_owned())];
    screen.list(&Found { problems, ..found(&runs) });
    let hidden = text(&mut screen, 80, 24);
    assert!(hidden.contains("end of the list") && !hidden.contains("is empty"), "{hidden}");
    press(&mut screen, KeyCode::End);
    let shown = text(&mut screen, 80, 24);
    assert!(shown.contains("damaged.safetensors  is empty"), "{shown}");
    let is_selected = |line: &str| line.split_whitespace().take(3).eq(["own", "gdg", "0"]);
    assert!(shown.lines().any(is_selected), "it stays in view: {shown}");
}

#[test]
fn files_that_cannot_be_read_are_rows_that_tell_all() {
    let mut screen = screen();
    let problems: Vec<_> = (0..30)
        .map(|i| {
            (format!("many/bad-{i}.jsonl").into(), format!("line 7: {} {i}", "no ".repeat(30)))
        })
        .collect();
    screen.list(&Found { problems, ..found(&[saved("good", "own", "gdg", 0, &[])]) });
    press(&mut screen, KeyCode::End);
    let shown = text(&mut screen, 80, 24);
    assert!(
        shown.contains("many/bad-29.jsonl: line 7:") && shown.contains(" no 29 "),
        "not cut: {shown}"
    );
    assert!(shown.contains(" 23 to 31 of 31 "), "{shown}");
    press(&mut screen, KeyCode::Enter);
    assert!(screen.wish.is_none() && text(&mut screen, 80, 24).contains("cannot be resumed"));
    type_text(&mut screen, "/bad-12\n");
    press(&mut screen, KeyCode::Enter);
    let shown = text(&mut screen, 80, 24);
    assert!(shown.contains("0 of 1 run ") && shown.contains(" bad-12.jsonl"), "{shown}");
    assert!(!shown.contains("bad-29"), "{shown}");
}

#[test]
fn long_words_leave_room_for_numbers_and_files() {
    let mut screen = screen();
    let long = "x".repeat(300);
    let run = saved("own.safetensors", &long, &long, u64::MAX, &[0.375]);
    screen.list(&found(&[run, saved("other.safetensors", "own", "gdg", 0, &[0.5])]));
    for (width, height) in [(60, 20), (80, 24)] {
        let shown = text(&mut screen, width, height);
        for part in ["xxx...", " 0.38 ", " own.safete", " other.safe"] {
            assert!(shown.contains(part), "{part:?} at {width}: {shown}");
        }
    }
    press(&mut screen, KeyCode::Char(' '));
    press(&mut screen, KeyCode::Char(' '));
    press(&mut screen, KeyCode::Home);
    let one = |name: &str| saved(&format!("{name}-{long}"), "own", "gdg", 0, &[0.5]);
    screen.list(&found(&["one", "two"].map(one)));
    type_text(&mut screen, " j ");
    let shown = text(&mut screen, 80, 24);
    assert!(shown.contains("  A two") && shown.contains("  B one"), "both curves: {shown}");
}

#[test]
fn the_footer_of_a_narrow_list_says_how_to_resume_and_compare() {
    let mut screen = screen();
    for (width, left_out) in [(60, Some("plot")), (80, Some("sort")), (120, None)] {
        let shown = text(&mut screen, width, 24);
        let footer = shown.lines().last().expect("a footer");
        let keys = ["Space mark", "/ filter", "Enter resume", "c compare", "? help", "q quit"];
        assert!(keys.iter().all(|key| footer.contains(key)), "{width} columns: {footer}");
        assert_eq!(left_out.map(|key| footer.contains(key)), left_out.map(|_| false), "{footer}");
    }
}

#[test]
fn curves_show_the_marked_runs_and_change_their_axes() {
    let mut screen = screen();
    let shown = text(&mut screen, 120, 40);
    assert!(shown.contains("> trap-her-3 ") && !shown.contains("A fourrooms"), "{shown}");
    press(&mut screen, KeyCode::End);
    press(&mut screen, KeyCode::Up);
    press(&mut screen, KeyCode::Char(' '));
    let shown = text(&mut screen, 120, 40);
    assert!(shown.contains("  A fourrooms ") && shown.contains(" 4,000 "), "{shown}");
    press(&mut screen, KeyCode::Char('x'));
    let shown = text(&mut screen, 120, 40);
    assert!(shown.contains("over environment steps") && shown.contains("not known"), "{shown}");
    press(&mut screen, KeyCode::Char('x'));
    press(&mut screen, KeyCode::Char('v'));
    let shown = text(&mut screen, 120, 40);
    assert!(shown.contains("success rate without plans over seconds"), "{shown}");
}

#[test]
fn files_that_grow_change_curves_and_numbers() {
    let mut screen = screen();
    press(&mut screen, KeyCode::Char(' '));
    let run = |success: &[f64]| saved("saves/own.safetensors", "own", "gdg", 7, success);
    screen.list(&found(&[run(&[0.25])]));
    press(&mut screen, KeyCode::Char(' '));
    assert!(text(&mut screen, 120, 40).contains(" 0.25 "));
    screen.list(&found(&[run(&[0.25, 0.75])]));
    let shown = text(&mut screen, 120, 40);
    assert!(
        shown.contains(" 0.75 ") && shown.contains(" A own") && !shown.contains("0.25"),
        "{shown}"
    );
}

#[test]
fn the_mouse_sorts_selects_and_marks() {
    let mut screen = screen();
    let shown = text(&mut screen, 120, 40);
    click(&mut screen, place_of(&shown, "success "));
    assert_eq!(screen.list.order(), (list::Column::Success, false));
    let shown = text(&mut screen, 120, 40);
    let at = place_of(&shown, "fourrooms-2.safetensors");
    click(&mut screen, at);
    assert!(screen.list.marked().is_empty());
    click(&mut screen, at);
    assert_eq!(screen.list.marked()[0].1.run.seed, 1);
    let at = place_of(&shown, "success rate over");
    click(&mut screen, at);
    assert_eq!(screen.curves.axis, Axis::Steps);
}

#[test]
fn only_runs_with_a_checkpoint_can_be_resumed() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("own.safetensors");
    std::fs::write(&file, "a checkpoint").expect("a file");
    let mut screen = screen();
    press(&mut screen, KeyCode::Enter);
    let shown = text(&mut screen, 120, 40);
    assert!(screen.wish.is_none() && shown.contains("its checkpoint was not kept"), "{shown}");
    let own = |path: &Path| saved(&path.to_string_lossy(), "own", "gdg", 7, &[]);
    screen.list(&found(&[own(&folder.path().join("gone.safetensors")), own(&file)]));
    press(&mut screen, KeyCode::End);
    press(&mut screen, KeyCode::Enter);
    let shown = text(&mut screen, 200, 40);
    assert!(screen.wish.is_none() && shown.contains("is gone"), "{shown}");
    press(&mut screen, KeyCode::Home);
    press(&mut screen, KeyCode::Enter);
    assert_eq!(screen.wish, Some(Wish::Resume(Saved { file, goes_on: false })));
}

#[test]
fn a_run_that_another_program_still_trains_is_opened_as_such() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("own.safetensors");
    std::fs::write(&file, "a checkpoint").expect("a file");
    let run = |name: &str, ending| SavedRun {
        kind: Kind::Records(ending),
        source: name.into(),
        ..saved(&file.to_string_lossy(), "own", "gdg", 7, &[])
    };
    // Its checkpoint is of the same run, as it is the one that its records name.
    let is_own = |run: SavedRun| SavedRun { source: file.clone(), ..run };
    let runs = [run("done.jsonl", Ending::Finished), is_own(run("grows", Ending::Open))];
    let now = Some(SystemTime::now());
    let runs = runs.into_iter().map(|run| (Arc::new(run), now)).collect();
    let mut screen = screen();
    screen.list(&Found { runs, ..Found::default() });
    press(&mut screen, KeyCode::Char('c'));
    let row = screen.list.shown().position(|entry| entry.run.source == file);
    screen.list.select(row.expect("its row"));
    press(&mut screen, KeyCode::Enter);
    let resumed = screen.wish.take().expect("a wish");
    assert_eq!(resumed, Wish::Resume(Saved { file: file.clone(), goes_on: true }));
    let told = resumed.warning().expect("a warning");
    assert!(told.contains("as last saved") && told.contains("to another name"), "{told}");
    let [ended, grows] = [false, true].map(|goes_on| Saved { file: file.clone(), goes_on });
    let told = |both| Wish::Compare(both).warning().unwrap_or_default();
    assert!(told([ended.clone(), grows.clone()]).contains("still train B:"));
    assert!(told([grows.clone(), grows]).contains("still train A and B:"));
    assert_eq!(told([ended.clone(), ended]), "");
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
    press(&mut screen, KeyCode::Char('c'));
    assert!(text(&mut screen, 120, 40).contains("mark two runs"));
    press(&mut screen, KeyCode::Char(' '));
    press(&mut screen, KeyCode::Down);
    press(&mut screen, KeyCode::Char('c'));
    assert!(
        text(&mut screen, 120, 40).contains("different maps cannot be compared: own and other")
    );
    press(&mut screen, KeyCode::Down);
    press(&mut screen, KeyCode::Char('c'));
    let both = ["a", "c"].map(|name| Saved { file: path(name), goes_on: false });
    assert_eq!(screen.wish, Some(Wish::Compare(both)));
}

#[test]
fn space_marks_and_unmarks_where_it_is_and_letters_go_to_the_first_and_the_last_row() {
    let mut screen = screen();
    press(&mut screen, KeyCode::Char('G'));
    assert_eq!(screen.list.position(), screen.list.rows() - 1);
    press(&mut screen, KeyCode::Char('g'));
    for marked in [1, 0] {
        press(&mut screen, KeyCode::Char(' '));
        assert_eq!((screen.list.position(), screen.list.marked().len()), (0, marked));
    }
}

#[test]
fn the_question_names_all_files_or_says_how_many_more_there_are() {
    let mut screen = screen();
    let folder = "saves/a-long-name-of-a-folder/";
    let own = |i: u64| saved(&format!("{folder}run-{i}.safetensors"), "own", "gdg", i, &[]);
    for (runs, left_out) in [(4, None), (26, Some("and 7 more"))] {
        screen.list(&found(&(0..runs).map(own).collect::<Vec<_>>()));
        press(&mut screen, KeyCode::Home);
        for _ in 0..runs {
            type_text(&mut screen, " j");
        }
        type_text(&mut screen, "D");
        let shown = text(&mut screen, 80, 24);
        let named = |i: &u64| shown.contains(&format!("run-{i}.safetensors"));
        assert_eq!(left_out.is_none(), (0..runs).all(|i| named(&i)), "{shown}");
        assert!(left_out.is_none_or(|text| shown.contains(text)), "{shown}");
        press(&mut screen, KeyCode::Char('n'));
        press(&mut screen, KeyCode::Esc);
    }
}

#[test]
fn deleting_asks_and_removes_only_the_files_of_marked_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let own = |name: &str| saved(&path(name).to_string_lossy(), "own", "gdg", 7, &[]);
    let runs = ["a.safetensors", "b.safetensors", "c.safetensors"].map(own);
    for run in &runs {
        std::fs::write(&run.source, "a checkpoint").expect("a file");
    }
    let mut screen = screen();
    screen.list(&found(&runs));
    press(&mut screen, KeyCode::End);
    press(&mut screen, KeyCode::Char('D'));
    assert!(text(&mut screen, 200, 40).contains("delete 1 file for good?"));
    press(&mut screen, KeyCode::Enter);
    assert!(path("a.safetensors").exists() && screen.question.is_none(), "only y deletes");
    press(&mut screen, KeyCode::Home);
    type_text(&mut screen, " j D");
    let asked = text(&mut screen, 80, 24);
    for part in ["delete 2 files for good?", "y: yes  n: no", "c.safetensors", "b.safetensors"] {
        assert!(asked.contains(part), "{part}: {asked}");
    }
    press(&mut screen, KeyCode::Char('y'));
    settle(&mut screen);
    let left = ["a", "b", "c"].map(|name| path(&format!("{name}.safetensors")).exists());
    assert_eq!(left, [true, false, false]);
    assert!(text(&mut screen, 120, 40).contains("deleted 2 files"));
    let damaged = path("damaged.jsonl");
    std::fs::write(&damaged, "[]").expect("a file");
    let problems = vec![(damaged.clone(), "line 1: not a record".to_owned())];
    screen.list(&Found { problems, ..found(&runs[..1]) });
    press(&mut screen, KeyCode::End);
    type_text(&mut screen, "Dy");
    settle(&mut screen);
    assert!(!damaged.exists() && path("a.safetensors").exists(), "a file that is no run");
    let records = path("a.jsonl");
    std::fs::write(&records, "records").expect("a file");
    let joined = SavedRun {
        kind: Kind::Records(Ending::Finished),
        source: records.clone(),
        others: vec![path("a.safetensors")],
        ..runs[0].clone()
    };
    let another = SavedRun { seed: 8, others: Vec::new(), ..joined.clone() };
    screen.list(&found(&[joined.clone(), another]));
    press(&mut screen, KeyCode::End);
    type_text(&mut screen, "D");
    assert!(text(&mut screen, 120, 40).contains("delete 2 files with 1 run not chosen for good?"));
    press(&mut screen, KeyCode::Char('n'));
    screen.list(&found(&[joined]));
    type_text(&mut screen, "D");
    std::fs::remove_file(&records).expect("another program removes it meanwhile");
    type_text(&mut screen, "y");
    settle(&mut screen);
    assert!(!records.exists() && !path("a.safetensors").exists(), "all files of the run");
    let grows = SavedRun { kind: Kind::Records(Ending::Open), ..runs[0].clone() };
    let now = Some(SystemTime::now());
    screen.list(&Found { runs: vec![(Arc::new(grows), now)], ..Found::default() });
    press(&mut screen, KeyCode::Delete);
    assert!(text(&mut screen, 120, 40).contains("still grows"));
}

#[test]
fn a_file_is_kept_while_any_of_its_runs_grows() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("both.jsonl");
    std::fs::write(&file, "records").expect("a file");
    let run = |seed, ending| SavedRun {
        kind: Kind::Records(ending),
        checkpoint: None,
        ..saved(&file.to_string_lossy(), "own", "gdg", seed, &[])
    };
    let runs = [run(1, Ending::Finished), run(2, Ending::Open)];
    let now = Some(SystemTime::now());
    let runs = runs.into_iter().map(|run| (Arc::new(run), now)).collect();
    let mut screen = screen();
    screen.list(&Found { runs, ..Found::default() });
    press(&mut screen, KeyCode::Home);
    assert_eq!(screen.list.selected().map(|entry| entry.run.seed), Some(1), "the finished one");
    type_text(&mut screen, "D");
    assert!(text(&mut screen, 120, 40).contains("both.jsonl still grows"));
    type_text(&mut screen, "y");
    assert!(file.exists());
}
