//! The map as a picture.

use ratatui::layout::Rect;

use super::staged::staged_app;
use super::*;
use crate::tui::choices::{Marker, Overlay};
use crate::tui::graphics::patches::Patches;
use crate::tui::graphics::{Graphics, Redraw, TerminalPicture};
use crate::tui::theme::Rgb;

pub(super) const GRAPHICS: Graphics = Graphics { character: (8, 16) };

fn app_with_pictures() -> App {
    let mut app = app();
    app.set_graphics(Some(GRAPHICS), Redraw::All);
    app
}

fn picture(app: &App) -> &TerminalPicture {
    app.pictures().first().copied().expect("a picture")
}

/// Returns the colour of the picture at a position on the map, shifted by some pixels.
fn colour(app: &App, at: [f32; 2], off: [f32; 2]) -> Rgb {
    let window = app.screen.layout.map.as_ref().expect("a map").raster.window;
    let TerminalPicture { columns, pixels, .. } = picture(app);
    let pixel = |at: f32, from: f32, shown: f32, size: usize, off: f32| {
        ((at - from) / shown * size as f32 + off) as usize
    };
    let x = pixel(at[0], window[0], window[2], *columns, off[0]);
    let y = pixel(at[1], window[1], window[3], pixels.len() / columns, off[1]);
    pixels[y * columns + x].into()
}

/// Hides everything except the map, the field, the goal and the walking agent.
fn hide_overlays(app: &mut App) {
    let shown = Overlay::ALL.into_iter().filter(|overlay| app.screen.overlays.has(*overlay));
    for overlay in shown.collect::<Vec<_>>() {
        app.screen.overlays.toggle(overlay);
    }
}

/// Returns the characters that no text has been written over.
fn left_to_picture(terminal: &Terminal<TestBackend>, area: Rect) -> usize {
    area.positions().filter(|at| TerminalPicture::owns(&terminal.backend().buffer()[*at])).count()
}

#[test]
fn a_small_map_is_drawn_pixel_by_pixel() {
    let mut app = app_with_pictures();
    hide_overlays(&mut app);
    let terminal = draw(&mut app, 80, 24);
    let area = app.screen.layout.map.as_ref().expect("a map").area;
    assert_eq!(picture(&app).area, area);
    assert!(left_to_picture(&terminal, area) > area.area() as usize / 2);
    let theme = app.screen.theme;
    // The wall has sharp edges, one pixel apart.
    assert_eq!(colour(&app, [10.5, 1.5], [0.0; 2]), theme.wall);
    assert_eq!(colour(&app, [10.0, 1.5], [0.5, 0.0]), theme.wall);
    assert_ne!(colour(&app, [10.0, 1.5], [-0.5, 0.0]), theme.wall);
    assert_ne!(colour(&app, [10.5, 2.5], [0.0; 2]), theme.wall, "the door");
    // The goal is a disc with a letter on it.
    assert_eq!(colour(&app, app.maze().goal.centre(), [-5.0, 0.0]), theme.goal);
}

#[test]
fn text_over_the_map_wins() {
    let mut app = app_with_pictures();
    let mut patches = Patches::default();
    let before = draw(&mut app, 80, 24);
    let sent = |patches: &mut Patches, app: &App, terminal: &Terminal<TestBackend>| {
        let screen = terminal.backend().buffer();
        let bytes = patches.update(&app.pictures(), screen, GRAPHICS).expect("encoded");
        String::from_utf8_lossy(&bytes).into_owned()
    };
    sent(&mut patches, &app, &before);
    let area = app.screen.layout.map.as_ref().expect("a map").area;
    press(&mut app, KeyCode::Char('?'));
    let after = draw(&mut app, 80, 24);
    assert!(left_to_picture(&after, area) < left_to_picture(&before, area) / 2);
    assert!(sent(&mut patches, &app, &after).contains("a=d"), "what is below is deleted");
    // A maximised pane takes the place of the map.
    press(&mut app, KeyCode::Esc);
    press(&mut app, KeyCode::Char('z'));
    draw(&mut app, 80, 24);
    assert!(app.pictures().is_empty());
}

