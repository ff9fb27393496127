//! Text that does not fit is wrapped, or ends with dots.

use std::collections::HashSet;

use ratatui::layout::{Margin, Rect};

use super::staged::staged_app;
use super::*;
use crate::tui::lists;
use crate::tui::panes::Pane;
use crate::tui::render::pane_lines;
use gdg::train::Success;

/// A name as long as names get, which ends with `END`.
const LONG_NAME: &str = "a-very-long-name-of-a-map-that-somebody-has-chosen-with-great-care-and-\
                         that-goes-on-and-on-because-nothing-forbids-it-END";

/// The screens on which everything is drawn, and one with room for everything.
const SIZES: [(u16, u16); 3] = [(80, 24), (60, 20), (120, 40)];
const WIDE: (u16, u16) = (240, 70);

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || "-_./'".contains(c)
}

/// Returns the words of a screen.
fn words(shown: &str) -> HashSet<&str> {
    let all = shown.split(|c: char| !is_word(c));
    all.filter(|word| !word.is_empty() && !word.ends_with("...")).collect()
}

/// Checks that no row ends within a word that the wide screen shows in full, unless with dots or
/// because the rest follows on the next row.
fn check_cuts(what: &str, (width, height): (u16, u16), narrow: &[String], wide: &[String]) {
    let wide = wide.join("\n");
    let known = words(&wide);
    let mut starts: Vec<&str> = known.iter().copied().collect();
    starts.sort_unstable();
    for (row, next) in narrow.iter().zip(narrow.iter().skip(1).chain([&String::new()])) {
        let end = row.trim_end();
        let Some(last) = end.rsplit(|c: char| !is_word(c)).next() else { continue };
        let is_number = !last.chars().any(char::is_alphabetic);
        if last.len() < 2 || is_number || known.contains(last) || end.ends_with("...") {
            continue;
        }
        let rest = next.trim_start().split(|c: char| !is_word(c)).next().unwrap_or_default();
        let at = starts.partition_point(|word| *word < last);
        let cut = starts[at..].iter().take_while(|word| word.starts_with(last));
        // The wide screen wraps long words elsewhere.
        let follows = |word: &&&str| {
            let own = &word[last.len()..];
            !rest.is_empty() && (own.starts_with(rest) || rest.starts_with(own))
        };
        let lost: Vec<&&str> = cut.filter(|word| !follows(word)).collect();
        assert!(
            lost.is_empty(),
            "{what} at {width} x {height}: {last} of {lost:?} in {end:?}\n{}",
            narrow.join("\n")
        );
    }
}

/// Returns the rows within an area, in which only text is kept.
fn rows_in(buffer: &ratatui::buffer::Buffer, area: Rect) -> Vec<String> {
    let row = |y| (area.left()..area.right()).map(|x| buffer[(x, y)].symbol()).collect();
    (area.top()..area.bottom()).map(row).collect()
}

/// Returns what is checked of a screen: the open dialog, or else the lines around the map, and the
/// panes.
fn parts(app: &App, buffer: &ratatui::buffer::Buffer) -> Vec<Vec<String>> {
    let (all, map) = (buffer.area, app.screen.layout.map_pane);
    if !app.screen.dialogs.is_empty() {
        return vec![rows_in(buffer, app.screen.layout.dialog.inner(Margin::new(1, 0)))];
    }
    let line = |y| Rect { y, height: 1, ..all };
    let side =
        Rect { x: map.right() + 1, width: all.right().saturating_sub(map.right() + 1), ..map };
    let hint = Rect { height: 1, ..map };
    // Notices cover the line below the map.
    let rows = u16::from(app.screen.log.notice().is_none());
    let info = Rect { y: map.bottom().saturating_sub(1), height: rows, ..map };
    [line(0), side, hint, info, Rect { y: all.bottom() - 4, height: 4, ..all }]
        .map(|area| rows_in(buffer, area.intersection(all)))
        .to_vec()
}

