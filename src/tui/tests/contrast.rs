//! Kinds of ground can be told apart with few colours: in what is sent to the terminal.

use ratatui::backend::{Backend, CrosstermBackend};

use super::*;
use crate::tui::export::contents;
use crate::tui::layers::{Overlay, Overlays};
use crate::tui::marker::Marker;
use crate::tui::output::ExportKind;
use crate::tui::raster::MapFrame;
use crate::tui::theme::{LEAST_CONTRAST, Rgb, XTERM, rgb_of_indexed};
use gdg::draw::Ground;
use gdg::draw::contrast;
use gdg::viewer::maze::{Exploration, Knowledge};

const SIZE: (u16, u16) = (120, 40);

const COLOURED: [ThemeName; 3] = [ThemeName::Dark, ThemeName::Light, ThemeName::ColourBlindSafe];

/// Returns a terminal's colour, where `first` are its first 16.
fn displayed(colour: vt100::Color, first: Option<&[Rgb; 16]>) -> Rgb {
    match (colour, first) {
        (vt100::Color::Idx(i), Some(first)) if i < 16 => first[usize::from(i)],
        (vt100::Color::Idx(i), _) => rgb_of_indexed(i),
        (vt100::Color::Rgb(..), _) => panic!("{colour:?} is not sent to such a terminal"),
        (vt100::Color::Default, _) => (0, 0, 0),
    }
}

/// A maze-like map, of which agents know the left half: corridors, rooms and pillars.
fn half_explored(theme: &Theme, marker: Marker) -> Still {
    let row = |y: usize| {
        let wall = |x: usize| {
            x.is_multiple_of(12) && y % 9 != 4
                || y.is_multiple_of(9) && x % 12 != 6
                || x.is_multiple_of(4) && y.is_multiple_of(3)
        };
        (0..60).map(|x| if wall(x) { '#' } else { '.' }).collect::<String>() + "\n"
    };
    let text: String = (0..37).map(row).collect();
    let mut app = still_on(parse_map("halls", text.as_bytes()).expect("a map"), gdg());
    app.set_goal(Cell::new(2, 2));
    app.screen.theme = *theme;
    app.screen.marker = marker;
    let overlays = &mut app.screen.overlays;
    *overlays = Overlays::by_default(theme.depth);
    for overlay in [Overlay::Agents, Overlay::Candidates, Overlay::Path] {
        if overlays.has(overlay) {
            overlays.toggle(overlay);
        }
    }
    draw(&mut app, SIZE.0, SIZE.1);
    let frame = app.screen.layout.map.clone().expect("the map is drawn");
    let map = app.maze().map.clone();
    let raster = frame.raster;
    let value = |i| match raster.ground(&map, i % raster.pixels.0, i / raster.pixels.0) {
        Ground::Free([x, y]) => 2.0 * (x - 2.5).hypot(y - 2.5),
        _ => f32::NAN,
    };
    let field: Vec<f32> = (0..raster.len()).map(value).collect();
    let visits: Vec<u32> = (0..map.free().len()).map(|i| u32::from(map.cell(i).x < 30)).collect();
    let goal = (Some(app.maze().goal), app.maze().view.goal.1);
    app.change_view(|view| {
        view.goal = goal;
        view.farthest = field.iter().copied().filter(|d| d.is_finite()).fold(1.0, f32::max);
        (view.raster, view.field) = (Some(raster), Arc::new(field));
        view.exploration = Arc::new(Exploration::new(&map, &visits));
    });
    app
}

/// Draws the screen, and returns what a terminal makes of the bytes sent to it.
fn sent(app: &mut App) -> vt100::Parser {
    let drawn = draw(app, SIZE.0, SIZE.1).backend().buffer().clone();
    let mut bytes = Vec::new();
    let cells = drawn.area.positions().map(|at| (at.x, at.y, &drawn[at]));
    CrosstermBackend::new(&mut bytes).draw(cells).expect("bytes");
    let size = |n| std::num::NonZero::new(n).expect("a size");
    let mut parser = vt100::Parser::new(size(SIZE.1), size(SIZE.0), 0);
    parser.process(&bytes);
    parser
}

/// Returns each pixel's colour of a map in half blocks, row by row; none below letters.
fn half_blocks(
    parser: &vt100::Parser,
    frame: &MapFrame,
    first: Option<&[Rgb; 16]>,
) -> Vec<Option<Rgb>> {
    let (columns, rows) = frame.raster.pixels;
    let pixel = |i: usize| {
        let (column, row) = ((i % columns) as u16, i / columns);
        let cell = parser.screen().cell(frame.area.y + row as u16 / 2, frame.area.x + column)?;
        let colours = [cell.fgcolor(), cell.bgcolor()].map(|colour| displayed(colour, first));
        let [upper, lower] = match cell.contents() {
            "\u{2580}" => [colours[0], colours[1]],
            "\u{2584}" => [colours[1], colours[0]],
            "\u{2588}" => [colours[0]; 2],
            " " => [colours[1]; 2],
            _ => return None,
        };
        Some(if row % 2 == 0 { upper } else { lower })
    };
    (0..columns * rows).map(pixel).collect()
}

