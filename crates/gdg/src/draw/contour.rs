//! Contour lines of a field of values, one a pixel: marching squares (Lorensen and Cline 1987, in
//! the plane) with a pixel's middle at each corner.
//!
//! The crate `contour` does not fit: it closes its lines along the border of the field, and so
//! would outline every wall.

/// Returns how far apart the values of neighbouring lines have to be for the lines to be `spacing`
/// pixels apart or more, on average: 1, 2 or 5 times a power of ten, at least 1. `field` has rows
/// of `columns` pixels; NaN pixels do not count.
pub fn contour_interval(field: &[f32], columns: usize, spacing: f32) -> f32 {
    round_up(f64::from(spacing) * mean_slope(field, columns))
}

/// Returns the mean length of the gradient, per pixel. By the coarea formula, the lines' length in
/// pixels is this over their interval, times the number of pixels.
fn mean_slope(field: &[f32], columns: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0_u32);
    for (i, value) in field.iter().enumerate() {
        let right = field.get(i + 1).filter(|_| !(i + 1).is_multiple_of(columns));
        let rises = [right, field.get(i + columns)]
            .map(|other| other.map_or(f32::NAN, |other| other - value));
        let mut known = rises.into_iter().filter(|rise| rise.is_finite()).peekable();
        if known.peek().is_some() {
            sum += known.map(|rise| f64::from(rise).powi(2)).sum::<f64>().sqrt();
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

/// Returns the least of 1, 2, 5, 10, 20, 50, ... that is not below `least`.
fn round_up(least: f64) -> f32 {
    let power = 10_f64.powf(least.max(1.0).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|step| step * power);
    steps.into_iter().find(|step| *step >= least).unwrap_or(steps[3]) as f32
}

/// A contour line between the middles of pixels, or a piece of it between walls.
#[derive(Clone, Debug, PartialEq)]
pub struct ContourPath {
    /// The value along it.
    pub level: f32,
    /// Where it passes from one square of four pixels to the next, in pixels: the middle of the
    /// first one is at 0.5, 0.5. A closed line ends where it begins.
    pub points: Vec<[f32; 2]>,
}

impl ContourPath {
    /// Returns the pixels it passes, in a field with rows of `columns`: each touches the next, and
    /// none of them can be left out.
    pub fn pixels(&self, columns: usize) -> Vec<usize> {
        let passed = self.points.iter().map(|[x, y]| *y as usize * columns + *x as usize);
        let mut pixels = thinned(passed, columns);
        if pixels.len() > 1 && pixels.first() == pixels.last() {
            pixels.pop();
        }
        pixels
    }
}

/// Returns the lines at all positive multiples of `interval` in `field`, which has rows of
/// `columns` pixels. Lines end at NaN pixels, and at cliffs, where several of them would coincide:
/// neither has lines along it.
pub fn contour_paths(field: &[f32], columns: usize, interval: f32) -> Vec<ContourPath> {
    let crossings = Crossings::new(field, columns, interval);
    let path = |borders: Vec<usize>| {
        let (first, last) = (borders[0], borders[borders.len() - 1]);
        let is_closed = borders.len() > 2 && crossings.links[last].contains(&Some(first as u32));
        let all = borders.iter().copied().chain(is_closed.then_some(first));
        ContourPath {
            level: crossings.level(first),
            points: all.map(|border| crossings.point(border)).collect(),
        }
    };
    crossings.lines().into_iter().map(path).collect()
}

/// Where lines cross the borders between neighbouring pixels. Border `2 i` is between pixel `i` and
/// the one to its right, `2 i + 1` between it and the one below.
struct Crossings<'a> {
    field: &'a [f32],
    columns: usize,
    interval: f32,
    /// The level of the line that crosses each border, in intervals; 0 if none does.
    levels: Vec<u32>,
    /// The crossings of the same line before and after: above and below (or left and right of) the
    /// two pixels.
    links: Vec<[Option<u32>; 2]>,
}

impl<'a> Crossings<'a> {
    fn new(field: &'a [f32], columns: usize, interval: f32) -> Self {
        let bands: Vec<Option<i32>> = field.iter().map(|value| band(*value, interval)).collect();
        let mut levels = vec![0; 2 * field.len()];
        for (i, own) in bands.iter().enumerate() {
            if let Some(right) = bands.get(i + 1).filter(|_| (i + 1) % columns != 0) {
                levels[2 * i] = level_between(*own, *right);
            }
            if let Some(below) = bands.get(i + columns) {
                levels[2 * i + 1] = level_between(*own, *below);
            }
        }
        let links = vec![[None; 2]; levels.len()];
        let mut crossings = Self { field, columns, interval, levels, links };
        for i in 0..field.len().saturating_sub(columns) {
            if (i + 1) % columns != 0 {
                crossings.link_within_square(i);
            }
        }
        crossings
    }

    /// Links the crossings within the square whose upper left corner is the middle of pixel `i`.
    fn link_within_square(&mut self, i: usize) {
        let corners = [i, i + 1, i + self.columns + 1, i + self.columns];
        // Top, right, bottom, left; each with the side on which the square is.
        let mut borders =
            [(2 * i, 1), (2 * corners[1] + 1, 0), (2 * corners[3], 0), (2 * i + 1, 1)];
        let levels = borders.map(|(border, _)| self.levels[border]);
        let level = levels.into_iter().max().unwrap_or(0);
        if level == 0 {
            return;
        }
        // At a saddle, two lines keep the corners apart that are on the other side of the level
        // than the middle.
        if levels == [level; 4] {
            let middle = corners.iter().map(|corner| self.field[*corner] / 4.0).sum::<f32>();
            let is_above = |value: f32| value >= level as f32 * self.interval;
            if is_above(middle) != is_above(self.field[i]) {
                borders.rotate_left(1);
            }
        }
        for first in 0..4 {
            for second in first + 1..4 {
                let [(a, side_a), (b, side_b)] = [borders[first], borders[second]];
                let same = self.levels[a] != 0 && self.levels[a] == self.levels[b];
                if same && self.links[a][side_a].is_none() && self.links[b][side_b].is_none() {
                    self.links[a][side_a] = Some(b as u32);
                    self.links[b][side_b] = Some(a as u32);
                }
            }
        }
    }

    /// Returns the crossings of each line, from one end to the other.
    fn lines(&self) -> Vec<Vec<usize>> {
        let mut done = vec![false; self.levels.len()];
        let mut lines = Vec::new();
        for border in 0..done.len() {
            if self.levels[border] == 0 || std::mem::replace(&mut done[border], true) {
                continue;
            }
            let [mut borders, after] = [0, 1].map(|side| self.follow(border, side, &mut done));
            borders.reverse();
            borders.push(border);
            borders.extend(after);
            lines.push(borders);
        }
        lines
    }

    /// Returns the crossings after `border` on one side of it, up to the end of the line or back
    /// around to it.
    fn follow(&self, border: usize, side: usize, done: &mut [bool]) -> Vec<usize> {
        let mut passed = Vec::new();
        let (mut from, mut next) = (border, self.links[border][side]);
        while let Some(at) =
            next.map(|at| at as usize).filter(|at| !std::mem::replace(&mut done[*at], true))
        {
            passed.push(at);
            let [one, other] = self.links[at];
            next = if one == Some(from as u32) { other } else { one };
            from = at;
        }
        passed
    }

    fn level(&self, border: usize) -> f32 {
        self.levels[border] as f32 * self.interval
    }

    /// Returns where the line crosses `border`, in pixels.
    fn point(&self, border: usize) -> [f32; 2] {
        let (from, to) =
            (border / 2, border / 2 + if border.is_multiple_of(2) { 1 } else { self.columns });
        let share = (self.level(border) - self.field[from]) / (self.field[to] - self.field[from]);
        let [from, to] =
            [from, to].map(|i| [(i % self.columns) as f32 + 0.5, (i / self.columns) as f32 + 0.5]);
        [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
    }
}

/// Returns the level at or below a value, in intervals, if it is known.
fn band(value: f32, interval: f32) -> Option<i32> {
    value.is_finite().then(|| (value / interval).floor() as i32)
}

/// Returns the only positive level between the values of neighbouring pixels, by their bands; 0 if
/// there is none, and if there are several.
fn level_between(a: Option<i32>, b: Option<i32>) -> u32 {
    match (a, b) {
        (Some(a), Some(b)) if a.abs_diff(b) == 1 => a.max(b).max(0).unsigned_abs(),
        _ => 0,
    }
}

/// Leaves out the pixels of a line without which those before and after still touch, such as the
/// corners of its steps.
fn thinned(pixels: impl Iterator<Item = usize>, columns: usize) -> Vec<usize> {
    let touch = |a: usize, b: usize| {
        (a % columns).abs_diff(b % columns) <= 1 && (a / columns).abs_diff(b / columns) <= 1
    };
    let mut thin: Vec<usize> = Vec::new();
    for pixel in pixels {
        if matches!(thin[..], [.., before, _] if touch(before, pixel)) {
            thin.pop();
        }
        if thin.last() != Some(&pixel) {
            thin.push(pixel);
        }
    }
    thin
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: usize = 40;

    /// Returns a field of 40 by 30 pixels.
    fn field(value: impl Fn(f32, f32) -> f32) -> Vec<f32> {
        (0..COLUMNS * 30).map(|i| value((i % COLUMNS) as f32, (i / COLUMNS) as f32)).collect()
    }

    fn positions(line: &ContourPath) -> Vec<(usize, usize)> {
        line.pixels(COLUMNS).iter().map(|i| (i % COLUMNS, i / COLUMNS)).collect()
    }

    /// Returns whether some square of two by two pixels is all line, or some neighbours of a line
    /// do not touch.
    fn is_thick_or_torn(line: &ContourPath) -> bool {
        let own = positions(line);
        let thick = own.iter().any(|(x, y)| {
            [(x + 1, *y), (*x, y + 1), (x + 1, y + 1)].iter().all(|other| own.contains(other))
        });
        thick || own.windows(2).any(|p| p[0].0.abs_diff(p[1].0).max(p[0].1.abs_diff(p[1].1)) != 1)
    }

    #[test]
    fn lines_on_a_cone_are_circles_and_paths_are_where_they_are_but_finer() {
        let cone = field(|x, y| (x - 20.0).hypot(y - 15.0));
        let paths = contour_paths(&cone, COLUMNS, 10.0);
        let path = paths.iter().find(|path| path.level == 10.0).expect("a circle");
        let own = positions(path);
        let off = |[x, y]: [f32; 2]| ((x - 20.5).hypot(y - 15.5) - 10.0).abs();
        assert!(own.iter().all(|(x, y)| off([*x as f32 + 0.5, *y as f32 + 0.5]) <= 0.75));
        let [first, last] = [own[0], own[own.len() - 1]];
        assert!(first.0.abs_diff(last.0) <= 1 && first.1.abs_diff(last.1) <= 1, "closed");
        assert!(!is_thick_or_torn(path));
        let points = &path.points;
        assert!(points.iter().all(|at| off(*at) < 0.03), "far closer than a pixel");
        assert_eq!(points.first(), points.last(), "closed");
        let open = &contour_paths(&field(|x, _| x), COLUMNS, 30.0)[0];
        assert!(open.points.len() == 30 && open.points.iter().all(|at| at[0] == 30.5));
    }

    #[test]
    fn a_wall_interrupts_lines_and_has_none_along_it() {
        let wall = |y: f32| y == 12.0;
        // Across the wall, distances differ by a lot.
        let value = |x: f32, y: f32| {
            if wall(y) { f32::NAN } else { x + if y > 12.0 { 203.0 } else { 0.0 } }
        };
        let lines = contour_paths(&field(value), COLUMNS, 10.0);
        let levels = |above: bool| {
            let own =
                lines.iter().filter(|line| positions(line).iter().all(|(_, y)| (*y < 12) == above));
            own.map(|line| (line.level, positions(line).len())).collect::<Vec<_>>()
        };
        assert_eq!(levels(true), [(10.0, 12), (20.0, 12), (30.0, 12)]);
        assert_eq!(levels(false), [(210.0, 17), (220.0, 17), (230.0, 17), (240.0, 17)]);
        assert_eq!(lines.len(), 7, "none passes the wall");
    }

    #[test]
    fn passages_cliffs_saddles_and_unknown_fields_have_the_lines_that_they_allow() {
        let passage = field(|x, y| if y == 4.0 { x } else { f32::NAN });
        let lines = contour_paths(&passage, COLUMNS, 10.0);
        assert!(lines.iter().map(positions).eq([[(10, 4)], [(20, 4)], [(30, 4)]]));
        let cliff = field(|x, _| if x < 20.0 { 5.0 } else { 95.0 });
        assert_eq!(contour_paths(&cliff, COLUMNS, 10.0), []);
        // At a saddle they do not cross.
        let saddle = contour_paths(&[0.0, 12.0, 11.0, 1.0], 2, 10.0);
        assert!(saddle.iter().map(|line| line.pixels(2).len()).eq([1, 1]));
        for field in [vec![], vec![3.0, 3.0], vec![f32::INFINITY, 4.0, f32::NAN, 1e38]] {
            assert_eq!(contour_paths(&field, 2, 5.0), []);
        }
    }

    #[test]
    fn the_interval_is_round_and_keeps_lines_apart() {
        let interval = |slope: f32| contour_interval(&field(|x, _| slope * x), COLUMNS, 6.0);
        // Six pixels apart: 0.6, 1.5, 6, 7.2, 15 and 60 steps at least.
        assert_eq!(
            [0.1, 0.25, 1.0, 1.2, 2.5, 10.0].map(interval),
            [1.0, 2.0, 10.0, 10.0, 20.0, 100.0]
        );
        assert_eq!(contour_interval(&[f32::NAN; 4], 2, 6.0), 1.0, "nothing is known");
    }
}
