//! What is drawn: reviewed screens as snapshots, with their styles, and that everything can be.

use std::fmt::Write as _;

use ratatui::Terminal;
use ratatui::backend::TestBackend;

use super::staged::staged_app;
use super::*;
use crate::tui::choices::{Marker, Overlay, Overlays, Pane};
use crate::tui::graphics::Redraw;
use crate::tui::viewport::{MapFrame, Viewport};
use gdg::bridge::EdgeStatus;
use gdg::draw::RasterPixel;
use gdg::map::{RandomMapKind, random};
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
    (app.screen.pane, app.screen.maximised) = (Pane::Curves, true);
    check("curves", &mut app, 80, 24);
    let mut app = staged_app(120, 40);
    for overlay in Overlay::ALL {
        if !app.screen.overlays.has(overlay) {
            app.screen.overlays.toggle(overlay);
        }
    }
    app.screen.pane = Pane::Legend;
    check("overlays", &mut app, 120, 40);
    check("arm", &mut spaces::staged_arm(120, 40), 120, 40);
    check("goals", &mut spaces::staged_goals(120, 40), 120, 40);
    check("comparison", &mut compare::staged(120, 40), 120, 40);
    let mut list = crate::tui::runs::tests::screen();
    type_text(&mut list, "mjmjm");
    check("runs", &mut list, 120, 40);
}

