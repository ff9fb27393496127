//! Snapshots of reviewed screens, with their styles.
//!
//! Everything drawn is made up, since training results differ between machines.

use std::path::Path;
use std::time::SystemTime;

use jiff::tz::TimeZone;

use super::picture::picture;
use super::*;
use crate::tui::action::Action;
use crate::tui::dialog::Choice;
use crate::tui::export::contents;
use crate::tui::layers::{Overlay, Overlays};
use crate::tui::lists;
use crate::tui::output::ExportKind;
use crate::tui::panes::Pane;
use crate::tui::render::pane_lines;
use crate::tui::runs::tests::saved;
use gdg::bridge::{BridgePoint, EdgeStatus, SearchOutcome};
use gdg::engine::{FollowedAgent, NextEvaluation, Snapshot};
use gdg::train::{
    CheckpointError, Counters, CurvePoint, Description, DistanceError, DistanceScore, Evaluation,
    Score, Success,
};
use gdg::viewer::maze::{Exploration, Walk};
use gdg::viewer::{Candidate, MazeView, View};

fn score(success: f64) -> Score {
    let by_distance = (1..=6).map(|i| DistanceScore {
        distance_steps: Some(f64::from(5 * i)),
        distance_cm: None,
        tasks: 10,
        success: Some((success + 0.1 - 0.05 * f64::from(i)).clamp(0.0, 1.0)),
        spl: Some(success),
    });
    Score {
        success: Some(success),
        spl: Some(success),
        steps_ratio: Some(1.1),
        by_distance: by_distance.collect(),
    }
}

/// Returns the fraction explored at a share of the run.
fn coverage(at: f64) -> f64 {
    0.8 * at.sqrt()
}

pub(super) fn evaluation(at: f64) -> Evaluation {
    Evaluation {
        greedy: score(0.6 * at),
        planned: Some(score(at)),
        straight: None,
        distance_error: Some(DistanceError { mape: 0.5 - 0.4 * at, ..DistanceError::default() }),
        bridges: None,
        coverage: Some(coverage(at)),
        marked: None,
    }
}

/// Returns an app in the middle of a run with fixed numbers on the rooms map, drawn once at the
/// given size.
pub(super) fn staged_app(width: u16, height: u16) -> Still {
    let mut app = still();
    draw(&mut app, width, height);
    let evaluations = (1..=4).map(|i| (2_500 * i, evaluation(0.25 * i as f64))).collect();
    let (search, followed) = (staged_search(), staged_agent());
    for updates in [2_500, 5_000, 7_500, 10_000] {
        let mut counters = Counters::default();
        (counters.updates, counters.env_steps, counters.episodes) =
            (updates, 16 * updates, updates / 10);
        let losses =
            gdg::learn::Losses { critic: 100.0 / updates as f32, model: 0.002, actor: 9.5 };
        let snapshot = Snapshot {
            phase: Phase::Running,
            counters,
            limits: Limits { updates: Some(20_000), ..Limits::default() },
            seconds: 12.0,
            rates: (812.0, 13_000.0),
            losses,
            replay: (15_000, 20_000),
            agents: Arc::new(vec![4.5, 3.5, 7.5, 1.5, 14.5, 2.5]),
            trails: Arc::new(vec![vec![3.5, 3.5, 4.0, 3.5, 4.5, 3.5]]),
            frontier_goals: Arc::new(vec![13.5, 1.5]),
            followed: Some(Arc::new(followed.clone())),
            search: Some(Arc::new(search.clone())),
            evaluations: Arc::new(Vec::new()),
            next_evaluation: NextEvaluation::AtUpdate(updates + 1_000),
            curve: {
                let mut curve = app.screen.snapshot.curve.to_vec();
                let coverage = Some(coverage(updates as f64 / 10_000.0) as f32);
                curve.push(CurvePoint {
                    updates,
                    losses: [losses.critic, losses.model, losses.actor],
                    coverage,
                });
                Arc::new(curve)
            },
            ..(*app.screen.snapshot).clone()
        };
        app.on_snapshot(Arc::new(snapshot));
    }
    app.change_snapshot(|snapshot| snapshot.evaluations = Arc::new(evaluations));
    let view = staged_view(&app);
    app.on_view(View::Maze(Arc::new(view)));
    app
}

