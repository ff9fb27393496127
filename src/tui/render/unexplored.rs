//! Unvisited cells, and the edge of the known world.

use crate::tui::canvas::{Canvas, UNVISITED_MARK};
use crate::tui::layers::Overlay;
use crate::tui::raster::MapFrame;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, blend};
use crate::view::{Field, Ground, Knowledge};

/// How far unvisited cells fade into the colour of unknown ground, and hatched ones into that of walls.
const FADE: f32 = 0.7;
const HATCH: f32 = 0.5;

/// Pixels between two lines of hatching.
const HATCH_SPACING: usize = 4;

/// How strongly the edge is tinted.
const TINT: f32 = 0.75;

/// What the agents know of the cell that each pixel shows; all of it if that is not shown.
pub struct Unexplored(Vec<Knowledge>);

impl Unexplored {
    /// Looks up each pixel's cell.
    pub fn new(map_frame: &MapFrame, screen: &Screen) -> Self {
        let (raster, map, exploration) = (&map_frame.raster, screen.map(), &screen.view.exploration);
        if !screen.overlays.has(Overlay::Unexplored) || exploration.is_complete(map) {
            return Self(Vec::new());
        }
        let (columns, rows) = raster.pixels;
        let known = |i: usize| match raster.ground(map, i % columns, i / columns) {
            Ground::Free(at) => exploration.at(at),
            Ground::Wall | Ground::Outside => Knowledge::Known,
        };
        Self((0..columns * rows).map(known).collect())
    }

    /// Returns whether pixel `i` shows an unvisited cell.
    pub fn has(&self, i: usize) -> bool {
        self.0.get(i) == Some(&Knowledge::Unvisited)
    }

    /// Fades the colours of unvisited cells, except where they show what is true even there, and draws the edge.
    pub fn draw(&self, canvas: &mut Canvas, screen: &Screen) {
        let theme = &screen.theme;
        let learned = matches!(screen.field, Field::Learned | Field::FromStart | Field::Composed);
        let columns = canvas.columns();
        for (i, known) in self.0.iter().enumerate() {
            let Some(ground) = canvas.colour(i) else { continue };
            match known {
                Knowledge::Unvisited if learned || screen.field == Field::Plain => {
                    let hatched = (i % columns + i / columns).is_multiple_of(HATCH_SPACING);
                    let faded = blend(ground, theme.unknown, FADE);
                    let rgb = if hatched { blend(faded, theme.wall, HATCH) } else { faded };
                    canvas.set(i, Some(rgb), UNVISITED_MARK);
                }
                Knowledge::Unvisited => canvas.set(i, Some(ground), UNVISITED_MARK),
                Knowledge::Edge if theme.depth != ColourDepth::Mono && self.borders(i, columns) => {
                    canvas.set(i, Some(blend(ground, theme.frontier, TINT)), ' ');
                }
                Knowledge::Edge | Knowledge::Known => {}
            }
        }
    }

    /// Whether a pixel beside or diagonal to pixel `i` shows an unvisited cell.
    fn borders(&self, i: usize, columns: usize) -> bool {
        let (x, y) = (i % columns, i / columns);
        let around = (y.saturating_sub(1)..=y + 1).flat_map(|y| (x.saturating_sub(1)..=x + 1).map(move |x| (x, y)));
        around.filter(|(x, _)| *x < columns).any(|(x, y)| self.has(y * columns + x))
    }
}
