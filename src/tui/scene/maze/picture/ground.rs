//! Ground, walls, and the edge of the known world.

use std::ops::Range;

use crate::tui::layers::Overlay;
use crate::tui::scene::maze::MazeState;
use crate::tui::scene::scale::MAX_SHOWN_ERROR;
use crate::tui::screen::Screen;
use crate::tui::sheet::{Ink, Sheet};
use crate::tui::theme::{Rgb, blend};
use gdg::map::{Cell, Grid};
use gdg::viewer::Field;
use gdg::viewer::maze::Knowledge;

/// Number of shades from near to far.
const SHADES: usize = 1024;

/// Width and spacing of hatching, as shares of a character's height.
const HATCH_WIDTH: f32 = 0.12;
const HATCH_SPACING: f32 = 0.5;

/// Half the width of the edge of the known world, as a share of a character's height.
const EDGE: f32 = 0.06;

/// Minimum share of the wall colour in a pixel that shows walls among several cells.
const LEAST_WALL_SHARE: f32 = 0.5;

/// Positions on the map in pixels.
pub struct Scale {
    /// Columns and rows of pixels.
    pub size: (u32, u32),
    window: [f32; 4],
    /// Width and height of a character.
    character: (u16, u16),
}

impl Scale {
    /// Shows a part of the map (left, top, width, height) in `size` pixels.
    pub fn new(window: [f32; 4], size: (u32, u32), character: (u16, u16)) -> Self {
        Self { size, window, character }
    }

    /// Returns the pixels in a character's height: the unit of all signs.
    pub fn unit(&self) -> f32 {
        f32::from(self.character.1)
    }

    /// Returns the pixels in a cell's width.
    pub fn cell_width(&self) -> f32 {
        self.size.0 as f32 / self.window[2]
    }

    /// Converts a position on the map to pixels.
    pub fn pixel(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        let [left, top, width, height] = self.window;
        [(x - left) / width * self.size.0 as f32, (y - top) / height * self.size.1 as f32]
    }

    /// Returns left, top, right and bottom of a cell.
    pub fn cell(&self, cell: Cell) -> [f32; 4] {
        let [x, y] = [cell.x, cell.y].map(|n| n as f32);
        let ([left, top], [right, bottom]) = (self.pixel([x, y]), self.pixel([x + 1.0, y + 1.0]));
        [left, top, right, bottom]
    }

    /// Returns the columns and the rows of cells (first, end) that are shown of a map of this size.
    fn shown_cells(&self, size: [usize; 2]) -> [[usize; 2]; 2] {
        let [left, top, width, height] = self.window;
        let of = |from: f32, shown: f32, all: usize| {
            [from as usize, ((from + shown).ceil() as usize).min(all)]
        };
        [of(left, width, size[0]), of(top, height, size[1])]
    }

    /// Returns the cells (first, end) that each column of pixels shows, and each row: at least one.
    fn cells(&self) -> [Vec<(usize, usize)>; 2] {
        let [left, top, width, height] = self.window;
        [(left, width, self.size.0), (top, height, self.size.1)].map(|(from, shown, pixels)| {
            let at = |i: u32, off: f32| from + (i as f32 + off) / pixels as f32 * shown;
            let span = |i: u32| {
                // A pixel shows the cell of its middle, and others whose middles are in it.
                let (first, end) = ((at(i, 0.0) + 0.5) as usize, (at(i, 1.0) + 0.5) as usize);
                let middle = at(i, 0.5).max(0.0) as usize;
                if first < end && shown > pixels as f32 {
                    (first, end)
                } else {
                    (middle, middle + 1)
                }
            };
            (0..pixels).map(span).collect()
        })
    }
}

/// The kind of ground that a cell's pixels show.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Plain,
    Pocket,
    Beyond,
    CutOff,
    Outside,
}

