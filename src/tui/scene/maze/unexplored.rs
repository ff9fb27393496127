//! Unvisited cells, the edge of the known world, and cells from which no path leads to the goal.

use super::MazeState;
use crate::tui::canvas::{CUT_OFF_MARK, Canvas, UNVISITED_MARK};
use crate::tui::layers::Overlay;
use crate::tui::raster::MapFrame;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, blend};
use gdg::draw::Ground;
use gdg::viewer::Field;
use gdg::viewer::maze::Knowledge;

/// Pixels between two lines of hatching with colours, and characters between two signs without.
const HATCH_SPACING: usize = 4;
const MONO_HATCH_SPACING: usize = 8;

/// What the agents know of the cell that each pixel shows; everything if the overlay is off.
pub struct Unexplored {
    known: Vec<Knowledge>,
    /// Whether no path leads from each pixel's cell to the goal; empty if one leads from everywhere
    /// or that is not shown.
    cut_off: Vec<bool>,
    /// Whether unvisited cells fade and so hide values: not if values are valid even there.
    fades: bool,
}

impl Unexplored {
    /// Looks up each pixel's cell.
    pub fn new(grounds: &[Ground], maze: &MazeState, screen: &Screen) -> Self {
        let (map, exploration) = (&maze.map, &maze.view.exploration);
        if maze.past().is_some() {
            // The film does not record what had been explored.
            return Self { known: Vec::new(), cut_off: Vec::new(), fades: false };
        }
        let cut_off = cut_off(grounds, maze, screen);
        if !screen.overlays.has(Overlay::Unexplored) || exploration.is_complete(map) {
            return Self { known: Vec::new(), cut_off, fades: false };
        }
        let known = |ground: &Ground| match ground {
            Ground::Free(at) => exploration.at(*at),
            Ground::Wall | Ground::Crossed(_) | Ground::Outside => Knowledge::Known,
        };
        Self { known: grounds.iter().map(known).collect(), cut_off, fades: screen.field.fades() }
    }

    /// Returns whether values at pixel `i` mean nothing, as it shows a cell beyond the known world.
    pub fn hides(&self, i: usize) -> bool {
        self.is_cut_off(i) || self.fades && self.is_beyond(i)
    }

    fn is_cut_off(&self, i: usize) -> bool {
        self.cut_off.get(i) == Some(&true)
    }

    fn is_beyond(&self, i: usize) -> bool {
        self.known.get(i) == Some(&Knowledge::Beyond)
    }

    /// Fades unvisited cells, unless their values are valid even there, and draws the edge.
    pub fn draw(&self, canvas: &mut Canvas, map_frame: &MapFrame, screen: &Screen) {
        self.draw_known(canvas, map_frame, screen);
        let columns = canvas.columns();
        for i in (0..self.cut_off.len()).filter(|i| self.is_cut_off(*i)) {
            let hatched = (i % columns)
                .abs_diff(2 * columns - i / columns % columns)
                .is_multiple_of(HATCH_SPACING);
            canvas.set(i, Some(screen.theme.cut_off(hatched)), CUT_OFF_MARK);
        }
    }

    fn draw_known(&self, canvas: &mut Canvas, map_frame: &MapFrame, screen: &Screen) {
        let theme = &screen.theme;
        let columns = canvas.columns();
        // A pixel that shows several cells may show the edge without being represented by a cell at
        // the edge.
        let coarse = map_frame.raster.window[2] > map_frame.raster.pixels.0 as f32;
        let mono = theme.depth == ColourDepth::Mono;
        let (across, down) = map_frame.marker.pixels();
        let is_hatched = |i: usize| {
            let (column, row) = (i % columns, i / columns);
            if mono {
                // Few, and by characters: signs stand out more than colours.
                (column / across + MONO_HATCH_SPACING / 2 * (row / down))
                    .is_multiple_of(MONO_HATCH_SPACING)
            } else {
                (column + row).is_multiple_of(HATCH_SPACING)
            }
        };
        for (i, known) in self.known.iter().enumerate() {
            let Some(ground) = canvas.colour(i) else { continue };
            match known {
                Knowledge::Beyond if self.fades => {
                    let hatched = is_hatched(i);
                    let mark = if hatched { UNVISITED_MARK } else { ' ' };
                    canvas.set(i, Some(theme.unvisited(ground, hatched)), mark);
                }
                Knowledge::Pocket if self.fades => {
                    canvas.set(i, Some(theme.pocket(ground)), canvas.mark(i));
                }
                Knowledge::Beyond => {
                    canvas.set(
                        i,
                        Some(ground),
                        if is_hatched(i) { UNVISITED_MARK } else { canvas.mark(i) },
                    );
                }
                Knowledge::Pocket => {}
                Knowledge::Edge | Knowledge::Known => {
                    let edge = *known == Knowledge::Edge || coarse && !canvas.is_wall(i);
                    if edge && !mono && self.borders(i, columns) {
                        let (rgb, share) = theme.edge();
                        canvas.set(i, Some(blend(ground, rgb, share)), ' ');
                    }
                }
            }
        }
    }

    /// Whether a pixel beside or diagonal to pixel `i` shows a cell beyond the known world.
    fn borders(&self, i: usize, columns: usize) -> bool {
        let (x, y) = (i % columns, i / columns);
        let around = (y.saturating_sub(1)..=y + 1)
            .flat_map(|y| (x.saturating_sub(1)..=x + 1).map(move |x| (x, y)));
        around.filter(|(x, _)| *x < columns).any(|(x, y)| self.is_beyond(y * columns + x))
    }
}

/// Returns whether no path leads from each pixel's cell to the goal, if the colours show distances
/// to it.
fn cut_off(grounds: &[Ground], maze: &MazeState, screen: &Screen) -> Vec<bool> {
    let (map, cells) = (&maze.map, &maze.view.cut_off);
    let to_goal =
        matches!(screen.field, Field::Learned | Field::Composed | Field::True | Field::Error);
    // The trainer may not know the map's latest edit yet.
    if !to_goal || cells.len() != map.free().len() {
        return Vec::new();
    }
    let is = |ground: &Ground| match ground {
        Ground::Free([x, y]) => cells[*y as usize * map.width() + *x as usize],
        Ground::Wall | Ground::Crossed(_) | Ground::Outside => false,
    };
    grounds.iter().map(is).collect()
}
