//! `gdg-tui reproduce`: the figures of "Reinforcement Learning with Goal-Distance Gradient", and
//! the point mazes of OGBench, each a list of jobs and what is drawn of their results.

mod catalogue;
mod drawn;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use miette::{Report, miette};

use super::jobs::{JobOptions, Jobs, warn_if_short};
use super::plan::{JobPlan, Length};
use super::spec::{JobResult, JobSpec, JobWorld};
use crate::process::errors::{from_config_error, print};
use crate::setup::values::{counts, output};
use crate::setup::{settings_of, split_prefix};
use catalogue::{Budget, Entry, FIGURES, Figure};
use drawn::{head, section};
use gdg::printing::eprint_line;
use gdg::train::{Overrides, Registry, Run, settings_from};

const EXAMPLES: &str = "\
Examples:
  gdg-tui reproduce all                      all figures; run again to resume
  gdg-tui reproduce fig3 fig4 --budget paper --out /shared/paper
  gdg-tui reproduce fig6 --set gdg:hidden=256    runs only that method's jobs
  gdg-tui reproduce ogbench                  beside published results
  gdg-tui reproduce all --list               one line per job
  gdg-tui reproduce all --job 3              the third, on a cluster
  gdg-tui reproduce all --collect            report from the jobs that are done

Exit status: as of gdg-tui suite.";

#[derive(Clone, Debug, Args)]
#[command(after_help = EXAMPLES, allow_negative_numbers = true, arg_required_else_help = true)]
pub struct FigureOptions {
    /// Figures of the paper, all of them, or OGBench's point mazes
    #[arg(value_name = "FIGURE", required = true, value_parser = names())]
    pub figures: Vec<String>,

    /// How much to train
    #[arg(long, value_enum, default_value_t = Budget::Quick)]
    pub budget: Budget,

    /// Train every job for N updates instead
    #[arg(long = "max-updates", alias = "updates", value_name = "N", value_parser = counts::<u64>(1..=1 << 53))]
    pub updates: Option<u64>,

    /// Train every job for N episodes instead
    #[arg(long = "max-episodes", alias = "episodes", value_name = "N", conflicts_with = "updates", value_parser = counts::<u64>(1..=1 << 53))]
    pub episodes: Option<u64>,

    /// Train every job for N environment steps instead
    #[arg(long = "max-steps", alias = "steps", value_name = "N", conflicts_with_all = ["updates", "episodes"], value_parser = counts::<u64>(1..=1 << 53))]
    pub steps: Option<u64>,

    /// Runs per method in figures over several seeds, with seeds 1, 2, ...
    #[arg(long, value_name = "N", value_parser = counts::<u64>(1..=1000))]
    pub seeds: Option<u64>,

    /// Folder of OGBench's datasets, for the figure ogbench
    #[arg(long, value_name = "FOLDER", default_value = "saves/ogbench", value_parser = output())]
    pub data_dir: PathBuf,

    /// Evaluation tasks at each of six distances (five for the arm) at the end, and at most that
    /// many along the way
    #[arg(long, value_name = "N", value_parser = counts::<u32>(1..=10_000))]
    pub eval_tasks: Option<u32>,

    /// Change one setting of all methods, or of the one named (repeatable)
    #[arg(long, value_name = "[METHOD:]NAME=VALUE")]
    pub set: Vec<String>,

    #[command(flatten)]
    pub running: JobOptions,
}

fn names() -> PossibleValuesParser {
    let figures = FIGURES.iter().map(|figure| PossibleValue::new(figure.name).help(figure.title));
    figures.chain([PossibleValue::new("all").help("All of the paper's")]).collect::<Vec<_>>().into()
}

pub struct Reproduction<'a> {
    options: &'a FigureOptions,
    jobs: Jobs<'a>,
    figures: Vec<(&'static Figure, Vec<MethodRuns>)>,
}

/// A method, its jobs, one per seed, and the available results.
struct MethodRuns {
    entry: &'static Entry,
    jobs: Vec<JobSpec>,
    results: Vec<JobResult>,
}

impl MethodRuns {
    fn plan(&self) -> &JobPlan {
        &self.jobs[0].plan
    }
}

pub fn prepare<'a>(
    options: &'a FigureOptions,
    registry: &'a Arc<Registry>,
) -> Result<Reproduction<'a>, Report> {
    let chosen: Vec<&'static Figure> =
        FIGURES.iter().filter(|figure| figure.is_among(&options.figures)).collect();
    check_prefixes(&options.set, &chosen)?;
    let JobOptions { collect, list, .. } = &options.running;
    let mut figures = Vec::new();
    for figure in chosen {
        let mut methods = Vec::new();
        for entry in figure.methods {
            let jobs = jobs(figure, entry, options, registry)?;
            if !*collect && !*list {
                let usual = figure.plan(options.budget, entry.name).length;
                let is_same_unit = jobs[0].plan.length.unit() == usual.unit();
                warn_if_short(is_same_unit.then_some((&jobs[0], usual.amount())));
            }
            methods.push(MethodRuns { entry, jobs, results: Vec::new() });
        }
        figures.push((figure, methods));
    }
    let all = figures.iter().flat_map(|(_, methods)| methods).flat_map(|method| &method.jobs);
    let jobs = Jobs::new("reproduce", all.cloned(), &options.running, registry)?;
    Ok(Reproduction { options, jobs, figures })
}

