//! D of a film's frame all over the map, from the few cells that were filmed.

use std::collections::VecDeque;
use std::sync::Arc;

use super::walk::sees;
use crate::draw::Raster;
use crate::env::maze::ProbeGrid;
use crate::map::{Cell, Grid};
use crate::train::FilmFrame;
use crate::viewer::mean_distance;

/// Minimum total weight of the filmed cells in sight to interpolate between them.
const MIN_SHARE: f32 = 1e-3;

/// Places with their weights.
type Around = [(u32, f32); 4];

/// A map and its filmed cells.
#[derive(Clone, Debug)]
pub struct FilmedMap {
    map: Arc<Grid>,
    grid: ProbeGrid,
    /// The middle of the filmed cell of each place.
    places: Vec<Option<[f32; 2]>>,
    /// The place with the shortest path from each cell; `None` if no path leads to any.
    nearest: Vec<Option<u32>>,
}

impl FilmedMap {
    /// Prepares a map.
    pub fn new(map: Arc<Grid>) -> Self {
        let grid = ProbeGrid::new(&map);
        let cells: Vec<Option<Cell>> =
            (0..grid.places()).map(|place| grid.cell(&map, place)).collect();
        let nearest = nearest_places(&map, &cells);
        Self {
            places: cells.into_iter().map(|cell| cell.map(Cell::centre)).collect(),
            nearest,
            grid,
            map,
        }
    }

    /// Returns the map.
    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// Returns the places between which a free position lies, with weights that sum up to 1: those
    /// in sight, or else the one with the shortest path, since D jumps at walls.
    fn around(&self, at: [f32; 2]) -> Around {
        let ProbeGrid { side, columns, rows } = self.grid;
        // The centre of the filmed cell in most blocks.
        let middle = (side / 2) as f32 + 0.5;
        let along = |at: f32, count: usize| {
            let along = ((at - middle) / side as f32).clamp(0.0, (count - 1) as f32);
            (along as usize, along.fract())
        };
        let ((column, right), (row, down)) = (along(at[0], columns), along(at[1], rows));
        let corners =
            [(0, 0, 1.0 - right, 1.0 - down), (1, 0, right, 1.0 - down), (0, 1, 1.0 - right, down)];
        let mut around = [corners[0], corners[1], corners[2], (1, 1, right, down)].map(
            |(across, below, x, y)| {
                // Beyond the last block, there is no weight.
                let place =
                    (row + below).min(rows - 1) * columns + (column + across).min(columns - 1);
                let seen =
                    x * y > 0.0 && self.places[place].is_some_and(|from| sees(&self.map, from, at));
                (place as u32, if seen { x * y } else { 0.0 })
            },
        );
        let sum: f32 = around.iter().map(|(_, weight)| weight).sum();
        if sum >= MIN_SHARE {
            around.iter_mut().for_each(|(_, weight)| *weight /= sum);
            return around;
        }
        let nearest = self.nearest[self.map.index(Cell::new(at[0] as usize, at[1] as usize))];
        [
            (nearest.unwrap_or(0), if nearest.is_some() { 1.0 } else { 0.0 }),
            (0, 0.0),
            (0, 0.0),
            (0, 0.0),
        ]
    }

    /// Returns D from a free position; NaN if it is not known.
    pub fn distance(&self, frame: &FilmFrame, at: [f32; 2]) -> f32 {
        mean_distance(frame, self.around(at).map(|(place, weight)| (place as usize, weight)))
    }

    /// Returns the value of each pixel; NaN where there is none.
    pub fn field(&self, frame: &FilmFrame, raster: Raster) -> Vec<f32> {
        let mut field = vec![f32::NAN; raster.len()];
        let (free, positions) = raster.free_ground(&self.map);
        free.into_iter().zip(positions).for_each(|(i, at)| field[i] = self.distance(frame, at));
        field
    }
}

/// Returns, for each cell, the place whose filmed cell has the shortest path to it.
fn nearest_places(map: &Grid, cells: &[Option<Cell>]) -> Vec<Option<u32>> {
    let mut nearest = vec![None; map.free().len()];
    let mut reached = VecDeque::new();
    for (place, cell) in
        cells.iter().enumerate().filter_map(|(place, cell)| Some((place, (*cell)?)))
    {
        nearest[map.index(cell)] = Some(place as u32);
        reached.push_back(cell);
    }
    while let Some(cell) = reached.pop_front() {
        let place = nearest[map.index(cell)];
        for next in map.neighbours(cell) {
            let known = &mut nearest[map.index(next)];
            if known.is_none() {
                *known = place;
                reached.push_back(next);
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::{Environment, PointMaze};
    use crate::train::Film;

    /// Returns a film's only frame on `map`, with `distance` of each filmed position.
    fn filmed(map: Grid, distance: impl Fn([f32; 2]) -> f32) -> (FilmedMap, Arc<FilmFrame>) {
        let map = Arc::new(map);
        let (world, mut film) = (PointMaze::new(map.clone(), 1), Film::default());
        let points = film.points(&world).expect("points");
        let (states, _) = points.states.as_chunks::<2>();
        let distances: Vec<f32> = states.iter().map(|at| distance(*at)).collect();
        film.add(1, 32, &world as &dyn Environment, &points, &distances);
        (FilmedMap::new(map), film.frames()[0].clone())
    }

    fn map(text: &str) -> Grid {
        crate::map::parse_map("map", text.as_bytes()).expect("a map")
    }

    #[test]
    fn values_between_filmed_cells_are_interpolated_and_walls_are_not() {
        let (filmed, frame) = filmed(map("....#....\n....#....\n"), |[x, y]| x + 10.0 * y);
        for at in [[0.5, 0.5], [1.5, 1.0], [2.25, 0.75], [3.5, 1.5]] {
            let found = filmed.distance(&frame, at);
            assert!((found - at[0] - 10.0 * at[1]).abs() < 0.01, "{at:?}: {found}");
        }
        let beside_wall = [3.99, 5.01].map(|x| filmed.distance(&frame, [x, 0.5]) - 5.0);
        let off = [beside_wall[0] - 3.5, beside_wall[1] - 5.5];
        assert!(off.iter().all(|off| off.abs() < 0.01), "{off:?}");
    }

    #[test]
    fn on_large_maps_distances_do_not_leak_through_thin_walls() {
        let (width, height) = (120, 60);
        let open = Grid::empty("wall", width, height);
        let wall = (0..height).map(|y| (Cell::new(61, y), false));
        let map = open.with_cells(wall).expect("a map");
        let (filmed, frame) = filmed(map, |[x, _]| if x < 61.0 { 10.0 } else { 90.0 });
        assert!(filmed.grid.side > 1);
        for x in 0..width {
            let expected = if x < 61 { 10.0 } else { 90.0 };
            let found = filmed.distance(&frame, Cell::new(x, 31).centre());
            assert!(x == 61 || (found - expected).abs() < 0.01, "column {x}: {found}");
        }
    }

    #[test]
    fn walls_that_are_gone_have_no_value() {
        let (_, frame) = filmed(map("..#\n"), |[x, _]| x);
        let filmed = FilmedMap::new(Arc::new(map("...\n")));
        let raster = Raster { window: [0.0, 0.0, 3.0, 1.0], pixels: (3, 1) };
        let field = filmed.field(&frame, raster);
        assert!((field[0] - 0.5).abs() < 0.01 && field[2].is_nan(), "{field:?}");
    }
}
