//! `gdg-tui suite`: trains on every map and writes a table and a report.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, WrapErr, miette};

use super::folder::{Folder, State};
use super::job::{Job, JobResult};
use super::plan::Plan;
use super::plot::{self, By, Drawn};
use super::report::{CURVES, report};
use super::runner::{End, Outcome, Runner};
use super::runs::SavedRun;
use super::table::{Row, table};
use super::world::{JobWorld, told_apart};
use crate::figure::Format;
use crate::host::maps::{find_map, warn, warnings};
use crate::host::report::from_map_error;
use crate::host::setup::{self, RunChoice, parallel_jobs, split_prefix};
use crate::host::status::{EXIT_FAILURE, EXIT_NOT_REACHED};
use crate::host::waiting::Waiting;
use gdg::env::maze;
use gdg::files::{has_extension, is_hidden};
use gdg::map::{Grid, Reading, builtin, load_map_as};
use gdg::printing::eprint_line;
use gdg::printing::print_text;
use gdg::text::{aligned, counted, sanitized, sanitized_lines};
use gdg::train::{METHODS, Method, Preset, Registry};

/// What to train on, and where results go.
#[derive(Clone, Debug)]
pub struct Options {
    /// Built-in maps, map files, and folders of them.
    pub maps: Vec<PathBuf>,
    /// How they are read.
    pub reading: Reading,
    /// Updates per map; otherwise by its size.
    pub budget: Option<u64>,
    /// Runs per map, with seeds 1, 2, ...
    pub seeds: u64,
    /// Evaluation tasks at each distance.
    pub eval_tasks: u32,
    /// Folder of the results.
    pub out: PathBuf,
    /// Parallel jobs; otherwise one a core.
    pub jobs: Option<u16>,
    /// The methods.
    pub methods: Vec<Method>,
    /// The preset to start from; otherwise that of each method.
    pub preset: Option<Preset>,
    /// A settings file.
    pub config: Option<PathBuf>,
    /// Changes of single settings, `[NAME:]SETTING=VALUE`: of all runs, of one method, or of a
    /// variant.
    pub set: Vec<String>,
    /// Whether to print the jobs instead.
    pub list: bool,
    /// Names of the only jobs to run.
    pub job: Vec<String>,
    /// Whether checkpoints of finished jobs are kept.
    pub keep: bool,
    /// The success rate that every run has to reach.
    pub require_success: Option<f64>,
}

/// Default budgets: maximum number of free cells, and updates.
const BUDGETS: [(usize, u64); 2] = [(6_000, 60_000), (50_000, 200_000)];

/// Default updates on larger maps.
const LARGEST_BUDGET: u64 = 600_000;

/// A suite, ready to run.
pub struct Suite<'a> {
    options: &'a Options,
    registry: Arc<Registry>,
    folder: Folder,
    /// The jobs of each map, method and variant, a job per seed.
    groups: Vec<Vec<Job>>,
}

/// A method with settings of its own.
struct Variant {
    name: Option<String>,
    run: RunChoice,
}

impl Variant {
    /// Returns the method and the name, as in names of jobs.
    fn label(&self) -> String {
        let method = self.run.method.name();
        self.name.as_ref().map_or(method.clone(), |name| format!("{method}-{name}"))
    }
}

/// Returns every method as it is, and with the settings of each variant.
///
/// # Errors
/// A setting is of a method that is not trained, or a variant's name has characters that names of
/// files may not have.
fn variants(options: &Options) -> Result<Vec<Variant>, Report> {
    let methods: Vec<String> = options.methods.iter().map(Method::name).collect();
    let mut names: Vec<Option<&str>> = vec![None];
    for name in options.set.iter().filter_map(|text| split_prefix(text).0) {
        if !methods.iter().any(|method| method == name) && !names.contains(&Some(name)) {
            check_name(name, &methods)?;
            names.push(Some(name));
        }
    }
    let variant = |method: &Method, name: Option<&str>| {
        let is_own = |text: &&String| match split_prefix(text).0 {
            Some(prefix) => prefix == method.name() || Some(prefix) == name,
            None => true,
        };
        let own = options.set.iter().filter(is_own).map(|text| split_prefix(text).1.to_owned());
        let (preset, config) = (options.preset, options.config.clone());
        let run = RunChoice { method: method.clone(), preset, config, set: own.collect() };
        Variant { name: name.map(str::to_owned), run }
    };
    let of_method =
        |method| names.iter().map(move |name| variant(method, *name)).collect::<Vec<_>>();
    Ok(options.methods.iter().flat_map(of_method).collect())
}

