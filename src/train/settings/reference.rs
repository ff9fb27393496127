//! The reference of all settings: meaning, unit, range and the effect of a change. Errors, the settings dialog,
//! `--print-config` and the reference page use it.

use super::{Effect, Settings};
use crate::train::config::list_settings;
use crate::train::method::Preset;

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
    /// What it does.
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
}

use Group::{Agents, Batches, Bridges, Exploration, Networks, Optimiser, Planning, Targets};

const SHARE_RANGE: &str = "a share from 0 to 1";
const PROBABILITY_RANGE: &str = "a probability from 0 to 1";
const SWITCH_VALUES: &str = "true or false";

/// All settings, group by group.
pub const SETTINGS: [Setting; 54] = [
    Setting::new(Networks, "hidden", "", "a whole number from 1 to 4096", "width of each hidden layer").for_networks(),
    Setting::new(Networks, "layers", "", "a whole number from 1 to 8", "hidden layers (ReLU)").for_networks(),
    Setting::new(Networks, "critics", "", "1 or 2", "critics; their maximum counts: pessimism about short cuts")
        .for_networks(),
    Setting::new(Networks, "distance_scale_steps", "steps", "a number above 0", "D = scale * softplus(output)")
        .for_networks(),
    Setting::new(
        Networks,
        "fourier_octaves",
        "",
        "a whole number from 0 to 12",
        "Fourier features sin, cos(pi 2^l u) of positions, for l below this",
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
        "a whole number from 1 to 32",
        "trainable numbers at each corner of each grid",
    )
    .for_networks(),
    Setting::new(
        Networks,
        "actor_bound",
        "",
        "a number from 0 to 100",
        "actions are tanh(z); a z beyond this either way is pulled back, as a saturated actor has no gradient; 0 for no bound",
    ),
    Setting::new(Targets, "n_step", "steps", "a whole number from 1 to 1000", "steps before a target bootstraps"),
    Setting::new(
        Targets,
        "expectile",
        "",
        "a number above 0 and below 1",
        "weight of errors where the target lies below D, 1 minus it where above; 0.5 for the plain square",
    ),
    Setting::new(
        Targets,
        "greedy_targets",
        "",
        SWITCH_VALUES,
        "bound targets by a step of the actor and what follows, 1 + D'(f(s, mu'(s, g)), g)",
    ),
    Setting::new(
        Targets,
        "hindsight_bound",
        "",
        SWITCH_VALUES,
        "bound targets by the steps in which a trajectory reached the goal",
    ),
    Setting::new(
        Targets,
        "relearn_updates",
        "updates",
        "a whole number, 0 or more",
        "after walls went up: updates during which targets follow behaviour alone",
    ),
    Setting::new(Targets, "loss", "", "squared, sqrt or log", "scale on which a critic's error is measured"),
    Setting::new(Targets, "tau", "", "a number above 0, at most 1", "Polyak factor of target networks and averages"),
    Setting::new(
        Batches,
        "batch_size",
        "pairs",
        "a whole number from 1 to 65536",
        "pairs, and transitions, in a batch",
    )
    .formerly("batch"),
    Setting::new(
        Batches,
        "goal_hindsight",
        "",
        SHARE_RANGE,
        "share of goals that are states reached later in the same episode",
    ),
    Setting::new(
        Batches,
        "goal_geometric",
        "",
        SHARE_RANGE,
        "share of hindsight goals a geometric number of steps ahead; the rest are uniform in the future",
    ),
    Setting::new(
        Batches,
        "goal_geometric_mean_steps",
        "steps",
        "a number of steps, at least 1",
        "mean of that geometric number",
    ),
    Setting::new(
        Batches,
        "goal_random",
        "",
        "a share from 0 to 1, and at most 1 together with goal_hindsight",
        "share of goals that are random states of the replay; the rest are those really pursued",
    ),
    Setting::new(
        Batches,
        "distillation",
        "",
        SHARE_RANGE,
        "share of pairs that are bridge candidates with their graph distance as the target",
    ),
    Setting::new(
        Batches,
        "buffer_size",
        "transitions",
        "a whole number from 1000 to 100000000, with room for an episode of every agent",
        "transitions kept for replay",
    )
    .for_agents()
    .formerly("replay_capacity"),
    Setting::new(Optimiser, "learning_rate", "", "a number above 0", "Adam's step size for the networks"),
    Setting::new(Optimiser, "grid_learning_rate", "", "a number above 0", "Adam's step size for the grid encoding"),
    Setting::new(
        Optimiser,
        "env_steps_per_update",
        "steps",
        "a whole number of at least 1",
        "environment steps, of all agents together, for each update",
    ),
    Setting::new(
        Optimiser,
        "update_when",
        "",
        "step or episode-end",
        "whether updates are done as soon as they are due or, as in Algorithm 1, after each episode",
    ),
    Setting::new(
        Optimiser,
        "learning_starts",
        "steps",
        "a whole number, 0 or more",
        "environment steps before the first update",
    )
    .formerly("warmup_env_steps"),
    Setting::new(
        Optimiser,
        "backend",
        "",
        "fused, tape or cuda",
        "what computes updates: our kernels, candle's tape, or candle on the first GPU",
    )
    .for_networks(),
    Setting::new(Agents, "agents", "", "a whole number from 1 to 4096", "agents that explore side by side")
        .for_agents(),
    Setting::new(Agents, "episode_steps", "steps", "a whole number from 1 to 60000", "steps of an episode"),
    Setting::new(
        Agents,
        "restart",
        "",
        "anywhere or start-cell",
        "where episodes begin: at a random place, or at the map's start S",
    )
    .for_agents(),
    Setting::new(
        Agents,
        "new_goal_when_reached",
        "",
        SWITCH_VALUES,
        "give an agent that reaches its goal a new one within the episode",
    ),
    Setting::new(
        Agents,
        "env_noise",
        "",
        "a number from 0 to 100",
        "standard deviation of the noise that the world adds to every action",
    ),
    Setting::new(
        Exploration,
        "random_actions",
        "",
        SHARE_RANGE,
        "share of steps that follow a random direction instead of the actor",
    ),
    Setting::new(
        Exploration,
        "random_hold_steps",
        "steps",
        "a number of steps of at least 1",
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
        "probability that an episode's first goal is a bridge point (Algorithm 1's epsilon)",
    ),
    Setting::new(
        Exploration,
        "search_budget",
        "candidates",
        "a whole number from 1 to 100000",
        "candidates that one bridge search may try (Algorithm 2)",
    ),
    Setting::new(
        Exploration,
        "planned_episodes",
        "",
        PROBABILITY_RANGE,
        "probability that an episode is walked through the bridge graph",
    ),
    Setting::new(
        Exploration,
        "frontier_epsilon",
        "",
        PROBABILITY_RANGE,
        "probability that an episode's first goal is at the frontier: a candidate that few edges leave",
    ),
    Setting::new(
        Bridges,
        "candidates",
        "",
        "a whole number from 2 to 10000",
        "bridge candidates wanted; up to three times as many where these would lie too far apart",
    ),
    Setting::new(
        Bridges,
        "candidate_spacing",
        "goal radii",
        "a number from 0.01 to 1000000",
        "least distance between candidates; it grows when there would be too many",
    ),
    Setting::new(
        Bridges,
        "edge_cutoff_steps",
        "steps",
        "a number of steps from 1 to 100",
        "the longest D that makes an edge",
    ),
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
        "keep pairs that trajectories join as costly edges where D is above the cut-off",
    ),
    Setting::new(
        Bridges,
        "graph_every_updates",
        "updates",
        "a whole number of at least 1",
        "updates between two builds of the bridge graph",
    ),
    Setting::new(
        Planning,
        "hop_steps",
        "steps",
        "a number of steps from 0 to 100",
        "steps that a way through a waypoint takes beyond D to it and D from it",
    ),
    Setting::new(Planning, "open_loop", "", SWITCH_VALUES, "plan once and follow that to its end"),
    Setting::new(
        Planning,
        "progress_check",
        "",
        SWITCH_VALUES,
        "ban a waypoint for a while that was not reached in time",
    ),
    Setting::new(
        Planning,
        "late_factor",
        "",
        "a number from 0 to 100",
        "a waypoint is late after this many times D, plus late_slack_steps",
    ),
    Setting::new(Planning, "late_slack_steps", "steps", "a number of steps of at least 1", "see late_factor"),
    Setting::new(
        Planning,
        "ban_steps",
        "steps",
        "a whole number, 0 or more",
        "steps for which a late waypoint is banned",
    ),
    Setting::new(
        Planning,
        "averaged_weights",
        "",
        SWITCH_VALUES,
        "plan and evaluate with the running averages of critics and actor",
    ),
];

