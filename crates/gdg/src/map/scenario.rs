//! Moving AI `.scen` files: tasks on a map.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

use super::components::Components;
use super::formats::{AgentTask, agents, is_mapf};
use super::grid::{Cell, Grid};
use super::text_file::{MapError, MapResult, TextFile};
use crate::text::SourceLine;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScenarioTask {
    pub start: Cell,
    /// The cell it must reach.
    pub goal: Cell,
    /// Optimal length as stated in the file, if it is, in cells (octile: a diagonal counts sqrt 2).
    pub optimal_octile: Option<f64>,
}

const EXPECTED_FIELDS: &str = "a task has 9 fields separated by tabs: bucket, map, map width, map height, start x, start y, \
                      goal x, goal y, optimal length";

/// Fields of a task.
const FIELDS: usize = 9;

/// A scenario as read from its file, for any map.
#[derive(Clone, Debug)]
pub struct Scenario {
    file: String,
    entries: Vec<TaskLine>,
}

/// A task as in the file.
#[derive(Clone, Debug)]
struct TaskLine {
    /// Line, from 0.
    line: usize,
    /// The line itself, empty for an agent of a map.
    text: String,
    /// For an agent, errors without a problem at its start and goal.
    marks: Option<[Box<MapError>; 2]>,
    /// Width and height of the map that coordinates refer to.
    size: (usize, usize),
    start: (usize, usize),
    goal: (usize, usize),
    length: Option<f64>,
}

/// A field of a task: its first byte in the line, and its text.
type TaskField<'a> = (usize, &'a str);

/// Returns whether the text starts like a scenario of any version.
pub fn is_scenario(text: &TextFile) -> bool {
    text.lines[0].split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("version"))
}

impl Scenario {
    /// Parses a scenario; errors refer to it as `file`.
    pub fn parse(file: &str, bytes: &[u8]) -> MapResult<Self> {
        let text = TextFile::new(file, bytes)?;
        if is_mapf(&text) {
            return Self::of_agents(&text);
        }
        let version: Vec<&str> = text.lines[0].split_whitespace().collect();
        let is_first = |words: &[&str]| {
            words[0].eq_ignore_ascii_case("version") && ["1", "1.0"].contains(&words[1])
        };
        if version.len() != 2 || !is_first(&version) {
            let problem = "not a scenario of version 1";
            return Err(text.line_error(0, problem, "the first line must be 'version 1'"));
        }
        let lines =
            text.lines.iter().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty());
        let entries = lines.map(|(i, _)| parse_entry(&text, i)).collect::<MapResult<Vec<_>>>()?;
        if entries.is_empty() {
            return Err(text.line_error(0, "the scenario has no tasks", EXPECTED_FIELDS));
        }
        Ok(Self { file: file.to_owned(), entries })
    }

    /// Returns the tasks of the agents of a map for planners: they refer to the map in the same file.
    fn of_agents(text: &TextFile) -> MapResult<Self> {
        let (size, agents) = agents(text)?;
        let entries = agents.iter().map(|AgentTask { start, goal }| TaskLine {
            line: start.1.line,
            text: String::new(),
            marks: Some([start.1, goal.1].map(|place| text.error_at(place, "", ""))),
            size,
            start: (start.0.x, start.0.y),
            goal: (goal.0.x, goal.0.y),
            length: None,
        });
        Ok(Self { file: text.file.to_owned(), entries: entries.collect() })
    }

    /// Returns the name of the map's file that the first task names.
    pub fn map_name(&self) -> String {
        self.entries.first().map_or(String::new(), |entry| map_name(&entry.text).to_owned())
    }

    /// Returns a warning if a task names another map than `grid`, with its line.
    pub fn other_map(&self, grid: &Grid) -> Option<String> {
        let named = self.entries.iter().filter(|entry| entry.length.is_some());
        let mut names = named.map(|entry| (entry.line, map_name(&entry.text)));
        let (line, name) = names.find(|(_, name)| !is_name_of(name, grid))?;
        Some(format!("line {} is a task on {name}, but the map is {}", line + 1, grid.name()))
    }

    /// Returns the tasks on `grid`; scales coordinates if the stated map size has the grid's
    /// proportions.
    pub fn tasks(&self, grid: &Grid) -> MapResult<Vec<ScenarioTask>> {
        self.entries.iter().map(|entry| entry.task(&self.file, grid)).collect()
    }

    /// Checks that each of `tasks` (this scenario's, on `grid`) has a path.
    pub fn check_paths(&self, tasks: &[ScenarioTask], grid: &Grid) -> MapResult<()> {
        let components = Components::of(grid).of_cell;
        let component = |cell: Cell| components[grid.index(cell)];
        let mut all = self.entries.iter().zip(tasks);
        match all.find(|(_, task)| component(task.start) != component(task.goal)) {
            None => Ok(()),
            Some((entry, _)) => {
                let help = "starts and goals must be connected; is this the right map?";
                let problem = "no path leads from this start to this goal".to_owned();
                Err(entry.error(&self.file, 4..=7, problem, help))
            }
        }
    }
}

