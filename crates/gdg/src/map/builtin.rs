//! The maps compiled into the program.

use super::grid::Grid;
use super::load::parse_map;

/// Name and text of every built-in map.
pub const BUILTIN: [(&str, &str); 3] = [
    ("fourrooms", include_str!("../../maps/fourrooms.txt")),
    ("city", include_str!("../../maps/city.txt")),
    ("trap", include_str!("../../maps/trap.txt")),
];

/// Returns the built-in map called `name`.
///
/// # Panics
/// Never: tests check the built-in maps.
pub fn builtin(name: &str) -> Option<Grid> {
    let (name, text) = BUILTIN.iter().find(|(n, _)| *n == name)?;
    Some(parse_map(name, text.as_bytes()).expect("built-in maps are well-formed"))
}
