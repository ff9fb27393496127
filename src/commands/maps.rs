//! `gdg-tui maps`: the built-in maps, random ones, and maps in other formats.

use std::path::Path;

use miette::{Report, miette};

use super::check::describe_diameter;
use super::output::{OrFail, write_file};
use super::output::{Outcome, print, print_safely};
use crate::cli::{ConvertArgs, MapsArgs, MapsCommand};
use crate::host::maps::{find_map, warn};
use crate::host::report::from_map_error;
use crate::host::setup::{refuse_existing, refuse_input};
use gdg::map::{self, BUILTIN, Diameter, Grid, MapFormat, Reading, print_ascii};
use gdg::printing::eprint_line;
use gdg::text::sanitized;
use gdg::train::Registry;

/// Returns the table of built-in maps.
fn list() -> String {
    let head =
        format!("{:<28}{:>9}{:>12}{:>18}\n", "map", "size", "free cells", "farthest (steps)");
    let lines = BUILTIN.iter().filter_map(|(name, _)| map::builtin(name)).map(|grid| {
        let size = format!("{}x{}", grid.width(), grid.height());
        let farthest = describe_diameter(Diameter::compute(&grid));
        format!("{:<28}{size:>9}{:>12}{farthest:>18}\n", grid.name(), grid.free_count())
    });
    std::iter::once(head).chain(lines).collect()
}

/// Prints the table of built-in maps, or a random map, or converts one.
///
/// # Errors
/// Standard output cannot be written, or the map cannot be converted.
pub fn run(args: &MapsArgs, registry: &Registry) -> Outcome {
    if let Some(MapsCommand::Convert(args)) = &args.command {
        return print_safely(&convert(args, registry).or_bad_input()?);
    }
    match args.random {
        None => print(&list()),
        Some(kind) => {
            print(&print_ascii(&map::random(kind.into(), args.size.map(usize::from), args.seed)))
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
    let grid = find_map(input, &Reading::from(&args.map), registry)?;
    warn(&grid);
    let files = format.write(&grid, output);
    for (path, _) in &files {
        refuse_input("OUT", path, std::iter::once(input))?;
        refuse_existing(path, args.overwrite)?;
    }
    warn_of_losses(input, &grid, format)?;
    files.iter().map(|(path, bytes)| write_file(path, bytes)).collect()
}

/// Prints what of a map its file in this `format` will not have.
fn warn_of_losses(input: &Path, grid: &Grid, format: &MapFormat) -> Result<(), Report> {
    let warn = |lost: &str| {
        eprint_line(&format!("warning: {}: {lost}", sanitized(grid.name())));
    };
    let has_marks = !grid.starts().is_empty() || !grid.goals().is_empty();
    if has_marks && !format.loses.is_empty() {
        warn(&format!("the format {} has no {}", format.name, format.loses));
    }
    let radius = grid.scale().goal_radius;
    if radius != Reading::default().scale.goal_radius && !format.keeps_goal_radius {
        warn(&format!("the file has no goal radius: give --goal-radius {radius} with it"));
    }
    if map::agents_of(input).map_err(from_map_error)?.is_some() {
        warn("its agents are not written");
    }
    Ok(())
}
