//! The lists to pick from.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ratatui::text::Line;

use super::dialog::{Choice, Item, Picker};
use crate::experiment::saved_runs::{COLUMNS, RunCells, SavedRun, WRITTEN, name};
use crate::process::logging;
use crate::tui::action::{Action, Binding, ListAction, Mode, SECTIONS, bindings};
use crate::tui::choices::ExportKind;
use crate::tui::keymap::Keymap;
use crate::tui::pane_text::clock;
use crate::tui::render::dialog::MAX_LIST_SIZE;
use crate::tui::render::side::training::MEANINGS as NUMBERS;
use crate::tui::scene::{Scene, legend};
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, ThemeName};
use gdg::bridge::Planner;
use gdg::engine::Snapshot;
use gdg::env::WorldKind;
use gdg::map::{BUILTIN, Grid, RandomMapKind};
use gdg::text::{fitted, grouped, padded, sanitized};
use gdg::train::{
    LogEntry, METHODS, Method, NamedMethod, Preset, Registry, Run, SETTINGS, Setting, USUAL,
    about_setting, list_settings,
};
use gdg::viewer::Field;

pub const EMPTY_MAP: (usize, usize) = (40, 30);

/// Columns of a setting's value in the list; longer ones are shown in full below it.
const VALUE_WIDTH: usize = 12;

/// What the program does besides.
const COMMANDS: [&str; 4] = [
    "gdg-tui tour: a guided tour of the four rooms",
    "gdg-tui compare gdg-bridge gdg trap: two methods side by side",
    "gdg-tui runs: all saved runs, their curves and settings",
    "gdg-tui suite: many maps, methods, settings and seeds",
];

/// What the help says in the editor, of one run or two.
pub const EDITOR: &str = "Draw by mouse, or at the cursor: the agents learn the new map at once. S and G of \
     the map's file are shown as s and g, as S and G are those of the walk. What is drawn is saved with \
     the run, and as a map of its own.";

/// The help: what is seen, what can be done on this screen, with its keys, the fields to show, the
/// settings, and what the numbers mean. Typing searches it, and Enter does what is selected.
pub fn help(screen: &Screen, scene: &Scene) -> Picker {
    if scene.is_editing() {
        return help_in(&[Mode::Editing], screen, scene, EDITOR, std::iter::empty());
    }
    let modes = [Mode::Watching, Mode::Editing, scene.mode(screen)];
    let fields = Field::ALL.into_iter().filter(|field| scene.has_field(*field, screen));
    let settings = setting_items(screen).into_iter().map(|setting| {
        let detail = format!("setting: {}", setting.below[0]);
        let below = setting.below[..3].to_vec();
        // Of a run that is only watched, none can be changed.
        let choice =
            if screen.elsewhere.is_some() { Choice::Nothing } else { setting.choice.clone() };
        Item { detail, below, choice, marked: false, ..setting }.within("settings")
    });
    help_in(&modes, screen, scene, scene.introduction(), fields.map(field_item).chain(settings))
}

pub fn help_in(
    modes: &[Mode],
    screen: &Screen,
    scene: &Scene,
    introduction: &str,
    more: impl Iterator<Item = Item>,
) -> Picker {
    let is_here = |b: &&Binding| {
        let is_refused = screen.elsewhere.is_some() && b.changes_run();
        scene.offers(b.action) && modes.iter().any(|m| b.is_active(*m)) && !is_refused
    };
    // In the editor, what is its own comes first.
    let is_own = |b: &Binding| b.when == Some(Mode::Editing) && scene.is_editing();
    let (first, others): (Vec<_>, Vec<_>) =
        SECTIONS.iter().partition(|section| section.bindings.iter().any(is_own));
    let actions = first.into_iter().chain(others).flat_map(|section| {
        section.bindings.iter().filter(is_here).map(|b| {
            let place = if scene.is_editing() { "" } else { b.place() };
            let label = format!("{}{place}", scene.wording(b));
            action_item(b, label, &screen.keymap).within(section.title)
        })
    });
    let about = |(name, meaning): &(&str, &str)| {
        Item::new(format!("{name}: {meaning}"), "", Choice::Nothing).within("the numbers")
    };
    let numbers = NUMBERS.iter().chain(legend::MEANINGS).map(about);
    let folder = logging::folder().map(|folder| {
        let label = format!("log files: {}", folder.display());
        Item::new(label, "", Choice::Nothing).within("files of the program")
    });
    let command = |text: &&str| Item::new(*text, "", Choice::Nothing).within("on the command line");
    let commands = COMMANDS.iter().map(command);
    let mut text = introduction.to_owned();
    if screen.theme.depth == ColourDepth::Mono {
        text = text.replace("light near, dark far", "the denser, the farther");
        text = text.replace("Colours show", "Shades show");
    }
    Picker::new("help", actions.chain(more).chain(numbers).chain(commands).chain(folder).collect())
        .explaining(text)
}

