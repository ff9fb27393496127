//! Maps, checkpoints and exports on disk.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::saving::unsaved;
use super::{Cx, Session};
use crate::experiment::saved_runs::{self, RunReader};
use crate::setup::find_maps::warnings;
use crate::setup::saves::files_in;
use crate::tui::action::Action;
use crate::tui::choices::ExportKind;
use crate::tui::drawings;
use crate::tui::lists;
use gdg::files::{has_extension, is_hidden, prepare};
use gdg::job::{Job, Running};
use gdg::map::{
    Grid, MapFormat, Reading as MapReading, format_for, load_map, load_map_like, lost_from,
};

/// The largest text that is read to find out whether it is a map, in bytes.
const MAX_LISTED_BYTES: u64 = 1 << 18;

/// Shows what has been read or written.
pub type ShowResult = Box<dyn FnOnce(&mut Cx) + Send>;

/// Reads `what` on its own thread and shows it: at once, or when it is there.
fn read(cx: &mut Cx, what: &str, read: impl FnOnce(&Job) -> ShowResult + Send + 'static) {
    let mut reading = Running::start("reading", Job::new(format!("reading {what}")), read);
    if reading.wait(cx.reading_patience) {
        return show(cx, reading);
    }
    reading.notice().iter().for_each(|notice| cx.screen.say(notice));
    cx.reading = Some(reading);
}

/// Shows what has been read or written, or how long it takes; returns whether there is any.
pub fn on_tick(cx: &mut Cx) -> bool {
    let both = [&mut cx.reading, &mut cx.writing];
    let done: Vec<Running<ShowResult>> =
        both.into_iter().filter_map(|slot| slot.take_if(|running| running.is_finished())).collect();
    let is_done = !done.is_empty();
    done.into_iter().for_each(|done| show(cx, done));
    let left = [&mut cx.reading, &mut cx.writing].into_iter().flatten();
    let notices: Vec<String> = left.filter_map(Running::notice).collect();
    notices.iter().for_each(|notice| cx.screen.say(notice));
    is_done || !notices.is_empty()
}

fn show(cx: &mut Cx, done: Running<ShowResult>) {
    match done.finish() {
        Ok(show) => show(cx),
        Err(problem) => cx.screen.report(&problem),
    }
}

/// Draws an export now, and writes it on its own thread.
pub fn export(kind: ExportKind, cx: &mut Cx) {
    let Cx { screen, scene, writing, .. } = cx;
    if let Some(writing) = writing {
        return screen.notify(&format!("not yet: still {}", writing.job().what()));
    }
    let name = kind.name(scene.noun());
    match drawings::begin(kind, screen, scene) {
        Ok(write) => {
            let work = move |_: &Job| -> ShowResult {
                let written = write();
                Box::new(move |Cx { screen, .. }| match written {
                    Ok(notice) => screen.notify(&notice),
                    Err(problem) => screen.report(&problem),
                })
            };
            *writing = Some(Running::start("export", Job::new(format!("writing {name}")), work));
        }
        Err(error) => screen.report(&format!("{name} cannot be written: {error}")),
    }
}

/// Lists the checkpoints beside the run's own file, in the present folder and below, to load one.
pub fn pick_checkpoint(session: &mut Session) {
    let own = session.saver.to.path().parent().map(Path::to_owned);
    let key = session.screen.keymap.key_of(Action::Save);
    read(session, "the checkpoints here", move |progress| {
        let mut files = saved_runs::checkpoints_below(Path::new("."));
        files.extend(own.and_then(|folder| files_in(&folder).ok()).unwrap_or_default());
        progress.begin(0, 1);
        let found = RunReader::new(&files).read(|[file, files], _| {
            progress.set(file, files);
            ControlFlow::Continue(())
        });
        Box::new(move |cx| match found.runs.len() {
            0 => cx.screen.notify(&format!("no runs here yet: {key} saves this one")),
            _ => cx.screen.open(lists::checkpoints(found.runs, cx.screen.layout.screen.width)),
        })
    });
}

/// Returns the file for a map that is called `name`.
pub fn map_file(name: &str) -> PathBuf {
    let path = PathBuf::from(name);
    if path.extension().is_none() { path.with_extension("txt") } else { path }
}

