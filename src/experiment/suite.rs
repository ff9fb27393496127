//! `gdg-tui suite`: trains methods on maps and other worlds, and writes a table and a report.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};

use super::jobs::{JobOptions, Jobs, warn_if_short};
use super::plan::JobPlan;
use super::plot::{self, By, DrawnPlot, PAGE};
use super::report::{CURVES, JobRow, report, rows, table};
use super::saved_runs::SavedRun;
use super::spec::{JobResult, JobSpec, JobWorld};
use super::variants::{Ablation, variants};
use crate::process::errors::{from_map_error, print};
use crate::process::waiting::Waiting;
use crate::setup::find_maps::{MapArgs, find_map, known_name, warnings};
use crate::setup::values::{MethodParser, counts, methods_help};
use crate::setup::{self, RunChoice, SettingsBase};
use gdg::env::maze;
use gdg::files::{has_extension, is_hidden};
use gdg::map::{Grid, MapFormat, Reading, builtin, load_map_as};
use gdg::printing::eprint_line;
use gdg::text::{counted, sanitized};
use gdg::train::{METHODS, Method, Registry};

const EXAMPLES: &str = "\
Examples:
  gdg-tui suite maps/ --seeds 3              every map; run again to resume
  gdg-tui suite fourrooms city my.map --max-updates 20000 --set hidden=128
  gdg-tui suite my.map --seeds 3 --method gdg-bridge --method her
  gdg-tui suite my.map --sweep hidden=32,64 --sweep tau=0.01,0.1    all four
  gdg-tui suite my.map --set small:hidden=32    a variant called small as well
  gdg-tui suite fourrooms --ablation components    without each component
  gdg-tui suite maps/ --list                 one line per job
  gdg-tui suite maps/ --job 3 --out /shared/suite    the third, on a cluster

Exit status: 0 success; 1 a job failed (the others run), or --collect found jobs missing; 2 bad \
usage or input; 128 + its number after a signal, as 130 after \
Ctrl-C (all jobs are saved; the same signal again exits without saving).";

#[derive(Clone, Debug, Args)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true)]
pub struct SuiteOptions {
    /// Built-in maps, map files, folders, of which the .map files that are not hidden are used, or
    /// the .txt files if there are none, and other worlds, like fetch-reach
    #[arg(value_name = "FOLDER|MAP", required = true)]
    pub maps: Vec<PathBuf>,

    /// Updates of every run [default: 60,000 up to 6,000 free cells, 200,000 up to 50,000, 600,000
    /// beyond]
    #[arg(long = "max-updates", alias = "budget", value_name = "N", value_parser = counts::<u64>(1..=1 << 53))]
    pub budget: Option<u64>,

    /// Python interpreter of gym:ID [default: that of the active virtual environment, else python3]
    #[arg(long, value_name = "PATH")]
    pub python: Option<PathBuf>,

    /// Runs per map, with seeds 1, 2, ...
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = counts::<u64>(1..=1000))]
    pub seeds: u64,

    /// Evaluation tasks at each of six distances
    #[arg(long, value_name = "N", default_value_t = crate::headless::EVAL_TASKS, value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: u32,

    /// Learner and planner: one of these methods, or LEARNER+PLANNER (repeatable: each trains on
    /// every map)
    #[arg(long, value_name = "METHOD", default_value = METHODS[0].name, value_parser = MethodParser, long_help = methods_help())]
    pub method: Vec<Method>,

    #[command(flatten)]
    pub base: SettingsBase,

    /// Change one setting, of all runs, or of the method called NAME; any other NAME is a variant,
    /// which trains with these changes beside the runs without (repeatable)
    #[arg(long, value_name = "[NAME:]SETTING=VALUE")]
    pub set: Vec<String>,

    /// Train with each of these values (repeatable: with all combinations)
    #[arg(long, value_name = "SETTING=VALUE,VALUE")]
    pub sweep: Vec<String>,

    /// Train the variants of an ablation of the default method instead
    #[arg(long, value_enum, value_name = "WHICH", conflicts_with_all = ["method", "preset", "config", "sweep"])]
    pub ablation: Option<Ablation>,

    /// Print the table as Markdown, with all columns, as in the report
    #[arg(long)]
    pub markdown: bool,

    #[command(flatten)]
    pub running: JobOptions,

    #[command(flatten)]
    pub reading: MapArgs,
}

