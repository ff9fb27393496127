//! Snapshots of reviewed screens, with their styles.

use std::path::Path;
use std::time::SystemTime;

use jiff::tz::TimeZone;

use super::picture::picture;
use super::staged::staged_app;
use super::*;
use crate::tui::action::Action;
use crate::tui::dialog::Choice;
use crate::tui::layers::{Overlay, Overlays};
use crate::tui::lists;
use crate::tui::panes::Pane;
use crate::tui::runs::tests::saved;
use gdg::bridge::EdgeStatus;
use gdg::train::{CheckpointError, Description, Success};
use gdg::viewer::maze::Exploration;

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
        fingerprint: None,
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
