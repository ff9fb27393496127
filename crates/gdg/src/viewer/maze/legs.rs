//! The way along a plan: straight where no wall is between two stops, and around walls elsewhere.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use crate::draw::positions_along;
use crate::map::{Cell, Grid};

/// Positions along a straight line in each cell that it crosses.
const SIGHT_PER_CELL: f32 = 8.0;

/// The distance that a way keeps from walls where it turns, in cells.
const MARGIN: f32 = 0.25;

/// Cells that are searched for a way around walls, at most: legs of a plan are short.
const MOST_SEARCHED: usize = 20_000;

/// Costs of a step along an axis and of a diagonal one.
const STEP: usize = 5;
const DIAGONAL: usize = 7;

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
    let cells = cells_between(map, cell_of(map, from)?, cell_of(map, to)?)?;
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

fn cell_of(map: &Grid, [x, y]: [f32; 2]) -> Option<Cell> {
    map.is_free_at(x, y).then(|| Cell::new(x as usize, y as usize))
}

/// Returns the cells of a shortest way, both ends included.
fn cells_between(map: &Grid, from: Cell, to: Cell) -> Option<Vec<Cell>> {
    let least = |cell: Cell| {
        let (x, y) = (cell.x.abs_diff(to.x), cell.y.abs_diff(to.y));
        STEP * x.max(y) + (DIAGONAL - STEP) * x.min(y)
    };
    let mut known = HashMap::from([(from, (0, from))]);
    let mut open = BinaryHeap::from([(Reverse(least(from)), from)]);
    for _ in 0..MOST_SEARCHED {
        let (_, cell) = open.pop()?;
        if cell == to {
            let mut cells = vec![to];
            while let Some((_, before)) = known.get(&cells[cells.len() - 1])
                && cells[cells.len() - 1] != from
            {
                cells.push(*before);
            }
            cells.reverse();
            return Some(cells);
        }
        let cost = known[&cell].0;
        for next in map.neighbours(cell) {
            let is_diagonal = next.x != cell.x && next.y != cell.y;
            let cost = cost + if is_diagonal { DIAGONAL } else { STEP };
            if known.get(&next).is_none_or(|(best, _)| cost < *best) {
                known.insert(next, (cost, cell));
                open.push((Reverse(cost + least(next)), next));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

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