/// Default budgets: maximum number of free cells, and updates.
const BUDGETS: [(usize, u64); 2] = [(6_000, 60_000), (50_000, 200_000)];

const LARGEST_BUDGET: u64 = 600_000;

pub struct Suite<'a> {
    jobs: Jobs<'a>,
    markdown: bool,
}

pub fn prepare<'a>(
    options: &'a SuiteOptions,
    registry: &'a Arc<Registry>,
) -> Result<Suite<'a>, Report> {
    let (base, set) = (options.base.clone(), options.set.clone());
    let run = RunChoice { method: Method::default(), base, set };
    let variants = match options.ablation {
        Some(ablation) => ablation.variants(&run),
        None => variants(&options.method, &run, &options.sweep)?,
    };
    for method in variants.iter().map(|variant| &variant.run.method) {
        registry.learner(&method.learner).into_diagnostic()?;
    }
    let (mut jobs, mut usual) = (Vec::new(), Vec::new());
    let reading = Reading::from(&options.reading);
    for given in &options.maps {
        let found = worlds(given, &reading, registry)
            .or_else(|error| known_worlds(given, options, registry).ok_or(error))?;
        for world in found {
            let (usual_updates, opened_by) = match world.map() {
                Some(map) => (usual_updates(map), maze::KIND.name),
                None => (BUDGETS[0].1, world.name()),
            };
            let updates = options.budget.unwrap_or(usual_updates);
            for variant in &variants {
                for seed in 1..=options.seeds {
                    let run = setup::run(&variant.run, Path::new(opened_by), registry, seed)?;
                    let plan = JobPlan::suite(updates, options.eval_tasks);
                    let job = JobSpec::new(world.with_start(seed), &variant.label, run, plan)?;
                    jobs.push(JobSpec { variant: variant.name.clone(), ..job });
                    usual.push(usual_updates);
                }
            }
        }
    }
    warn_if_short(jobs.iter().zip(usual));
    let jobs = Jobs::new("suite", jobs, &options.running, registry)?;
    Ok(Suite { jobs, markdown: options.markdown })
}

/// Returns the worlds called `name` that the folder has results of, if they are only listed or
/// reported: where one cannot be opened, as without gymnasium, nothing needs it.
fn known_worlds(name: &Path, options: &SuiteOptions, registry: &Registry) -> Option<Vec<JobWorld>> {
    let (name, running) = (known_name(name), &options.running);
    registry.world_opened_by(name).filter(|_| running.list || running.collect)?;
    let results = running.folder("suite").results().0.into_iter();
    let own = results.filter(|result| result.world == name);
    let known: BTreeSet<Option<String>> = own.map(|result| result.fingerprint).collect();
    let worlds = known.into_iter().map(|own| JobWorld::Named(name.to_owned(), own));
    let worlds: Vec<JobWorld> = worlds.collect();
    (!worlds.is_empty()).then(|| {
        let name = sanitized(name);
        eprint_line(&format!("{name}: cannot be opened: its jobs are those of its results"));
        worlds
    })
}

fn usual_updates(map: &Grid) -> u64 {
    let fitting = BUDGETS.iter().find(|(cells, _)| map.free_count() <= *cells);
    fitting.map_or(LARGEST_BUDGET, |(_, updates)| *updates)
}

