//! Worlds with a map: facts about cells, what the agents have explored, and ways around walls.

use pathfinding::directed::astar::astar;

use crate::draw::positions_along;
use crate::map::{Cell, Grid};

/// Steps from any visited cell up to which unvisited cells do not count as beyond the known world:
/// agents skip many cells on their way, and outlining them all would hide the edge.
const POCKET_STEPS: usize = 2;

/// Positions along a straight line in each cell that it crosses.
const SIGHT_PER_CELL: f32 = 8.0;

/// The distance that a way keeps from walls where it turns, in cells.
const MARGIN: f32 = 0.25;

/// Cells that are searched for a way around walls, at most: legs of a plan are short.
const MOST_SEARCHED: usize = 20_000;

/// Costs of a step along an axis and of a diagonal one.
const STEP: usize = 5;
const DIAGONAL: usize = 7;

/// Information about a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellInfo {
    pub cell: Cell,
    /// D from its centre to the goal.
    pub learned: f32,
    /// The true number of steps, if the goal is reachable.
    pub truth: Option<u32>,
    /// Number of visits by agents; not known of the past.
    pub visits: Option<u32>,
}

/// What the agents know of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Knowledge {
    /// Visited; or a wall.
    #[default]
    Known,
    /// Visited, and one step away from a cell beyond the known world.
    Edge,
    /// Not visited, but only a pocket in the known world.
    Pocket,
    /// Beyond the known world: not visited, and part of an area that reaches more than two steps
    /// from all visited cells, or out of their reach.
    Beyond,
}

/// What the agents know of each cell. Empty if they have explored everything.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exploration {
    size: (usize, usize),
    /// By cell, row by row.
    cells: Vec<Knowledge>,
}

impl Exploration {
    /// Derives it from the number of visits of each cell of `map`. Before the first visit, it is
    /// empty.
    pub fn new(map: &Grid, visits: &[u32]) -> Self {
        let of = |is: &dyn Fn(usize) -> bool| -> Vec<bool> {
            (0..map.free().len()).map(|i| map.free()[i] && is(i)).collect()
        };
        let visited = of(&|i| visits.get(i) != Some(&0));
        let unvisited = of(&|i| !visited[i]);
        if !visited.contains(&true) || !unvisited.contains(&true) {
            return Self::default();
        }
        let near = grown(map, &visited);
        // Cells around those far from the visited ones belong to the same area; what is out of
        // reach as well: D is not learned there.
        let beyond = grown(map, &of(&|i| !near[i]));
        let is_beside = |i: usize| map.neighbours(map.cell(i)).any(|next| beyond[map.index(next)]);
        let knowledge = |i: usize| match (unvisited[i], beyond[i]) {
            (true, true) => Knowledge::Beyond,
            (true, false) => Knowledge::Pocket,
            (false, _) if visited[i] && is_beside(i) => Knowledge::Edge,
            (false, _) => Knowledge::Known,
        };
        let cells = (0..visited.len()).map(knowledge).collect();
        Self { size: (map.width(), map.height()), cells }
    }

    /// Whether there is nothing unexplored on `map`, or the map has another size.
    pub fn is_complete(&self, map: &Grid) -> bool {
        self.size != (map.width(), map.height())
    }

    /// Returns what is known at a position.
    pub fn at(&self, [x, y]: [f32; 2]) -> Knowledge {
        let (x, y) = (x as usize, y as usize);
        if x >= self.size.0 {
            return Knowledge::Known;
        }
        self.cells.get(y * self.size.0 + x).copied().unwrap_or_default()
    }
}

/// Returns the cells within [`POCKET_STEPS`] of those in `cells`.
fn grown(map: &Grid, cells: &[bool]) -> Vec<bool> {
    let mut grown = cells.to_vec();
    let mut reached: Vec<Cell> =
        (0..cells.len()).filter(|i| cells[*i]).map(|i| map.cell(i)).collect();
    for _ in 0..POCKET_STEPS {
        let around = reached.iter().flat_map(|cell| map.neighbours(*cell));
        reached =
            around.filter(|next| !std::mem::replace(&mut grown[map.index(*next)], true)).collect();
    }
    grown
}

