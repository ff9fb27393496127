//! What the agents have explored: where they have been, and the edge of the known world.

use std::sync::Arc;
use std::time::Instant;

use super::MazeWorker;
use crate::map::{Cell, Grid};

/// Steps from any visited cell up to which unvisited cells do not count as beyond the known world:
/// agents skip many cells on their way, and outlining them all would hide the edge.
const POCKET_STEPS: usize = 2;

/// What the agents know of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Knowledge {
    /// Visited; or a wall.
    #[default]
    Known,
    /// Visited, and one step away from a cell beyond the known world.
    Edge,
    /// Not visited, but only a pocket in the known world.
    Pocket,
    /// Beyond the known world: not visited, and part of an area that reaches more than two steps
    /// from all visited cells, or out of their reach.
    Beyond,
}

/// What the agents know of each cell. Empty if they have explored everything.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exploration {
    size: (usize, usize),
    /// By cell, row by row.
    cells: Vec<Knowledge>,
}

impl Exploration {
    /// Derives it from the number of visits of each cell of `map`. Before the first visit, it is
    /// empty.
    pub fn new(map: &Grid, visits: &[u32]) -> Self {
        let unvisited = |cell: Cell| visits.get(map.index(cell)) == Some(&0);
        let visited_beside: Vec<Cell> = map
            .free_cells()
            .filter(|c| !unvisited(*c) && map.neighbours(*c).any(unvisited))
            .collect();
        let has_visited = map.free_cells().any(|cell| !unvisited(cell));
        if !has_visited || !map.free_cells().any(unvisited) {
            return Self::default();
        }
        let mut cells = vec![Knowledge::Known; map.free().len()];
        // All unvisited cells within reach, by their steps from the visited ones.
        let mut reached = visited_beside.clone();
        for steps in 1.. {
            let from = std::mem::take(&mut reached);
            let kind = if steps <= POCKET_STEPS { Knowledge::Pocket } else { Knowledge::Beyond };
            for next in
                from.iter().flat_map(|cell| map.neighbours(*cell)).filter(|next| unvisited(*next))
            {
                let own = &mut cells[map.index(next)];
                if *own == Knowledge::Known {
                    *own = kind;
                    reached.push(next);
                }
            }
            if reached.is_empty() {
                break;
            }
        }
        // What is left is out of reach: D is not learned there.
        for cell in map.free_cells().filter(|cell| unvisited(*cell)) {
            let own = &mut cells[map.index(cell)];
            if *own == Knowledge::Known {
                *own = Knowledge::Beyond;
            }
        }
        // Cells around those far from the visited ones belong to the same area.
        let mut beyond: Vec<Cell> =
            map.free_cells().filter(|c| cells[map.index(*c)] == Knowledge::Beyond).collect();
        for _ in 0..POCKET_STEPS {
            let from = std::mem::take(&mut beyond);
            for next in from.iter().flat_map(|cell| map.neighbours(*cell)) {
                let own = &mut cells[map.index(next)];
                if *own == Knowledge::Pocket {
                    *own = Knowledge::Beyond;
                    beyond.push(next);
                }
            }
        }
        for cell in visited_beside {
            if map.neighbours(cell).any(|next| cells[map.index(next)] == Knowledge::Beyond) {
                cells[map.index(cell)] = Knowledge::Edge;
            }
        }
        Self { size: (map.width(), map.height()), cells }
    }

    /// Whether there is nothing unexplored on `map`, or the map has another size.
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

impl MazeWorker {
    /// Derives what has been explored from the latest visits, if they are new.
    pub(super) fn refresh_exploration(&mut self, pause_factor: u32) {
        let visits = self.latest_visits.clone();
        if Arc::ptr_eq(&visits, &self.visits) || !self.exploration_timer.is_due(pause_factor) {
            return;
        }
        let began = Instant::now();
        let exploration = Exploration::new(self.world.map(), &visits);
        self.visits = visits;
        // While nothing changes, the screen reuses what it has drawn.
        if exploration != *self.view.exploration {
            self.view.exploration = Arc::new(exploration);
            self.shown.changed = true;
        }
        self.exploration_timer.done(began);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    fn map(rows: &[&str]) -> Grid {
        parse_map("map", rows.join("\n").as_bytes()).expect("a map")
    }

    /// Returns what is known of each cell, row by row: `x` visited, `e` edge, `p` pocket, `?`
    /// beyond. In `rows`, `x` marks visited cells.
    fn explored(rows: &[&str]) -> Vec<String> {
        let free: Vec<String> = rows.iter().map(|row| row.replace('x', ".")).collect();
        let map = map(&free.iter().map(String::as_str).collect::<Vec<_>>());
        let visits: Vec<u32> = rows.concat().chars().map(|c| 3 * u32::from(c == 'x')).collect();
        let exploration = Exploration::new(&map, &visits);
        let letter = |cell: Cell| match exploration.at(cell.centre()) {
            Knowledge::Known if map.is_free(cell) => 'x',
            Knowledge::Known => '#',
            Knowledge::Edge => 'e',
            Knowledge::Pocket => 'p',
            Knowledge::Beyond => '?',
        };
        (0..map.height())
            .map(|y| (0..map.width()).map(|x| letter(Cell::new(x, y))).collect())
            .collect()
    }

    #[test]
    fn the_edge_is_next_to_unvisited_areas_within_reach_that_are_no_pockets() {
        for (rows, expected) in [
            (&["xxx.....", "xx#....."][..], &["xxe?????", "xx#?????"][..]),
            // The corners beside a tip are pockets.
            (&["xx......", "xxxx....", "xx......"], &["xxpp????", "xxxe????", "xxpp????"]),
            (&["xx.xx", "x...x", "xx.xx"], &["xxpxx", "xpppx", "xxpxx"]),
            (&["xxx.."], &["xxxpp"]),
            (&["xxx..."], &["xxe???"]),
            // No step leads diagonally between walls.
            (&["xxx#....", "xxxx#...", "xxxxx#.."], &["xxx#????", "xxxx#???", "xxxxx#??"]),
        ] {
            assert_eq!(explored(rows), expected);
        }
    }

    #[test]
    fn nothing_is_left_once_everything_is_visited_or_before_the_first_visit() {
        let map = map(&["..#."]);
        for visits in [[1, 2, 0, 1], [0; 4]] {
            assert!(Exploration::new(&map, &visits).is_complete(&map), "{visits:?}");
        }
        assert!(!Exploration::new(&map, &[1, 0, 0, 0]).is_complete(&map));
        assert!(Exploration::new(&map, &[1, 0, 0, 0]).is_complete(&Grid::empty("other", 5, 1)));
    }
}