/// Returns the world, the built-in map or the map file called `name`, or all `.map` files of that
/// folder, sorted by name; all `.txt` files if it has none. Hidden files are left out.
fn worlds(name: &Path, reading: &Reading, registry: &Registry) -> Result<Vec<JobWorld>, Report> {
    if !name.is_dir() {
        let _opening = Waiting::on("opening the world");
        if let Some(world) = JobWorld::named(known_name(name), registry)? {
            return Ok(vec![world]);
        }
    }
    let maze = |map: Grid| JobWorld::Maze(Arc::new(map));
    if !name.is_dir() || name.to_str().is_some_and(|name| builtin(name).is_some()) {
        let map = find_map(name, reading, registry)?;
        warnings(&map).iter().for_each(|own| eprint_line(&format!("warning: {own}")));
        return Ok(vec![maze(map)]);
    }
    let folder = name.display();
    let entries = std::fs::read_dir(name).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries =
        entries.into_diagnostic().wrap_err_with(|| format!("{folder}: cannot be read"))?;
    let mut paths: Vec<PathBuf> = entries.iter().map(std::fs::DirEntry::path).collect();
    paths.retain(|path| MapFormat::by_name(path).is_some() && !is_hidden(path) && path.is_file());
    // Text files beside maps are likely to describe them.
    let ending = ["map", "txt"].into_iter().find(|end| paths.iter().any(|p| has_extension(p, end)));
    let is_used = |path: &&PathBuf| ending.is_some_and(|ending| has_extension(path, ending));
    let mut files: Vec<PathBuf> = paths.iter().filter(is_used).cloned().collect();
    files.sort();
    if files.is_empty() {
        let help = "give a folder of .map or .txt files, map files, or names from 'gdg-tui maps'";
        return Err(miette!(help = help, "{folder}: the folder has no .map or .txt files"));
    }
    if paths.len() > files.len() {
        let more = counted((paths.len() - files.len()) as u64, "file");
        eprint_line(&format!("{folder}: {more} in other formats left out: name those to add"));
    }
    let working = Waiting::on("reading the maps");
    working.begin(0, 1);
    let load = |(i, path): (usize, &PathBuf)| {
        working.set(i, files.len());
        load_map_as(path, reading).map(|map| (warnings(&map), map)).map_err(from_map_error)
    };
    let loaded = files.iter().enumerate().map(load).collect::<Result<Vec<_>, Report>>()?;
    drop(working);
    loaded.iter().flat_map(|(all, _)| all).for_each(|own| eprint_line(&format!("warning: {own}")));
    Ok(loaded.into_iter().map(|(_, map)| maze(map)).collect())
}

impl Suite<'_> {
    pub fn run(&self) -> Result<u8, Report> {
        let folder = &self.jobs.folder;
        self.jobs.run(|_| {
            let (rows, problems) = rows(&self.jobs.all, folder);
            problems.iter().for_each(|error| eprint_line(&format!("{error}: left out")));
            let caption = self.draw_curves(&rows)?;
            folder.write_report(report(&rows, folder, caption.as_deref()))?;
            print(&table(&rows, self.markdown))
        })
    }

    /// Draws the learning curves, a chart for each map; returns their caption, or `None` without
    /// results.
    fn draw_curves(&self, rows: &[JobRow]) -> Result<Option<String>, Report> {
        let folder = &self.jobs.folder;
        let results = rows.iter().flat_map(|row| &row.results);
        let file = |result: &JobResult| folder.path(&format!("jobs/{}.json", result.name));
        let run = |result: &JobResult| SavedRun::of_result(result.clone(), file(result));
        let done = results.filter(|result| !result.evaluations.is_empty());
        let runs: Vec<SavedRun> = done.map(run).collect();
        if runs.is_empty() {
            return Ok(None);
        }
        let by = vec![By::Method, By::Setting];
        let options = plot::PlotOptions { by, width: PAGE, ..plot::PlotOptions::default() };
        let DrawnPlot { sheet, table, caption, notes } = plot::draw(&runs, &options)?;
        notes.iter().for_each(|note| eprint_line(note));
        plot::write_unless_edited(folder, &[CURVES.into()], ("success.csv", &table), &sheet)?;
        Ok(Some(caption))
    }
}

#[cfg(test)]
mod tests {
    use clap::FromArgMatches;
    use serde_json::json;

    use super::super::folder::Folder;
    use super::super::spec::EvaluationAt;
    use super::*;

    fn jobs(out: &Path, args: &str) -> Vec<JobSpec> {
        let line = ["suite", "--out", out.to_str().expect("text")];
        let args = args.replace("OUT", line[2]);
        let line = line.into_iter().chain(args.split_whitespace());
        let found = SuiteOptions::augment_args(clap::Command::new("suite")).get_matches_from(line);
        let options = SuiteOptions::from_arg_matches(&found).expect("options");
        prepare(&options, &Registry::builtin()).expect("a suite").jobs.all
    }

    /// Returns the result of a job, with this success.
    fn done(job: &JobSpec, success: f64) -> JobResult {
        let score = json!({"success": success, "by_distance": []});
        let coverage = (job.run.seed == 1).then_some(0.5);
        let at = json!({"updates": 9, "env_steps": 0, "seconds": 1, "greedy": score, "coverage": coverage});
        let at: EvaluationAt = serde_json::from_value(at).expect("an evaluation");
        JobResult { evaluations: vec![at], ..job.open_result() }
    }

