//! Bridge points: states b with D(s,b) + D(b,g) < D(s,g) that split a hard task into easy ones.
//!
//! [`Candidates`] spreads candidates over what the agents have seen and remembers in how many steps one was reached
//! from another; [`BridgeGraph`] joins them by edges that the critics propose and experience verifies;
//! [`Walker`] walks through it, waypoint by waypoint; [`search()`] is the published search for a single bridge point.

mod candidates;
mod graph;
mod planner;
mod search;
mod settings;

pub use candidates::{Candidates, CandidatesState, NEVER, Practice};
pub use graph::{BridgeGraph, Distilled, Edge, GraphState, LINKS, Route, Standing};
pub use planner::{Hop, Target, Walker, WalkerState};
pub use search::{BridgePoint, SearchOutcome, search};
pub use settings::{BridgeSettings, Planner};
