//! The jobs of an experiment: listed, run, and reported.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use miette::{IntoDiagnostic, Report, WrapErr, miette};

use super::folder::Folder;
use super::spec::{JobResult, JobSpec};
use crate::host::runs::SAVES;
use crate::host::values::{counts, output, shares};
use crate::host::{EXIT_FAILURE, EXIT_NOT_REACHED};
use gdg::printing::{eprint_line, print_text};
use gdg::text::{aligned, counted, sanitized, sanitized_lines};
use gdg::train::{Evaluation, Registry};

/// A length below this share of the usual one says nothing about a method.
const SHORT: f64 = 0.1;

/// Which jobs run, how, and where.
#[derive(Clone, Debug, Args)]
pub struct JobOptions {
    /// Folder for jobs, their checkpoints, results and the report [default: saves/ and the command]
    #[arg(long, value_name = "FOLDER", value_parser = output())]
    pub out: Option<PathBuf>,

    /// Parallel jobs, each on one thread; results do not depend on their number [default: this
    /// machine's cores]
    #[arg(long, value_name = "N", value_parser = counts::<u16>(1..=256))]
    pub jobs: Option<u16>,

    /// Print one line per job, its name first, and exit
    #[arg(long, conflicts_with_all = ["job", "collect"])]
    pub list: bool,

    /// Run only this job, by its name or by its line in --list (repeatable), and report nothing
    #[arg(long, value_name = "NAME|N", conflicts_with = "collect")]
    pub job: Vec<String>,

    /// Run nothing: report from the jobs that are done
    #[arg(long)]
    pub collect: bool,

    /// Remove the checkpoints of finished jobs, which --resume needs
    #[arg(long)]
    pub no_keep: bool,

    /// Exit with status 3 unless every run's final success rate is at least X
    #[arg(long, value_name = "X", value_parser = shares())]
    pub require_success: Option<f64>,
}

/// The jobs of an experiment, each once, in order.
pub struct Jobs<'a> {
    pub all: Vec<JobSpec>,
    pub folder: Folder,
    pub registry: &'a Arc<Registry>,
    pub options: &'a JobOptions,
}

impl<'a> Jobs<'a> {
    /// Takes the jobs of a `command`, the same of which may be given several times. Checks that those
    /// named exist, and that results can be written.
    pub fn new(
        jobs: impl IntoIterator<Item = JobSpec>,
        options: &'a JobOptions,
        command: &str,
        registry: &'a Arc<Registry>,
    ) -> Result<Self, Report> {
        let mut known = BTreeSet::new();
        let all = jobs.into_iter().filter(|job| known.insert(job.name.clone())).collect();
        let folder = options.out.clone().unwrap_or_else(|| Path::new(SAVES).join(command));
        let jobs = Self { all, folder: Folder(folder), registry, options };
        jobs.chosen()?;
        if options.collect {
            jobs.folder.check_has_jobs()?;
        }
        if !options.list {
            jobs.folder.check_writable()?;
        }
        Ok(jobs)
    }

    /// Returns the jobs to run: those given with `--job`, or all.
    fn chosen(&self) -> Result<Vec<&JobSpec>, Report> {
        if self.options.job.is_empty() {
            return Ok(self.all.iter().collect());
        }
        let find = |name: &String| {
            let line = name.parse().ok().and_then(|line: usize| self.all.get(line.checked_sub(1)?));
            line.or_else(|| self.all.iter().find(|job| job.name == *name)).ok_or_else(|| {
                let names: Vec<&str> = self.all.iter().map(|job| job.name.as_str()).collect();
                let (all, names) = (names.len(), names.join(", "));
                let help = format!("give a number from 1 to {all}, or a name: {names}");
                miette!(help = help, "--job {name}: there is no such job")
            })
        };
        let mut chosen = self.options.job.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let mut seen = BTreeSet::new();
        chosen.retain(|job| seen.insert(&job.name));
        Ok(chosen)
    }

