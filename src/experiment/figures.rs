//! `gdg-tui reproduce`: the figures of "Reinforcement Learning with Goal-Distance Gradient", and
//! the point mazes of OGBench, each a list of jobs and what is drawn of their results.

mod catalogue;
mod curves;
mod maps;
mod ogbench;
mod output;
mod report;

use std::collections::BTreeSet;
use std::sync::Arc;

use miette::{Report, miette};

use super::jobs::{JobOptions, Jobs, print_raw, warn_if_short};
use super::plan::{Length, Plan};
use super::spec::{JobResult, JobSpec, JobWorld};
use crate::host::report::from_config_error;
use crate::host::setup::{settings_of, split_prefix};
use catalogue::Entry;
pub use catalogue::{Budget, FIGURES, Figure};
use gdg::printing::eprint_line;
use gdg::train::{Overrides, Preset, Registry, Run, settings_from};
pub use ogbench::DataFolder;
use output::Drawn;

/// Which figures to reproduce, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Names of figures, or `all` for those of the paper.
    pub figures: Vec<String>,
    pub budget: Budget,
    /// Updates of every job instead.
    pub updates: Option<u64>,
    /// Episodes of every job instead.
    pub episodes: Option<u64>,
    /// Environment steps of every job instead.
    pub steps: Option<u64>,
    /// Runs per method in figures over several seeds; otherwise as many as the figure has.
    pub seeds: Option<u64>,
    /// Evaluation tasks at each distance; otherwise those of the figure.
    pub eval_tasks: Option<u32>,
    pub data: DataFolder,
    /// Changes of settings of all methods, or of one, `[METHOD:]NAME=VALUE`.
    pub set: Vec<String>,
    pub running: JobOptions,
}

/// Figures, ready to be reproduced.
pub struct Reproduction<'a> {
    options: &'a Options,
    jobs: Jobs<'a>,
    figures: Vec<(&'static Figure, Vec<MethodRuns>)>,
    /// Methods without a learner, which are left out.
    unavailable: Vec<&'static str>,
}

/// A method, its jobs, one per seed, and the available results.
struct MethodRuns {
    entry: &'static Entry,
    jobs: Vec<JobSpec>,
    results: Vec<JobResult>,
}

impl MethodRuns {
    fn plan(&self) -> &Plan {
        &self.jobs[0].plan
    }
}

/// Checks all arguments and lists the jobs.
pub fn prepare<'a>(
    options: &'a Options,
    registry: &'a Arc<Registry>,
) -> Result<Reproduction<'a>, Report> {
    let is_chosen = |figure: &&Figure| {
        let is_named = |name: &String| name == figure.name || name == "all" && figure.is_of_paper();
        options.figures.iter().any(is_named)
    };
    let chosen: Vec<&'static Figure> = FIGURES.iter().filter(is_chosen).collect();
    check_prefixes(&options.set, &chosen)?;
    let JobOptions { collect, list, .. } = options.running;
    if !collect {
        let entries = chosen.iter().flat_map(|figure| figure.methods);
        let datasets: Vec<&str> = entries.filter_map(|entry| entry.dataset).collect();
        options.data.collect(&datasets)?;
    }
    let (mut figures, mut unavailable) = (Vec::new(), BTreeSet::new());
    for figure in chosen {
        let mut methods = Vec::new();
        for entry in figure.methods {
            let Some(preset) = entry.preset(registry) else {
                unavailable.insert(entry.name);
                continue;
            };
            let jobs = jobs(figure, entry, preset, options, registry)?;
            if !collect && !list {
                let usual = figure.plan(options.budget, entry.name).length;
                let is_same_unit = jobs[0].plan.length.unit() == usual.unit();
                warn_if_short(is_same_unit.then_some((&jobs[0], usual.amount())));
            }
            methods.push(MethodRuns { entry, jobs, results: Vec::new() });
        }
        figures.push((figure, methods));
    }
    let all = figures.iter().flat_map(|(_, methods)| methods).flat_map(|method| &method.jobs);
    let files = ["data/NAME.json", "figures/NAME.png"];
    let jobs = Jobs::new(all.cloned(), &options.running, registry, &files)?;
    Ok(Reproduction { options, jobs, figures, unavailable: unavailable.into_iter().collect() })
}

