//! Bridge points: states b with D(s,b) + D(b,g) < D(s,g) that split a hard task into easy ones.
//!
//! [`Candidates`] spreads candidates over the visited states and records the fewest steps observed between them;
//! [`BridgeGraph`] connects them with edges that the critics propose and observed trajectories verify; [`Walker`]
//! follows the graph to a goal, one waypoint at a time; [`search()`] is the published search for a single bridge point.
//! [`Excursions`] lead agents beyond the frontier of what has been visited.

mod candidates;
mod excursion;
mod graph;
mod hops;
mod planner;
mod search;
mod settings;

pub use candidates::{Candidates, CandidatesState, UNOBSERVED, WalkRecord};
pub(crate) use candidates::{
    DETOUR_FACTOR, DETOUR_SLACK_STEPS, MANY_HOP_FAILURES, MANY_PATHS, MAX_SPACING_SHARE, MIN_SPACING_RADII,
    NEWCOMER_FACTOR, OPEN_SHARE, WELL_KNOWN_PATHS,
};
pub use excursion::Excursions;
pub(crate) use excursion::{
    EXCURSION_STEPS, HELD_STEPS, MAX_ATTEMPTS, MAX_PLACES, MIN_ATTEMPTS, MIN_STRIDE, RANDOM_SHARE, SHARE_ROUNDS,
};
pub use graph::{BridgeGraph, DistilledDistances, Edge, EdgeStatus, GraphState, LINK_CANDIDATES, Route};
pub(crate) use graph::{
    CHANGED_GOALS, CHANGED_MARGIN, DEMOTED_FACTOR, GROWN_FACTOR, GROWN_SLACK_STEPS, OBSERVED_FACTOR,
    OBSERVED_PENALTY_STEPS, OBSERVED_SLACK_STEPS, REVERSED_PENALTY_STEPS, SHRUNK_SLACK_STEPS, UNVERIFIED_FACTOR,
};
pub(crate) use hops::HOP_FORGETTING;
pub(crate) use planner::{BAN_STRIKES, MAX_STRIKES};
pub use planner::{Hop, Target, Walker, WalkerState};
pub use search::{BridgePoint, SearchOutcome, search};
pub use settings::{BridgeSettings, Planner};
pub(crate) use settings::{EXPLORED_SHARE, FRONTIER_SHARE, MAX_FACTOR, MAX_UNVERIFIED_FACTOR};
