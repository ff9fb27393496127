//! Grid maps: parsing, printing, the built-in maps, and step distances.
//!
//! Distances computed here are the *ground truth* of a map: evaluation and display use them,
//! learning never does.

mod components;
mod flood;
mod formats;
mod grid;
mod load;
mod ogbench;
mod points;
mod random;
mod scale;
mod scenario;
mod text_file;

pub use components::Components;
pub use flood::{StepSearch, UNREACHABLE};
pub use formats::{FORMATS, MapFormat, fingerprint, image_named_in, print_ascii};
pub use grid::{Cell, Grid, MAX_CELLS, MAX_SIDE, MapScale, is_size, size_limits};
pub use load::{
    BUILTIN, Reading, agents_of, builtin, format_for, load_map, load_map_as, load_map_like,
    lost_from, parse_map, read_scenario,
};
pub use ogbench::Ogbench;
pub use points::{Diameter, PointSearch};
pub use random::{RANDOM_SIZES, RandomMapKind, random, with_start};
pub use scenario::{Scenario, ScenarioTask};
pub use text_file::{MapError, MapResult};
