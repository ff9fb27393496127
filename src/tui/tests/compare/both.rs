//! What a comparison does on both sides: edits, looking back, exports, and words about them.

use super::*;
use crate::tui::action::{Mode, bindings};
use crate::tui::output::ExportKind;
use crate::tui::tests::past::film;
use gdg::map::Grid;
use gdg::text::grouped;

fn maps(comparison: &mut Comparison) -> [Arc<Grid>; 2] {
    comparison.apps().map(|app| app.maze().map.clone())
}

fn stopped_comparison() -> Comparison {
    let limits = Limits { updates: Some(0), ..Limits::default() };
    comparison_with(["gdg-bridge", "gdg"], limits)
}

fn type_keys(comparison: &mut Comparison, keys: &str) {
    keys.chars().for_each(|key| press(comparison, KeyCode::Char(key)));
}

/// Draws a wall at a cell with the mouse, on one side.
fn draw_wall(comparison: &mut Comparison, side: usize, cell: Cell) {
    let at = character_of(comparison, side, cell);
    mouse(comparison, MouseEventKind::Down(MouseButton::Left), at);
    mouse(comparison, MouseEventKind::Up(MouseButton::Left), at);
}

/// Waits until both trainers have the maps that are shown.
fn wait_for_trainers(comparison: &mut Comparison) {
    wait_until(comparison, |apps| {
        apps.iter().all(|app| app.drawn_map().free() == app.maze().map.free())
    });
}

#[test]
fn an_edit_on_either_side_goes_to_both_trainers_and_so_does_its_undo() {
    let mut comparison = comparison();
    draw(&mut comparison, (80, 24));
    let before = rooms();
    press(&mut comparison, KeyCode::Char('e'));
    let shown = text(&draw(&mut comparison, (80, 24)));
    assert!(shown.contains("EDIT") && shown.contains("undo"), "{shown}");
    let cells = [Cell::new(2, 1), Cell::new(15, 4)];
    for (side, cell) in cells.into_iter().enumerate() {
        draw_wall(&mut comparison, side, cell);
        assert!(maps(&mut comparison).iter().all(|map| !map.is_free(cell)), "{cell:?}");
    }
    wait_for_trainers(&mut comparison);
    assert!(comparison.apps().iter().all(|app| app.screen.snapshot.phase.is_training()));
    press(&mut comparison, KeyCode::Char('u'));
    assert!(
        maps(&mut comparison).iter().all(|map| map.is_free(cells[1]) && !map.is_free(cells[0]))
    );
    press(&mut comparison, KeyCode::Char('u'));
    assert!(maps(&mut comparison).iter().all(|map| map.free() == before.free()));
    wait_for_trainers(&mut comparison);
    press(&mut comparison, KeyCode::Char('e'));
    assert!(!text(&draw(&mut comparison, (80, 24))).contains("EDIT"));
}

#[test]
fn the_editor_has_the_keys_of_the_main_screen_and_shows_its_cursor_on_both() {
    let mut comparison = comparison();
    draw(&mut comparison, (80, 24));
    let goal = comparison.apps()[0].maze().goal;
    type_keys(&mut comparison, "e3");
    let editors = comparison.apps().map(|app| {
        let editor = &app.maze().editor;
        (editor.cursor, editor.tool)
    });
    assert_eq!(editors, [(Some(goal), crate::tui::tool::Tool::Line); 2]);
    let right = goal.x + 3 < rooms().width();
    let step = if right { KeyCode::Right } else { KeyCode::Left };
    press(&mut comparison, KeyCode::Char('x'));
    (0..2).for_each(|_| press(&mut comparison, step));
    let previews = comparison.apps().map(|app| {
        app.maze().editor.preview().map(|(cells, _)| cells.into_owned()).expect("a line")
    });
    assert_eq!(previews[0].len(), 3);
    assert_eq!(previews[0], previews[1], "the line that is being drawn is shown on both");
    press(&mut comparison, KeyCode::Enter);
    assert!(maps(&mut comparison).iter().all(|map| !map.is_free(goal)));
    let [a, b] = comparison.apps().map(|app| app.maze().goal);
    assert!(a == b && a != goal, "the goal has left the wall on both sides");
    press(&mut comparison, KeyCode::Esc);
    press(&mut comparison, KeyCode::Char('u'));
    assert!(maps(&mut comparison).iter().all(|map| map.is_free(goal)), "also with a closed editor");
}

