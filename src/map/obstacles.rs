//! How many obstacles lie between two cells.

use super::grid::{Cell, Grid};

/// The obstacles of a map: its 8-connected groups of wall cells.
#[derive(Clone, Debug)]
pub struct Obstacles {
    /// Obstacle of each cell, row-major; free cells have none.
    pub of_cell: Vec<Option<u32>>,
    /// How many there are.
    pub count: usize,
}

impl Obstacles {
    /// Finds the obstacles of `grid`.
    pub fn new(grid: &Grid) -> Self {
        let mut of_cell = vec![None; grid.free().len()];
        let mut count = 0;
        for i in 0..of_cell.len() {
            if grid.free()[i] || of_cell[i].is_some() {
                continue;
            }
            of_cell[i] = Some(count);
            let mut pending = vec![grid.cell(i)];
            while let Some(at) = pending.pop() {
                for y in at.y.saturating_sub(1)..=(at.y + 1).min(grid.height() - 1) {
                    for x in at.x.saturating_sub(1)..=(at.x + 1).min(grid.width() - 1) {
                        let next = grid.index(Cell::new(x, y));
                        if !grid.free()[next] && of_cell[next].is_none() {
                            of_cell[next] = Some(count);
                            pending.push(Cell::new(x, y));
                        }
                    }
                }
            }
            count += 1;
        }
        Self { of_cell, count: count as usize }
    }
}

/// How many different obstacles the straight line between the middles of `a` and `b` runs through: each of them
/// has to be got round. The line is sampled at every tenth of a cell.
pub fn obstacles_between(grid: &Grid, obstacles: &Obstacles, a: Cell, b: Cell) -> usize {
    let ([ax, ay], [bx, by]) = (a.centre(), b.centre());
    let samples = 10 * a.x.abs_diff(b.x).max(a.y.abs_diff(b.y)).max(1);
    let mut met = Vec::new();
    for i in 0..=samples {
        let t = i as f32 / samples as f32;
        let cell = Cell::new((ax + t * (bx - ax)) as usize, (ay + t * (by - ay)) as usize);
        if let Some(obstacle) = obstacles.of_cell[grid.index(cell)]
            && !met.contains(&obstacle)
        {
            met.push(obstacle);
        }
    }
    met.len()
}
