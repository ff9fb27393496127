//! The constants that the reference page lists.

use crate::learn::kernel;
use crate::train::{graphs, trainer};
use crate::{bridge, env, learn};

/// A number that is the same in every run.
pub struct Constant {
    /// Its name in the code.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its unit.
    pub unit: &'static str,
    /// Description.
    pub about: &'static str,
}

/// Returns the constants that decide how runs learn, plan and are evaluated.
pub fn constants() -> Vec<Constant> {
    [evaluation(), learning(), graph_paths(), recovery(), candidates(), edges_and_plans(), exploration()]
        .into_iter()
        .flatten()
        .collect()
}

fn evaluation() -> Vec<Constant> {
    vec![
        constant(
            "MIN_BUDGET_STEPS",
            env::MIN_BUDGET_STEPS,
            "steps",
            "least number of steps to solve an evaluation task",
        ),
        constant("BUDGET_FACTOR", env::BUDGET_FACTOR, "", "a task's steps as a multiple of its shortest path ..."),
        constant("MAX_BUDGET_STEPS", env::MAX_BUDGET_STEPS, "steps", "... and the most"),
        constant("NEAR_STEPS", env::NEAR_STEPS, "steps", "pairs up to this far apart count as near in errors of D"),
        constant(
            "LOSS_AVERAGE_UPDATES",
            trainer::LOSS_AVERAGE_UPDATES,
            "updates",
            "losses are reported as running means over this many",
        ),
    ]
}

fn learning() -> Vec<Constant> {
    vec![
        constant("BETA1", kernel::BETA.0, "", "Adam's decay of the gradient's mean"),
        constant("BETA2", kernel::BETA.1, "", "Adam's decay of the squared gradient's mean"),
        constant("EPSILON", learn::EPSILON, "", "Adam's addend to the denominator"),
        constant("EXCESS_WEIGHT", learn::EXCESS_WEIGHT, "", "weight of squared actor outputs beyond actor_bound"),
        constant(
            "MISPREDICTED_ERROR",
            learn::MISPREDICTED_ERROR,
            "",
            "squared error, in units of change, above which model_check doubts the model, but at least ...",
        ),
        constant(
            "MISPREDICTED_FACTOR",
            learn::MISPREDICTED_FACTOR,
            "",
            "... this multiple of the mean over the part of a batch that one task computes",
        ),
        constant(
            "BLOCKED_CHANGE",
            learn::BLOCKED_CHANGE,
            "",
            "unblock_actor helps actions that change the state by less than this share of a usual change",
        ),
        constant(
            "WAY_OUT_WEIGHT",
            learn::WAY_OUT_WEIGHT,
            "",
            "weight of the squared difference from the outputs that unblock_actor asks for, ...",
        ),
        constant("WAY_OUT_OUTPUT", learn::WAY_OUT_OUTPUT, "", "... this before tanh for a full step"),
        constant(
            "MIN_REMAINING",
            learn::MIN_REMAINING,
            "",
            "least discount^D that the learners with rewards tell apart from 0",
        ),
        constant(
            "MAX_NOISE_DEVIATIONS",
            learn::MAX_NOISE_DEVIATIONS,
            "",
            "target_noise is clipped at this many standard deviations",
        ),
        constant(
            "RELEARN_RECENT",
            learn::RELEARN_RECENT,
            "",
            "fraction of the dynamics model's transitions since the edit, during relearn_updates",
        ),
        constant(
            "STUCK_BOUND",
            learn::STUCK_BOUND,
            "",
            "actor_bound during relearn_updates where actions bring less than",
        ),
        constant("STUCK_PROGRESS_STEPS", learn::STUCK_PROGRESS_STEPS, "steps", "... this progress"),
        constant(
            "RELEARN_N_STEP",
            learn::RELEARN_N_STEP as f64,
            "steps",
            "least n_step during relearn_updates of methods without a bridge graph",
        ),
        constant(
            "CHANGED_GOALS",
            bridge::CHANGED_GOALS as f64,
            "candidates",
            "goals whose graph distances are compared with D during relearn_updates",
        ),
        constant("CHANGED_MARGIN", bridge::CHANGED_MARGIN, "", "factor above which D is too long or too short"),
        constant(
            "GROWN_FACTOR",
            bridge::GROWN_FACTOR,
            "",
            "a D too short is raised to this multiple of the graph's ...",
        ),
        constant("GROWN_SLACK_STEPS", bridge::GROWN_SLACK_STEPS, "steps", "... less this many steps"),
        constant("SHRUNK_SLACK_STEPS", bridge::SHRUNK_SLACK_STEPS, "steps", "a D too long exceeds the graph's by this"),
    ]
}

