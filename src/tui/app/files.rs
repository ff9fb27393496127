//! Maps and checkpoints on disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::tz::TimeZone;

use super::answer_error::AnswerError;
use super::saving::is_worth_saving;
use crate::experiment::runs as saved_runs;
use crate::host::maps::warnings;
use crate::host::outputs::is_same_file;
use crate::host::runs::{self, SAVES};
use crate::tui::action::Action;
use crate::tui::background::Background;
use crate::tui::config::recent_path;
use crate::tui::lists;
use crate::tui::reading::{ListCheckpoints, Read};
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use gdg::files::{has_extension, is_hidden, read_text, write_atomically};
use gdg::map::{Grid, MapFormat, Reading as MapReading, format_for, load_map, load_map_like};
use gdg::pulse::Progress;
use gdg::text::counted;
use gdg::train::describe;

/// Number of recent maps remembered.
const MAX_RECENT_MAPS: usize = 8;

/// The largest text that is read to find out whether it is a map, in bytes.
const MAX_LISTED_BYTES: u64 = 1 << 18;

/// The largest list of recent maps that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Reads `what` on its own thread and shows it: at once, or when it is there.
fn read(
    what: &str,
    read: impl FnOnce(&Progress) -> Read + Send + 'static,
    scene: &Scene,
    screen: &mut Screen,
) {
    match Background::start(format!("reading {what}"), read) {
        Ok(reading) if reading.wait(screen.reading_patience) => show(reading, scene, screen),
        Ok(mut reading) => {
            reading.notice().iter().for_each(|notice| screen.say(notice));
            screen.reading = Some(reading);
        }
        Err(error) => screen.report(&format!("nothing can be read: {error}")),
    }
}

/// Shows what has been read meanwhile, or how long it takes; returns whether the screen changes.
pub fn on_tick(scene: &Scene, screen: &mut Screen) -> bool {
    if let Some(reading) = screen.reading.take_if(|reading| reading.is_finished()) {
        show(reading, scene, screen);
        return true;
    }
    let notice = screen.reading.as_mut().and_then(Background::notice);
    notice.iter().for_each(|notice| screen.say(notice));
    notice.is_some()
}

/// Shows what has been read.
fn show(reading: Background<Read>, scene: &Scene, screen: &mut Screen) {
    match reading.finish() {
        Ok(Read::Checkpoints(found, list)) => screen.open(list(found, &TimeZone::system())),
        Ok(Read::Runs(Ok(found))) => {
            let Some(run) = found.into_iter().next() else { return };
            let name = run.source.display().to_string();
            if run.evaluations.is_empty() {
                return screen.report(&format!("{name} has no curves: it was never evaluated"));
            }
            screen.under = Some(Arc::new(run));
            let key = screen.keymap.key_of(Action::LayUnder);
            screen.notify(&format!("the curves of {name} are drawn behind: {key} removes them"));
        }
        Ok(Read::Runs(Err(problem))) => screen.report(&problem.to_string()),
        Ok(Read::Maps(folder, entries, recent)) => {
            let registry = &screen.latest.registry;
            screen.open(lists::maps(&folder, &entries, recent.as_deref(), registry));
        }
        Ok(Read::Map(path, Ok(map))) => {
            warnings(&map).iter().for_each(|warning| screen.notify(warning));
            offer_map(&Arc::new(map), Some(&path), scene, screen);
        }
        Ok(Read::Map(_, Err(error))) => screen.report(&format!("{error}: {}", error.help)),
        Err(problem) => screen.report(&problem),
    }
}

/// Lists the checkpoints beside `own`, the file of the run, and those in the usual folder, to load
/// one.
pub fn pick_checkpoint(own: &Path, scene: &Scene, screen: &mut Screen) {
    list_checkpoints(own, |_| true, lists::checkpoints, scene, screen);
}

