//! Editing the map: tools for mouse and keyboard, undo and redo.

use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::Arc;

use ratatui::layout::Position;

use crate::tui::choices::Tool;
use crate::tui::viewport::MapFrame;
use gdg::map::{Cell, Grid};

/// The most cells of all maps together that are kept to undo edits. Beyond it the oldest are dropped.
const MAX_CELLS: usize = 256 << 20;

/// The editor's state. Strokes exist only while it is open; undo and redo outlast closing it.
#[derive(Clone, Default)]
pub struct Editor {
    /// Where the keyboard draws; `None` while the editor is closed.
    pub cursor: Option<Cell>,
    pub tool: Tool,
    stroke: Option<Stroke>,
    /// The map before the first edit, and after each; those after `shown` have been undone.
    history: Vec<Arc<Grid>>,
    shown: usize,
}

/// An unfinished stroke: until the button is released, or the second key press.
#[derive(Clone)]
struct Stroke {
    free: bool,
    /// Cells drawn freehand, each once.
    cells: Vec<Cell>,
    known: HashSet<Cell>,
    from: Cell,
    to: Cell,
    /// The last position of the mouse; `None` for a stroke by keyboard.
    at: Option<Position>,
}

impl Stroke {
    fn at(cell: Cell, free: bool) -> Self {
        Self { free, cells: Vec::new(), known: HashSet::new(), from: cell, to: cell, at: None }
    }

    fn add(&mut self, cells: impl IntoIterator<Item = Cell>) {
        let known = &mut self.known;
        self.cells.extend(cells.into_iter().filter(|cell| known.insert(*cell)));
    }
}

impl Editor {
    /// Returns an editor that looks the same, without edits to undo.
    pub fn shown(&self) -> Self {
        Self { history: Vec::new(), shown: 0, ..self.clone() }
    }

    pub fn is_open(&self) -> bool {
        self.cursor.is_some()
    }

    pub fn select_tool(&mut self, tool: Tool) {
        (self.tool, self.stroke) = (tool, None);
    }

    pub fn close(&mut self) {
        (self.cursor, self.stroke) = (None, None);
    }

    /// Forgets all edits, because the map was replaced.
    pub fn clear_history(&mut self) {
        *self = Self { tool: self.tool, ..Self::default() };
    }

    /// Returns the cells that the unfinished stroke would change, and whether they become free.
    pub fn preview(&self) -> Option<(Cow<'_, [Cell]>, bool)> {
        self.stroke.as_ref().map(|stroke| (self.cells_of(stroke), stroke.free))
    }

    /// Returns where an unfinished line or box begins.
    pub fn first_end(&self) -> Option<Cell> {
        let has_ends = matches!(self.tool, Tool::Line | Tool::Rectangle);
        self.stroke.as_ref().filter(|_| has_ends).map(|stroke| stroke.from)
    }

    pub fn is_drawing(&self) -> bool {
        self.stroke.is_some()
    }

