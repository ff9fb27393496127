//! The lists to pick from.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;
use jiff::tz::TimeZone;

use super::{Choice, Item, Picker};
use crate::env::WORLDS;
use crate::map::{BUILTIN, Grid};
use crate::train::{
    CheckpointError, Description, METHODS, Method, NamedMethod, Preset, SETTINGS, Setting, Settings, list_settings,
};
use crate::tui::action::{Action, Binding, Mode, bindings};
use crate::tui::keymap::Keymap;
use crate::tui::output::ExportKind;
use crate::tui::scene::SceneKind;
use crate::tui::theme::ThemeName;

/// Lists all actions by name.
pub fn actions(keymap: &Keymap, scene: SceneKind) -> Picker {
    let named = |b: &&Binding| {
        scene.offers(b.action) && b.action != Action::Palette && !b.long.is_empty() && !b.long.starts_with("...")
    };
    let item = |b: &Binding| Item::new(scene.wording(b), keymap.display_keys(b).join(" "), Choice::Act(b.action));
    let here = |b: &&Binding| [Mode::Watching, Mode::Editing, Mode::Offered].into_iter().any(|mode| b.is_active(mode));
    Picker::new("find an action", bindings().filter(here).filter(named).map(item).collect())
}

/// Lists the themes.
pub fn themes(now: ThemeName) -> Picker {
    let items = ThemeName::ALL.map(|name| Item::new(name.name(), "", Choice::Theme(name))).to_vec();
    Picker::new("theme", items).selecting(|choice| *choice == Choice::Theme(now))
}

/// Lists the methods.
pub fn methods(now: &Method) -> Picker {
    let item = |named: &NamedMethod| Item::new(named.name, named.about, Choice::Method(named.into()));
    let title = "continue with method (data is kept, networks where they fit)";
    Picker::new(title, METHODS.iter().map(item).collect()).selecting(|choice| *choice == Choice::Method(now.clone()))
}

/// Lists the presets.
pub fn presets(now: Preset) -> Picker {
    let items = Preset::ALL.map(|preset| Item::new(preset.name(), preset.about(), Choice::Preset(preset)));
    let title = "continue with preset (data is kept, networks are reset)";
    Picker::new(title, items.to_vec()).selecting(|choice| *choice == Choice::Preset(now))
}

/// Lists the settings by group: their values, what they do, and what changing them costs.
pub fn settings(settings: &Settings) -> Picker {
    let values = list_settings(settings).into_iter().zip(list_settings(&Settings::default()));
    let items = SETTINGS.iter().zip(values).map(|(setting, ((name, value), (_, default)))| {
        let Setting { group, about, unit, range, effect, former, .. } = setting;
        let former = former.map_or(String::new(), |former| format!("; was {former}"));
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let changed = if value == default { String::new() } else { format!(" (default {default})") };
        let detail = format!("{value}{unit}{changed}  {about}; {range}; {}; {}{former}", effect.about(), group.name());
        Item::new(name.clone(), detail, Choice::Setting(name))
    });
    Picker::new("change a setting", items.collect())
}

/// Lists the kinds of exports.
pub fn exports(scene: SceneKind) -> Picker {
    let items = ExportKind::ALL.map(|kind| Item::new(kind.name(scene), kind.file_type(), Choice::Export(kind)));
    Picker::new("export", items.to_vec())
}

/// Asks whether to save before quitting.
pub fn quit_choices(unsaved_updates: u64, file: &Path, autosaves: &[PathBuf]) -> Picker {
    let autosaved = autosaves.last().map_or(String::new(), |path| format!("; autosaved in {}", path.display()));
    let items = vec![
        Item::new("save and quit", format!("to {}", file.display()), Choice::Quit { save: true }),
        Item::new(
            "quit without saving",
            format!("{unsaved_updates} unsaved updates are lost{autosaved}"),
            Choice::Quit { save: false },
        ),
        Item::new("cancel", "", Choice::Nothing),
    ];
    Picker::new("quit?", items)
}

/// Asks whether to load a checkpoint although training is unsaved.
pub fn load_choices(unsaved_updates: u64, file: PathBuf, save_key: &str) -> Picker {
    let items = vec![
        Item::new("stay", format!("{save_key} saves this run first"), Choice::Nothing),
        Item::new("load it", format!("{unsaved_updates} unsaved updates are lost"), Choice::LoadUnsaved(file)),
    ];
    Picker::new("load a checkpoint although this run is not saved?", items)
}

/// Asks what to do after a failure.
pub fn failure(title: &str, problem: &str, file: &Path, hint: &str) -> Picker {
    let items = vec![
        // A long detail is fine: the selected item is shown in full below the list.
        Item::new("save and quit", format!("to {}; {problem}; {hint}", file.display()), Choice::Quit { save: true }),
        Item::new("stay", "to inspect, save, change a setting or load a checkpoint", Choice::Nothing),
    ];
    Picker::new(title, items)
}

