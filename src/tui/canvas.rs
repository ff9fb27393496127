//! The pixels of a scene, painted at any resolution: a few pixels a character, which become
//! characters, or the terminal's own, which are sent as a picture. Letters are written as
//! characters or as pixels.

use std::sync::Arc;

use super::theme::{Rgb, Theme, blend, contour, ink};
use super::viewport::MapFrame;
use gdg::draw::{
    self, ContourPath, Raster, TextPixel, contour_paths, paint_text, text_size, trace,
};
use gdg::map::Cell;

const CAPITAL_SHARE: f32 = 0.62;

/// Black outlines make signs stand out on any ground in pictures.
const SHADOW: Rgb = (0, 0, 0);

#[derive(Clone, Copy, Debug)]
pub struct Ink {
    /// The colour; `None` for one that stands out from the ground.
    pub rgb: Option<Rgb>,
    pub share: f32,
    /// The character without colours, if it is shown then.
    pub mark: Option<char>,
    /// Whether walls hide it.
    pub on_floor: bool,
}

impl Ink {
    /// Returns an ink that covers walls as well, with its character without colours.
    pub fn new(rgb: Rgb, share: f32, mark: char) -> Self {
        Self { rgb: Some(rgb), share, mark: Some(mark), on_floor: false }
    }
}

/// What a pixel shows below everything else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ground {
    #[default]
    Outside,
    Floor,
    Wall,
}

/// A letter or a sign on top of the pixels.
#[derive(Clone, Debug)]
pub enum Sign {
    Letter([f32; 2], char, Rgb),
    Symbol([f32; 2], char, Option<Rgb>),
}

#[derive(Debug)]
pub struct Canvas {
    pub frame: MapFrame,
    pub raster: Raster,
    /// Columns and rows of pixels in a character.
    pub character: (usize, usize),
    /// Whether they are the terminal's own pixels.
    pub is_fine: bool,
    /// The colours, row by row.
    pub pixels: Vec<[u8; 3]>,
    /// Shared by the frames that are painted on the same ground.
    pub grounds: Arc<Vec<Ground>>,
    /// The character of each pixel without colours; none in pictures.
    pub marks: Vec<char>,
    /// What lies on top, if characters show it.
    pub signs: Vec<Sign>,
    /// Pixels that have changed since the last full paint.
    pub changed: Vec<usize>,
    /// How much of each pixel is covered by what is being painted, and where that is anything.
    cover: Vec<u8>,
    touched: Vec<usize>,
}

impl Canvas {
    /// Creates an empty canvas; with the size of a `character` in pixels, one for a picture.
    pub fn new(frame: &MapFrame, character: Option<(u16, u16)>) -> Self {
        let is_fine = character.is_some();
        let character =
            character.map_or(frame.marker.pixels(), |(across, down)| (across.into(), down.into()));
        let area = frame.area;
        let pixels =
            (usize::from(area.width) * character.0, usize::from(area.height) * character.1);
        let raster = Raster { pixels, ..frame.raster };
        let (count, coarse) = (raster.len(), if is_fine { 0 } else { raster.len() });
        Self {
            frame: frame.clone(),
            raster,
            character,
            is_fine,
            pixels: vec![[0; 3]; count],
            grounds: Arc::new(vec![Ground::Outside; count]),
            marks: vec![' '; coarse],
            signs: Vec::new(),
            changed: Vec::new(),
            cover: vec![0; count],
            touched: Vec::new(),
        }
    }

    /// Returns a copy to draw on, which reuses the memory of `pixels`.
    pub fn on_top(&self, mut pixels: Vec<[u8; 3]>) -> Self {
        pixels.clone_from(&self.pixels);
        Self {
            frame: self.frame.clone(),
            raster: self.raster,
            character: self.character,
            is_fine: self.is_fine,
            pixels,
            grounds: self.grounds.clone(),
            marks: self.marks.clone(),
            signs: self.signs.clone(),
            changed: Vec::new(),
            cover: vec![0; self.cover.len()],
            touched: Vec::new(),
        }
    }

    pub fn columns(&self) -> usize {
        self.raster.pixels.0
    }

    /// Returns the pixels in a character's height: the unit of all widths and radii.
    fn unit(&self) -> f32 {
        self.character.1 as f32
    }