#[test]
fn each_overlay_changes_the_map_and_is_hidden_again() {
    let mut app = staged_app(80, 24);
    for graphics in [Some(pixels::GRAPHICS), None] {
        app.set_graphics(graphics, Redraw::All);
        let drawn = |app: &mut Still| {
            let screen = draw(app, 80, 24).backend().buffer().clone();
            (screen, app.pictures().first().map(|picture| picture.pixels.clone()))
        };
        for overlay in Overlay::ALL {
            let before = drawn(&mut app);
            app.screen.overlays.toggle(overlay);
            assert!(drawn(&mut app) != before, "{overlay:?}");
            app.screen.overlays.toggle(overlay);
            assert!(drawn(&mut app) == before, "{overlay:?}");
        }
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
fn of_many_edges_some_are_drawn_everywhere() {
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
    let before = draw(&mut app, 120, 40).backend().buffer().clone();
    app.change_view(|view| view.graph = Arc::new(graph));
    let after = draw(&mut app, 120, 40).backend().buffer().clone();
    let map = app.screen.layout.map.clone().expect("a map").area;
    let changed: Vec<_> = map.positions().filter(|at| before[*at] != after[*at]).collect();
    let left = changed.iter().filter(|at| at.x < map.x + map.width / 2).count();
    let right = changed.len() - left;
    assert!(left > 50 && right > 50 && changed.len() < map.area() as usize / 2, "{left} {right}");
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

#[test]
fn maps_of_every_shape_can_be_drawn() {
    for (width, height) in [(1, 1), (300, 1), (1, 300), (256, 256)] {
        let map = parse_map("shape", format!("{}\n", ".".repeat(width)).repeat(height).as_bytes())
            .expect("a map");
        let mut app = still_on(map, gdg());
        for (columns, rows) in [(80, 24), (30, 5), (200, 60)] {
            draw(&mut app, columns, rows);
            click(&mut app, MouseButton::Left, Position::new(columns / 2, rows / 2));
        }
    }
}

#[test]
fn every_field_can_be_shown() {
    let mut app = app();
    draw(&mut app, 80, 24);
    wait_until(&mut app, |app| {
        app.screen.snapshot.counters.updates > 1_000 && !app.maze().view.graph.edges.is_empty()
    });
    press(&mut app, KeyCode::Char(' '));
    wait_until(&mut app, |app| !app.screen.snapshot.phase.is_training());
    for _ in 0..8 {
        let asked = app.screen.field;
        wait_until(&mut app, |app| {
            app.maze().view.kind == asked
                && (asked == Field::Plain || app.maze().view.field().is_some())
        });
        assert!(shown_by(&mut app, 80, 24).contains(asked.name()), "{asked:?} is named");
        let view = app.maze().view.clone();
        let (field, raster) = view.field().expect("a field");
        let (column, row) = raster.pixel_of([0.5, 4.5]).expect("on the map");
        let value = field[row * raster.pixels.0 + column];
        match asked {
            Field::True => assert_eq!(value, 19.0, "from the left to the lower right corner"),
            Field::Plain => assert!(value.is_nan()),
            Field::OverEach => {
                let (view, policy) = (&app.maze().view, &app.screen.snapshot.networks.policy);
                let (start, goal) = (&view.reach.start, app.maze().goal.centre());
                let at = raster.middle_of(row * raster.pixels.0 + column);
                let part = |from: &[f32], to: &[f32]| {
                    policy.distance(from, to, &mut gdg::learn::Scratch::default())
                };
                let sum = part(start, &at) + part(&at, &goal);
                assert!((value - sum).abs() < 0.01, "the sum of both parts: {value}, {sum}");
            }
            _ => assert!(value.is_finite() && field.iter().any(|d| d.is_nan()), "none on walls"),
        }
        press(&mut app, KeyCode::Char('v'));
    }
    assert_eq!(app.screen.field, Field::Learned, "and round");
}

fn shows_floor(frame: &MapFrame, map: &Grid, at: Position) -> bool {
    let (across, down) = frame.marker.pixels();
    (0..across * down).any(|n| {
        let column = usize::from(at.x - frame.area.x) * across + n % across;
        let row = usize::from(at.y - frame.area.y) * down + n / across;
        matches!(frame.raster.ground(map, column, row), RasterPixel::Free(_))
    })
}

/// Draws an agent and the walking agent at `at`; returns how many characters they change.
fn check_agent(app: &mut App, at: [f32; 2], (width, height): (u16, u16)) -> usize {
    app.change_view(|view| view.reach.at.clear());
    app.change_snapshot(|snapshot| snapshot.agents = Arc::default());
    let without = draw(app, width, height).backend().buffer().clone();
    app.change_view(|view| view.reach.at = at.to_vec());
    app.change_snapshot(|snapshot| snapshot.agents = Arc::new(at.to_vec()));
    let with = draw(app, width, height).backend().buffer().clone();
    let (frame, map) = (app.screen.layout.map.clone().expect("a map"), app.maze().map.clone());
    let changed = frame.area.positions().filter(|at| with[*at] != without[*at]);
    let changed = changed.inspect(|place| {
        assert!(shows_floor(&frame, &map, *place), "{at:?} at {place} of {frame:?}");
    });
    changed.count()
}

#[test]
fn agents_in_a_maze_are_never_drawn_inside_walls() {
    let map = random(RandomMapKind::Perfect, Some(21), 3);
    let cells: Vec<Cell> = map.free_cells().step_by(12).collect();
    let mut app = still_on(map, gdg());
    app.screen.overlays = Overlays::by_default(ColourDepth::True);
    for overlay in [Overlay::Candidates, Overlay::Path, Overlay::Contours] {
        app.screen.overlays.toggle(overlay);
    }
    let (mut shown, mut all) = (0, 0);
    for (marker, zoom) in [Marker::HalfBlock, Marker::Quadrant]
        .into_iter()
        .flat_map(|marker| [(marker, 1.0), (marker, 1.7), (marker, 4.0)])
    {
        app.screen.marker = marker;
        for (i, cell) in cells.iter().enumerate() {
            // Near a corner of the cell, each in turn.
            let [x, y] = cell.centre();
            let sign = |bit: usize| if i >> bit & 1 == 0 { 0.4 } else { -0.4 };
            let at = [x + sign(0), y + sign(1)];
            app.maze_mut().viewport = Viewport { zoom, centre: at };
            all += 1;
            shown += usize::from(check_agent(&mut app, at, (80, 24)) > 0);
        }
    }
    assert!(10 * shown > 9 * all, "{shown} of {all} are shown");
}

/// Returns the characters row by row, then the letters of the cells' styles where they change, with
/// a legend at the end.
pub fn picture(terminal: &Terminal<TestBackend>) -> String {
    let buffer = terminal.backend().buffer();
    let mut known: Vec<String> = Vec::new();
    let (mut signs, mut letters) = (String::new(), String::new());
    for row in buffer.content.chunks(usize::from(buffer.area.width)) {
        let (mut line, mut styles, mut last) = (String::new(), String::new(), None);
        for cell in row {
            line.push_str(cell.symbol());
            let style = format!("{} on {} {:?}", cell.fg, cell.bg, cell.modifier);
            let at = known.iter().position(|known| *known == style).unwrap_or(known.len());
            if at == known.len() {
                known.push(style);
            }
            // The field has many colours, so other characters are used after the alphabet.
            let letter = char::from_u32(0x61 + at as u32).filter(char::is_ascii_lowercase);
            let letter = letter.or(char::from_u32(0x4e00 + at as u32)).unwrap_or('?');
            styles.push(if last.replace(at) == Some(at) { ' ' } else { letter });
        }
        let _ = writeln!(signs, "|{}", line.trim_end());
        let _ = writeln!(letters, "|{}", styles.trim_end());
    }
    let mut all = signs + &letters;
    for (i, style) in known.iter().enumerate().take(26) {
        let _ = writeln!(all, "{}: {style}", char::from(b'a' + i as u8));
    }
    all
}
