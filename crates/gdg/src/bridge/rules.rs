//! The settings and constants that planned walks depend on, for other programs that follow plans.

use serde_json::{Value, json};

use super::candidates::UNOBSERVED;
use super::graph::{
    BridgeGraph, COST_UNITS_PER_STEP, LINK_CANDIDATES, OBSERVED_FACTOR, OBSERVED_PENALTY_STEPS,
    OBSERVED_SLACK_STEPS, REVERSED_PENALTY_STEPS, UNVERIFIED_FACTOR,
};
use super::planner::{BAN_STRIKES, MAX_STRIKES, NEAREST_CANDIDATES, PROMISING_CANDIDATES};
use super::settings::{BAN_STEPS, BridgeSettings, LATE_FACTOR, LATE_SLACK_STEPS};

impl BridgeGraph {
    /// Returns the settings and constants that a walk along this graph depends on, by name.
    pub fn rules(&self) -> Value {
        let BridgeSettings {
            verify_edges,
            keep_observed_edges,
            edge_cutoff_steps,
            open_loop,
            progress_check,
            lookahead,
            ..
        } = self.settings();
        json!({
            "verify_edges": verify_edges,
            "keep_observed_edges": keep_observed_edges,
            "edge_cutoff_steps": edge_cutoff_steps,
            "hop_steps": self.hop_steps(),
            "open_loop": open_loop,
            "progress_check": progress_check,
            "late_factor": LATE_FACTOR,
            "late_slack_steps": LATE_SLACK_STEPS,
            "ban_steps": BAN_STEPS,
            "lookahead": lookahead,
            "window_steps": self.settings().window_steps(),
            "unobserved": UNOBSERVED,
            "link_candidates": LINK_CANDIDATES,
            "nearest_candidates": NEAREST_CANDIDATES,
            "promising_candidates": PROMISING_CANDIDATES,
            "max_strikes": MAX_STRIKES,
            "ban_strikes": BAN_STRIKES,
            "unverified_factor": UNVERIFIED_FACTOR,
            "observed_factor": OBSERVED_FACTOR,
            "observed_slack_steps": OBSERVED_SLACK_STEPS,
            "observed_penalty_steps": OBSERVED_PENALTY_STEPS,
            "reversed_penalty_steps": REVERSED_PENALTY_STEPS,
            "cost_units_per_step": COST_UNITS_PER_STEP,
        })
    }
}
