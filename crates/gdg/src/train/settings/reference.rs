//! The reference of all settings: meaning, unit, range and the effect of a change. Errors, the
//! settings dialog, `--print-config` and the reference page use it.

use super::Effect;

/// A group of related settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// The networks and their inputs.
    Networks,
    /// The critics' targets.
    Targets,
    /// Composition of a batch.
    Batches,
    /// Step sizes, update schedule and backend.
    Optimiser,
    /// Agents, episodes and the world.
    Agents,
    /// How agents explore.
    Exploration,
    /// Bridge candidates and the edges between them.
    Bridges,
    /// Execution of plans.
    Planning,
}

impl Group {
    /// All groups, in the order in which settings are listed.
    pub const ALL: [Self; 8] = [
        Self::Networks,
        Self::Targets,
        Self::Batches,
        Self::Optimiser,
        Self::Agents,
        Self::Exploration,
        Self::Bridges,
        Self::Planning,
    ];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Networks => "networks",
            Self::Targets => "targets",
            Self::Batches => "batches",
            Self::Optimiser => "optimiser",
            Self::Agents => "agents",
            Self::Exploration => "exploration",
            Self::Bridges => "bridges",
            Self::Planning => "planning",
        }
    }
}

/// A setting.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Its name on the command line and in files.
    pub name: &'static str,
    /// The group it belongs to.
    pub group: Group,
    /// Description.
    pub about: &'static str,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// Its valid values.
    pub range: &'static str,
    /// Effect of a change during a run.
    pub effect: Effect,
    /// Its former name, which is still accepted.
    pub former: Option<&'static str>,
}

impl Setting {
    const fn new(
        group: Group,
        name: &'static str,
        unit: &'static str,
        range: &'static str,
        about: &'static str,
    ) -> Self {
        Self { name, group, about, unit, range, effect: Effect::Immediate, former: None }
    }

    const fn for_networks(self) -> Self {
        Self { effect: Effect::NewNetworks, ..self }
    }

    const fn for_agents(self) -> Self {
        Self { effect: Effect::NewAgents, ..self }
    }

    const fn formerly(self, name: &'static str) -> Self {
        Self { former: Some(name), ..self }
    }

    /// Returns the setting whose current or former name is `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        SETTINGS.iter().find(|setting| setting.name == name || setting.former == Some(name))
    }

    /// Whether it is a whole number (or, for some, a word).
    pub fn is_count(&self) -> bool {
        self.range.contains("an integer")
    }

    /// Whether it is either true or false.
    pub fn is_switch(&self) -> bool {
        self.range == SWITCH_VALUES
    }
}

use Group::{Agents, Batches, Bridges, Exploration, Networks, Optimiser, Planning, Targets};

/// What numbers in single precision can hold.
const POSITIVE_RANGE: &str = "a number from 1e-38 to 3e38";
const LONG_STEPS_RANGE: &str = "a number of steps from 1 to 1e6";
const SHARE_RANGE: &str = "a fraction from 0 to 1";
const PROBABILITY_RANGE: &str = "a probability from 0 to 1";
const SWITCH_VALUES: &str = "true or false";