/// Checks the name of a variant.
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

/// Reads all maps and checks all arguments.
///
/// # Errors
/// A map, a setting or a job's name is invalid, or the folder is not writable.
pub fn prepare<'a>(options: &'a Options, registry: &Arc<Registry>) -> Result<Suite<'a>, Report> {
    let (mut groups, mut known) = (Vec::new(), BTreeSet::new());
    let variants = variants(options)?;
    let job = |map: &Grid, variant: &Variant, seed, plan: &Plan| {
        let run = setup::run(&variant.run, Path::new(maze::KIND.name), registry, seed)?;
        let world = JobWorld::maze(map, seed);
        let job = Job::new(world, Some(&variant.label()), run, plan.clone())?;
        Ok::<_, Report>(Job { variant: variant.name.clone(), ..job })
    };
    for map in &options.maps {
        for grid in maps(map, &options.reading, registry)? {
            let updates = options.budget.unwrap_or_else(|| default_budget(&grid));
            let plan = Plan::suite(updates, options.eval_tasks);
            for variant in &variants {
                let jobs = (1..=options.seeds).map(|seed| job(&grid, variant, seed, &plan));
                let mut jobs = jobs.collect::<Result<Vec<_>, _>>()?;
                // The same map may be given twice, by itself and in its folder.
                jobs.retain(|job| known.insert(job.name.clone()));
                if !jobs.is_empty() {
                    groups.push(jobs);
                }
            }
        }
    }
    let suite =
        Suite { options, registry: registry.clone(), folder: Folder::new(&options.out), groups };
    suite.check_names()?;
    for method in &options.methods {
        registry.learner(&method.learner).into_diagnostic()?;
    }
    if !options.list {
        suite.folder.check_writable(&[
            "report.md",
            CURVES,
            "jobs/NAME.json",
            "pictures/NAME.png",
        ])?;
    }
    Ok(suite)
}

/// Returns the built-in map or the map file called `folder`, or all `.map` files of that folder,
/// sorted by name; all `.txt` files if it has none. Hidden files are left out.
fn maps(folder: &Path, reading: &Reading, registry: &Registry) -> Result<Vec<Grid>, Report> {
    if !folder.is_dir() || folder.to_str().is_some_and(|name| builtin(name).is_some()) {
        let map = find_map(folder, reading, registry)?;
        warn(&map);
        return Ok(vec![map]);
    }
    let name = folder.display();
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<std::io::Result<Vec<_>>>);
    let entries = entries.into_diagnostic().wrap_err_with(|| format!("{name}: cannot be read"))?;
    let files: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
    let ending = |extension: &str| {
        let is_map =
            |path: &&PathBuf| has_extension(path, extension) && !is_hidden(path) && path.is_file();
        files.iter().filter(is_map).cloned().collect::<Vec<_>>()
    };
    // Text files beside maps are likely to describe them.
    let (maps, texts) = (ending("map"), ending("txt"));
    if !maps.is_empty() && !texts.is_empty() {
        let left_out = counted(texts.len() as u64, ".txt file");
        eprint_line(&format!(
            "{name}: {left_out} left out, as there are .map files: name those that are maps"
        ));
    }
    let mut files = if maps.is_empty() { texts } else { maps };
    files.sort();
    if files.is_empty() {
        let help = "give a folder of .map or .txt files, map files, or names from 'gdg-tui maps'";
        return Err(miette!(help = help, "{name}: the folder has no .map or .txt files"));
    }
    let working = Waiting::on("reading the maps");
    working.begin(0, 1);
    let load = |(i, path): (usize, &PathBuf)| {
        working.set(i, files.len());
        load_map_as(path, reading).map(|map| (warnings(&map), map)).map_err(from_map_error)
    };
    let loaded = files.iter().enumerate().map(load).collect::<Result<Vec<_>, Report>>()?;
    drop(working);
    let said = |(warnings, map): (Vec<String>, Grid)| {
        warnings.iter().for_each(|warning| eprint_line(warning));
        map
    };
    Ok(loaded.into_iter().map(said).collect())
}

