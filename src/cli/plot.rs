//! Options of `gdg-tui plot`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::values::output;
use crate::experiment::plot::{self, Axis, By, COLUMN, Measure, PAGE};
use crate::figure::MILLIMETRE;

const EXAMPLES: &str = "\
Examples:
  gdg-tui suite my.map --seeds 3 --method gdg-bridge --method her --out saves/my
  gdg-tui plot saves/my --out fig.pdf        both methods, and fig.csv behind it
  gdg-tui plot saves/my --y error --x steps --out error.svg --out error.png
  gdg-tui plot saves/my --by map --width page    a chart per method
  gdg-tui plot saves/a.safetensors saves/b.safetensors    two saved runs
  gdg-tui plot run1.jsonl run2.jsonl         records of gdg-tui --no-ui

Every curve is the mean over the seeds, on a band from the lowest to the highest; standard \
error says what to write into the caption. Seeds that were evaluated at different places are \
interpolated. All curves are drawn over the same range.

Exit status: 0 success; 2 bad usage or input.";

/// Options of `gdg-tui plot`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct PlotArgs {
    /// Folders of gdg-tui suite, reproduce or ablate or of checkpoints, checkpoints, and records of
    /// gdg-tui --no-ui
    #[arg(value_name = "FOLDER|CHECKPOINT|JSONL", required = true)]
    pub runs: Vec<PathBuf>,

    /// What curves differ in; what else differs makes charts of its own (repeatable) [default:
    /// methods and settings; maps if these are the same]
    #[arg(long, value_name = "WHAT")]
    pub by: Vec<By>,

    /// What is drawn
    #[arg(long, value_name = "MEASURE", default_value = "success")]
    pub y: Measure,

    /// What it is drawn over
    #[arg(long, value_name = "AXIS", default_value = "updates")]
    pub x: Axis,

    /// Draw each curve to its own end, instead of all to the end of the shortest
    #[arg(long)]
    pub whole: bool,

    /// File that ends in .svg, .png (300 pixels an inch) or .pdf (repeatable); the table of that name
    /// ends in .csv [default: MEASURE.svg in the folder, or RUN.MEASURE.svg beside the file]
    #[arg(long, value_name = "FILE", value_parser = output())]
    pub out: Vec<PathBuf>,

    /// Replace files that exist, even if they are not figures of gdg-tui
    #[arg(long)]
    pub overwrite: bool,

    /// Width: column (84 mm), page (174 mm), or millimetres
    #[arg(long, value_name = "WIDTH", default_value = "column", value_parser = parse_width)]
    pub width: f32,
}

/// Parses a width; returns points.
fn parse_width(text: &str) -> Result<f32, String> {
    let millimetres = match text {
        "column" => return Ok(COLUMN),
        "page" => return Ok(PAGE),
        _ => text.strip_suffix("mm").unwrap_or(text).trim().parse::<f32>(),
    };
    let fitting = millimetres.ok().filter(|width| (40.0..=1000.0).contains(width));
    fitting.map(|width| width * MILLIMETRE).ok_or_else(|| {
        "expected column, page, or a number of millimetres from 40 to 1000".to_owned()
    })
}

impl ValueEnum for By {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Method, Self::Map, Self::Setting]
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(match self {
            Self::Method => "method".into(),
            Self::Map => "map".into(),
            Self::Setting => "setting".into(),
        })
    }
}

impl ValueEnum for Measure {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Success, Self::Greedy, Self::Error, Self::Coverage]
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(self.name().into())
    }
}

impl ValueEnum for Axis {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Updates, Self::Steps, Self::Seconds]
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(self.name().into())
    }
}

impl From<PlotArgs> for plot::Options {
    fn from(args: PlotArgs) -> Self {
        let PlotArgs { runs, by, y, x, whole, out, overwrite, width } = args;
        Self { runs, by, y, x, whole, out, overwrite, width }
    }
}
