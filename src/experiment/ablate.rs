//! `gdg-tui ablate`: measures the effect of switching off each component of the default preset, or
//! of adding one after the other to the preset `paper`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, WrapErr, miette};
use serde::Serialize;

use super::folder::Folder;
use super::job::Job;
use super::plan::{Length, Plan};
use super::runner::Runner;
use super::suite::{any_failed, print};
use super::world::JobWorld;
use crate::host::maps::{find_map, warn};
use crate::host::outputs::{refuse_existing, refuse_input};
use crate::host::report::from_config_error;
use crate::host::setup::parallel_jobs;
use crate::host::status::EXIT_FAILURE;
use gdg::files::{check_writable, write_atomically};
use gdg::map::{Grid, Reading};
use gdg::printing::eprint_line;
use gdg::settings::Ablation;
use gdg::text::{counted, markdown};
use gdg::train::{
    Evaluation, Method, Overrides, Preset, Registry, Run, SETTINGS, Settings, list_settings,
    settings_from,
};

/// What to train, and where results go.
#[derive(Clone, Debug)]
pub struct Options {
    /// Built-in map or map file.
    pub map: PathBuf,
    /// Whether to climb from the preset paper to the default instead.
    pub ladder: bool,
    /// Updates per run.
    pub updates: u64,
    /// Runs per variant, with seeds 1, 2, ...
    pub seeds: u64,
    /// Evaluation tasks at each distance.
    pub eval_tasks: u32,
    /// Parallel runs; otherwise one a core.
    pub jobs: Option<u16>,
    /// Folder of the results.
    pub out: PathBuf,
    /// File for all results as JSON.
    pub json: Option<PathBuf>,
    /// Whether that is replaced if it exists.
    pub overwrite: bool,
}

/// What is trained and evaluated.
#[derive(Clone)]
struct Case {
    name: &'static str,
    method: &'static str,
    preset: Preset,
    /// Settings that differ from the preset's, as `--set` takes them.
    set: Vec<String>,
}

/// The default with two settings changed, besides those whose entry has an ablation.
const COMBINATION: (&str, &str) =
    ("targets from behaviour alone, expectile of 0.95", "greedy_targets=false expectile=0.95");

/// The default with another method.
const OTHER_METHODS: [(&str, &str); 2] =
    [("method sorb", "sorb"), ("method gdg (no bridges)", "gdg")];

/// The default's method.
const METHOD: &str = "gdg-bridge";

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

/// Returns the cases in the order of the table.
fn cases(ladder: bool) -> Vec<Case> {
    if ladder { rungs() } else { variants() }
}

/// Returns the rungs of the [`LADDER`].
fn rungs() -> Vec<Case> {
    let default = list_settings(&Settings::default());
    let (preset, mut set) = (Preset::Paper, Vec::new());
    let mut rung = |(name, added): (&'static str, &str)| {
        let is_added = |name: &str| added.split_whitespace().any(|added| added == name);
        let added = default.iter().filter(|(name, _)| is_added(name));
        set.extend(added.map(|(name, value)| format!("{name}={value}")));
        Case { name, method: METHOD, preset, set: set.clone() }
    };
    LADDER.map(&mut rung).to_vec()
}

/// Returns the default, the default without each component, and with other methods.
fn variants() -> Vec<Case> {
    let case = |name, method, set: &str| {
        let set = set.split_whitespace().map(str::to_owned).collect();
        Case { name, method, preset: Preset::Default, set }
    };
    let ablated = SETTINGS.iter().filter_map(|setting| {
        let Ablation { name, value } = setting.ablation?;
        Some(case(name, METHOD, &format!("{}={value}", setting.name)))
    });
    let default = case("default", METHOD, "");
    let combination = case(COMBINATION.0, METHOD, COMBINATION.1);
    let methods = OTHER_METHODS.map(|(name, method)| case(name, method, ""));
    [default].into_iter().chain(ablated).chain([combination]).chain(methods).collect()
}

/// One run's result.
#[derive(Debug, Serialize)]
struct Outcome {
    variant: &'static str,
    preset: Preset,
    set: String,
    method: &'static str,
    seed: u64,
    evaluation: Evaluation,
}