/// Returns the latest search for a bridge in [`staged_app`].
fn staged_search() -> SearchOutcome {
    SearchOutcome {
        state: vec![1.5, 0.5],
        goal: vec![15.5, 1.5],
        rejected: vec![3.5, 3.5, 17.5, 3.5],
        found: Some(BridgePoint { point: vec![10.5, 2.5], gain: 4.0 }),
        budget: 64,
    }
}

/// Returns the agent that can be followed in [`staged_app`].
fn staged_agent() -> FollowedAgent {
    FollowedAgent {
        agent: 2,
        start: vec![2.5, 4.5],
        state: vec![7.5, 1.5],
        steps: (17, 150),
        aim: vec![10.5, 2.5],
        goal: vec![18.5, 0.5],
        distances: (3.0, 11.0),
        planned: true,
    }
}

/// Returns the view of the rooms map in [`staged_app`].
fn staged_view(app: &App) -> MazeView {
    let frame = app.screen.layout.map.clone().expect("the map is drawn");
    let field = |i: usize| {
        let (column, row) = (i % frame.raster.pixels.0, i / frame.raster.pixels.0);
        let [left, top, width, height] = frame.raster.window;
        let x = left + (column as f32 + 0.5) / frame.raster.pixels.0 as f32 * width;
        let y = top + (row as f32 + 0.5) / frame.raster.pixels.1 as f32 * height;
        let free = app.maze().map.is_free_at(x, y);
        if free { 2.0 * (x - 19.5).abs().max((y - 4.5).abs()) } else { f32::NAN }
    };
    let candidate = |(i, at): (usize, [f32; 2])| Candidate { at, degree: i as f32 / 4.0 };
    let candidates = [[2.5, 2.5], [6.5, 1.5], [10.5, 2.5], [14.5, 3.5], [18.5, 1.5]];
    let standings =
        [EdgeStatus::Confirmed, EdgeStatus::Demoted, EdgeStatus::Confirmed, EdgeStatus::Confirmed];
    let edges =
        candidates.windows(2).zip(standings).map(|(ends, status)| ([ends[0], ends[1]], status));
    let values: Vec<f32> = (0..frame.raster.pixels.0 * frame.raster.pixels.1).map(field).collect();
    // Everything except the right end and a single cell.
    let map = &app.maze().map;
    let visited = |i: usize| map.cell(i).x < 15 && map.cell(i) != Cell::new(3, 3);
    let visits: Vec<u32> = (0..map.free().len()).map(|i| u32::from(visited(i))).collect();
    let mut view = MazeView {
        goal: (Some(app.maze().goal), 1),
        kind: Field::Learned,
        farthest: values.iter().copied().filter(|d| d.is_finite()).fold(1.0, f32::max),
        field: Arc::new(values),
        raster: Some(frame.raster),
        directions: Arc::new(vec![
            ([5.5, 2.5], [1.0, 0.0]),
            ([12.5, 1.5], [0.7, 0.7]),
            ([16.5, 1.5], [0.0, 1.0]),
        ]),
        candidates: Arc::new(candidates.into_iter().enumerate().map(candidate).collect()),
        edges: Arc::new(edges.collect()),
        exploration: Arc::new(Exploration::new(&app.maze().map, &visits)),
        trail: vec![[1.5, 2.5], [2.5, 2.2], [3.5, 1.9]],
        walk: Walk {
            start: [0.5, 2.5],
            steps: 4,
            shortest: Some(19),
            distances: (15.2, 2.1),
            along: 12.4,
            waypoint: Some([6.5, 1.5]),
            arrived: false,
            gave_up: false,
            finished_walks: (3, 4),
        },
        followed_steps: Some(11),
        ..MazeView::default()
    };
    let path = vec![[6.5, 1.5], [10.5, 2.5], [14.5, 3.5], [19.5, 4.5]];
    view.set_plan(map, [3.5, 1.9], path);
    view
}

pub(super) fn check(name: &str, app: &mut App, width: u16, height: u16) {
    check_drawn(name, &draw(app, width, height));
}

/// Compares a screen with its snapshot.
pub(in crate::tui) fn check_drawn(name: &str, terminal: &Terminal<TestBackend>) {
    let shown = picture(terminal);
    insta::with_settings!({ omit_expression => true, prepend_module_to_snapshot => false, snapshot_path => "screens" }, {
        insta::assert_snapshot!(name, shown);
    });
}

#[test]
fn overviews_match_their_snapshots() {
    for (width, height) in [(80, 24), (120, 40), (200, 60)] {
        check(&format!("overview-{width}x{height}"), &mut staged_app(width, height), width, height);
    }
}

