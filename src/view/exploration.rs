//! What the agents have explored: where they have been, and the edge of the known world.

use std::sync::Arc;
use std::time::Instant;

use super::Worker;
use crate::map::{Cell, Grid};
use crate::train::Snapshot;

/// What the agents know of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Knowledge {
    /// Visited; or never to be visited, as a wall or out of reach.
    #[default]
    Known,
    /// Visited, with an unvisited cell one step away.
    Edge,
    /// Within reach, but not visited yet.
    Unvisited,
}

/// What the agents know of each cell. Empty if they have explored everything within reach.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exploration {
    /// Columns and rows of the map.
    size: (usize, usize),
    /// By cell, row by row.
    cells: Vec<Knowledge>,
}

impl Exploration {
    /// Derives it from the number of visits of each cell of `map`. Before the first visit, it is empty.
    pub fn new(map: &Grid, visits: &[u32]) -> Self {
        let unvisited = |cell: Cell| visits.get(map.index(cell)) == Some(&0);
        let mut edge: Vec<Cell> = map.free_cells().filter(|c| !unvisited(*c)).collect();
        edge.retain(|cell| map.neighbours(*cell).any(unvisited));
        if edge.is_empty() {
            return Self::default();
        }
        let mut cells = vec![Knowledge::Known; map.free().len()];
        edge.iter().for_each(|cell| cells[map.index(*cell)] = Knowledge::Edge);
        // All unvisited cells within reach are reached from the edge.
        while let Some(cell) = edge.pop() {
            for next in map.neighbours(cell).filter(|next| unvisited(*next)) {
                let known = &mut cells[map.index(next)];
                if *known != Knowledge::Unvisited {
                    *known = Knowledge::Unvisited;
                    edge.push(next);
                }
            }
        }
        Self { size: (map.width(), map.height()), cells }
    }

    /// Whether there is nothing left to explore within reach on `map`, or the map has another size.
    pub fn is_complete(&self, map: &Grid) -> bool {
        self.size != (map.width(), map.height())
    }

    /// Returns what is known at a position.
    pub fn at(&self, [x, y]: [f32; 2]) -> Knowledge {
        let (x, y) = (x as usize, y as usize);
        if x >= self.size.0 {
            return Knowledge::Known;
        }
        self.cells.get(y * self.size.0 + x).copied().unwrap_or_default()
    }
}

impl Worker {
    /// Derives what has been explored from the visits in `snapshot`, if they are new.
    pub(super) fn refresh_exploration(&mut self, snapshot: &Snapshot, pause_factor: u32) {
        let visits = snapshot.scene.maze().visits;
        if Arc::ptr_eq(&visits, &self.visits) || !self.exploration_timer.is_due(pause_factor) {
            return;
        }
        let began = Instant::now();
        let exploration = Exploration::new(self.world.map(), &visits);
        self.visits = visits;
        // While nothing changes, the screen reuses what it has drawn.
        if exploration != *self.view.exploration {
            self.view.exploration = Arc::new(exploration);
            self.changed = true;
        }
        self.exploration_timer.done(began);
    }
}

#[cfg(test)]
mod tests {
    use super::Knowledge::{Edge, Known, Unvisited};
    use super::*;
    use crate::map::parse_ascii;

    /// Returns what is known of each row's cells; `visited` marks visited cells with `x`.
    fn explored(map: &str, visited: &str) -> Vec<Vec<Knowledge>> {
        let map = parse_ascii("map", map).expect("a map");
        let visits: Vec<u32> = visited.lines().flat_map(str::chars).map(|c| 3 * u32::from(c == 'x')).collect();
        let exploration = Exploration::new(&map, &visits);
        let row = |y: usize| (0..map.width()).map(|x| exploration.at(Cell::new(x, y).centre())).collect();
        (0..map.height()).map(row).collect()
    }

    #[test]
    fn the_edge_is_next_to_unvisited_cells_within_reach() {
        let found = explored(".....\n..#..\n", "xx...\nxx#..\n");
        assert_eq!(
            found,
            [[Known, Edge, Unvisited, Unvisited, Unvisited], [Known, Known, Known, Unvisited, Unvisited]]
        );
    }

    #[test]
    fn cells_behind_walls_and_corners_are_out_of_reach() {
        // No step leads diagonally between walls, so the right part is another component.
        let found = explored("..#.\n..#.\n...#\n", "xx#.\nxx#.\nxx.#\n");
        assert_eq!(found[2], [Known, Edge, Unvisited, Known]);
        assert!(found[..2].iter().all(|row| row[2..] == [Known, Known]), "{found:?}");
        assert_eq!(found[1][1], Known, "a wall is beside it");
    }

    #[test]
    fn nothing_is_left_once_everything_within_reach_is_visited_or_before_the_first_visit() {
        let map = parse_ascii("map", "..#.\n").expect("a map");
        for visits in [[1, 2, 0, 0], [0; 4]] {
            assert!(Exploration::new(&map, &visits).is_complete(&map), "{visits:?}");
        }
        assert!(!Exploration::new(&map, &[1, 0, 0, 0]).is_complete(&map));
        assert!(Exploration::new(&map, &[1, 0, 0, 0]).is_complete(&Grid::empty("other", 5, 1)));
    }
}