/// Lists those of other runs to lay the curves of one under those of the run, or takes away those
/// that are there.
pub fn pick_under(own: &Path, scene: &Scene, screen: &mut Screen) {
    if let Some(run) = screen.under.take() {
        return screen.notify(&format!("removed the curves of {}", run.source.display()));
    }
    let saved = screen.latest.saved.as_ref().map(|(_, path)| path.clone());
    let is_other = |file: &Path| saved.as_ref().is_none_or(|saved| !is_same_file(saved, file));
    list_checkpoints(own, is_other, lists::runs_to_lay_under, scene, screen);
}

/// Lays the curves of a checkpoint's run under those of the run.
pub fn lay_under(path: PathBuf, scene: &Scene, screen: &mut Screen) {
    let what = path.display().to_string();
    read(&what, move |_| Read::Runs(saved_runs::file(&path)), scene, screen);
}

/// Returns the folders whose checkpoints are listed: that of the run's own file, and the usual one.
fn folders(own: &Path) -> Vec<PathBuf> {
    let usual = PathBuf::from(SAVES);
    let mut folders = vec![own.parent().map_or(usual.clone(), Path::to_owned), usual];
    // It may be the same by another name, such as ./saves.
    folders.dedup_by_key(|folder| folder.canonicalize().ok());
    folders
}

fn list_checkpoints(
    own: &Path,
    is_listed: impl Fn(&Path) -> bool,
    list: ListCheckpoints,
    scene: &Scene,
    screen: &mut Screen,
) {
    let folders = folders(own);
    let mut files: Vec<PathBuf> =
        folders.iter().flat_map(|folder| runs::files_in(folder).unwrap_or_default()).collect();
    let all = files.len();
    files.retain(|file| is_listed(file));
    if files.is_empty() {
        let (key, folder) = (screen.keymap.key_of(Action::Save), folders[0].display());
        return screen.notify(&if all > 0 {
            format!("{folder} has no checkpoints of other runs")
        } else {
            format!("no checkpoints in {folder}: {key} saves one")
        });
    }
    let what = counted(files.len() as u64, "checkpoint");
    let describe_all = move |progress: &Progress| {
        progress.begin(0, 1);
        let described = files.iter().enumerate().map(|(i, path)| {
            progress.set(i, files.len());
            describe(path)
        });
        Read::Checkpoints(described.collect(), list)
    };
    read(&what, describe_all, scene, screen);
}

/// Writes the map to a file.
///
/// # Errors
/// There is no name, or the file cannot be written.
pub fn save_map(name: &str, scene: &mut Scene, screen: &mut Screen) -> Result<(), AnswerError> {
    if name.is_empty() {
        return Err(AnswerError::NoFileName);
    }
    let Some(maze) = scene.maze_mut() else { return Ok(()) };
    let path = Path::new(name);
    let format = format_for(path);
    for (path, bytes) in format.write(&maze.map, path) {
        write_atomically(&path, &bytes)
            .map_err(|error| AnswerError::Unwritable(name.to_owned(), error))?;
    }
    let lost = format.lost(&maze.map, path);
    let without =
        if lost.is_empty() { String::new() } else { format!(" without {}", lost.join(", ")) };
    maze.kept_map = maze.map.clone();
    screen.notify(&format!("wrote {name}{without}"));
    remember_map(path);
    Ok(())
}

/// Returns what a file for the map called `name` would lack, if anything.
pub fn loss(name: &str, scene: &Scene) -> Option<String> {
    let format = format_for(Path::new(name));
    let map = &scene.maze()?.map;
    let lost = format.lost(map, Path::new(name));
    // Plain text, which anybody can edit, has no place for a scale.
    let text = Path::new("NAME.txt");
    let is_kept = MapFormat::by_name(text).is_some_and(|plain| plain.lost(map, text).is_empty());
    let keeps = if is_kept { "NAME.txt" } else { "NAME.png" };
    let loss =
        || format!("the format {} has no {}: {keeps} keeps them", format.name, lost.join(", "));
    (!lost.is_empty()).then(loss)
}

