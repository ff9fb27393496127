//! Nothing that is on floor is drawn inside a wall.

use super::*;
use crate::tui::layers::{Overlay, Overlays};
use crate::tui::marker::Marker;
use crate::tui::raster::{MapFrame, Viewport};
use gdg::draw::Ground;
use gdg::map::{RandomMapKind, random};

/// Returns whether a character shows floor in any of its pixels.
fn shows_floor(frame: &MapFrame, map: &Grid, at: Position) -> bool {
    let (across, down) = frame.marker.pixels();
    (0..across * down).any(|n| {
        let column = usize::from(at.x - frame.area.x) * across + n % across;
        let row = usize::from(at.y - frame.area.y) * down + n / across;
        matches!(frame.raster.ground(map, column, row), Ground::Free(_))
    })
}

/// Draws an agent and the walking agent at `at`; returns how many characters they change.
fn check(app: &mut App, at: [f32; 2], (width, height): (u16, u16)) -> usize {
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
            shown += usize::from(check(&mut app, at, (80, 24)) > 0);
        }
    }
    assert!(10 * shown > 9 * all, "{shown} of {all} are shown");
}