#[test]
fn a_right_click_draws_floor_while_the_editor_is_open() {
    let mut comparison = comparison();
    draw(&mut comparison, (80, 24));
    press(&mut comparison, KeyCode::Char('e'));
    let cell = Cell::new(2, 1);
    draw_wall(&mut comparison, 0, cell);
    let at = character_of(&mut comparison, 1, cell);
    mouse(&mut comparison, MouseEventKind::Down(MouseButton::Right), at);
    mouse(&mut comparison, MouseEventKind::Up(MouseButton::Right), at);
    assert!(maps(&mut comparison).iter().all(|map| map.is_free(cell)));
}

/// Gives both sides films of these updates.
fn stage_films(comparison: &mut Comparison, updates: [&[u64]; 2]) {
    for (side, updates) in updates.into_iter().enumerate() {
        let app = &comparison.apps()[side].screen.snapshot.clone();
        let film = film(comparison.apps()[side], updates);
        comparison.on_snapshot(side, &Arc::new(Snapshot { film, ..(**app).clone() }));
    }
}

fn shown_updates(comparison: &mut Comparison) -> [Option<u64>; 2] {
    comparison.apps().map(|app| app.screen.past.as_ref().map(|frame| frame.updates))
}

#[test]
fn both_look_back_at_the_same_place_along_the_axis() {
    let mut comparison = stopped_comparison();
    draw(&mut comparison, (80, 24));
    press(&mut comparison, KeyCode::Char('['));
    assert!(text(&draw(&mut comparison, (80, 24))).contains("no film yet"));
    stage(&mut comparison);
    // An update is 16 environment steps on one side, and 12 on the other.
    stage_films(&mut comparison, [&[1, 2_500, 5_000], &[1, 2_500, 7_500]]);
    let after = |comparison: &mut Comparison, key: char| {
        press(comparison, KeyCode::Char(key));
        shown_updates(comparison)
    };
    assert_eq!(after(&mut comparison, '['), [Some(5_000), Some(7_500)]);
    let shown = text(&draw(&mut comparison, (120, 40)));
    for updates in [5_000, 7_500].map(|updates| format!("at update {}", grouped(updates))) {
        assert!(shown.contains(&updates), "{updates}: {shown}");
    }
    assert!(shown.contains(" looking back: [ earlier, ] later, Esc the present"), "{shown}");
    let narrow = text(&draw(&mut comparison, (80, 24)));
    assert!(narrow.contains(" looking back: [ ] Esc"), "{narrow}");
    assert_eq!(after(&mut comparison, '['), [Some(2_500); 2]);
    assert_eq!(after(&mut comparison, '['), [Some(1); 2]);
    assert_eq!(after(&mut comparison, '['), [Some(1); 2], "there is nothing before");
    assert_eq!(after(&mut comparison, ']'), [Some(2_500); 2]);
    assert_eq!(after(&mut comparison, ']'), [Some(5_000), Some(7_500)]);
    assert_eq!(after(&mut comparison, ']'), [None; 2], "the present");
    after(&mut comparison, '[');
    press(&mut comparison, KeyCode::Esc);
    assert_eq!(shown_updates(&mut comparison), [None; 2]);
    // The editor leads both back, which one notice says.
    press(&mut comparison, KeyCode::Char('['));
    assert!(shown_updates(&mut comparison).iter().all(Option::is_some));
    press(&mut comparison, KeyCode::Char('e'));
    assert_eq!(shown_updates(&mut comparison), [None; 2]);
    let shown = text(&draw(&mut comparison, (80, 24)));
    assert!(shown.contains("back in the present") && !shown.contains("A: back"), "{shown}");
}

#[test]
fn a_click_on_the_curves_looks_back_and_an_edit_returns() {
    let mut comparison = stopped_comparison();
    draw(&mut comparison, (80, 24));
    stage(&mut comparison);
    stage_films(&mut comparison, [&[1, 2_500, 5_000, 10_000], &[1, 2_500, 5_000, 10_000]]);
    draw(&mut comparison, (80, 24));
    // The left quarter of the chart's rows, above those with the axis and the keys.
    mouse(&mut comparison, MouseEventKind::Down(MouseButton::Left), Position::new(24, 19));
    assert_eq!(shown_updates(&mut comparison), [Some(2_500); 2]);
    press(&mut comparison, KeyCode::Char('e'));
    assert_eq!(shown_updates(&mut comparison), [None; 2], "the present is edited");
}

