//! The kinds of exports to files.

/// A kind of export.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportKind {
    /// The pane with map or arm as a bitmap.
    MapPng,
    /// The pane with map or arm as a vector drawing.
    MapSvg,
    /// The whole screen as a bitmap.
    ScreenPng,
    /// The whole screen as a vector drawing.
    ScreenSvg,
    /// The curves as a vector drawing.
    CurvesSvg,
    /// The curves as a bitmap.
    CurvesPng,
    /// The curves as a vector drawing for papers.
    CurvesPdf,
    /// The curves as a table.
    CurvesCsv,
    /// D at the end of the film as a large bitmap, with a caption.
    Still,
    /// The film of how distance was learned, as an animation.
    Film,
}

impl ExportKind {
    /// All kinds.
    pub const ALL: [Self; 10] = [
        Self::MapPng,
        Self::MapSvg,
        Self::ScreenPng,
        Self::ScreenSvg,
        Self::CurvesSvg,
        Self::CurvesPng,
        Self::CurvesPdf,
        Self::CurvesCsv,
        Self::Still,
        Self::Film,
    ];

    /// Those that show a part of the screen.
    pub const PICTURES: [Self; 4] = [Self::ScreenPng, Self::ScreenSvg, Self::MapPng, Self::MapSvg];

    /// Returns the name shown on the screen, where the scene is called `noun`.
    pub fn name(self, noun: &str) -> String {
        let form = match self {
            Self::MapPng | Self::ScreenPng | Self::CurvesPng => "bitmap",
            Self::CurvesPdf => "PDF",
            Self::MapSvg | Self::ScreenSvg | Self::CurvesSvg => "vector graphic",
            Self::CurvesCsv => "table",
            Self::Still => "large bitmap with caption",
            Self::Film => "animation",
        };
        format!("{} as {form}", self.stem(noun))
    }

    /// Returns the part of the file name that follows world and update.
    pub fn stem(self, noun: &str) -> &str {
        match self {
            Self::MapPng | Self::MapSvg => noun,
            Self::ScreenPng | Self::ScreenSvg => "screen",
            Self::CurvesSvg | Self::CurvesPng | Self::CurvesPdf | Self::CurvesCsv => "curves",
            Self::Still => "distance",
            Self::Film => "film",
        }
    }

    /// Returns the file extension.
    pub fn file_type(self) -> &'static str {
        match self {
            Self::MapPng | Self::ScreenPng | Self::CurvesPng | Self::Still | Self::Film => "png",
            Self::CurvesPdf => "pdf",
            Self::MapSvg | Self::ScreenSvg | Self::CurvesSvg => "svg",
            Self::CurvesCsv => "csv",
        }
    }
}
