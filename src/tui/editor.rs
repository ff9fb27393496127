//! Editing the map: tools for mouse and keyboard, undo and redo.

use std::sync::Arc;

use ratatui::layout::Position;

use super::raster::MapFrame;
use crate::map::{Cell, Grid};

/// What a press of the button, or of the key, does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    /// Draws walls.
    #[default]
    Pencil,
    /// Draws floor.
    Eraser,
    /// A straight wall.
    Line,
    /// Walls around a rectangle.
    Rectangle,
    /// Fills an area of floor with wall, or of wall with floor.
    Fill,
    /// Puts a start, moves it or takes it away.
    Start,
    /// Puts a goal, moves it or takes it away.
    Goal,
}

impl Tool {
    /// All of them, in the order of their keys.
    pub const ALL: [Self; 7] =
        [Self::Pencil, Self::Eraser, Self::Line, Self::Rectangle, Self::Fill, Self::Start, Self::Goal];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pencil => "wall",
            Self::Eraser => "floor",
            Self::Line => "line",
            Self::Rectangle => "box",
            Self::Fill => "fill",
            Self::Start => "start",
            Self::Goal => "goal",
        }
    }
}

/// The editor's state; strokes are made of it while it is open, undo and redo last.
#[derive(Default)]
pub struct Editor {
    /// Where the keyboard draws, while the editor is open.
    pub cursor: Option<Cell>,
    /// What is drawn with.
    pub tool: Tool,
    stroke: Option<Stroke>,
    undone: Vec<Arc<Grid>>,
    done: Vec<Arc<Grid>>,
}

/// What has been begun: by a button that is still pressed, or by the first of two key presses.
struct Stroke {
    free: bool,
    /// Cells drawn freehand.
    cells: Vec<Cell>,
    from: Cell,
    to: Cell,
    /// Where the mouse was last.
    at: Option<Position>,
}

impl Editor {
    /// Whether it is open.
    pub fn is_open(&self) -> bool {
        self.cursor.is_some()
    }

    /// Takes another tool; what was begun with the one before is given up.
    pub fn take(&mut self, tool: Tool) {
        (self.tool, self.stroke) = (tool, None);
    }

    /// Closes it; what was begun is given up.
    pub fn close(&mut self) {
        (self.cursor, self.stroke) = (None, None);
    }

    /// Forgets all edits: the map is another one.
    pub fn forget(&mut self) {
        *self = Self { tool: self.tool, ..Self::default() };
    }

    /// Cells that what was begun would change, and whether they are to be free.
    pub fn preview(&self) -> Option<(Vec<Cell>, bool)> {
        self.stroke.as_ref().map(|stroke| (self.cells_of(stroke), stroke.free))
    }

    fn cells_of(&self, stroke: &Stroke) -> Vec<Cell> {
        match self.tool {
            Tool::Pencil | Tool::Eraser => stroke.cells.clone(),
            Tool::Line => line(stroke.from, stroke.to),
            Tool::Rectangle => rectangle(stroke.from, stroke.to),
            Tool::Fill | Tool::Start | Tool::Goal => Vec::new(),
        }
    }

    /// A button goes down, or is dragged on, at a place on the screen; the second button draws floor.
    pub fn draw(&mut self, to: Position, second: bool, frame: &MapFrame, map: &Grid) {
        let Some(cell) = frame.cell_at(to, map) else { return };
        let free = second || self.tool == Tool::Eraser;
        let begun = Stroke { free, cells: Vec::new(), from: cell, to: cell, at: None };
        let stroke = self.stroke.get_or_insert(begun);
        stroke.to = cell;
        let from = stroke.at.replace(to).unwrap_or(to);
        let along =
            |from: u16, to: u16, i: i32, n: i32| (i32::from(from) + (i32::from(to) - i32::from(from)) * i / n) as u16;
        let n = i32::from(from.x.abs_diff(to.x).max(from.y.abs_diff(to.y))).max(1);
        for i in 0..=n {
            let at = Position::new(along(from.x, to.x, i, n), along(from.y, to.y, i, n));
            for cell in frame.cells_at(at, map) {
                if !stroke.cells.contains(&cell) {
                    stroke.cells.push(cell);
                }
            }
        }
    }

    /// The button is let go: the map as it is then, if anything changed.
    pub fn finish(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        // A line begun by the keyboard waits for its second press.
        let stroke = self.stroke.take_if(|stroke| stroke.at.is_some())?;
        self.change(map, &stroke)
    }

    /// The tool is used at the cursor: the map as it is then, if anything changed.
    pub fn apply(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let cell = self.cursor?;
        if matches!(self.tool, Tool::Line | Tool::Rectangle) {
            if let Some(mut stroke) = self.stroke.take() {
                stroke.to = cell;
                return self.change(map, &stroke);
            }
            self.stroke = Some(Stroke { free: false, cells: Vec::new(), from: cell, to: cell, at: None });
            return None;
        }
        let free = self.tool == Tool::Eraser || !map.is_free(cell);
        self.change(map, &Stroke { free, cells: vec![cell], from: cell, to: cell, at: None })
    }

    /// The cursor moves by a cell; a line that was begun follows it.
    pub fn move_cursor(&mut self, (dx, dy): (isize, isize), map: &Grid) {
        let Some(at) = self.cursor else { return };
        let to = beside(at, (dx, dy), map);
        self.cursor = Some(to);
        if let Some(stroke) = &mut self.stroke {
            stroke.to = to;
        }
    }

