//! What is read in the background: maps, checkpoints and runs.

use std::path::PathBuf;

use jiff::tz::TimeZone;
use miette::Report;

use super::dialog::Picker;
use crate::experiment::runs::SavedRun;
use gdg::map::{Grid, MapError};
use gdg::train::{CheckpointError, Description};

/// What has been read.
pub enum Read {
    /// A map, from this file.
    Map(PathBuf, Result<Grid, Box<MapError>>),
    /// A folder's files and folders (whether it is one) from which a map may be chosen, and recent
    /// maps, if asked for.
    Maps(PathBuf, Vec<(PathBuf, bool)>, Option<Vec<PathBuf>>),
    /// Checkpoints, and how they are listed.
    Checkpoints(Vec<Result<Description, CheckpointError>>, ListCheckpoints),
    /// The runs in a file.
    Runs(Result<Vec<SavedRun>, Report>),
}

/// Makes a list of checkpoints, with dates in a zone.
pub type ListCheckpoints = fn(Vec<Result<Description, CheckpointError>>, &TimeZone) -> Picker;
