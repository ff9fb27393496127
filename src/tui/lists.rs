//! The lists to pick from.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use jiff::Timestamp;
use jiff::tz::TimeZone;

use super::dialog::{Choice, Item, ListKind, Picker};
use crate::host::runs::resume_command;
use crate::tui::action::{Action, Binding, Mode, When, bindings};
use crate::tui::output::ExportKind;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use crate::tui::theme::ThemeName;
use gdg::bridge::Planner;
use gdg::engine::Snapshot;
use gdg::files::has_extension;
use gdg::map::{BUILTIN, Grid, RandomMapKind};
use gdg::text::{fitted, grouped, padded};
use gdg::train::{
    CheckpointError, Description, METHODS, Method, NamedMethod, Preset, Registry, Run, SETTINGS,
    Setting, list_settings,
};
use gdg::viewer::Field;

/// Columns of a setting's value in the list; longer ones are shown in full below it.
const VALUE_WIDTH: usize = 12;

/// Lists the actions available on this screen by name, then the fields to show, then the settings.
pub fn actions(screen: &Screen, scene: &Scene) -> Picker {
    let here = |b: &&Binding| {
        let active = b.is_active(Mode::Watching) || b.is_active(Mode::Editing);
        active
            || screen.offer.is_some() && b.is_active(Mode::Offered)
            || screen.tour.is_some() && b.is_active(Mode::Touring)
    };
    let named = |b: &&Binding| b.action != Action::Palette && scene.offers(b.action) && here(b);
    let settings = setting_items(screen).into_iter().map(|setting| {
        let detail = format!("setting: {}", setting.below[0]);
        Item { detail, marked: false, ..setting }.within("settings")
    });
    let fields =
        Field::ALL.into_iter().filter(|field| scene.has_field(*field, screen)).map(field_item);
    let actions = bindings().filter(named).map(|b| action_item(b, screen, scene));
    let items = actions.chain(fields).chain(settings).collect();
    let mut picker = Picker::new("find an action", items);
    picker.keeps_groups = true;
    picker
}

/// Lists the actions of comparisons in these modes by name, then the `fields` to show, then the
/// actions that comparisons do not have, to say why.
pub fn actions_of_comparisons(
    screen: &Screen,
    scene: &Scene,
    modes: &[Mode],
    fields: impl Iterator<Item = Field>,
) -> Picker {
    let is_here = |b: &Binding| modes.iter().any(|mode| b.is_active(*mode));
    let named = bindings().filter(|b| b.action != Action::Palette && scene.offers(b.action));
    let (here, others): (Vec<_>, Vec<_>) = named.partition(|b| is_here(b));
    let is_single = |b: &&&Binding| matches!(b.when, When::Always | When::Watching);
    let items = here.into_iter().map(|b| action_item(b, screen, scene));
    let fields = fields.map(field_item);
    let missing = others.iter().filter(is_single).map(|b| {
        Item { detail: String::new(), ..action_item(b, screen, scene) }
            .within("not in a comparison")
    });
    let mut picker =
        Picker::new("find an action", items.chain(fields).chain(missing).collect::<Vec<_>>());
    picker.keeps_groups = true;
    picker
}

fn action_item(b: &Binding, screen: &Screen, scene: &Scene) -> Item {
    let keys = screen.keymap.display_keys(b).join(" ");
    Item {
        // Some of the editor's tools have the names of other actions.
        name: if b.when == When::Editing { "" } else { b.name },
        words: format!("{} {}", b.name, b.words),
        ..Item::new(scene.wording(b), keys, Choice::Act(b.action))
    }
}

fn field_item(field: Field) -> Item {
    Item {
        words: field.words().to_owned(),
        ..Item::new(format!("colours: {}", field.name()), "", Choice::Field(field))
    }
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
    let title = "continue with method (data is kept, networks where they fit)";
    let items = METHODS.iter().map(named).chain(others).collect();
    Picker::new(title, items).selecting(|choice| *choice == Choice::Method(now.clone()))
}

pub fn presets(now: Preset) -> Picker {
    let items =
        Preset::ALL.map(|preset| Item::new(preset.name(), preset.about(), Choice::Preset(preset)));
    let title = "continue with preset (data is kept, networks are reset)";
    Picker::new(title, items.to_vec()).selecting(|choice| *choice == Choice::Preset(now))
}

