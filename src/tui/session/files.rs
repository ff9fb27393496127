//! Maps, checkpoints and exports on disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::JoinHandle;

use jiff::tz::TimeZone;

use super::saving::is_worth_saving;
use super::{Cx, Session};
use crate::experiment::runs as saved_runs;
use crate::host::maps::warnings;
use crate::host::outputs::is_same_file;
use crate::host::runs::{self, SAVES};
use crate::tui::action::Action;
use crate::tui::config::recent_path;
use crate::tui::dialog::Picker;
use crate::tui::export;
use crate::tui::lists::{self, Described};
use crate::tui::output::ExportKind;
use crate::tui::screen::Screen;
use gdg::files::{has_extension, is_hidden, read_text, write_atomically};
use gdg::job::{Job, Running};
use gdg::map::{Grid, MapFormat, Reading as MapReading, format_for, load_map, load_map_like};
use gdg::text::{counted, grouped};
use gdg::train::{Description, describe};

/// Number of recent maps remembered.
const MAX_RECENT_MAPS: usize = 8;

/// The largest text that is read to find out whether it is a map, in bytes.
const MAX_LISTED_BYTES: u64 = 1 << 18;

/// The largest list of recent maps that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Shows what has been read.
pub type Show = Box<dyn FnOnce(&mut Cx) + Send>;

/// Reads `what` on its own thread and shows it: at once, or when it is there.
fn read(cx: &mut Cx, what: &str, read: impl FnOnce(&Job) -> Show + Send + 'static) {
    let mut reading = Running::start("reading", Job::new(format!("reading {what}")), read);
    if reading.wait(cx.reading_patience) {
        return show(cx, reading);
    }
    reading.notice().iter().for_each(|notice| cx.screen.say(notice));
    cx.reading = Some(reading);
}

/// Shows what has been read meanwhile, or how long it takes; returns whether the screen changes.
pub fn on_tick(cx: &mut Cx) -> bool {
    if let Some(reading) = cx.reading.take_if(|reading| reading.is_finished()) {
        show(cx, reading);
        return true;
    }
    let notice = cx.reading.as_mut().and_then(Running::notice);
    notice.iter().for_each(|notice| cx.screen.say(notice));
    notice.is_some()
}

fn show(cx: &mut Cx, reading: Running<Show>) {
    match reading.finish() {
        Ok(show) => show(cx),
        Err(problem) => cx.screen.report(&problem),
    }
}

/// Lists the checkpoints beside the run's own file, and those in the usual folder, to load one.
pub fn pick_checkpoint(session: &mut Session) {
    list_checkpoints(session, |_| true, lists::checkpoints);
}

/// Lists those of other runs to lay the curves of one under those of the run, or takes away those
/// that are there.
pub fn pick_under(session: &mut Session) {
    let screen = &mut session.cx.screen;
    if let Some(run) = screen.under.take() {
        return screen.notify(&format!("removed the curves of {}", run.source.display()));
    }
    let saved = screen.latest.saved.as_ref().map(|(_, path)| path.clone());
    let is_other = |file: &Path| saved.as_ref().is_none_or(|saved| !is_same_file(saved, file));
    list_checkpoints(session, is_other, lists::runs_to_lay_under);
}

/// Lays the curves of a checkpoint's run under those of the run.
pub fn lay_under(cx: &mut Cx, path: PathBuf) {
    read(cx, &path.display().to_string(), move |_| {
        let found = saved_runs::file(&path);
        Box::new(move |Cx { screen, .. }| match found {
            Ok(found) => {
                let Some(run) = found.into_iter().next() else { return };
                let name = run.source.display().to_string();
                if run.evaluations.is_empty() {
                    return screen.report(&format!("{name} has no curves: it was never evaluated"));
                }
                screen.under = Some(Arc::new(run));
                let key = screen.keymap.key_of(Action::LayUnder);
                let text = format!("the curves of {name} are drawn behind: {key} removes them");
                screen.notify(&text);
            }
            Err(problem) => screen.report(&problem.to_string()),
        })
    });
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
    session: &mut Session,
    is_listed: impl Fn(&Path) -> bool,
    list: fn(Vec<Described>, &TimeZone) -> Picker,
) {
    let (folders, screen) = (folders(session.saver.to.path()), &mut session.cx.screen);
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
    read(session, &what, move |progress| {
        progress.begin(0, 1);
        let described = files.iter().enumerate().map(|(i, path)| {
            progress.set(i, files.len());
            describe(path)
        });
        let found: Vec<Described> = described.collect();
        Box::new(move |cx| cx.screen.open(list(found, &TimeZone::system())))
    });
}

/// Writes the map to a file, or returns why it cannot be.
pub fn save_map(cx: &mut Cx, name: &str) -> Result<(), String> {
    if name.is_empty() {
        return Err("enter a file name, e.g. rooms.txt or rooms.map".to_owned());
    }
    let Some(maze) = cx.scene.maze_mut() else { return Ok(()) };
    let path = Path::new(name);
    let format = format_for(path);
    for (path, bytes) in format.write(&maze.map, path) {
        write_atomically(&path, &bytes)
            .map_err(|error| format!("{name} cannot be written: {error}"))?;
    }
    let lost = format.lost(&maze.map);
    let without =
        if lost.is_empty() { String::new() } else { format!(" without {}", lost.join(", ")) };
    maze.kept_map = maze.map.clone();
    cx.screen.notify(&format!("wrote {name}{without}"));
    remember_map(path);
    Ok(())
}

