//! The colours of ground on terminals with 256 and with 16 colours. The nearest colours would turn
//! walls, dark floor and contour lines into the same grey: these are chosen by contrast.

use anstyle::{Ansi256Color, RgbColor};
use anstyle_lossy::palette::VGA;
use anstyle_lossy::xterm_to_rgb;
use gdg::draw::{Rgb, contour, contrast, lightness};

use super::ThemeName;

/// Minimum contrast between walls, floor and contour lines.
const LEAST_CONTRAST: f32 = 1.6;

/// Number of colours of a field.
const LEVELS: usize = 32;

/// A contour line stands out from this many levels around its own: its neighbours.
const LEVELS_BESIDE: usize = 4;

/// Distances for every kind of colour vision, from near to far: the nearest colours to those of the
/// gradient would be pink, olive and teal.
const COLOUR_BLIND_SAFE: [u8; 9] = [227, 221, 179, 144, 247, 103, 67, 61, 25];

/// The colours of ground.
#[derive(Clone, Copy, Debug)]
pub struct Palette {
    pub wall: Rgb,
    /// Unvisited floor: between the lines of its hatching, and on them.
    pub unvisited: [Rgb; 2],
    /// Distances from near to far.
    distances: [Rgb; LEVELS],
    /// Contour lines on each of them.
    contours: [Rgb; LEVELS],
    /// Whether a line between two colours may need another colour than on either.
    is_coarse: bool,
    /// Relative errors from -1 to 1.
    errors: [Rgb; LEVELS],
}

impl Palette {
    /// Chooses from the 256 colours, as near as possible to a theme's colours of distances from near
    /// (0) to far (1), and of errors from too short (0) to too long (1).
    pub fn of_256(
        theme: ThemeName,
        distance: impl Fn(f32) -> Rgb,
        error: impl Fn(f32) -> Rgb,
    ) -> Self {
        let [wall, between, hatched] = match theme {
            ThemeName::Light => [238, 254, 250],
            _ => [233, 238, 241],
        }
        .map(rgb_of_indexed);
        let mut lightest = f32::INFINITY;
        let of_gradient = levels().map(|share| {
            // Farther is never lighter: after dark blue, the nearest colour is a lighter one.
            let own = nearest_of_256(distance(share), |rgb| {
                is_floor(rgb, wall) && lightness(rgb) <= lightest
            });
            lightest = lightness(own);
            own
        });
        let distances = match theme {
            ThemeName::ColourBlindSafe => spread(&COLOUR_BLIND_SAFE),
            _ => of_gradient,
        };
        let contours = std::array::from_fn(|i| {
            let beside = i.saturating_sub(LEVELS_BESIDE)..(i + LEVELS_BESIDE + 1).min(LEVELS);
            nearest_of_256(contour(distances[i]), |rgb| {
                let mut others = distances[beside.clone()].iter().chain([&wall]);
                others.all(|other| contrast(rgb, *other) >= LEAST_CONTRAST)
            })
        });
        let errors = levels().map(|at| nearest_of_256(error(at), |rgb| is_floor(rgb, wall)));
        Self { wall, unvisited: [between, hatched], distances, contours, is_coarse: false, errors }
    }

    /// Chooses from 16 colours. The Linux console has only the first 8 as backgrounds: neighbours
    /// in a scale are not both among the others.
    pub fn of_16(theme: ThemeName) -> Self {
        const BLACK: u8 = 0;
        let (unvisited, scale, contours): (u8, &[u8], &[u8]) = match theme {
            ThemeName::ColourBlindSafe => (8, &[11, 6, 12], &[8, 8, 15]),
            ThemeName::Light => (7, &[10, 6, 12, 5], &[8, 8, 15, 15]),
            ThemeName::Dark => (8, &[10, 6, 12, 5], &[8, 8, 7, 7]),
        };
        Self {
            wall: rgb_of_indexed(BLACK),
            unvisited: [rgb_of_indexed(unvisited); 2],
            distances: spread(scale),
            contours: spread(contours),
            is_coarse: true,
            errors: spread(&[9, 3, 7, 6, 12]),
        }
    }

    /// The colour of a distance, as a share of the farthest shown.
    pub fn distance(&self, share: f32) -> Rgb {
        at(&self.distances, share)
    }

    /// The colour of a relative error, from 0 (too short) to 1 (too long).
    pub fn error(&self, share: f32) -> Rgb {
        at(&self.errors, share)
    }

    /// Returns the colour of a contour line on the colour of a distance, with these colours
    /// `beside` it: the usual one, unless it can hardly be told from those of the scale.
    pub fn contour(&self, ground: Rgb, beside: &[Rgb]) -> Rgb {
        let level = self.distances.iter().position(|own| *own == ground);
        let own = level.map_or(contour(ground), |level| self.contours[level]);
        let least = |line: Rgb| {
            let beside = beside.iter().filter(|other| self.distances.contains(other));
            let others = beside.chain([&ground, &self.wall]);
            others.map(|other| contrast(line, *other)).fold(f32::INFINITY, f32::min)
        };
        if !self.is_coarse || least(own) >= LEAST_CONTRAST {
            return own;
        }
        let others = (0..16).map(rgb_of_indexed).filter(|other| least(*other) > least(own));
        others.max_by(|a, b| least(*a).total_cmp(&least(*b))).unwrap_or(own)
    }
}

/// Returns levels that share a terminal's colours equally.
fn spread(colours: &[u8]) -> [Rgb; LEVELS] {
    std::array::from_fn(|i| rgb_of_indexed(colours[i * colours.len() / LEVELS]))
}

/// Returns the share of the scale that each level shows.
fn levels() -> [f32; LEVELS] {
    std::array::from_fn(|i| i as f32 / (LEVELS - 1) as f32)
}

fn at(levels: &[Rgb; LEVELS], share: f32) -> Rgb {
    levels[(share.clamp(0.0, 1.0) * (LEVELS - 1) as f32).round() as usize]
}

/// Returns whether visited floor may have this colour: greys are reserved for walls and unvisited
/// floor.
fn is_floor(rgb: Rgb, wall: Rgb) -> bool {
    let is_grey = rgb.0 == rgb.1 && rgb.1 == rgb.2;
    !is_grey && contrast(rgb, wall) >= LEAST_CONTRAST
}

/// Returns the nearest of a terminal's 256 colours that `fits`. The first 16 depend on the
/// terminal's own palette.
fn nearest_of_256(rgb: Rgb, fits: impl Fn(Rgb) -> bool) -> Rgb {
    let off = |own: &Rgb| {
        let square = |a: u8, b: u8| (i32::from(a) - i32::from(b)).pow(2);
        2 * square(own.0, rgb.0) + 4 * square(own.1, rgb.1) + 3 * square(own.2, rgb.2)
    };
    let colours = (16..=255).map(rgb_of_indexed).filter(|own| fits(*own));
    colours.min_by_key(off).unwrap_or(rgb)
}

/// Returns the RGB value of one of a terminal's 256 colours.
pub fn rgb_of_indexed(index: u8) -> Rgb {
    let RgbColor(r, g, b) = xterm_to_rgb(Ansi256Color(index), VGA);
    (r, g, b)
}