/// Lists the settings of `run` by group, with a mark where they differ from those of its preset.
pub fn settings(screen: &Screen) -> Picker {
    let title = "change a setting (* differs from its default)";
    Picker::new(title, setting_items(screen)).of(ListKind::Settings)
}

/// Describes the settings of the run shown.
pub fn setting_items(screen: &Screen) -> Vec<Item> {
    let run = screen.run();
    let values = list_settings(&run.settings)
        .into_iter()
        .zip(list_settings(&screen.settings_of(run.preset)));
    let all = SETTINGS.iter().zip(values);
    let items = all.map(|(setting, ((_, now), (_, default)))| Item {
        marked: screen.changed_settings.contains(setting.name),
        ..setting_item(setting, &now, &default, run.preset)
    });
    items.collect()
}

/// Describes a setting: its value, what it does, what it can be and what changing it costs.
fn setting_item(setting: &Setting, now: &str, default: &str, preset: Preset) -> Item {
    let Setting { name, group, about, unit, values, effect, .. } = setting;
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let of = if preset == Preset::Default {
        String::new()
    } else {
        format!(" in the preset {}", preset.name())
    };
    let below = vec![
        format!("{about}."),
        format!("Now {now}{unit}; {default} by default{of}. Possible: {values}."),
        format!("A change {}.", effect.about()),
    ];
    let detail = format!("{}  {about}", padded(&fitted(now, VALUE_WIDTH), VALUE_WIDTH));
    let choice = Choice::Setting((*name).to_owned());
    Item { below, ..Item::new(*name, detail, choice).within(group) }
}

pub fn random_maps() -> Picker {
    let item = |kind: RandomMapKind| Item::new(kind.name(), kind.about(), Choice::OpenRandom(kind));
    Picker::new("open a random map", RandomMapKind::ALL.map(item).to_vec())
}

/// Lists these kinds of exports of a scene called `noun`.
pub fn exports(kinds: &[ExportKind], noun: &str) -> Picker {
    let item = |kind: &ExportKind| Item::new(kind.name(noun), "", Choice::Export(*kind));
    Picker::new("export", kinds.iter().map(item).collect())
}

pub fn quit_choices(snapshot: &Snapshot, is_map_edited: bool, file: &Path) -> Picker {
    let map = if is_map_edited { " and map edits" } else { "" };
    let lost = lost(snapshot, map);
    let items = vec![
        Item::new("save and quit", format!("to {}", file.display()), Choice::Quit { save: true })
            .on('y'),
        Item::new("quit without saving", lost, Choice::Quit { save: false }).on('n'),
        Item::new("cancel", "", Choice::Nothing).on('c'),
    ];
    Picker::new("save before quitting?", items).of(ListKind::Quit)
}

/// Asks whether to quit a comparison whose map has been drawn.
pub fn quit_comparison() -> Picker {
    let items = vec![
        Item::new("quit", "map edits are lost", Choice::Quit { save: false }).on('n'),
        Item::new("cancel", "ctrl-w saves the map", Choice::Nothing).on('c'),
    ];
    Picker::new("quit without saving the map?", items)
}

/// Asks whether to load a checkpoint while training is unsaved.
pub fn load_choices(snapshot: &Snapshot, file: PathBuf) -> Picker {
    let items = leave_items("load it", lost(snapshot, ""), Choice::LoadUnsaved(file), true);
    Picker::new("load a checkpoint without saving this run?", items)
}

/// Asks whether to continue an unsaved run as `run`, which needs other networks.
pub fn change_choices(snapshot: &Snapshot, run: Run) -> Picker {
    let choice = Choice::Change(Box::new(run));
    let items = leave_items("continue with new networks", lost(snapshot, ""), choice, true);
    Picker::new("this resets the networks, which are not saved", items)
}