/// Asks how to switch to `map` from map `now`, if the world has one; `fitted` is `map` at the size of `now`.
pub fn map_switch_choices(map: &Arc<Grid>, now: Option<&Grid>, fitted: Option<Grid>) -> Picker {
    let mut items = vec![Item::new(
        "start a new run on it",
        "new networks; unsaved training is lost",
        Choice::StartOn(map.clone()),
    )];
    let size = now.map(|now| (now.width(), now.height()));
    if size == Some((map.width(), map.height())) {
        let same = Choice::ContinueOn(map.clone());
        items.insert(0, Item::new("continue on it", "the same networks learn the new walls", same));
    } else if let (Some((width, height)), Some(fitted)) = (size, fitted) {
        let label = format!("continue on it, cropped or padded to {width} x {height}");
        let fitted = Choice::ContinueOn(Arc::new(fitted));
        items.push(Item::new(label, "the networks expect a map of this size", fitted));
    }
    items.push(Item::new("cancel", "", Choice::Nothing));
    Picker::new(format!("{} ({} x {})", map.name(), map.width(), map.height()), items)
}

/// Asks whether to start a new run in the world called `name`.
pub fn world_switch_choices(name: &'static str) -> Picker {
    let start = Item::new(
        "start a new run in it",
        "new networks, the preset's settings; unsaved training is lost",
        Choice::StartIn(name),
    );
    Picker::new(name, vec![start, Item::new("cancel", "", Choice::Nothing)])
}

/// Lists the maps in `folder`, given its `entries` and whether each is a folder. If `recent` is given, recent and
/// built-in maps and other worlds come first.
pub fn maps(folder: &Path, entries: &[(PathBuf, bool)], recent: Option<&[PathBuf]>) -> Picker {
    let mut items = Vec::new();
    if let Some(recent) = recent {
        let item = |path: &PathBuf| Item::new(path.display().to_string(), "recent", Choice::OpenMap(path.clone()));
        items.extend(recent.iter().map(item));
        items.extend(BUILTIN.iter().map(|(name, _)| Item::new(*name, "built in", Choice::OpenBuiltin(name))));
        let worlds = WORLDS.iter().filter(|kind| kind.create.is_some());
        items.extend(worlds.map(|kind| Item::new(kind.name, "another world", Choice::OpenWorld(kind.name))));
    }
    items.push(Item::new("..", "folder", Choice::Folder(folder.join(".."))));
    for (path, is_folder) in entries {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let is_map = path.extension().is_some_and(|e| e == "map" || e == "txt");
        if *is_folder && !name.starts_with('.') {
            items.push(Item::new(format!("{name}/"), "folder", Choice::Folder(path.clone())));
        } else if is_map {
            items.push(Item::new(name, "map", Choice::OpenMap(path.clone())));
        }
    }
    Picker::new(format!("open a map: {}", folder.display()), items)
}

/// Lists checkpoints, latest first, with dates in `zone`; those that cannot be loaded come last, with the reason.
pub fn checkpoints(mut found: Vec<Result<Description, CheckpointError>>, zone: &TimeZone) -> Picker {
    found.sort_by_key(|d| std::cmp::Reverse(d.as_ref().ok().and_then(|d| d.written)));
    let name = |file: &Path| file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let item = |found: &Result<Description, CheckpointError>| match found {
        Ok(d) if !SceneKind::draws(&d.world) => {
            let why = format!("cannot be drawn: continue it with --no-ui; {}", about(d, zone));
            Item::new(name(&d.file), why, Choice::Nothing)
        }
        Ok(d) => Item::new(name(&d.file), about(d, zone), Choice::Load(d.file.clone())),
        Err(e) => Item::new(name(&e.file), format!("cannot be loaded: {}", e.problem), Choice::Nothing),
    };
    Picker::new("load a checkpoint", found.iter().map(item).collect())
}

/// Describes a checkpoint.
fn about(d: &Description, zone: &TimeZone) -> String {
    let success = d.success.map_or("not evaluated".to_owned(), |s| match (s.planned, s.greedy) {
        (Some(planned), Some(greedy)) => format!("success {planned:.2}/{greedy:.2}"),
        (_, Some(greedy)) => format!("success {greedy:.2}"),
        (_, None) => "no tasks".to_owned(),
    });
    let written = d.written.and_then(|at| Timestamp::try_from(at).ok());
    let date = written.map_or(String::new(), |at| at.to_zoned(zone.clone()).strftime("%F %R").to_string());
    let (method, megabytes) = (d.run.method.name(), d.bytes as f64 / 1e6);
    format!("{date}, {success}, {} updates, {} {method}, {megabytes:.1} MB", d.updates, d.title)
}