pub fn help_of_lists(keymap: &Keymap) -> Picker {
    let listed = |when| {
        let is_listed = move |b: &&Binding| b.is_active(Mode::Listing) && b.when == when;
        bindings().filter(is_listed)
    };
    let item = |binding: &Binding| {
        let wording = match binding.action {
            Action::Move(_, 1) => "select the next run",
            Action::Move(..) => "select the run before",
            Action::Close => "show all runs again, or unmark them",
            Action::Help => "this help",
            _ => binding.long,
        };
        action_item(binding, wording, keymap)
    };
    let items = listed(Some(Mode::Listing)).chain(listed(None)).map(item);
    Picker::new("help", items.collect())
}

fn action_item(b: &Binding, label: impl Into<String>, keymap: &Keymap) -> Item {
    let keys = keymap.display_keys(b).join(" ");
    let words = format!("{} {}", b.name, b.words);
    Item { words, ..Item::new(label, keys, Choice::Act(b.action)) }
}

pub fn field_item(field: Field) -> Item {
    Item {
        words: field.words().to_owned(),
        ..Item::new(format!("colours: {}", field.name()), "", Choice::Field(field))
    }
    .within("colours")
}

pub fn sign_item(line: &Line) -> Item {
    let words = "legend signs".to_owned();
    Item { words, ..Item::new(line.to_string(), "", Choice::Nothing) }.within("legend")
}

pub fn themes(now: ThemeName) -> Picker {
    let items = ThemeName::ALL
        .map(|name| Item::new(name.name(), name.about(), Choice::Theme(name)))
        .to_vec();
    Picker::new("theme", items).selecting(|choice| *choice == Choice::Theme(now))
}

/// Lists the methods: those with a name, then all other combinations with a learner of `registry`.
pub fn methods(now: &Method, registry: &Registry) -> Picker {
    let named = |named: &NamedMethod| {
        Item::new(named.name, named.about, Choice::Method(named.into())).within("named methods")
    };
    let learners = registry.learners().iter();
    let all = learners.flat_map(|learner| Planner::ALL.map(|planner| (learner, planner)));
    let others = all.filter_map(|(learner, planner)| {
        let method = Method { learner: learner.name.to_owned(), planner };
        let about =
            format!("learner {}, planner {}: {}", learner.name, planner.name(), planner.about());
        let is_named = METHODS.iter().any(|named| Method::from(named) == method);
        (!is_named).then(|| {
            Item::new(method.name(), about, Choice::Method(method)).within("LEARNER+PLANNER")
        })
    });
    let title = "method (replay is kept, networks where they fit)";
    let items = METHODS.iter().map(named).chain(others).collect();
    Picker::new(title, items).selecting(|choice| *choice == Choice::Method(now.clone()))
}

pub fn presets(now: Preset) -> Picker {
    let items =
        Preset::ALL.map(|preset| Item::new(preset.name(), preset.about(), Choice::Preset(preset)));
    let title = "preset (replay is kept, networks are reset)";
    Picker::new(title, items.to_vec()).selecting(|choice| *choice == Choice::Preset(now))
}

/// Lists all that changes the run: method and preset, and the settings by group, with a mark where they
/// differ from those of its preset.
pub fn settings(screen: &Screen) -> Picker {
    let Run { method, preset, .. } = screen.run();
    let about = METHODS.iter().find(|named| Method::from(*named) == *method);
    let of_run = [
        ("method", method.name(), about.map_or("", |named| named.about), Action::Method),
        ("preset", preset.name().to_owned(), preset.about(), Action::Preset),
    ];
    let of_run = of_run.map(|(name, now, about, action)| {
        Item::new(name, valued(&now, about), Choice::Act(action)).within("run")
    });
    let items = of_run.into_iter().chain(setting_items(screen)).collect();
    let mut list = Picker::new("setting (* differs from its preset)", items);
    list.stays = true;
    list
}

/// Returns a value, in its column, and what it is.
fn valued(now: &str, about: &str) -> String {
    format!("{}  {about}", padded(&fitted(now, VALUE_WIDTH), VALUE_WIDTH))
}

fn setting_items(screen: &Screen) -> Vec<Item> {
    let run = screen.run();
    let values = list_settings(&run.settings)
        .into_iter()
        .zip(list_settings(&screen.settings_of(run.preset)));
    let all = SETTINGS.iter().zip(values);
    let mut items: Vec<Item> = all
        .map(|(setting, ((_, now), (_, default)))| Item {
            marked: screen.changed_settings.contains(setting.name),
            ..setting_item(setting, &now, &default, screen)
        })
        .collect();
    items.sort_by_key(|item| item.group != USUAL);
    items
}

