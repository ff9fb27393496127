//! `gdg-tui maps` and `gdg-tui check`: facts about maps.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::CommandFactory;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Report, miette};

use crate::cli::Cli;
use crate::progress_bar;
use crate::report::from_map_error;
use gdg::files::has_extension;
use gdg::map::{self, BUILTIN, Cell, Components, Diameter, Grid, MapError, StepSearch};
use gdg::printing::eprint_line;
use gdg::text::{counted, nearest, sanitized};
use gdg::train::Registry;

/// A map with fewer free cells is a mistake.
const FEWEST_CELLS: usize = 4;

/// Returns the table of built-in maps.
pub fn list() -> String {
    let head =
        format!("{:<12}{:>9}{:>12}{:>18}\n", "map", "size", "free cells", "farthest (steps)");
    let lines = BUILTIN.iter().filter_map(|(name, _)| map::builtin(name)).map(|grid| {
        let size = format!("{}x{}", grid.width(), grid.height());
        let farthest = describe_diameter(Diameter::compute(&grid));
        format!("{:<12}{size:>9}{:>12}{farthest:>18}\n", grid.name(), grid.free_count())
    });
    std::iter::once(head).chain(lines).collect()
}

/// Validates a map or scenario file, or a built-in map, and returns the facts about it.
///
/// # Errors
/// Returns what is wrong with the file.
pub fn check(file: &Path, map_file: Option<&Path>) -> Result<String, Report> {
    let _spinner = Spinner::start("measuring the map");
    if !has_extension(file, "scen") {
        if map_file.is_some() {
            let help = "leave --map out, or give a .scen file with it";
            return Err(miette!(
                help = help,
                "{}: is not a scenario: --map goes with a .scen file",
                file.display()
            ));
        }
        let grid = find_map(file, &Registry::builtin())?;
        return Ok(facts(&grid, None));
    }
    let scenario = map::read_scenario(file).map_err(from_map_error)?;
    let path = map_file
        .map_or_else(|| map_beside(file, &scenario.map_name()), |path| Ok(path.to_owned()))?;
    let grid = map::load_map(&path).map_err(from_map_error)?;
    let tasks = scenario.tasks(&grid).map_err(from_map_error)?;
    scenario.check_lengths(&tasks, &grid).map_err(from_map_error)?;
    let longest = tasks.iter().map(|t| t.optimal_octile).fold(0.0, f64::max);
    let tasks = counted(tasks.len() as u64, "task");
    let facts = facts(&grid, scenario.other_map(&grid));
    Ok(format!("scenario: {tasks}, longest {longest:.1} cells\n{facts}"))
}

/// Returns the map of a scenario in the same folder: the one that it names, or the one that it is
/// named after.
fn map_beside(scenario: &Path, named: &str) -> Result<PathBuf, Report> {
    let after = scenario.file_stem().unwrap_or_default();
    let folder =
        scenario.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let others: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|f| f.path()).collect();
    let find = |name: &OsStr| {
        let exact = scenario.with_file_name(name);
        // Scenarios made on Windows may name it in other letters.
        let similar = || {
            others
                .iter()
                .find(|path| path.file_name().is_some_and(|own| own.eq_ignore_ascii_case(name)))
        };
        if exact.is_file() { Some(exact) } else { similar().filter(|path| path.is_file()).cloned() }
    };
    [OsStr::new(named), after]
        .into_iter()
        .filter(|name| !name.is_empty())
        .find_map(find)
        .ok_or_else(|| {
            let problem = format!("its map {named} is not in the same folder");
            from_map_error(MapError::whole_file(
                &scenario.to_string_lossy(),
                problem,
                "give it with --map FILE",
            ))
        })
}

/// Returns the facts about a map, and a line for each warning.
fn facts(grid: &Grid, other_map: Option<String>) -> String {
    let components = StepSearch::new(grid).components(grid);
    let free = grid.free_count();
    let largest = components.sizes[components.largest() as usize];
    let mut lines = vec![
        format!("map:        {}", grid.name()),
        format!("size:       {} x {}", grid.width(), grid.height()),
        format!("free cells: {free} ({:.1} %)", 100.0 * free as f64 / grid.free().len() as f64),
        format!(
            "components: {}, the largest {} ({:.1} % of the free cells)",
            components.sizes.len(),
            counted(largest as u64, "cell"),
            100.0 * largest as f64 / free as f64
        ),
        format!(
            "farthest:   {} steps",
            describe_diameter(Diameter::compute_from(grid, &components))
        ),
    ];
    if !grid.starts().is_empty() || !grid.goals().is_empty() {
        let (starts, goals) = (grid.starts().len() as u64, grid.goals().len() as u64);
        lines.push(format!("marked:     {}, {}", counted(starts, "start"), counted(goals, "goal")));
    }
    let warnings =
        doubts(grid).into_iter().chain(unconnected_parts(grid, &components)).chain(other_map);
    lines.extend(warnings.map(|problem| format!("warning:    {problem}")));
    lines.join("\n") + "\n"
}

/// Prints the warnings about a map.
pub fn warn(grid: &Grid) {
    warnings(grid).iter().for_each(|warning| eprint_line(warning));
}

