//! Starts, loads and changes runs and their settings.

use std::sync::Arc;

use super::Cx;
use super::saving::{Saver, is_worth_saving, unsaved};
use crate::tui::dialog::{Choice, Prompt, Question};
use crate::tui::lists;
use crate::tui::scene::Scene;
use crate::tui::scene::maze::maze_on;
use gdg::engine::{EngineCommand, MakeWorld};
use gdg::env::{WorldKind, maze};
use gdg::map::Grid;
use gdg::train::{Run, SaveTo, Setting, list_settings, resets_networks, settings_in_world};

/// Continues with the run as modified by `change`; asks first if that discards much that the
/// networks have learned.
pub fn change(change: impl FnOnce(&mut Run), saver: &mut Saver, cx: &mut Cx) {
    let mut run = cx.screen.run().clone();
    change(&mut run);
    if run == *cx.screen.run() {
        return;
    }
    if resets_networks(cx.screen.run(), &run) && is_worth_saving(cx) {
        let (title, begin) = ("save before the networks are reset?", "continue with new networks");
        let (to, lost) = (Choice::Change(Box::new(run)), lists::lost(&cx.screen.snapshot, false));
        cx.screen.open(lists::leave(title, begin, "", to, Some(lost)));
    } else {
        change_to(run, saver, cx);
    }
}

/// Continues as `run`. New networks do not replace the file of what was learned before.
pub fn change_to(run: Run, saver: &mut Saver, cx: &mut Cx) {
    let resets = resets_networks(cx.screen.run(), &run);
    let [before, now] = [cx.screen.run(), &run].map(|run| run.method.name());
    let leaves = resets || matches!(saver.to, SaveTo::CreateNew(_));
    if cx.screen.command(EngineCommand::Change(Box::new(run))) && leaves {
        saver.leave_file([&before, &now]);
    }
}

pub fn ask_to_restart(cx: &mut Cx) {
    let seed = cx.screen.run().seed.wrapping_add(1);
    let [title, begin] = ["restart", "start"].map(|word| format!("{word} with seed {seed}"));
    // On the same map.
    let lost = is_worth_saving(cx).then(|| lists::lost(&cx.screen.snapshot, false));
    cx.screen.open(lists::leave(title + "?", &begin, "new networks", Choice::Restart(seed), lost));
}

pub fn restart(seed: u64, cx: &mut Cx) {
    let run = Run { seed, ..cx.screen.run().clone() };
    let world: MakeWorld = match &cx.scene {
        Scene::Maze(maze) => maze_on(maze.map.clone()),
        Scene::Space(_) => Box::new(|world| world.fork(0)),
    };
    cx.screen.command(EngineCommand::StartRun(Box::new(run), world));
}

/// Starts a new run in the world called `name`, with the preset's settings for it.
pub fn start_in(name: &str, cx: &mut Cx) {
    let registry = cx.screen.snapshot.registry.clone();
    if let Some(kind) = registry.world(name)
        && let Some(create) = kind.create
    {
        let run = Box::new(adapted_to(kind, cx));
        cx.screen.command(EngineCommand::StartRun(run, Box::new(move |_| Ok(create()))));
    }
}

/// Starts a new run on `map`: with the settings of this run, if its world is a map too.
pub fn start_on(map: Arc<Grid>, cx: &mut Cx) {
    let run = match cx.scene {
        Scene::Maze(_) => cx.screen.run().clone(),
        Scene::Space(_) => adapted_to(&maze::KIND, cx),
    };
    cx.screen.command(EngineCommand::StartRun(Box::new(run), maze_on(map)));
}

pub fn continue_on(map: &Grid, cx: &mut Cx) {
    cx.in_maze(|maze, screen| {
        let new = (*map != *maze.map).then(|| Arc::new(map.clone()));
        maze.change_map_or_say(new, ["", "the map stays as it is"], screen);
    });
}

/// Loads a checkpoint; asks first if much would be lost, unless the user has decided.
pub fn load(path: std::path::PathBuf, is_decided: bool, cx: &mut Cx) {
    if let Some(lost) = unsaved(cx).filter(|_| !is_decided) {
        let title = "save before loading?";
        let choice = Choice::LoadUnsaved(path);
        return cx.screen.open(lists::leave(title, "load it", "", choice, Some(lost)));
    }
    cx.screen.say(&format!("loading {} ...", path.display()));
    cx.screen.command(EngineCommand::Load(path));
}

fn adapted_to(kind: &WorldKind, cx: &Cx) -> Run {
    let run = cx.screen.run().clone();
    Run { settings: settings_in_world(run.preset, kind.defaults), ..run }
}

pub fn ask_setting(name: String, cx: &mut Cx) {
    let values = list_settings(&cx.screen.run().settings);
    let value = values.into_iter().find(|(known, _)| *known == name).map(|(_, value)| value);
    let (value, setting) = (value.unwrap_or_default(), Setting::named(&name));
    let hint = setting.map_or(String::new(), |setting| {
        format!("{}: {}; {}", setting.about, setting.values, setting.effect.about())
    });
    let title = format!("value of {name}");
    cx.screen.open(Prompt::new(Question::Setting(name), title, hint, value));
}