    /// Lists the jobs; or runs those without a result and, unless single ones were named, calls
    /// `report` with the names of those that have none yet. Returns the exit status.
    pub fn run(&self, report: impl FnOnce(&[&str]) -> Result<(), Report>) -> Result<u8, Report> {
        if self.options.list {
            return print(&self.list()).map(|()| 0);
        }
        let (chosen, collect) = (self.chosen()?, self.options.collect);
        let (mut any_failed, mut any_elsewhere) = (false, false);
        if !collect {
            let outcome = self.run_open(&chosen)?;
            if let Some(status) = outcome.interrupted {
                return Ok(status);
            }
            (any_failed, any_elsewhere) = (outcome.any_failed, outcome.any_elsewhere);
        }
        if self.options.job.is_empty() {
            let open = self.all.iter().filter(|job| self.folder.result_of(job).is_none());
            let missing: Vec<&str> = open.map(|job| &*job.name).collect();
            report(&missing)?;
            eprint_line(&format!("report: {}", self.folder.path("report.md").display()));
            if !missing.is_empty() {
                let names = missing.join(", ");
                eprint_line(&format!("{} missing: {names}", counted(missing.len() as u64, "job")));
                any_failed |= collect;
            }
        }
        Ok(match self.options.require_success {
            _ if any_failed => EXIT_FAILURE,
            Some(least) if self.any_below(&chosen, least) || any_elsewhere => EXIT_NOT_REACHED,
            _ => 0,
        })
    }

    fn list(&self) -> String {
        let row = |job: &JobSpec| {
            let variant = job.variant.as_ref().map_or(String::new(), |name| format!(" {name}"));
            let length = job.plan.length;
            vec![
                job.name.clone(),
                sanitized(job.world.name()),
                format!("{}{variant}", job.run.method),
                format!("seed {}", job.run.seed),
                format!("{:>7} {}", length.amount(), length.unit()),
                self.folder.state(job),
            ]
        };
        aligned(&self.all.iter().map(row).collect::<Vec<_>>())
    }

    /// Names the results below a success rate; returns whether there are any.
    fn any_below(&self, jobs: &[&JobSpec], required: f64) -> bool {
        let rate = |result: &JobResult| result.last().and_then(Evaluation::success_rate);
        let results = jobs.iter().filter_map(|job| self.folder.result_of(job));
        let is_below = |result: &JobResult| rate(result).is_none_or(|rate| rate < required);
        let below: Vec<JobResult> = results.filter(is_below).collect();
        for result in &below {
            let (name, rate) = (&result.name, rate(result));
            let rate = rate.map_or("-".to_owned(), |rate| format!("{rate:.3}"));
            eprint_line(&format!("{name}: success rate {rate} is below the required {required}"));
        }
        !below.is_empty()
    }
}

/// Warns if jobs train for far less than is `usual` for them, given in the same unit.
pub fn warn_if_short<'a>(jobs: impl IntoIterator<Item = (&'a JobSpec, u64)>) {
    let is_short =
        |(job, usual): &(&JobSpec, u64)| (job.plan.length.amount() as f64) < SHORT * *usual as f64;
    if let Some((job, usual)) = jobs.into_iter().find(is_short) {
        let (name, length) = (job.world.name(), job.plan.length);
        eprint_line(&sanitized(&format!(
            "warning: {} {} on {name}, where {usual} are usual, are too few to compare methods",
            length.amount(),
            length.unit()
        )));
    }
}

/// Prints to standard output, made safe to display.
pub fn print(text: &str) -> Result<(), Report> {
    print_raw(&sanitized_lines(text))
}

/// Prints text of our own, which may contain colours, to standard output. An early close (`| head`)
/// is not an error.
pub fn print_raw(text: &str) -> Result<(), Report> {
    print_text(text).into_diagnostic().wrap_err("standard output")
}