    fn change(&mut self, map: &Arc<Grid>, stroke: &Stroke) -> Option<Arc<Grid>> {
        let (from, to) = (stroke.from, stroke.to);
        let new = match self.tool {
            Tool::Fill => map.with_cells(area(map, to).into_iter().map(|cell| (cell, !map.is_free(to)))),
            Tool::Start => Some(map.with_marks(moved(map.starts(), from, to), map.goals().to_vec())),
            Tool::Goal => Some(map.with_marks(map.starts().to_vec(), moved(map.goals(), from, to))),
            _ => map.with_cells(self.cells_of(stroke).into_iter().map(|cell| (cell, stroke.free))),
        };
        self.remember(map, new?)
    }

    /// The new map, if it differs; the old one can be taken back.
    pub fn remember(&mut self, map: &Arc<Grid>, new: Grid) -> Option<Arc<Grid>> {
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

/// The cell so many columns and rows from `at`, or the last one before the map's edge.
pub fn beside(at: Cell, (dx, dy): (isize, isize), map: &Grid) -> Cell {
    let to = Cell::new(at.x.saturating_add_signed(dx), at.y.saturating_add_signed(dy));
    Cell::new(to.x.min(map.width() - 1), to.y.min(map.height() - 1))
}

/// Marks after a press at `from` that was let go at `to`: moved, taken away or put.
fn moved(marks: &[Cell], from: Cell, to: Cell) -> Vec<Cell> {
    let mut marks = marks.to_vec();
    match marks.iter().position(|m| *m == from) {
        Some(i) if from == to => {
            marks.remove(i);
        }
        Some(i) => marks[i] = to,
        None => marks.push(to),
    }
    marks
}

/// Cells on a straight line, each beside the one before.
fn line(from: Cell, to: Cell) -> Vec<Cell> {
    let (dx, dy) = (to.x as isize - from.x as isize, to.y as isize - from.y as isize);
    let n = dx.abs().max(dy.abs()).max(1);
    let along = |from: usize, d: isize, i: isize| from.saturating_add_signed((2 * d * i + d.signum() * n) / (2 * n));
    (0..=n).map(|i| Cell::new(along(from.x, dx, i), along(from.y, dy, i))).collect()
}

/// Cells around a rectangle.
fn rectangle(a: Cell, b: Cell) -> Vec<Cell> {
    let corners = [a, Cell::new(b.x, a.y), b, Cell::new(a.x, b.y)];
    (0..4).flat_map(|i| line(corners[i], corners[(i + 1) % 4])).collect()
}

/// The cells of the same kind that hang together with `from` by their sides.
fn area(map: &Grid, from: Cell) -> Vec<Cell> {
    let free = map.is_free(from);
    let mut seen = vec![false; map.free().len()];
    seen[map.index(from)] = true;
    let mut all = vec![from];
    let mut done = 0;
    while let Some(at) = all.get(done).copied() {
        done += 1;
        for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let next = Cell::new(at.x.wrapping_add_signed(dx), at.y.wrapping_add_signed(dy));
            let inside = next.x < map.width() && next.y < map.height();
            if inside && map.is_free(next) == free && !std::mem::replace(&mut seen[map.index(next)], true) {
                all.push(next);
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{parse_map, print_ascii};

    const ROOM: &str = "S....\n.....\n..#..\n....G\n";

    fn drawn(tool: Tool, cells: [(usize, usize); 2]) -> String {
        let map = Arc::new(parse_map("room", ROOM.as_bytes()).expect("a map"));
        let mut editor = Editor { tool, ..Editor::default() };
        let mut now = map.clone();
        for (x, y) in cells {
            editor.cursor = Some(Cell::new(x, y));
            now = editor.apply(&now).unwrap_or(now);
        }
        print_ascii(&now)
    }

    #[test]
    fn every_tool_draws_by_keyboard() {
        assert_eq!(drawn(Tool::Pencil, [(1, 1), (2, 2)]), "S....\n.#...\n.....\n....G\n", "and turns walls to floor");
        assert_eq!(drawn(Tool::Eraser, [(2, 2), (0, 1)]), "S....\n.....\n.....\n....G\n");
        assert_eq!(drawn(Tool::Line, [(1, 0), (4, 3)]), "S#...\n..#..\n..##.\n....#\n");
        assert_eq!(drawn(Tool::Rectangle, [(1, 1), (3, 3)]), "S....\n.###.\n.###.\n.###G\n");
        let floor = "S....\n.....\n.....\n....G\n";
        assert_eq!(drawn(Tool::Fill, [(2, 2), (2, 2)]), floor, "the wall is filled, but no map is without floor");
        assert_eq!(drawn(Tool::Start, [(0, 0), (2, 1)]), ".....\n..S..\n..#..\n....G\n");
        assert_eq!(drawn(Tool::Goal, [(4, 3), (2, 2)]), "S....\n.....\n..#..\n.....\n", "walls hold no goal");
    }

    #[test]
    fn undo_and_redo_lead_back_and_forth_without_limit() {
        let first = Arc::new(parse_map("room", ROOM.as_bytes()).expect("a map"));
        let mut editor = Editor::default();
        let mut now = first.clone();
        for i in 0..15 {
            editor.cursor = Some(Cell::new(i % 5, 1 + i / 5));
            now = editor.apply(&now).expect("another map");
        }
        let last = now.clone();
        while let Some(before) = editor.undo(&now) {
            now = before;
        }
        assert_eq!(now, first);
        while let Some(after) = editor.redo(&now) {
            now = after;
        }
        assert_eq!(now, last);
    }
}
