//! Settings of bridge search and planning.

use serde::{Deserialize, Serialize};

use crate::learn::{Auto, OutOfRange};

/// Automatic share of excursions while there is anything left to try ...
pub(crate) const FRONTIER_SHARE: f32 = 0.5;

/// ... and afterwards, as a door may open at any time.
pub(crate) const EXPLORED_SHARE: f32 = 0.05;

/// Maximum number of candidates, in target numbers, where trajectories verify edges ...
pub(crate) const MAX_FACTOR: usize = 8;

/// ... and where any two close ones are joined by an edge.
pub(crate) const MAX_UNVERIFIED_FACTOR: usize = 3;

/// How agents plan on the learned distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planner {
    /// No planning: the actor heads straight for the goal.
    None,
    /// Bridge points: searched during exploration, planned through at execution.
    Bridges,
    /// Search on the replay buffer (Eysenbach et al. 2019): unverified edges, one plan.
    Sorb,
}

impl Planner {
    /// All planners.
    pub const ALL: [Self; 3] = [Self::None, Self::Bridges, Self::Sorb];

    /// Returns its name on the command line and in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Bridges => "bridges",
            Self::Sorb => "sorb",
        }
    }

    /// Returns a short description.
    pub fn about(self) -> &'static str {
        match self {
            Self::None => "the actor heads straight for the goal",
            Self::Bridges => "explores and plans through bridge points",
            Self::Sorb => "unverified edges, one plan per episode",
        }
    }
}

/// Settings of bridge candidates, edges, search and planning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BridgeSettings {
    /// Target number of bridge candidates. Between thin walls, on large maps and where many walks
    /// between them fail, there are up to eight times as many (three times without `verify_edges`).
    pub candidates: usize,
    /// Minimum distance between candidates, in goal radii; it grows when there would be too many.
    pub candidate_spacing: f32,
    /// An edge needs D below this, in steps.
    pub edge_cutoff_steps: f32,
    /// Overhead of passing a waypoint, in steps beyond D to it and D from it: D ends a goal radius
    /// before its goal, short of where the next hop starts.
    pub hop_steps: f32,
    /// Whether an edge also needs a stored trajectory from one end to the other in about D steps.
    pub verify_edges: bool,
    /// Whether a pair that trajectories connect is kept as a costly edge if D is above the cut-off.
    pub keep_observed_edges: bool,
    /// Updates between rebuilds of the bridge graph.
    pub graph_every_updates: u64,
    /// Whether a waypoint not reached in time is banned temporarily.
    pub progress_check: bool,
    /// A waypoint is late after this many times D ...
    pub late_factor: f32,
    /// ... plus this many steps.
    pub late_slack_steps: f32,
    /// Steps for which a late waypoint is banned, times the number of complete runs of
    /// `BAN_STRIKES` late ones in a row (at least 1).
    pub ban_steps: u32,
    /// Probability that an episode's first goal is a bridge point (Algorithm 1's epsilon; method
    /// gdg-bridge).
    pub bridge_epsilon: f32,
    /// Candidates that one bridge search may try (Algorithm 2's number of searches).
    pub search_budget: usize,
    /// Whether to plan once and follow the plan to its end, instead of replanning at every
    /// waypoint.
    pub open_loop: bool,
    /// Probability that an agent walks to a new goal through the bridge graph, which trains the
    /// actor on the waypoints it will be given and confirms or demotes edges.
    pub planned_episodes: f32,
    /// Share of their steps that agents spend on exploring beyond the frontier of what has been
    /// visited. Automatic: high while there is anything left to try.
    pub frontier_epsilon: Auto<f32>,
    /// Whether planning and evaluation use the running averages of critics and actor.
    pub averaged_weights: bool,
    /// Whether agents that follow a plan choose their actions by one step of lookahead, D(f(s, a),
    /// g), over the actor's action and a fixed set of others.
    #[serde(default)]
    pub lookahead: bool,
}

impl Default for BridgeSettings {
    fn default() -> Self {
        Self {
            candidates: 1_200,
            candidate_spacing: 1.0,
            edge_cutoff_steps: 10.0,
            hop_steps: 0.5,
            verify_edges: true,
            keep_observed_edges: true,
            graph_every_updates: 1_000,
            progress_check: true,
            late_factor: 1.5,
            late_slack_steps: 6.0,
            ban_steps: 60,
            bridge_epsilon: 0.2,
            search_budget: 64,
            open_loop: false,
            planned_episodes: 0.7,
            frontier_epsilon: Auto::AUTO,
            averaged_weights: true,
            lookahead: true,
        }
    }
}

