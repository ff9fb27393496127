//! Starts, loads and changes runs and their settings.

use std::sync::Arc;

use super::saving::{Saver, is_worth_saving};
use super::{Cx, Session};
use crate::tui::dialog::{Choice, Dialog, Prompt, Question};
use crate::tui::lists;
use crate::tui::scene::Scene;
use crate::tui::scene::maze::maze_on;
use gdg::engine::{Command, MakeWorld};
use gdg::env::{WorldKind, maze};
use gdg::map::Grid;
use gdg::train::{
    Effect, Run, Setting, Settings, list_settings, resets_networks, settings_in_world, with_setting,
};

/// Continues with the run as modified by `change`; asks first if that discards much that the
/// networks have learned.
pub fn change(change: impl FnOnce(&mut Run), saver: &mut Saver, cx: &mut Cx) {
    let mut run = cx.screen.run().clone();
    change(&mut run);
    if run == *cx.screen.run() {
        return;
    }
    if resets_networks(cx.screen.run(), &run) && is_worth_saving(cx) {
        cx.screen.open(lists::change_choices(&cx.screen.latest, run));
    } else {
        change_to(run, saver, cx);
    }
}

/// Continues as `run`. The file of what was learned before is not replaced by what new networks
/// learn.
pub fn change_to(run: Run, saver: &mut Saver, cx: &mut Cx) {
    let resets = resets_networks(cx.screen.run(), &run);
    if cx.command(Command::Change(Box::new(run))) && resets {
        saver.leave_file();
    }
}

pub fn ask_seed(cx: &mut Cx) {
    let next = cx.screen.run().seed.wrapping_add(1).to_string();
    let hint = "an integer: same seed, same run";
    cx.screen.open(Prompt::new(Question::Seed, "restart with seed", hint, next));
}

pub fn restart(seed: u64, cx: &mut Cx) {
    let run = Run { seed, ..cx.screen.run().clone() };
    let world: MakeWorld = match &cx.scene {
        Scene::Maze(maze) => maze_on(maze.map.clone()),
        Scene::Space(_) => Box::new(|world| world.fork(0)),
    };
    cx.command(Command::StartRun(Box::new(run), world));
}

/// Starts a new run in the world called `name`, with the preset's settings for it.
pub fn start_in(name: &str, cx: &mut Cx) {
    let registry = cx.screen.latest.registry.clone();
    if let Some(kind) = registry.world(name)
        && let Some(create) = kind.create
    {
        let run = Box::new(adapted_to(kind, cx));
        cx.command(Command::StartRun(run, Box::new(move |_| Ok(create()))));
    }
}

/// Starts a new run on `map`: with the settings of this run, if its world is a map too.
pub fn start_on(map: Arc<Grid>, cx: &mut Cx) {
    let run = match cx.scene {
        Scene::Maze(_) => cx.screen.run().clone(),
        Scene::Space(_) => adapted_to(&maze::KIND, cx),
    };
    cx.command(Command::StartRun(Box::new(run), maze_on(map)));
}

/// Continues on `map`.
pub fn continue_on(map: &Grid, cx: &mut Cx) {
    cx.in_maze(|maze, screen, link| {
        let new = (*map != *maze.map).then(|| Arc::new(map.clone()));
        maze.change_map_or_say(new, ["", "the map stays as it is"], screen, link);
    });
}

/// Loads a checkpoint; asks first if much would be lost, unless the user has decided.
pub fn load(path: std::path::PathBuf, is_decided: bool, cx: &mut Cx) {
    if !is_decided && is_worth_saving(cx) {
        return cx.screen.open(lists::load_choices(&cx.screen.latest, path));
    }
    cx.screen.notify(&format!("loading {} ...", path.display()));
    cx.command(Command::Load(path));
}

fn adapted_to(kind: &WorldKind, cx: &Cx) -> Run {
    let run = cx.screen.run().clone();
    Run { settings: settings_in_world(run.preset, kind.defaults), ..run }
}

/// Gives the setting selected in the list the value of the run's preset.
pub fn reset_setting(session: &mut Session) {
    let Session { cx, saver, .. } = session;
    let Some(Dialog::Pick(picker)) = cx.screen.dialogs.last() else { return };
    let Some(Choice::Setting(name)) = picker.choice().cloned() else { return };
    let run = cx.screen.run();
    let Some(value) = value_of(&name, &cx.screen.settings_of(run.preset)) else { return };
    match with_setting(&run.settings, &name, &value) {
        Ok(settings) if settings == run.settings => {
            cx.screen.notify(&format!("{name} has its default already"));
        }
        Ok(settings) => change(|run| run.settings = settings, saver, cx),
        Err(error) => cx.screen.report(&error.one_line()),
    }
}

/// Asks for a setting's new value; a switch that costs nothing is turned over at once.
pub fn ask_setting(name: String, saver: &mut Saver, cx: &mut Cx) {
    let value = value_of(&name, &cx.screen.run().settings).unwrap_or_default();
    let setting = Setting::named(&name);
    if setting
        .is_some_and(|setting| setting.values.are_switch() && setting.effect == Effect::Immediate)
    {
        let other = if value == "true" { "false" } else { "true" };
        if let Ok(settings) = with_setting(&cx.screen.run().settings, &name, other) {
            change(|run| run.settings = settings, saver, cx);
        }
        return;
    }
    let hint = setting.map_or(String::new(), |setting| {
        format!("{}: {}; {}", setting.about, setting.values, setting.effect.about())
    });
    cx.screen.open(Prompt::new(Question::Setting(name.clone()), name, hint, value));
}

fn value_of(name: &str, settings: &Settings) -> Option<String> {
    let (_, value) = list_settings(settings).into_iter().find(|(known, _)| *known == name)?;
    Some(value)
}