/// Checks walls against floor, visited or not, and contour lines against both.
fn check_half_blocks(theme: &Theme, first: Option<&[Rgb; 16]>) {
    let mut app = half_explored(theme, Marker::HalfBlock);
    let with = sent(&mut app);
    let frame = app.screen.layout.map.clone().expect("the map is drawn");
    app.screen.overlays.toggle(Overlay::Contours);
    let without = sent(&mut app);
    let [with, without] = [&with, &without].map(|sent| half_blocks(sent, &frame, first));
    let (maze, columns) = (app.maze(), frame.raster.pixels.0);
    let ground = |i| frame.raster.ground(&maze.map, i % columns, i / columns);
    let wall = displayed_wall(&without, &ground);
    let mut counts = [0; 3];
    for i in 0..without.len() {
        let (Some(floor), Ground::Free(at)) = (without[i], ground(i)) else { continue };
        let knowledge = maze.view.exploration.at(at);
        // The edge of the known world has a colour of its own.
        if knowledge == Knowledge::Edge {
            continue;
        }
        if let Some(line) = with[i].filter(|line| *line != floor) {
            counts[2] += 1;
            let known = |other: usize| match ground(other) {
                Ground::Free(at) => maze.view.exploration.at(at) == knowledge,
                _ => false,
            };
            let beside = [i.wrapping_sub(1), i + 1, i.wrapping_sub(columns), i + columns];
            let beside = beside.into_iter().filter(|other| *other < without.len() && known(*other));
            let beside = beside.filter_map(|other| without[other]);
            for other in [floor, wall].into_iter().chain(beside) {
                let own = contrast(line, other);
                assert!(own >= LEAST_CONTRAST, "{line:?} on {other:?} has only {own}");
            }
        }
        let beside = [i.wrapping_sub(1), i + 1, i.wrapping_sub(columns), i + columns];
        let is_wall = |other: &&usize| **other < without.len() && ground(**other) == Ground::Wall;
        for other in beside.iter().filter(is_wall).filter_map(|other| without[*other]) {
            counts[usize::from(knowledge == Knowledge::Beyond)] += 1;
            let own = contrast(floor, other);
            assert!(own >= LEAST_CONTRAST, "{floor:?} by {other:?} has only {own}");
        }
    }
    assert!(counts.iter().all(|count| *count > 50), "little to compare: {counts:?}");
}

/// Returns the colour of walls, of which there is only one.
fn displayed_wall(pixels: &[Option<Rgb>], ground: &impl Fn(usize) -> Ground) -> Rgb {
    let mut walls: Vec<Rgb> = (0..pixels.len())
        .filter(|i| ground(*i) == Ground::Wall)
        .filter_map(|i| pixels[i])
        .collect();
    walls.sort_unstable();
    walls.dedup();
    let [wall] = walls[..] else { panic!("walls have several colours: {walls:?}") };
    wall
}

#[test]
fn ground_can_be_told_apart_with_256_and_with_16_colours() {
    for name in COLOURED {
        check_half_blocks(&Theme::new(name, ColourDepth::Indexed), None);
        for first in [None, Some(&XTERM)] {
            check_half_blocks(&Theme::new(name, ColourDepth::Basic), first);
        }
    }
}

#[test]
fn characters_that_show_floor_and_wall_have_both_colours() {
    for (name, marker) in
        COLOURED.into_iter().flat_map(|name| [(name, Marker::Quadrant), (name, Marker::Braille)])
    {
        let mut app = half_explored(&Theme::new(name, ColourDepth::Indexed), marker);
        app.screen.overlays.toggle(Overlay::Contours);
        let sent = sent(&mut app);
        let frame = app.screen.layout.map.clone().expect("the map is drawn");
        let (maze, (across, down)) = (app.maze(), marker.pixels());
        let mut count = 0;
        for at in frame.area.positions() {
            let ground = |n: usize| {
                let column = usize::from(at.x - frame.area.x) * across + n % across;
                let row = usize::from(at.y - frame.area.y) * down + n / across;
                frame.raster.ground(&maze.map, column, row)
            };
            let grounds: Vec<Ground> = (0..across * down).map(ground).collect();
            // Two colours show one kind of floor beside walls.
            let kind = |ground: &Ground| match ground {
                Ground::Free(at) => Some(maze.view.exploration.at(*at)),
                _ => None,
            };
            let mut kinds = grounds.iter().filter_map(kind);
            let own = kinds.next().filter(|own| *own != Knowledge::Edge);
            let is_one_kind = own.is_some_and(|own| kinds.all(|other| other == own));
            let has_wall = grounds.contains(&Ground::Wall);
            let is_known = |ground: &Ground| matches!(ground, Ground::Wall | Ground::Free(_));
            let cell = sent.screen().cell(at.y, at.x).expect("a cell");
            let is_letter = cell.contents().chars().all(|c| c.is_alphanumeric() || c == '@');
            if !is_one_kind || !has_wall || !grounds.iter().all(is_known) || is_letter {
                continue;
            }
            count += 1;
            let [front, back] =
                [cell.fgcolor(), cell.bgcolor()].map(|colour| displayed(colour, None));
            let own = contrast(front, back);
            assert!(
                own >= LEAST_CONTRAST,
                "{name:?} {marker:?}: {front:?} on {back:?} at {at} has only {own}"
            );
        }
        assert!(count > 50, "little to compare: {count}");
    }
}

#[test]
fn exports_have_all_colours_whatever_the_terminal_has() {
    let export = |depth| {
        let mut app = half_explored(&Theme::new(ThemeName::Dark, depth), Marker::HalfBlock);
        let app = &mut app.app;
        let before = app.screen.theme.depth;
        let svg = contents(ExportKind::MapSvg, &mut app.screen, &app.scene).expect("an export");
        assert_eq!(app.screen.theme.depth, before, "the screen keeps its colours");
        String::from_utf8(svg).expect("text")
    };
    let own = export(ColourDepth::True);
    assert_eq!([ColourDepth::Indexed, ColourDepth::Basic].map(export), [own.clone(), own]);
}