/// Writes the map to a file, or returns why it cannot be.
pub fn save_map(cx: &mut Cx, name: &str) -> Result<(), String> {
    if name.is_empty() {
        return Err("enter a file name, e.g. rooms.txt or rooms.map".to_owned());
    }
    let Some(maze) = cx.scene.maze_mut() else { return Ok(()) };
    let path = map_file(name);
    let name = path.display();
    let files = format_for(&path).write(&maze.map, &path);
    // All are written before any is replaced.
    let written: std::io::Result<Vec<_>> =
        files.iter().map(|(path, bytes)| prepare(path, bytes)).collect();
    written
        .and_then(|places| places.into_iter().try_for_each(|place| place()))
        .map_err(|error| format!("{name} cannot be written: {error}"))?;
    maze.kept_map = maze.map.clone();
    cx.screen.notify(&format!("saved the map to {name}"));
    Ok(())
}

/// Returns what a file for the map would lack, or lose of its own, and a file that would not.
pub fn loss(cx: &Cx, path: PathBuf) -> (Option<String>, PathBuf) {
    let Some(maze) = cx.scene.maze() else { return (None, path) };
    let format = format_for(&path);
    let lost = format.lost(&maze.map).join(" or ");
    let there = lost_from(&path, &maze.map).map(|own| format!("the file's {own} would be lost"));
    if lost.is_empty() {
        return (there, path);
    }
    let lost = format!("the format {} has no {lost}", format.name);
    let all = there.into_iter().chain([lost]).reduce(|there, lost| there + "; " + &lost);
    (all, path.with_extension("txt"))
}

/// Lists the maps in `folder`, or by default built-in maps and those in the current folder.
pub fn pick_map(cx: &mut Cx, folder: Option<&Path>) {
    let here = folder.unwrap_or(Path::new(".")).to_owned();
    let is_first = folder.is_none();
    read(cx, &format!("the maps in {}", here.display()), move |_| {
        let here = here.canonicalize().unwrap_or(here);
        let files = std::fs::read_dir(&here).into_iter().flatten().flatten();
        let mut entries: Vec<(PathBuf, bool)> = files
            .map(|file| (file.path(), file.path().is_dir()))
            .filter(is_folder_or_map)
            .collect();
        entries.sort();
        Box::new(move |Cx { screen, .. }| {
            let registry = screen.snapshot.registry.clone();
            screen.open(lists::maps(&here, &entries, is_first.then_some(&*registry)));
        })
    });
}

pub fn open_map(cx: &mut Cx, path: &Path) {
    let (path, now) = (path.to_owned(), cx.scene.maze().map(|maze| maze.map.clone()));
    read(cx, &path.display().to_string(), move |_| {
        let map = match now {
            Some(now) => load_map_like(&path, &now, MapReading::default().threshold),
            None => load_map(&path),
        };
        Box::new(move |cx| match map {
            Ok(map) => {
                warnings(&map).iter().for_each(|warning| cx.screen.notify(warning));
                offer_map(cx, map);
            }
            Err(error) => cx.screen.report(&format!("{error}: {}", error.help)),
        })
    });
}

pub fn offer_map(cx: &mut Cx, map: Grid) {
    let now = cx.scene.maze().map(|maze| &*maze.map);
    // Cells beyond the new map become walls, to keep agents out.
    let fitted = now.and_then(|now| {
        let fitted = map.resized(now.width(), now.height())?;
        let walls: Vec<_> =
            fitted.free_cells().filter(|c| !map.contains(*c)).map(|c| (c, false)).collect();
        fitted.with_cells(walls)
    });
    cx.screen.open(lists::map_switch(&Arc::new(map), now, fitted, unsaved(cx)));
}

/// Returns whether to list a file, or folder, for opening a map: no text of another kind.
fn is_folder_or_map((path, is_folder): &(PathBuf, bool)) -> bool {
    let has = |extension| has_extension(path, extension);
    // Any picture is a map.
    let may_be = || MapFormat::by_name(path).is_some() && !has("png");
    let small = || path.metadata().is_ok_and(|file| file.len() <= MAX_LISTED_BYTES);
    !is_hidden(path) && (*is_folder || has("map") || may_be() && small() && load_map(path).is_ok())
}
