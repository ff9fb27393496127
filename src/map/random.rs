//! Random maps: places on a square lattice, joined by a random spanning tree and some extra passages.

use pathfinding::undirected::kruskal::kruskal_indices;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::grid::Grid;

/// The kind of a random map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RandomMapKind {
    /// 9 x 9 rooms of 4 x 4 cells, separated by walls one cell thick; besides those of the spanning tree, a tenth of
    /// the walls are open.
    Maze,
    /// Streets 3 cells wide between 14 x 14 blocks of 4 x 4 cells; about a third of the streets are closed.
    City,
}

/// Dimensions of a kind of map.
struct Lattice {
    /// Places along each axis.
    places: usize,
    /// Cells per place along each axis.
    place: usize,
    /// Cells between two places.
    gap: usize,
    /// Probability of joining two neighbours that the tree does not join.
    extra: f32,
}

impl RandomMapKind {
    /// Returns its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Maze => "maze",
            Self::City => "city",
        }
    }

    fn lattice(self) -> Lattice {
        match self {
            Self::Maze => Lattice { places: 9, place: 4, gap: 1, extra: 0.1 },
            // The tree uses a little more than half of all streets.
            Self::City => Lattice { places: 15, place: 3, gap: 4, extra: 0.3 },
        }
    }
}

/// Generates the map of `kind` for `seed`; all of its free cells are connected.
pub fn random(kind: RandomMapKind, seed: u64) -> Grid {
    let Lattice { places, place, gap, extra } = kind.lattice();
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let right = (0..places * places).filter(|i| i % places + 1 < places).map(|i| (i, i + 1));
    let down = (0..places * (places - 1)).map(|i| (i, i + places));
    let ways: Vec<(usize, usize, u32)> = right.chain(down).map(|(a, b)| (a, b, rng.random())).collect();
    let tree: Vec<(usize, usize)> = kruskal_indices(places * places, &ways).map(|(a, b, _)| (a, b)).collect();
    let others = ways.iter().map(|(a, b, _)| (*a, *b)).filter(|way| !tree.contains(way));
    let open: Vec<(usize, usize)> = others.filter(|_| rng.random::<f32>() < extra).collect();

    let pitch = place + gap;
    let side = places * pitch - gap;
    let mut free = vec![false; side * side];
    let mut clear = |x: usize, y: usize, width: usize, height: usize| {
        (y..y + height).for_each(|y| free[y * side + x..y * side + x + width].fill(true));
    };
    for i in 0..places * places {
        clear(i % places * pitch, i / places * pitch, place, place);
    }
    for (a, b) in tree.iter().chain(&open) {
        let (x, y) = (a % places * pitch, a / places * pitch);
        if *b == a + 1 { clear(x + place, y, gap, place) } else { clear(x, y + place, place, gap) }
    }
    Grid::new(&format!("{}-{seed}", kind.name()), side, free, Vec::new(), Vec::new())
}
