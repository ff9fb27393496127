//! The space of goals, which front ends draw where they know nothing else about a world; and the
//! walls of a maze that another program simulates.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{EnvError, Environment, Episodes, Spec};

/// A world without a picture of its own: its goals, states and steps.
#[derive(Clone)]
pub struct GoalSpace {
    kind: &'static str,
    title: String,
    pub(crate) spec: Spec,
    episode_steps: Option<u32>,
    walls: Option<Arc<Walls>>,
    /// Without agents, if it has not failed.
    world: Result<Arc<dyn Environment>, EnvError>,
}

impl GoalSpace {
    /// Returns the space of goals of `world`, with the walls of its maze, if it has one: the first two
    /// components of goals are positions in it.
    pub fn of(world: &dyn Environment, walls: Option<&Walls>) -> Self {
        Self {
            kind: world.kind(),
            title: world.title().to_owned(),
            spec: world.spec().clone(),
            episode_steps: world.abilities().episodes.and_then(Episodes::episode_steps),
            walls: walls.cloned().map(Arc::new),
            world: world.fork(0).map(Arc::from),
        }
    }

    /// Returns whether (x, y) lies in a wall of its maze or outside; not without a maze.
    pub fn is_wall(&self, at: [f32; 2]) -> bool {
        self.walls.as_ref().is_some_and(|walls| walls.cell_at(at).is_none_or(|i| walls.is_wall(i)))
    }

    pub fn spec(&self) -> &Spec {
        &self.spec
    }

    pub fn world(&self) -> Result<Box<dyn Environment>, EnvError> {
        self.world.clone()?.fork(1)
    }

    /// Returns the most steps that an agent may take to a goal, if the world itself defines them.
    pub fn episode_steps(&self) -> Option<u32> {
        self.episode_steps
    }

    /// Returns the range of a goal's component `i`: in the maze, or of the state's component.
    pub fn range(&self, i: usize) -> [f32; 2] {
        if let Some(walls) = self.walls.as_ref().filter(|_| i < 2) {
            return walls.range(i);
        }
        let (spec, i) = (self.spec(), self.spec().achieved[i]);
        [-1.0, 1.0].map(|side| spec.state_centre[i] + side * spec.state_half_range[i])
    }

    pub fn name(&self, i: usize) -> String {
        let named = self.spec().goal_dim() <= NAMES.len() && self.spec().position_scale.is_some();
        if named { NAMES[i].to_owned() } else { format!("g{i}") }
    }
}

const NAMES: [&str; 3] = ["x", "y", "z"];

/// Two are equal if nothing that is drawn or walked in differs: the scales of other components than the
/// goal's follow the agents' steps.
impl PartialEq for GoalSpace {
    fn eq(&self, other: &Self) -> bool {
        let spec = |Spec { achieved, action_dim, goal_radius, state_centre, .. }: &Spec| {
            (achieved.clone(), *action_dim, *goal_radius, state_centre.len())
        };
        let ranges = |space: &Self| -> Vec<[f32; 2]> {
            (0..space.spec.goal_dim()).map(|i| space.range(i)).collect()
        };
        (self.kind, &self.title, self.episode_steps, &self.walls)
            == (other.kind, &other.title, other.episode_steps, &other.walls)
            && spec(&self.spec) == spec(&other.spec)
            && ranges(self) == ranges(other)
    }
}

impl fmt::Debug for GoalSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GoalSpace").field("title", &self.title).finish_non_exhaustive()
    }
}

/// Most rows, and most columns, of a maze.
const MAX_SIDE_CELLS: usize = 1024;

/// Which cells of a maze are walls, and where its cells are.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Walls {
    /// Whether each cell is a wall, by row.
    is_wall: Vec<Vec<bool>>,
    /// Middle (x, y) of the first cell of the first row.
    first: [f32; 2],
    /// How x changes from column to column, and y from row to row.
    cell: [f32; 2],
}

impl Walls {
    /// Returns whether the numbers make sense: rows of one length, and cells with a size.
    pub fn is_sound(&self) -> bool {
        let (rows, columns) = (self.is_wall.len(), self.columns());
        (1..=MAX_SIDE_CELLS).contains(&rows)
            && (1..=MAX_SIDE_CELLS).contains(&columns)
            && self.is_wall.iter().all(|row| row.len() == columns)
            && self.first.iter().all(|v| v.is_finite())
            && self.cell.iter().all(|v| v.is_normal())
    }

