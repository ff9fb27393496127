//! The styles of text, and the map's colours: themes, reduced to the colours that the terminal has.

use anstyle::{Ansi256Color, RgbColor};
use anstyle_lossy::palette::VGA;
use anstyle_lossy::{rgb_to_xterm, xterm_to_rgb};
use colorous::Gradient;
use ratatui::style::{Color, Modifier, Style};
use serde::{Deserialize, Serialize};

pub use gdg::draw::{Rgb, blend, contour, lightness};
use gdg::draw::{contrast, distance_colour, sample};
use gdg::text::terminal_obeys_escapes;

pub const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);

pub const DIM: Style = Style::new().add_modifier(Modifier::DIM);

pub const REVERSED: Style = Style::new().add_modifier(Modifier::REVERSED);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourDepth {
    True,
    Indexed,
    /// No colours: `NO_COLOR` is set, or the terminal has none, or 16 as the Linux console.
    Mono,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ThemeName {
    Dark,
    Light,
    /// Distinguishable with every kind of colour vision.
    ColourBlindSafe,
}

impl ThemeName {
    pub const ALL: [Self; 3] = [Self::Dark, Self::Light, Self::ColourBlindSafe];

    pub fn about(self) -> &'static str {
        match self {
            Self::Dark => "light text on a dark page",
            Self::Light => "dark text on a light page",
            Self::ColourBlindSafe => "distinguishable with every kind of colour vision",
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Light => "light",
            Self::ColourBlindSafe => "colour-blind-safe",
        }
    }
}

/// Share of white in the colour of the actor that walks alone.
const GHOST_TINT: f32 = 0.6;

/// How much lighter distances are in the light theme.
const LIGHT_TINT: f32 = 0.3;

/// How far floor beyond the known world fades into unknown ground, and its hatching into walls.
const FADE: f32 = 0.7;
const HATCH: f32 = 0.5;

/// How far floor without a path fades into the colour of walls, without and with hatching.
const CUT_OFF_FADES: [f32; 2] = [0.35, 0.75];

/// Names of terminals (`TERM`) with 24-bit colours and with 16, or parts of them: over ssh,
/// `COLORTERM` is usually lost.
const NAMES_OF_TRUE: [&str; 6] = ["-direct", "kitty", "alacritty", "foot", "wezterm", "ghostty"];
const NAMES_OF_16: [&str; 6] = ["linux", "cygwin", "ansi", "vt100", "vt220", "-16color"];

#[derive(Clone, Copy, Debug)]
pub struct Theme {
    pub name: ThemeName,
    pub depth: ColourDepth,
    pub page: Option<(Rgb, Rgb)>,
    pub wall: Rgb,
    /// Free cells without a known value.
    pub unknown: Rgb,
    pub agent: Rgb,
    /// The edge of the known world, and goals there.
    pub frontier: Rgb,
    pub path: Rgb,
    pub goal: Rgb,
    pub walker: Rgb,
    pub cursor: Rgb,
    /// Edges: walked successfully, failed, and not walked yet.
    pub edges: [Rgb; 3],
    pub failure: Rgb,
    /// Points that a bridge search accepted, and those it rejected.
    pub search: [Rgb; 2],
    /// From far (0) to near (1).
    distance: Gradient,
    /// From too short (0) to too long (1).
    error: Gradient,
    /// The colours of ground, if the terminal has not all of them.
    palette: Option<Palette>,
}

impl ColourDepth {
    pub fn detect() -> Self {
        let variable = |name: &str| std::env::var(name).unwrap_or_default();
        if !variable("NO_COLOR").is_empty() || !terminal_obeys_escapes() {
            return Self::Mono;
        }
        Self::of_names(&variable("COLORTERM"), &variable("TERM"))
    }

    fn of_names(colorterm: &str, term: &str) -> Self {
        let is_one_of = |names: &[&str]| names.iter().any(|name| term.contains(name));
        match colorterm {
            "truecolor" | "24bit" => Self::True,
            _ if is_one_of(&NAMES_OF_TRUE) => Self::True,
            _ if is_one_of(&NAMES_OF_16) => Self::Mono,
            _ => Self::Indexed,
        }
    }
}

impl Theme {
    pub fn new(name: ThemeName, depth: ColourDepth) -> Self {
        let theme = Self { depth, ..Self::in_all_colours(name) };
        match depth {
            ColourDepth::True => theme,
            ColourDepth::Mono => Self { page: None, ..theme },
            ColourDepth::Indexed => {
                let distance = |share| theme.smooth_distance_colour(share);
                let error = |share| sample(theme.error, share);
                let palette = Palette::of_256(name, distance, error);
                let (wall, [unknown, _]) = (palette.wall, palette.unvisited);
                Self { wall, unknown, palette: Some(palette), ..theme }
            }
        }
    }