fn jobs(
    figure: &Figure,
    entry: &Entry,
    options: &FigureOptions,
    registry: &Registry,
) -> Result<Vec<JobSpec>, Report> {
    let preset = entry.preset();
    let own = entry.set.iter().map(|text| (*text).to_owned());
    let set: Vec<String> = own.chain(settings_of(&[entry.name], &options.set)).collect();
    let world = entry.world(figure.world);
    let defaults = registry.world_opened_by(&world).map_or(&[][..], |kind| kind.defaults);
    let settings = settings_from(preset, &Overrides { defaults, config: None, set: &set })
        .map_err(|error| {
            let problem = format!("the settings of {} cannot be used", entry.name);
            from_config_error(error).wrap_err(problem)
        })?;
    let mut plan = figure.plan(options.budget, entry.name);
    plan.data = entry
        .dataset
        .map(|dataset| catalogue::find_dataset(dataset, &options.data_dir))
        .transpose()?;
    let lengths = [
        options.updates.map(Length::Updates),
        options.episodes.map(Length::Episodes),
        options.steps.map(Length::Steps),
    ];
    plan.length = lengths.into_iter().flatten().next().unwrap_or(plan.length);
    if let Some(tasks) = options.eval_tasks {
        (plan.eval_tasks, plan.last_tasks) = (plan.eval_tasks.min(tasks), tasks);
        plan.random_tasks = plan.random_tasks.map(|random| random.min(2 * tasks));
    }
    let seeds = options.seeds.unwrap_or(figure.seeds(options.budget));
    let job = |seed| {
        let run = Run { method: entry.method(), preset, seed, settings: settings.clone() };
        JobSpec::new(JobWorld::find(&world, seed, registry)?, entry.name, run, plan.clone())
    };
    (1..=if figure.several_seeds { seeds } else { 1 }).map(job).collect()
}

fn check_prefixes(set: &[String], figures: &[&Figure]) -> Result<(), Report> {
    let mut names: Vec<&str> =
        figures.iter().flat_map(|figure| figure.methods).map(|entry| entry.name).collect();
    let mut known = BTreeSet::new();
    names.retain(|name| known.insert(*name));
    let unknown = |method: &&str| !names.contains(method);
    let Some(method) = set.iter().filter_map(|text| split_prefix(text).0).find(unknown) else {
        return Ok(());
    };
    let figures = figures.iter().map(|figure| figure.name).collect::<Vec<_>>().join(", ");
    let help = format!("methods of {figures}: {}", names.join(", "));
    Err(miette!(help = help, "--set {method}:...: no figure given has a method called {method:?}"))
}

impl Reproduction<'_> {
    pub fn run(mut self) -> Result<u8, Report> {
        let mut figures = std::mem::take(&mut self.figures);
        self.jobs.run(|missing| self.draw(&mut figures, missing))
    }

    fn draw(
        &self,
        figures: &mut [(&'static Figure, Vec<MethodRuns>)],
        missing: &[&str],
    ) -> Result<(), Report> {
        let (folder, options) = (&self.jobs.folder, self.options);
        for job in self.jobs.all.iter().filter(|job| missing.contains(&&*job.name)) {
            let problem = folder.problem(job).unwrap_or_else(|error| Some(error.to_string()));
            problem.iter().for_each(|problem| eprint_line(problem));
        }
        let (mut sections, others) = (String::new(), folder.results().0);
        for (figure, methods) in &mut *figures {
            for method in &mut *methods {
                method.results =
                    method.jobs.iter().filter_map(|job| folder.result_of(job)).collect();
                // What was trained with further seeds counts as well.
                let is_open = |seed| method.jobs.iter().all(|job| job.run.seed != seed);
                let further = others.iter().filter(|other| {
                    figure.several_seeds && is_open(other.seed) && method.jobs[0].is_seed(other)
                });
                method.results.extend(further.cloned());
            }
            methods.retain(|method| !method.results.is_empty());
            if methods.is_empty() {
                let name = figure.name;
                eprint_line(&format!("{name}: no job is done, so there is nothing to draw"));
                continue;
            }
            sections += &section(figure, methods, folder)?;
        }
        let of_paper = figures.iter().any(|(figure, _)| figure.is_of_paper());
        let head = head(&options.figures, options.budget, of_paper, missing);
        folder.write_report(head + &sections)?;
        print(&sections)
    }
}