    fn cells_of<'a>(&self, stroke: &'a Stroke) -> Cow<'a, [Cell]> {
        match self.tool {
            Tool::Pencil | Tool::Eraser => Cow::Borrowed(&stroke.cells),
            Tool::Line => line(stroke.from, stroke.to).into(),
            Tool::Rectangle => rectangle(stroke.from, stroke.to).into(),
            Tool::Fill | Tool::Start | Tool::Goal => Cow::Borrowed(&[]),
        }
    }

    /// Handles a button press or drag at a screen position; the second button draws floor.
    pub fn draw(&mut self, to: Position, second: bool, frame: &MapFrame, map: &Grid) {
        let Some(cell) = frame.cell_at(to, map) else { return };
        let free = second || self.tool == Tool::Eraser;
        let stroke = self.stroke.get_or_insert_with(|| Stroke::at(cell, free));
        let from = stroke.at.replace(to).unwrap_or(to);
        stroke.to = cell;
        if !matches!(self.tool, Tool::Pencil | Tool::Eraser) {
            return;
        }
        let along = |from: u16, to: u16, i: i32, n: i32| {
            (i32::from(from) + (i32::from(to) - i32::from(from)) * i / n) as u16
        };
        let n = i32::from(from.x.abs_diff(to.x).max(from.y.abs_diff(to.y))).max(1);
        for i in 0..=n {
            let at = Position::new(along(from.x, to.x, i, n), along(from.y, to.y, i, n));
            stroke.add(frame.cells_at(at, map));
        }
    }

    /// Handles a button release; returns the new map if anything changed.
    pub fn finish(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        // A line started by keyboard waits for its second key press.
        let stroke = self.stroke.take_if(|stroke| stroke.at.is_some())?;
        self.change(map, &stroke)
    }

    /// Uses the tool at the cursor; returns the new map if anything changed.
    pub fn apply(&mut self, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let cell = self.cursor?;
        if matches!(self.tool, Tool::Line | Tool::Rectangle) {
            if let Some(mut stroke) = self.stroke.take() {
                stroke.to = cell;
                return self.change(map, &stroke);
            }
            self.stroke = Some(Stroke::at(cell, false));
            return None;
        }
        let free = self.tool == Tool::Eraser || !map.is_free(cell);
        self.change(map, &Stroke { cells: vec![cell], ..Stroke::at(cell, free) })
    }

    /// Moves the cursor by a cell; an unfinished line follows it.
    pub fn move_cursor(&mut self, [dx, dy]: [isize; 2], map: &Grid) {
        let Some(at) = self.cursor else { return };
        let to = offset_cell(at, [dx, dy], map);
        self.cursor = Some(to);
        if let Some(stroke) = &mut self.stroke {
            stroke.to = to;
        }
    }

    fn change(&mut self, map: &Arc<Grid>, stroke: &Stroke) -> Option<Arc<Grid>> {
        let (from, to) = (stroke.from, stroke.to);
        let new = match self.tool {
            Tool::Fill => {
                map.with_cells(area(map, to).into_iter().map(|cell| (cell, !map.is_free(to))))
            }
            // A cell has at most one mark, as map files have one character per cell.
            Tool::Start => {
                let starts = with_mark_moved(map.starts(), from, to);
                let goals = without(map.goals(), &starts);
                Some(map.with_marks(starts, goals))
            }
            Tool::Goal => {
                let goals = with_mark_moved(map.goals(), from, to);
                Some(map.with_marks(without(map.starts(), &goals), goals))
            }
            _ => map.with_cells(self.cells_of(stroke).iter().map(|cell| (*cell, stroke.free))),
        };
        new.filter(|new| *new != **map).map(Arc::new)
    }

    pub fn undo(&self) -> Option<Arc<Grid>> {
        self.history.get(self.shown.checked_sub(1)?).cloned()
    }

    pub fn redo(&self) -> Option<Arc<Grid>> {
        self.history.get(self.shown + 1).cloned()
    }

    /// Takes note that `map` has replaced `before`. The oldest edits go if maps take much memory.
    pub fn settle(&mut self, before: &Arc<Grid>, map: &Arc<Grid>) {
        if let Some(known) = self.history.iter().position(|own| Arc::ptr_eq(own, map)) {
            self.shown = known;
            return;
        }
        self.history.truncate(self.shown + 1);
        if self.history.is_empty() {
            self.history.push(before.clone());
        }
        self.history.push(map.clone());
        let most = (MAX_CELLS / map.free().len()).max(2);
        self.history.drain(..self.history.len().saturating_sub(most));
        self.shown = self.history.len() - 1;
    }
}

/// Returns the cell `dx` columns and `dy` rows from `at`, clamped to the map.
pub fn offset_cell(at: Cell, [dx, dy]: [isize; 2], map: &Grid) -> Cell {
    let to = Cell::new(at.x.saturating_add_signed(dx), at.y.saturating_add_signed(dy));
    Cell::new(to.x.min(map.width() - 1), to.y.min(map.height() - 1))
}

fn without(marks: &[Cell], others: &[Cell]) -> Vec<Cell> {
    let others: HashSet<&Cell> = others.iter().collect();
    marks.iter().filter(|mark| !others.contains(mark)).copied().collect()
}