#[test]
fn the_screen_without_colours_matches_its_snapshot() {
    let mut app = staged_app(80, 24);
    app.screen.theme = Theme::new(ThemeName::Mono, ColourDepth::Mono);
    check("mono-80x24", &mut app, 80, 24);
}

#[test]
fn panes_match_their_snapshots() {
    for pane in Pane::ALL {
        let mut app = staged_app(80, 24);
        app.screen.pane = pane;
        check(&format!("pane-{}-80x24", pane.name()), &mut app, 80, 24);
    }
    let mut app = staged_app(80, 24);
    (app.screen.pane, app.screen.maximised, app.screen.log_scale) = (Pane::Curves, true, true);
    check("pane-curves-maximised-80x24", &mut app, 80, 24);
    (app.screen.pane, app.screen.maximised, app.screen.following) = (Pane::Walk, false, Some(2));
    check("pane-explorer-80x24", &mut app, 80, 24);
}

#[test]
fn all_overlays_together_match_their_snapshot() {
    let mut app = staged_app(120, 40);
    Overlay::ALL
        .into_iter()
        .filter(|o| !app.screen.overlays.has(*o))
        .collect::<Vec<_>>()
        .into_iter()
        .for_each(|overlay| {
            app.screen.overlays.toggle(overlay);
        });
    app.screen.pane = Pane::Legend;
    check("overlays-120x40", &mut app, 120, 40);
}

#[test]
fn frontier_goals_are_marked_together_with_the_agents() {
    let mut app = staged_app(80, 24);
    let marked = |app: &mut App| text(&draw(app, 80, 24)).contains('\u{25c6}');
    assert!(marked(&mut app));
    press(&mut app, KeyCode::Char('a'));
    assert!(!marked(&mut app), "hidden with the agents");
}

#[test]
fn what_is_unexplored_can_be_hidden_and_is_not_drawn_once_everything_is_explored() {
    for theme in [
        Theme::new(ThemeName::Dark, ColourDepth::True),
        Theme::new(ThemeName::Mono, ColourDepth::Mono),
    ] {
        let mut app = staged_app(80, 24);
        app.screen.theme = theme;
        let shown = picture(&draw(&mut app, 80, 24));
        app.screen.overlays.toggle(Overlay::Unexplored);
        let hidden = picture(&draw(&mut app, 80, 24));
        assert_ne!(shown, hidden);
        app.screen.overlays.toggle(Overlay::Unexplored);
        assert_eq!(picture(&draw(&mut app, 80, 24)), shown);
        let map = app.maze().map.clone();
        let exploration = Arc::new(Exploration::new(&map, &vec![1; map.free().len()]));
        app.change_view(|view| view.exploration = exploration);
        assert_eq!(picture(&draw(&mut app, 80, 24)), hidden);
    }
}

#[test]
fn dialogs_match_their_snapshots() {
    for (name, keys) in [
        ("help", "?"),
        ("palette", ":goal"),
        ("settings", "o"),
        ("seed", "R"),
        ("export", "E"),
        ("colours", "T"),
    ] {
        let mut app = staged_app(80, 24);
        type_text(&mut app, &keys[..1]);
        type_text(&mut app, &keys[1..]);
        check(&format!("dialog-{name}-80x24"), &mut app, 80, 24);
    }
    let mut app = staged_app(80, 24);
    press(&mut app, KeyCode::Char('q'));
    check("dialog-quit-80x24", &mut app, 80, 24);
}

#[test]
fn dialogs_of_actions_without_a_key_match_their_snapshots() {
    let actions = [
        Action::Method,
        Action::Preset,
        Action::NewMap,
        Action::ResizeMap,
        Action::SaveAs,
        Action::SaveMap,
    ];
    for action in actions.into_iter().chain([Action::Autosave]) {
        let mut app = staged_app(80, 24);
        app.act(action);
        let name = bindings().find(|b| b.action == action).expect("it has a name").name;
        check(&format!("dialog-{name}-80x24"), &mut app, 80, 24);
    }
}