    /// Returns the width of a pixel as a share of its height: characters are twice as high as wide.
    fn aspect(&self) -> f32 {
        let (across, down) = self.character;
        if self.is_fine { 1.0 } else { down as f32 / (2 * across) as f32 }
    }

    pub fn heights(&self, length: f32) -> f32 {
        length * self.raster.pixels.1 as f32 / self.raster.window[3] / self.unit()
    }

    pub fn pixel(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        let Raster { window: [left, top, width, height], pixels: (columns, rows) } = self.raster;
        [(x - left) / width * columns as f32, (y - top) / height * rows as f32]
    }

    fn index(&self, [x, y]: [f32; 2]) -> Option<usize> {
        let (columns, rows) = self.raster.pixels;
        let inside = x >= 0.0 && y >= 0.0 && (x as usize) < columns && (y as usize) < rows;
        inside.then(|| y as usize * columns + x as usize)
    }

    /// Returns the colour at a position; black if it is not shown.
    pub fn colour(&self, at: [f32; 2]) -> Rgb {
        self.index(self.pixel(at)).map_or((0, 0, 0), |i| self.pixels[i].into())
    }

    fn cover(&mut self, i: usize, share: u8) {
        if self.cover[i] == 0 {
            self.touched.push(i);
        }
        self.cover[i] = self.cover[i].max(share);
    }

    /// Covers the pixels within `radius` of a line between pixels, and those that it passes.
    fn trace(&mut self, ends: [[f32; 2]; 2], radius: f32) {
        let (pixels, aspect, is_fine) = (self.raster.pixels, self.aspect(), self.is_fine);
        trace(ends, radius, pixels, aspect, is_fine, |i, share| self.cover(i, share));
    }

    fn apply(&mut self, ink: Ink) {
        self.apply_with(ink, |ground| ink.rgb.unwrap_or_else(|| contour(contour(ground))));
    }

    /// Applies an ink in a colour that its ground determines.
    fn apply_with(&mut self, ink: Ink, colour: impl Fn(Rgb) -> Rgb) {
        for i in std::mem::take(&mut self.touched) {
            let share = ink.share * f32::from(std::mem::take(&mut self.cover[i])) / 255.0;
            if ink.on_floor && self.grounds[i] == Ground::Wall {
                continue;
            }
            let ground = self.pixels[i].into();
            self.pixels[i] = blend(ground, colour(ground), share).into();
            if !self.is_fine {
                self.marks[i] = ink.mark.unwrap_or(self.marks[i]);
                self.changed.push(i);
            }
        }
    }

    /// Draws lines of a width in characters' heights, at least a pixel, and crossings once.
    pub fn lines(&mut self, lines: impl IntoIterator<Item = [[f32; 2]; 2]>, width: f32, ink: Ink) {
        let radius = 0.5 * (width * self.unit()).max(1.0);
        for ends in lines {
            let ends = ends.map(|at| self.pixel(at));
            self.trace(ends, radius);
        }
        self.apply(ink);
    }

    pub fn line(&mut self, stops: &[[f32; 2]], width: f32, ink: Ink) {
        self.lines(stops.windows(2).map(|ends| [ends[0], ends[1]]), width, ink);
    }

    /// Draws a line from stop to stop, with a shadow in pictures.
    pub fn route(&mut self, stops: &[[f32; 2]], width: f32, ink: Ink) {
        if self.is_fine {
            let shadow = Ink { rgb: Some(SHADOW), share: 0.35 * ink.share, ..ink };
            self.line(stops, width + 2.0 / self.unit(), shadow);
        }
        self.line(stops, width, ink);
    }

    /// Draws a disc, as characters a dot.
    pub fn disc(&mut self, at: [f32; 2], radius: f32, ink: Ink) {
        let radius = if self.is_fine { radius } else { 0.0 };
        self.lines([[at; 2]], 2.0 * radius, ink);
    }

    pub fn agent(&mut self, at: [f32; 2], radius: f32, ink: Ink) {
        if self.is_fine {
            let shadow = Ink { rgb: Some(SHADOW), share: 0.7, ..ink };
            self.disc(at, radius + 1.2 / self.unit(), shadow);
        }
        self.disc(at, radius, ink);
    }

