//! Moving AI `.scen` files: tasks on a map.

use super::error::MapResult;
use super::grid::{Cell, Grid};
use super::text::Text;

/// One task of a scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScenarioTask {
    /// Where the agent starts.
    pub start: Cell,
    /// The cell it must reach.
    pub goal: Cell,
    /// Optimal length as stated in the file, in cells (octile: a diagonal counts sqrt 2).
    pub optimal_octile: f64,
}

const EXPECTED_FIELDS: &str = "a task has 9 fields separated by tabs: bucket, map, map width, map height, start x, start y, \
                      goal x, goal y, optimal length";

/// Returns whether the text starts like a scenario of any version.
pub fn is_scenario(text: &Text) -> bool {
    text.lines[0].split_whitespace().next() == Some("version")
}

/// Parses a scenario for `grid`; scales coordinates if the stated map size differs from the grid's.
///
/// # Errors
/// Fails on a missing version, a wrong number of fields, values that are not numbers, cells off the map or in a wall,
/// and scenarios without tasks.
pub fn parse_scenario(text: &Text, grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
    let version: Vec<&str> = text.lines[0].split_whitespace().collect();
    if !matches!(version.as_slice(), ["version", "1" | "1.0"]) {
        return Err(text.line_error(0, "not a scenario of version 1", "the first line must be 'version 1'"));
    }
    let tasks: MapResult<Vec<ScenarioTask>> = text
        .lines
        .iter()
        .enumerate()
        .skip(1)
        .filter(|(_, line)| !line.trim().is_empty())
        .map(|(i, _)| parse_task(text, i, grid))
        .collect();
    let tasks = tasks?;
    if tasks.is_empty() {
        return Err(text.line_error(0, "the scenario has no tasks", EXPECTED_FIELDS));
    }
    Ok(tasks)
}

fn parse_task(text: &Text, line: usize, grid: &Grid) -> MapResult<ScenarioTask> {
    let fields: Vec<&str> = text.lines[line].split('\t').collect();
    if fields.len() != 9 {
        let problem = format!("{} fields instead of 9", fields.len());
        return Err(text.line_error(line, problem, EXPECTED_FIELDS));
    }
    let columns = |field: usize| {
        let from: usize = fields[..field].iter().map(|f| f.chars().count() + 1).sum();
        from..from + fields[field].chars().count()
    };
    let number = |field: usize| {
        fields[field].trim().parse::<usize>().map_err(|_| {
            text.error(line, columns(field), format!("{:?} is not an integer", fields[field]), EXPECTED_FIELDS)
        })
    };
    let (stated_width, stated_height) = (number(2)?, number(3)?);
    let cell = |field: usize, which: &str| {
        let scale = |value: usize, stated: usize, size: usize| {
            if stated == size || stated == 0 { value } else { (value as u128 * size as u128 / stated as u128) as usize }
        };
        let cell = Cell::new(
            scale(number(field)?, stated_width, grid.width()),
            scale(number(field + 1)?, stated_height, grid.height()),
        );
        if grid.is_free(cell) {
            return Ok(cell);
        }
        let (x, y) = (cell.x, cell.y);
        let stated = (number(field)?, number(field + 1)?);
        let mut place = format!("the {which} ({}, {})", stated.0, stated.1);
        if stated != (x, y) {
            place += &format!(" of a map of {stated_width} x {stated_height}, here ({x}, {y}),");
        }
        let problem = if grid.contains(cell) {
            format!("{place} is a wall of {}", grid.name())
        } else {
            format!("{place} is outside the map of {} x {}", grid.width(), grid.height())
        };
        let help = "starts and goals must be free cells, as x, y from (0, 0) at the upper left; is this the right map?";
        Err(text.error(line, columns(field).start..columns(field + 1).end, problem, help))
    };
    let optimal_octile = fields[8].trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    Ok(ScenarioTask {
        start: cell(4, "start")?,
        goal: cell(6, "goal")?,
        optimal_octile: optimal_octile
            .ok_or_else(|| text.error(line, columns(8), format!("{:?} is not a length", fields[8]), EXPECTED_FIELDS))?,
    })
}

#[cfg(test)]
mod tests {
    use crate::map::{parse_map, parse_scenario_bytes};

    #[test]
    fn a_cell_that_does_not_fit_is_named_as_in_the_file() {
        let map = parse_map("map", b"#...\n....\n").expect("a map");
        let refused = |size: &str, cell: &str| {
            let file = format!("version 1\n0\tmap\t{size}\t{cell}\t3\t1\t2\n");
            parse_scenario_bytes("file", file.as_bytes(), &map).expect_err("refused").to_string()
        };
        assert!(refused("4\t2", "0\t0").contains("the start (0, 0) is a wall of map"));
        let scaled = refused("40\t20", "1\t1");
        assert!(scaled.contains("the start (1, 1) of a map of 40 x 20, here (0, 0), is a wall of map"), "{scaled}");
        let outside = refused("4\t2", "7\t1");
        assert!(outside.contains("the start (7, 1) is outside the map of 4 x 2"), "{outside}");
    }
}
