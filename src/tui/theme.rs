//! The map's colours: themes, reduced to the colours that the terminal has.

use anstyle::{Ansi256Color, RgbColor};
use anstyle_lossy::palette::VGA;
use anstyle_lossy::{rgb_to_xterm, xterm_to_rgb};
use colorous::Gradient;
use ratatui::style::{Color, Modifier, Style};
use serde::{Deserialize, Serialize};

pub use gdg::draw::{Rgb, blend, contour, lightness};
use gdg::draw::{distance_colour, sample};
use gdg::text::terminal_obeys_escapes;

/// How many colours the terminal shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourDepth {
    /// 24 bits.
    True,
    /// The 256 colours of xterm.
    Indexed,
    /// No colours: `NO_COLOR` is set, or the terminal has none.
    Mono,
}

/// A set of colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ThemeName {
    /// For dark terminals.
    Dark,
    /// For light terminals.
    Light,
    /// Distinguishable with every kind of colour vision.
    ColourBlindSafe,
    /// Letters and signs instead of colours.
    Mono,
}

impl ThemeName {
    /// All themes.
    pub const ALL: [Self; 4] = [Self::Dark, Self::Light, Self::ColourBlindSafe, Self::Mono];

    /// Returns a short description.
    pub fn about(self) -> &'static str {
        match self {
            Self::Dark => "light text on a dark page",
            Self::Light => "dark text on a light page",
            Self::ColourBlindSafe => "distinguishable with every kind of colour vision",
            Self::Mono => "shades and signs instead of colours",
        }
    }

    /// Returns the name used in the configuration and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Light => "light",
            Self::ColourBlindSafe => "colour-blind-safe",
            Self::Mono => "mono",
        }
    }
}

/// How much lighter distances are in the light theme.
const LIGHT_TINT: f32 = 0.3;

/// Colours of distances on terminals with 256 colours.
const INDEXED_DISTANCES: usize = 32;

/// The colours in use.
#[derive(Clone, Copy, Debug)]
pub struct Theme {
    /// The theme's name.
    pub name: ThemeName,
    /// The colours that the terminal shows.
    pub depth: ColourDepth,
    /// Text and page, if the theme does not leave them to the terminal.
    pub page: Option<(Rgb, Rgb)>,
    /// Walls.
    pub wall: Rgb,
    /// Free cells without a known value.
    pub unknown: Rgb,
    /// Exploring agents.
    pub agent: Rgb,
    /// The edge of the known world, and goals there.
    pub frontier: Rgb,
    /// Bridge candidates.
    pub candidate: Rgb,
    /// The planned path and its waypoints.
    pub path: Rgb,
    /// The goal.
    pub goal: Rgb,
    /// The walking agent.
    pub walker: Rgb,
    /// The cursor of editor and inspector.
    pub cursor: Rgb,
    /// Edges: walked successfully, failed, and not walked yet.
    pub edges: [Rgb; 3],
    /// Messages that something went wrong.
    pub failure: Rgb,
    /// Points that a bridge search accepted, and those it rejected.
    pub search: [Rgb; 2],
    /// From far (0) to near (1).
    distance: Gradient,
    /// The same from near to far, for terminals with 256 colours.
    indexed: [Rgb; INDEXED_DISTANCES],
    /// From too short (0) to too long (1).
    error: Gradient,
}

impl ColourDepth {
    /// Detects the terminal's colours from the environment.
    pub fn detect() -> Self {
        let variable = |name: &str| std::env::var(name).unwrap_or_default();
        if !variable("NO_COLOR").is_empty() || !terminal_obeys_escapes() {
            return Self::Mono;
        }
        match variable("COLORTERM").as_str() {
            "truecolor" | "24bit" => Self::True,
            _ => Self::Indexed,
        }
    }
}