    /// Fills the pixels whose middles lie between these corners.
    pub fn rectangle(&mut self, corners: [[f32; 2]; 2], ink: Ink) {
        let [from, to] = corners.map(|at| self.pixel(at).map(|x| (x + 0.5).max(0.0) as usize));
        let (columns, rows) = self.raster.pixels;
        for row in from[1]..to[1].min(rows) {
            (from[0]..to[0].min(columns)).for_each(|x| self.cover(row * columns + x, u8::MAX));
        }
        self.apply(ink);
    }

    /// Fills a cell, and at least the pixel of its middle.
    pub fn cell(&mut self, cell: Cell, ink: Ink) {
        if let Some(i) = self.index(self.pixel(cell.centre())) {
            self.cover(i, u8::MAX);
        }
        let [x, y] = [cell.x, cell.y].map(|at| at as f32);
        self.rectangle([[x, y], [x + 1.0, y + 1.0]], ink);
    }

    /// Draws a letter on a ground of its own: in pictures on a disc of this radius.
    pub fn letter(&mut self, at: [f32; 2], letter: char, rgb: Rgb, radius: f32) {
        if !self.is_fine {
            return self.signs.push(Sign::Letter(at, letter, rgb));
        }
        let letters = Ink::new(ink(rgb), 0.8, letter);
        self.disc(at, radius + 1.5 / self.unit(), letters);
        self.disc(at, radius, Ink::new(rgb, 1.0, letter));
        let (at, height) = (self.pixel(at), 1.3 * radius * self.unit() / CAPITAL_SHARE);
        self.text(&letter.to_string(), at, height, true, Ink { share: 1.0, ..letters });
    }

    /// Draws a sign on the existing ground, by default in a colour that is readable there.
    pub fn symbol(&mut self, at: [f32; 2], symbol: char, rgb: Option<Rgb>) {
        if !self.is_fine {
            return self.signs.push(Sign::Symbol(at, symbol, rgb));
        }
        let ink = Ink::new(rgb.unwrap_or(ink(self.colour(at))), 1.0, symbol);
        self.text(&symbol.to_string(), self.pixel(at), 0.8 * self.unit(), true, ink);
    }

    /// Draws a mark: in pictures a disc, or `symbol` as a character.
    pub fn mark(&mut self, at: [f32; 2], symbol: char, rgb: Rgb) {
        if self.is_fine {
            return self.agent(at, 0.15, Ink::new(rgb, 1.0, symbol));
        }
        self.symbol(at, symbol, Some(rgb));
    }

    /// Draws contour lines through points in pixels, in colours that are visible on their ground.
    pub fn contours(&mut self, lines: &[Vec<[f32; 2]>], width: f32, theme: &Theme) {
        let radius = 0.5 * (width * self.unit()).max(1.0);
        for points in lines {
            if self.is_fine {
                points.windows(2).for_each(|ends| self.trace([ends[0], ends[1]], radius));
            } else {
                points.iter().for_each(|at| self.trace([*at; 2], radius));
            }
        }
        let ink = Ink { rgb: None, share: 1.0, mark: None, on_floor: true };
        self.apply_with(ink, |ground| theme.contour(ground));
    }

    /// Writes a line of text around a point in pixels, `height` pixels high.
    fn text(&mut self, text: &str, [x, y]: [f32; 2], height: f32, is_bold: bool, ink: Ink) {
        let [width, rows] = text_size(text, is_bold);
        let mut written = vec![0.0; width * rows];
        paint_text(text, is_bold, |TextPixel { column, row, coverage }| {
            written[row * width + column] = f32::from(coverage);
        });
        let at = |column: i32, row: i32| {
            let inside = (0..width as i32).contains(&column) && (0..rows as i32).contains(&row);
            if inside { written[row as usize * width + column as usize] } else { 0.0 }
        };
        let scale = rows as f32 / height;
        let (columns, all) = self.raster.pixels;
        let span = |at: f32, size: usize, count: usize| {
            let reach = 0.5 * size as f32 / scale + 1.0;
            ((at - reach).max(0.0) as usize).min(count)..((at + reach).max(0.0) as usize).min(count)
        };
        for row in span(y, rows, all) {
            for column in span(x, width, columns) {
                let u = scale * (column as f32 + 0.5 - x) + 0.5 * width as f32 - 0.5;
                let v = scale * (row as f32 + 0.5 - y) + 0.5 * rows as f32 - 0.5;
                let (left, top) = (u.floor(), v.floor());
                let (by, below, left, top) = (u - left, v - top, left as i32, top as i32);
                let mix = |row: i32| at(left, row) * (1.0 - by) + at(left + 1, row) * by;
                let share = mix(top) * (1.0 - below) + mix(top + 1) * below;
                if share >= 1.0 {
                    self.cover(row * columns + column, share as u8);
                }
            }
        }
        self.apply(ink);
    }
}