/// Trains every variant that has no result yet and prints the table as Markdown; returns the exit
/// status.
///
/// # Errors
/// The map is invalid, the folder is not writable, or the JSON file exists already or cannot be
/// written.
pub fn run(options: &Options, registry: &Arc<Registry>) -> Result<u8, Report> {
    if let Some(path) = &options.json {
        check_json(path, options)?;
    }
    let map = find_map(&options.map, &Reading::default(), registry)?;
    warn(&map);
    let plan = Plan::new(Length::Updates(options.updates), 1, options.eval_tasks);
    let (cases, mut runs) = (cases(options.ladder), Vec::new());
    for case in &cases {
        for seed in 1..=options.seeds {
            let method: Method = case.method.parse().into_diagnostic()?;
            let run = Run { method, preset: case.preset, seed, settings: settings(case)? };
            let job =
                Job::new(JobWorld::maze(&map, seed), Some(&slug(case.name)), run, plan.clone())?;
            runs.push((case, job));
        }
    }
    let folder = Folder::new(&options.out);
    folder.check_writable(&["jobs/NAME.json"])?;
    let jobs = runs.iter().map(|(_, job)| job);
    let outcome = Runner::run_open(&folder, registry, jobs, parallel_jobs(options.jobs), false)?;
    // This reports which.
    any_failed(&outcome);
    let result = |(case, job): &(&Case, Job)| {
        let evaluation = folder.result_of(job)?.last()?.clone();
        let Case { name, method, preset, ref set } = **case;
        Some(Outcome {
            variant: name,
            preset,
            set: set.join(" "),
            method,
            seed: job.run.seed,
            evaluation,
        })
    };
    let Some(outcomes) = runs.iter().map(result).collect::<Option<Vec<Outcome>>>() else {
        eprint_line("the table needs all jobs: the same command runs those that are left");
        return Ok(outcome.interrupted.unwrap_or(EXIT_FAILURE));
    };
    // Before the file: the table is printed even if that cannot be written.
    print(&table(&map, &outcomes, options))?;
    options.json.as_ref().map_or(Ok(()), |path| write_json(path, options.overwrite, &outcomes))?;
    Ok(outcome.interrupted.unwrap_or(0))
}

/// Returns a variant's name as a part of file names.
fn slug(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("-").to_lowercase()
}

/// Checks that the results can be written, to fail before hours of training instead of after.
fn check_json(path: &Path, options: &Options) -> Result<(), Report> {
    refuse_existing(path, options.overwrite)?;
    refuse_input("--json", path, std::iter::once(options.map.as_path()))?;
    let folder =
        path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Err(miette!(
            "{}: cannot be written: there is no folder {}",
            path.display(),
            folder.display()
        ));
    }
    check_writable(path)
        .into_diagnostic()
        .wrap_err_with(|| format!("{}: cannot be written", path.display()))
}

fn write_json(path: &Path, overwrite: bool, outcomes: &[Outcome]) -> Result<(), Report> {
    let json = serde_json::to_string_pretty(outcomes).into_diagnostic()? + "\n";
    // Another program may have made one in the meantime.
    refuse_existing(path, overwrite)?;
    write_atomically(path, json.as_bytes())
        .into_diagnostic()
        .wrap_err_with(|| format!("{}: cannot be written", path.display()))
}

/// Returns the settings of `case`.
fn settings(case: &Case) -> Result<Settings, Report> {
    settings_from(case.preset, &Overrides { set: &case.set, ..Overrides::default() })
        .map_err(from_config_error)
}

fn table(map: &Grid, outcomes: &[Outcome], options: &Options) -> String {
    let mut out = format!(
        "{}, {}, means of {} (success: worst seed in brackets), {} at each of six distances\n\n",
        markdown(map.name()),
        counted(options.updates, "update"),
        counted(options.seeds, "seed"),
        counted(options.eval_tasks.into(), "task")
    );
    out += "| variant | planned | SPL | greedy | error of D | error of graph | false edges |\n|---|---|---|---|---|---|---|\n";
    for own in outcomes.chunk_by(|a, b| a.variant == b.variant) {
        let all = |of: &dyn Fn(&Evaluation) -> Option<f64>| {
            own.iter().map(|o| of(&o.evaluation)).collect::<Option<Vec<_>>>()
        };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let worst = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
        let success = |of: &dyn Fn(&Evaluation) -> Option<f64>| {
            all(of).map_or("-".to_owned(), |v| format!("{:.3} ({:.2})", mean(&v), worst(&v)))
        };
        let number = |of: &dyn Fn(&Evaluation) -> Option<f64>| {
            all(of).map_or("-".to_owned(), |v| format!("{:.2}", mean(&v)))
        };
        let false_edges = all(&|e| Some(e.bridges.as_ref()?.false_edges? as f64));
        out += &format!(
            "| {} | {} | {} | {} | {} | {} | {} |\n",
            own[0].variant,
            success(&|e| e.planned.as_ref()?.success),
            number(&|e| e.planned.as_ref()?.spl),
            success(&|e| e.greedy.success),
            number(&|e| Some(e.distance_error?.mape)),
            number(&|e| Some(e.distance_error?.graph?.mape)),
            false_edges.map_or("-".to_owned(), |v| format!("{:.0}", mean(&v))),
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::train::TrainSettings;

    #[test]
    fn the_ladder_climbs_from_the_preset_paper_to_the_default() {
        let ladder = cases(true);
        let settings = |case: &Case| settings(case).expect("valid settings");
        let first = Settings {
            train: TrainSettings { env_noise: 0.0, ..TrainSettings::of(Preset::Paper) },
            ..Preset::Paper.settings()
        };
        assert_eq!(settings(&ladder[0]), first);
        assert_eq!(settings(&ladder[ladder.len() - 1]), Settings::default());
        assert!(ladder.windows(2).all(|rungs| settings(&rungs[0]) != settings(&rungs[1])));
        assert!(cases(false).iter().all(|case| super::settings(case).is_ok()));
    }
}