/// Says what is lost without saving: updates, and `also` something else.
fn lost(snapshot: &Snapshot, also: &str) -> String {
    let (unsaved, lost) = (snapshot.unsaved_updates(), snapshot.lost_updates());
    let autosave = snapshot.autosaves.last().filter(|_| lost < unsaved);
    match autosave.and_then(|(_, path)| path.file_name()) {
        Some(name) => {
            let name = name.to_string_lossy();
            format!("keeps autosave {name}, loses {} updates after it{also}", grouped(lost))
        }
        None => format!("{} unsaved updates{also} are lost", grouped(lost)),
    }
}

/// The choices for leaving a run, which can be saved first if it `is_worth_saving`.
fn leave_items(leave: &str, detail: String, choice: Choice, is_worth_saving: bool) -> Vec<Item> {
    let save = is_worth_saving.then(|| save_first(leave, choice.clone()));
    let leave = Item::new(format!("yes, {leave}"), detail, choice).on('y');
    save.into_iter().chain([leave, stay()]).collect()
}

/// Asks whether to leave this run for the guided tour, and offers to save it if it
/// `is_worth_saving`.
pub fn tour_choices(snapshot: &Snapshot, is_worth_saving: bool) -> Picker {
    let run = "a new run on the four rooms, about 90 seconds";
    let lost = match snapshot.unsaved_updates() {
        0 => run.to_owned(),
        _ => format!("{run}; {}", lost(snapshot, "")),
    };
    Picker::new("guided tour", leave_items("take the tour", lost, Choice::Tour, is_worth_saving))
}

pub fn failure(title: &str, problem: &str, file: &Path, hint: &str) -> Picker {
    let items = vec![
        // A long detail is fine: the selected item is shown in full below the list.
        Item::new(
            "save and quit",
            format!("to {}; {} goes on", file.display(), resume_command(file)),
            Choice::Quit { save: true },
        )
        .on('y'),
        Item::new(
            "stay",
            "to inspect, save, change a setting or load a checkpoint",
            Choice::Nothing,
        )
        .on('n'),
    ];
    Picker::new(title, items).explaining(format!("{problem}\n{hint}"))
}

/// Asks how to switch to `map`, which may come from a `file`, from map `now`, if the world has one;
/// `fitted` is `map` at the size of `now`. Offers to save this run first if it `is_worth_saving`.
pub fn map_switch_choices(
    map: &Arc<Grid>,
    file: Option<&Path>,
    now: Option<&Grid>,
    fitted: Option<Grid>,
    is_worth_saving: bool,
) -> Picker {
    let file = file.map(Path::to_owned);
    let mut items =
        start_choices("it", &Choice::StartOn(map.clone(), file.clone()), is_worth_saving);
    let size = now.map(|now| (now.width(), now.height()));
    if size == Some((map.width(), map.height())) {
        let same = Choice::ContinueOn(map.clone(), file);
        items.insert(
            0,
            Item::new("continue on it", "the same networks learn the new walls", same).on('c'),
        );
    } else if let (Some((width, height)), Some(fitted)) = (size, fitted) {
        let label = format!("continue on it, cropped or padded to {width} x {height}");
        let fitted = Choice::ContinueOn(Arc::new(fitted), file);
        items.push(Item::new(label, "the networks expect a map of this size", fitted).on('c'));
    }
    items.push(stay());
    Picker::new(format!("{} ({} x {})", map.name(), map.width(), map.height()), items)
}

/// Asks whether to start a new run in the world called `name`, and offers to save this one first if
/// it `is_worth_saving`.
pub fn world_switch_choices(name: &'static str, is_worth_saving: bool) -> Picker {
    let mut items = start_choices(name, &Choice::StartIn(name), is_worth_saving);
    items.push(stay());
    Picker::new(name, items)
}

/// Asks whether to restart an unsaved run with another seed.
pub fn restart_choices(seed: u64) -> Picker {
    let mut items =
        start_choices(&format!("this map with seed {seed}"), &Choice::Restart(seed), true);
    items.push(stay());
    Picker::new(format!("restart with seed {seed}"), items)
}

/// The choices for a new run on `place`, which `start` begins.
fn start_choices(place: &str, start: &Choice, is_worth_saving: bool) -> Vec<Item> {
    let begin = format!("start a new run on {place}");
    if is_worth_saving {
        let discard = format!("{begin} without saving");
        return vec![
            save_first(&begin, start.clone()),
            Item::new(discard, "new networks; unsaved training is lost", start.clone()).on('d'),
        ];
    }
    vec![Item::new(begin, "new networks", start.clone()).on('s')]
}