/// Checks what `prepare` shows.
fn check(what: &str, prepare: impl Fn(&mut Still)) {
    let shown = |(width, height)| {
        let mut app = staged_app(width, height);
        prepare(&mut app);
        let drawn = draw(&mut app, width, height).backend().buffer().clone();
        parts(&app, &drawn)
    };
    let wide = shown(WIDE).concat();
    for size in SIZES {
        for narrow in shown(size) {
            check_cuts(what, size, &narrow, &wide);
            let text = narrow.join("\n");
            if let Some((_, rest)) = text.split_once("a-very-") {
                let whole: String = rest.split_whitespace().collect();
                assert!(
                    whole.contains("END") || rest.contains("..."),
                    "{what} at {size:?}: the name is cut\n{text}"
                );
            }
        }
    }
}

fn long_path() -> PathBuf {
    Path::new("saves").join(LONG_NAME).with_extension("safetensors")
}

/// Returns a map of that name with the rooms' walls.
fn long_map() -> Arc<Grid> {
    Arc::new(rooms().named(LONG_NAME))
}

/// Returns a saved run with long values.
fn long_run() -> Description {
    let folder = tempfile::tempdir().expect("a folder");
    let mut found = saved_run(folder.path(), &staged_app(80, 24).app);
    found.updates = 123_456_789;
    found.file = long_path();
    found.run.seed = u64::MAX;
    found.success = Some(Success { updates: 1, greedy: Some(0.5), planned: Some(1.0) });
    found
}

#[test]
fn no_dialog_cuts_text_without_saying_so() {
    for action in [
        Action::Settings,
        Action::Palette,
        Action::Method,
        Action::Preset,
        Action::NewSeed,
        Action::Save,
        Action::SaveAs,
        Action::SaveMap,
        Action::NewMap,
        Action::ResizeMap,
        Action::RandomMap,
        Action::OpenMap,
        Action::Export,
        Action::Theme,
        Action::Autosave,
        Action::Help,
    ] {
        check(&format!("{action:?}"), |app| app.act(action));
    }
    for down in [3, 9, 20, 40, 60] {
        check(&format!("setting {down}"), |app| {
            app.act(Action::Settings);
            (0..down).for_each(|_| press(app, KeyCode::Down));
        });
    }
}

/// A question by its name.
type Ask<'a> = (&'a str, Box<dyn Fn() -> crate::tui::dialog::Picker + 'a>);

#[test]
fn no_question_cuts_what_it_asks_about() {
    let (path, map) = (long_path(), long_map());
    let app = still();
    let mut unsaved = Snapshot::clone(&app.screen.latest);
    unsaved.counters.updates = 223_456_789;
    let autosave = path.with_file_name(format!("{LONG_NAME}-auto-123456789.safetensors"));
    let autosaves = Arc::new(vec![(123_456_789, autosave)]);
    let autosaved = Snapshot { autosaves, ..unsaved.clone() };
    let run = app.screen.run();
    let questions: [Ask; 7] = [
        ("quit", Box::new(|| lists::quit_choices(&unsaved, true, &path))),
        ("quit with autosave", Box::new(|| lists::quit_choices(&autosaved, true, &path))),
        ("load", Box::new(|| lists::load_choices(&unsaved, path.clone()))),
        ("change", Box::new(|| lists::change_choices(&autosaved, run.clone()))),
        ("tour", Box::new(|| lists::tour_choices(&unsaved, true))),
        ("restart", Box::new(|| lists::restart_choices(u64::MAX))),
        (
            "map",
            Box::new(|| lists::map_switch_choices(&map, Some(&path), Some(&rooms()), None, true)),
        ),
    ];
    for (what, question) in &questions {
        check(what, |app| app.screen.open(question()));
        // Whoever decides sees all that is at stake, on the smallest screen.
        let mut app = staged_app(60, 20);
        app.screen.open(question());
        let shown = text(&draw(&mut app, 60, 20)).replace(['\n', '\u{2502}', ' '], "");
        for item in question().items() {
            let all: String = item.detail.split_whitespace().collect();
            assert!(shown.contains(&all), "{what}: {all} is not in\n{shown}");
        }
    }
}

