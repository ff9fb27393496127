//! Images as maps, one pixel a cell: dark pixels are walls, green ones starts, red ones goals,
//! yellow ones both.

use std::path::Path;

use super::super::grid::{Grid, is_size, size_limits};
use super::super::text::{MapError, MapResult};
use super::marks;
use super::rows::{Mark, grid};

/// Channels of a strong colour are at least this bright, the others at most as bright as [`DARK`].
const BRIGHT: u8 = 160;
const DARK: u8 = 96;

/// Colours of written images.
pub const WALL: [u8; 3] = [0; 3];
pub const FREE: [u8; 3] = [255; 3];
pub const START: [u8; 3] = [0, 176, 0];
pub const GOAL: [u8; 3] = [224, 0, 0];
pub const BOTH: [u8; 3] = [240, 200, 0];

/// An image, row by row from the top.
pub struct Image {
    pub width: usize,
    pub pixels: Vec<[u8; 3]>,
}

impl Image {
    /// Checks that a map can be as large as an image.
    pub fn check_size(file: &str, width: usize, height: usize) -> MapResult<()> {
        if is_size(width, height) {
            return Ok(());
        }
        let problem = format!("an image of {width} x {height} pixels is too large");
        Err(MapError::whole_file(file, problem, size_limits()))
    }

    /// Returns the map; pixels without a strong colour are walls where `is_wall` says so of their
    /// brightness, from 0 to 1.
    ///
    /// # Errors
    /// It has no free cell.
    pub fn map(&self, file: &str, is_wall: impl Fn(f32) -> bool, help: &str) -> MapResult<Grid> {
        let mark = |pixel: &[u8; 3]| {
            strong(*pixel).unwrap_or_else(|| {
                let sum: u16 = pixel.iter().map(|channel| u16::from(*channel)).sum();
                if is_wall(f32::from(sum) / 765.0) { Mark::Wall } else { Mark::Free }
            })
        };
        let marks: Vec<Mark> = self.pixels.iter().map(mark).collect();
        grid(&super::name_of(Path::new(file)), self.width, &marks)
            .ok_or_else(|| MapError::whole_file(file, "the map has no free cell", help))
    }

    /// Draws a map.
    pub fn of(grid: &Grid) -> Self {
        let colour = |mark| match mark {
            Mark::Wall => WALL,
            Mark::Free => FREE,
            Mark::Start => START,
            Mark::Goal => GOAL,
            Mark::Both => BOTH,
        };
        Self { width: grid.width(), pixels: marks(grid).flatten().map(colour).collect() }
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.pixels.len() / self.width
    }
}

/// Returns what a pixel of a strong colour marks.
fn strong([red, green, blue]: [u8; 3]) -> Option<Mark> {
    if blue > DARK {
        return None;
    }
    match (red, green) {
        (BRIGHT.., BRIGHT..) => Some(Mark::Both),
        (BRIGHT.., ..=DARK) => Some(Mark::Goal),
        (..=DARK, BRIGHT..) => Some(Mark::Start),
        _ => None,
    }
}