fn graph_paths() -> Vec<Constant> {
    vec![
        constant(
            "GRAPH_LOWER_FACTOR",
            learn::GRAPH_LOWER_FACTOR,
            "",
            "a graph distance bounds D from below by this multiple ...",
        ),
        constant("GRAPH_LOWER_SLACK_STEPS", learn::GRAPH_LOWER_SLACK_STEPS, "steps", "... less this many steps"),
        constant(
            "LEAST_BOUND_STEPS",
            learn::LEAST_BOUND_STEPS,
            "steps",
            "least length of the paths that graph_bounds bounds targets by, between their candidates",
        ),
        constant("LEAST_LED_STEPS", learn::LEAST_LED_STEPS, "steps", "the same for actor_waypoints"),
        constant(
            "WAYPOINT_STEPS",
            learn::WAYPOINT_STEPS,
            "steps",
            "least distance along the path of the waypoints of actor_waypoints",
        ),
        constant(
            "MAX_STEPS_BEFORE",
            learn::MAX_STEPS_BEFORE,
            "steps",
            "longest D from a state to the path that leads the actor there, ...",
        ),
        constant("MAX_STEPS_AFTER", learn::MAX_STEPS_AFTER, "steps", "... and from the path's end to the goal, or ..."),
        constant("MAX_SHARE_AFTER", learn::MAX_SHARE_AFTER, "", "... the same as a share of the path's length"),
        constant(
            "DISTILLED_PAIRS",
            graphs::DISTILLED_PAIRS as f64,
            "pairs",
            "pairs of candidates whose graph distances each graph distils, ...",
        ),
        constant(
            "DISTILLED_EDGES",
            graphs::DISTILLED_EDGES as f64,
            "edges",
            "... by following about this many edges ...",
        ),
        constant(
            "MAX_DISTILLED_GOALS",
            graphs::MAX_DISTILLED_GOALS as f64,
            "candidates",
            "... to at most this many goals ...",
        ),
        constant("MIN_DISTILLED_GOALS", graphs::MIN_DISTILLED_GOALS as f64, "candidates", "... and at least this many"),
    ]
}

fn recovery() -> Vec<Constant> {
    vec![
        constant(
            "KEEP_EVERY_UPDATES",
            trainer::KEEP_EVERY_UPDATES as f64,
            "updates",
            "interval between copies of the networks to roll back to",
        ),
        constant("MAX_RECOVERIES", trainer::MAX_RECOVERIES, "", "rollbacks before a diverging run stops"),
        constant(
            "LEARNING_RATE_FACTOR",
            trainer::LEARNING_RATE_FACTOR,
            "",
            "multiplier of the learning rates at each rollback",
        ),
    ]
}

fn candidates() -> Vec<Constant> {
    vec![
        constant(
            "MAX_SPACING_SHARE",
            bridge::MAX_SPACING_SHARE,
            "edge_cutoff_steps",
            "candidate spacing beyond which there may be more candidates",
        ),
        constant(
            "MANY_HOP_FAILURES",
            bridge::MANY_HOP_FAILURES,
            "failures per arrival",
            "failed walks between candidates above which these move closer together, and space does not count as open",
        ),
        constant(
            "MANY_PATHS",
            bridge::MANY_PATHS as f64,
            "candidates",
            "observed paths beyond which candidates move apart in open space, as a multiple of the setting",
        ),
        constant(
            "OPEN_SHARE",
            bridge::OPEN_SHARE,
            "",
            "space is open if known paths join this share of candidates that are close in a straight line",
        ),
        constant(
            "MAX_FACTOR",
            bridge::MAX_FACTOR as f64,
            "candidates",
            "maximum number of candidates, as a multiple of the setting",
        ),
        constant(
            "MAX_UNVERIFIED_FACTOR",
            bridge::MAX_UNVERIFIED_FACTOR as f64,
            "candidates",
            "the same without verify_edges",
        ),
        constant(
            "NEWCOMER_FACTOR",
            bridge::NEWCOMER_FACTOR,
            "spacings",
            "at the maximum number, distance from all candidates at which a place becomes one and others retire for it",
        ),
        constant(
            "MIN_SPACING_RADII",
            bridge::MIN_SPACING_RADII,
            "goal radii",
            "distance that candidates keep from each other even where walls separate them",
        ),
        constant(
            "WELL_KNOWN_PATHS",
            bridge::WELL_KNOWN_PATHS as f64,
            "paths",
            "observed paths from a candidate that make a missing path evidence of a wall",
        ),
        constant(
            "DETOUR_FACTOR",
            bridge::DETOUR_FACTOR,
            "",
            "a path goes round a wall if it takes more than this multiple of the straight line ...",
        ),
        constant("DETOUR_SLACK_STEPS", bridge::DETOUR_SLACK_STEPS, "steps", "... plus this many steps"),
    ]
}

