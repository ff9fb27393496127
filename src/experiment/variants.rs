//! The variants that a suite trains on every map: methods with settings of their own, sweeps, and
//! ablations.

use miette::{Report, miette};
use serde_json::Value;

use super::spec::setting_text;
use crate::setup::{RunChoice, SettingsBase, settings_of, split_prefix};
use gdg::settings::SettingAblation;
use gdg::train::{METHODS, Method, Preset, SETTINGS, Settings, list_settings, with_setting};

pub struct JobVariant {
    pub name: Option<String>,
    /// What names of jobs say of it.
    pub label: String,
    pub run: RunChoice,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Ablation {
    /// The default, the default without each of its components, and with other methods
    Components,
    /// From the preset paper to the default, component by component
    Ladder,
}

const METHOD: &str = METHODS[0].name;

/// Two settings of the default changed at once, besides those whose entry has an ablation.
const COMBINATION: (&str, &str) =
    ("targets from behaviour alone, expectile of 0.95", "greedy_targets=false expectile=0.95");

const OTHER_METHODS: [(&str, &str); 2] =
    [("method sorb", "sorb"), ("method gdg (no bridges)", "gdg")];

/// The components between the presets `paper` and `default`, each on top of those before it: the
/// settings that get their default. The world is the same for all, without noise.
const LADDER: [(&str, &str); 16] = [
    ("preset paper, without noise", "env_noise"),
    (
        "+ hindsight goals instead of near ones",
        "near_goals goal_hindsight goal_random hindsight_bound max_distance_steps",
    ),
    (
        "+ 32 agents side by side, long episodes",
        "agents env_steps_per_update update_when learning_starts random_actions \
         new_goal_when_reached episode_steps",
    ),
    ("+ relative inputs, Fourier features", "relative_scales fourier_octaves"),
    ("+ grid encoding", "grid_cells"),
    ("+ 3-step targets, two critics, error of sqrt(D)", "n_step critics loss tau"),
    (
        "+ targets of the better of behaviour and actor",
        "greedy_targets expectile actor_bound relearn_updates",
    ),
    (
        "+ verified edges, progress check, more candidates",
        "verify_edges keep_observed_edges progress_check averaged_weights hop_steps candidates \
         candidate_spacing",
    ),
    ("+ distillation, plans in exploration", "distillation planned_episodes"),
    ("+ bounds by the graph on other pairs", "graph_bounds"),
    ("+ waypoints for the actor", "actor_waypoints"),
    ("+ checks of the model, ways out for a blocked actor", "model_check unblock_actor"),
    ("+ near pairs where D falls short of the graph", "short_pairs"),
    ("+ pairs where the actor gets stuck", "imagined_walks"),
    ("+ lookahead", "lookahead"),
    ("+ one start, excursions: the default", "restart frontier_epsilon"),
];

/// Returns what names of jobs say of a method with this name of a variant and these settings.
fn label(method: &str, name: Option<&str>, swept: &[String]) -> String {
    let text = [&[method.to_owned()], swept].concat().join(" ") + " " + name.unwrap_or_default();
    let words = text.split(|c: char| !c.is_alphanumeric() && !"-_.=".contains(c));
    words.filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-")
}

/// Returns every method as it is and with the settings of each variant that `set`,
/// `[NAME:]SETTING=VALUE`, names; with every value of every sweep instead, if there are any.
pub fn variants(
    methods: &[Method],
    base: &RunChoice,
    sweeps: &[String],
) -> Result<Vec<JobVariant>, Report> {
    let sweeps = combinations(sweeps)?;
    let own: Vec<String> = methods.iter().map(Method::name).collect();
    let mut names: Vec<Option<&str>> = vec![None];
    for name in base.set.iter().filter_map(|text| split_prefix(text).0) {
        if !own.iter().any(|method| method == name) && !names.contains(&Some(name)) {
            check_name(name, &own)?;
            names.push(Some(name));
        }
    }
    let mut all = Vec::new();
    for method in methods {
        for name in &names {
            let of_method = method.name();
            let names: Vec<&str> = name.iter().copied().chain([&*of_method]).collect();
            let set = settings_of(&names, &base.set);
            all.extend(sweeps.iter().map(|swept| JobVariant {
                name: name.map(str::to_owned),
                label: label(&method.name(), *name, swept),
                run: RunChoice {
                    method: method.clone(),
                    set: [&set[..], swept].concat(),
                    ..base.clone()
                },
            }));
        }
    }
    Ok(all)
}

fn check_name(name: &str, methods: &[String]) -> Result<(), Report> {
    if METHODS.iter().any(|method| method.name == name) {
        let help = format!("add --method {name}, or name one of {}", methods.join(", "));
        return Err(miette!(help = help, "--set {name}:...: {name} is not among the methods"));
    }
    if name.is_empty() || !name.chars().all(|c| c.is_alphanumeric() || "-_.".contains(c)) {
        let help = "NAME has only letters, digits and -_.: --set small:hidden=32";
        return Err(miette!(help = help, "--set {name}:...: not the name of a variant"));
    }
    Ok(())
}

/// Returns `name=value` as written in lists of settings; unchanged if it is not valid.
fn as_listed(text: String) -> String {
    let (name, value) = text.split_once('=').unwrap_or_default();
    let settings = with_setting(&Settings::default(), name, value);
    let listed = settings.map(|settings| list_settings(&settings)).unwrap_or_default();
    let own = listed.into_iter().find(|(known, _)| known == name);
    own.map_or(text, |(name, value)| format!("{name}={value}"))
}

fn combinations(sweeps: &[String]) -> Result<Vec<Vec<String>>, Report> {
    let mut all = vec![Vec::new()];
    for sweep in sweeps {
        let parts = sweep.split_once('=').filter(|(_, values)| !values.trim().is_empty());
        let Some((name, values)) = parts else {
            let help = "--sweep hidden=32,64,128";
            return Err(miette!(help = help, "--sweep {sweep}: not SETTING=VALUE,VALUE"));
        };
        if all.iter().flatten().any(|set: &String| set.starts_with(&format!("{name}="))) {
            let help = format!("give all values at once: --sweep {name}=32,64,128");
            return Err(miette!(help = help, "--sweep {sweep}: the second one of {name}"));
        }
        // Values may be lists themselves; names of choices are no JSON.
        let settings: Vec<String> = match serde_json::from_str::<Vec<Value>>(&format!("[{values}]"))
        {
            Ok(values) => values.iter().map(|value| setting_text(name, value)).collect(),
            Err(_) => values.split(',').map(|value| format!("{name}={}", value.trim())).collect(),
        };
        // A value may be written in several ways, as 16 and 1_6: one job has one name.
        let settings: Vec<String> = settings.into_iter().map(as_listed).collect();
        let with = |before: &Vec<String>| -> Vec<Vec<String>> {
            settings.iter().map(|own| [&before[..], std::slice::from_ref(own)].concat()).collect()
        };
        all = all.iter().flat_map(with).collect();
    }
    Ok(all)
}

impl Ablation {
    /// Returns its variants in the order of the table, each on top of the settings of `base`.
    pub fn variants(self, base: &RunChoice) -> Vec<JobVariant> {
        let variant = |name: &str, method: &str, preset, set: &[String]| {
            let label = label(method, Some(name), &[]);
            let method = method.parse().unwrap_or_default();
            let set = [&base.set, set].concat();
            let base = SettingsBase { preset: Some(preset), config: None };
            let run = RunChoice { method, base, set };
            JobVariant { name: Some(name.to_owned()), label, run }
        };
        match self {
            Self::Ladder => {
                let (default, mut set) = (list_settings(&Settings::default()), Vec::new());
                let rung = |(name, added): (&str, &str)| {
                    let is_added = |name: &str| added.split_whitespace().any(|added| added == name);
                    let added = default.iter().filter(|(name, _)| is_added(name));
                    set.extend(added.map(|(name, value)| format!("{name}={value}")));
                    variant(name, METHOD, Preset::Paper, &set)
                };
                LADDER.map(rung).into()
            }
            Self::Components => {
                let changed = |name: &str, method: &str, set: &str| {
                    let set: Vec<String> = set.split_whitespace().map(str::to_owned).collect();
                    variant(name, method, Preset::Default, &set)
                };
                let without = SETTINGS.iter().filter_map(|setting| {
                    let SettingAblation { name, value } = setting.ablation?;
                    Some(changed(name, METHOD, &format!("{}={value}", setting.name)))
                });
                let others = OTHER_METHODS.map(|(name, method)| changed(name, method, ""));
                let all = [changed("default", METHOD, "")].into_iter().chain(without);
                all.chain([changed(COMBINATION.0, METHOD, COMBINATION.1)]).chain(others).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::train::{Overrides, TrainSettings, settings_from};

    fn base(set: &str) -> RunChoice {
        let set = vec![set.to_owned()];
        RunChoice { method: Method::default(), base: SettingsBase::default(), set }
    }

    fn settings(variant: &JobVariant) -> Settings {
        let overrides = Overrides { set: &variant.run.set, ..Overrides::default() };
        settings_from(variant.run.base.preset.expect("a preset"), &overrides)
            .expect("valid settings")
    }

    #[test]
    fn the_ladder_climbs_from_the_preset_paper_to_the_default() {
        let none = RunChoice { set: Vec::new(), ..base("") };
        let ladder = Ablation::Ladder.variants(&none);
        let first = Settings {
            train: TrainSettings { env_noise: 0.0, ..TrainSettings::of(Preset::Paper) },
            ..Preset::Paper.settings()
        };
        assert_eq!(settings(&ladder[0]), first);
        assert_eq!(settings(&ladder[ladder.len() - 1]), Settings::default());
        assert!(ladder.windows(2).all(|rungs| settings(&rungs[0]) != settings(&rungs[1])));
        assert_eq!(ladder[4].label, "gdg-bridge-grid-encoding");
        let components = Ablation::Components.variants(&base("hidden=16"));
        assert!(components.iter().all(|variant| settings(variant).learn.hidden == 16));
    }

    #[test]
    fn sweeps_are_all_combinations_and_nothing_else() {
        let of = |sweeps: &[&str]| {
            let sweeps: Vec<String> = sweeps.iter().map(|text| (*text).to_owned()).collect();
            let all = variants(&[Method::default()], &base("tau=0.1"), &sweeps);
            let all = all.map_err(|error| error.to_string())?;
            Ok::<_, String>(
                all.iter().map(|variant| variant.run.set[1..].join(" ")).collect::<Vec<_>>(),
            )
        };
        for (sweeps, expected) in [
            (&[][..], &[""][..]),
            (
                &["hidden=32,64", "grid_cells=[4,2],[]"],
                &[
                    "hidden=32 grid_cells=[4.0,2.0]",
                    "hidden=32 grid_cells=[]",
                    "hidden=64 grid_cells=[4.0,2.0]",
                    "hidden=64 grid_cells=[]",
                ],
            ),
            (&["loss=sqrt, mse"], &["loss=sqrt", "loss=mse"]),
            (&["expectile=.5,5e-1"], &["expectile=0.5", "expectile=0.5"]),
        ] {
            assert_eq!(of(sweeps).expect("settings"), expected);
        }
        for (sweeps, problem) in
            [(&["hidden"][..], "not SETTING=VALUE"), (&["tau=1", "tau=2"], "the second one of tau")]
        {
            assert!(of(sweeps).is_err_and(|error| error.contains(problem)));
        }
    }
}