fn default_budget(map: &Grid) -> u64 {
    let free = map.free_count();
    BUDGETS.iter().find(|(cells, _)| free <= *cells).map_or(LARGEST_BUDGET, |(_, updates)| *updates)
}

impl Suite<'_> {
    /// Returns all jobs, map by map.
    fn jobs(&self) -> impl Iterator<Item = &Job> {
        self.groups.iter().flatten()
    }

    /// Checks the names given with `--job`.
    fn check_names(&self) -> Result<(), Report> {
        let unknown = |name: &&String| self.jobs().all(|job| job.name != **name);
        let Some(name) = self.options.job.iter().find(unknown) else { return Ok(()) };
        let names: Vec<&str> = self.jobs().map(|job| job.name.as_str()).collect();
        Err(miette!(
            help = format!("jobs: {}", names.join(", ")),
            "--job {name}: there is no such job"
        ))
    }

    /// Runs the jobs, prints the table and writes the report; returns the exit status.
    ///
    /// # Errors
    /// The report cannot be written.
    pub fn run(&self) -> Result<u8, Report> {
        if self.options.list {
            return print(&self.list()).map(|()| 0);
        }
        let chosen =
            |job: &&Job| self.options.job.is_empty() || self.options.job.contains(&job.name);
        let jobs = self.jobs().filter(chosen);
        let (parallel, keep) = (parallel_jobs(self.options.jobs), self.options.keep);
        let outcome = Runner::run_open(&self.folder, &self.registry, jobs, parallel, keep)?;
        let rows = self.rows();
        let caption = self.draw_curves(&rows)?;
        let text = report(&rows, &self.folder, caption.as_deref());
        self.folder.write("report.md", text.as_bytes())?;
        print(&table(&rows))?;
        eprint_line(&format!("report: {}", self.folder.path("report.md").display()));
        let failed = any_failed(&outcome);
        match outcome.interrupted {
            Some(status) => Ok(status),
            None if failed => Ok(EXIT_FAILURE),
            None => Ok(self.required_success(&outcome)),
        }
    }

    /// Returns a line per job.
    fn list(&self) -> String {
        let row = |job: &Job| {
            let state = match self.folder.state(job) {
                State::NotBegun => "not begun".to_owned(),
                State::Begun(updates) => format!("begun, {updates} updates done"),
                State::Done(_) => "done".to_owned(),
            };
            let (name, map, seed) = (&job.name, sanitized(job.world.name()), job.run.seed);
            let variant = job.variant.as_ref().map_or(String::new(), |name| format!(" {name}"));
            let method = format!("{}{variant}", job.run.method);
            let cells = job.world.map().map_or(0, |map| map.free_count());
            let updates = job.plan.length.amount();
            let (cells, updates) = (format!("{cells:>8} cells"), format!("{updates:>7} updates"));
            vec![name.clone(), map, method, cells, format!("seed {seed}"), updates, state]
        };
        aligned(&self.jobs().map(row).collect::<Vec<_>>())
    }

    /// Returns the rows of the table: those of these jobs, with the results there are, and those of
    /// other runs in the folder, so that no method's results replace those of another.
    fn rows(&self) -> Vec<Row> {
        let own = |jobs: &Vec<Job>| {
            let results = jobs.iter().filter_map(|job| self.folder.result_of(job)).collect();
            Row::of(jobs, results)
        };
        let mut rows: Vec<Row> = self.groups.iter().filter_map(own).collect();
        let (results, problems) = self.folder.results();
        problems.iter().for_each(|problem| eprint_line(&format!("{problem}: left out")));
        for result in results.into_iter().filter(|result| result.map.is_some()) {
            if let Some(row) = rows.iter_mut().find(|row| row.is_of(&result)) {
                row.add(result);
            } else {
                let last = rows.iter().rposition(|row| row.map == result.world);
                rows.insert(last.map_or(rows.len(), |i| i + 1), Row::other(result));
            }
        }
        let maps = rows.iter().map(|row| (&*row.map, row.fingerprint.as_deref()));
        let names = told_apart(&maps.collect::<Vec<_>>());
        rows.iter_mut().zip(names).for_each(|(row, name)| row.map = name);
        rows
    }

    /// Draws the learning curves, a chart for each map; returns their caption, or `None` without
    /// results.
    fn draw_curves(&self, rows: &[Row]) -> Result<Option<String>, Report> {
        let results =
            rows.iter().flat_map(|row| &row.results).filter(|r| !r.evaluations.is_empty());
        let run = |result: &JobResult| {
            let file = self.folder.path(&format!("jobs/{}.json", result.name));
            SavedRun::of_result(result.clone(), file)
        };
        let runs: Vec<SavedRun> = results.map(run).collect();
        if runs.is_empty() {
            return Ok(None);
        }
        let options =
            plot::Options { by: vec![By::Method, By::Setting], ..plot::Options::default() };
        let Drawn { sheet, table, caption, notes } = plot::draw(&runs, &options)?;
        notes.iter().for_each(|note| eprint_line(note));
        self.folder.write(CURVES, &Format::Svg.encode(&sheet)?)?;
        self.folder.write("success.csv", &table)?;
        Ok(Some(caption))
    }

    /// Returns the exit status for `--require-success` and reports the jobs below it. Jobs that run
    /// in other processes have not reached it yet.
    fn required_success(&self, Outcome { ends, .. }: &Outcome) -> u8 {
        let Some(required) = self.options.require_success else { return 0 };
        let elsewhere = ends.contains(&End::Elsewhere);
        let results = self.jobs().filter_map(|job| self.folder.result_of(job));
        let rate =
            |result: &JobResult| result.last().and_then(gdg::train::Evaluation::success_rate);
        let below: Vec<_> =
            results.filter(|result| rate(result).is_none_or(|rate| rate < required)).collect();
        for result in &below {
            let rate = rate(result).map_or("-".to_owned(), |rate| format!("{rate:.3}"));
            eprint_line(&format!(
                "{}: success rate {rate} is below the required {required}",
                result.name
            ));
        }
        if below.is_empty() && !elsewhere { 0 } else { EXIT_NOT_REACHED }
    }
}

