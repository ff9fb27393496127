//! A map as it is read, row by row.

use super::super::grid::{Cell, Grid, MAX_CELLS, MAX_SIDE, is_size, size_limits};
use super::super::text::{MapError, MapResult};
use super::super::text::{Place, Text};
use crate::text::counted;

/// What a cell is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Wall,
    Free,
    Start,
    Goal,
    /// Start and goal.
    Both,
}

/// Returns the map of these cells, row by row; `None` if none is free.
pub fn grid(name: &str, width: usize, marks: &[Mark]) -> Option<Grid> {
    let free: Vec<bool> = marks.iter().map(|mark| *mark != Mark::Wall).collect();
    let cells = |which: Mark| {
        let is = |mark: &Mark| *mark == which || *mark == Mark::Both;
        let at = marks.iter().enumerate().filter(|(_, mark)| is(mark));
        at.map(|(i, _)| Cell::new(i % width, i / width)).collect()
    };
    free.contains(&true)
        .then(|| Grid::new(name, width, free, cells(Mark::Start), cells(Mark::Goal)))
}

/// Creates the error for a map that is too large.
pub fn too_large(text: &Text, width: usize, height: usize) -> Box<MapError> {
    text.line_error(0, format!("a map of {width} x {height} cells is too large"), size_limits())
}

/// The rows read so far, all of the first one's length.
pub struct Rows<'a> {
    text: &'a Text<'a>,
    /// Cells of the first row, once it has ended.
    width: Option<usize>,
    /// Index of the first cell of the row that is being read.
    row: usize,
    marks: Vec<Mark>,
}

impl<'a> Rows<'a> {
    /// Begins a map; errors show places in `text`.
    pub fn new(text: &'a Text<'a>) -> Self {
        Self { text, width: None, row: 0, marks: Vec::new() }
    }

    /// Adds a cell to the row.
    ///
    /// # Errors
    /// The map is too large.
    pub fn push(&mut self, mark: Mark) -> MapResult<()> {
        self.marks.push(mark);
        let width = self.marks.len() - self.row;
        if width > MAX_SIDE || self.marks.len() > MAX_CELLS {
            let height = self.width.map_or(1, |width| self.marks.len().div_ceil(width));
            return Err(too_large(self.text, self.width.unwrap_or(width), height));
        }
        Ok(())
    }

    /// Returns whether the row has no cells yet.
    pub fn is_row_empty(&self) -> bool {
        self.row == self.marks.len()
    }

    /// Ends the row, which began at `from`.
    ///
    /// # Errors
    /// It is empty or has another length than the first one.
    pub fn end_row(&mut self, from: Place) -> MapResult<()> {
        let length = self.marks.len() - self.row;
        let width = *self.width.get_or_insert(length);
        let help = "all rows must have the same number of cells";
        if length == 0 {
            return Err(self.text.error_at(from, "this row has no cells", help));
        }
        if length != width {
            let cells = counted(length as u64, "cell");
            let problem = format!("this row has {cells}, the first row has {width}");
            return Err(self.text.error_at(from, problem, help));
        }
        self.row = self.marks.len();
        Ok(())
    }

    /// Returns the map; `cells` says how its cells are written.
    ///
    /// # Errors
    /// It has no free cell, or is too large.
    pub fn finish(self, name: &str, cells: &str) -> MapResult<Grid> {
        let width = self.width.unwrap_or(1);
        let height = self.marks.len() / width;
        if height > 0 && !is_size(width, height) {
            return Err(too_large(self.text, width, height));
        }
        let problem = if height == 0 { "the map has no rows" } else { "the map has no free cell" };
        let none = || MapError::whole_file(self.text.file, problem, cells);
        grid(name, width, &self.marks).ok_or_else(none)
    }
}
