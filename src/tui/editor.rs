//! Editing the map: strokes of wall or floor, a cursor for the keyboard, undo and redo.

use std::sync::Arc;

use ratatui::layout::Position;

use super::raster::MapFrame;
use crate::map::{Cell, Grid};

/// The editor's state; strokes are made of it while it is open, undo and redo last.
#[derive(Default)]
pub struct Editor {
    /// Where the keyboard draws, while the editor is open.
    pub cursor: Option<Cell>,
    stroke: Option<Stroke>,
    undone: Vec<Arc<Grid>>,
    done: Vec<Arc<Grid>>,
}

/// What a pressed button has drawn so far.
struct Stroke {
    free: bool,
    cells: Vec<Cell>,
    at: Position,
}

impl Editor {
    /// Whether it is open.
    pub fn is_open(&self) -> bool {
        self.cursor.is_some()
    }

    /// Cells of the stroke under way, and whether they are to be free.
    pub fn stroke(&self) -> Option<(&[Cell], bool)> {
        self.stroke.as_ref().map(|stroke| (&stroke.cells[..], stroke.free))
    }

    /// A button goes down, or is dragged on, at a place on the screen: free cells or walls are drawn there, and on the
    /// line from where it was before.
    pub fn draw(&mut self, to: Position, free: bool, frame: &MapFrame, map: &Grid) {
        let stroke = self.stroke.get_or_insert_with(|| Stroke { free, cells: Vec::new(), at: to });
        let along =
            |from: u16, to: u16, i: i32, n: i32| (i32::from(from) + (i32::from(to) - i32::from(from)) * i / n) as u16;
        let n = i32::from(stroke.at.x.abs_diff(to.x).max(stroke.at.y.abs_diff(to.y))).max(1);
        for i in 0..=n {
            let at = Position::new(along(stroke.at.x, to.x, i, n), along(stroke.at.y, to.y, i, n));
            for cell in frame.cells_at(at, map) {
                if !stroke.cells.contains(&cell) {
                    stroke.cells.push(cell);
                }
            }
        }
        stroke.at = to;
    }

    /// The button is let go: the map as the stroke made it, if it changed anything that may be changed.
    pub fn finish(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let Stroke { free, cells, .. } = self.stroke.take()?;
        self.change(map, cells, free)
    }

    /// The map with the cell at the cursor turned from wall to floor or back.
    pub fn toggle(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let cell = self.cursor?;
        self.change(map, vec![cell], !map.is_free(cell))
    }

    fn change(&mut self, map: &Arc<Grid>, cells: Vec<Cell>, free: bool) -> Option<Arc<Grid>> {
        let new = map.with_cells(cells.into_iter().map(|cell| (cell, free)))?;
        if new == **map {
            return None;
        }
        self.done.push(map.clone());
        self.undone.clear();
        Some(Arc::new(new))
    }

    /// The map before the latest change.
    pub fn undo(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let before = self.done.pop()?;
        self.undone.push(map.clone());
        Some(before)
    }

    /// The map before the latest undo.
    pub fn redo(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let after = self.undone.pop()?;
        self.done.push(map.clone());
        Some(after)
    }
}