impl TaskLine {
    /// Whether coordinates refer to a map of another size; a size of 0 x 0 is that of the map.
    fn is_scaled(&self, grid: &Grid) -> bool {
        self.size != (0, 0) && self.size != (grid.width(), grid.height())
    }

    fn task(&self, file: &str, grid: &Grid) -> MapResult<ScenarioTask> {
        let (width, height) = self.size;
        if width as u128 * grid.height() as u128 != height as u128 * grid.width() as u128 {
            let problem = format!(
                "a task on a map of {width} x {height} cells does not fit {}, which has {} x {}",
                grid.name(),
                grid.width(),
                grid.height()
            );
            let help = "width and height, in this order, must be the map's, or both the same multiple of them; is this the \
                        right map?";
            return Err(self.error(file, 2..=3, problem, help));
        }
        Ok(ScenarioTask {
            start: self.cell(file, grid, 4, "start", self.start)?,
            goal: self.cell(file, grid, 6, "goal", self.goal)?,
            optimal_octile: self.length,
        })
    }

    /// Returns the cell of `grid` at the coordinates `stated` in `field` and the next.
    fn cell(
        &self,
        file: &str,
        grid: &Grid,
        field: usize,
        which: &str,
        stated: (usize, usize),
    ) -> MapResult<Cell> {
        // Of a maze that has been enlarged, the middle of the block.
        let is_enlarged = grid.scale().cell > 1;
        let scale = |value: usize, from: usize, to: usize| {
            let middle = if is_enlarged { to / from / 2 } else { 0 };
            (value as u128 * to as u128 / from as u128) as usize + middle
        };
        let (width, height) = self.size;
        let cell = if self.is_scaled(grid) {
            Cell::new(scale(stated.0, width, grid.width()), scale(stated.1, height, grid.height()))
        } else {
            Cell::new(stated.0, stated.1)
        };
        if grid.is_free(cell) {
            return Ok(cell);
        }
        let (x, y) = (cell.x, cell.y);
        let mut place = format!("the {which} ({}, {})", stated.0, stated.1);
        if stated != (x, y) {
            place += &format!(" of a map of {width} x {height}, here ({x}, {y}),");
        }
        let problem = if grid.contains(cell) {
            format!("{place} is a wall of {}", grid.name())
        } else {
            format!("{place} is outside the map of {} x {}", grid.width(), grid.height())
        };
        let help = "starts and goals must be free cells, as x, y from (0, 0) at the upper left; is this the right map?";
        Err(self.error(file, field..=field + 1, problem, help))
    }