/// Describes a setting: its value, what it does, what it can be and what changing it costs.
fn setting_item(setting: &Setting, now: &str, default: &str, screen: &Screen) -> Item {
    let (Setting { name, about, .. }, Run { method, preset, .. }) = (setting, screen.run());
    let of = (*preset != Preset::Default).then(|| format!(" in the preset {}", preset.name()));
    let of = of.unwrap_or_default();
    let is_idle = screen.snapshot.registry.is_idle(setting, method);
    let idle = if is_idle { format!("unused by {method}: ") } else { String::new() };
    let below = about_setting(setting, &format!("Now {now}; {default} by default{of}"));
    let (detail, choice) = (valued(now, &(idle + about)), Choice::Setting((*name).to_owned()));
    // Their initials find them, too: lr.
    let words = name.split('_').filter_map(|word| word.chars().next()).collect();
    Item { below, words, ..Item::new(*name, detail, choice).within(setting.heading()) }
}

pub fn exports(kinds: &[ExportKind], noun: &str) -> Picker {
    let item = |kind: &ExportKind| Item::new(kind.name(noun), "", Choice::Export(*kind));
    Picker::new("export", kinds.iter().map(item).collect())
}

/// Asks what to do first, so that `y` loses nothing; `d` discards, and `n` changes nothing.
fn ask(title: impl Into<String>, answers: impl IntoIterator<Item = Item>) -> Picker {
    let stay = Item::new("stay", "", Choice::Nothing).on('n');
    Picker::new(title, answers.into_iter().chain([stay]).collect())
}

pub fn quit_choices(lost: String, files: impl Display) -> Picker {
    let to = format!("to {files}");
    let save = Item::new("save and quit", to, Choice::Quit { save: true }).on('y');
    let quit = Item::new("quit without saving", lost, Choice::Quit { save: false }).on('d');
    ask("save before quitting?", [save, quit])
}

/// Asks whether to delete files; nothing is lost unless that is chosen.
pub fn deletion(what: &str, names: String) -> Picker {
    let keep = Item::new("keep", "", Choice::Nothing).on('n');
    let delete = Choice::Act(Action::List(ListAction::Delete));
    let delete = Item::new("delete", "for good", delete).on('d');
    Picker::new(format!("delete {what}?"), vec![keep, delete]).explaining(names)
}

/// Says what is lost without saving: updates, and edits of the map.
pub fn lost(snapshot: &Snapshot, is_map_edited: bool) -> String {
    let also = if is_map_edited { " and map edits" } else { "" };
    let (unsaved, lost) = (snapshot.unsaved_updates(), snapshot.lost_updates());
    let autosave = snapshot.autosaves.last().filter(|_| lost < unsaved);
    match autosave.and_then(|(_, path)| path.file_name()) {
        Some(name) => {
            let name = name.to_string_lossy();
            format!("keeps autosave {name}, loses {} updates after it{also}", grouped(lost))
        }
        None if lost == 0 && snapshot.has_unsaved_evaluation() => {
            format!("an evaluation{also} {} lost", if is_map_edited { "are" } else { "is" })
        }
        None if lost == 0 => format!("unsaved steps or settings{also} are lost"),
        None => format!("{} unsaved updates{also} are lost", grouped(lost)),
    }
}

/// Asks whether to leave a run, which can be saved first if something would be `lost`, to `begin` what
/// `about` describes.
pub fn leave(
    title: impl Into<String>,
    begin: &str,
    about: &str,
    choice: Choice,
    lost: Option<String>,
) -> Picker {
    let Some(lost) = lost else { return ask(title, [Item::new(begin, about, choice).on('y')]) };
    let first = Choice::SaveFirst(Box::new(choice.clone()));
    let save = Item::new(format!("save, then {begin}"), about, first).on('y');
    ask(title, [save, Item::new(format!("{begin}, unsaved"), lost, choice).on('d')])
}

/// Asks whether to write what would replace the files `there`, or lose something, unlike `other`.
pub fn replace(there: Option<String>, lost: Option<String>, own: &str, other: String) -> Picker {
    let label = if there.is_some() { "replace" } else { "save anyway" };
    let what = there.into_iter().chain(lost).collect::<Vec<_>>().join("; ");
    let save = Item::new("save under another name", other.clone(), Choice::Answer(other)).on('y');
    let own = Item::new(label, what, Choice::Answer(own.to_owned())).on('d');
    ask("save under another name?", [save, own])
}

pub fn failure(title: &str, problem: &str, file: &Path, hint: &str) -> Picker {
    let to = format!("to {}, from where it can be resumed", file.display());
    let save = Item::new("save and quit", to, Choice::Quit { save: true }).on('y');
    ask(format!("{title}: save and quit?"), [save]).explaining(format!("{problem}\n{hint}"))
}