/// All settings, group by group.
pub const SETTINGS: [Setting; 66] = [
    Setting::new(Networks, "hidden", "", "an integer from 1 to 4096", "width of each hidden layer").for_networks(),
    Setting::new(Networks, "layers", "", "an integer from 1 to 8", "hidden layers (ReLU)").for_networks(),
    Setting::new(Networks, "critics", "", "an integer, 1 or 2", "number of critics; pessimism combines them")
        .for_networks(),
    Setting::new(Networks, "distance_scale_steps", "steps", POSITIVE_RANGE, "D = scale * softplus(output)")
        .for_networks(),
    Setting::new(
        Networks,
        "fourier_octaves",
        "",
        "an integer from 0 to 12",
        "Fourier features sin, cos(pi 2^l u) of positions u, for l below this",
    )
    .for_networks(),
    Setting::new(
        Networks,
        "relative_scales",
        "goal radii",
        "up to 16 numbers from 0.01 to 1000000",
        "scales c of the relative inputs tanh((g - s) / c); [] for none",
    )
    .for_networks(),
    Setting::new(
        Networks,
        "grid_cells",
        "goal radii",
        "up to 16 numbers from 0.01 to 1000000",
        "cell sizes of the trainable grid encoding, for goals that are positions; [] for none",
    )
    .for_networks(),
    Setting::new(
        Networks,
        "grid_channels",
        "",
        "an integer from 1 to 32",
        "trainable features at each corner of each grid",
    )
    .for_networks(),
    Setting::new(
        Networks,
        "actor_bound",
        "",
        "a number from 0 to 100",
        "actions are tanh(z); |z| above this is penalised, as a saturated actor has no gradient; 0 for no bound",
    ),
    Setting::new(
        Networks,
        "actor_l2",
        "",
        "a number from 0 to 1000000",
        "weight of the mean of z squared in the actor's loss of ddpg, her and ddpg-distance",
    ),
    Setting::new(Targets, "n_step", "steps", "an integer from 1 to 1000", "n of the n-step return"),
    Setting::new(
        Targets,
        "pessimism",
        "",
        SHARE_RANGE,
        "weight of the larger distance of two critics in D; the rest is their mean",
    ),
    Setting::new(
        Targets,
        "expectile",
        "",
        "a number above 0 and below 1",
        "weight of errors where the target is below D, 1 minus it above; 0.5 is the squared error",
    ),
    Setting::new(
        Targets,
        "greedy_targets",
        "",
        SWITCH_VALUES,
        "cap targets at the actor's one-step lookahead, 1 + D'(f(s, mu'(s, g)), g)",
    ),
    Setting::new(
        Targets,
        "model_check",
        "",
        SWITCH_VALUES,
        "leave pairs out of greedy_targets whose own step the dynamics model mispredicts",
    ),
    Setting::new(
        Targets,
        "hindsight_bound",
        "",
        SWITCH_VALUES,
        "cap targets at the steps in which a trajectory reached the goal",
    ),
    Setting::new(
        Targets,
        "graph_bounds",
        "",
        SWITCH_VALUES,
        "cap targets of far pairs at the length of a path through the bridge graph",
    ),
    Setting::new(
        Targets,
        "actor_waypoints",
        "",
        SWITCH_VALUES,
        "lead the actor to far goals by the next waypoint on the path through the bridge graph",
    ),
    Setting::new(
        Targets,
        "unblock_actor",
        "",
        SWITCH_VALUES,
        "pull the actor towards what lookahead finds where its own action changes nothing",
    ),
    Setting::new(
        Targets,
        "max_distance_steps",
        "steps",
        "0, or a number up to 1e6",
        "upper bound of targets; 0 for none",
    ),
    Setting::new(
        Targets,
        "relearn_updates",
        "updates",
        "an integer, 0 or more",
        "updates after an edit during which distances that have changed are relearned",
    ),
    Setting::new(
        Targets,
        "discount",
        "",
        "a number from 0, below 1",
        "discount gamma of the learners with rewards: ddpg, her and ddpg-distance",
    )
    .for_networks(),
    Setting::new(
        Targets,
        "target_noise",
        "",
        "a number from 0 to 100",
        "standard deviation of the noise on the actions of targets of ddpg, her and ddpg-distance",
    ),
    Setting::new(Targets, "loss", "", "squared, sqrt or log", "scale on which the critic error is measured"),
    Setting::new(Targets, "tau", "", "a number above 0, at most 1", "Polyak factor of target networks and averages"),
    Setting::new(Batches, "batch_size", "pairs", "an integer from 1 to 65536", "pairs, and transitions, per batch")
        .formerly("batch"),
    Setting::new(
        Batches,
        "goal_hindsight",
        "",
        SHARE_RANGE,
        "fraction of goals relabelled in hindsight: states reached later in the episode",
    ),
    Setting::new(
        Batches,
        "goal_geometric",
        "",
        SHARE_RANGE,
        "fraction of hindsight goals a geometric number of steps ahead; the rest are uniform over the future",
    ),
    Setting::new(
        Batches,
        "goal_geometric_mean_steps",
        "steps",
        LONG_STEPS_RANGE,
        "mean of that geometric distribution",
    ),
    Setting::new(
        Batches,
        "goal_random",
        "",
        "a fraction from 0 to 1, at most 1 together with goal_hindsight",
        "fraction of goals that are random states of the replay buffer; the rest are the goals pursued",
    ),
    Setting::new(
        Batches,
        "distillation",
        "",
        SHARE_RANGE,
        "fraction of pairs that are bridge candidates, whose distance in the graph bounds the target",
    ),
    Setting::new(
        Batches,
        "buffer_size",
        "transitions",
        "an integer from 1000 to 100000000, with room for an episode of every agent",
        "capacity of the replay buffer",
    )
    .for_agents()
    .formerly("replay_capacity"),
    Setting::new(Optimiser, "learning_rate", "", POSITIVE_RANGE, "Adam's learning rate for the networks"),
    Setting::new(Optimiser, "grid_learning_rate", "", POSITIVE_RANGE, "Adam's learning rate for the grid encoding"),
    Setting::new(
        Optimiser,
        "env_steps_per_update",
        "steps",
        "an integer from 1 to 1000000",
        "environment steps, summed over all agents, per update",
    ),
    Setting::new(
        Optimiser,
        "update_when",
        "",
        "step or episode-end",
        "run updates as soon as they are due or, as in Algorithm 1, after each episode",
    ),
    Setting::new(
        Optimiser,
        "learning_starts",
        "steps",
        "an integer from 0 to 100000000",
        "environment steps before the first update",
    )
    .formerly("warmup_env_steps"),
    Setting::new(
        Optimiser,
        "backend",
        "",
        "fused or tape",
        "implementation of updates: hand-written kernels, or candle's tape",
    )
    .for_networks(),
    Setting::new(Agents, "agents", "", "an integer from 1 to 4096", "agents exploring in parallel").for_agents(),
    Setting::new(
        Agents,
        "episode_steps",
        "steps",
        "auto, or an integer from 1 to 60000",
        "steps per episode; auto: three times the longest distance in the bridge graph, and at least 150",
    ),
    Setting::new(
        Agents,
        "restart",
        "",
        "auto, anywhere, start-cell or never",
        "start of an episode: anywhere, the map's start S, or where the last one ended; auto: never if there is an S",
    )
    .for_agents(),
    Setting::new(
        Agents,
        "near_goals",
        "",
        PROBABILITY_RANGE,
        "probability that an agent's goal is where a short straight walk from its place ends",
    ),
    Setting::new(Agents, "near_goal_steps", "steps", "an integer from 1 to 10000", "longest of these walks"),
    Setting::new(
        Agents,
        "new_goal_when_reached",
        "",
        SWITCH_VALUES,
        "give an agent that reaches its goal, or gives up on it, a new one within the episode",
    ),
    Setting::new(
        Agents,
        "env_noise",
        "",
        "a number from 0 to 100",
        "standard deviation of the noise added to every action by the environment",
    ),
    Setting::new(
        Exploration,
        "random_actions",
        "",
        SHARE_RANGE,
        "fraction of steps in a random direction instead of the actor's",
    ),
    Setting::new(
        Exploration,
        "random_hold_steps",
        "steps",
        LONG_STEPS_RANGE,
        "mean number of steps for which a random direction is held",
    ),
    Setting::new(
        Exploration,
        "exploration_noise",
        "",
        "a number from 0 to 100",
        "standard deviation of the Gaussian noise on the actor's actions",
    )
    .formerly("action_noise"),
    Setting::new(
        Exploration,
        "bridge_epsilon",
        "",
        PROBABILITY_RANGE,
        "probability that an episode that begins without an excursion has a bridge point as its first goal (Algorithm 1's epsilon)",
    ),
    Setting::new(
        Exploration,
        "search_budget",
        "candidates",
        "an integer from 1 to 100000",
        "maximum number of candidates that one bridge search tries (Algorithm 2)",
    ),
    Setting::new(
        Exploration,
        "planned_episodes",
        "",
        PROBABILITY_RANGE,
        "probability that an agent walks to a new goal through the bridge graph",
    ),
    Setting::new(
        Exploration,
        "frontier_epsilon",
        "",
        "auto, or a share from 0 to 1",
        "share of their steps that agents spend on exploring beyond the frontier; auto: 0.5 while there is anything left to try, 0.05 afterwards",
    ),
    Setting::new(
        Bridges,
        "candidates",
        "",
        "an integer from 2 to 10000",
        "target number of bridge candidates; up to eight times as many between thin walls, on large maps and where many walks between them fail (three times without verify_edges)",
    ),
    Setting::new(
        Bridges,
        "candidate_spacing",
        "goal radii",
        "a number from 0.01 to 1000000",
        "minimum distance between candidates; grows if there would be too many, and shrinks if many walks between them fail",
    ),
    Setting::new(Bridges, "edge_cutoff_steps", "steps", "a number of steps from 1 to 100", "maximum D of an edge"),
    Setting::new(
        Bridges,
        "verify_edges",
        "",
        SWITCH_VALUES,
        "require a stored trajectory along an edge in about D steps",
    ),
    Setting::new(
        Bridges,
        "keep_observed_edges",
        "",
        SWITCH_VALUES,
        "keep pairs connected by trajectories as costly edges if D is above the cut-off",
    ),
    Setting::new(
        Bridges,
        "graph_every_updates",
        "updates",
        "an integer, at least 1",
        "updates between builds of the bridge graph",
    ),
    Setting::new(
        Planning,
        "hop_steps",
        "steps",
        "a number of steps from 0 to 100",
        "overhead of passing a waypoint, in steps beyond D to it and D from it",
    ),
    Setting::new(Planning, "open_loop", "", SWITCH_VALUES, "plan once and follow the plan to its end"),
    Setting::new(
        Planning,
        "progress_check",
        "",
        SWITCH_VALUES,
        "temporarily ban a waypoint that was not reached in time",
    ),
    Setting::new(
        Planning,
        "late_factor",
        "",
        "a number from 0 to 100",
        "a waypoint is late after this many times D, plus late_slack_steps",
    ),
    Setting::new(Planning, "late_slack_steps", "steps", LONG_STEPS_RANGE, "see late_factor"),
    Setting::new(
        Planning,
        "ban_steps",
        "steps",
        "an integer from 0 to 4294967295",
        "steps for which a late waypoint is banned; more if the agent is stuck",
    ),
    Setting::new(
        Planning,
        "averaged_weights",
        "",
        SWITCH_VALUES,
        "plan and evaluate with the averaged critics and actor",
    ),
    Setting::new(
        Planning,
        "lookahead",
        "",
        SWITCH_VALUES,
        "agents that follow a plan take the action a with the smallest D(f(s, a), waypoint), of the actor's and a fixed set",
    ),
];