/// Returns whether no wall is on the straight line between two positions.
pub fn sees(map: &Grid, from: [f32; 2], to: [f32; 2]) -> bool {
    let cells = (to[0] - from[0]).hypot(to[1] - from[1]);
    let count = (SIGHT_PER_CELL * cells).ceil().max(1.0) as usize;
    positions_along([from, to], count).all(|[x, y]| map.is_free_at(x, y))
}

/// Returns `stops` with the corners between those that do not see each other, as the shortest way
/// around walls has them. It ends where none is found.
pub fn way_along(map: &Grid, stops: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let mut way: Vec<[f32; 2]> = stops.first().copied().into_iter().collect();
    for ends in stops.windows(2) {
        if !sees(map, ends[0], ends[1]) {
            let Some(corners) = corners(map, ends[0], ends[1]) else { break };
            way.extend(corners);
        }
        way.push(ends[1]);
    }
    way
}

/// Returns whether two positions see each other with some room beside the line.
fn has_room(map: &Grid, from: [f32; 2], to: [f32; 2]) -> bool {
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let scale = MARGIN / x.hypot(y).max(f32::MIN_POSITIVE);
    [-scale, 0.0, scale].into_iter().all(|scale| {
        let [from, to] = [from, to].map(|at| [at[0] - scale * y, at[1] + scale * x]);
        sees(map, from, to)
    })
}

/// Returns the corners of the shortest way between two positions; `None` if there is none nearby.
fn corners(map: &Grid, from: [f32; 2], to: [f32; 2]) -> Option<Vec<[f32; 2]>> {
    let cells = path_between(map, free_cell(map, from)?, free_cell(map, to)?)?;
    let centres: Vec<[f32; 2]> = cells.into_iter().map(Cell::centre).collect();
    let (mut corners, mut at, mut next) = (Vec::new(), from, 0);
    while !has_room(map, at, to) && next < centres.len() {
        // The farthest one in view; the next one follows in any case.
        let seen = centres[next..].iter().take_while(|centre| has_room(map, at, **centre)).count();
        next += seen.max(1);
        at = centres[next - 1];
        corners.push(at);
    }
    Some(corners)
}

fn free_cell(map: &Grid, [x, y]: [f32; 2]) -> Option<Cell> {
    map.is_free_at(x, y).then(|| Cell::new(x as usize, y as usize))
}

/// Returns the cells of a shortest way, both ends included.
fn path_between(map: &Grid, from: Cell, to: Cell) -> Option<Vec<Cell>> {
    let least = |cell: &Cell| {
        let (x, y) = (cell.x.abs_diff(to.x), cell.y.abs_diff(to.y));
        STEP * x.max(y) + (DIAGONAL - STEP) * x.min(y)
    };
    let mut searched = 0;
    let moves = |cell: &Cell| {
        searched += 1;
        let at = *cell;
        let cost = move |next: Cell| {
            let is_diagonal = next.x != at.x && next.y != at.y;
            (next, if is_diagonal { DIAGONAL } else { STEP })
        };
        map.neighbours(at).take(if searched > MOST_SEARCHED { 0 } else { usize::MAX }).map(cost)
    };
    Some(astar(&from, moves, least, |cell| *cell == to)?.0)
}

/// Returns the cell of a goal, `(goal_dim)`, if it is on the map.
pub fn cell_of_goal(goal: &[f32], map: &Grid) -> Option<Cell> {
    let cell = cell_of(goal.try_into().ok()?);
    map.contains(cell).then_some(cell)
}

