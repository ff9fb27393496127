//! Snapshots of reviewed screens, with their styles.

use super::picture::picture;
use super::staged::staged_app;
use super::*;
use crate::tui::layers::Overlay;
use crate::tui::panes::Pane;
use gdg::bridge::EdgeStatus;
use gdg::viewer::{Candidate, Exploration, Graph};

pub(super) fn check(name: &str, app: &mut impl Driven, width: u16, height: u16) {
    let shown = picture(&draw(app, width, height));
    let name = format!("{name}-{width}x{height}");
    insta::with_settings!({ omit_expression => true, prepend_module_to_snapshot => false, snapshot_path => "screens" }, {
        insta::assert_snapshot!(name, shown);
    });
}

#[test]
fn screens_match_their_snapshots() {
    for (width, height) in [(80, 24), (120, 40)] {
        check("overview", &mut staged_app(width, height), width, height);
    }
    for (name, keys) in [("settings", "o"), ("palette", ":goal"), ("editor", "e4x")] {
        let mut app = staged_app(80, 24);
        type_text(&mut app, &keys[..1]);
        type_text(&mut app, &keys[1..]);
        (0..2).for_each(|_| press(&mut app, KeyCode::Up));
        check(name, &mut app, 80, 24);
    }
    let mut app = staged_app(80, 24);
    app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::Mono);
    check("mono", &mut app, 80, 24);
    let mut app = staged_app(80, 24);
    (app.screen.pane, app.screen.maximised, app.screen.log_scale) = (Pane::Curves, true, true);
    check("curves", &mut app, 80, 24);
    let mut app = staged_app(120, 40);
    for overlay in Overlay::ALL {
        if !app.screen.overlays.has(overlay) {
            app.screen.overlays.toggle(overlay);
        }
    }
    app.screen.pane = Pane::Legend;
    check("overlays", &mut app, 120, 40);
    check("arm", &mut arm::staged_app(120, 40), 120, 40);
    check("goals", &mut goals::staged_app(120, 40), 120, 40);
    check("comparison", &mut compare::staged(120, 40), 120, 40);
    let mut list = crate::tui::runs::tests::screen();
    type_text(&mut list, " j j ");
    check("runs", &mut list, 120, 40);
}

#[test]
fn each_overlay_changes_the_map_and_is_hidden_again() {
    let mut app = staged_app(80, 24);
    for overlay in Overlay::ALL {
        let before = picture(&draw(&mut app, 80, 24));
        app.screen.overlays.toggle(overlay);
        let after = picture(&draw(&mut app, 80, 24));
        assert_ne!(before, after, "{overlay:?}");
        app.screen.overlays.toggle(overlay);
        assert_eq!(picture(&draw(&mut app, 80, 24)), before, "{overlay:?}");
    }
    // Nothing is unexplored once everything has been visited.
    let map = app.maze().map.clone();
    let exploration = Arc::new(Exploration::new(&map, &vec![1; map.free().len()]));
    app.change_view(|view| view.exploration = exploration);
    let shown = picture(&draw(&mut app, 80, 24));
    app.screen.overlays.toggle(Overlay::Unexplored);
    assert_eq!(picture(&draw(&mut app, 80, 24)), shown);
}

#[test]
fn of_many_edges_only_those_near_the_cursor_are_drawn() {
    let mut app = staged_app(120, 40);
    app.screen.overlays.toggle(Overlay::Edges);
    let at = |i: usize| [0.5 + (i % 39) as f32 / 2.0, 0.5 + (i / 39 % 9) as f32 / 2.0];
    let candidate = |i: usize| Candidate { at: at(i).to_vec(), degree: 0.0 };
    let graph = Graph {
        candidates: (0..11_040).map(candidate).collect(),
        edges: (0..11_000).map(|i| ([i, i + 40], EdgeStatus::Confirmed)).collect(),
    };
    // Only edges are shown.
    app.screen.overlays.toggle(Overlay::Candidates);
    for (x, is_left) in [(2, true), (17, false)] {
        app.maze_mut().inspecting = Some(Cell::new(x, 2));
        app.change_view(|view| view.graph = Arc::default());
        let before = draw(&mut app, 120, 40).backend().buffer().clone();
        app.change_view(|view| view.graph = Arc::new(graph.clone()));
        let after = draw(&mut app, 120, 40).backend().buffer().clone();
        let map = app.screen.layout.map.clone().expect("a map").area;
        let mut changed = map.positions().filter(|at| before[*at] != after[*at]).peekable();
        assert!(changed.peek().is_some());
        assert!(changed.all(|at| (at.x < map.x + map.width / 2) == is_left), "cursor at {x}");
    }
}

#[test]
fn the_light_theme_covers_the_whole_screen() {
    let mut app = staged_app(80, 24);
    app.screen.theme = Theme::new(ThemeName::Light, ColourDepth::True);
    let drawn = draw(&mut app, 80, 24);
    assert!(drawn.backend().buffer().content.iter().all(|cell| cell.bg != Color::Reset));
}

#[test]
fn curves_say_where_the_map_was_edited() {
    let mut app = staged_app(120, 40);
    // Drawing a wall is several edits.
    app.change_snapshot(|snapshot| snapshot.edits = Arc::new(vec![4_000, 4_010, 4_020, 8_000]));
    app.screen.pane = Pane::Curves;
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains("\u{2506} map edited"), "{shown}");
}
