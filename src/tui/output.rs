//! What can be exported to files.

/// A kind of export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportKind {
    /// The map pane as a bitmap.
    MapPng,
    /// The map pane as a vector drawing.
    MapSvg,
    /// The whole screen as a bitmap.
    ScreenPng,
    /// The whole screen as a vector drawing.
    ScreenSvg,
    /// The curves as a vector drawing.
    CurvesSvg,
    /// The curves as a table.
    CurvesCsv,
}

impl ExportKind {
    /// All kinds.
    pub const ALL: [Self; 6] =
        [Self::MapPng, Self::MapSvg, Self::ScreenPng, Self::ScreenSvg, Self::CurvesSvg, Self::CurvesCsv];

    /// Returns the name shown on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::MapPng => "map as bitmap",
            Self::MapSvg => "map as vector graphic",
            Self::ScreenPng => "screen as bitmap",
            Self::ScreenSvg => "screen as vector graphic",
            Self::CurvesSvg => "curves as vector graphic",
            Self::CurvesCsv => "curves as table",
        }
    }

    /// Returns the part of the file name that follows map and update.
    pub fn stem(self) -> &'static str {
        match self {
            Self::MapPng | Self::MapSvg => "map",
            Self::ScreenPng | Self::ScreenSvg => "screen",
            Self::CurvesSvg | Self::CurvesCsv => "curves",
        }
    }

    /// Returns the file extension.
    pub fn file_type(self) -> &'static str {
        match self {
            Self::MapPng | Self::ScreenPng => "png",
            Self::MapSvg | Self::ScreenSvg | Self::CurvesSvg => "svg",
            Self::CurvesCsv => "csv",
        }
    }
}