#[test]
fn no_line_cuts_text_without_saying_so() {
    let found = long_run();
    check("offer", |app| app.screen.offer = Some(found.clone()));
    check("first run", |app| app.screen.first_run = true);
    check("error", |app| app.report(&format!("cannot write {LONG_NAME}: no such file")));
    check("notice", |app| app.screen.notify(&format!("saved {LONG_NAME}")));
    for pane in crate::tui::panes::Pane::ALL {
        check(&format!("{pane:?}"), |app| app.act(Action::Show(pane)));
    }
    check("title", |app| {
        app.change_snapshot(|snapshot| {
            snapshot.title = LONG_NAME.into();
            snapshot.saved = Some((10_000, Arc::new(long_path())));
        });
        app.maze_mut().map = long_map();
    });
    check("editor", |app| app.act(Action::ToggleEdit));
    check("inspector", |app| app.act(Action::Inspect));
}

#[test]
fn an_offer_stays_within_the_map_and_says_how_to_resume() {
    let found = long_run();
    for (width, height) in SIZES {
        let mut app = staged_app(width, height);
        app.screen.offer = Some(found.clone());
        let drawn = draw(&mut app, width, height);
        let map = app.screen.layout.map_pane;
        let row = text(&drawn).lines().nth(1).expect("a row").to_owned();
        let line: String = row.chars().skip(map.x.into()).take(map.width.into()).collect();
        assert!(line.contains("resumes"), "{width} x {height}: {line:?} of {row:?}");
    }
}

#[test]
fn a_screen_without_room_for_panes_says_that_there_are_some() {
    for (width, height) in SIZES {
        let mut app = staged_app(width, height);
        let shown = text(&draw(&mut app, width, height));
        assert!(shown.contains("panes"), "{width} x {height}: {shown}");
        assert!(shown.contains("quit") && shown.contains("help"), "{shown}");
    }
}

#[test]
fn nothing_is_cut_off_on_the_smallest_screen() {
    let longest = staged_app(80, 24);
    for method in [Method::default(), gdg()] {
        for following in [None, Some(2)] {
            let mut app = staged_app(80, 24);
            app.screen.following = following;
            let mut snapshot = (*app.screen.snapshot).clone();
            // Numbers as long as after a day of training.
            Arc::make_mut(&mut snapshot.run).method = method.clone();
            snapshot.seconds = 90_000.0;
            snapshot.rates = (1_234.0, 19_744.0);
            snapshot.counters.updates = 99_900_000;
            snapshot.counters.env_steps = 16 * snapshot.counters.updates;
            snapshot.limits.updates = Some(500_000_000);
            snapshot.replay = (999_999, 1_000_000);
            snapshot.losses.actor = 1_234.5;
            snapshot.evaluations = longest.screen.snapshot.evaluations.clone();
            app.on_snapshot(Arc::new(snapshot));
            for pane in [Pane::Training, Pane::Walk, Pane::Legend] {
                let lines = pane_lines(pane, &app.screen, &app.scene, 29).expect("lines");
                // Header, names and title above, footer below; a border on the left.
                assert!(lines.len() <= 20, "{} lines in {}", lines.len(), pane.name());
                for line in lines {
                    assert!(line.width() <= 29, "{} in {} is cut off", line, pane.name());
                }
            }
        }
    }
}

#[test]
fn the_line_below_the_map_is_never_cut_off() {
    for width in 80..=120 {
        let shown = text(&draw(&mut staged_app(width, 24), width, 24));
        let line = shown.lines().nth(22).expect("the line above the footer");
        let interval = line
            .split_once(", a line every ")
            .map(|(_, rest)| rest.starts_with(|c: char| c.is_ascii_digit()));
        assert_eq!(interval.unwrap_or(false), line.contains(", a"), "{width} columns: {line}");
        assert!(width < 100 || interval.is_some(), "{width} columns: {line}");
    }
}
