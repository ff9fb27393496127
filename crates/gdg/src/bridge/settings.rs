//! Settings of bridge search and planning.

use crate::env::Spec;
use crate::settings::Preset::{Paper, Sb3, Tuned};
use crate::settings::{Auto, Values, settings, without};

/// Automatic share of excursions while there is anything left to try.
pub(crate) const FRONTIER_SHARE: f32 = 0.5;

/// The same where the achieved goal seldom moves: goals teach nothing there.
pub(crate) const SEEK_SHARE: f32 = 0.8;

/// Automatic share of excursions afterwards, as a door may open at any time.
pub(crate) const EXPLORED_SHARE: f32 = 0.05;

/// Maximum number of candidates, in target numbers, where trajectories verify edges.
pub(crate) const MAX_FACTOR: usize = 8;

/// The same where any two close candidates are joined by an edge.
pub(crate) const MAX_UNVERIFIED_FACTOR: usize = 3;

/// Maximum number of edges from a candidate where trajectories verify them, the nearest ones.
/// Shorter paths make up longer ones: more edges cost time and bring little.
pub(crate) const EDGES_PER_CANDIDATE: usize = 24;

/// Maximum number of candidates that one bridge search tries (Algorithm 2).
pub const SEARCH_BUDGET: usize = 64;

/// A waypoint is late after this many times D, plus this many steps.
pub(super) const LATE_FACTOR: f32 = 1.5;
pub(super) const LATE_SLACK_STEPS: f32 = 6.0;

pub(super) const BAN_STEPS: u32 = 60;

/// The automatic overhead of a waypoint is the steps that a goal radius takes, as D to it ends there,
/// less this, as paths between candidates begin and end near them.
const HOP_SAVED_STEPS: f32 = 0.6;

/// Least automatic overhead of a waypoint.
const LEAST_HOP_STEPS: f32 = 0.4;

/// Largest automatic overhead of a waypoint, as a share of the longest edge.
const MOST_HOP_SHARE: f32 = 0.5;

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
    pub const ALL: [Self; 3] = [Self::None, Self::Bridges, Self::Sorb];

    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Bridges => "bridges",
            Self::Sorb => "sorb",
        }
    }

    pub fn about(self) -> &'static str {
        match self {
            Self::None => "the actor heads straight for the goal",
            Self::Bridges => "explores and plans through bridge points",
            Self::Sorb => "unverified edges, one plan per episode",
        }
    }
}

