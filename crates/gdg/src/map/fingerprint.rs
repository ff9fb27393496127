//! What tells maps of the same name apart.

use super::formats::print_ascii;
use super::grid::Grid;

/// Returns what tells `grid` apart from other maps of its name: its size, its goal radius, and a
/// checksum of its cells, marks and scale. A start that was drawn at random does not count.
pub fn fingerprint(grid: &Grid) -> String {
    let text = if grid.is_start_drawn() {
        print_ascii(&grid.with_marks(Vec::new(), grid.goals().to_vec()))
    } else {
        print_ascii(grid)
    };
    let scale = grid.scale();
    let checksum = crc32fast::hash(format!("{text}{scale:?}").as_bytes());
    let [width, height] = [grid.width(), grid.height()];
    format!("{width} x {height}, goal radius {}, {checksum:08x}", scale.goal_radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::{MapScale, parse_map, with_start};

    #[test]
    fn it_depends_on_cells_marks_and_scale_but_not_on_a_start_that_was_drawn() {
        let map = |text: &str| parse_map("map", text.as_bytes()).expect("a map");
        let own = fingerprint(&map("...#\n....\n"));
        assert!(own.starts_with("4 x 2, goal radius 1, "), "{own}");
        let wider = MapScale { goal_radius: 2.0, ..MapScale::default() };
        for other in [
            map("..##\n....\n"),
            map("S..#\n....\n"),
            map("...#\n...G\n"),
            map("...#\n....\n").with_scale(wider),
        ] {
            assert_ne!(fingerprint(&other), own);
        }
        let drawn = with_start(map("...#\n....\n"), 7);
        assert_eq!((drawn.starts().len(), fingerprint(&drawn)), (1, own));
    }
}