/// Returns the jobs of a method in a figure, one per seed.
fn jobs(
    figure: &Figure,
    entry: &Entry,
    preset: Preset,
    options: &Options,
    registry: &Registry,
) -> Result<Vec<JobSpec>, Report> {
    let own = entry.set.iter().map(|text| (*text).to_owned());
    let set: Vec<String> = own.chain(settings_of(entry.name, &options.set)).collect();
    let world = entry.world(figure.world);
    let defaults = registry.world_opened_by(&world).map_or(&[][..], |kind| kind.defaults);
    let settings = settings_from(preset, &Overrides { defaults, config: None, set: &set })
        .map_err(|error| {
            let problem = format!("the settings of {} cannot be used", entry.name);
            from_config_error(error).wrap_err(problem)
        })?;
    let mut plan = figure.plan(options.budget, entry.name);
    plan.data = entry.dataset.map(|dataset| options.data.find(dataset)).transpose()?;
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

/// Checks that the methods named by `--set` are among those of `figures`.
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
    /// Runs, draws or lists; returns the exit status.
    pub fn run(mut self) -> Result<u8, Report> {
        if !self.unavailable.is_empty() {
            let names = self.unavailable.join(", ");
            eprint_line(&format!("left out, as this build has no such learner: {names}"));
        }
        let mut figures = std::mem::take(&mut self.figures);
        self.jobs.run(|missing| self.draw(&mut figures, missing))
    }

    fn draw(
        &self,
        figures: &mut [(&'static Figure, Vec<MethodRuns>)],
        missing: &[&str],
    ) -> Result<(), Report> {
        let (folder, arguments) = (&self.jobs.folder, self.arguments());
        let open = self.jobs.all.iter().filter(|job| missing.contains(&&*job.name));
        for problem in
            open.filter_map(|job| folder.problem(job).unwrap_or_else(|e| Some(e.to_string())))
        {
            eprint_line(&problem);
        }
        let (mut sections, mut charts) = (String::new(), String::new());
        for (figure, methods) in figures {
            for method in &mut *methods {
                method.results =
                    method.jobs.iter().filter_map(|job| folder.result_of(job)).collect();
            }
            methods.retain(|method| !method.results.is_empty());
            if methods.is_empty() {
                let name = figure.name;
                eprint_line(&format!("{name}: no job is done, so there is nothing to draw"));
                continue;
            }
            let drawn = Drawn::write(figure, methods, folder)?;
            charts += &drawn.for_terminal(figure);
            sections += &report::section(figure, methods, &drawn);
        }
        let of_paper = FIGURES.iter().any(|figure| {
            let is_named = |name: &String| name == figure.name || name == "all";
            figure.is_of_paper() && self.options.figures.iter().any(is_named)
        });
        let head = report::head(&arguments, of_paper, missing, &self.unavailable);
        folder.write("report.md", (head + &sections).as_bytes())?;
        print_raw(&charts)
    }

    /// Returns the arguments that determine what is drawn, without those that say where and how to
    /// run.
    fn arguments(&self) -> String {
        let options = self.options;
        let mut words = vec!["reproduce".to_owned()];
        words.extend(options.figures.iter().cloned());
        words.push(format!("--budget {}", options.budget.name()));
        let numbers = [
            ("--updates", options.updates),
            ("--episodes", options.episodes),
            ("--steps", options.steps),
            ("--seeds", options.seeds),
            ("--eval-tasks", options.eval_tasks.map(u64::from)),
        ];
        for (name, value) in numbers {
            words.extend(value.map(|value| format!("{name} {value}")));
        }
        if options.figures.iter().any(|name| name == "ogbench") {
            words.push(format!("--data-dir {}", quoted(&options.data.folder.to_string_lossy())));
        }
        words.extend(options.set.iter().map(|setting| format!("--set {}", quoted(setting))));
        words.join(" ")
    }
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        assert_eq!(quoted("city-gdg-1-3f2a9c"), "city-gdg-1-3f2a9c");
        assert_eq!(quoted("relative_scales=[1]"), "'relative_scales=[1]'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
