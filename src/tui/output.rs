//! What of the screen can be written to files.

/// What can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// The map pane as a picture of pixels.
    MapPng,
    /// The map pane as a drawing.
    MapSvg,
    /// The whole screen as a picture.
    ScreenPng,
    /// The whole screen as a drawing.
    ScreenSvg,
    /// The curves as a drawing.
    CurvesSvg,
    /// The curves as a table of numbers.
    CurvesCsv,
}

impl What {
    /// All of it.
    pub const ALL: [Self; 6] =
        [Self::MapPng, Self::MapSvg, Self::ScreenPng, Self::ScreenSvg, Self::CurvesSvg, Self::CurvesCsv];

    /// What it is called on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::MapPng => "the map as a picture",
            Self::MapSvg => "the map as a drawing",
            Self::ScreenPng => "the screen as a picture",
            Self::ScreenSvg => "the screen as a drawing",
            Self::CurvesSvg => "the curves as a drawing",
            Self::CurvesCsv => "the curves as numbers",
        }
    }

    /// The file's name without map and update.
    pub fn stem(self) -> &'static str {
        match self {
            Self::MapPng | Self::MapSvg => "map",
            Self::ScreenPng | Self::ScreenSvg => "screen",
            Self::CurvesSvg | Self::CurvesCsv => "curves",
        }
    }

    /// The file's extension.
    pub fn file_type(self) -> &'static str {
        match self {
            Self::MapPng | Self::ScreenPng => "png",
            Self::MapSvg | Self::ScreenSvg | Self::CurvesSvg => "svg",
            Self::CurvesCsv => "csv",
        }
    }
}