#[test]
fn lists_of_files_match_their_snapshots() {
    let folder = Path::new("/home/ada/maps");
    let entries =
        [("cellar.map", false), ("old", true), ("notes.pdf", false), ("rooms.txt", false)];
    let entries = entries.map(|(name, is_folder)| (folder.join(name), is_folder));
    let recent = [PathBuf::from("/home/ada/rooms-edited.txt")];
    let description = |name: &str, days: u64, planned| Description {
        world: "maze".to_owned(),
        file: PathBuf::from(format!("saves/{name}.safetensors")),
        title: "rooms".to_owned(),
        run: staged_app(80, 24).screen.run().clone(),
        updates: 20_000,
        success: Some(Success { updates: 20_000, greedy: Some(0.91), planned }),
        bytes: 2_345_678,
        written: Some(SystemTime::UNIX_EPOCH + Duration::from_secs(86_400 * days)),
    };
    let broken = CheckpointError {
        file: PathBuf::from("saves/old.safetensors"),
        problem: "is not a safetensors file".to_owned(),
        help: String::new(),
    };
    let found = vec![
        Err(broken),
        Ok(description("rooms-gdg-seed1", 20_000, None)),
        Ok(description("rooms-at-95-percent", 20_400, Some(0.98))),
    ];
    let other = Arc::new(Grid::empty("hall", 30, 8));
    let lists = [
        ("maps", lists::maps(folder, &entries, Some(&recent), &Registry::builtin())),
        ("checkpoints", lists::checkpoints(found, &TimeZone::UTC)),
        (
            "other-map",
            lists::map_switch_choices(&other, None, Some(&rooms()), rooms().resized(20, 5), true),
        ),
    ];
    for (name, list) in lists {
        let mut app = staged_app(80, 24);
        app.screen.dialogs.push(Dialog::Pick(list));
        check(&format!("dialog-{name}-80x24"), &mut app, 80, 24);
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

#[test]
fn settings_are_found_by_their_former_names() {
    for (former, name) in
        [("replay_capacity", "buffer_size"), ("warmup_env_steps", "learning_starts")]
    {
        let mut picker = lists::settings(&staged_app(80, 24).screen);
        picker.paste(former);
        assert_eq!(picker.choice(), Some(&Choice::Setting(name.to_owned())));
    }
}

#[test]
fn the_editor_matches_its_snapshot() {
    let mut app = staged_app(80, 24);
    type_text(&mut app, "e4x");
    (0..4).for_each(|_| press(&mut app, KeyCode::Left));
    (0..2).for_each(|_| press(&mut app, KeyCode::Up));
    check("editor-80x24", &mut app, 80, 24);
}

#[test]
fn sentences_of_a_pane_are_as_wide_as_it_is() {
    let mut app = staged_app(120, 40);
    app.screen.pane = Pane::Walk;
    app.screen.maximised = true;
    let shown = text(&draw(&mut app, 120, 40));
    assert!(
        shown.contains(" 3 waypoints; direct D says 15, along bridges 12: 3 steps shorter"),
        "{shown}"
    );
}

#[test]
fn lines_over_the_map_match_their_snapshots() {
    let mut app = staged_app(80, 24);
    app.screen.first_run = true;
    check("first-run-80x24", &mut app, 80, 24);
    let folder = tempfile::tempdir().expect("a folder");
    let saved = saved_run(folder.path(), &app);
    offer(saved, &mut app.screen);
    check("offer-80x24", &mut app, 80, 24);
}

#[test]
fn cells_without_a_path_to_the_goal_match_their_snapshot() {
    let mut app = staged_app(80, 24);
    let map = app.maze().map.clone();
    let cut_off = (0..map.free().len()).map(|i| map.free()[i] && map.cell(i).x < 8).collect();
    app.change_view(|view| view.cut_off = Arc::new(cut_off));
    check("cut-off-80x24", &mut app, 80, 24);
}

#[test]
fn curves_under_those_of_the_run_match_their_snapshot() {
    let mut app = staged_app(120, 40);
    let success = [0.2, 0.3, 0.6, 0.7, 0.8, 0.9, 0.9, 1.0, 1.0, 1.0, 1.0, 1.0];
    let run = saved("saves/yesterday.safetensors", "rooms", "gdg-bridge", 1, &success);
    app.screen.under = Some(Arc::new(run));
    app.screen.pane = Pane::Curves;
    check("curves-under-120x40", &mut app, 120, 40);
}

#[test]
fn curves_say_where_the_map_was_edited() {
    let mut app = staged_app(120, 40);
    app.screen.pane = Pane::Curves;
    assert!(!text(&draw(&mut app, 120, 40)).contains("edited"));
    // Drawing a wall is several edits.
    app.change_snapshot(|snapshot| snapshot.edits = Arc::new(vec![4_000, 4_010, 4_020, 8_000]));
    let shown = text(&draw(&mut app, 120, 40));
    assert!(shown.contains("\u{2506} 4,000 map edited  \u{2506} 8,000 map edited"), "{shown}");
}

#[test]
fn curves_of_several_methods_match_their_snapshot() {
    let mut app = staged_app(120, 40);
    let mut methods = gdg::train::Methods::default();
    let used = |name: &str, learns| gdg::train::UsedMethod { name: name.to_owned(), learns };
    let (bridge, random) = (|| used("gdg-bridge", true), || used("random", false));
    methods.change(4_000, bridge(), random());
    methods.change(6_000, random(), bridge());
    app.change_snapshot(|snapshot| snapshot.methods = methods);
    app.screen.pane = Pane::Curves;
    check("curves-methods-120x40", &mut app, 120, 40);
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
fn everything_can_be_exported() {
    let mut app = staged_app(80, 24);
    let app = &mut app.app;
    press(app, KeyCode::Char('?'));
    assert!(
        contents(ExportKind::Film, &mut app.screen, &app.scene)
            .expect_err("no film")
            .to_string()
            .contains("no film")
    );
    let is_drawn = |kind: &ExportKind| !matches!(kind, ExportKind::Still | ExportKind::Film);
    for kind in ExportKind::ALL.into_iter().filter(is_drawn) {
        let bytes = contents(kind, &mut app.screen, &app.scene).expect("a file");
        match kind.file_type() {
            "pdf" => assert!(bytes.starts_with(b"%PDF-") && bytes.ends_with(b"%%EOF")),
            "png" => {
                let reader =
                    png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
                let found = (reader.info().width, reader.info().height);
                match kind {
                    ExportKind::MapPng => assert_eq!(found, (50 * 8, 22 * 16)),
                    ExportKind::ScreenPng => assert_eq!(found, (80 * 8, 24 * 16)),
                    _ => assert!(found.0 > 1500 && found.1 > found.0, "{found:?}"),
                }
            }
            "svg" => {
                let text = String::from_utf8(bytes).expect("text");
                assert!(
                    text.starts_with("<svg") && text.trim_end().ends_with("</svg>"),
                    "{kind:?}"
                );
                let part =
                    if kind == ExportKind::CurvesSvg { "relative error of D" } else { "\nG\n" };
                assert!(text.contains(part), "{kind:?} shows {part:?}");
                assert!(!text.contains("get no reward"), "the dialog on top is left out");
            }
            _ => {
                let text = String::from_utf8(bytes).expect("text");
                let lines: Vec<&str> = text.lines().collect();
                assert!(
                    lines[0].starts_with("updates,critic_loss")
                        && lines[0].contains("planned_at_30_steps")
                );
                assert_eq!(lines[0].split(',').nth(4), Some("coverage"));
                let last: Vec<&str> = lines.last().expect("lines").split(',').collect();
                assert_eq!((last[0], last.len()), ("10000", lines[0].split(',').count()));
                assert!(last[4].starts_with("0.8"), "the coverage: {}", last[4]);
            }
        }
    }
    assert_eq!(app.screen.dialogs.len(), 1, "the help is still open");
}

#[test]
fn fields_match_their_snapshots() {
    for field in
        [Field::FromStart, Field::Composed, Field::True, Field::Error, Field::Visits, Field::Plain]
    {
        let mut app = staged_app(80, 24);
        app.screen.field = field;
        app.change_view(|view| view.kind = field);
        let name = field.name().replace(' ', "-").to_lowercase();
        check(&format!("field-{name}-80x24"), &mut app, 80, 24);
    }
}

/// Checks what `prepare` opens on a small and on a usual screen, and on one that is smaller than
/// intended and has no colours.
fn check_everywhere(name: &str, prepare: impl Fn(&mut App)) {
    let colours = Theme::new(ThemeName::Dark, ColourDepth::True);
    let mono = Theme::new(ThemeName::Mono, ColourDepth::Mono);
    for (kind, theme, (width, height)) in
        [("", colours, (80, 24)), ("", colours, (120, 40)), ("-mono", mono, (60, 20))]
    {
        let mut app = staged_app(width, height);
        app.screen.theme = theme;
        app.screen.overlays = Overlays::by_default(theme.depth);
        prepare(&mut app);
        check(&format!("{name}{kind}-{width}x{height}"), &mut app, width, height);
    }
}

#[test]
fn the_list_of_settings_matches_its_snapshots() {
    check_everywhere("settings-changed", |app| {
        let mut snapshot = (*app.screen.snapshot).clone();
        Arc::make_mut(&mut snapshot.run).settings.learn.n_step = 5;
        app.on_snapshot(Arc::new(snapshot));
        type_text(app, "o");
        (0..10).for_each(|_| press(app, KeyCode::Down));
    });
}

#[test]
fn a_searched_help_and_errors_match_their_snapshots() {
    check_everywhere("help-searched", |app| type_text(app, "?/map"));
    check_everywhere("error", |app| {
        app.report("cannot write /home/ada/a/long/way/to/a/folder/that/is/not/there/rooms-gdg-bridge-seed1.safetensors: no such file or directory (os error 2)");
    });
}

#[test]
fn maximised_numbers_match_their_snapshots() {
    check_everywhere("numbers", |app| app.screen.maximised = true);
}

#[test]
fn the_light_theme_matches_its_snapshot() {
    let mut app = staged_app(80, 24);
    app.screen.theme = Theme::new(ThemeName::Light, ColourDepth::True);
    let terminal = draw(&mut app, 80, 24);
    assert!(
        terminal.backend().buffer().content.iter().all(|cell| cell.bg != Color::Reset),
        "all of it is light"
    );
    check("light-80x24", &mut app, 80, 24);
}

#[test]
fn long_and_large_maps_match_their_snapshots() {
    let shape = |width: usize, height: usize| {
        let row = |y: usize| {
            (0..width).map(|x| if x == width / 2 && y != 1 { '#' } else { '.' }).collect::<String>()
                + "\n"
        };
        parse_map("shape", (0..height).map(row).collect::<String>().as_bytes()).expect("a map")
    };
    for (name, width, height) in [("long", 200, 3), ("large", 250, 200)] {
        let mut app =
            app_with(shape(width, height), gdg(), Limits { updates: Some(0), ..Limits::default() });
        app.screen.overlays.toggle(Overlay::Unexplored);
        app.screen.overlays.toggle(Overlay::Agents);
        app.set_goal(Cell::new(5, 1));
        for (width, height) in [(80, 24), (120, 40), (200, 60), (60, 20)] {
            let shown = text(&draw(&mut app, width, height));
            assert_eq!(
                shown.contains("1 dot ="),
                name == "large" || width < 200,
                "{width} x {height}: {shown}"
            );
            assert_eq!(
                shown.contains("\u{250c} training"),
                (width, name) != (60, "large"),
                "{shown}"
            );
        }
    }
}

#[test]
fn of_many_edges_only_tried_ones_near_the_cursor_are_drawn() {
    let mut app = staged_app(120, 40);
    app.screen.overlays.toggle(Overlay::Edges);
    let at = |i: usize| [0.5 + (i % 39) as f32 / 2.0, 0.5 + (i / 39 % 9) as f32 / 2.0];
    let edges = |status| (0..11_000).map(|i| ([at(i), at(i + 40)], status)).collect::<Vec<_>>();
    let mut cells_changed = |edges, cursor| {
        app.maze_mut().inspecting = Some(cursor);
        app.change_view(|view| view.edges = Arc::default());
        let before = draw(&mut app, 120, 40).backend().buffer().clone();
        app.change_view(|view| view.edges = Arc::new(edges));
        let after = draw(&mut app, 120, 40).backend().buffer().clone();
        // Only the map: the legend counts the edges.
        let map = app.screen.layout.map.clone().expect("a map").area;
        let changed: Vec<Position> =
            map.positions().filter(|at| before[*at] != after[*at]).collect();
        (changed, map)
    };
    let (none, _) = cells_changed(edges(EdgeStatus::Untried), Cell::new(2, 2));
    assert!(none.is_empty(), "untried edges are not drawn");
    let (left, map) = cells_changed(edges(EdgeStatus::Confirmed), Cell::new(2, 2));
    let (right, _) = cells_changed(edges(EdgeStatus::Confirmed), Cell::new(17, 2));
    let middle = map.x + map.width / 2;
    assert!(!left.is_empty() && left.iter().all(|at| at.x < middle), "around the cursor");
    assert!(!right.is_empty() && right.iter().all(|at| at.x > middle), "around the cursor");
}
