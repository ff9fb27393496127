//! `gdg-tui plot`: curves of runs over their seeds, as a figure for a paper and as a table.

mod lines;

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use miette::{IntoDiagnostic, Report, miette};
use serde::Serialize;

use super::folder::Folder;
use super::saved_runs::{self, SavedRun};
use super::spec::EvaluationAt;
use crate::figure::{ChartPage, FigureFormat, MILLIMETRE, MOST_BYTES, Sheet, table_behind};
use crate::process::waiting::Waiting;
use crate::setup::outputs::{prepare_file, refuse_existing, refuse_other_kind};
use gdg::files::{named, read, while_locked};
use gdg::printing::eprint_line;
use gdg::train::Evaluation;
pub use lines::{Grouping, Points, SeedCurves, table};

pub const COLUMN: f32 = 84.0 * MILLIMETRE;
pub const PAGE: f32 = 174.0 * MILLIMETRE;

/// Width of a chart among several side by side, at least.
const PANEL_WIDTH: f32 = 160.0;

const EXAMPLES: &str = "\
Examples:
  gdg-tui suite my.map --seeds 3 --method gdg-bridge --method her --out saves/my
  gdg-tui plot saves/my --out fig.pdf        both methods, and fig.csv behind it
  gdg-tui plot saves/my --y error --x steps --out error.svg --out error.png
  gdg-tui plot saves/my --by map --width page    a chart per method
  gdg-tui plot saves/a.safetensors b.jsonl   saved runs, and records of --no-ui

Every curve is the mean over the seeds, on a band from the lowest to the highest; standard \
error says what to write into the caption.

Exit status: 0 success; 2 bad usage or input.";

#[derive(Clone, Debug, Default, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct PlotOptions {
    /// Folders of gdg-tui suite or reproduce or of checkpoints, checkpoints, and records of
    /// gdg-tui --no-ui
    #[arg(value_name = "FOLDER|CHECKPOINT|JSONL", required = true)]
    pub runs: Vec<PathBuf>,

    /// What curves differ in; what else differs makes charts of its own (repeatable) [default:
    /// methods and settings; maps if these are the same]
    #[arg(long, value_enum, value_name = "WHAT")]
    pub by: Vec<By>,

    /// What is drawn
    #[arg(long, value_enum, value_name = "MEASURE", default_value_t = Measure::Success)]
    pub y: Measure,

    /// What it is drawn over
    #[arg(long, value_enum, value_name = "AXIS", default_value_t = XAxis::Updates)]
    pub x: XAxis,

    /// File that ends in .svg, .png (300 pixels an inch) or .pdf (repeatable); the table of that name
    /// ends in .csv [default: MEASURE.svg in the folder, or RUN-MEASURE.svg beside the file]
    #[arg(long, value_name = "FILE")]
    pub out: Vec<PathBuf>,

    /// Replace files that exist, even if gdg-tui has not made them, or somebody has edited them
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
    let wanted = "expected column, page, or a number of millimetres from 40 to 1000";
    fitting.map(|width| width * MILLIMETRE).ok_or(wanted.to_owned())
}

/// What runs differ in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum By {
    Method,
    Map,
    Setting,
}

/// A result of evaluations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Measure {
    /// Success rate: planned if the method plans, otherwise alone
    #[default]
    #[value(alias = "planned")]
    Success,
    /// Success rate of the actor alone
    #[value(alias = "greedy")]
    Alone,
    /// Mean relative error of D
    Error,
    /// Share of the world explored
    #[value(alias = "coverage")]
    Explored,
}

/// What the horizontal axis counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum XAxis {
    /// Updates
    #[default]
    Updates,
    /// Environment steps
    Steps,
    /// Seconds of training
    Seconds,
}

/// What is drawn along an axis: an option, or chosen by a key.
pub trait Drawable: ValueEnum + PartialEq + Copy {
    /// Returns its name on the command line, and on an axis.
    fn names(self) -> [&'static str; 2];

    fn name(self) -> &'static str {
        self.names()[0]
    }

    fn label(self) -> &'static str {
        self.names()[1]
    }

    #[must_use]
    fn next(self) -> Self {
        let mut all = Self::value_variants().iter().cycle().skip_while(|value| **value != self);
        all.nth(1).copied().unwrap_or(self)
    }
}

impl Drawable for Measure {
    fn names(self) -> [&'static str; 2] {
        match self {
            Self::Success => ["success", "success rate"],
            Self::Alone => ["alone", "success rate, alone"],
            Self::Error => ["error", "error of D"],
            Self::Explored => ["explored", "explored"],
        }
    }
}

impl Drawable for XAxis {
    fn names(self) -> [&'static str; 2] {
        match self {
            Self::Updates => ["updates", "updates"],
            Self::Steps => ["steps", "environment steps"],
            Self::Seconds => ["seconds", "seconds of training"],
        }
    }
}

impl Measure {
    /// Returns the number of its colour where curves have several meanings; of success, if that is planned.
    pub fn colour(self, planned: bool) -> usize {
        if planned { self as usize } else { (self as usize).max(Self::Alone as usize) }
    }

    pub fn of(self, evaluation: &Evaluation) -> Option<f64> {
        let value = match self {
            Self::Success => evaluation.success_rate(),
            Self::Alone => evaluation.alone.success,
            Self::Error => evaluation.error.map(|error| error.mape),
            Self::Explored => evaluation.explored,
        };
        value.filter(|value| value.is_finite())
    }
}

impl XAxis {
    pub fn of(self, at: &EvaluationAt) -> f64 {
        match self {
            Self::Updates => at.updates as f64,
            Self::Steps => at.env_steps as f64,
            Self::Seconds => at.seconds,
        }
    }
}