/// Asks how to switch to `map` from map `now`, if the world has one; `fitted` is `map` at the size of
/// `now`. Offers to save this run first if something would be `lost`.
pub fn map_switch(
    map: &Arc<Grid>,
    now: Option<&Grid>,
    fitted: Option<Grid>,
    lost: Option<String>,
) -> Picker {
    let title = format!("open {}? ({} x {})", map.name(), map.width(), map.height());
    let start = Choice::StartOn(map.clone());
    let mut picker = leave(title, "start a new run on it", "new networks", start, lost);
    let continued = |label, about, map| Item::new(label, about, Choice::ContinueOn(map)).on('c');
    let size = now.map(|now| (now.width(), now.height()));
    if size == Some((map.width(), map.height())) {
        let about = "the same networks learn the new walls";
        picker.insert_item(0, continued("continue on it".to_owned(), about, map.clone()));
    } else if let (Some((width, height)), Some(fitted)) = (size, fitted) {
        let label = format!("continue on it, cropped or padded to {width} x {height}");
        let about = "the networks expect a map of this size";
        picker.insert_item(1, continued(label, about, Arc::new(fitted)));
    }
    picker
}

/// Lists the maps and folders in `folder`: its `entries`, and whether each is a folder. If a `registry` is
/// given, built-in maps and those of its worlds that can be drawn come first.
pub fn maps(folder: &Path, entries: &[(PathBuf, bool)], registry: Option<&Registry>) -> Picker {
    let mut items = Vec::new();
    if let Some(registry) = registry {
        items.extend(
            BUILTIN.iter().map(|(name, _)| Item::new(*name, "built in", Choice::OpenBuiltin(name))),
        );
        items.extend(RandomMapKind::ALL.map(|kind| {
            let name = format!("random {}", kind.name());
            Item::new(name, kind.about(), Choice::OpenRandom(kind))
        }));
        let about = format!("{} x {} cells to draw on", EMPTY_MAP.0, EMPTY_MAP.1);
        items.push(Item::new("empty", about, Choice::OpenEmpty));
        let item =
            |kind: &WorldKind| Item::new(kind.name, kind.about, Choice::OpenWorld(kind.name));
        items.extend(registry.named_worlds().map(item));
    }
    items.push(Item::new("..", "folder", Choice::Folder(folder.join(".."))));
    for (path, is_folder) in entries {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        items.push(match is_folder {
            true => Item::new(format!("{name}/"), "folder", Choice::Folder(path.clone())),
            false => Item::new(name, "map", Choice::OpenMap(path.clone())),
        });
    }
    Picker::new(format!("map ({})", folder.display()), items)
}

/// Lists messages, the latest first, by training time; below, the selected one with its update.
pub fn messages(log: &[LogEntry]) -> Option<Picker> {
    let item = |LogEntry { text, seconds, updates }: &LogEntry| Item {
        below: vec![format!("{text} (update {})", grouped(*updates))],
        ..Item::new(format!("{} {text}", clock(*seconds)), "", Choice::Nothing)
    };
    let items: Vec<Item> = log.iter().rev().map(item).collect();
    (!items.is_empty()).then(|| Picker::new("messages", items))
}

/// Columns of a list of checkpoints besides its rows.
const BESIDE: u16 = 6;

/// Lists checkpoints, the latest first, as lists of runs do, on a screen of this `width`; those that cannot
/// be loaded come last, with the reason.
pub fn checkpoints(mut found: Vec<Arc<SavedRun>>, width: u16) -> Picker {
    found.sort_by(|a, b| COLUMNS[WRITTEN].compare(a, b, false));
    found.sort_by_key(|run| run.is_damaged());
    let cells = RunCells::of(&found);
    // A checkpoint alone does not tell whether a program trains the run.
    let room = width.min(MAX_LIST_SIZE.0).saturating_sub(BESIDE);
    let columns = cells.columns(room.into(), "state");
    let row = |text: &dyn Fn(usize) -> String| {
        let cells = columns.iter().map(|(i, width)| COLUMNS[*i].fitted(&text(*i), *width));
        cells.collect::<Vec<_>>().join(" ")
    };
    let names = row(&|i| COLUMNS[i].name.to_owned());
    let item = |(i, run): (usize, &Arc<SavedRun>)| {
        let item = match &run.problem {
            Some(problem) => {
                Item::new(format!("{}{problem}", name(&run.source)), "", Choice::Nothing)
            }
            None => Item {
                words: run.settings.join(" "),
                below: vec![sanitized(&run.source.to_string_lossy())],
                ..Item::new(row(&|of| cells.0[i][of].clone()), "", Choice::Load(run.source.clone()))
            },
        };
        item.within(format!(" {names}"))
    };
    Picker::new("checkpoint", found.iter().enumerate().map(item).collect())
}
