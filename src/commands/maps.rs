//! `gdg-tui maps`: the built-in maps.

use super::check::describe_diameter;
use super::output::{Outcome, print};
use crate::cli::MapKindArg;
use gdg::map::{self, BUILTIN, Diameter, print_ascii};

/// Returns the table of built-in maps.
fn list() -> String {
    let head =
        format!("{:<12}{:>9}{:>12}{:>18}\n", "map", "size", "free cells", "farthest (steps)");
    let lines = BUILTIN.iter().filter_map(|(name, _)| map::builtin(name)).map(|grid| {
        let size = format!("{}x{}", grid.width(), grid.height());
        let farthest = describe_diameter(Diameter::compute(&grid));
        format!("{:<12}{size:>9}{:>12}{farthest:>18}\n", grid.name(), grid.free_count())
    });
    std::iter::once(head).chain(lines).collect()
}

/// Prints the table of built-in maps, or a random map.
///
/// # Errors
/// Standard output cannot be written.
pub fn run(random: Option<MapKindArg>, size: Option<u16>, seed: u64) -> Outcome {
    match random {
        None => print(&list()),
        Some(kind) => print(&print_ascii(&map::random(kind.into(), size.map(usize::from), seed))),
    }
}