/// Lists the maps in `folder`, or by default recent maps, built-in maps and those in the current
/// folder.
pub fn pick_map(folder: Option<&Path>, scene: &Scene, screen: &mut Screen) {
    let here = folder.unwrap_or(Path::new(".")).to_owned();
    let has_recent = folder.is_none();
    let what = format!("the maps in {}", here.display());
    let list = move |_: &Progress| {
        let here = here.canonicalize().unwrap_or(here);
        let files = files_in(&here).into_iter().map(|path| (path.clone(), path.is_dir()));
        let entries = files.filter(is_folder_or_map).collect();
        Read::Maps(here, entries, has_recent.then(recent_maps))
    };
    read(&what, list, scene, screen);
}

/// Reads a map and asks how to switch to it.
pub fn open_map(path: &Path, scene: &Scene, screen: &mut Screen) {
    let (path, now) = (path.to_owned(), scene.maze().map(|maze| maze.map.clone()));
    let load = {
        let path = path.clone();
        move |_: &Progress| {
            let map = match now {
                Some(now) => load_map_like(&path, &now, MapReading::default().threshold),
                None => load_map(&path),
            };
            Read::Map(path, map)
        }
    };
    read(&path.display().to_string(), load, scene, screen);
}

/// Asks the user how to switch to another map.
pub fn offer_map(map: &Arc<Grid>, file: Option<&Path>, scene: &Scene, screen: &mut Screen) {
    let now = scene.maze().map(|maze| &*maze.map);
    // Cells beyond the new map become walls, to keep agents out.
    let fitted = now.and_then(|now| {
        let fitted = map.resized(now.width(), now.height())?;
        let walls: Vec<_> =
            fitted.free_cells().filter(|c| !map.contains(*c)).map(|c| (c, false)).collect();
        fitted.with_cells(walls)
    });
    let unsaved = is_worth_saving(scene, screen);
    screen.open(lists::map_switch_choices(map, file, now, fitted, unsaved));
}

/// Returns the file of a checkpoint given by name or path.
pub fn checkpoint_file(name: &str) -> PathBuf {
    // A dot within a name does not begin an extension.
    let path = Path::new(name);
    let path = if has_extension(path, "safetensors") {
        path.to_owned()
    } else {
        format!("{name}.safetensors").into()
    };
    let plain = path.parent().is_none_or(|folder| folder.as_os_str().is_empty());
    if plain { Path::new(SAVES).join(path) } else { path }
}

/// Returns the files and folders in `folder`, sorted by name; none if it cannot be read.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|f| f.path()).collect();
    files.sort();
    files
}

/// Returns whether to list a file (or folder, if `is_folder`) for opening a map: not a text of
/// another kind.
fn is_folder_or_map((path, is_folder): &(PathBuf, bool)) -> bool {
    let has = |extension| has_extension(path, extension);
    // Any picture is a map.
    let may_be = || MapFormat::by_name(path).is_some() && !has("png");
    let small = || path.metadata().is_ok_and(|file| file.len() <= MAX_LISTED_BYTES);
    !is_hidden(path) && (*is_folder || has("map") || may_be() && small() && load_map(path).is_ok())
}

/// Returns recently opened or written maps that still exist.
fn recent_maps() -> Vec<PathBuf> {
    let text = recent_path().and_then(|file| read_text(&file, MAX_BYTES).ok());
    let recent: Vec<PathBuf> =
        text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default();
    recent.into_iter().filter(|path| path.exists()).collect()
}

/// Puts a map at the front of the recent maps. Failures are ignored: nothing important is lost.
pub fn remember_map(path: &Path) {
    let (Ok(path), Some(file)) = (path.canonicalize(), recent_path()) else { return };
    let mut recent = recent_maps();
    recent.retain(|known| *known != path);
    recent.insert(0, path);
    recent.truncate(MAX_RECENT_MAPS);
    if let Ok(text) = serde_json::to_string(&recent) {
        let _ = write_atomically(&file, text.as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_by_another_name_is_listed_once() {
        let listed = |own: &str| folders(Path::new(own));
        for own in ["saves/x.safetensors", "./saves/x.safetensors", "src/../saves/x.safetensors"] {
            assert_eq!(listed(own).len(), 1, "{own}");
        }
        assert_eq!(listed("src/x.safetensors"), ["src", SAVES].map(PathBuf::from));
    }
}