/// Draws the ground as if there were no walls: `field` has rows of `columns` values, evenly spaced
/// over the window, between which others are interpolated.
pub fn draw(
    sheet: &mut Sheet,
    scale: &Scale,
    field: Option<&[f32]>,
    columns: usize,
    maze: &MazeState,
    screen: &Screen,
) {
    let colours = Colours::new(maze, screen);
    let shades: Vec<f32> =
        field.unwrap_or_default().iter().map(|value| colours.shade(*value)).collect();
    let width = scale.size.0 as usize;
    let samples = Samples::new(&shades, columns, maze.shown_field(screen) != Field::Visits);
    let across = samples.across(width);
    let [columns_of_cells, rows_of_cells] = scale.cells();
    let hatching = Hatching {
        spacing: (HATCH_SPACING * scale.unit()).max(3.0) as usize,
        width: (HATCH_WIDTH * scale.unit()).max(1.0) as usize,
    };
    // Runs of pixels of the same kind, which the rows of a cell share.
    let mut runs: Vec<(Range<usize>, Kind)> = Vec::new();
    let mut before = None;
    let (mut values, mut shown) = (Vec::new(), vec![0; width]);
    let (pixels, _) = sheet.0.data_mut().as_chunks_mut::<4>();
    for (y, row) in pixels.chunks_mut(width).enumerate() {
        let cell_row = rows_of_cells[y].0;
        if before.replace(cell_row) != Some(cell_row) {
            runs.clear();
            let mut x = 0;
            for same_cell in columns_of_cells.chunk_by(|a, b| a.0 == b.0) {
                let (own, end) =
                    (kind(Cell::new(same_cell[0].0, cell_row), maze, screen), x + same_cell.len());
                match runs.last_mut() {
                    Some((run, kind)) if *kind == own => run.end = end,
                    _ => runs.push((x..end, own)),
                }
                x = end;
            }
        }
        samples.row(y, scale.size.1 as usize, &mut values);
        fill_row(&values, &across, &mut shown);
        for (run, kind) in &runs {
            colours.paint(&mut row[run.clone()], &shown[run.clone()], *kind, |x| {
                hatching.is_on(x + run.start, y, *kind)
            });
        }
    }
}

/// Diagonal lines.
struct Hatching {
    spacing: usize,
    width: usize,
}

impl Hatching {
    /// Returns whether a pixel is on a line; the slope depends on the kind.
    fn is_on(&self, x: usize, y: usize, kind: Kind) -> bool {
        let along = if kind == Kind::CutOff { x + self.spacing - y % self.spacing } else { x + y };
        along % self.spacing < self.width
    }
}

/// Returns what the pixels of a cell show.
fn kind(cell: Cell, maze: &MazeState, screen: &Screen) -> Kind {
    let map = &maze.map;
    if !map.contains(cell) {
        return Kind::Outside;
    }
    let view = &maze.view;
    let to_goal = matches!(
        maze.shown_field(screen),
        Field::Learned | Field::Composed | Field::True | Field::Error
    );
    if to_goal && view.cut_off.len() == map.free().len() && view.cut_off[map.index(cell)] {
        return Kind::CutOff;
    }
    let fades = maze.shown_field(screen).fades();
    if !screen.overlays.has(Overlay::Unexplored)
        || view.exploration.is_complete(map)
        || !map.is_free(cell)
    {
        return Kind::Plain;
    }
    match view.exploration.at(cell.centre()) {
        Knowledge::Pocket if fades => Kind::Pocket,
        Knowledge::Beyond if fades => Kind::Beyond,
        _ => Kind::Plain,
    }
}

/// The shade of an unknown value.
const UNKNOWN: u16 = SHADES as u16;

/// The colours of all shades and of unknown values, on ground that is plain, a pocket, beyond the
/// known world, and hatched there.
struct Colours {
    shades: [Vec<[u8; 4]>; 4],
    cut_off: [[u8; 4]; 2],
    outside: [u8; 4],
    field: Field,
    farthest: f32,
}

fn opaque((r, g, b): Rgb) -> [u8; 4] {
    [r, g, b, 255]
}

impl Colours {
    fn new(maze: &MazeState, screen: &Screen) -> Self {
        let theme = screen.theme.in_full_colour();
        let variants = |rgb: Rgb| {
            [rgb, theme.pocket(rgb), theme.unvisited(rgb, false), theme.unvisited(rgb, true)]
                .map(opaque)
        };
        let shade = |i: usize| {
            let share = i as f32 / (SHADES - 1) as f32;
            let is_error = maze.shown_field(screen) == Field::Error;
            variants(if is_error {
                theme.error_colour(2.0 * share - 1.0)
            } else {
                theme.distance_colour(share)
            })
        };
        let all: Vec<[[u8; 4]; 4]> =
            (0..SHADES).map(shade).chain([variants(theme.unknown)]).collect();
        Self {
            shades: [0, 1, 2, 3].map(|variant| all.iter().map(|own| own[variant]).collect()),
            cut_off: [true, false].map(|is_hatched| opaque(theme.cut_off(is_hatched))),
            outside: opaque(theme.page.map_or((0, 0, 0), |(_, ground)| ground)),
            field: maze.shown_field(screen),
            farthest: maze.farthest(screen),
        }
    }

