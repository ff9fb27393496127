//! Starts, loads and changes runs.

use std::sync::Arc;

use super::files::remember_map;
use super::saving::{Saver, is_worth_saving};
use crate::tui::dialog::Choice;
use crate::tui::link::Link;
use crate::tui::lists;
use crate::tui::scene::Scene;
use crate::tui::scene::maze::maze_on;
use crate::tui::screen::Screen;
use gdg::engine::{Command, MakeWorld};
use gdg::env::{WorldKind, maze};
use gdg::map::Grid;
use gdg::train::{Run, resets_networks, settings_in_world};

/// Continues with another run, or this one changed.
pub fn choose(choice: Choice, scene: &mut Scene, screen: &mut Screen, link: &mut Link) {
    match choice {
        Choice::StartIn(name) => start_in(name, screen, link),
        Choice::Restart(seed) => restart(seed, scene, screen, link),
        Choice::StartOn(map, file) => {
            file.as_deref().inspect(|file| remember_map(file));
            start_on(map, scene, screen, link);
        }
        Choice::ContinueOn(map, file) => {
            file.as_deref().inspect(|file| remember_map(file));
            if let Some(maze) = scene.maze_mut() {
                let new = maze.editor.offer(&maze.map.clone(), (*map).clone());
                maze.change_map_or_say(new, Some("the map stays as it is"), screen, link);
            }
        }
        Choice::Load(path) if is_worth_saving(scene, screen) => {
            screen.open(lists::load_choices(&screen.latest, path));
        }
        Choice::Load(path) | Choice::LoadUnsaved(path) => {
            screen.notify(&format!("loading {} ...", path.display()));
            link.command(Command::Load(path), screen);
        }
        _ => {}
    }
}

/// Continues with the run as modified by `change`; asks first if that discards much that the
/// networks have learned.
pub fn change(
    change: impl FnOnce(&mut Run),
    saver: &mut Saver,
    scene: &Scene,
    screen: &mut Screen,
    link: &Link,
) {
    let mut run = screen.run().clone();
    change(&mut run);
    if run == *screen.run() {
        return;
    }
    if resets_networks(screen.run(), &run) && is_worth_saving(scene, screen) {
        screen.open(lists::change_choices(&screen.latest, run));
    } else {
        change_to(run, saver, screen, link);
    }
}

/// Continues as `run`. The file of what was learned before is not replaced by what new networks
/// learn.
pub fn change_to(run: Run, saver: &mut Saver, screen: &mut Screen, link: &Link) {
    let resets = resets_networks(screen.run(), &run);
    if link.command(Command::Change(Box::new(run)), screen) && resets {
        saver.leave_file();
    }
}

/// Starts the run again with another seed.
pub fn restart(seed: u64, scene: &Scene, screen: &mut Screen, link: &Link) {
    let run = Run { seed, ..screen.run().clone() };
    let world: MakeWorld = match scene {
        Scene::Maze(maze) => maze_on(maze.map.clone()),
        Scene::Arm(_) | Scene::Goals(_) => Box::new(|world| world.fork(0)),
    };
    link.command(Command::StartRun(Box::new(run), world), screen);
}

/// Starts a new run in the world called `name`, with the preset's settings for it.
fn start_in(name: &str, screen: &mut Screen, link: &Link) {
    let registry = screen.latest.registry.clone();
    if let Some(kind) = registry.world(name)
        && let Some(create) = kind.create
    {
        let run = Box::new(adapted_to(kind, screen));
        link.command(Command::StartRun(run, Box::new(move |_| Ok(create()))), screen);
    }
}

/// Starts a new run on `map`: with the settings of this run, if its world is a map too.
fn start_on(map: Arc<Grid>, scene: &Scene, screen: &mut Screen, link: &Link) {
    let run = match scene {
        Scene::Maze(_) => screen.run().clone(),
        Scene::Arm(_) | Scene::Goals(_) => adapted_to(&maze::KIND, screen),
    };
    link.command(Command::StartRun(Box::new(run), maze_on(map)), screen);
}

/// Returns this run with the settings that its preset has in another kind of world.
fn adapted_to(kind: &WorldKind, screen: &Screen) -> Run {
    let run = screen.run().clone();
    Run { settings: settings_in_world(run.preset, kind.defaults), ..run }
}