#[test]
fn the_palette_finds_what_applies_to_both_and_says_why_the_rest_does_not() {
    let mut comparison = comparison();
    draw(&mut comparison, (120, 40));
    type_keys(&mut comparison, ":draw walls doors");
    press(&mut comparison, KeyCode::Enter);
    assert!(comparison.apps().iter().all(|app| app.maze().editor.is_open()));
    press(&mut comparison, KeyCode::Esc);
    type_keys(&mut comparison, ":colours visits");
    assert!(text(&draw(&mut comparison, (120, 40))).contains("find an action"));
    press(&mut comparison, KeyCode::Enter);
    assert_eq!(comparison.apps().map(|app| app.screen.field), [Field::Visits; 2]);
    type_keys(&mut comparison, ":save a checkpoint");
    press(&mut comparison, KeyCode::Enter);
    let shown = text(&draw(&mut comparison, (120, 40)));
    assert!(shown.contains("not in a comparison: save a checkpoint; it saves"), "{shown}");
}

#[test]
fn what_is_not_available_is_said_in_words() {
    let mut comparison = comparison();
    draw(&mut comparison, (200, 60));
    let missing = bindings().filter(|b| {
        b.is_active(Mode::Watching) && !b.is_active(Mode::Comparing) && !b.keys.is_empty()
    });
    let mut refused = 0;
    for binding in missing {
        let key = binding.keys[0];
        let key = match key.strip_prefix("shift-") {
            Some(letter) => letter.to_uppercase(),
            None => key.to_owned(),
        };
        let [key] = key.chars().collect::<Vec<_>>()[..] else { continue };
        let taken = comparison.apps()[0]
            .screen
            .keymap
            .action(KeyEvent::new(KeyCode::Char(key), KeyModifiers::NONE), Mode::Comparing);
        if taken.is_some() {
            continue;
        }
        press(&mut comparison, KeyCode::Char(key));
        let shown = text(&draw(&mut comparison, (200, 60)));
        let said = shown.lines().find(|line| line.contains("not in a comparison: "));
        let said = said.unwrap_or_else(|| panic!("{key} says nothing: {shown}"));
        let words = binding.long.split(" (").next().expect("words");
        assert!(said.contains(words), "{key}: {said}");
        assert!(!binding.name.contains('-') || !said.contains(binding.name), "{said}");
        refused += 1;
    }
    assert!(refused > 8, "{refused}");
}

#[test]
fn pictures_show_both_maps_or_the_whole_screen() {
    let mut comparison = stopped_comparison();
    draw(&mut comparison, (80, 24));
    stage(&mut comparison);
    press(&mut comparison, KeyCode::Char('E'));
    let shown = text(&draw(&mut comparison, (80, 24)));
    assert!(shown.contains("both maps as bitmap") && shown.contains("screen as vector graphic"));
    press(&mut comparison, KeyCode::Esc);
    let size = |comparison: &mut Comparison, kind| {
        let file = comparison.contents(kind).expect("a picture");
        let reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG");
        (reader.info().width, reader.info().height)
    };
    draw(&mut comparison, (80, 24));
    assert_eq!(size(&mut comparison, ExportKind::ScreenPng), (8 * 80, 16 * 24));
    let (width, height) = size(&mut comparison, ExportKind::MapPng);
    assert!(width == 8 * 80 && (16 * 10..16 * 20).contains(&height), "{width} x {height}");
    let drawing = comparison.contents(ExportKind::ScreenSvg).expect("a drawing");
    let drawing = String::from_utf8(drawing).expect("text");
    assert!(drawing.contains("<svg") && drawing.matches("<text").count() > 500);
}

#[test]
fn pictures_have_all_colours_on_terminals_that_have_few() {
    let mut comparison = stopped_comparison();
    draw(&mut comparison, (80, 24));
    stage(&mut comparison);
    let [full, few] = [ColourDepth::True, ColourDepth::Basic].map(|depth| {
        let theme = Theme::new(ThemeName::Dark, depth);
        comparison.apps().into_iter().for_each(|app| app.screen.theme = theme);
        comparison.contents(ExportKind::ScreenPng).expect("a picture")
    });
    assert!(full == few);
    assert!(comparison.apps().iter().all(|app| app.screen.theme.depth == ColourDepth::Basic));
}

#[test]
fn colours_and_presets_of_rivals_are_explained() {
    let mut plain = comparison();
    assert!(!text(&draw(&mut plain, (120, 40))).contains(" its Q"));
    let mut comparison = comparison_with(["gdg-bridge", "her"], Limits::default());
    for (size, words) in [
        ((80, 24), ["D: steps by its Q", "tuned: best here"]),
        ((240, 60), ["colours show the steps that its Q stands for", "it does best here"]),
    ] {
        let shown = text(&draw(&mut comparison, size));
        assert!(words.iter().all(|words| shown.contains(words)), "{size:?}: {shown}");
    }
    press(&mut comparison, KeyCode::Char('?'));
    let shown = text(&draw(&mut comparison, (120, 40)));
    assert!(shown.contains("no D"), "{shown}");
}