settings! {
    pub struct BridgeSettings {
        exploration {
            /// Method gdg-bridge only.
            bridge_epsilon: f32 = 0.2;
                "probability that an episode that begins without an excursion has a bridge point \
                 as its first goal (Algorithm 1's epsilon)",
                values: Values::PROBABILITY,
                ablation: without("no bridge goals in exploration", "0");
            /// It trains the actor on the waypoints it will be given, and confirms or demotes edges.
            planned_episodes: f32 = 0.7, Paper => 0.0;
                "probability that an agent walks to a new goal through the bridge graph",
                values: Values::PROBABILITY,
                ablation: without("no plans in exploration", "0");
            /// The comparison with rivals leaves out excursions.
            frontier_epsilon: Auto<f32> = Auto::AUTO, Paper | Tuned | Sb3 => Auto::Given(0.0);
                "share of their steps that agents spend on exploring beyond the frontier; auto: \
                 0.8 where what has to be achieved seldom moves, 0.5 while there is anything left to \
                 try, 0.05 afterwards",
                values: Values::measure("a share", 0.0, 1.0).or_auto(),
                ablation: without("no excursions", "0");
        }
        bridges {
            candidates: usize = 1_200, Paper => 600;
                "target number of bridge candidates; up to eight times as many between thin walls, \
                 on large maps and where many walks between them fail (three times without \
                 verify_edges)",
                values: Values::count(2, 10_000);
            candidate_spacing: f32 = 1.0, Paper => 2.0;
                "minimum distance between candidates; grows if there would be too many, and \
                 shrinks if many walks between them fail",
                values: Values::number(0.01, 1e6), unit: "goal radii";
            edge_cutoff_steps: f32 = 10.0;
                "maximum D of an edge",
                values: Values::steps(1.0, 100.0), unit: "steps";
            verify_edges: bool = true, Paper => false;
                "require a stored trajectory along an edge in about D steps",
                ablation: without("unverified edges", "false");
            keep_observed_edges: bool = true, Paper => false;
                "keep pairs connected by trajectories as costly edges if D is above the cut-off",
                ablation: without("no edges from trajectories alone", "false");
            graph_every_updates: u64 = 1_000;
                "updates between builds of the bridge graph",
                values: Values::count(1, u64::MAX), unit: "updates";
        }
        planning {
            /// D ends a goal radius before its goal, short of where the next hop starts. Distances
            /// of the rivals are less exact.
            hop_steps: Auto<f32> = Auto::AUTO, Paper => Auto::Given(0.0),
                Tuned | Sb3 => Auto::Given(1.0);
                "overhead of passing a waypoint, in steps beyond D to it and D from it; auto: the \
                 steps that a goal radius takes, less 0.6, from 0.4 to half of edge_cutoff_steps",
                values: Values::steps(0.0, 100.0).or_auto(), unit: "steps",
                ablation: without("waypoints cost a step", "1");
            open_loop: bool = false;
                "plan once and follow the plan to its end";
            progress_check: bool = true, Paper => false;
                "temporarily ban a waypoint that was not reached in time",
                ablation: without("no progress check", "false");
            averaged_weights: bool = true, Paper | Sb3 => false;
                "plan and evaluate with the averaged critics and actor",
                ablation: without("current weights, no averages", "false");
            lookahead: bool = true, Paper => false;
                "agents that follow a plan take the action a with the smallest D(f(s, a), \
                 waypoint), of the actor's and a fixed set",
                ablation: without("no lookahead", "false");
        }
    }
}

impl BridgeSettings {
    #[must_use]
    pub(crate) fn for_planner(&self, planner: Planner) -> Self {
        match planner {
            Planner::None | Planner::Bridges => self.clone(),
            // Plans on the same candidates as SoRB does (Eysenbach et al. 2019, algorithm 1 and
            // section 3): edges wherever D is below the cut-off, one plan at the start.
            Planner::Sorb => Self {
                verify_edges: false,
                keep_observed_edges: false,
                progress_check: false,
                open_loop: true,
                hop_steps: Auto::Given(0.0),
                planned_episodes: 0.0,
                bridge_epsilon: 0.0,
                lookahead: false,
                frontier_epsilon: Auto::Given(self.frontier_epsilon.given().unwrap_or(0.0)),
                ..self.clone()
            },
        }
    }

    /// Returns the overhead of passing a waypoint in a world of `spec`, in steps.
    pub fn hop_steps_in(&self, spec: &Spec) -> f32 {
        let radius_steps = spec.goal_radius / spec.largest_change();
        let most = (MOST_HOP_SHARE * self.edge_cutoff_steps).max(LEAST_HOP_STEPS);
        let automatic = (radius_steps - HOP_SAVED_STEPS).clamp(LEAST_HOP_STEPS, most);
        self.hop_steps.given().unwrap_or(automatic)
    }

    pub fn max_candidates(&self) -> usize {
        let factor = if self.verify_edges { MAX_FACTOR } else { MAX_UNVERIFIED_FACTOR };
        factor * self.candidates
    }

    /// Returns the number of steps within which a trajectory from one candidate to another is
    /// recorded.
    pub fn window_steps(&self) -> usize {
        (2.0 * self.edge_cutoff_steps).ceil() as usize
    }
}

pub(super) fn late_after(distance: f32) -> f32 {
    LATE_FACTOR * distance + LATE_SLACK_STEPS
}
