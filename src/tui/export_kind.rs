//! The kinds of exports to files.

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

    /// Those that show a part of the screen.
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
