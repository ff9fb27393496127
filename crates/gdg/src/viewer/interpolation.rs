//! Interpolates D of a film's frame: all over a maze, from the few cells that were filmed, and on a
//! plane in the space of an arm.

use std::collections::VecDeque;
use std::sync::Arc;

use super::Plane;
use crate::draw::Raster;
use crate::env::ArmScene;
use crate::env::fetch_reach::ProbeLattice;
use crate::env::maze::ProbeGrid;
use crate::map::{Cell, Grid};
use crate::train::FilmFrame;

#[derive(Clone, Debug)]
pub struct FilmedMap {
    map: Arc<Grid>,
    /// The place whose filmed cell has the shortest path to each cell, as D jumps at walls; `None` if
    /// no path leads to any.
    nearest: Vec<Option<usize>>,
}

impl FilmedMap {
    pub fn new(map: Arc<Grid>) -> Self {
        let grid = ProbeGrid::new(&map);
        let mut nearest = vec![None; map.free().len()];
        let mut reached = VecDeque::new();
        for (place, cell) in (0..grid.places()).map(|place| (place, grid.cell(&map, place))) {
            if let Some(cell) = cell {
                nearest[map.index(cell)] = Some(place);
                reached.push_back(cell);
            }
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
        Self { map, nearest }
    }

    pub fn map(&self) -> &Arc<Grid> {
        &self.map
    }

    /// Returns D from a free position; NaN if it is not known.
    pub fn distance(&self, frame: &FilmFrame, [x, y]: [f32; 2]) -> f32 {
        let place = self.nearest[self.map.index(Cell::new(x as usize, y as usize))];
        place.map_or(f32::NAN, |place| frame.distance(place))
    }

    /// Returns the value of each pixel; NaN where there is none.
    pub fn field(&self, frame: &FilmFrame, raster: Raster) -> Vec<f32> {
        let mut field = vec![f32::NAN; raster.len()];
        let (free, positions) = raster.free_ground(&self.map);
        free.into_iter().zip(positions).for_each(|(i, at)| field[i] = self.distance(frame, at));
        field
    }
}

/// Returns D in a film's frame at every pixel of a plane through the frame's goal, from the points
/// in space that were filmed; NaN where the grip cannot be.
pub fn field_of_arm(scene: ArmScene, frame: &FilmFrame, plane: &Plane) -> Vec<f32> {
    let lattice = ProbeLattice::new(&scene);
    let value = |i: usize| {
        let at = plane.point(plane.raster.middle_of(i), &frame.goal);
        // Beside the table, only some of the points have a value.
        let at = <[f32; 3]>::try_from(at).ok().filter(|at| scene.has_room(*at));
        let around = at.and_then(|at| lattice.around(at));
        around.map_or(f32::NAN, |around| mean_distance(frame, around))
    };
    (0..plane.raster.len()).map(value).collect()
}

/// Returns the mean of D in a film's frame over places, each with a weight; NaN if it is not known
/// at any place with a positive weight.
fn mean_distance(frame: &FilmFrame, places: impl IntoIterator<Item = (usize, f32)>) -> f32 {
    let weighted = places.into_iter().filter(|(_, weight)| *weight > 0.0);
    let (sum, weights) = weighted
        .map(|(place, weight)| (frame.distance(place), weight))
        .filter(|(distance, _)| distance.is_finite())
        .fold((0.0, 0.0), |(sum, weights), (distance, weight)| {
            (sum + weight * distance, weights + weight)
        });
    if weights > 0.0 { sum / weights } else { f32::NAN }
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
        film.add([1, 32], &world as &dyn Environment, &points, &distances);
        (FilmedMap::new(map), film.frames()[0].clone())
    }

    fn map(text: &str) -> Grid {
        crate::map::parse_map("map", text.as_bytes()).expect("a map")
    }

    #[test]
    fn on_large_maps_distances_do_not_leak_through_thin_walls() {
        let (width, height) = (120, 60);
        let open = Grid::empty("wall", width, height);
        let wall = (0..height).map(|y| (Cell::new(61, y), false));
        let map = open.with_cells(wall).expect("a map");
        let (filmed, frame) = filmed(map, |[x, _]| if x < 61.0 { 10.0 } else { 90.0 });
        assert!(frame.places() < width * height / 2);
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
