//! The cells whose distances the film of a run shows: every cell of a small map, a sample of a
//! large one.

use super::tasks::longest;
use crate::env::{MAX_PROBES, Probes};
use crate::map::{Cell, Grid};

/// Square blocks of cells, row by row; one cell of each is filmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ProbeGrid {
    /// Cells along the side of a block.
    pub side: usize,
    pub columns: usize,
    pub rows: usize,
}

impl ProbeGrid {
    /// Returns the smallest blocks that divide `map` into at most [`MAX_PROBES`].
    pub fn new(map: &Grid) -> Self {
        let of_side = |side: usize| Self {
            side,
            columns: map.width().div_ceil(side),
            rows: map.height().div_ceil(side),
        };
        let mut grid = of_side(1);
        while grid.places() > MAX_PROBES {
            grid = of_side(grid.side + 1);
        }
        grid
    }

    pub fn places(&self) -> usize {
        self.columns * self.rows
    }

    /// Returns the filmed cell of block `place`: the free cell nearest to its centre; `None` if the
    /// block has no free cell.
    pub fn cell(&self, map: &Grid, place: usize) -> Option<Cell> {
        let first = Cell::new(place % self.columns * self.side, place / self.columns * self.side);
        let middle = Cell::new(first.x + self.side / 2, first.y + self.side / 2);
        let is_free = |cell: &Cell| map.is_free(*cell);
        if is_free(&middle) {
            return Some(middle);
        }
        let cells = (0..self.side * self.side)
            .map(|i| Cell::new(first.x + i % self.side, first.y + i / self.side));
        let off = |cell: &Cell| cell.x.abs_diff(middle.x).pow(2) + cell.y.abs_diff(middle.y).pow(2);
        cells.filter(is_free).min_by_key(off)
    }
}

/// Returns the probes of `map`. Their goal is the map's own; else that of the film so far, if it is
/// still free; else the cell farthest from the map's start.
pub fn points(map: &Grid, goal_before: Option<&[f32]>) -> Probes {
    let grid = ProbeGrid::new(map);
    let mut points = Probes {
        places: grid.places(),
        place_of: Vec::new(),
        states: Vec::new(),
        goal: goal(map, goal_before),
    };
    for place in 0..grid.places() {
        if let Some(cell) = grid.cell(map, place) {
            points.place_of.push(place as u32);
            points.states.extend(cell.centre());
        }
    }
    points
}

/// Returns the position of the film's goal.
fn goal(map: &Grid, before: Option<&[f32]>) -> Vec<f32> {
    let before = before.map(|at| Cell::new(at[0] as usize, at[1] as usize));
    let own = map.goals().first().copied();
    let free = own.into_iter().chain(before).find(|cell| map.is_free(*cell));
    free.map_or_else(|| longest(map).goal, |cell| cell.centre().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    fn map(text: &str) -> Grid {
        parse_map("map", text.as_bytes()).expect("a map")
    }

    #[test]
    fn every_cell_of_a_small_map_is_filmed_and_some_of_a_large_one() {
        let small = points(&map("S.#\n..G\n"), None);
        assert_eq!((small.places, small.place_of), (6, vec![0, 1, 3, 4, 5]));
        assert_eq!(small.states, [0.5, 0.5, 1.5, 0.5, 0.5, 1.5, 1.5, 1.5, 2.5, 1.5]);
        for (width, height) in [(36, 36), (37, 37), (2_600, 1), (1_500, 900)] {
            let grid = ProbeGrid::new(&Grid::empty("map", width, height));
            assert!(grid.places() <= MAX_PROBES && grid.columns * grid.side >= width, "{grid:?}");
            assert!(grid.side == 1 || 5 * grid.places() > MAX_PROBES, "too few: {grid:?}");
        }
    }

    #[test]
    fn of_a_block_the_free_cell_nearest_to_its_middle_is_filmed() {
        let grid = ProbeGrid { side: 3, columns: 2, rows: 1 };
        let map = map("######\n#.####\n.#####\n");
        assert_eq!([0, 1].map(|place| grid.cell(&map, place)), [Some(Cell::new(1, 1)), None]);
        let map = map.with_cells([(Cell::new(1, 1), false)]).expect("a map");
        assert_eq!(grid.cell(&map, 0), Some(Cell::new(0, 2)));
    }

    #[test]
    fn the_goal_is_the_maps_own_or_stays_or_is_far() {
        for (text, before, goal) in [
            ("S..G.\n", Some([1.5, 0.5]), [3.5, 0.5]),
            ("S....\n", Some([1.5, 0.5]), [1.5, 0.5]),
            ("S#...\n....#\n", Some([1.5, 0.5]), [4.5, 0.5]),
            ("....S\n", None, [0.5, 0.5]),
            ("S....\n", Some([1e9, -3.0]), [4.5, 0.5]),
        ] {
            let before = before.as_ref().map(|at: &[f32; 2]| &at[..]);
            assert_eq!(points(&map(text), before).goal, goal, "{text}");
        }
    }
}
