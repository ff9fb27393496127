//! The marker that the map is drawn with: half blocks, quadrants or pixels.

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
}

impl Marker {
    pub const ALL: [Self; 4] = [Self::Auto, Self::Pixels, Self::HalfBlock, Self::Quadrant];

    /// Returns the name used in the configuration and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Pixels => "pixels",
            Self::HalfBlock => "half-block",
            Self::Quadrant => "quadrant",
        }
    }

    /// Returns whether the map is drawn as a picture where the terminal shows pictures.
    pub fn wants_pixels(self) -> bool {
        matches!(self, Self::Auto | Self::Pixels)
    }

    /// Returns the marker to use where a cell has room for `scale` half blocks. Pictures
    /// interpolate between as many values as it has pixels.
    #[must_use]
    pub fn resolved(self, scale: f32) -> Self {
        match self {
            Self::Auto | Self::Pixels if scale >= 0.95 => Self::HalfBlock,
            Self::Auto | Self::Pixels => Self::Quadrant,
            other => other,
        }
    }

    /// Returns the columns and rows of pixels in a character.
    pub fn pixels(self) -> (usize, usize) {
        match self {
            Self::Auto | Self::Pixels | Self::HalfBlock => (1, 2),
            Self::Quadrant => (2, 2),
        }
    }
}
