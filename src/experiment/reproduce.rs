//! `gdg-tui reproduce`: the figures of "Reinforcement Learning with Goal-Distance Gradient", one
//! command each, and the point mazes of OGBench.

mod curves;
mod datasets;
mod draw;
mod figures;
mod grip;
mod maps;
mod methods;
mod output;
mod panel;
mod report;
#[cfg(feature = "tui")]
mod terminal;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use miette::{Report, miette};

use super::folder::Folder;
use super::job::{Job, JobResult};
use super::plan::{Length, Plan};
use super::runner::Runner;
use super::suite::{any_failed, print, print_raw};
use super::world::JobWorld;
use crate::host::report::from_config_error;
use crate::host::setup::{parallel_jobs, settings_of, split_prefix};
use crate::host::status::EXIT_FAILURE;
pub use datasets::DataFolder;
pub use figures::{Budget, FIGURES, Figure};
use gdg::printing::eprint_line;
use gdg::text::counted;
use gdg::train::{Overrides, Preset, Registry, Run, settings_from};
use methods::Entry;

/// Which figures to reproduce, how, and where.
#[derive(Clone, Debug)]
pub struct Options {
    /// Names of figures, or `all` for those of the paper.
    pub figures: Vec<String>,
    /// How much to train.
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
    /// Where datasets are.
    pub data: DataFolder,
    /// Changes of settings of all methods, or of one, `[METHOD:]NAME=VALUE`.
    pub set: Vec<String>,
    /// Folder of jobs and results.
    pub out: PathBuf,
    /// Parallel jobs; otherwise one a core.
    pub jobs: Option<u16>,
    /// Whether to print a command per job instead.
    pub list_jobs: bool,
    /// Names or numbers of the only jobs to run.
    pub job: Vec<String>,
    /// Whether to report from finished jobs without running any.
    pub collect: bool,
    /// Whether checkpoints of finished jobs are kept.
    pub keep: bool,
}

/// Figures, ready to be reproduced.
pub struct Reproduction<'a> {
    options: &'a Options,
    registry: Arc<Registry>,
    folder: Folder,
    figures: Vec<FigureJobs>,
    /// All jobs, each once, in the order of the figures.
    jobs: Vec<Job>,
    /// Methods without a learner, which are left out.
    unavailable: Vec<&'static str>,
}

/// A figure and the jobs that it is drawn from.
struct FigureJobs {
    figure: &'static Figure,
    methods: Vec<MethodJobs>,
}

/// A method and its jobs, one per seed.
struct MethodJobs {
    entry: &'static Entry,
    jobs: Vec<Job>,
}

/// A method and the available results.
struct MethodResults {
    entry: &'static Entry,
    /// The jobs' plan, the same for every seed.
    plan: Plan,
    results: Vec<JobResult>,
}

/// Checks all arguments and lists the jobs.
///
/// # Errors
/// A setting or a job's name is invalid, or the folder is not writable.
pub fn prepare<'a>(
    options: &'a Options,
    registry: &Arc<Registry>,
) -> Result<Reproduction<'a>, Report> {
    let chosen = |figure: &&Figure| {
        let is_named = |name: &String| name == figure.name || name == "all" && figure.is_of_paper();
        options.figures.iter().any(is_named)
    };
    let chosen: Vec<&'static Figure> = FIGURES.iter().filter(chosen).collect();
    check_prefixes(&options.set, &chosen)?;
    if !options.collect {
        let entries = chosen.iter().flat_map(|figure| figure.methods);
        let datasets: Vec<&str> = entries.filter_map(|entry| entry.dataset).collect();
        options.data.collect(&datasets, parallel_jobs(options.jobs))?;
    }
    let (mut figures, mut unavailable) = (Vec::new(), BTreeSet::new());
    for figure in chosen {
        let mut methods = Vec::new();
        for entry in figure.methods {
            match entry.preset(registry) {
                Some(preset) => methods.push(MethodJobs {
                    entry,
                    jobs: jobs(figure, entry, preset, options, registry)?,
                }),
                None => drop(unavailable.insert(entry.name)),
            }
        }
        figures.push(FigureJobs { figure, methods });
    }
    let mut known = BTreeSet::new();
    let all = figures.iter().flat_map(|figure| &figure.methods).flat_map(|method| &method.jobs);
    let jobs: Vec<Job> = all.filter(|job| known.insert(job.name.clone())).cloned().collect();
    let unavailable = unavailable.into_iter().collect();
    let folder = Folder::new(&options.out);
    let own =
        Reproduction { options, registry: registry.clone(), folder, figures, jobs, unavailable };
    own.chosen()?;
    if options.collect {
        own.folder.check_has_jobs()?;
    }
    if !options.list_jobs {
        own.folder.check_writable(&[
            "report.md",
            "jobs/NAME.json",
            "data/NAME.json",
            "figures/NAME.png",
        ])?;
    }
    Ok(own)
}

