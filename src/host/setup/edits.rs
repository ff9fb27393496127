//! Scheduled changes of the map.

use std::path::PathBuf;
use std::sync::Arc;

use miette::{Report, miette};

use super::{Request, not_a_maze};
use crate::host::report::from_map_error;
use gdg::env::{Environment, PointMaze};
use gdg::map::{self, Grid, MapError};
use gdg::text::safe_file_name;
use gdg::train::Trainer;

/// A change of the map to another one.
#[derive(Clone, Debug)]
pub struct EditAt {
    /// Number of updates after which to switch.
    pub updates: u64,
    pub file: PathBuf,
}

/// A scheduled change of the world.
pub struct Edit {
    /// Number of updates after which to apply it.
    pub updates: u64,
    pub world: Box<dyn Environment>,
}

/// Loads the maps of `--edit-at`. All are read before the run starts, and the run must reach their
/// updates. Leaves out those that the run had applied before it was saved, right after them.
pub fn load_edits(request: &Request, trainer: &Trainer) -> Result<Vec<Edit>, Report> {
    if request.edits.is_empty() {
        return Ok(Vec::new());
    }
    let maze = PointMaze::downcast_ref(trainer.world()).ok_or_else(|| not_a_maze("--edit-at"))?;
    let (map, begun) = (maze.map(), trainer.counters().updates);
    let load = |edit: &EditAt| {
        let never =
            |why: String| miette!("--edit-at {}:{}: {why}", edit.updates, edit.file.display());
        if edit.updates < begun {
            return Err(never(format!(
                "the run starts at update {begun}: give that or a later one"
            )));
        }
        if let Some(most) = request.limits.updates.filter(|most| edit.updates > *most) {
            return Err(never(format!(
                "the run ends at update {most}: give that or an earlier one"
            )));
        }
        let threshold = request.reading.threshold;
        let new = map::load_map_like(&edit.file, map, threshold).map_err(from_map_error)?;
        if (new.width(), new.height()) != (map.width(), map.height()) {
            let problem = format!("is {} x {} cells", new.width(), new.height());
            let help = format!(
                "give a map of {} x {}, the size of the run's map",
                map.width(),
                map.height()
            );
            return Err(from_map_error(MapError::whole_file(
                &edit.file.to_string_lossy(),
                problem,
                help,
            )));
        }
        let new: Box<dyn Environment> = Box::new(maze.with_map(Arc::new(new)));
        Ok(Edit { updates: edit.updates, world: new })
    };
    let mut edits = request.edits.iter().map(load).collect::<Result<Vec<Edit>, Report>>()?;
    let last = edits
        .iter()
        .rfind(|edit| edit.updates == begun)
        .and_then(|edit| PointMaze::downcast_ref(&*edit.world));
    // Checkpoints contain sanitised names.
    let as_saved = |map: &Grid| map.clone().named(&safe_file_name(map.name()));
    if request.resume.is_some() && last.is_some_and(|edited| as_saved(edited.map()) == **map) {
        edits.retain(|edit| edit.updates != begun);
    }
    Ok(edits)
}