impl BridgeSettings {
    /// Returns the preset `paper`: edges from D alone, no progress check.
    pub fn paper() -> Self {
        Self {
            verify_edges: false,
            keep_observed_edges: false,
            progress_check: false,
            averaged_weights: false,
            lookahead: false,
            hop_steps: 0.0,
            planned_episodes: 0.0,
            frontier_epsilon: Auto::Given(0.0),
            candidates: 600,
            candidate_spacing: 2.0,
            ..Self::default()
        }
    }

    /// Returns the presets `tuned` and `sb3` of rivals: without excursions, which are no part of
    /// what they are compared for, and with a larger overhead of waypoints, as their distances are
    /// less exact.
    pub fn rivals() -> Self {
        Self { frontier_epsilon: Auto::Given(0.0), hop_steps: 1.0, ..Self::default() }
    }

    /// Returns the settings that plan on the same candidates as SoRB does (Eysenbach et al. 2019,
    /// algorithm 1 and section 3): edges wherever D is below the cut-off, one plan at the start.
    #[must_use]
    fn sorb(&self) -> Self {
        Self {
            verify_edges: false,
            keep_observed_edges: false,
            progress_check: false,
            open_loop: true,
            hop_steps: 0.0,
            planned_episodes: 0.0,
            bridge_epsilon: 0.0,
            lookahead: false,
            frontier_epsilon: Auto::Given(self.frontier_epsilon.given().unwrap_or(0.0)),
            ..self.clone()
        }
    }

    /// Returns the settings as `planner` uses them.
    #[must_use]
    pub fn for_planner(&self, planner: Planner) -> Self {
        match planner {
            Planner::Sorb => self.sorb(),
            Planner::None | Planner::Bridges => self.clone(),
        }
    }

    /// Whether bridge candidates are the same with these settings as with `other`: compares all
    /// that [`super::Candidates::new`] reads.
    pub(crate) fn makes_same_candidates(&self, other: &Self) -> bool {
        let read =
            |s: &Self| (s.candidates, s.candidate_spacing, s.edge_cutoff_steps, s.verify_edges);
        read(self) == read(other)
    }

    /// Returns the share of steps to spend on excursions beyond the frontier, given whether any
    /// action is left to try.
    pub fn frontier_share(&self, has_frontier: bool) -> f32 {
        self.frontier_epsilon.given().unwrap_or(if has_frontier {
            FRONTIER_SHARE
        } else {
            EXPLORED_SHARE
        })
    }

    /// Returns the maximum number of candidates.
    pub fn max_candidates(&self) -> usize {
        let factor = if self.verify_edges { MAX_FACTOR } else { MAX_UNVERIFIED_FACTOR };
        factor * self.candidates
    }

    /// Returns the steps after which a waypoint `distance` steps away by D is late.
    pub fn late_after(&self, distance: f32) -> f32 {
        self.late_factor * distance + self.late_slack_steps
    }

    /// Returns the number of steps within which a trajectory from one candidate to another is
    /// recorded.
    pub fn window_steps(&self) -> usize {
        (2.0 * self.edge_cutoff_steps).ceil() as usize
    }

    /// Checks every value's range.
    ///
    /// # Errors
    /// Returns the first setting that is out of range.
    pub fn validate(&self) -> Result<(), OutOfRange> {
        let within = |v: f32, from: f32, to: f32| (from..=to).contains(&v);
        let checks = [
            ("candidates", (2..=10_000).contains(&self.candidates)),
            ("candidate_spacing", within(self.candidate_spacing, 0.01, 1e6)),
            ("edge_cutoff_steps", within(self.edge_cutoff_steps, 1.0, 100.0)),
            ("hop_steps", within(self.hop_steps, 0.0, 100.0)),
            ("graph_every_updates", self.graph_every_updates > 0),
            ("late_factor", within(self.late_factor, 0.0, 100.0)),
            ("late_slack_steps", within(self.late_slack_steps, 1.0, 1e6)),
            ("bridge_epsilon", within(self.bridge_epsilon, 0.0, 1.0)),
            ("planned_episodes", within(self.planned_episodes, 0.0, 1.0)),
            (
                "frontier_epsilon",
                self.frontier_epsilon.given().is_none_or(|share| within(share, 0.0, 1.0)),
            ),
            ("search_budget", (1..=100_000).contains(&self.search_budget)),
        ];
        checks.iter().find(|(_, ok)| !ok).map_or(Ok(()), |(name, _)| Err(OutOfRange(name)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn excursions_are_frequent_while_there_is_a_frontier() {
        let automatic = BridgeSettings::default();
        assert!(automatic.frontier_share(true) > automatic.frontier_share(false));
        let given = BridgeSettings { frontier_epsilon: Auto::Given(0.2), ..automatic };
        assert_eq!([true, false].map(|has_frontier| given.frontier_share(has_frontier)), [0.2; 2]);
    }
}