    /// Returns the shade of a value; NaN if it is unknown.
    fn shade(&self, value: f32) -> f32 {
        let share = match self.field {
            Field::Error => 0.5 + 0.5 * value / MAX_SHOWN_ERROR,
            Field::Visits => 1.0 - (1.0 + value).ln() / (1.0 + self.farthest).ln(),
            _ => value / self.farthest,
        };
        share.clamp(0.0, 1.0) * (SHADES - 1) as f32
    }

    /// Colours pixels of one kind by their shades.
    fn paint(
        &self,
        pixels: &mut [[u8; 4]],
        shades: &[u16],
        kind: Kind,
        is_hatched: impl Fn(usize) -> bool,
    ) {
        let [plain, pocket, beyond, hatched] = &self.shades;
        let [line, between] = self.cut_off;
        let mut by = |colours: &[[u8; 4]]| {
            pixels
                .iter_mut()
                .zip(shades)
                .for_each(|(pixel, shade)| *pixel = colours[usize::from(*shade)]);
        };
        match kind {
            Kind::Plain => by(plain),
            Kind::Pocket => by(pocket),
            Kind::Beyond => {
                by(beyond);
                let on = (0..pixels.len()).filter(|x| is_hatched(*x));
                on.for_each(|x| pixels[x] = hatched[usize::from(shades[x])]);
            }
            Kind::CutOff => {
                let colour = |x: usize| if is_hatched(x) { line } else { between };
                pixels.iter_mut().enumerate().for_each(|(x, pixel)| *pixel = colour(x));
            }
            Kind::Outside => pixels.fill(self.outside),
        }
    }
}

/// Evenly spaced values.
struct Samples<'a> {
    values: &'a [f32],
    columns: usize,
    /// Whether to interpolate between them.
    is_smooth: bool,
}

/// A pixel's position between two samples.
#[derive(Clone, Copy)]
struct Place {
    from: usize,
    to: usize,
    share: f32,
}

impl Place {
    /// Places the middle of pixel `i` of `pixels` among `count` samples.
    fn new(i: usize, pixels: usize, count: usize, is_smooth: bool) -> Self {
        let at = (i as f32 + 0.5) / pixels as f32 * count as f32;
        let last = count.saturating_sub(1);
        if !is_smooth {
            let nearest = (at as usize).min(last);
            return Self { from: nearest, to: nearest, share: 0.0 };
        }
        let at = (at - 0.5).clamp(0.0, last as f32);
        let from = at as usize;
        Self { from, to: (from + 1).min(last), share: at - from as f32 }
    }
}

/// Replaces an unknown one of two values by the other.
fn known(a: f32, b: f32) -> (f32, f32) {
    (if a.is_nan() { b } else { a }, if b.is_nan() { a } else { b })
}

impl<'a> Samples<'a> {
    fn new(values: &'a [f32], columns: usize, is_smooth: bool) -> Self {
        Self { values, columns, is_smooth }
    }

    fn across(&self, pixels: usize) -> Vec<Place> {
        (0..pixels).map(|x| Place::new(x, pixels, self.columns, self.is_smooth)).collect()
    }

    /// Computes the values in the row of pixels `y` of `pixels`, in the samples' columns.
    fn row(&self, y: usize, pixels: usize, values: &mut Vec<f32>) {
        values.clear();
        let rows = self.values.len().checked_div(self.columns).unwrap_or(0);
        if rows > 0 {
            let place = Place::new(y, pixels, rows, self.is_smooth);
            let of = |row: usize| &self.values[row * self.columns..(row + 1) * self.columns];
            values.extend(of(place.from).iter().zip(of(place.to)).map(|(a, b)| {
                let (a, b) = known(*a, *b);
                a + place.share * (b - a)
            }));
        }
    }
}