/// Returns what a file for the map called `name` would lack, if anything.
pub fn loss(cx: &Cx, name: &str) -> Option<String> {
    let format = format_for(Path::new(name));
    let lost = format.lost(&cx.scene.maze()?.map).join(" or ");
    (!lost.is_empty())
        .then(|| format!("the format {} has no {lost}: NAME.txt keeps them", format.name))
}

/// Lists the maps in `folder`, or by default recent maps, built-in maps and those in the current
/// folder.
pub fn pick_map(cx: &mut Cx, folder: Option<&Path>) {
    let here = folder.unwrap_or(Path::new(".")).to_owned();
    let has_recent = folder.is_none();
    read(cx, &format!("the maps in {}", here.display()), move |_| {
        let here = here.canonicalize().unwrap_or(here);
        let files = std::fs::read_dir(&here).into_iter().flatten().flatten();
        let mut entries: Vec<(PathBuf, bool)> = files
            .map(|file| (file.path(), file.path().is_dir()))
            .filter(is_folder_or_map)
            .collect();
        entries.sort();
        let recent = has_recent.then(recent_maps);
        Box::new(move |Cx { screen, .. }| {
            let registry = &screen.latest.registry;
            screen.open(lists::maps(&here, &entries, recent.as_deref(), registry));
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
                offer_map(cx, map, Some(&path));
            }
            Err(error) => cx.screen.report(&format!("{error}: {}", error.help)),
        })
    });
}

pub fn offer_map(cx: &mut Cx, map: Grid, file: Option<&Path>) {
    let now = cx.scene.maze().map(|maze| &*maze.map);
    // Cells beyond the new map become walls, to keep agents out.
    let fitted = now.and_then(|now| {
        let fitted = map.resized(now.width(), now.height())?;
        let walls: Vec<_> =
            fitted.free_cells().filter(|c| !map.contains(*c)).map(|c| (c, false)).collect();
        fitted.with_cells(walls)
    });
    let unsaved = is_worth_saving(cx);
    cx.screen.open(lists::map_switch_choices(&Arc::new(map), file, now, fitted, unsaved));
}

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

/// Returns whether to list a file (or folder, if `is_folder`) for opening a map: not a text of
/// another kind.
fn is_folder_or_map((path, is_folder): &(PathBuf, bool)) -> bool {
    let has = |extension| has_extension(path, extension);
    // Any picture is a map.
    let may_be = || MapFormat::by_name(path).is_some() && !has("png");
    let small = || path.metadata().is_ok_and(|file| file.len() <= MAX_LISTED_BYTES);
    !is_hidden(path) && (*is_folder || has("map") || may_be() && small() && load_map(path).is_ok())
}

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

/// The search for a saved run, on its own thread: a folder with many large checkpoints takes a
/// while.
pub type Search = JoinHandle<Option<Description>>;

/// Starts looking for the newest saved run of the world with this title; there is nothing to offer
/// without a thread.
pub fn search(title: String) -> Option<Search> {
    let find = move || runs::newest(Path::new(SAVES), Some(&title));
    std::thread::Builder::new().name("saved runs".to_owned()).spawn(find).ok()
}

/// Offers a saved run in the line over the map, and logs it for later.
pub fn offer(found: Description, screen: &mut Screen) {
    let (updates, seed, file) = (grouped(found.updates), found.run.seed, found.file.display());
    let text = format!("a run of {updates} updates, seed {seed}, is saved in {file}");
    screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
    screen.offer = Some(found);
    screen.show_banner();
}

/// Collects what the search has found, and withdraws an old line over the map; returns whether the
/// screen changes.
pub fn offer_on_tick(search: &mut Option<Search>, screen: &mut Screen) -> bool {
    if let Some(search) = search.take_if(|search| search.is_finished()) {
        // A search that failed has nothing to offer.
        let found = search.join().ok().flatten();
        let shown = found.is_some();
        found.into_iter().for_each(|found| offer(found, screen));
        return shown;
    }
    screen.drop_old_banner()
}

/// The export that is pending, and the one that is being written.
#[derive(Default)]
pub struct Exports {
    pending: Option<ExportKind>,
    /// Returns the notice at the end.
    writing: Option<Running<Result<String, String>>>,
}

impl Exports {
    /// Asks for an export. It is written from the next tick on, without the dialog that asked for
    /// it.
    pub fn request(&mut self, kind: ExportKind) {
        self.pending = Some(kind);
    }

    /// Begins to write what is pending, and says what is being written and what has been.
    pub fn on_tick(&mut self, Cx { screen, scene, .. }: &mut Cx) {
        if let Some(kind) = self.pending.take() {
            if let Some(writing) = &self.writing {
                return screen.notify(&format!("not yet: still {}", writing.job().what()));
            }
            match export::begin(kind, screen, scene) {
                Ok(writing) => self.writing = Some(writing),
                Err(error) => {
                    let name = kind.name(scene.noun());
                    screen.report(&format!("{name} cannot be written: {error}"));
                }
            }
        }
        if let Some(done) = self.writing.take_if(|writing| writing.is_finished()) {
            match done.finish().flatten() {
                Ok(notice) => screen.notify(&notice),
                Err(problem) => screen.report(&problem),
            }
        }
        let notice = self.writing.as_mut().and_then(Running::notice);
        notice.iter().for_each(|notice| screen.say(notice));
    }

    pub fn finish(&mut self) {
        // A second or two; otherwise its temporary file would stay behind.
        self.writing.take().map(Running::finish);
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
