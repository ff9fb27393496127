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
use crate::host::report::from_config_error;
use crate::host::setup::{refuse_existing, refuse_input, threads};
use crate::host::status::EXIT_FAILURE;
use gdg::files::{check_writable, write_atomically};
use gdg::map::Grid;
use gdg::printing::eprint_line;
use gdg::text::{counted, markdown};
use gdg::train::{Evaluation, Method, Overrides, Preset, Registry, Run, Settings, settings_from};

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
struct Case {
    name: &'static str,
    method: &'static str,
    preset: Preset,
    /// Settings that differ from the preset's, as `--set` takes them.
    set: Vec<&'static str>,
}

/// The default with one thing changed: settings as `--set` takes them, separated by spaces.
const VARIANTS: [(&str, &str); 28] = [
    ("default", ""),
    ("1-step targets", "n_step=1"),
    ("targets from behaviour alone", "greedy_targets=false"),
    ("... and an expectile of 0.95", "greedy_targets=false expectile=0.95"),
    ("no check of the model before targets", "model_check=false"),
    ("no hindsight bound", "hindsight_bound=false"),
    ("one critic", "critics=1"),
    ("squared error of D", "loss=squared"),
    ("no random goals in a batch", "goal_random=0"),
    ("no Fourier features", "fourier_octaves=0"),
    ("no relative inputs", "relative_scales=[]"),
    ("no grid encoding", "grid_cells=[]"),
    ("unbounded actor", "actor_bound=0"),
    ("no distillation", "distillation=0"),
    ("no bounds by the graph on other pairs", "graph_bounds=false"),
    ("no waypoints for the actor", "actor_waypoints=false"),
    ("no ways out for a blocked actor", "unblock_actor=false"),
    ("waypoints cost a step", "hop_steps=1"),
    ("unverified edges", "verify_edges=false"),
    ("no edges from trajectories alone", "keep_observed_edges=false"),
    ("no progress check", "progress_check=false"),
    ("current weights, no averages", "averaged_weights=false"),
    ("no bridge goals in exploration", "bridge_epsilon=0"),
    ("no plans in exploration", "planned_episodes=0"),
    ("no lookahead", "lookahead=false"),
    ("episodes from anywhere", "restart=anywhere"),
    ("episodes of 150 steps", "episode_steps=150"),
    ("no excursions", "frontier_epsilon=0"),
];

/// The default with another method.
const OTHER_METHODS: [(&str, &str); 2] =
    [("method sorb", "sorb"), ("method gdg (no bridges)", "gdg")];

/// The default's method.
const METHOD: &str = "gdg-bridge";

/// The components between the presets `paper` and `default`, each on top of those before it. The
/// world is the same for all, without noise.
const LADDER: [(&str, &str); 14] = [
    ("preset paper, without noise", "env_noise=0"),
    (
        "+ hindsight goals instead of near ones",
        "near_goals=0 goal_hindsight=0.5 goal_random=0.1 hindsight_bound=true max_distance_steps=0",
    ),
    (
        "+ 32 agents side by side, long episodes",
        "agents=32 env_steps_per_update=16 update_when=step learning_starts=4000 random_actions=0.3 \
         new_goal_when_reached=true episode_steps=auto",
    ),
    ("+ relative inputs, Fourier features", "relative_scales=[0.5,1,2,4,8,32] fourier_octaves=3"),
    ("+ grid encoding", "grid_cells=[4,2,1,0.5]"),
    ("+ 3-step targets, two critics, error of sqrt(D)", "n_step=3 critics=2 loss=sqrt tau=0.005"),
    (
        "+ targets of the better of behaviour and actor",
        "greedy_targets=true expectile=0.55 actor_bound=2.5 relearn_updates=3000",
    ),
    (
        "+ verified edges, progress check, more candidates",
        "verify_edges=true keep_observed_edges=true progress_check=true averaged_weights=true hop_steps=0.5 \
         candidates=1200 candidate_spacing=1",
    ),
    ("+ distillation, plans in exploration", "distillation=0.3 planned_episodes=0.7"),
    ("+ bounds by the graph on other pairs", "graph_bounds=true"),
    ("+ waypoints for the actor", "actor_waypoints=true"),
    ("+ checks of the model, ways out for a blocked actor", "model_check=true unblock_actor=true"),
    ("+ lookahead", "lookahead=true"),
    ("+ one start, excursions: the default", "restart=auto frontier_epsilon=auto"),
];

/// Returns the cases in the order of the table.
fn cases(ladder: bool) -> Vec<Case> {
    let case = |name, method, preset, set| Case { name, method, preset, set };
    if ladder {
        let set = |rung: usize| {
            LADDER[..=rung].iter().flat_map(|(_, set)| set.split_whitespace()).collect()
        };
        return (0..LADDER.len())
            .map(|rung| case(LADDER[rung].0, METHOD, Preset::Paper, set(rung)))
            .collect();
    }
    let variants = VARIANTS
        .iter()
        .map(|(name, set)| case(name, METHOD, Preset::Default, set.split_whitespace().collect()));
    let methods =
        OTHER_METHODS.iter().map(|(name, method)| case(name, method, Preset::Default, Vec::new()));
    variants.chain(methods).collect()
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
    let map = find_map(&options.map, registry)?;
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
    let outcome = Runner::run_open((&folder, registry), jobs, threads(options.jobs), false)?;
    // It says which.
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
    refuse_input(("--json", path), std::iter::once(options.map.as_path()))?;
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
    let set: Vec<String> = case.set.iter().map(|set| (*set).to_owned()).collect();
    settings_from(case.preset, &Overrides { set: &set, ..Overrides::default() })
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
