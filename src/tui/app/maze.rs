//! What the guided tour and comparisons do in a maze.

use super::App;
use crate::tui::scene::maze;
use gdg::map::Cell;

impl App {
    /// Puts the goal at `cell`, or at the free cell nearest to it.
    pub fn set_goal(&mut self, cell: Cell) {
        self.in_maze(|maze, screen, link| maze.set_goal(cell, screen, link));
    }

    /// Puts the walking agent at a cell, or at a random place.
    pub fn place_walker(&mut self, cell: Option<Cell>) {
        self.in_maze(|_, screen, link| maze::place_walker(cell, screen, link));
    }
}