/// Reports which jobs failed and which run elsewhere; returns whether any failed.
pub(super) fn any_failed(Outcome { open, ends, .. }: &Outcome) -> bool {
    let named = |wanted: End| {
        let names = open
            .iter()
            .zip(ends)
            .filter(|(_, end)| **end == wanted)
            .map(|(job, _)| job.name.as_str());
        names.collect::<Vec<_>>()
    };
    let (failed, elsewhere) = (named(End::Failed), named(End::Elsewhere));
    if !failed.is_empty() {
        eprint_line(&format!(
            "{} failed: {}",
            counted(failed.len() as u64, "job"),
            failed.join(", ")
        ));
    }
    if !elsewhere.is_empty() {
        let names = elsewhere.join(", ");
        eprint_line(&format!(
            "other processes run {names}: once they are done, run this again for the whole report"
        ));
    }
    !failed.is_empty()
}

/// Prints to standard output, made safe to display.
///
/// # Errors
/// See [`print_raw`].
pub(super) fn print(text: &str) -> Result<(), Report> {
    print_raw(&sanitized_lines(text))
}

/// Prints text of our own, which may contain colours, to standard output. An early close (`| head`)
/// is not an error.
///
/// # Errors
/// It cannot be written.
pub(super) fn print_raw(text: &str) -> Result<(), Report> {
    print_text(text).into_diagnostic().wrap_err("standard output")
}
