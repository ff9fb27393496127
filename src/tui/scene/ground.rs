//! The ground of any scene: values as colours, walls, and the edge of the known world.

use std::sync::Arc;

use crate::tui::canvas::{Canvas, Ground, shade};
use crate::tui::characters::{CUT_OFF_MARK, UNVISITED_MARK, WALL_MARK};
use crate::tui::theme::{ColourDepth, Rgb, Theme, blend};
use gdg::viewer::Field;

/// Relative error from which the colour is the strongest.
pub const MAX_SHOWN_ERROR: f32 = 0.5;

const EDGE_TINT: f32 = 0.65;

/// Number of shades from near to far, and the shade of an unknown value.
const COUNT: usize = 1024;
const UNKNOWN: usize = COUNT;

/// Width and spacing of hatching in pictures, as shares of a character's height; its spacing as
/// characters, in pixels with colours and in characters without.
const HATCH_WIDTH: f32 = 0.12;
const HATCH_SPACING: f32 = 0.5;
const COARSE_SPACING: usize = 4;
const MONO_SPACING: usize = 8;

#[derive(Clone, Copy, PartialEq)]
pub enum GroundKind {
    /// Its value, if any.
    Plain,
    Beyond,
    /// No path leads from it to the goal.
    CutOff,
    Outside,
}

#[derive(Clone, Copy)]
pub struct Look {
    pub kind: GroundKind,
    pub wall: f32,
    /// Whether it may be at the edge of the known world.
    pub is_edge: bool,
}

impl Look {
    pub fn plain(wall: f32) -> Self {
        Self { kind: GroundKind::Plain, wall, is_edge: false }
    }
}

pub struct Colours<'a> {
    pub theme: &'a Theme,
    pub field: Field,
    pub farthest: f32,
}

impl Colours<'_> {
    /// Returns the colours of all shades and of unknown values: plain, beyond, and hatched there.
    fn shades(&self) -> [Vec<Rgb>; 3] {
        let theme = self.theme;
        let plain: Vec<Rgb> = (0..COUNT)
            .map(|i| {
                let share = i as f32 / (COUNT - 1) as f32;
                match self.field {
                    Field::Error => theme.error_colour(2.0 * share - 1.0),
                    _ => theme.distance_colour(share),
                }
            })
            .chain([theme.unknown])
            .collect();
        let all = |change: &dyn Fn(Rgb) -> Rgb| plain.iter().map(|rgb| change(*rgb)).collect();
        let [beyond, hatched] =
            [all(&|rgb| theme.unvisited(rgb, false)), all(&|rgb| theme.unvisited(rgb, true))];
        [plain, beyond, hatched]
    }

    /// Returns the shade of a value; NaN if it is unknown.
    fn shade(&self, value: f32) -> f32 {
        let share = match self.field {
            Field::Error => 0.5 + 0.5 * value / MAX_SHOWN_ERROR,
            Field::Visits => 1.0 - (1.0 + value).ln() / (1.0 + self.farthest).ln(),
            _ => value / self.farthest,
        };
        share.clamp(0.0, 1.0) * (COUNT - 1) as f32
    }

    /// Returns the character of a shade without colours: their edges show where distances are equal.
    fn mark(&self, number: usize) -> char {
        let share = match self.field {
            _ if number == UNKNOWN => return ' ',
            Field::Error => (2.0 * number as f32 / (COUNT - 1) as f32 - 1.0).abs(),
            _ => number as f32 / (COUNT - 1) as f32,
        };
        shade(share)
    }
}

/// A pixel's position between two of evenly spaced values.
#[derive(Clone, Copy)]
struct BetweenValues {
    from: usize,
    to: usize,
    share: f32,
}

impl BetweenValues {
    /// Places the middle of pixel `i` of `pixels` among `count` values.
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

    /// Interpolates; an unknown one of the two values is replaced by the other.
    fn between(self, a: f32, b: f32) -> f32 {
        let (a, b) = (if a.is_nan() { b } else { a }, if b.is_nan() { a } else { b });
        a + self.share * (b - a)
    }
}

