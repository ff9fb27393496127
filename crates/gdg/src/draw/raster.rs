//! The part of the map that each pixel of a picture shows.

use super::positions_along;
use crate::map::{Cell, Grid};

/// Lines are traced in pieces of this length, in pixels, to look only at pixels near them.
const PIECE: f32 = 16.0;

/// A window on the map and the pixels that show it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Raster {
    /// The part of the map shown, in cells: left, top, width, height.
    pub window: [f32; 4],
    /// Columns and rows of pixels.
    pub pixels: (usize, usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RasterPixel {
    /// Nothing: it lies outside the map.
    Outside,
    /// Nothing but wall.
    Wall,
    /// Several cells, of which at least half are wall, or which a wall crosses from side to side,
    /// however thin; represented by the free position nearest to its centre.
    Crossed([f32; 2]),
    /// Free; represented by the free position nearest to its centre.
    Free([f32; 2]),
}

impl Raster {
    /// Returns the pixels for a whole map: as many for each cell as possible, or the map scaled down
    /// where it is longer than `longest` pixels.
    pub fn of_map(map: &Grid, longest: usize) -> Self {
        let (width, height) = (map.width(), map.height());
        let longer = width.max(height);
        let along = |side: usize| match longest / longer {
            0 => (side * longest).div_ceil(longer),
            scale => side * scale,
        };
        let window = [0.0, 0.0, width as f32, height as f32];
        Self { window, pixels: (along(width), along(height)) }
    }

    pub fn len(&self) -> usize {
        self.pixels.0 * self.pixels.1
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub fn ground(&self, map: &Grid, column: usize, row: usize) -> RasterPixel {
        let [left, top, width, height] = self.window;
        let (columns, rows) = self.pixels;
        let along = |i: usize, n: usize, from: f32, size: f32| {
            let at = |i: f32| from + i / n as f32 * size;
            (at(i as f32), at(i as f32 + 0.5), at(i as f32 + 1.0))
        };
        let (x0, x, x1) = along(column, columns, left, width);
        let (y0, y, y1) = along(row, rows, top, height);
        if !map.contains(Cell::new(x as usize, y as usize)) {
            return RasterPixel::Outside;
        }
        if map.is_free_at(x, y) && x1 - x0 <= 1.0 {
            return RasterPixel::Free([x, y]);
        }
        // A pixel covers the cells whose centres lie in it, and at least the one that contains its
        // own centre.
        let span = |from: f32, middle: f32, to: f32, max: usize| {
            let first = (from + 0.5) as usize;
            let end = ((to + 0.5) as usize).min(max);
            if first < end { first..end } else { middle as usize..middle as usize + 1 }
        };
        let xs = span(x0, x, x1, map.width());
        let ys = span(y0, y, y1, map.height());
        let (columns, rows) = (xs.len(), ys.len());
        let cells = ys.flat_map(|y| xs.clone().map(move |x| Cell::new(x, y)));
        let cells: Vec<Cell> = cells.collect();
        let free: Vec<bool> = cells.iter().map(|c| map.is_free(*c)).collect();
        let off = |c: &[f32; 2]| (c[0] - x).powi(2) + (c[1] - y).powi(2);
        let all_free = cells.iter().zip(&free).filter(|(_, free)| **free).map(|(c, _)| c.centre());
        let Some(nearest) = all_free.min_by(|a, b| off(a).total_cmp(&off(b))) else {
            return RasterPixel::Wall;
        };
        let count = free.iter().filter(|free| **free).count();
        let mostly_wall = 2 * count <= free.len();
        if mostly_wall || count < free.len() && is_crossed(&free, (columns, rows)) {
            RasterPixel::Crossed(nearest)
        } else {
            RasterPixel::Free(nearest)
        }
    }

    /// Returns the number of cells along each axis that a pixel covers, on average.
    pub fn cells_per_pixel(&self) -> f32 {
        (self.window[2] / self.pixels.0 as f32).max(self.window[3] / self.pixels.1 as f32)
    }

    /// Returns the pixels that show free ground, by index row by row, and the position that
    /// represents each.
    pub fn free_ground(&self, map: &Grid) -> (Vec<usize>, Vec<[f32; 2]>) {
        let (columns, rows) = self.pixels;
        let free =
            (0..columns * rows).filter_map(|i| match self.ground(map, i % columns, i / columns) {
                RasterPixel::Free(position) | RasterPixel::Crossed(position) => Some((i, position)),
                RasterPixel::Wall | RasterPixel::Outside => None,
            });
        free.unzip()
    }

    /// Returns the position at the middle of pixel `i`.
    pub fn middle_of(&self, i: usize) -> [f32; 2] {
        let ([left, top, width, height], (columns, rows)) = (self.window, self.pixels);
        let (column, row) = ((i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5);
        [left + column / columns as f32 * width, top + row / rows as f32 * height]
    }

    /// Returns where to draw what is at a free position: on floor, although a pixel that contains
    /// the position may show the wall beside it.
    pub fn on_floor(&self, map: &Grid, at: [f32; 2]) -> [f32; 2] {
        let Some((column, row)) = self.pixel_of(at).filter(|_| map.is_free_at(at[0], at[1])) else {
            return at;
        };
        if matches!(self.ground(map, column, row), RasterPixel::Free(_)) {
            return at;
        }
        let cell = at.map(f32::floor);
        // Floor of the same cell first: other floor may be behind a thin wall.
        let off = |[x, y]: [f32; 2]| {
            let is_elsewhere = [x, y].map(f32::floor) != cell;
            (is_elsewhere, (x - at[0]).hypot(y - at[1]))
        };
        let around = (row.saturating_sub(1)..(row + 2).min(self.pixels.1)).flat_map(|row| {
            let columns = column.saturating_sub(1)..(column + 2).min(self.pixels.0);
            columns.map(move |column| (column, row))
        });
        let floor = around.filter_map(|(column, row)| match self.ground(map, column, row) {
            RasterPixel::Free(shown) => Some((off(shown), row * self.pixels.0 + column)),
            _ => None,
        });
        let nearest = floor.min_by(|((a_is_elsewhere, a), _), ((b_is_elsewhere, b), _)| {
            a_is_elsewhere.cmp(b_is_elsewhere).then(a.total_cmp(b))
        });
        nearest.map_or(at, |(_, i)| self.middle_of(i))
    }

    /// Returns the column and row of the pixel that shows a position, if any does.
    pub fn pixel_of(&self, [x, y]: [f32; 2]) -> Option<(usize, usize)> {
        let [left, top, width, height] = self.window;
        let column = (x - left) / width * self.pixels.0 as f32;
        let row = (y - top) / height * self.pixels.1 as f32;
        let inside = column >= 0.0
            && row >= 0.0
            && (column as usize) < self.pixels.0
            && (row as usize) < self.pixels.1;
        inside.then_some((column as usize, row as usize))
    }
}

/// Returns whether a wall crosses a block of cells, given row by row: connects opposite sides, or
/// cuts off a corner.
fn is_crossed(free: &[bool], (columns, rows): (usize, usize)) -> bool {
    let mut seen = free.to_vec();
    for from in 0..free.len() {
        let (mut cells, mut sides) = (0, [false; 4]);
        let mut reached = vec![from];
        while let Some(i) = reached.pop() {
            if std::mem::replace(&mut seen[i], true) {
                continue;
            }
            let (x, y) = (i % columns, i / columns);
            cells += 1;
            for (side, at) in
                sides.iter_mut().zip([x == 0, y == 0, x + 1 == columns, y + 1 == rows])
            {
                *side |= at;
            }
            // Walls that touch diagonally block the way.
            let beside = x.saturating_sub(1)..(x + 2).min(columns);
            reached.extend(
                (y.saturating_sub(1)..(y + 2).min(rows))
                    .flat_map(|y| beside.clone().map(move |x| y * columns + x)),
            );
        }
        let [left, top, right, bottom] = sides;
        if left && right || top && bottom || cells > 1 && (left || right) && (top || bottom) {
            return true;
        }
    }
    false
}

/// Calls `cover` for the pixels of a picture of that size that are within `radius` of a line between
/// two of them, with how much of each is covered, of 255. `aspect` is a pixel's width as a share of
/// its height. Edges that are not smooth cover whole pixels, and those that the line passes.
pub fn trace(
    ends: [[f32; 2]; 2],
    radius: f32,
    (columns, rows): (usize, usize),
    aspect: f32,
    is_smooth: bool,
    mut cover: impl FnMut(usize, u8),
) {
    let [from, to] = ends;
    let longer = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
    if !is_smooth {
        for [x, y] in positions_along(ends, longer.ceil().clamp(1.0, 1e5) as usize) {
            if x >= 0.0 && y >= 0.0 && (x as usize) < columns && (y as usize) < rows {
                cover(y as usize * columns + x as usize, u8::MAX);
            }
        }
        if radius <= 0.5 * aspect.max(1.0) {
            return;
        }
    }
    let pieces: Vec<[f32; 2]> =
        positions_along(ends, (longer / PIECE).ceil().clamp(1.0, 1e4) as usize).collect();
    let span = |a: f32, b: f32, radius: f32, count: usize| {
        let (low, high) = (a.min(b) - radius - 0.5, a.max(b) + radius + 1.5);
        (low.max(0.0) as usize).min(count)..(high.max(0.0) as usize).min(count)
    };
    for ends in pieces.windows(2) {
        let ([x, y], end) = (ends[0], ends[1]);
        let along = [aspect * (end[0] - x), end[1] - y];
        let squared = along[0] * along[0] + along[1] * along[1];
        for row in span(y, end[1], radius, rows) {
            for column in span(x, end[0], radius / aspect, columns) {
                let at = [aspect * (column as f32 + 0.5 - x), row as f32 + 0.5 - y];
                let share = if squared > 0.0 {
                    ((at[0] * along[0] + at[1] * along[1]) / squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                let off = (at[0] - share * along[0]).hypot(at[1] - share * along[1]);
                let covered = if is_smooth {
                    (255.0 * (radius + 0.5 - off).clamp(0.0, 1.0)) as u8
                } else {
                    u8::from(off <= radius) * u8::MAX
                };
                if covered > 0 {
                    cover(row * columns + column, covered);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::parse_map;

    /// Returns what the pixels show: `#` wall, `+` crossed, `.` free.
    fn shown(text: &str, pixels: (usize, usize)) -> String {
        let map = parse_map("map", text.as_bytes()).expect("a map");
        let raster = Raster { window: [0.0, 0.0, map.width() as f32, map.height() as f32], pixels };
        let sign = |i: usize| match raster.ground(&map, i % pixels.0, i / pixels.0) {
            RasterPixel::Outside => ' ',
            RasterPixel::Wall => '#',
            RasterPixel::Crossed(_) => '+',
            RasterPixel::Free(_) => '.',
        };
        (0..pixels.0 * pixels.1).map(sign).collect()
    }

    #[test]
    fn a_wall_one_cell_thick_is_never_lost() {
        let open = ".........\n";
        // Wherever it lies within the pixels, and whether it is straight or not.
        for at in 0..9 {
            let row: String = (0..9).map(|x| if x == at { '#' } else { '.' }).collect();
            let shown = shown(&format!("{row}\n").repeat(9), (3, 3));
            assert_eq!(shown.matches('+').count(), 3, "column {at}: {shown}");
        }
        let step = ".........\n####.....\n...#.....\n...######\n".to_owned() + &open.repeat(5);
        assert_eq!(shown(&step, (3, 3)), "++..++...", "a wall with a step");
    }

    #[test]
    fn what_is_free_is_drawn_on_floor() {
        let map = parse_map("map", b"#####\n#..##\n##.##\n##..#\n#####\n").expect("a map");
        let free = |i: usize| [(i % 200) as f32 / 40.0, (i / 200) as f32 / 40.0];
        for pixels in [(5, 5), (6, 6), (7, 9), (8, 13), (29, 19)] {
            let raster = Raster { window: [0.0, 0.0, 5.0, 5.0], pixels };
            let mut moved = 0;
            for at in (0..200 * 200).map(free).filter(|[x, y]| map.is_free_at(*x, *y)) {
                let shown = raster.on_floor(&map, at);
                let (column, row) = raster.pixel_of(shown).expect("on the map");
                let ground = raster.ground(&map, column, row);
                assert!(
                    matches!(ground, RasterPixel::Free(_)),
                    "{at:?} at {shown:?} of {pixels:?}"
                );
                assert!((0..2).all(|axis| (shown[axis] - at[axis]).abs() < 1.0), "{at:?}: near");
                moved += usize::from(shown != at);
            }
            assert_eq!(moved > 0, pixels != (5, 5), "{pixels:?}: {moved} beside walls");
        }
        let raster = Raster { window: [0.0, 0.0, 5.0, 5.0], pixels: (5, 5) };
        assert_eq!(raster.on_floor(&map, [0.5, 0.5]), [0.5, 0.5], "in a wall");
    }

    #[test]
    fn pillars_do_not_make_walls() {
        assert_eq!(shown("...\n.#.\n...\n", (1, 1)), ".");
        assert_eq!(shown("#...\n....\n.##.\n....\n", (1, 1)), ".");
        assert_eq!(shown("###\n###\n...\n", (1, 1)), "+", "mostly wall");
        assert_eq!(shown("##\n##\n..\n..\n", (1, 2)), "#.");
    }
}
