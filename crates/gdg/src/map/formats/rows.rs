//! A map as it is read, row by row.

use super::super::error::{MapError, MapResult};
use super::super::grid::{Cell, Grid, MAX_CELLS, MAX_SIDE, is_size};
use super::super::text::{Place, Text};
use super::plain::too_large;
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

/// The rows read so far, all of the first one's length.
pub struct Rows<'a> {
    text: &'a Text<'a>,
    /// Cells of the first row, once it has ended.
    width: Option<usize>,
    /// Index of the first cell of the row that is being read.
    row: usize,
    free: Vec<bool>,
    starts: Vec<usize>,
    goals: Vec<usize>,
}

impl<'a> Rows<'a> {
    /// Begins a map; errors show places in `text`.
    pub fn new(text: &'a Text<'a>) -> Self {
        Self { text, width: None, row: 0, free: Vec::new(), starts: Vec::new(), goals: Vec::new() }
    }

    /// Adds a cell to the row.
    ///
    /// # Errors
    /// The map is too large.
    pub fn push(&mut self, mark: Mark) -> MapResult<()> {
        let at = self.free.len();
        self.free.push(mark != Mark::Wall);
        if matches!(mark, Mark::Start | Mark::Both) {
            self.starts.push(at);
        }
        if matches!(mark, Mark::Goal | Mark::Both) {
            self.goals.push(at);
        }
        let width = self.free.len() - self.row;
        if width > MAX_SIDE || self.free.len() > MAX_CELLS {
            let height = self.width.map_or(1, |width| self.free.len().div_ceil(width));
            return Err(too_large(self.text, self.width.unwrap_or(width), height));
        }
        Ok(())
    }

    /// Returns whether the row has no cells yet.
    pub fn is_row_empty(&self) -> bool {
        self.row == self.free.len()
    }

    /// Ends the row, which began at `from`.
    ///
    /// # Errors
    /// It is empty or has another length than the first one.
    pub fn end_row(&mut self, from: Place) -> MapResult<()> {
        let length = self.free.len() - self.row;
        let width = *self.width.get_or_insert(length);
        let help = "all rows must have the same number of cells";
        if length == 0 {
            return Err(self.text.error_at(from, "this row has no cells", help));
        }
        if length != width {
            let problem = format!(
                "this row has {}, the first row has {width}",
                counted(length as u64, "cell")
            );
            return Err(self.text.error_at(from, problem, help));
        }
        self.row = self.free.len();
        Ok(())
    }

    /// Returns the map; `cells` says how its cells are written.
    ///
    /// # Errors
    /// It has no free cell, or is too large.
    pub fn finish(self, name: &str, cells: &str) -> MapResult<Grid> {
        if !self.free.contains(&true) {
            return Err(MapError::whole_file(self.text.file, "the map has no free cell", cells));
        }
        let width = self.width.unwrap_or(self.free.len());
        let height = self.free.len() / width;
        if !is_size(width, height) {
            return Err(too_large(self.text, width, height));
        }
        let cells = |at: Vec<usize>| at.iter().map(|i| Cell::new(i % width, i / width)).collect();
        Ok(Grid::new(name, width, self.free, cells(self.starts), cells(self.goals)))
    }
}
