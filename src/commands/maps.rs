//! `gdg-tui maps`: the built-in maps, random ones, and maps in other formats.

use miette::{Report, miette};

use super::check::in_steps;
use super::{CommandOutcome, bad_input, print};
use crate::cli::{ConvertArgs, MapsArgs, MapsCommand};
use crate::process::errors::from_map_error;
use crate::process::waiting::Waiting;
use crate::setup::find_maps::{find_map, warnings};
use crate::setup::outputs::{prepare_file, refuse_existing, refuse_input};
use gdg::map::{
    self, BUILTIN, Diameter, FORMATS, Grid, MapFormat, MapScale, Reading, ScenarioTask, print_ascii,
};
use gdg::printing::eprint_line;
use gdg::text::{aligned, grouped, sanitized};
use gdg::train::Registry;

fn list() -> String {
    let measuring = Waiting::on("measuring the maps");
    measuring.begin(0, 1);
    let head = ["map", "size", "free cells", "farthest"].map(str::to_owned).to_vec();
    let maps = (0..).zip(BUILTIN).filter_map(|(i, (name, _))| Some((i, map::builtin(name)?)));
    let row = |(i, grid): (usize, Grid)| {
        measuring.set(i, BUILTIN.len());
        let size = format!("{}x{}", grid.width(), grid.height());
        let (free, farthest) = (grouped(grid.free_count() as u64), Diameter::compute(&grid));
        vec![grid.name().to_owned(), size, free, in_steps(farthest)]
    };
    aligned(&std::iter::once(head).chain(maps.map(row)).collect::<Vec<_>>())
}

/// Prints the table of built-in maps, or a random map, or converts one.
pub fn run(args: &MapsArgs, registry: &Registry) -> CommandOutcome {
    if let Some(MapsCommand::Convert(args)) = &args.command {
        return print(&convert(args, registry).map_err(bad_input)?);
    }
    let Some(kind) = args.random else { return print(&list()) };
    print(&print_ascii(&map::random(kind, args.size.map(usize::from), args.seed)))
}

/// Writes a map in another format and returns which files were written.
fn convert(args: &ConvertArgs, registry: &Registry) -> Result<String, Report> {
    let (input, output) = (args.input.as_path(), args.output.as_path());
    let format = args.format.or_else(|| MapFormat::by_name(output)).ok_or_else(|| {
        let help = "give --format FORMAT: gdg-tui maps convert --help lists them";
        miette!(help = help, "{}: this ending says no format", output.display())
    })?;
    let converting = Waiting::on("converting the map");
    let mut grid = find_map(input, &Reading::from(&args.map), registry)?;
    if let Some(scenario) = &args.scen {
        let tasks = map::read_scenario(scenario).and_then(|scenario| scenario.tasks(&grid));
        grid = with_tasks(&grid, tasks.map_err(from_map_error)?);
    }
    let files = format.write(&grid, output);
    let warnings = warnings(&grid);
    drop(converting);
    warnings.iter().for_each(|warning| eprint_line(&format!("warning: {warning}")));
    for (path, _) in &files {
        refuse_input("OUT", path, std::iter::once(input).chain(args.scen.as_deref()))?;
        refuse_existing(path, args.overwrite)?;
    }
    for loss in losses(args, &grid, format)? {
        eprint_line(&format!("warning: {}: {loss}", sanitized(grid.name())));
    }
    let written = files.iter().map(|(path, bytes)| prepare_file(path, bytes));
    written.collect::<Result<Vec<_>, _>>()?.into_iter().map(|place| place()).collect()
}

fn with_tasks(grid: &Grid, tasks: Vec<ScenarioTask>) -> Grid {
    let (starts, goals): (Vec<_>, Vec<_>) =
        tasks.into_iter().map(|task| (task.start, task.goal)).unzip();
    grid.with_marks([grid.starts(), &starts].concat(), [grid.goals(), &goals].concat())
}

/// Returns what of a map its file in this `format` will not have, and how to keep it.
fn losses(args: &ConvertArgs, grid: &Grid, format: &MapFormat) -> Result<Vec<String>, Report> {
    let (mut said, lost) = (Vec::new(), format.lost(grid).join(" and "));
    if !lost.is_empty() {
        let keep = FORMATS.iter().filter(|format| format.loses.is_empty());
        let keep = keep.map(|format| format.name).collect::<Vec<_>>().join(", ");
        said.push(format!("the file has no {lost}; formats that keep them: {keep}"));
    }
    let MapScale { goal_radius, .. } = grid.scale();
    if goal_radius != MapScale::default().goal_radius {
        let keep = format!("give --goal-radius {goal_radius} with it");
        said.push(format!("no file of a map has a goal radius: {keep}"));
    }
    if grid.scale().benchmark.is_some() {
        said.push("the tasks of the benchmark are not written".to_owned());
    }
    if let Some(agents) = map::agents_of(&args.input).map_err(from_map_error)?
        && with_tasks(grid, agents.tasks(grid).map_err(from_map_error)?) != *grid
    {
        let file = sanitized(&args.input.to_string_lossy());
        let keep = format!("--scen {file} makes them starts and goals");
        said.push(format!("its agents are not written: {keep}"));
    }
    Ok(said)
}