/// Returns the reference page in Markdown.
pub fn reference_page() -> String {
    let mut page = "# Settings\n\nChange one with `--set NAME=VALUE`, several with `--config FILE` (JSON, as \
                    `--print-config` prints it), any of them during a run with `o`. Former names still work. This page \
                    is printed by `gdg-tui settings`.\n"
        .to_owned();
    let values = list_settings(&Settings::default()).into_iter().zip(list_settings(&Preset::Paper.settings()));
    let rows: Vec<_> = SETTINGS.iter().zip(values).collect();
    for group in Group::ALL {
        page += &format!(
            "\n## {}\n\n| setting | default | paper | unit | values | what it does | a change |\n|---|---|---|---|---|---|---|\n",
            group.name()
        );
        for (setting, ((_, default), (_, paper))) in rows.iter().filter(|(setting, _)| setting.group == group) {
            let Setting { name, about, unit, range, effect, former, .. } = setting;
            let former = former.map_or(String::new(), |former| format!(" (was `{former}`)"));
            let effect = effect.about();
            page += &format!("| `{name}`{former} | {default} | {paper} | {unit} | {range} | {about} | {effect} |\n");
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::with_setting;

    #[test]
    fn every_setting_has_an_entry_and_every_entry_a_setting() {
        let mut listed: Vec<String> = list_settings(&Settings::default()).into_iter().map(|(name, _)| name).collect();
        let known: Vec<&str> = SETTINGS.iter().map(|setting| setting.name).collect();
        assert_eq!(listed, known, "settings are listed in the order of the table");
        listed.dedup();
        assert_eq!(listed.len(), SETTINGS.len());
        let groups: Vec<Group> = SETTINGS.iter().map(|setting| setting.group).collect();
        let mut seen = groups.clone();
        seen.dedup();
        assert_eq!(seen, Group::ALL, "group by group");
    }

    #[test]
    fn former_names_are_accepted() {
        for setting in SETTINGS.iter().filter(|setting| setting.former.is_some()) {
            let former = setting.former.unwrap_or_default();
            let value = list_settings(&Preset::Default.settings()).into_iter().find(|(name, _)| name == setting.name);
            let value = value.expect("listed").1;
            let settings = with_setting(&Settings::default(), former, &value).expect("the default");
            assert_eq!(settings, Settings::default(), "{former}");
        }
    }

    #[test]
    fn the_reference_page_matches_the_committed_file() {
        let kept = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/settings.md");
        let kept = std::fs::read_to_string(kept).unwrap_or_default();
        assert!(kept == reference_page(), "gdg-tui settings > docs/settings.md");
    }
}
