//! `gdg-tui check`: validates a map or scenario file and prints facts about it.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use miette::{Report, miette};

use super::{CommandOutcome, bad_input, print};
use crate::cli::CheckArgs;
use crate::process::EXIT_NOT_REACHED;
use crate::process::errors::from_map_error;
use crate::process::waiting::Waiting;
use crate::setup::find_maps::{doubts, faults, find_map};
use gdg::files::has_extension;
use gdg::job::Job;
use gdg::map::{self, Components, Diameter, Grid, MapError, MapScale, Scenario};
use gdg::text::{counted, grouped};
use gdg::train::Registry;

/// Prints the facts about a map or scenario file, or a built-in map; the exit status says whether
/// `strict` finds a fault.
pub fn run(args: &CheckArgs, registry: &Registry) -> CommandOutcome {
    let (text, grid) = checked(args, registry).map_err(bad_input)?;
    let faults = faults(&grid);
    let kind = if args.strict { "fault:  " } else { "warning:" };
    let lines: String = faults.iter().map(|fault| format!("{kind}    {fault}\n")).collect();
    print(&(text + &lines))?;
    Ok(if args.strict && !faults.is_empty() { EXIT_NOT_REACHED } else { 0 })
}

/// Returns the facts about a file, and the map.
fn checked(args: &CheckArgs, registry: &Registry) -> Result<(String, Grid), Report> {
    let (file, map_file, reading) = (&args.file, &args.map, &(&args.reading).into());
    let progress = &Waiting::on("measuring the map");
    if !has_extension(file, "scen") {
        if map_file.is_some() {
            let help = "leave --map out, or give a .scen file with it";
            let problem = format!("{}: is not a scenario", file.display());
            return Err(miette!(help = help, "{problem}: --map goes with a .scen file"));
        }
        let grid = find_map(file, reading, registry)?;
        let Some(scenario) = map::agents_of(file).map_err(from_map_error)? else {
            return Ok((facts(&grid, None, progress), grid));
        };
        return Ok((tasks(&scenario, &grid, progress)?, grid));
    }
    let scenario = map::read_scenario(file).map_err(from_map_error)?;
    let path = map_file.clone().map_or_else(|| map_beside(file, &scenario.map_name()), Ok)?;
    let grid = map::load_map_as(&path, reading).map_err(from_map_error)?;
    Ok((tasks(&scenario, &grid, progress)?, grid))
}

/// Returns the facts about a scenario and its map.
fn tasks(scenario: &Scenario, grid: &Grid, progress: &Job) -> Result<String, Report> {
    let tasks = scenario.tasks(grid).map_err(from_map_error)?;
    scenario.check_paths(&tasks, grid).map_err(from_map_error)?;
    let longest = tasks.iter().filter_map(|t| t.optimal_octile).reduce(f64::max);
    let longest = longest.map(|n| format!(", longest {n:.1} cells (octile)")).unwrap_or_default();
    let tasks = counted(tasks.len() as u64, "task");
    let facts = facts(grid, scenario.other_map(grid), progress);
    Ok(format!("scenario: {tasks}{longest}\n{facts}"))
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
        // Scenarios made on Windows may name it with other capitals.
        let is_similar = |path: &&PathBuf| {
            path.is_file() && path.file_name().is_some_and(|own| own.eq_ignore_ascii_case(name))
        };
        if exact.is_file() { Some(exact) } else { others.iter().find(is_similar).cloned() }
    };
    let mut names = [OsStr::new(named), after].into_iter().filter(|name| !name.is_empty());
    names.find_map(find).ok_or_else(|| {
        let problem = format!("its map {named} is not in the same folder");
        let (file, help) = (scenario.to_string_lossy(), "give it with --map FILE");
        from_map_error(MapError::whole_file(&file, problem, help))
    })
}

/// Returns the facts about a map, and a line for each warning.
fn facts(grid: &Grid, other_map: Option<String>, progress: &Job) -> String {
    let components = Components::of(grid);
    let (free, all) = (grid.free_count(), grid.free().len());
    let largest = components.sizes[components.largest() as usize];
    let mut lines = vec![
        format!("map:        {}", grid.name()),
        format!("size:       {} x {}", grid.width(), grid.height()),
        format!("free cells: {} ({:.1} %)", grouped(free as u64), 100.0 * free as f64 / all as f64),
        format!(
            "components: {}, the largest {} ({:.1} % of the free cells)",
            grouped(components.sizes.len() as u64),
            counted(largest as u64, "cell"),
            100.0 * largest as f64 / free as f64
        ),
        format!("farthest:   {}", in_steps(Diameter::compute_from(grid, &components, progress))),
    ];
    if !grid.starts().is_empty() || !grid.goals().is_empty() {
        let (starts, goals) = (grid.starts().len() as u64, grid.goals().len() as u64);
        lines.push(format!("marked:     {}, {}", counted(starts, "start"), counted(goals, "goal")));
    }
    let scale = grid.scale();
    if scale != MapScale::default() {
        lines.push(format!(
            "scale:      {} a block, walls wider by {}, goals reached within {}",
            counted(scale.cell as u64, "cell"),
            scale.margin,
            scale.goal_radius
        ));
    }
    let all = doubts(grid).into_iter().chain(other_map);
    lines.extend(all.map(|problem| format!("warning:    {problem}")));
    lines.join("\n") + "\n"
}

pub fn in_steps(diameter: Diameter) -> String {
    let steps = counted(diameter.steps.into(), "step");
    if diameter.exact { steps } else { format!("at least {steps}") }
}
