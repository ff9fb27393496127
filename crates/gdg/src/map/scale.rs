//! How a map relates to the maze that it was read from.

use serde::{Deserialize, Serialize};

use super::ogbench::Ogbench;

/// How the cells of a map relate to the maze that it was read from and to the body that moves there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MapScale {
    /// Cells along each side of one of the maze's blocks.
    pub cell: usize,
    /// By how much walls are wider than the maze's: the body's radius, in cells.
    pub margin: f32,
    /// A goal is reached below this distance, in cells.
    pub goal_radius: f32,
    /// The benchmark that it is of, with tasks of its own, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub benchmark: Option<Ogbench>,
}

impl Default for MapScale {
    fn default() -> Self {
        Self { cell: 1, margin: 0.0, goal_radius: 1.0, benchmark: None }
    }
}

impl MapScale {
    /// Most cells along each side of a block.
    pub const MAX_CELL: usize = 256;

    /// The widest margin, in cells.
    pub const MAX_MARGIN: f32 = 100.0;

    /// The goal radii that a map can have, in cells.
    pub const GOAL_RADII: std::ops::RangeInclusive<f32> = 0.1..=100.0;

    /// Returns the scale of a maze of OGBench.
    pub fn of_benchmark(benchmark: Ogbench) -> Self {
        Self {
            cell: Ogbench::BLOCK_CELLS,
            margin: Ogbench::BALL_CELLS,
            goal_radius: Ogbench::GOAL_CELLS,
            benchmark: Some(benchmark),
        }
    }

    /// Returns whether all values are within their ranges.
    pub fn is_valid(&self) -> bool {
        (1..=Self::MAX_CELL).contains(&self.cell)
            && (0.0..=Self::MAX_MARGIN).contains(&self.margin)
            && Self::GOAL_RADII.contains(&self.goal_radius)
    }
}