/// Free ground without colours, from near (or good) to far.
pub const SHADES: [char; 4] = [' ', '\u{2591}', '\u{2592}', '\u{2593}'];

pub fn shade(share: f32) -> char {
    SHADES[((share.clamp(0.0, 1.0) * SHADES.len() as f32) as usize).min(SHADES.len() - 1)]
}

/// Minimum average distance between lines, in pixels of the field: as characters, and in pictures.
const CONTOUR_SPACING: f32 = 6.0;
const PICTURE_SPACING: f32 = 3.0;

/// Relative deviation from that distance before the interval changes, so that it does not flip.
const INTERVAL_TOLERANCE: f32 = 0.15;

/// Width of a line in a picture, as a share of a character's height.
const CONTOUR_WIDTH: f32 = 0.07;

/// The distance of neighbouring points of a line in a picture, in pixels.
const POINT_SPACING: f32 = 3.0;

/// Returns the common interval of the lines of fields; `before` if that is nearly right.
pub fn contour_interval(of: &[(&[f32], usize)], is_fine: bool, before: Option<f32>) -> Option<f32> {
    let apart = if is_fine { PICTURE_SPACING } else { CONTOUR_SPACING };
    let with = |spacing: f32| {
        let own =
            |(field, columns): &(&[f32], usize)| draw::contour_interval(field, *columns, spacing);
        of.iter().map(own).reduce(f32::max)
    };
    let spacings = [apart, (1.0 - INTERVAL_TOLERANCE) * apart, (1.0 + INTERVAL_TOLERANCE) * apart];
    let same = before.is_some() && spacings.into_iter().any(|spacing| with(spacing) == before);
    if same { before } else { with(apart) }
}

/// Draws the lines of `field`, which has rows of `columns` values all over the canvas, at the
/// multiples of `interval`.
pub fn draw_contours(
    canvas: &mut Canvas,
    (field, columns): (&[f32], usize),
    interval: f32,
    theme: &Theme,
) {
    let rows = (field.len() / columns).max(1);
    let (across, down) = canvas.raster.pixels;
    let pixel = [across as f32 / columns as f32, down as f32 / rows as f32];
    let middle = |i: usize| [(i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5];
    let is_fine = canvas.is_fine;
    let points = |path: ContourPath| {
        if is_fine {
            smooth(path.points.iter().map(|at| [at[0] * pixel[0], at[1] * pixel[1]]).collect())
        } else {
            path.pixels(columns).into_iter().map(middle).collect()
        }
    };
    let lines: Vec<Vec<[f32; 2]>> =
        contour_paths(field, columns, interval).into_iter().map(points).collect();
    canvas.contours(&lines, CONTOUR_WIDTH, theme);
}

/// Returns a line without its corners, as points that are [`POINT_SPACING`] apart.
fn smooth(mut points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    let between = |a: [f32; 2], b: [f32; 2], share: f32| {
        [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]
    };
    // Chaikin's algorithm cuts corners.
    for _ in 0..2 {
        let (Some(first), Some(last)) = (points.first(), points.last()) else { return points };
        let cut = points
            .windows(2)
            .flat_map(|ends| [0.25, 0.75].map(|share| between(ends[0], ends[1], share)));
        points = [*first].into_iter().chain(cut).chain([*last]).collect();
    }
    let mut even: Vec<[f32; 2]> = points.first().copied().into_iter().collect();
    let mut left = POINT_SPACING;
    for ends in points.windows(2) {
        let length = (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]);
        let mut at = left;
        while at <= length {
            even.push(between(ends[0], ends[1], at / length));
            at += POINT_SPACING;
        }
        left = at - length;
    }
    even.extend(points.last());
    even
}