/// Returns the jobs of a method in a figure, one per seed.
fn jobs(
    figure: &Figure,
    entry: &Entry,
    preset: Preset,
    options: &Options,
    registry: &Registry,
) -> Result<Vec<Job>, Report> {
    let own = entry.set.iter().map(|text| (*text).to_owned());
    let set: Vec<String> = own.chain(settings_of(entry.name, &options.set)).collect();
    let world = entry.world(figure.world);
    let defaults = registry.world_opened_by(&world).map_or(&[][..], |kind| kind.defaults);
    let settings = settings_from(preset, &Overrides { defaults, config: None, set: &set })
        .map_err(|error| {
            from_config_error(error)
                .wrap_err(format!("the settings of {} cannot be used", entry.name))
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
    let seeds = if figure.several_seeds {
        options.seeds.unwrap_or(figure.seeds(options.budget))
    } else {
        1
    };
    let job = |seed| {
        let run = Run { method: entry.method(), preset, seed, settings: settings.clone() };
        Job::new(JobWorld::find(&world, seed, registry)?, Some(entry.name), run, plan.clone())
    };
    (1..=seeds).map(job).collect()
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
    ///
    /// # Errors
    /// A file cannot be written, or a figure cannot be drawn.
    pub fn run(&self) -> Result<u8, Report> {
        if !self.unavailable.is_empty() {
            eprint_line(&format!(
                "left out, as this build has no such learner: {}",
                self.unavailable.join(", ")
            ));
        }
        if self.options.list_jobs {
            return print(&self.list()).map(|()| 0);
        }
        if self.options.collect {
            return self.draw();
        }
        let jobs = self.chosen()?.into_iter();
        let (parallel, keep) = (parallel_jobs(self.options.jobs), self.options.keep);
        let outcome = Runner::run_open(&self.folder, &self.registry, jobs, parallel, keep)?;
        let failed = any_failed(&outcome);
        if let Some(status) = outcome.interrupted {
            return Ok(status);
        }
        let drawn = if self.options.job.is_empty() { self.draw()? } else { 0 };
        Ok(if failed { EXIT_FAILURE } else { drawn })
    }

    /// Returns the jobs to run: those given with `--job`, or all.
    fn chosen(&self) -> Result<Vec<&Job>, Report> {
        if self.options.job.is_empty() {
            return Ok(self.jobs.iter().collect());
        }
        let find = |name: &String| {
            let line =
                name.parse::<usize>().ok().and_then(|line| self.jobs.get(line.checked_sub(1)?));
            line.or_else(|| self.jobs.iter().find(|job| job.name == *name)).ok_or_else(|| {
                let names: Vec<&str> = self.jobs.iter().map(|job| job.name.as_str()).collect();
                let help = format!(
                    "give a number from 1 to {}, or a name: {}",
                    names.len(),
                    names.join(", ")
                );
                miette!(help = help, "--job {name}: there is no such job")
            })
        };
        let mut chosen = self.options.job.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let mut seen = BTreeSet::new();
        chosen.retain(|job| seen.insert(&job.name));
        Ok(chosen)
    }

    /// Returns a complete command per job, one a line.
    fn list(&self) -> String {
        let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("gdg-tui"));
        let out =
            std::path::absolute(&self.options.out).unwrap_or_else(|_| self.options.out.clone());
        let (program, out) = (quoted(&program.to_string_lossy()), quoted(&out.to_string_lossy()));
        let command = self.arguments() + if self.options.keep { " --keep" } else { "" };
        let line =
            |job: &Job| format!("{program} {command} --out {out} --job {}\n", quoted(&job.name));
        self.jobs.iter().map(line).collect()
    }

    /// Returns the arguments that determine what is drawn, without those that say where and how to
    /// run.
    fn arguments(&self) -> String {
        let options = self.options;
        let mut words = vec!["reproduce".to_owned()];
        words.extend(options.figures.iter().cloned());
        words.extend(["--budget".to_owned(), options.budget.name().to_owned()]);
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
        if self.figures.iter().any(|jobs| !jobs.figure.is_of_paper()) {
            words.push(format!("--data-dir {}", quoted(&options.data.folder.to_string_lossy())));
        }
        words.extend(options.set.iter().map(|setting| format!("--set {}", quoted(setting))));
        words.join(" ")
    }

    /// Draws all figures from the available results and writes the report; returns the exit status.
    fn draw(&self) -> Result<u8, Report> {
        let mut missing = BTreeSet::new();
        let (mut sections, mut charts) = (Vec::new(), String::new());
        for FigureJobs { figure, methods } in &self.figures {
            let mut found = Vec::new();
            for MethodJobs { entry, jobs } in methods {
                let mut results = Vec::new();
                for job in jobs {
                    match self.folder.result_of(job) {
                        Some(result) => results.push(result),
                        None => {
                            if missing.insert(job.name.clone())
                                && let Some(problem) = self.folder.problem(job)
                            {
                                eprint_line(&problem);
                            }
                        }
                    }
                }
                if let Some(job) = jobs.first().filter(|_| !results.is_empty()) {
                    found.push(MethodResults { entry, plan: job.plan.clone(), results });
                }
            }
            if found.is_empty() {
                eprint_line(&format!(
                    "{}: no job is done, so there is nothing to draw",
                    figure.name
                ));
            } else {
                let drawn = output::Drawn::new(figure, &found)?;
                drawn.write(&self.folder, &self.arguments())?;
                charts += &drawn.for_terminal();
                sections.push(report::section(figure, &found, &drawn));
            }
        }
        let missing: Vec<String> = missing.into_iter().collect();
        let of_paper = self.figures.iter().any(|jobs| jobs.figure.is_of_paper());
        let arguments = self.arguments();
        let text = report::report(&arguments, of_paper, &sections, &missing, &self.unavailable);
        self.folder.write("report.md", text.as_bytes())?;
        print_raw(&charts)?;
        eprint_line(&format!("report: {}", self.folder.path("report.md").display()));
        if !missing.is_empty() {
            eprint_line(&format!(
                "{} missing: {}",
                counted(missing.len() as u64, "job"),
                missing.join(", ")
            ));
        }
        Ok(if missing.is_empty() { 0 } else { EXIT_FAILURE })
    }
}

/// Quotes a word for a shell if it needs that.
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
        assert_eq!(quoted("a folder"), "'a folder'");
        assert_eq!(quoted("relative_scales=[1]"), "'relative_scales=[1]'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }

    #[test]
    fn settings_may_name_a_method() {
        assert_eq!(split_prefix("gdg:hidden=17"), (Some("gdg"), "hidden=17"));
        assert_eq!(split_prefix("hidden=17"), (None, "hidden=17"));
        assert_eq!(split_prefix("name=a:b"), (None, "name=a:b"));
        let figures: Vec<&Figure> = FIGURES.iter().filter(|figure| figure.name == "fig6").collect();
        assert!(check_prefixes(&["gdg:hidden=17".to_owned()], &figures).is_ok());
        for method in ["gd", "her"] {
            let error = check_prefixes(&[format!("{method}:hidden=17")], &figures)
                .expect_err("no such method");
            assert!(
                error.to_string().contains(&format!("a method called \"{method}\"")),
                "{error}"
            );
            let help = error.help().map(|help| help.to_string()).unwrap_or_default();
            assert_eq!(
                help,
                "methods of fig6: default, default-gdg, gdg-bridge, gdg, ddpg, ddpg-distance"
            );
        }
    }
}
