//! `gdg-tui maps`: the built-in maps, random ones, and maps in other formats.

use miette::{Report, miette};

use super::check::describe_diameter;
use super::output::{OrFail, write_file};
use super::output::{Outcome, print, print_safely};
use crate::cli::{ConvertArgs, MapsArgs, MapsCommand};
use crate::host::maps::{find_map, warnings};
use crate::host::outputs::{refuse_existing, refuse_input};
use crate::host::report::from_map_error;
use crate::host::waiting::Waiting;
use gdg::map::{
    self, BUILTIN, Diameter, FORMATS, Grid, MapFormat, MapScale, Reading, ScenarioTask, print_ascii,
};
use gdg::printing::eprint_line;
use gdg::text::sanitized;
use gdg::train::Registry;

/// Steps of a conversion: a map is read, printed in the other format, and doubts about it are found.
const CONVERT_STEPS: usize = 3;

/// Returns the table of built-in maps.
fn list() -> String {
    let measuring = Waiting::on("measuring the maps");
    measuring.begin(0, 1);
    let head =
        format!("{:<28}{:>9}{:>12}{:>18}\n", "map", "size", "free cells", "farthest (steps)");
    let maps = BUILTIN.iter().enumerate();
    let lines =
        maps.filter_map(|(i, (name, _))| Some((i, map::builtin(name)?))).map(|(i, grid)| {
            measuring.set(i, BUILTIN.len());
            let size = format!("{}x{}", grid.width(), grid.height());
            let farthest = describe_diameter(Diameter::compute(&grid));
            format!("{:<28}{size:>9}{:>12}{farthest:>18}\n", grid.name(), grid.free_count())
        });
    std::iter::once(head).chain(lines).collect()
}

/// Prints the table of built-in maps, or a random map, or converts one.
pub fn run(args: &MapsArgs, registry: &Registry) -> Outcome {
    if let Some(MapsCommand::Convert(args)) = &args.command {
        return print_safely(&convert(args, registry).or_bad_input()?);
    }
    match args.random {
        None => print(&list()),
        Some(kind) => {
            print(&print_ascii(&map::random(kind, args.size.map(usize::from), args.seed)))
        }
    }
}

/// Writes a map in another format and returns which files were written.
fn convert(args: &ConvertArgs, registry: &Registry) -> Result<String, Report> {
    let (input, output) = (args.input.as_path(), args.output.as_path());
    let format = args.format.or_else(|| MapFormat::by_name(output)).ok_or_else(|| {
        let help = "give --format FORMAT: gdg-tui maps convert --help lists them";
        miette!(help = help, "{}: this ending says no format", output.display())
    })?;
    let converting = Waiting::on("converting the map");
    let told = |done| converting.set(done, CONVERT_STEPS);
    converting.begin(0, 1);
    told(0);
    let mut grid = find_map(input, &Reading::from(&args.map), registry)?;
    if let Some(scenario) = &args.scen {
        grid = with_tasks(&grid, map::load_scenario(scenario, &grid).map_err(from_map_error)?);
    }
    told(1);
    let files = format.write(&grid, output);
    told(2);
    let warnings = warnings(&grid);
    drop(converting);
    warnings.iter().for_each(|warning| eprint_line(warning));
    for (path, _) in &files {
        let read = std::iter::once(input).chain(args.scen.as_deref());
        refuse_input("OUT", path, read)?;
        refuse_existing(path, args.overwrite)?;
    }
    warn_of_losses(args, &grid, format)?;
    files.iter().map(|(path, bytes)| write_file(path, bytes)).collect()
}

/// Returns a map with the starts and goals of tasks beside its own.
fn with_tasks(grid: &Grid, tasks: Vec<ScenarioTask>) -> Grid {
    let (starts, goals): (Vec<_>, Vec<_>) =
        tasks.into_iter().map(|task| (task.start, task.goal)).unzip();
    grid.with_marks([grid.starts(), &starts].concat(), [grid.goals(), &goals].concat())
}

/// Prints what of a map its file in this `format` will not have, and how to keep it.
fn warn_of_losses(args: &ConvertArgs, grid: &Grid, format: &MapFormat) -> Result<(), Report> {
    let say = |what: &str| eprint_line(&format!("{}: {what}", sanitized(grid.name())));
    let lost = format.lost(grid).join(" and ");
    if !lost.is_empty() {
        let keep = FORMATS.iter().filter(|format| format.loses.is_empty());
        let keep = keep.map(|format| format.name).collect::<Vec<_>>().join(", ");
        say(&format!("warning: the file has no {lost}; formats that keep them: {keep}"));
    }
    let MapScale { goal_radius, .. } = grid.scale();
    if goal_radius != MapScale::default().goal_radius {
        say(&format!(
            "warning: no file of a map has a goal radius: give --goal-radius {goal_radius} with it"
        ));
    }
    if grid.scale().benchmark.is_some() {
        say("warning: the tasks of the benchmark are not written");
    }
    if let Some(agents) = map::agents_of(&args.input).map_err(from_map_error)? {
        let tasks = agents.tasks(grid).map_err(from_map_error)?;
        if with_tasks(grid, tasks) != *grid {
            let file = sanitized(&args.input.to_string_lossy());
            say(&format!(
                "warning: its agents are not written: --scen {file} makes them starts and goals"
            ));
        }
    }
    Ok(())
}
