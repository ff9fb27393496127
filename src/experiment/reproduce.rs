//! `gdg-tui reproduce`: the figures of "Reinforcement Learning with Goal-Distance Gradient", one command each.

mod curves;
mod draw;
mod figures;
mod maps;
mod methods;
mod output;
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
use crate::cli::{EXIT_FAILURE, ReproduceArgs};
use crate::report::from_config_error;
use crate::setup::{find_map, settings_of, split_prefix, threads};
use crate::text::{counted, eprint_line};
use crate::train::{Overrides, Preset, Registry, Run, settings_from};
pub use figures::{FIGURES, Figure};
use methods::{ENTRIES, Entry};

/// Figures, ready to be reproduced.
pub struct Reproduction<'a> {
    args: &'a ReproduceArgs,
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

/// A method and the results that there are.
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
pub fn prepare<'a>(args: &'a ReproduceArgs, registry: &Arc<Registry>) -> Result<Reproduction<'a>, Report> {
    check_prefixes(&args.set)?;
    let chosen = |figure: &&Figure| args.figures.iter().any(|name| name == figure.name || name == "all");
    let (mut figures, mut unavailable) = (Vec::new(), BTreeSet::new());
    for figure in FIGURES.iter().filter(chosen) {
        let mut methods = Vec::new();
        for entry in figure.methods.iter().filter_map(|name| Entry::named(name)) {
            match entry.preset(registry) {
                Some(preset) => methods.push(MethodJobs { entry, jobs: jobs(figure, entry, preset, args, registry)? }),
                None => drop(unavailable.insert(entry.name)),
            }
        }
        figures.push(FigureJobs { figure, methods });
    }
    let mut known = BTreeSet::new();
    let all = figures.iter().flat_map(|figure| &figure.methods).flat_map(|method| &method.jobs);
    let jobs: Vec<Job> = all.filter(|job| known.insert(job.name.clone())).cloned().collect();
    let unavailable = unavailable.into_iter().collect();
    let folder = Folder::new(&args.out);
    let own = Reproduction { args, registry: registry.clone(), folder, figures, jobs, unavailable };
    own.chosen()?;
    if !args.list_jobs {
        own.folder.check_writable(&["report.md", "jobs/NAME.json", "data/NAME.json", "figures/NAME.png"])?;
    }
    Ok(own)
}

/// Returns the jobs of a method in a figure, one per seed.
fn jobs(
    figure: &Figure,
    entry: &Entry,
    preset: Preset,
    args: &ReproduceArgs,
    registry: &Registry,
) -> Result<Vec<Job>, Report> {
    let map = find_map(figure.map, registry)?;
    let own = entry.set.iter().map(|text| (*text).to_owned());
    let set: Vec<String> = own.chain(settings_of(entry.name, &args.set)).collect();
    let settings = settings_from(preset, &Overrides { config: None, set: &set }).map_err(from_config_error)?;
    let mut plan = figure.plan(args.budget, entry.name);
    let length = args.updates.map(Length::Updates).or(args.episodes.map(Length::Episodes));
    plan.length = length.unwrap_or(plan.length);
    if let Some(tasks) = args.eval_tasks {
        (plan.eval_tasks, plan.last_tasks) = (plan.eval_tasks.min(tasks), tasks);
    }
    let seeds = if figure.several_seeds { args.seeds.unwrap_or(figure.seeds()) } else { 1 };
    let run = |seed| Run { method: entry.method(), preset, seed, settings: settings.clone() };
    (1..=seeds).map(|seed| Job::new(&map, Some(entry.name), run(seed), plan.clone())).collect()
}

/// Checks the methods named by `--set`.
fn check_prefixes(set: &[String]) -> Result<(), Report> {
    let unknown = |method: &&str| Entry::named(method).is_none();
    let Some(method) = set.iter().filter_map(|text| split_prefix(text).0).find(unknown) else {
        return Ok(());
    };
    let names = ENTRIES.map(|entry| entry.name).join(", ");
    Err(miette!(help = format!("methods: {names}"), "--set {method}:...: there is no method called {method:?}"))
}