/// Returns warnings about a map for its user, with its name.
pub fn warnings(grid: &Grid) -> Vec<String> {
    let named = |problem| format!("warning: {}: {problem}", sanitized(grid.name()));
    doubts(grid).into_iter().chain(unconnected(grid)).map(named).collect()
}

/// Returns what suggests that a map is not what its author meant.
fn doubts(grid: &Grid) -> Vec<String> {
    let free = grid.free_count();
    let few = format!(
        "the map has only {}: too few to learn anything",
        counted(free as u64, "free cell")
    );
    let few = (free < FEWEST_CELLS).then_some(few);
    let letters =
        grid.doubt().map(|doubt| format!("{doubt}: write walls as '#' and free cells as '.'"));
    letters.into_iter().chain(few).collect()
}

/// Returns what is wrong if starts and goals of a map lie in different components, or the starts
/// outside the largest.
fn unconnected(grid: &Grid) -> Option<String> {
    let has_starts = !grid.starts().is_empty();
    has_starts.then(|| unconnected_parts(grid, &StepSearch::new(grid).components(grid))).flatten()
}

fn unconnected_parts(grid: &Grid, components: &Components) -> Option<String> {
    disconnected_marks(grid, components).or_else(|| cut_off_starts(grid, components))
}

fn cut_off_starts(grid: &Grid, components: &Components) -> Option<String> {
    let own = components.of_cell[grid.index(*grid.starts().first()?)]?;
    let largest = components.largest();
    let is_reached =
        grid.starts().iter().any(|start| components.of_cell[grid.index(*start)] == Some(largest));
    (!is_reached).then(|| {
        let [own, largest] = [own, largest].map(|component| components.sizes[component as usize] as u64);
        let own = counted(own, "cell");
        format!("the start S is cut off, with {own}: agents that begin there stay there, but tasks are drawn among {largest} others")
    })
}

fn disconnected_marks(grid: &Grid, components: &Components) -> Option<String> {
    let component = |cell: &Cell| components.of_cell[grid.index(*cell)];
    let (starts, goals) = (grid.starts(), grid.goals());
    let (start, goal) = (starts.first()?, goals.first()?);
    let all = |cells: &[Cell]| cells.iter().map(component).collect::<BTreeSet<_>>();
    let which = match (starts, goals) {
        _ if all(starts) == all(goals) => return None,
        ([_], [_]) => "the start S and the goal G",
        _ if component(start) != component(goal) => "the first start S and the first goal G",
        _ => "some starts S and goals G",
    };
    Some(format!("{which} lie in different components: no path connects them"))
}

fn describe_diameter(diameter: Diameter) -> String {
    if diameter.exact { diameter.steps.to_string() } else { format!("at least {}", diameter.steps) }
}

/// A spinner on standard error, if that is a terminal, until it is dropped.
struct Spinner(ProgressBar);

impl Spinner {
    fn start(message: &'static str) -> Self {
        let bar = ProgressBar::with_draw_target(None, progress_bar::target());
        let bar = bar.with_style(ProgressStyle::default_spinner()).with_message(message);
        bar.enable_steady_tick(Duration::from_millis(100));
        Self(bar)
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Returns a path as the name of a built-in map or world, which it may be; those are UTF-8.
pub fn known_name(path: &Path) -> &str {
    path.to_str().unwrap_or_default()
}

/// Loads the built-in map or the file at `path`; errors also list the worlds of `registry` that
/// need no file.
///
/// # Errors
/// The file is invalid, or `path` is neither a built-in map nor a file.
pub fn find_map(path: &Path, registry: &Registry) -> Result<Grid, Report> {
    let name = known_name(path);
    if let Some(grid) = map::builtin(name) {
        return Ok(grid);
    }
    if registry.world(name).is_some_and(|kind| kind.create.is_some()) && !path.exists() {
        let help = "give a map: a built-in name or a file";
        return Err(miette!(
            help = help,
            "{name}: is a world without a map, which this command needs"
        ));
    }
    let looks_like_a_name = name != "-"
        && !path.exists()
        && path.extension().is_none()
        && path.components().count() == 1;
    if looks_like_a_name {
        let maps = map::BUILTIN.map(|(known, _)| known);
        let worlds =
            registry.worlds().iter().filter(|kind| kind.create.is_some()).map(|kind| kind.name);
        let worlds: Vec<&str> = worlds.collect();
        let commands: Vec<String> =
            Cli::command().get_subcommands().map(|c| c.get_name().to_owned()).collect();
        let names = maps.iter().chain(&worlds).copied().chain(commands.iter().map(String::as_str));
        let nearest =
            nearest(name, names).map_or(String::new(), |known| format!("did you mean {known}? "));
        let worlds = if worlds.is_empty() {
            String::new()
        } else {
            format!("; worlds: {}", worlds.join(", "))
        };
        let help =
            format!("{nearest}Built-in maps: {}{worlds}; or give a map file", maps.join(", "));
        return Err(from_map_error(MapError::whole_file(
            &path.to_string_lossy(),
            "is neither a built-in map nor a file",
            help,
        )));
    }
    map::load_map(path).map_err(|mut error| {
        if !path.exists() {
            error.help.push_str(", or a name from 'gdg-tui maps'");
        }
        from_map_error(error)
    })
}
