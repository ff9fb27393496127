//! What there is to choose from: panes, overlays, what draws the map, its editor's tools, exports.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::theme::ColourDepth;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pane {
    /// Phase, counters, rates, success.
    #[default]
    Training,
    /// Success, coverage, losses and errors over time.
    Curves,
    Walk,
    Legend,
}

impl Pane {
    /// All panes, in the order of their keys, the most informative first.
    pub const ALL: [Self; 4] = [Self::Training, Self::Curves, Self::Walk, Self::Legend];

    pub fn name(self) -> &'static str {
        match self {
            Self::Training => "train",
            Self::Curves => "curves",
            Self::Walk => "walk",
            Self::Legend => "legend",
        }
    }

    #[must_use]
    pub fn next(self) -> Self {
        Self::ALL[(self as usize + 1) % Self::ALL.len()]
    }
}

/// Something drawn over the map's colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// Contour lines of equal distance.
    Contours,
    /// Unvisited cells, and the edge of the known world.
    Unexplored,
    /// Exploring agents, their trails, and their goals at the frontier.
    Agents,
    Candidates,
    Edges,
    /// The latest search for a bridge point.
    Search,
    /// The path planned by the walking agent.
    Path,
    /// The actor alone, beside the walking agent.
    Ghost,
}

impl Overlay {
    pub const ALL: [Self; 8] = [
        Self::Contours,
        Self::Unexplored,
        Self::Agents,
        Self::Candidates,
        Self::Edges,
        Self::Search,
        Self::Path,
        Self::Ghost,
    ];

    pub fn name(self) -> &'static str {
        match self {
            Self::Contours => "contours",
            Self::Unexplored => "unvisited places",
            Self::Agents => "exploring agents",
            Self::Candidates => "bridge candidates",
            Self::Edges => "bridge edges",
            Self::Search => "bridge search",
            Self::Path => "planned path",
            Self::Ghost => "actor alone",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlays([bool; Overlay::ALL.len()]);

impl Overlays {
    /// Returns the default set: fewer without colours, where overlays would hide each other.
    pub fn by_default(depth: ColourDepth) -> Self {
        let mut all = vec![Overlay::Contours, Overlay::Unexplored, Overlay::Agents, Overlay::Path];
        if depth != ColourDepth::Mono {
            all.push(Overlay::Candidates);
        }
        Self(Overlay::ALL.map(|overlay| all.contains(&overlay)))
    }

    pub fn has(self, overlay: Overlay) -> bool {
        self.0[overlay as usize]
    }

    pub fn toggle(&mut self, overlay: Overlay) -> bool {
        self.0[overlay as usize] = !self.0[overlay as usize];
        self.0[overlay as usize]
    }
}

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
    /// A sign per character, without colours: what shares one with a wall would seem to be in it.
    #[serde(skip)]
    #[value(skip)]
    Sign,
}

impl Marker {
    pub const ALL: [Self; 4] = [Self::Auto, Self::Pixels, Self::HalfBlock, Self::Quadrant];

    /// Returns the name used in the configuration and on the screen.
    pub fn name(self) -> String {
        self.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
    }

    /// Returns the marker to draw with at a colour depth: without colours, signs.
    #[must_use]
    pub fn at(self, depth: ColourDepth) -> Self {
        if depth == ColourDepth::Mono { Self::Sign } else { self }
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
            Self::Sign => (1, 1),
        }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tool {
    #[default]
    Pencil,
    Eraser,
    Line,
    /// Draws walls around a rectangle.
    Rectangle,
    /// Fills an area of floor with wall, or of wall with floor.
    Fill,
    /// Adds, moves or removes a start.
    Start,
    /// Adds, moves or removes a goal.
    Goal,
}

impl Tool {
    pub const ALL: [Self; 7] = [
        Self::Pencil,
        Self::Eraser,
        Self::Line,
        Self::Rectangle,
        Self::Fill,
        Self::Start,
        Self::Goal,
    ];

    /// Returns its name, and what the mouse does with it.
    pub fn about(self) -> (&'static str, &'static str) {
        match self {
            Self::Pencil => ("wall", "drag: walls; right: floor"),
            Self::Eraser => ("floor", "drag: floor"),
            Self::Line => ("line", "drag: a wall; right: floor"),
            Self::Rectangle => ("box", "drag: an outline; right: floor"),
            Self::Fill => ("fill", "click: fill, or clear a wall"),
            Self::Start => ("start", "click: add, remove s; drag: it"),
            Self::Goal => ("goal", "click: add, remove g; drag: it"),
        }
    }

    /// Returns why using the tool has changed nothing; `None` if that is obvious.
    pub fn refusal(self) -> Option<&'static str> {
        match self {
            Self::Fill => Some("not filled: a map needs floor"),
            Self::Start => Some("a start needs floor"),
            Self::Goal => Some("a goal needs floor"),
            Self::Pencil | Self::Eraser | Self::Line | Self::Rectangle => None,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportKind {
    /// The pane with map or arm.
    MapPng,
    MapSvg,
    /// Success, errors and losses.
    CurvesSvg,
    CurvesPdf,
    CurvesCsv,
}

impl ExportKind {
    pub const ALL: [Self; 5] =
        [Self::MapPng, Self::MapSvg, Self::CurvesSvg, Self::CurvesPdf, Self::CurvesCsv];

    pub const PICTURES: [Self; 2] = [Self::MapPng, Self::MapSvg];

    /// Returns the name shown on the screen, where the scene is called `noun`.
    pub fn name(self, noun: &str) -> String {
        format!("{} as {}", self.stem(noun), self.file_type().to_uppercase())
    }

    /// Returns the part of the file name that follows world and update.
    pub fn stem(self, noun: &str) -> &str {
        match self {
            Self::MapPng | Self::MapSvg => noun,
            Self::CurvesSvg | Self::CurvesPdf | Self::CurvesCsv => "curves",
        }
    }

    pub fn file_type(self) -> &'static str {
        match self {
            Self::MapPng => "png",
            Self::MapSvg | Self::CurvesSvg => "svg",
            Self::CurvesPdf => "pdf",
            Self::CurvesCsv => "csv",
        }
    }
}