fn edges_and_plans() -> Vec<Constant> {
    vec![
        constant(
            "OBSERVED_FACTOR",
            bridge::OBSERVED_FACTOR,
            "D",
            "a trajectory verifies an edge within this multiple of D ...",
        ),
        constant("OBSERVED_SLACK_STEPS", bridge::OBSERVED_SLACK_STEPS, "steps", "... plus this many steps"),
        constant(
            "OBSERVED_PENALTY_STEPS",
            bridge::OBSERVED_PENALTY_STEPS,
            "steps",
            "added to the cost of an edge of keep_observed_edges",
        ),
        constant(
            "REVERSED_PENALTY_STEPS",
            bridge::REVERSED_PENALTY_STEPS,
            "steps",
            "the same if they connect them in the other direction alone",
        ),
        constant(
            "HOP_FORGETTING",
            bridge::HOP_FORGETTING,
            "",
            "weight of a hop's outcome after each later hop of its length",
        ),
        constant(
            "DEMOTED_FACTOR",
            bridge::DEMOTED_FACTOR,
            "",
            "cost multiplier of an edge on which two walks in a row failed",
        ),
        constant(
            "MIN_GAIN_STEPS",
            learn::MIN_GAIN_STEPS,
            "steps",
            "steps by which an action of lookahead must be better than the actor's",
        ),
        constant(
            "LINK_CANDIDATES",
            bridge::LINK_CANDIDATES as f64,
            "candidates",
            "nearest candidates considered for first and last links",
        ),
        constant(
            "UNVERIFIED_FACTOR",
            bridge::UNVERIFIED_FACTOR,
            "D",
            "cost of a first or last link that no trajectory verifies, where there is no other",
        ),
        constant(
            "MAX_STRIKES",
            bridge::MAX_STRIKES,
            "waypoints",
            "late waypoints in a row after which a walk takes the shortest hop",
        ),
        constant(
            "BAN_STRIKES",
            bridge::BAN_STRIKES,
            "waypoints",
            "late waypoints in a row by which ban_steps lasts as long again",
        ),
        constant(
            "ACTIVATION_DIVISOR",
            graphs::ACTIVATION_DIVISOR as f64,
            "",
            "a graph takes effect after graph_every_updates divided by this",
        ),
        constant(
            "EDIT_ACTIVATION_DIVISOR",
            graphs::EDIT_ACTIVATION_DIVISOR as f64,
            "",
            "the same for the graph that is built after an edit",
        ),
    ]
}

fn exploration() -> Vec<Constant> {
    vec![
        constant(
            "FRONTIER_SHARE",
            bridge::FRONTIER_SHARE,
            "",
            "automatic frontier_epsilon while there is anything left to try ...",
        ),
        constant("EXPLORED_SHARE", bridge::EXPLORED_SHARE, "", "... and afterwards"),
        constant(
            "SHARE_ROUNDS",
            f64::from(bridge::SHARE_ROUNDS),
            "steps",
            "recent steps of each agent that frontier_epsilon is a share of",
        ),
        constant(
            "EXCURSION_STEPS",
            bridge::EXCURSION_STEPS,
            "steps",
            "an excursion ends this long after it last found something new",
        ),
        constant("RANDOM_SHARE", bridge::RANDOM_SHARE, "", "fraction of random actions on an excursion"),
        constant("HELD_STEPS", bridge::HELD_STEPS, "steps", "steps for which an excursion attempts an action at most"),
        constant(
            "MIN_STRIDE",
            bridge::MIN_STRIDE,
            "",
            "least length of an excursion's step, as a fraction of a full one",
        ),
        constant(
            "MIN_ATTEMPTS",
            f64::from(bridge::MIN_ATTEMPTS),
            "",
            "failed attempts in a row after which an action leads nowhere ...",
        ),
        constant("MAX_ATTEMPTS", f64::from(bridge::MAX_ATTEMPTS), "", "... and as long as nothing else is left to try"),
        constant("MAX_PLACES", bridge::MAX_PLACES as f64, "", "maximum number of places that excursions tell apart"),
        constant(
            "GIVE_UP_FACTOR",
            crate::train::rollout::GIVE_UP_FACTOR,
            "",
            "an agent gives up on a goal after this multiple of D ...",
        ),
        constant(
            "GIVE_UP_SLACK_STEPS",
            crate::train::rollout::GIVE_UP_SLACK_STEPS,
            "steps",
            "... plus this many steps",
        ),
        constant(
            "EPISODE_FACTOR",
            super::EPISODE_FACTOR,
            "",
            "automatic episode_steps as a multiple of the longest distance in the bridge graph ...",
        ),
        constant("MIN_EPISODE_STEPS", super::MIN_EPISODE_STEPS, "steps", "... and at least"),
    ]
}

fn constant(name: &'static str, value: impl Into<f64>, unit: &'static str, about: &'static str) -> Constant {
    Constant { name, value: value.into(), unit, about }
}