pub fn cell_of(at: [f32; 2]) -> Cell {
    Cell::new(at[0] as usize, at[1] as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    fn map(rows: &[&str]) -> Grid {
        parse_map("map", rows.join("\n").as_bytes()).expect("a map")
    }

    /// Returns what is known of each cell, row by row: `x` visited, `e` edge, `p` pocket, `?`
    /// beyond. In `rows`, `x` marks visited cells.
    fn explored(rows: &[&str]) -> Vec<String> {
        let free: Vec<String> = rows.iter().map(|row| row.replace('x', ".")).collect();
        let map = map(&free.iter().map(String::as_str).collect::<Vec<_>>());
        let visits: Vec<u32> = rows.concat().chars().map(|c| 3 * u32::from(c == 'x')).collect();
        let exploration = Exploration::new(&map, &visits);
        let letter = |cell: Cell| match exploration.at(cell.centre()) {
            Knowledge::Known if map.is_free(cell) => 'x',
            Knowledge::Known => '#',
            Knowledge::Edge => 'e',
            Knowledge::Pocket => 'p',
            Knowledge::Beyond => '?',
        };
        (0..map.height())
            .map(|y| (0..map.width()).map(|x| letter(Cell::new(x, y))).collect())
            .collect()
    }

    #[test]
    fn the_edge_is_next_to_unvisited_areas_within_reach_that_are_no_pockets() {
        for (rows, expected) in [
            (&["xxx.....", "xx#....."][..], &["xxe?????", "xx#?????"][..]),
            // The corners beside a tip are pockets.
            (&["xx......", "xxxx....", "xx......"], &["xxpp????", "xxxe????", "xxpp????"]),
            (&["xx.xx", "x...x", "xx.xx"], &["xxpxx", "xpppx", "xxpxx"]),
            (&["xxx.."], &["xxxpp"]),
            (&["xxx..."], &["xxe???"]),
            // No step leads diagonally between walls.
            (&["xxx#....", "xxxx#...", "xxxxx#.."], &["xxx#????", "xxxx#???", "xxxxx#??"]),
        ] {
            assert_eq!(explored(rows), expected);
        }
    }

    #[test]
    fn nothing_is_left_once_everything_is_visited_or_before_the_first_visit() {
        let map = map(&["..#."]);
        for visits in [[1, 2, 0, 1], [0; 4]] {
            assert!(Exploration::new(&map, &visits).is_complete(&map), "{visits:?}");
        }
        assert!(!Exploration::new(&map, &[1, 0, 0, 0]).is_complete(&map));
        assert!(Exploration::new(&map, &[1, 0, 0, 0]).is_complete(&Grid::empty("other", 5, 1)));
    }

    #[test]
    fn walls_block_the_view() {
        let map = parse_map("map", b"..#..\n..#..\n.....\n").expect("a map");
        assert!(sees(&map, [0.5, 0.5], [0.5, 0.5]) && sees(&map, [0.5, 2.5], [4.5, 2.5]));
        assert!(!sees(&map, [0.5, 0.5], [4.5, 0.5]) && !sees(&map, [1.5, 1.5], [3.5, 2.2]));
    }

    #[test]
    fn a_way_leads_around_walls_and_through_all_stops() {
        let map = parse_map("map", b"..#..#.\n..#..#.\n.....#.\n").expect("a map");
        let stops = [[0.5, 0.2], [1.9, 0.3], [3.1, 0.4], [4.6, 0.5]];
        let way = way_along(&map, &stops);
        assert!(stops.iter().all(|stop| way.contains(stop)), "{way:?}");
        assert!(way.windows(2).all(|ends| sees(&map, ends[0], ends[1])), "{way:?}");
        let length = |way: &[[f32; 2]]| {
            let hops =
                way.windows(2).map(|ends| (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]));
            hops.sum::<f32>()
        };
        assert!(length(&way) < 10.5, "no detour: {way:?}");
        let cut_off = way_along(&map, &[[3.5, 0.5], [4.5, 0.5], [6.5, 0.5]]);
        assert_eq!(cut_off, [[3.5, 0.5], [4.5, 0.5]], "no line through a wall");
    }
}
