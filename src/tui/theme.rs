//! The map's colours: themes, reduced to the colours that the terminal has.

mod palette;

use anstyle::RgbColor;
use anstyle_lossy::palette::VGA;
use anstyle_lossy::{rgb_to_ansi, rgb_to_xterm};
use colorous::Gradient;
use ratatui::style::{Color, Modifier, Style};
use serde::{Deserialize, Serialize};

pub use gdg::draw::{Rgb, blend, contour, lightness};
use gdg::draw::{distance_colour, sample};
use gdg::text::terminal_obeys_escapes;
use palette::Palette;
pub use palette::rgb_of_indexed;

/// How many colours the terminal shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourDepth {
    /// 24 bits.
    True,
    /// The 256 colours of xterm.
    Indexed,
    /// 16 colours, as on the Linux console.
    Basic,
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

    /// Returns the name used in the configuration and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dark => "dark",
            Self::Light => "light",
            Self::ColourBlindSafe => "colour-blind-safe",
        }
    }
}

/// How much lighter distances are in the light theme.
const LIGHT_TINT: f32 = 0.3;

/// How far unvisited floor in the known world fades into the colour of unknown ground, floor
/// beyond that world, and its hatching into the colour of walls.
const POCKET_FADE: f32 = 0.35;
const FADE: f32 = 0.7;
const HATCH: f32 = 0.5;

/// How far floor from which no path leads to the goal fades into the colour of walls, between the
/// lines of its hatching and on them.
const CUT_OFF_FADES: [f32; 2] = [0.35, 0.75];

/// How strongly the edge of the known world is tinted.
const EDGE_TINT: f32 = 0.65;

/// Names of terminals (`TERM`) with 24-bit colours and with 16, or parts of them: over ssh,
/// `COLORTERM` is usually lost.
const NAMES_OF_TRUE: [&str; 6] = ["-direct", "kitty", "alacritty", "foot", "wezterm", "ghostty"];
const NAMES_OF_BASIC: [&str; 6] = ["linux", "cygwin", "ansi", "vt100", "vt220", "-16color"];

/// The colours in use.
#[derive(Clone, Copy, Debug)]
pub struct Theme {
    pub name: ThemeName,
    /// The colours that the terminal shows.
    pub depth: ColourDepth,
    /// Text and page, if the theme does not leave them to the terminal.
    pub page: Option<(Rgb, Rgb)>,
    pub wall: Rgb,
    /// Free cells without a known value.
    pub unknown: Rgb,
    /// Exploring agents.
    pub agent: Rgb,
    /// The edge of the known world, and goals there.
    pub frontier: Rgb,
    pub candidate: Rgb,
    /// The planned path and its waypoints.
    pub path: Rgb,
    pub goal: Rgb,
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
    /// From too short (0) to too long (1).
    error: Gradient,
    /// The colours of ground, if the terminal has not all of them.
    palette: Option<Palette>,
}

impl ColourDepth {
    /// Detects the terminal's colours from the environment.
    pub fn detect() -> Self {
        let variable = |name: &str| std::env::var(name).unwrap_or_default();
        if !variable("NO_COLOR").is_empty() || !terminal_obeys_escapes() {
            return Self::Mono;
        }
        Self::of_names(&variable("COLORTERM"), &variable("TERM"))
    }

    /// Returns the colours of a terminal that goes by these names.
    fn of_names(colorterm: &str, term: &str) -> Self {
        let is_one_of = |names: &[&str]| names.iter().any(|name| term.contains(name));
        match colorterm {
            "truecolor" | "24bit" => Self::True,
            _ if is_one_of(&NAMES_OF_TRUE) => Self::True,
            _ if is_one_of(&NAMES_OF_BASIC) => Self::Basic,
            _ => Self::Indexed,
        }
    }
}

