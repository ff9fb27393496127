//! Random maps, and random starts. Maps are places on a square lattice, joined by a random spanning tree and, in some kinds,
//! extra passages.

use std::collections::HashSet;

use pathfinding::undirected::kruskal::kruskal_indices;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::components::Components;
use super::grid::{Cell, Grid};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RandomMapKind {
    /// 9 x 9 rooms of 4 x 4 cells, separated by walls one cell thick; besides those of the spanning
    /// tree, a tenth of the walls are open.
    Maze,
    /// Streets 3 cells wide between 14 x 14 blocks of 4 x 4 cells; about a third of the streets are
    /// closed.
    City,
    /// A perfect maze: corridors and walls one cell wide and exactly one path between any two
    /// cells.
    Perfect,
}

/// The smallest and the largest side of a random map, in cells.
pub const RANDOM_SIZES: std::ops::RangeInclusive<usize> = 5..=4096;

/// Dimensions of a kind of map.
struct Lattice {
    /// Cells along each axis unless another size is wanted.
    side: usize,
    /// Cells of wall before the first place and after the last one.
    border: usize,
    /// Cells per place along each axis.
    place: usize,
    /// Cells between two places.
    gap: usize,
    /// Probability of joining two neighbours that the tree does not join.
    extra: f32,
}

impl RandomMapKind {
    pub const ALL: [Self; 3] = [Self::Maze, Self::City, Self::Perfect];

    /// Returns a short description.
    pub fn about(self) -> &'static str {
        match self {
            Self::Maze => "rooms of 4 x 4 cells, most walls between them closed",
            Self::City => "streets 3 cells wide between blocks of 4 x 4 cells",
            Self::Perfect => "corridors one cell wide, one path between any two cells",
        }
    }

    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Maze => "maze",
            Self::City => "city",
            Self::Perfect => "perfect",
        }
    }

    fn lattice(self) -> Lattice {
        match self {
            Self::Maze => Lattice { side: 44, border: 0, place: 4, gap: 1, extra: 0.1 },
            // The tree uses a little more than half of all streets.
            Self::City => Lattice { side: 101, border: 0, place: 3, gap: 4, extra: 0.3 },
            Self::Perfect => Lattice { side: 33, border: 1, place: 1, gap: 1, extra: 0.0 },
        }
    }
}

/// Generates the map of `kind` for `seed`, `size` cells wide and high (by default 44, 101 or 33);
/// what remains beyond the last whole place is wall. All of its free cells are connected.
pub fn random(kind: RandomMapKind, size: Option<usize>, seed: u64) -> Grid {
    let Lattice { side, border, place, gap, extra } = kind.lattice();
    let side = size.unwrap_or(side);
    let pitch = place + gap;
    let places = ((side + gap).saturating_sub(2 * border) / pitch).max(1);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let joined = match kind {
        RandomMapKind::Maze | RandomMapKind::City => spanning_tree(places, extra, &mut rng),
        RandomMapKind::Perfect => depth_first_tree(places, &mut rng),
    };

    let side = side.max(2 * border + places * pitch - gap);
    let mut free = vec![false; side * side];
    let mut clear = |x: usize, y: usize, width: usize, height: usize| {
        (y..y + height).for_each(|y| free[y * side + x..y * side + x + width].fill(true));
    };
    let corner = |i: usize| (border + i % places * pitch, border + i / places * pitch);
    for i in 0..places * places {
        let (x, y) = corner(i);
        clear(x, y, place, place);
    }
    for (a, b) in joined {
        let (x, y) = corner(a);
        if b == a + 1 { clear(x + place, y, gap, place) } else { clear(x, y + place, place, gap) }
    }
    Grid::new(&format!("{}-{seed}", kind.name()), side, free, Vec::new(), Vec::new())
}

/// Joins `places` x `places` places by a minimum spanning tree of random weights and, with
/// probability `extra` each, the other pairs of neighbours. Returns the joined pairs, the left or
/// upper place first.
fn spanning_tree(places: usize, extra: f32, rng: &mut ChaCha8Rng) -> Vec<(usize, usize)> {
    let right = (0..places * places).filter(|i| i % places + 1 < places).map(|i| (i, i + 1));
    let down = (0..places * (places - 1)).map(|i| (i, i + places));
    let ways: Vec<(usize, usize, u32)> =
        right.chain(down).map(|(a, b)| (a, b, rng.random())).collect();
    let mut joined: Vec<(usize, usize)> =
        kruskal_indices(places * places, &ways).map(|(a, b, _)| (a, b)).collect();
    let tree: HashSet<(usize, usize)> = joined.iter().copied().collect();
    let others = ways.iter().map(|(a, b, _)| (*a, *b)).filter(|way| !tree.contains(way));
    joined.extend(others.filter(|_| rng.random::<f32>() < extra));
    joined
}

/// Joins `places` x `places` places by a random depth-first search ("recursive backtracker"), which
/// makes long winding corridors. Returns the joined pairs like [`spanning_tree`].
fn depth_first_tree(places: usize, rng: &mut ChaCha8Rng) -> Vec<(usize, usize)> {
    let mut seen = vec![false; places * places];
    let mut path = vec![rng.random_range(0..places * places)];
    seen[path[0]] = true;
    let mut joined = Vec::new();
    while let Some(&at) = path.last() {
        let (x, y) = (at % places, at / places);
        let neighbours = [
            (x > 0, at.wrapping_sub(1)),
            (x + 1 < places, at + 1),
            (y > 0, at.wrapping_sub(places)),
            (y + 1 < places, at + places),
        ];
        let unseen: Vec<usize> =
            neighbours.iter().filter(|(exists, i)| *exists && !seen[*i]).map(|(_, i)| *i).collect();
        if unseen.is_empty() {
            path.pop();
            continue;
        }
        let next = unseen[rng.random_range(0..unseen.len())];
        seen[next] = true;
        joined.push((at.min(next), at.max(next)));
        path.push(next);
    }
    joined
}

/// Returns the map itself if it has a start, else with a start at a cell of its largest component,
/// drawn by `seed`.
#[must_use]
pub fn with_start(grid: Grid, seed: u64) -> Grid {
    if !grid.starts().is_empty() {
        return grid;
    }
    let components = Components::of(&grid);
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
