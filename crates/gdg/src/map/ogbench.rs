//! The point mazes of OGBench (Park et al. 2024): their tasks and teleports, which layouts leave
//! out.

use serde::{Deserialize, Serialize};

/// A block of a layout, as row and column from the upper left.
pub type Block = [usize; 2];

/// A point maze of OGBench.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ogbench {
    /// Of 8 x 8 blocks.
    Medium,
    /// Of 12 x 9 blocks.
    Large,
    /// Of 16 x 12 blocks.
    Giant,
    /// Of 12 x 9 blocks, with places that lead somewhere else at random.
    Teleport,
}

impl Ogbench {
    pub const ALL: [Self; 4] = [Self::Medium, Self::Large, Self::Giant, Self::Teleport];

    /// Cells along each side of a block, which is 4 long in OGBench's unit.
    pub const BLOCK_CELLS: usize = 20;

    /// The ball's radius, 0.7 in OGBench's unit, in cells.
    pub const BALL_CELLS: f32 = 3.5;

    /// A goal is reached within this distance, 1 in OGBench's unit, in cells.
    pub const GOAL_CELLS: f32 = 5.0;

    /// Steps of an episode and of an evaluation task.
    pub const EPISODE_STEPS: u32 = 1_000;

    /// Starts and goals are drawn up to this far from the middle of their blocks along each axis,
    /// in cells.
    pub const NOISE_CELLS: f32 = 5.0;

    /// The length of a cell, which is what an action of 1 moves, in OGBench's unit.
    pub const CELL_LENGTH: f32 = 0.2;

    /// OGBench's x and y of the map's upper left corner: the middle of the first block is at -4.
    pub const ORIGIN: f32 = -6.0;

    /// Closer than this to the middle of an [entry](Self::entries), the next step begins at one of
    /// the [exits](Self::exits), in cells.
    pub const ENTRY_CELLS: f32 = 7.5;

    /// Returns the name of the built-in map.
    pub fn name(self) -> &'static str {
        match self {
            Self::Medium => "ogbench-pointmaze-medium",
            Self::Large => "ogbench-pointmaze-large",
            Self::Giant => "ogbench-pointmaze-giant",
            Self::Teleport => "ogbench-pointmaze-teleport",
        }
    }

    /// Returns start and goal of its tasks.
    pub fn tasks(self) -> [[Block; 2]; 5] {
        match self {
            Self::Medium => [
                [[1, 1], [6, 6]],
                [[6, 1], [1, 6]],
                [[5, 3], [4, 2]],
                [[6, 5], [6, 1]],
                [[2, 6], [1, 1]],
            ],
            Self::Large => [
                [[1, 1], [7, 10]],
                [[5, 4], [7, 1]],
                [[7, 4], [1, 10]],
                [[3, 8], [5, 4]],
                [[1, 1], [5, 4]],
            ],
            Self::Giant => [
                [[1, 1], [10, 14]],
                [[1, 14], [10, 1]],
                [[8, 14], [1, 1]],
                [[8, 3], [5, 12]],
                [[5, 9], [3, 8]],
            ],
            Self::Teleport => [
                [[1, 10], [7, 1]],
                [[1, 1], [7, 10]],
                [[5, 6], [7, 10]],
                [[7, 1], [7, 10]],
                [[5, 6], [7, 1]],
            ],
        }
    }

    /// Returns the blocks in whose middle the point vanishes.
    pub fn entries(self) -> &'static [Block] {
        if self == Self::Teleport { &[[4, 6], [5, 1]] } else { &[] }
    }

    /// Returns the blocks in whose middle it appears, each as often. The first is walled in.
    pub fn exits(self) -> &'static [Block] {
        if self == Self::Teleport { &[[1, 7], [6, 1], [6, 10]] } else { &[] }
    }

    pub fn middle([row, column]: Block) -> [f32; 2] {
        [column, row].map(|block| (block as f32 + 0.5) * Self::BLOCK_CELLS as f32)
    }
}
