//! Bridge points: states b with D(s,b) + D(b,g) < D(s,g) that split a hard task into easy ones.
//!
//! [`Candidates`] spreads candidates over the visited states and records the fewest steps observed
//! between them; [`BridgeGraph`] connects them with edges that the critics propose and observed
//! trajectories verify; [`Walker`] follows the graph to a goal, one waypoint at a time; [`Guide`]
//! chooses actions by policy and walk; [`search()`] is the published search for a single bridge
//! point. Excursions lead agents beyond the frontier of what has been visited.

mod candidates;
mod excursion;
mod graph;
mod planner;
mod settings;

pub use candidates::Candidates;
pub(crate) use excursion::Excursions;
pub use graph::{BridgeGraph, Edge, EdgeStatus};
pub(crate) use graph::{LINK_CANDIDATES, StoredGraph};
pub(crate) use planner::Hop;
pub use planner::{BridgePoint, Guide, SearchOutcome, SearchSpace, WalkTarget, Walker, search};
pub use settings::{BridgeSettings, Planner, SEARCH_BUDGET};
pub(crate) use settings::{EXPLORED_SHARE, FRONTIER_SHARE, SEEK_SHARE};
