//! The map as a picture.

use ratatui::layout::Rect;

use super::staged::staged_app;
use super::*;
use crate::tui::graphics::patches::Patches;
use crate::tui::graphics::{Graphics, Picture, Redraw};
use crate::tui::layers::Overlay;
use crate::tui::marker::Marker;
use crate::tui::theme::Rgb;

const GRAPHICS: Graphics = Graphics { character: (8, 16) };

/// Returns an app on a terminal that shows pictures.
fn app_with_pictures() -> App {
    let mut app = app();
    app.set_graphics(Some(GRAPHICS), Redraw::All);
    app
}

/// Returns the same app, showing only the map, the field, the goal and the walking agent, once the
/// field is on the screen.
fn app_with_field(columns: u16, rows: u16) -> App {
    let mut app = app_with_pictures();
    hide_overlays(&mut app);
    draw(&mut app, columns, rows);
    wait_until(&mut app, |app| {
        app.maze().view.field().map(|(_, raster)| raster)
            == app.screen.layout.map.as_ref().map(|map| map.raster)
    });
    draw(&mut app, columns, rows);
    app
}

fn picture(app: &App) -> &Picture {
    app.pictures().first().copied().expect("a picture")
}

/// Returns the colour of the picture at a position on the map, shifted by some pixels.
fn colour(app: &App, at: [f32; 2], off: [f32; 2]) -> Rgb {
    let window = app.screen.layout.map.as_ref().expect("a map").raster.window;
    let Picture { columns, pixels, .. } = picture(app);
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
    area.positions().filter(|at| Picture::owns(&terminal.backend().buffer()[*at])).count()
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
fn while_training_comes_first_the_ground_may_be_older_than_what_moves() {
    let mut app = app_with_field(80, 24);
    let (walker, ground) = ([1.5, 3.5], [4.5, 1.5]);
    Arc::make_mut(&mut app.maze_mut().view).reach.start = walker.to_vec();
    let shown = |app: &mut App, redraw| {
        app.set_graphics(Some(GRAPHICS), redraw);
        draw(app, 80, 24);
        [colour(app, ground, [0.0; 2]), colour(app, walker, [0.0; 2])]
    };
    let before = shown(&mut app, Redraw::All);
    let scale = |view: &mut View, by: f32| {
        Arc::make_mut(&mut view.fields)[0].iter_mut().for_each(|value| *value *= by);
    };
    // All distances are smaller, and the walk begins elsewhere.
    let view = Arc::make_mut(&mut app.maze_mut().view);
    scale(view, 0.1);
    view.reach.start = vec![ground[0] + 3.0, ground[1]];
    let [same, moved] = shown(&mut app, Redraw::Moving);
    assert!(same == before[0] && moved != before[1]);
    let [other, _] = shown(&mut app, Redraw::All);
    assert_ne!(other, before[0]);
    // Another goal is shown at once.
    let view = Arc::make_mut(&mut app.maze_mut().view);
    scale(view, 5.0);
    view.goal.1 += 1;
    assert_ne!(shown(&mut app, Redraw::Moving)[0], other);
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
        assert_eq!(
            !app.pictures().is_empty(),
            are_shown,
            "{marker:?} {graphics:?} {theme:?} {depth:?}"
        );
        // The mouse finds the same cells as with characters.
        let at = character_of(&app, Cell::new(3, 3));
        click(&mut app, MouseButton::Left, at);
        assert_eq!(app.maze().goal, Cell::new(3, 3));
    }
}

#[test]
fn everything_on_the_map_is_drawn_as_pixels() {
    let mut app = staged_app(120, 40);
    app.set_graphics(Some(GRAPHICS), Redraw::All);
    let drawn = |app: &mut Still| {
        draw(app, 120, 40);
        picture(app).pixels.clone()
    };
    let before = drawn(&mut app);
    for overlay in Overlay::ALL {
        app.screen.overlays.toggle(overlay);
        assert!(drawn(&mut app) != before, "{overlay:?}");
        app.screen.overlays.toggle(overlay);
    }
    press(&mut app, KeyCode::Char('e'));
    assert!(drawn(&mut app) != before, "the editor's cursor");
    press(&mut app, KeyCode::Esc);
    type_text(&mut app, "++");
    assert!(drawn(&mut app) != before, "zoomed in");
    for (width, height) in [(1, 1), (2, 3), (40, 10), (400, 120)] {
        draw(&mut app, width, height);
    }
}

#[test]
fn maps_with_more_cells_than_pixels_lose_no_wall() {
    let row: String = (0..600).map(|x| if x % 50 == 49 { '#' } else { '.' }).collect();
    let map = parse_map("wide", format!("{row}\n").repeat(300).as_bytes()).expect("a map");
    let mut app = still_on(map, gdg());
    app.set_graphics(Some(Graphics { character: (3, 6) }), Redraw::All);
    draw(&mut app, 100, 40);
    let Picture { columns, pixels, .. } = picture(&app);
    assert!(*columns < 300, "less than a pixel for two cells");
    let row = pixels.chunks(*columns).nth(pixels.len() / columns * 3 / 4).expect("a row");
    let dark = |x: usize| row[x][1] > 38 && row[x][0] < 60;
    let walls = (1..*columns).filter(|x| dark(*x) && !dark(*x - 1)).count();
    assert_eq!(walls, 12);
}