/// Computes the shades of a row of pixels.
fn fill_row(values: &[f32], across: &[Place], shades: &mut [u16]) {
    let mut x = 0;
    // Pixels between the same two values.
    for places in across.chunk_by(|a, b| a.from == b.from) {
        let own = &mut shades[x..x + places.len()];
        x += places.len();
        let (Some(a), Some(b)) = (values.get(places[0].from), values.get(places[0].to)) else {
            own.fill(UNKNOWN);
            continue;
        };
        let (a, b) = known(*a, *b);
        if a.is_nan() {
            own.fill(UNKNOWN);
        } else {
            own.iter_mut()
                .zip(places)
                .for_each(|(shade, place)| *shade = (a + place.share * (b - a)) as u16);
        }
    }
}

/// Draws the walls. Where a pixel shows several cells, it is darker the more of them are wall.
pub fn draw_walls(sheet: &mut Sheet, scale: &Scale, map: &Grid, wall: Rgb) {
    let [columns, rows] = scale.cells();
    let mut runs = Vec::new();
    let mut before = None;
    let (pixels, _) = sheet.0.data_mut().as_chunks_mut::<4>();
    for (row, cells) in pixels.chunks_mut(scale.size.0 as usize).zip(rows) {
        // The rows of a cell share their runs.
        if before.replace(cells) != Some(cells) {
            wall_runs(map, &columns, cells, &mut runs);
        }
        for (run, share) in &runs {
            let mix =
                |[r, g, b, _]: [u8; 4]| opaque(blend((r, g, b), wall, share.max(LEAST_WALL_SHARE)));
            match &mut row[run.clone()] {
                all if *share == 1.0 => all.fill(opaque(wall)),
                some => some.iter_mut().for_each(|pixel| *pixel = mix(*pixel)),
            }
        }
    }
}

/// Finds the runs of pixels with walls, and the walls' share, in a row that shows the cells from
/// `top` to before `bottom`; each pixel shows its `columns`.
fn wall_runs(
    map: &Grid,
    columns: &[(usize, usize)],
    (top, bottom): (usize, usize),
    runs: &mut Vec<(Range<usize>, f32)>,
) {
    runs.clear();
    let mut end = 0;
    for same_cells in columns.chunk_by(|a, b| a == b) {
        let ((left, right), x) = (same_cells[0], end);
        end += same_cells.len();
        if right > map.width() || bottom > map.height() {
            continue;
        }
        let row = |y: usize| &map.free()[y * map.width() + left..y * map.width() + right];
        let walls: usize =
            (top..bottom).map(|y| row(y).iter().filter(|free| !**free).count()).sum();
        let share = walls as f32 / ((right - left) * (bottom - top)) as f32;
        match runs.last_mut() {
            Some((run, own)) if run.end == x && *own == share => run.end = end,
            _ if walls > 0 => runs.push((x..end, share)),
            _ => {}
        }
    }
}

/// Draws the edge of the known world, around what lies beyond it.
pub fn draw_edge(sheet: &mut Sheet, scale: &Scale, maze: &MazeState, screen: &Screen) {
    let (map, exploration) = (&maze.map, &maze.view.exploration);
    if !screen.overlays.has(Overlay::Unexplored) || exploration.is_complete(map) {
        return;
    }
    let is_beyond = |x: usize, y: usize| {
        map.free()[y * map.width() + x] && exploration.at([x as f32, y as f32]) == Knowledge::Beyond
    };
    // Between two free cells, one of which lies beyond.
    let borders = |a: (usize, usize), b: (usize, usize)| {
        map.is_free(Cell::new(b.0, b.1))
            && map.is_free(Cell::new(a.0, a.1))
            && is_beyond(a.0, a.1) != is_beyond(b.0, b.1)
    };
    let (rgb, share) = screen.theme.in_full_colour().edge();
    let (half, own) = ((EDGE * scale.unit()).max(0.7), Ink(rgb, share));
    let [[left, right], [top, bottom]] = scale.shown_cells([map.width(), map.height()]);
    for y in top..bottom {
        for x in left..right {
            let [from_x, from_y, to_x, to_y] = scale.cell(Cell::new(x, y));
            if x + 1 < map.width() && borders((x, y), (x + 1, y)) {
                sheet.tint([to_x - half, from_y, to_x + half, to_y], own);
            }
            if y + 1 < map.height() && borders((x, y), (x, y + 1)) {
                sheet.tint([from_x, to_y - half, to_x, to_y + half], own);
            }
        }
    }
}