/// Draws the ground: `field` has rows of so many values, evenly spaced over the canvas, between
/// which pictures show others. `looks` sets the looks of a row of pixels, if they differ from those
/// of the row before; `is_beside` says whether a pixel is beside one beyond the known world.
pub fn draw(
    canvas: &mut Canvas,
    field: Option<(&[f32], usize)>,
    colours: &Colours,
    mut looks: impl FnMut(usize, &mut [Look]),
    is_beside: impl Fn(usize, usize) -> bool,
) {
    let (theme, is_mono) = (colours.theme, colours.theme.depth == ColourDepth::Mono);
    let ((across, down), (columns, rows)) = (canvas.character, canvas.raster.pixels);
    let [spacing, width] = if canvas.is_fine {
        [HATCH_SPACING, HATCH_WIDTH].map(|share| (share * down as f32) as usize)
    } else {
        [COARSE_SPACING, 1]
    };
    let (spacing, width) = (spacing.max(3), width.max(1));
    let is_hatched = |x: usize, y: usize, kind: GroundKind| match kind {
        _ if is_mono => (x / across + MONO_SPACING / 2 * (y / down)).is_multiple_of(MONO_SPACING),
        GroundKind::CutOff => (x + spacing - y % spacing) % spacing < width,
        _ => (x + y) % spacing < width,
    };
    let [plain, beyond, hatched] = colours.shades();
    let (values, value_columns) = field.unwrap_or((&[], 1));
    let shades: Vec<f32> = values.iter().map(|value| colours.shade(*value)).collect();
    let value_rows = shades.len() / value_columns;
    let is_smooth = canvas.is_fine && colours.field != Field::Visits;
    let places: Vec<BetweenValues> =
        (0..columns).map(|x| BetweenValues::new(x, columns, value_columns, is_smooth)).collect();
    let outside = theme.page.map_or((0, 0, 0), |(_, ground)| ground);
    let mut look = vec![Look::plain(0.0); columns];
    let mut between = vec![f32::NAN; value_columns];
    let grounds = Arc::make_mut(&mut canvas.grounds);
    for y in 0..rows {
        looks(y, &mut look);
        if value_rows > 0 {
            let place = BetweenValues::new(y, rows, value_rows, is_smooth);
            let of = |row: usize| &shades[row * value_columns..(row + 1) * value_columns];
            let both = of(place.from).iter().zip(of(place.to));
            between.iter_mut().zip(both).for_each(|(own, (a, b))| *own = place.between(*a, *b));
        }
        for (x, Look { kind, wall, is_edge }) in look.iter().copied().enumerate() {
            let i = y * columns + x;
            let shade = places[x].between(between[places[x].from], between[places[x].to]);
            let shade = if shade.is_nan() { UNKNOWN } else { shade as usize };
            let is_on =
                matches!(kind, GroundKind::Beyond | GroundKind::CutOff) && is_hatched(x, y, kind);
            let mut rgb = match kind {
                GroundKind::Plain => plain[shade],
                GroundKind::Beyond if is_on => hatched[shade],
                GroundKind::Beyond => beyond[shade],
                GroundKind::CutOff => theme.cut_off(is_on),
                GroundKind::Outside => outside,
            };
            if is_edge && !is_mono && is_beside(x, y) {
                rgb = blend(rgb, theme.frontier, EDGE_TINT);
            }
            if wall > 0.0 {
                rgb = blend(rgb, theme.wall, wall);
            }
            grounds[i] = match kind {
                GroundKind::Outside => Ground::Outside,
                _ if wall > 0.0 => Ground::Wall,
                _ => Ground::Floor,
            };
            canvas.pixels[i] = rgb.into();
            if is_mono {
                canvas.marks[i] = match kind {
                    _ if wall > 0.0 => WALL_MARK,
                    GroundKind::Plain => colours.mark(shade),
                    GroundKind::Beyond if is_on => UNVISITED_MARK,
                    GroundKind::CutOff => CUT_OFF_MARK,
                    GroundKind::Beyond | GroundKind::Outside => ' ',
                };
            }
        }
    }
}