/// Returns the marks after a press at `from` and a release at `to`: one is moved, removed or added.
fn with_mark_moved(marks: &[Cell], from: Cell, to: Cell) -> Vec<Cell> {
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

/// Returns the cells on a straight line, each adjacent to the one before.
fn line(from: Cell, to: Cell) -> Vec<Cell> {
    let (dx, dy) = (to.x as isize - from.x as isize, to.y as isize - from.y as isize);
    let n = dx.abs().max(dy.abs()).max(1);
    let along = |from: usize, d: isize, i: isize| {
        from.saturating_add_signed((2 * d * i + d.signum() * n) / (2 * n))
    };
    (0..=n).map(|i| Cell::new(along(from.x, dx, i), along(from.y, dy, i))).collect()
}

fn rectangle(a: Cell, b: Cell) -> Vec<Cell> {
    let corners = [a, Cell::new(b.x, a.y), b, Cell::new(a.x, b.y)];
    (0..4).flat_map(|i| line(corners[i], corners[(i + 1) % 4])).collect()
}

/// Returns the cells of the same kind that are connected to `from` by their sides.
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
            if map.contains(next)
                && map.is_free(next) == free
                && !std::mem::replace(&mut seen[map.index(next)], true)
            {
                all.push(next);
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::map::{parse_map, print_ascii};

    const ROOM: &str = "S....\n.....\n..#..\n....G\n";

    fn drawn(tool: Tool, cells: [(usize, usize); 2]) -> String {
        let map = Arc::new(parse_map("room", ROOM.as_bytes()).expect("a map"));
        let mut editor = Editor { tool, ..Editor::default() };
        let mut now = map.clone();
        for (x, y) in cells {
            editor.cursor = Some(Cell::new(x, y));
            if let Some(new) = editor.apply(&now) {
                editor.settle(&now, &new);
                now = new;
            }
        }
        print_ascii(&now)
    }

    #[test]
    fn every_tool_draws_by_keyboard() {
        assert_eq!(
            drawn(Tool::Pencil, [(1, 1), (2, 2)]),
            "S....\n.#...\n.....\n....G\n",
            "and turns walls to floor"
        );
        assert_eq!(drawn(Tool::Eraser, [(2, 2), (0, 1)]), "S....\n.....\n.....\n....G\n");
        assert_eq!(drawn(Tool::Line, [(1, 0), (4, 3)]), "S#...\n..#..\n..##.\n....#\n");
        assert_eq!(drawn(Tool::Rectangle, [(1, 1), (3, 3)]), "S....\n.###.\n.###.\n.###G\n");
        let floor = "S....\n.....\n.....\n....G\n";
        assert_eq!(drawn(Tool::Fill, [(2, 2), (2, 2)]), floor, "no map is without floor");
        assert_eq!(drawn(Tool::Start, [(0, 0), (2, 1)]), ".....\n..S..\n..#..\n....G\n");
        // Walls hold no goal.
        assert_eq!(drawn(Tool::Goal, [(4, 3), (2, 2)]), "S....\n.....\n..#..\n.....\n");
    }

    #[test]
    fn a_stroke_over_millions_of_cells_has_each_once() {
        let map = Grid::empty("large", 2048, 1024);
        let mut stroke = Stroke::at(Cell::new(0, 0), false);
        // Like a mouse that moves back and forth: quadratic work would take hours.
        (0..4).for_each(|_| stroke.add(map.free_cells()));
        assert_eq!(stroke.cells.len(), 2048 * 1024);
        assert!(stroke.cells.iter().copied().eq(map.free_cells()));
    }

    #[test]
    fn edits_can_be_undone_and_redone() {
        let map = |width| Arc::new(Grid::empty("map", width, 2));
        let (mut editor, mut now) = (Editor::default(), map(1));
        for width in [2, 3, 4] {
            let new = map(width);
            editor.settle(&now, &new);
            now = new;
        }
        let mut undo = |editor: &mut Editor| {
            let before = editor.undo().expect("an edit");
            editor.settle(&now, &before);
            now = before.clone();
            before.width()
        };
        assert_eq!([undo(&mut editor), undo(&mut editor)], [3, 2]);
        let after = editor.redo().expect("an edit");
        assert_eq!(after.width(), 3);
        editor.settle(&now, &after);
        // Another edit takes the place of those that were undone.
        editor.settle(&after, &map(64));
        assert!(editor.redo().is_none() && editor.history.len() == 4);
    }
}