    /// Creates an error about some of its fields.
    fn error(
        &self,
        file: &str,
        fields: RangeInclusive<usize>,
        problem: String,
        help: &str,
    ) -> Box<MapError> {
        if let Some([start, goal]) = &self.marks {
            let mark = if *fields.start() < 6 { start } else { goal };
            return Box::new(MapError { problem, help: help.to_owned(), ..*mark.clone() });
        }
        let line = SourceLine { number: self.line, text: &self.text };
        MapError::at(file, line, columns(&self.text, fields), problem, help)
    }
}

fn parse_entry(text: &TextFile, line: usize) -> MapResult<TaskLine> {
    let whole = text.lines[line];
    let fields = fields(whole);
    if fields.len() != FIELDS {
        let problem = format!("{} fields instead of {FIELDS}", fields.len());
        return Err(text.line_error(line, problem, EXPECTED_FIELDS));
    }
    let error = |field: usize, what: &str| -> Box<MapError> {
        let problem = format!("{:?} is not {what}", fields[field].1);
        text.error(line, columns(whole, field..=field), problem, EXPECTED_FIELDS)
    };
    let number =
        |field: usize| fields[field].1.parse::<usize>().map_err(|_| error(field, "an integer"));
    let length = fields[8].1.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    Ok(TaskLine {
        line,
        text: whole.to_owned(),
        marks: None,
        size: (number(2)?, number(3)?),
        start: (number(4)?, number(5)?),
        goal: (number(6)?, number(7)?),
        length: Some(length.ok_or_else(|| error(8, "a length"))?),
    })
}

/// Splits a task at tabs; or else at blanks, which the map's name may contain.
fn fields(line: &str) -> Vec<TaskField<'_>> {
    let at = |part: &str| part.as_ptr() as usize - line.as_ptr() as usize;
    let tabbed: Vec<TaskField> =
        line.split('\t').map(str::trim).map(|field| (at(field), field)).collect();
    let words: Vec<TaskField> = line.split_whitespace().map(|word| (at(word), word)).collect();
    if tabbed.len() == FIELDS {
        return tabbed;
    }
    if words.len() < FIELDS {
        return if tabbed.len() > 1 { tabbed } else { words };
    }
    let last = words[words.len() - FIELDS + 1];
    let name = (words[1].0, &line[words[1].0..last.0 + last.1.len()]);
    [&words[..1], &[name], &words[words.len() - FIELDS + 2..]].concat()
}

/// Returns the columns (from 0, in characters) of some fields of a task.
fn columns(line: &str, which: RangeInclusive<usize>) -> std::ops::Range<usize> {
    let fields = fields(line);
    let column = |byte: usize| line[..byte].chars().count();
    let (first, last) = (fields[*which.start()], fields[*which.end()]);
    column(first.0)..column(last.0 + last.1.len())
}

/// Returns the file name in a task's map path, which may be a Windows path.
fn map_name(line: &str) -> &str {
    let path = fields(line).get(1).map_or("", |field| field.1);
    path.rsplit(['/', '\\']).next().unwrap_or_default()
}

/// Returns whether `grid` may have been read from a file of this name.
fn is_name_of(name: &str, grid: &Grid) -> bool {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    [name, stem].iter().any(|name| name.eq_ignore_ascii_case(grid.name()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    #[test]
    fn a_cell_that_does_not_fit_is_named_as_in_the_file() {
        let map = parse_map("map", b"#...\n....\n").expect("a map");
        let refused = |size: &str, cell: &str| {
            let file = format!("version 1\n0\tmap\t{size}\t{cell}\t3\t1\t2\n");
            let scenario = Scenario::parse("file", file.as_bytes()).expect("a scenario");
            scenario.tasks(&map).expect_err("refused").to_string()
        };
        assert!(refused("4\t2", "0\t0").contains("the start (0, 0) is a wall of map"));
        let scaled = refused("40\t20", "1\t1");
        assert!(
            scaled.contains("the start (1, 1) of a map of 40 x 20, here (0, 0), is a wall of map"),
            "{scaled}"
        );
        let outside = refused("4\t2", "7\t1");
        assert!(outside.contains("the start (7, 1) is outside the map of 4 x 2"), "{outside}");
    }
}
