//! `gdg-tui maps` and `gdg-tui check`: facts about maps.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use miette::{Report, miette};

use crate::map::{self, BUILTIN, Cell, Components, Diameter, Grid, MapError, StepSearch};
use crate::report::from_map_error;
use crate::setup::find_map;
use crate::text::counted;
use crate::train::Registry;

/// Returns the table of built-in maps.
pub fn list() -> String {
    let head = format!("{:<12}{:>9}{:>12}{:>18}\n", "map", "size", "free cells", "farthest (steps)");
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
    if file.extension().is_none_or(|e| e != "scen") {
        if map_file.is_some() {
            let help = "leave --map out, or give a .scen file with it";
            return Err(miette!(help = help, "{}: is not a scenario: --map goes with a .scen file", file.display()));
        }
        return Ok(facts(&match file.to_str() {
            Some(name) => find_map(name, &Registry::builtin())?,
            None => map::load_map(file).map_err(from_map_error)?,
        }));
    }
    let beside = || -> Result<std::path::PathBuf, Report> {
        let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let stems = [name.trim_end_matches(".scen").to_owned(), first_map_name(file).unwrap_or_default()];
        let found = stems.iter().filter(|s| !s.is_empty()).map(|s| file.with_file_name(s)).find(|p| p.is_file());
        found.ok_or_else(|| {
            let problem = "the scenario's map is not in the same folder";
            from_map_error(MapError::whole_file(&file.to_string_lossy(), problem, "give it with --map FILE"))
        })
    };
    // Report an unreadable scenario before a missing map.
    if !file.is_file() {
        let unreadable = map::load_scenario(file, &Grid::empty("", 1, 1)).err();
        return Err(from_map_error(unreadable.unwrap_or_else(|| {
            MapError::whole_file(&file.to_string_lossy(), "is not a file", "give a scenario file")
        })));
    }
    let path = map_file.map_or_else(beside, |p| Ok(p.to_owned()))?;
    let grid = map::load_map(&path).map_err(from_map_error)?;
    let tasks = map::load_scenario(file, &grid).map_err(from_map_error)?;
    let longest = tasks.iter().map(|t| t.optimal_octile).fold(0.0, f64::max);
    let tasks = counted(tasks.len() as u64, "task");
    Ok(format!("scenario: {tasks}, longest {longest:.1} cells\n{}", facts(&grid)))
}

/// Returns the file name of the map that a scenario's first task names.
fn first_map_name(file: &Path) -> Option<String> {
    let text = std::fs::read_to_string(file).ok()?;
    let name = text.lines().nth(1)?.split('\t').nth(1)?.to_owned();
    Some(Path::new(&name).file_name()?.to_string_lossy().into_owned())
}

fn facts(grid: &Grid) -> String {
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
        format!("farthest:   {} steps", describe_diameter(Diameter::compute_from(grid, &components))),
    ];
    if !grid.starts().is_empty() || !grid.goals().is_empty() {
        let (starts, goals) = (grid.starts().len() as u64, grid.goals().len() as u64);
        lines.push(format!("marked:     {}, {}", counted(starts, "start"), counted(goals, "goal")));
        lines.extend(unconnected_parts(grid, &components).map(|problem| format!("warning:    {problem}")));
    }
    lines.join("\n") + "\n"
}

/// Returns what is wrong if starts and goals of a map lie in different components, or the starts outside the largest.
pub fn unconnected(grid: &Grid) -> Option<String> {
    let has_starts = !grid.starts().is_empty();
    has_starts.then(|| unconnected_parts(grid, &StepSearch::new(grid).components(grid))).flatten()
}

fn unconnected_parts(grid: &Grid, components: &Components) -> Option<String> {
    disconnected_marks(grid, components).or_else(|| cut_off_starts(grid, components))
}

fn cut_off_starts(grid: &Grid, components: &Components) -> Option<String> {
    let own = components.of_cell[grid.index(*grid.starts().first()?)]?;
    let largest = components.largest();
    let is_reached = grid.starts().iter().any(|start| components.of_cell[grid.index(*start)] == Some(largest));
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
        // Indicatif draws nothing if standard error is not a terminal.
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
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