#[test]
fn pixels_are_for_terminals_with_pictures_and_colours() {
    for (marker, graphics, theme, depth, are_shown) in [
        (Marker::Auto, Some(GRAPHICS), ThemeName::Dark, ColourDepth::True, true),
        (Marker::Pixels, Some(GRAPHICS), ThemeName::Light, ColourDepth::True, true),
        (Marker::Auto, Some(GRAPHICS), ThemeName::Dark, ColourDepth::Mono, false),
        (Marker::Pixels, None, ThemeName::Dark, ColourDepth::True, false),
        (Marker::HalfBlock, Some(GRAPHICS), ThemeName::Dark, ColourDepth::True, false),
    ] {
        let mut app = still();
        app.screen.marker = marker;
        app.screen.theme = Theme::new(theme, depth);
        app.set_graphics(graphics, Redraw::All);
        draw(&mut app, 80, 24);
        assert_eq!(!app.pictures().is_empty(), are_shown, "{marker:?} {theme:?} {depth:?}");
    }
}

#[test]
fn the_editor_and_a_part_of_the_map_are_drawn_as_pixels() {
    let mut app = staged_app(120, 40);
    app.set_graphics(Some(GRAPHICS), Redraw::All);
    let drawn = |app: &mut Still| {
        draw(app, 120, 40);
        picture(app).pixels.clone()
    };
    let before = drawn(&mut app);
    press(&mut app, KeyCode::Char('e'));
    assert!(drawn(&mut app) != before, "the editor's cursor");
    press(&mut app, KeyCode::Esc);
    type_text(&mut app, "++");
    assert!(drawn(&mut app) != before, "zoomed in");
}

#[test]
fn maps_with_more_cells_than_pixels_lose_no_wall() {
    let row: String = (0..600).map(|x| if x % 50 == 49 { '#' } else { '.' }).collect();
    let map = parse_map("wide", format!("{row}\n").repeat(300).as_bytes()).expect("a map");
    let mut app = still_on(map, gdg());
    app.set_graphics(Some(Graphics { character: (3, 6) }), Redraw::All);
    draw(&mut app, 100, 40);
    let TerminalPicture { columns, pixels, .. } = picture(&app);
    assert!(*columns < 300, "less than a pixel for two cells");
    let row = pixels.chunks(*columns).nth(pixels.len() / columns * 3 / 4).expect("a row");
    let dark = |x: usize| row[x][1] > 38 && row[x][0] < 60;
    let walls = (1..*columns).filter(|x| dark(*x) && !dark(*x - 1)).count();
    assert_eq!(walls, 12);
}

#[test]
fn without_colours_signs_are_on_floor() {
    let row = |y| if y % 4 == 0 { ".###########\n" } else { "............\n" };
    let map = parse_map("rows", (0..21).map(row).collect::<String>().as_bytes()).expect("a map");
    let mut app = still_on(map.clone(), gdg());
    app.screen.theme = Theme::new(ThemeName::Dark, ColourDepth::Mono);
    for y in (0..21).filter(|y| y % 4 > 0) {
        app.set_goal(Cell::new(7, y));
        let shown = draw(&mut app, 80, 24);
        let frame = app.screen.layout.map.clone().expect("the map is drawn");
        let is_goal = |at: &Position| shown.backend().buffer()[*at].symbol() == "G";
        let at = frame.area.positions().find(is_goal).expect("a goal");
        assert!(frame.cells_at(at, &map).iter().all(|cell| map.is_free(*cell)), "row {y}");
    }
    let mut app = staged::staged_app(80, 24);
    assert!(shown_by(&mut app, 80, 24).contains('\u{25c6}'));
    app.change_cell(Cell::new(13, 1), false);
    assert!(!shown_by(&mut app, 80, 24).contains('\u{25c6}'), "a wall has been drawn there");
}