    /// The same theme in full colour: for pictures, which do not depend on the terminal.
    #[must_use]
    pub fn in_full_colour(&self) -> Self {
        Self::new(self.name, ColourDepth::True)
    }

    fn in_all_colours(name: ThemeName) -> Self {
        let dark = Self {
            name,
            depth: ColourDepth::True,
            page: None,
            wall: (58, 58, 66),
            unknown: (24, 24, 28),
            agent: (255, 255, 255),
            frontier: (90, 220, 255),
            path: (255, 90, 60),
            goal: (214, 40, 57),
            walker: (255, 140, 30),
            cursor: (240, 240, 240),
            edges: [(200, 255, 200), (220, 60, 60), (110, 110, 120)],
            failure: (255, 100, 90),
            search: [(255, 80, 200), (150, 90, 140)],
            distance: colorous::VIRIDIS,
            error: colorous::SPECTRAL,
            palette: None,
        };
        match name {
            ThemeName::Dark => dark,
            ThemeName::Light => Self {
                page: Some(((30, 30, 34), (252, 252, 252))),
                wall: (150, 150, 158),
                unknown: (238, 238, 240),
                agent: (30, 30, 34),
                frontier: (0, 110, 200),
                cursor: (20, 20, 20),
                edges: [(0, 120, 50), (190, 30, 30), (130, 130, 140)],
                failure: (190, 20, 20),
                ..dark
            },
            // Okabe-Ito colours for signs, Cividis for the field.
            ThemeName::ColourBlindSafe => Self {
                frontier: (240, 190, 220),
                path: (213, 94, 0),
                goal: (230, 159, 0),
                walker: (86, 180, 233),
                edges: [(0, 158, 115), (213, 94, 0), (120, 120, 120)],
                search: [(204, 121, 167), (120, 90, 110)],
                distance: colorous::CIVIDIS,
                error: colorous::PURPLE_ORANGE,
                ..dark
            },
        }
    }

    pub fn colour(&self, (r, g, b): Rgb) -> Color {
        match self.depth {
            ColourDepth::True => Color::Rgb(r, g, b),
            ColourDepth::Indexed => Color::Indexed(rgb_to_xterm(RgbColor(r, g, b)).0),
            ColourDepth::Mono => Color::Reset,
        }
    }

    pub fn failure(&self) -> Style {
        match self.depth {
            ColourDepth::Mono => Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED),
            _ => Style::new().fg(self.colour(self.failure)).add_modifier(Modifier::BOLD),
        }
    }

    pub fn distance_colour(&self, share: f32) -> Rgb {
        match &self.palette {
            Some(palette) => at(&palette.distances, share),
            None => self.smooth_distance_colour(share),
        }
    }

    fn smooth_distance_colour(&self, share: f32) -> Rgb {
        let rgb = distance_colour(self.distance, share);
        if self.name == ThemeName::Light { blend(rgb, (255, 255, 255), LIGHT_TINT) } else { rgb }
    }

    pub fn ghost(&self) -> Rgb {
        blend(self.walker, (255, 255, 255), GHOST_TINT)
    }

    /// Returns the colour of a relative error from -1 (too short) to 1 (too long).
    pub fn error_colour(&self, error: f32) -> Rgb {
        let share = 0.5 + 0.5 * error.clamp(-1.0, 1.0);
        self.palette.map_or_else(|| sample(self.error, share), |palette| at(&palette.errors, share))
    }

    pub fn contour(&self, ground: Rgb) -> Rgb {
        self.palette.map_or_else(|| contour(ground), |palette| palette.contour(ground))
    }

    pub fn unvisited(&self, ground: Rgb, is_hatched: bool) -> Rgb {
        if let Some(palette) = &self.palette {
            return palette.unvisited[usize::from(is_hatched)];
        }
        let faded = blend(ground, self.unknown, FADE);
        if is_hatched { blend(faded, self.wall, HATCH) } else { faded }
    }

    pub fn cut_off(&self, is_hatched: bool) -> Rgb {
        let fade = CUT_OFF_FADES[usize::from(is_hatched)];
        self.palette.map_or_else(
            || blend(self.unknown, self.wall, fade),
            |palette| palette.unvisited[usize::from(is_hatched)],
        )
    }
}