impl Reproduction<'_> {
    /// Runs, draws or lists; returns the exit status.
    ///
    /// # Errors
    /// A file cannot be written, or a figure cannot be drawn.
    pub fn run(&self) -> Result<u8, Report> {
        if !self.unavailable.is_empty() {
            eprint_line(&format!("left out, as this build has no such learner: {}", self.unavailable.join(", ")));
        }
        if self.args.list_jobs {
            return print(&self.list()).map(|()| 0);
        }
        if self.args.collect {
            return self.draw();
        }
        let place = (&self.folder, &self.registry);
        let jobs = self.chosen()?.into_iter();
        let outcome = Runner::run_open(place, jobs, threads(self.args.jobs), self.args.keep)?;
        let failed = any_failed(&outcome);
        if let Some(status) = outcome.interrupted {
            return Ok(status);
        }
        let drawn = if self.args.job.is_empty() { self.draw()? } else { 0 };
        Ok(if failed { EXIT_FAILURE } else { drawn })
    }

    /// Returns the jobs to run: those given with `--job`, or all.
    fn chosen(&self) -> Result<Vec<&Job>, Report> {
        if self.args.job.is_empty() {
            return Ok(self.jobs.iter().collect());
        }
        let find = |name: &String| {
            let line = name.parse::<usize>().ok().and_then(|line| self.jobs.get(line.checked_sub(1)?));
            line.or_else(|| self.jobs.iter().find(|job| job.name == *name)).ok_or_else(|| {
                let names: Vec<&str> = self.jobs.iter().map(|job| job.name.as_str()).collect();
                let help = format!("give a number from 1 to {}, or a name: {}", names.len(), names.join(", "));
                miette!(help = help, "--job {name}: there is no such job")
            })
        };
        self.args.job.iter().map(find).collect()
    }

    /// Returns a complete command per job, one a line.
    fn list(&self) -> String {
        let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("gdg-tui"));
        let out = std::path::absolute(&self.args.out).unwrap_or_else(|_| self.args.out.clone());
        let (program, out) = (quoted(&program.to_string_lossy()), quoted(&out.to_string_lossy()));
        let command = self.arguments();
        let line = |job: &Job| format!("{program} {command} --out {out} --job {}\n", quoted(&job.name));
        self.jobs.iter().map(line).collect()
    }

    /// Returns the arguments that determine what is drawn, without those that say where and how to run.
    fn arguments(&self) -> String {
        let args = self.args;
        let mut words = vec!["reproduce".to_owned()];
        words.extend(args.figures.iter().cloned());
        words.extend(["--budget".to_owned(), args.budget.name().to_owned()]);
        let numbers = [
            ("--updates", args.updates),
            ("--episodes", args.episodes),
            ("--seeds", args.seeds),
            ("--eval-tasks", args.eval_tasks.map(u64::from)),
        ];
        for (name, value) in numbers {
            words.extend(value.map(|value| format!("{name} {value}")));
        }
        words.extend(args.set.iter().map(|setting| format!("--set {}", quoted(setting))));
        words.join(" ")
    }

    /// Draws all figures from the results that there are and writes the report; returns the exit status.
    fn draw(&self) -> Result<u8, Report> {
        let mut missing = BTreeSet::new();
        let mut sections = Vec::new();
        for FigureJobs { figure, methods } in &self.figures {
            let mut found = Vec::new();
            for MethodJobs { entry, jobs } in methods {
                let mut results = Vec::new();
                for job in jobs {
                    match self.folder.result_of(job) {
                        Some(result) => results.push(result),
                        None => drop(missing.insert(job.name.clone())),
                    }
                }
                if let Some(job) = jobs.first().filter(|_| !results.is_empty()) {
                    found.push(MethodResults { entry, plan: job.plan.clone(), results });
                }
            }
            if found.is_empty() {
                eprint_line(&format!("{}: no job is done, so there is nothing to draw", figure.name));
            } else {
                let drawn = output::Drawn::new(figure, &found)?;
                drawn.write(&self.folder, &self.arguments())?;
                print_raw(&drawn.for_terminal())?;
                sections.push(report::section(figure, &found, &drawn));
            }
        }
        let missing: Vec<String> = missing.into_iter().collect();
        let text = report::report(&self.arguments(), &sections, &missing, &self.unavailable);
        self.folder.write("report.md", text.as_bytes())?;
        eprint_line(&format!("report: {}", self.folder.path("report.md").display()));
        if !missing.is_empty() {
            eprint_line(&format!("{} missing: {}", counted(missing.len() as u64, "job"), missing.join(", ")));
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
        assert!(check_prefixes(&["gdg:hidden=17".to_owned()]).is_ok());
        let error = check_prefixes(&["gd:hidden=17".to_owned()]).expect_err("no such method");
        assert!(error.to_string().contains("no method called \"gd\""), "{error}");
    }
}
