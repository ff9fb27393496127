//! Selects the bridge candidates to draw: all of them would hide the map.

use std::collections::HashMap;

use super::MazeState;
use crate::tui::raster::MapFrame;
use gdg::viewer::Candidate;

/// One candidate is drawn per block of characters, given by its columns and rows.
const SPACING: (u16, u16) = (6, 3);

/// Returns the candidates to draw: in each block the one nearest to its middle, so that the
/// selection is stable while they stay in place.
pub fn shown<'a>(map_frame: &MapFrame, maze: &'a MazeState) -> Vec<&'a Candidate> {
    let mut nearest: HashMap<(u16, u16), (f32, usize)> = HashMap::new();
    let candidates = &maze.view.candidates;
    for (i, candidate) in candidates.iter().enumerate() {
        let Some(at) = map_frame.character_of(candidate.at) else { continue };
        let (column, row) = (at.x - map_frame.area.x, at.y - map_frame.area.y);
        let off = |at: u16, spacing: u16| f32::from(at % spacing) - 0.5 * f32::from(spacing - 1);
        let own = off(column, SPACING.0).abs() + 2.0 * off(row, SPACING.1).abs();
        let part = nearest.entry((column / SPACING.0, row / SPACING.1)).or_insert((own, i));
        if own < part.0 {
            *part = (own, i);
        }
    }
    let mut shown: Vec<usize> = nearest.into_values().map(|(_, i)| i).collect();
    shown.sort_unstable();
    shown.into_iter().map(|i| &candidates[i]).collect()
}