    #[test]
    fn a_value_written_in_several_ways_is_one_job() {
        let out = tempfile::tempdir().expect("a folder");
        let jobs = jobs(out.path(), "city --sweep hidden=16,16,1_6,32 --set small:tau=0.1");
        let of = |name| jobs.iter().filter(|job| job.variant.as_deref() == name).count();
        assert_eq!([of(None), of(Some("small"))], [2, 2]);
    }

    #[test]
    fn an_environment_that_cannot_be_opened_is_listed_as_in_its_results() {
        let out = tempfile::tempdir().expect("a folder");
        let trap = &jobs(out.path(), "trap --budget 9")[0];
        let world = JobWorld::Named("gym:NoSuch-v0".to_owned(), Some("a 1".to_owned()));
        let job = JobSpec::new(world, "gdg-bridge", trap.run.clone(), trap.plan.clone());
        let job = job.expect("a job");
        let folder = Folder(out.path().to_owned());
        folder.finish(&job, &done(&job, 1.0), None, false).expect("a result");
        for shown in ["--list", "--collect"] {
            let found = &jobs(out.path(), &format!("gym:NoSuch-v0 --budget 9 {shown}"))[0];
            assert_eq!(found.world.name(), job.world.name());
            assert_eq!(found.open_result().fingerprint, job.open_result().fingerprint);
            // Among runs, by the name of records.
            assert_eq!(SavedRun::of_result(found.open_result(), PathBuf::new()).map, "NoSuch-v0");
        }
    }

    #[test]
    fn finished_seeds_stay_in_their_row_and_what_is_no_seed_of_it_is_named() {
        let out = tempfile::tempdir().expect("a folder");
        // Without a start, which each seed draws.
        std::fs::write(out.path().join("hall.txt"), "......\n......\n").expect("a map");
        let folder = Folder(out.path().to_owned());
        let finish = |job: &JobSpec, result: &JobResult| {
            folder.finish(job, result, None, false).expect("a result");
        };
        let jobs = |args: &str| jobs(out.path(), &format!("OUT/hall.txt trap --budget 9 {args}"));
        let three = jobs("--seeds 3");
        // The hall's first seed is open, and the trap has two.
        let [all @ .., _] = &three[1..] else { panic!("six jobs") };
        all.iter()
            .for_each(|job| finish(job, &done(job, if job.run.seed == 3 { 1.0 } else { 0.5 })));
        let one = jobs("");
        let (found, problems) = rows(&one, &folder);
        let seeds = |row: &JobRow| row.results.iter().map(|done| done.seed).collect::<Vec<_>>();
        assert_eq!(found.iter().map(seeds).collect::<Vec<_>>(), [vec![2, 3], vec![1, 2]]);
        assert!(problems.is_empty(), "{problems:?}");
        let shown = table(&found, false);
        let lines: Vec<String> = shown
            .lines()
            .map(|line| line.split_whitespace().collect::<Vec<_>>().join(" "))
            .collect();
        assert!(lines[1].starts_with("hall (2 of 3 seeds) gdg-bridge 9 - 0.75 (0.50)"), "{shown}");
        assert_eq!(lines[2], "trap gdg-bridge 9 - 0.50 (0.50) - 50 % [1] -", "of one seed");
        assert!(shown.ends_with("if not of all.\n"), "it says what brackets are: {shown}");
        assert!(lines[3].starts_with("mean of 2 gdg-bridge 9 - 0.62"), "each map once: {shown}");

        let tasks = jobs("--seeds 2 --eval-tasks 3");
        let own = jobs("--method her");
        finish(&tasks[1], &done(&tasks[1], 0.0));
        finish(&own[0], &JobResult { key: "0".to_owned(), seed: 7, ..done(&own[0], 0.0) });
        finish(&three[0], &done(&three[0], 0.5));
        let (found, problems) = rows(&one, &folder);
        assert_eq!((found.len(), seeds(&found[0])), (3, vec![1, 2, 3]), "her has a row of its own");
        let named: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert!(named.len() == 1 && named[0].contains(&tasks[1].name), "{named:?}");

        let shown = table(&rows(&tasks[..2], &folder).0, false);
        for part in ["gdg-bridge, eval-tasks=3 ", "gdg-bridge, eval-tasks=30 "] {
            assert!(shown.contains(part) && !shown.contains("mean"), "{shown}");
        }
    }
}