fn save_first(then: &str, choice: Choice) -> Item {
    Item::new(format!("save this run, then {then}"), "", Choice::SaveFirst(Box::new(choice)))
        .on('s')
}

fn stay() -> Item {
    Item::new("no, stay", "", Choice::Nothing).on('n')
}

/// Lists the maps in `folder`, given its `entries` and whether each is a folder. If `recent` is
/// given, recent and built-in maps and the worlds of `registry` that can be drawn come first.
pub fn maps(
    folder: &Path,
    entries: &[(PathBuf, bool)],
    recent: Option<&[PathBuf]>,
    registry: &Registry,
) -> Picker {
    let mut items = Vec::new();
    if let Some(recent) = recent {
        let item = |path: &PathBuf| {
            Item::new(path.display().to_string(), "recent", Choice::OpenMap(path.clone()))
        };
        items.extend(recent.iter().map(item));
        items.extend(
            BUILTIN.iter().map(|(name, _)| Item::new(*name, "built in", Choice::OpenBuiltin(name))),
        );
        items.push(Item::new(
            "random map",
            "maze, city or perfect maze",
            Choice::Act(Action::RandomMap),
        ));
        let worlds = registry.worlds().iter().filter(|kind| kind.create.is_some());
        items.extend(
            worlds.map(|kind| Item::new(kind.name, kind.about, Choice::OpenWorld(kind.name))),
        );
    }
    items.push(Item::new("..", "folder", Choice::Folder(folder.join(".."))));
    for (path, is_folder) in entries {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if *is_folder {
            items.push(Item::new(format!("{name}/"), "folder", Choice::Folder(path.clone())));
        } else if ["map", "txt"].iter().any(|extension| has_extension(path, extension)) {
            items.push(Item::new(name, "map", Choice::OpenMap(path.clone())));
        }
    }
    Picker::new(format!("open a map: {}", folder.display()), items)
}

/// Lists checkpoints, latest first, with dates in `zone`; those that cannot be loaded come last,
/// with the reason.
pub fn checkpoints(found: Vec<Described>, zone: &TimeZone) -> Picker {
    Picker::new("load a checkpoint", described(found, zone, Choice::Load))
}

/// Lists checkpoints, like [`checkpoints`], to lay the curves of one under those of the run.
pub fn runs_to_lay_under(found: Vec<Described>, zone: &TimeZone) -> Picker {
    Picker::new("draw behind these curves", described(found, zone, Choice::LayUnder))
}

/// A checkpoint's summary, or why it cannot be loaded.
pub type Described = Result<Description, CheckpointError>;

fn described(
    mut found: Vec<Described>,
    zone: &TimeZone,
    choice: fn(PathBuf) -> Choice,
) -> Vec<Item> {
    found.sort_by_key(|d| std::cmp::Reverse(d.as_ref().ok().and_then(|d| d.written)));
    let name = |file: &Path| {
        file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
    };
    let item = |found: &Described| match found {
        Ok(d) => Item::new(name(&d.file), about(d, zone), choice(d.file.clone())),
        Err(e) => {
            Item::new(name(&e.file), format!("cannot be loaded: {}", e.problem), Choice::Nothing)
        }
    };
    found.iter().map(item).collect()
}

fn about(d: &Description, zone: &TimeZone) -> String {
    let success = d.success.map_or("not evaluated".to_owned(), |s| match (s.planned, s.greedy) {
        (Some(planned), Some(greedy)) => format!("success {planned:.2}, greedy {greedy:.2}"),
        (_, Some(greedy)) => format!("success {greedy:.2}"),
        (_, None) => "no tasks".to_owned(),
    });
    let written = d.written.and_then(|at| Timestamp::try_from(at).ok());
    let date =
        written.map_or(String::new(), |at| at.to_zoned(zone.clone()).strftime("%F %R").to_string());
    let (method, megabytes) = (d.run.method.name(), d.bytes as f64 / 1e6);
    let updates = grouped(d.updates);
    format!("{date}, {success}, {updates} updates, {} {method}, {megabytes:.1} MB", d.title)
}
