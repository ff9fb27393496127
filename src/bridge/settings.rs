//! What can be set about bridges.

use serde::{Deserialize, Serialize};

/// What walks through the learned distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Planner {
    /// Nothing: the actor goes straight for the goal.
    None,
    /// Bridge points: searched in exploration, planned through at execution.
    Bridges,
    /// Search on the replay buffer (Eysenbach et al. 2019): unverified edges, one plan.
    Sorb,
}

impl Planner {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::None, Self::Bridges, Self::Sorb];

    /// Its name on the command line and in records.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Bridges => "bridges",
            Self::Sorb => "sorb",
        }
    }

    /// What it does, in a few words.
    pub fn about(self) -> &'static str {
        match self {
            Self::None => "straight for the goal",
            Self::Bridges => "explores and plans through bridge points",
            Self::Sorb => "unverified edges, waypoints planned once",
        }
    }
}

/// Settings of bridge candidates, edges, search and planning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BridgeSettings {
    /// Bridge candidates wanted. Where they would lie too far apart for edges there are more, up to three times as
    /// many.
    pub candidates: usize,
    /// Candidates keep at least this distance, in goal radii; it grows when there would be too many.
    pub candidate_spacing: f32,
    /// An edge needs D below this, in steps.
    pub edge_cutoff_steps: f32,
    /// Steps that a way through a waypoint takes beyond D to it and D from it: D ends a goal radius before its goal,
    /// where the way on does not begin.
    pub hop_steps: f32,
    /// Whether an edge also needs a stored trajectory that went from one end to the other in about D steps.
    pub verify_edges: bool,
    /// Whether a pair that trajectories join is kept as a costly edge where D is above the cut-off.
    pub keep_observed_edges: bool,
    /// Updates between two rebuilds of the bridge graph.
    pub graph_every_updates: u64,
    /// Whether a waypoint not reached in time is banned for a while.
    pub progress_check: bool,
    /// A waypoint is late after this many times D ...
    pub late_factor: f32,
    /// ... plus this many steps.
    pub late_slack_steps: f32,
    /// Steps for which a late waypoint is banned.
    pub ban_steps: u32,
    /// Probability that an episode's first goal is a bridge point (Algorithm 1's epsilon; method gdg-bridge).
    pub bridge_epsilon: f32,
    /// Candidates that one bridge search may try (Algorithm 2's number of searches).
    pub search_budget: usize,
    /// Whether a plan is made once and followed to its end, instead of anew at every waypoint.
    pub open_loop: bool,
    /// Probability that an episode is walked through the bridge graph, so that the actor is trained on the waypoints
    /// it will be given and edges are confirmed or demoted by practice.
    pub planned_episodes: f32,
    /// Probability that an episode's first goal is at the frontier: a candidate that few edges leave.
    pub frontier_epsilon: f32,
    /// Whether planning and evaluation use the running averages of critics and actor.
    pub averaged_weights: bool,
}

impl Default for BridgeSettings {
    fn default() -> Self {
        Self {
            candidates: 600,
            candidate_spacing: 2.0,
            edge_cutoff_steps: 10.0,
            hop_steps: 1.0,
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
            planned_episodes: 0.3,
            frontier_epsilon: 0.0,
            averaged_weights: true,
        }
    }
}

impl BridgeSettings {
    /// The preset `paper`: edges from D alone, no progress check.
    pub fn paper() -> Self {
        Self {
            verify_edges: false,
            keep_observed_edges: false,
            progress_check: false,
            averaged_weights: false,
            hop_steps: 0.0,
            planned_episodes: 0.0,
            ..Self::default()
        }
    }

    /// The same candidates planned on as SoRB does (Eysenbach et al. 2019, algorithm 1 and section 3): edges wherever D
    /// is below the cut-off, one plan at the beginning.
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
            ..self.clone()
        }
    }

    /// The settings as `planner` uses them.
    #[must_use]
    pub fn of(&self, planner: Planner) -> Self {
        match planner {
            Planner::Sorb => self.sorb(),
            Planner::None | Planner::Bridges => self.clone(),
        }
    }

    /// The most candidates there may be, on large maps.
    pub fn most_candidates(&self) -> usize {
        3 * self.candidates
    }

    /// Steps within which a trajectory's way from one candidate to another is remembered.
    pub fn window_steps(&self) -> usize {
        (2.0 * self.edge_cutoff_steps).ceil() as usize
    }

    /// Checks every value's range.
    ///
    /// # Errors
    /// The name of the first setting out of range, and what would be right.
    pub fn check(&self) -> Result<(), (&'static str, &'static str)> {
        let within = |v: f32, from: f32, to: f32| (from..=to).contains(&v);
        let checks = [
            ("candidates", (2..=10_000).contains(&self.candidates), "a whole number from 2 to 10000"),
            ("candidate_spacing", within(self.candidate_spacing, 0.01, 1e6), "a number of at least 0.01"),
            ("edge_cutoff_steps", within(self.edge_cutoff_steps, 1.0, 100.0), "a number of steps from 1 to 100"),
            ("hop_steps", within(self.hop_steps, 0.0, 100.0), "a number of steps from 0 to 100"),
            ("graph_every_updates", self.graph_every_updates > 0, "a whole number of at least 1"),
            ("late_factor", within(self.late_factor, 0.0, 100.0), "a number from 0 to 100"),
            ("late_slack_steps", within(self.late_slack_steps, 1.0, 1e6), "a number of steps of at least 1"),
            ("bridge_epsilon", within(self.bridge_epsilon, 0.0, 1.0), "a probability from 0 to 1"),
            ("planned_episodes", within(self.planned_episodes, 0.0, 1.0), "a probability from 0 to 1"),
            ("frontier_epsilon", within(self.frontier_epsilon, 0.0, 1.0), "a probability from 0 to 1"),
            ("search_budget", (1..=100_000).contains(&self.search_budget), "a whole number from 1 to 100000"),
        ];
        checks.iter().find(|(_, ok, _)| !ok).map_or(Ok(()), |(name, _, right)| Err((*name, *right)))
    }
}