impl Theme {
    /// Returns the theme `name` for a terminal of `depth`. Without colours, every theme is
    /// [`ThemeName::Mono`].
    pub fn new(name: ThemeName, depth: ColourDepth) -> Self {
        let name = if depth == ColourDepth::Mono { ThemeName::Mono } else { name };
        let dark = Self {
            name,
            depth: if name == ThemeName::Mono { ColourDepth::Mono } else { depth },
            page: None,
            wall: (58, 58, 66),
            unknown: (24, 24, 28),
            agent: (255, 255, 255),
            frontier: (90, 220, 255),
            candidate: (20, 20, 30),
            path: (255, 90, 60),
            goal: (214, 40, 57),
            walker: (255, 140, 30),
            cursor: (240, 240, 240),
            edges: [(200, 255, 200), (220, 60, 60), (110, 110, 120)],
            failure: (255, 100, 90),
            search: [(255, 80, 200), (150, 90, 140)],
            distance: colorous::VIRIDIS,
            indexed: [(0, 0, 0); INDEXED_DISTANCES],
            error: colorous::SPECTRAL,
        };
        let theme = match name {
            ThemeName::Dark | ThemeName::Mono => dark,
            ThemeName::Light => Self {
                page: Some(((30, 30, 34), (252, 252, 252))),
                wall: (150, 150, 158),
                unknown: (238, 238, 240),
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
        };
        if depth == ColourDepth::Indexed {
            Self { indexed: theme.indexed_distances(), ..theme }
        } else {
            theme
        }
    }

    /// Returns the nearest of a terminal's 256 colours for distances from near to far, none lighter
    /// than the one before: by nearness alone, a lighter grey would follow dark blue. Greys are
    /// reserved for walls.
    fn indexed_distances(&self) -> [Rgb; INDEXED_DISTANCES] {
        let mut lightest = f32::INFINITY;
        std::array::from_fn(|i| {
            let (r, g, b) = self.smooth_distance_colour(i as f32 / (INDEXED_DISTANCES - 1) as f32);
            let off = |colour: &Rgb| {
                let square = |a: u8, b: u8| (i32::from(a) - i32::from(b)).pow(2);
                2 * square(colour.0, r) + 4 * square(colour.1, g) + 3 * square(colour.2, b)
            };
            // The first 16 depend on the terminal's own palette.
            let is_grey = |(r, g, b): &Rgb| r == g && g == b;
            let colours = (16..=255)
                .map(rgb_of_indexed)
                .filter(|colour| !is_grey(colour) && lightness(*colour) <= lightest);
            let nearest = colours.min_by_key(off).unwrap_or((r, g, b));
            lightest = lightness(nearest);
            nearest
        })
    }

    /// Returns the nearest colour that the terminal has.
    pub fn colour(&self, (r, g, b): Rgb) -> Color {
        match self.depth {
            ColourDepth::True => Color::Rgb(r, g, b),
            ColourDepth::Indexed => Color::Indexed(rgb_to_xterm(RgbColor(r, g, b)).0),
            ColourDepth::Mono => Color::Reset,
        }
    }

    /// Returns the style of a message that something went wrong.
    pub fn failure(&self) -> Style {
        match self.depth {
            ColourDepth::Mono => Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED),
            _ => Style::new().fg(self.colour(self.failure)).add_modifier(Modifier::BOLD),
        }
    }

    /// Returns the colour of a distance, given as a share of the farthest shown: near is light, far
    /// is dark.
    pub fn distance_colour(&self, share: f32) -> Rgb {
        if self.depth == ColourDepth::Indexed {
            let last = (INDEXED_DISTANCES - 1) as f32;
            return self.indexed[(share.clamp(0.0, 1.0) * last).round() as usize];
        }
        self.smooth_distance_colour(share)
    }

    fn smooth_distance_colour(&self, share: f32) -> Rgb {
        let rgb = distance_colour(self.distance, share);
        if self.name == ThemeName::Light { blend(rgb, (255, 255, 255), LIGHT_TINT) } else { rgb }
    }

    /// Returns the colour of a relative error from -1 (too short) to 1 (too long).
    pub fn error_colour(&self, error: f32) -> Rgb {
        sample(self.error, 0.5 + 0.5 * error.clamp(-1.0, 1.0))
    }
}

/// Returns black or white, whichever is more readable on `ground`.
pub fn ink(ground: Rgb) -> Rgb {
    if lightness(ground) > 0.5 { (0, 0, 0) } else { (255, 255, 255) }
}

/// Returns the RGB value of one of a terminal's 256 colours.
pub fn rgb_of_indexed(index: u8) -> Rgb {
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
        assert_eq!(Theme::new(ThemeName::Mono, ColourDepth::True).colour((1, 2, 3)), Color::Reset);
    }

    #[test]
    fn near_is_lighter_than_far_in_every_theme() {
        for name in ThemeName::ALL {
            let theme = Theme::new(name, ColourDepth::True);
            let lights: Vec<f32> =
                (0..=10).map(|i| lightness(theme.distance_colour(i as f32 / 10.0))).collect();
            assert!(lights.windows(2).all(|pair| pair[0] > pair[1]), "{}: {lights:?}", name.name());
        }
    }

    #[test]
    fn farther_is_never_lighter_with_256_colours() {
        for name in [ThemeName::Dark, ThemeName::Light, ThemeName::ColourBlindSafe] {
            let theme = Theme::new(name, ColourDepth::Indexed);
            let mut shown: Vec<Color> =
                (0..=100).map(|i| theme.colour(theme.distance_colour(i as f32 / 100.0))).collect();
            let light = |colour: &Color| match colour {
                Color::Indexed(index) => lightness(rgb_of_indexed(*index)),
                _ => panic!("{colour:?} is not one of the 256"),
            };
            assert!(
                shown.windows(2).all(|pair| light(&pair[0]) >= light(&pair[1])),
                "{}: {shown:?}",
                name.name()
            );
            assert!(light(&shown[0]) > light(&shown[100]) + 0.3, "{}: {shown:?}", name.name());
            shown.dedup();
            assert!(shown.len() >= 7, "{}: {shown:?}", name.name());
        }
    }
}
