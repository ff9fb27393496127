//! The maps compiled into the program.

use super::grid::Grid;
use super::load::parse_map;
use super::ogbench::Ogbench;
use super::scale::MapScale;

/// Name and text of every built-in map; those of OGBench are layouts of blocks.
pub const BUILTIN: [(&str, &str); 8] = [
    ("fourrooms", include_str!("../../maps/fourrooms.txt")),
    ("city", include_str!("../../maps/city.txt")),
    ("trap", include_str!("../../maps/trap.txt")),
    ("dead-end", include_str!("../../maps/dead-end.txt")),
    ("ogbench-pointmaze-medium", include_str!("../../maps/ogbench-pointmaze-medium.txt")),
    ("ogbench-pointmaze-large", include_str!("../../maps/ogbench-pointmaze-large.txt")),
    ("ogbench-pointmaze-giant", include_str!("../../maps/ogbench-pointmaze-giant.txt")),
    ("ogbench-pointmaze-teleport", include_str!("../../maps/ogbench-pointmaze-teleport.txt")),
];

/// Returns the built-in map called `name`.
///
/// # Panics
/// Never: tests check the built-in maps.
pub fn builtin(name: &str) -> Option<Grid> {
    let (name, text) = BUILTIN.iter().find(|(n, _)| *n == name)?;
    let map = parse_map(name, text.as_bytes()).expect("built-in maps are well-formed");
    let benchmark = Ogbench::ALL.into_iter().find(|benchmark| benchmark.name() == *name);
    let enlarged = benchmark.map(|benchmark| MapScale::of_benchmark(benchmark).of(name, &map));
    Some(enlarged.unwrap_or(Ok(map)).expect("layouts have room for their scale"))
}
