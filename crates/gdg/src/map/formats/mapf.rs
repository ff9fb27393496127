//! Maps of planners for many agents (libMultiRobotPlanning and its relatives): YAML with the
//! dimensions, the obstacles, and each agent's start and goal.

use super::super::grid::{Cell, Grid, MAX_CELLS, is_size, size_limits};
use super::super::text::MapResult;
use super::super::text::{Place, Text};
use super::notes::{column_and_row, with_notes, yaml_lines};
use super::ros::has_key;
use super::rows::grid;
use super::yaml::{Node, tree};
use super::{MapFormat, Mark, marks};

pub const FORMAT: MapFormat = MapFormat {
    name: "mapf",
    about: "YAML of multi-agent planners; its agents are tasks for --scen",
    endings: &["yaml", "yml"],
    loses: "",
    keeps_scale: |_| true,
    is: |source| source.is_text(is_mapf),
    read: |source| {
        let text = source.text()?;
        let root = tree(text)?;
        with_notes(&root, text, &map(text, &source.name(), &root)?, |place| place)
    },
    write: |grid, _| (yaml_lines(grid, column_and_row) + &write(grid)).into_bytes(),
    image: None,
};

const HELP: &str = "such a map has the key map with dimensions: [WIDTH, HEIGHT] and obstacles, a list of [X, Y] from \
                    [0, 0] at the upper left, and may have agents, each with a start and a goal";

/// Returns whether a text begins like such a map.
pub fn is_mapf(text: &Text) -> bool {
    has_key(text, "dimensions") && has_key(text, "obstacles")
}

/// Returns whether a text is such a map with agents.
pub fn has_agents(text: &Text) -> bool {
    let has_start = ["start:", "start\":"].iter().any(|key| text.source.contains(key));
    is_mapf(text) && has_key(text, "agents") && has_start
}

/// A task of one agent.
pub struct Agent {
    /// The cells, and where they are in the file.
    pub start: (Cell, Place),
    pub goal: (Cell, Place),
}

/// Returns a pair of numbers, such as a cell. A third one, for a height, is ignored.
fn pair(text: &Text, node: &Node) -> MapResult<(usize, usize)> {
    match node.list(text, HELP)? {
        [x, y] | [x, y, _] => Ok((
            x.parsed(text, "a number of cells", HELP)?,
            y.parsed(text, "a number of cells", HELP)?,
        )),
        _ => Err(text.error_at(node.place, "this is not a pair of numbers", HELP)),
    }
}

/// Returns a cell within the dimensions.
fn cell(text: &Text, node: &Node, (width, height): (usize, usize)) -> MapResult<Cell> {
    let (x, y) = pair(text, node)?;
    if x < width && y < height {
        return Ok(Cell::new(x, y));
    }
    let problem = format!("({x}, {y}) is outside the map of {width} x {height}");
    Err(text.error_at(node.place, problem, HELP))
}

/// Returns the part of the document with the map: some write it without indentation.
fn map_of<'a, 'b>(root: &'b Node<'a>) -> &'b Node<'a> {
    root.get("map").filter(|map| map.get("dimensions").is_some()).unwrap_or(root)
}

fn dimensions(text: &Text, root: &Node) -> MapResult<(usize, usize)> {
    let node = map_of(root).wanted(text, "dimensions", HELP)?;
    let (width, height) = pair(text, node)?;
    if width.min(height) > 0 && width.max(height) <= MAX_CELLS && is_size(width, height) {
        return Ok((width, height));
    }
    let problem = format!("a map of {width} x {height} cells is not possible");
    Err(text.error_at(node.place, problem, size_limits()))
}

fn map(text: &Text, name: &str, root: &Node) -> MapResult<Grid> {
    let (width, height) = dimensions(text, root)?;
    let mut marks = vec![Mark::Free; width * height];
    let obstacles = map_of(root).wanted(text, "obstacles", HELP)?;
    // A map without obstacles may have the key without a value.
    let has_none = obstacles
        .scalar(text, "a list", HELP)
        .is_ok_and(|value| ["", "~", "null"].contains(&value));
    for node in if has_none { &[] } else { obstacles.list(text, HELP)? } {
        let Cell { x, y } = cell(text, node, (width, height))?;
        marks[y * width + x] = Mark::Wall;
    }
    let none = || text.error_at(obstacles.place, "the map has no free cell", HELP);
    grid(name, width, &marks).ok_or_else(none)
}

/// Returns the size of the map that agents are on, and the agents.
///
/// # Errors
/// The file is malformed, or has no agents.
pub fn agents(text: &Text) -> MapResult<((usize, usize), Vec<Agent>)> {
    let root = tree(text)?;
    let size = dimensions(text, &root)?;
    let nodes = root.wanted(text, "agents", HELP)?;
    let agent = |node: &Node| {
        let at = |key| -> MapResult<_> {
            let node = node.wanted(text, key, HELP)?;
            Ok((cell(text, node, size)?, node.place))
        };
        Ok(Agent { start: at("start")?, goal: at("goal")? })
    };
    let agents = nodes.list(text, HELP)?.iter().map(agent).collect::<MapResult<Vec<_>>>()?;
    if agents.is_empty() {
        return Err(text.error_at(nodes.place, "there are no agents", HELP));
    }
    Ok((size, agents))
}

fn write(grid: &Grid) -> String {
    let cell = |cell: &Cell| format!("[{}, {}]", cell.x, cell.y);
    let agents = grid.starts().iter().zip(grid.goals()).enumerate().map(|(i, (start, goal))| {
        format!("- name: agent{i}\n  start: {}\n  goal: {}\n", cell(start), cell(goal))
    });
    let agents: String = agents.collect();
    let agents = if agents.is_empty() { " []\n".to_owned() } else { format!("\n{agents}") };
    let walls = marks(grid).flatten().enumerate().filter(|(_, mark)| *mark == Mark::Wall);
    let walls: String = walls.map(|(i, _)| format!("  - {}\n", cell(&grid.cell(i)))).collect();
    let walls = if walls.is_empty() { " []\n".to_owned() } else { format!("\n{walls}") };
    let (width, height) = (grid.width(), grid.height());
    format!("agents:{agents}map:\n  dimensions: [{width}, {height}]\n  obstacles:{walls}")
}
