//! What tells maps of the same name apart.

use super::formats::print_ascii;
use super::grid::Grid;

/// Returns what tells `grid` apart from other maps of its name: its size, its goal radius, and a
/// checksum of its cells, goals and scale. Starts do not count: they may have been drawn at random.
pub fn fingerprint(grid: &Grid) -> String {
    let text = print_ascii(&grid.with_marks(Vec::new(), grid.goals().to_vec()));
    let scale = grid.scale();
    let checksum = crc32fast::hash(format!("{text}{scale:?}").as_bytes());
    let [width, height] = [grid.width(), grid.height()];
    format!("{width} x {height}, goal radius {}, {checksum:08x}", scale.goal_radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{MapScale, parse_map};

    #[test]
    fn it_depends_on_cells_goals_and_scale_but_not_on_starts() {
        let map = |text: &str| parse_map("map", text.as_bytes()).expect("a map");
        let own = fingerprint(&map("...#\n....\n"));
        assert!(own.starts_with("4 x 2, goal radius 1, "), "{own}");
        let wider = MapScale { goal_radius: 2.0, ..MapScale::default() };
        for other in
            [map("..##\n....\n"), map("...#\n...G\n"), map("...#\n....\n").with_scale(wider)]
        {
            assert_ne!(fingerprint(&other), own);
        }
        assert_eq!(fingerprint(&map("S..#\n....\n")), own);
    }
}