impl Theme {
    /// The theme `name` for a terminal of `depth`. Without colours, shades and signs replace those
    /// of every theme.
    pub fn new(name: ThemeName, depth: ColourDepth) -> Self {
        let theme = Self { depth, ..Self::in_all_colours(name) };
        match depth {
            ColourDepth::True => theme,
            ColourDepth::Mono => Self { page: None, ..theme },
            ColourDepth::Indexed => {
                let distance = |share| theme.smooth_distance_colour(share);
                let error = |share| sample(theme.error, share);
                theme.limited_to(&Palette::of_256(name, distance, error))
            }
            ColourDepth::Basic => theme.with_16_signs().limited_to(&Palette::of_16(name)),
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
            candidate: (20, 20, 30),
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

    /// Replaces the colours of ground.
    fn limited_to(self, palette: &Palette) -> Self {
        let [unknown, _] = palette.unvisited;
        Self { wall: palette.wall, unknown, palette: Some(*palette), ..self }
    }

    /// Replaces the colours of signs whose nearest of 16 colours are the same.
    fn with_16_signs(self) -> Self {
        let [red, bright_red, yellow, bright_magenta, cyan, white] =
            [1, 9, 11, 13, 14, 15].map(rgb_of_indexed);
        Self {
            path: bright_red,
            goal: red,
            walker: if self.name == ThemeName::ColourBlindSafe { cyan } else { yellow },
            frontier: if self.name == ThemeName::ColourBlindSafe { bright_magenta } else { cyan },
            edges: [white, red, self.edges[2]],
            search: [bright_magenta, red],
            ..self
        }
    }

    /// Returns the nearest colour that the terminal has.
    pub fn colour(&self, (r, g, b): Rgb) -> Color {
        match self.depth {
            ColourDepth::True => Color::Rgb(r, g, b),
            ColourDepth::Indexed => Color::Indexed(rgb_to_xterm(RgbColor(r, g, b)).0),
            ColourDepth::Basic => Color::Indexed(rgb_to_ansi(RgbColor(r, g, b), VGA) as u8),
            ColourDepth::Mono => Color::Reset,
        }
    }

    /// Returns whether the terminal shows every mixture of colours.
    pub fn has_all_colours(&self) -> bool {
        self.palette.is_none()
    }

    /// Returns whether the terminal shows `a` better in front of `b` than behind it: of 16 colours,
    /// the Linux console has only the first 8 as backgrounds, and dark grey would become black.
    pub fn prefers_in_front(&self, a: Color, b: Color) -> bool {
        const DARK_GREY: u8 = 8;
        match (self.depth, a, b) {
            (ColourDepth::Basic, Color::Indexed(a), Color::Indexed(b)) => {
                a >= DARK_GREY && (b < DARK_GREY || a == DARK_GREY && b != DARK_GREY)
            }
            _ => false,
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
        match &self.palette {
            Some(palette) => palette.distance(share),
            None => self.smooth_distance_colour(share),
        }
    }

    fn smooth_distance_colour(&self, share: f32) -> Rgb {
        let rgb = distance_colour(self.distance, share);
        if self.name == ThemeName::Light { blend(rgb, (255, 255, 255), LIGHT_TINT) } else { rgb }
    }

    /// Returns the colour of a relative error from -1 (too short) to 1 (too long).
    pub fn error_colour(&self, error: f32) -> Rgb {
        let share = 0.5 + 0.5 * error.clamp(-1.0, 1.0);
        self.palette.map_or_else(|| sample(self.error, share), |palette| palette.error(share))
    }

    /// Returns the colour of a contour line on `ground`, with these colours `beside` it.
    pub fn contour(&self, ground: Rgb, beside: &[Rgb]) -> Rgb {
        self.palette.map_or_else(|| contour(ground), |palette| palette.contour(ground, beside))
    }

    /// Returns the colour of unvisited floor beyond the known world whose value has the colour
    /// `ground`, between the lines of its hatching or on them.
    pub fn unvisited(&self, ground: Rgb, is_hatched: bool) -> Rgb {
        if let Some(palette) = &self.palette {
            return palette.unvisited[usize::from(is_hatched)];
        }
        let faded = blend(ground, self.unknown, FADE);
        if is_hatched { blend(faded, self.wall, HATCH) } else { faded }
    }

    /// Returns the colour of unvisited floor within the known world.
    pub fn pocket(&self, ground: Rgb) -> Rgb {
        if self.palette.is_some() { ground } else { blend(ground, self.unknown, POCKET_FADE) }
    }

    /// Returns the colour of floor from which no path leads to the goal, between the lines of its
    /// hatching or on them.
    pub fn cut_off(&self, is_hatched: bool) -> Rgb {
        let fade = CUT_OFF_FADES[usize::from(is_hatched)];
        self.palette.map_or_else(
            || blend(self.unknown, self.wall, fade),
            |palette| palette.unvisited[usize::from(is_hatched)],
        )
    }

    /// Returns the tint of the edge of the known world, and its opacity.
    pub fn edge(&self) -> (Rgb, f32) {
        // Mixtures of 16 colours are any other of them.
        (self.frontier, if self.depth == ColourDepth::Basic { 1.0 } else { EDGE_TINT })
    }
}

/// Returns black or white, whichever is more readable on `ground`.
pub fn ink(ground: Rgb) -> Rgb {
    if lightness(ground) > 0.5 { (0, 0, 0) } else { (255, 255, 255) }
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
            assert!(
                lights.windows(2).all(|pair| pair[0] >= pair[1]),
                "{}: {lights:?}",
                name.name()
            );
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
            ("", "linux", ColourDepth::Basic),
            ("", "xterm-16color", ColourDepth::Basic),
        ] {
            assert_eq!(ColourDepth::of_names(colorterm, term), depth, "{colorterm} {term}");
        }
    }
}