/// Returns black or white, whichever is more readable on `ground`.
pub fn ink(ground: Rgb) -> Rgb {
    if lightness(ground) > 0.5 { (0, 0, 0) } else { (255, 255, 255) }
}

/// Minimum contrast between walls, floor and contour lines with 256 colours: the nearest colours
/// would turn them into the same grey.
const LEAST_CONTRAST: f32 = 1.6;

const LEVELS: usize = 32;

/// A contour line stands out from this many levels around its own: its neighbours.
const LEVELS_BESIDE: usize = 4;

/// Distances for every kind of colour vision, from near to far: the nearest colours to those of the
/// gradient would be pink, olive and teal.
const COLOUR_BLIND_SAFE: [u8; 9] = [227, 221, 179, 144, 247, 103, 67, 61, 25];

#[derive(Clone, Copy, Debug)]
pub struct Palette {
    pub wall: Rgb,
    /// Unvisited floor: between the lines of its hatching, and on them.
    pub unvisited: [Rgb; 2],
    /// Distances from near to far.
    distances: [Rgb; LEVELS],
    contours: [Rgb; LEVELS],
    /// Relative errors from -1 to 1.
    errors: [Rgb; LEVELS],
}

impl Palette {
    /// Chooses from the 256 colours, as near as possible to a theme's colours of distances from near
    /// (0) to far (1), and of errors from too short (0) to too long (1).
    fn of_256(theme: ThemeName, distance: impl Fn(f32) -> Rgb, error: impl Fn(f32) -> Rgb) -> Self {
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
            ThemeName::ColourBlindSafe => std::array::from_fn(|i| {
                rgb_of_indexed(COLOUR_BLIND_SAFE[i * COLOUR_BLIND_SAFE.len() / LEVELS])
            }),
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
        Self { wall, unvisited: [between, hatched], distances, contours, errors }
    }

    /// Returns the colour of a contour line on the colour of a distance.
    pub fn contour(&self, ground: Rgb) -> Rgb {
        let level = self.distances.iter().position(|own| *own == ground);
        level.map_or(contour(ground), |level| self.contours[level])
    }
}

fn levels() -> [f32; LEVELS] {
    std::array::from_fn(|i| i as f32 / (LEVELS - 1) as f32)
}

fn at(levels: &[Rgb; LEVELS], share: f32) -> Rgb {
    levels[(share.clamp(0.0, 1.0) * (LEVELS - 1) as f32).round() as usize]
}

/// Returns whether visited floor may have this colour: greys are of walls and unvisited floor.
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

/// Returns the RGB value of a colour; `None` if it depends on the terminal.
pub fn rgb_of(colour: Color) -> Option<Rgb> {
    match colour {
        Color::Rgb(r, g, b) => Some((r, g, b)),
        Color::Indexed(i) => Some(rgb_of_indexed(i)),
        _ => None,
    }
}

/// Returns the RGB value of one of a terminal's 256 colours.
fn rgb_of_indexed(index: u8) -> Rgb {
    let RgbColor(r, g, b) = xterm_to_rgb(Ansi256Color(index), VGA);
    (r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_theme_uses_colours_on_a_terminal_without_them() {
        for name in ThemeName::ALL {
            assert_eq!(Theme::new(name, ColourDepth::Mono).colour((1, 2, 3)), Color::Reset);
        }
    }

    #[test]
    fn near_is_lighter_than_far_in_every_theme() {
        let depths = [ColourDepth::True, ColourDepth::Indexed];
        for (name, depth) in ThemeName::ALL.into_iter().flat_map(|name| depths.map(|d| (name, d))) {
            let theme = Theme::new(name, depth);
            let lights: Vec<f32> =
                (0..=10).map(|i| lightness(theme.distance_colour(i as f32 / 10.0))).collect();
            assert!(lights.windows(2).all(|pair| pair[0] >= pair[1]), "{name:?}: {lights:?}");
            assert!(lights[0] > lights[10] + 0.3, "{}: {lights:?}", name.name());
        }
    }

    #[test]
    fn terminals_are_known_by_their_names() {
        for (colorterm, term, depth) in [
            ("truecolor", "xterm-256color", ColourDepth::True),
            ("", "xterm-256color", ColourDepth::Indexed),
            ("", "screen", ColourDepth::Indexed),
            ("", "xterm-kitty", ColourDepth::True),
            ("", "xterm-direct", ColourDepth::True),
            ("", "linux", ColourDepth::Mono),
            ("", "xterm-16color", ColourDepth::Mono),
        ] {
            assert_eq!(ColourDepth::of_names(colorterm, term), depth, "{colorterm} {term}");
        }
    }
}
