//! What the map is drawn with, as given by options and configuration.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

/// What the map is drawn with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Marker {
    /// Pixels if the terminal shows pictures; else half blocks if a cell has room for one,
    /// quadrants on maps that are scaled down.
    #[default]
    Auto,
    /// The terminal's own pixels, even within tmux and screen, which are not queried otherwise.
    Pixels,
    /// Two square pixels per character, one above the other.
    HalfBlock,
    /// Two by two pixels per character.
    Quadrant,
    /// Two by four dots per character.
    Braille,
}

impl Marker {
    /// All markers.
    pub const ALL: [Self; 5] =
        [Self::Auto, Self::Pixels, Self::HalfBlock, Self::Quadrant, Self::Braille];

    /// Returns the name used in the configuration and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Pixels => "pixels",
            Self::HalfBlock => "half-block",
            Self::Quadrant => "quadrant",
            Self::Braille => "braille",
        }
    }
}