pub struct DrawnPlot {
    pub sheet: Sheet,
    pub table: Vec<u8>,
    /// What the figure shows, for its caption.
    pub caption: String,
    pub notes: Vec<String>,
}

pub fn draw(runs: &[SavedRun], options: &PlotOptions) -> Result<DrawnPlot, Report> {
    let grouping = Grouping::new(runs, &options.by);
    let mut notes = Vec::new();
    let (lines, label) = lines::lines(runs, &grouping, options, &mut notes)?;
    let ends = lines.iter().flat_map(|line| line.seeds.values()).filter_map(|points| points.last());
    let x = [0.0, ends.map(|point| point.0).fold(0.0, f64::max)];
    let charts = lines::charts(&lines, options, &label, x);
    let table = table(&lines, [options.x.name(), options.y.name()], x)?;
    let columns = (options.width / PANEL_WIDTH).floor().max(1.0) as usize;
    let title = format!("{label} over {}", options.x.label());
    let (title, charts, width) = (&*title, &*charts, options.width);
    let page = ChartPage { title, has_heading: false, charts, width, columns };
    let seeds = || lines.iter().map(|line| line.seeds.len());
    let band = match [seeds().min(), seeds().max()].map(Option::unwrap_or_default) {
        [_, 0 | 1] => "one seed".to_owned(),
        [least, most] => {
            let seeds = if least == most { most.to_string() } else { format!("{least} to {most}") };
            format!("mean of {seeds} seeds, with a band from the lowest to the highest")
        }
    };
    let caption = format!("{title}: {band}");
    Ok(DrawnPlot { sheet: page.draw(), table, caption, notes })
}

/// Reads runs, draws them and writes the files; returns a line for each.
pub fn run(options: &PlotOptions) -> Result<String, Report> {
    let first = options.runs.first().map_or(Path::new(""), PathBuf::as_path);
    let out = match &options.out[..] {
        [] => vec![beside(first, options.y.name())],
        out => out.to_vec(),
    };
    if let Some(path) = out.iter().find(|path| FigureFormat::of(path).is_none()) {
        let help = "give --out a file that ends in .svg, .png or .pdf";
        return Err(miette!(help = help, "{}: not a figure", path.display()));
    }
    let table = out[0].with_extension("csv");
    let reading = Waiting::on("reading the runs");
    let (runs, mut notes) = saved_runs::runs(&options.runs, &reading)?;
    drop(reading);
    let drawing = Waiting::on("drawing the curves");
    let drawn = draw(&runs, options)?;
    refuse_edited(&out, (&table, &drawn.table), options.overwrite)?;
    let lines = write_with_table(&out, (&table, &drawn.table), &drawn.sheet)?;
    drop(drawing);
    notes.extend(drawn.notes);
    notes.iter().for_each(|note| eprint_line(note));
    eprint_line(&drawn.caption);
    Ok(lines)
}

/// Rejects figures that are there but not as this program has made them, and a table that is there
/// with other rows and behind none of these figures.
fn refuse_edited(figures: &[PathBuf], csv: (&Path, &[u8]), overwrite: bool) -> Result<(), Report> {
    for path in figures {
        refuse_existing(path, overwrite || table_behind(path).is_some())?;
    }
    let found = read(csv.0, MOST_BYTES).map_or(0, |table| crc32fast::hash(&table));
    let mut known = figures.iter().filter_map(|figure| table_behind(figure));
    let is_own = known.any(|known| known == found) || found == crc32fast::hash(csv.1);
    refuse_existing(csv.0, overwrite || is_own)?;
    refuse_other_kind(csv.0, "a table of a figure", |start| start.starts_with(b"chart,"))
}

/// Writes figures and the table behind them, and has all take their places if that succeeds; first the
/// old table goes: killed in between, the program would take it for edited. Returns a line for each.
fn write_with_table(
    figures: &[PathBuf],
    (table, rows): (&Path, &[u8]),
    sheet: &Sheet,
) -> Result<String, Report> {
    let mut written = Vec::new();
    for path in figures {
        let format = FigureFormat::of(path).unwrap_or(FigureFormat::Svg);
        written.push(prepare_file(path, &format.encode_with_table(sheet, rows)?)?);
    }
    written.push(prepare_file(table, rows)?);
    if table.exists() {
        std::fs::remove_file(table).into_diagnostic()?;
    }
    written.into_iter().map(|place| place()).collect()
}

/// Writes figures and the table behind them to the folder of an experiment. If somebody has edited one
/// of these, leaves all as they are and says so.
pub fn write_unless_edited(
    folder: &Folder,
    figures: &[String],
    table: (&str, &[u8]),
    sheet: &Sheet,
) -> Result<(), Report> {
    let paths: Vec<PathBuf> = figures.iter().map(|name| folder.path(name)).collect();
    let (csv, rows) = (folder.path(table.0), table.1);
    // Another process may end at the same time, with other results.
    let written = while_locked(&csv, || match refuse_edited(&paths, (&csv, rows), false) {
        Err(problem) => {
            eprint_line(&format!("{problem}, edited: figure and table are left as they are"));
            Ok(())
        }
        Ok(()) => write_with_table(&paths, (&csv, rows), sheet).map(drop),
    });
    written.unwrap_or(Ok(()))
}

fn beside(path: &Path, name: &str) -> PathBuf {
    if path.is_dir() {
        return path.join(name).with_extension("svg");
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    named(folder, path.file_stem().unwrap_or_default(), &format!("-{name}.svg"))
}

pub fn csv_of(head: &[&str], rows: Vec<impl Serialize>) -> Result<Vec<u8>, Report> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(head).into_diagnostic()?;
    rows.into_iter().try_for_each(|row| writer.serialize(row)).into_diagnostic()?;
    writer.into_inner().into_diagnostic()
}