    fn columns(&self) -> usize {
        self.is_wall.first().map_or(0, Vec::len)
    }

    pub fn cell_size(&self) -> f32 {
        self.cell[0].abs().min(self.cell[1].abs())
    }

    pub fn cells(&self) -> usize {
        self.is_wall.len() * self.columns()
    }

    /// Returns the lowest and the highest x (`axis` 0) or y (1) of free cells and half of the walls beside.
    pub fn range(&self, axis: usize) -> [f32; 2] {
        let count = [self.columns(), self.is_wall.len()][axis];
        let place = |cell| [cell % self.columns(), cell / self.columns()][axis];
        let free = (0..self.cells()).filter(|cell| !self.is_wall(*cell)).map(place);
        let [low, high] = free.fold([count, 0], |[low, high], i| [low.min(i), high.max(i)]);
        let ends = [low as f32 - 1.0, high as f32 + 1.0].map(|i| i.clamp(-0.5, count as f32 - 0.5));
        let ends = ends.map(|i| self.first[axis] + i * self.cell[axis]);
        [ends[0].min(ends[1]), ends[0].max(ends[1])]
    }

    /// Returns the index of the cell, row by row, in which (x, y) lies, if it lies in the maze.
    pub fn cell_at(&self, at: [f32; 2]) -> Option<usize> {
        let index = |axis: usize| ((at[axis] - self.first[axis]) / self.cell[axis]).round();
        let [column, row] = [0, 1].map(index);
        let is_inside = |i: f32, count: usize| (0.0..count as f32).contains(&i);
        (is_inside(column, self.columns()) && is_inside(row, self.is_wall.len()))
            .then(|| row as usize * self.columns() + column as usize)
    }

    pub fn is_wall(&self, cell: usize) -> bool {
        self.is_wall[cell / self.columns()][cell % self.columns()]
    }

    /// Returns `side` times `side` points in each free cell, in its middle, where a body has room.
    pub fn free_points(&self, side: u32) -> impl Iterator<Item = [f32; 2]> + '_ {
        let offset = move |i: u32| (i as f32 + 0.5) / side as f32 * 0.5 - 0.25;
        (0..self.cells()).filter(|cell| !self.is_wall(*cell)).flat_map(move |cell| {
            let middle = [cell % self.columns(), cell / self.columns()];
            (0..side * side).map(move |i| {
                let offsets = [offset(i % side), offset(i / side)];
                [0, 1].map(|k| self.first[k] + self.cell[k] * (middle[k] as f32 + offsets[k]))
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walls() -> Walls {
        let walls = serde_json::json!({
            "is_wall": [[true, true, true], [true, false, true]],
            "first": [-2.0, 8.0],
            "cell": [4.0, -4.0],
        });
        serde_json::from_value(walls).expect("walls")
    }

    #[test]
    fn places_lie_in_cells_and_free_cells_give_points() {
        let walls = walls();
        assert!(walls.is_sound());
        assert_eq!(walls.cell_at([-3.9, 9.9]), Some(0));
        assert_eq!(walls.cell_at([7.9, 2.1]), Some(5));
        assert_eq!(walls.cell_at([3.0, 5.0]), Some(4));
        assert_eq!([[-4.1, 8.0], [8.1, 8.0], [0.0, 1.9]].map(|at| walls.cell_at(at)), [None; 3]);
        assert_eq!([0, 1].map(|axis| walls.range(axis)), [[-2.0, 6.0], [2.0, 8.0]]);
        assert!((0..6).filter(|cell| !walls.is_wall(*cell)).eq([4]));
        let points: Vec<_> = walls.free_points(2).collect();
        assert_eq!(points, [[1.5, 4.5], [2.5, 4.5], [1.5, 3.5], [2.5, 3.5]]);
        let mut ragged = walls.clone();
        ragged.is_wall[1].pop();
        let flat = Walls { cell: [1.0, 0.0], ..walls.clone() };
        let empty = Walls { is_wall: Vec::new(), ..walls };
        assert!([ragged, flat, empty].iter().all(|walls| !walls.is_sound()));
    }
}
