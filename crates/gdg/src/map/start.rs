//! One start for maps without any.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::distance::StepSearch;
use super::grid::{Cell, Grid};

/// Returns the map itself if it has a start, else with a start at a cell of its largest component,
/// drawn by `seed`.
#[must_use]
pub fn with_start(grid: Grid, seed: u64) -> Grid {
    if !grid.starts().is_empty() {
        return grid;
    }
    let components = StepSearch::new(&grid).components(&grid);
    let cells: Vec<Cell> = components.largest_cells(&grid).collect();
    let start = cells[ChaCha8Rng::seed_from_u64(seed).random_range(0..cells.len())];
    grid.with_marks(vec![start], grid.goals().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    #[test]
    fn starts_are_kept_or_drawn_from_the_largest_component() {
        let map = |text: &str| parse_map("map", text.as_bytes()).expect("a map");
        let marked = map("..S\n##.\n");
        assert_eq!(with_start(marked.clone(), 7), marked);
        let two = map("..#.G.\n..#...\n");
        let starts: Vec<Cell> =
            (0..50).map(|seed| with_start(two.clone(), seed).starts()[0]).collect();
        assert!(starts.iter().all(|start| start.x > 2), "{starts:?}");
        assert!((3..6).all(|x| starts.iter().any(|start| start.x == x)), "{starts:?}");
        assert_eq!(with_start(two.clone(), 3), with_start(two.clone(), 3));
        assert_eq!(with_start(two.clone(), 3).goals(), two.goals());
    }
}
