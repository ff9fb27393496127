//! Grid maps: parsing, printing, the built-in maps, and step distances.
//!
//! Distances computed here are the *ground truth* of a map: evaluation and display use them,
//! learning never does.

mod builtin;
mod diameter;
mod distance;
mod enlarge;
mod file;
mod flood;
mod formats;
mod grid;
mod half_cells;
mod load;
mod ogbench;
mod random;
mod scale;
mod scenario;
mod text;

pub use builtin::{BUILTIN, builtin};
pub use diameter::Diameter;
pub use distance::{Components, StepSearch};
pub use flood::UNREACHABLE;
pub use formats::{FORMATS, MapFormat, fingerprint, print_ascii, print_movingai};
pub use grid::{Cell, Grid, MAX_CELLS, MAX_SIDE, is_size, size_limits};
pub(crate) use half_cells::PointFlood;
pub use half_cells::PointSearch;
pub use load::{
    Reading, agents_of, format_for, load_map, load_map_as, load_map_like, load_scenario, parse_map,
    parse_scenario_bytes, read_scenario,
};
pub use ogbench::Ogbench;
pub use random::{RANDOM_SIZES, RandomMapKind, random, with_start};
pub use scale::MapScale;
pub use scenario::{Scenario, ScenarioTask};
pub use text::{MapError, MapResult};
