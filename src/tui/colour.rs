//! Colours: as many as the terminal has.

use ratatui::style::Color;

/// How many colours the terminal shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// 24 bits.
    True,
    /// The 256 of xterm.
    Indexed,
    /// None: NO_COLOR, or a terminal that has none.
    Mono,
}

/// Red, green, blue.
pub type Rgb = (u8, u8, u8);

/// Walls.
pub const WALL: Rgb = (58, 58, 66);
/// Agents that explore.
pub const AGENT: Rgb = (255, 255, 255);
/// Bridge candidates.
pub const CANDIDATE: Rgb = (20, 20, 30);
/// The planned path and its waypoints.
pub const PATH: Rgb = (255, 90, 60);
/// The goal.
pub const GOAL: Rgb = (214, 40, 57);
/// The walking agent.
pub const WALKER: Rgb = (255, 140, 30);
/// The editor's cursor.
pub const CURSOR: Rgb = (240, 240, 240);
/// Free cells before anything is known of them.
pub const UNKNOWN: Rgb = (24, 24, 28);

impl Depth {
    /// What the environment says of the terminal.
    pub fn detect() -> Self {
        let variable = |name: &str| std::env::var(name).unwrap_or_default();
        if !variable("NO_COLOR").is_empty() || variable("TERM") == "dumb" {
            return Self::Mono;
        }
        match variable("COLORTERM").as_str() {
            "truecolor" | "24bit" => Self::True,
            _ => Self::Indexed,
        }
    }

    /// The nearest colour that the terminal has.
    pub fn colour(self, (r, g, b): Rgb) -> Color {
        match self {
            Self::True => Color::Rgb(r, g, b),
            Self::Indexed => Color::Indexed(ansi_colours::ansi256_from_rgb((r, g, b))),
            Self::Mono => Color::Reset,
        }
    }
}

/// The colour of a distance as a share of the farthest shown: near is light, far is dark (viridis).
pub fn of_distance(share: f32) -> Rgb {
    // The darkest end is left out: walls and the background are there.
    let at = 0.95 - 0.85 * share.clamp(0.0, 1.0);
    let colour = colorous::VIRIDIS.eval_continuous(f64::from(at));
    (colour.r, colour.g, colour.b)
}

/// The colour of a contour line on that distance: the same, darker where the field is light and lighter where it is
/// dark.
pub fn contour(share: f32) -> Rgb {
    let (r, g, b) = of_distance(share);
    let towards = |from: u8, to: f32| (f32::from(from) + 0.45 * (to - f32::from(from))) as u8;
    let to = if share < 0.6 { 0.0 } else { 255.0 };
    (towards(r, to), towards(g, to), towards(b, to))
}
