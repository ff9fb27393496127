//! Training: runs are reproducible, changed settings keep what they should, and updates follow steps.

mod edits;
mod exploration;
mod film;
mod goals;
mod learning;
mod resume;

use std::path::Path;
use std::sync::Arc;

use crate::runs::train_to;
use gdg::bridge::{BridgeSettings, Planner};
use gdg::env::{Goals, PointMaze, Restart};
use gdg::learn::{LearnSettings, Scratch, Threads};
use gdg::map::{Cell, Grid, RandomMapKind, builtin, parse_map, random};
use gdg::pulse::{Cancelled, Wanted};
use gdg::settings::{Auto, Effect};
use gdg::store::{Array, Store};
use gdg::train::{
    self, Evaluation, Method, Moment, Preset, Registry, Run, SaveTo, Settings, Tick, Trainer,
};

/// Two rooms joined by a door: most straight lines between them hit the wall.
const TWO_ROOMS: &str = "\
..........#..........
..........#..........
..........#..........
..........#..........
..........#..........
..........#..........
..........#..........
.....................
.....................
..........#..........
..........#..........
";

/// Returns settings with small networks and a small graph: fast, and enough for two rooms.
fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.learn.hidden = 64;
    settings.learn.buffer_size = 100_000;
    settings.bridge.candidates = 80;
    settings.bridge.graph_every_updates = 200;
    settings
}

/// Returns the two rooms with a start in one corner and a goal beyond the door.
fn marked_rooms() -> String {
    let mut text = format!("S{}", &TWO_ROOMS[1..]);
    let goal = text.find("\n.....................\n").unwrap() + 13;
    text.replace_range(goal..=goal, "G");
    text
}

/// Returns a maze with corridors and walls one cell wide, and a start in a corner.
fn perfect_maze(size: usize) -> Arc<Grid> {
    let maze = random(RandomMapKind::Perfect, Some(size), 1);
    let rows = maze
        .free()
        .chunks(maze.width())
        .map(|row| row.iter().map(|free| if *free { '.' } else { '#' }));
    let text: Vec<String> = rows.map(String::from_iter).collect();
    Arc::new(parse_map("maze", text.join("\n").replacen('.', "S", 1).as_bytes()).unwrap())
}

fn trainer(settings: Settings, seed: u64, threads: impl Into<Threads>) -> Trainer {
    let map = parse_map("two-rooms", TWO_ROOMS.as_bytes()).unwrap();
    trainer_on(&Arc::new(map), settings, seed, threads)
}

fn trainer_on(
    map: &Arc<Grid>,
    settings: Settings,
    seed: u64,
    threads: impl Into<Threads>,
) -> Trainer {
    let run = Run { method: Method::default(), preset: Preset::Default, seed, settings };
    Trainer::new(run, &PointMaze::new(map.clone(), 0), &Registry::builtin(), threads).unwrap()
}

fn map_of(trainer: &Trainer) -> &Arc<Grid> {
    PointMaze::downcast_ref(trainer.world()).unwrap().map()
}

/// Switches to the same maze on another map.
fn change_map(
    trainer: &mut Trainer,
    map: &Arc<Grid>,
) -> Result<train::WorldChange, train::TrainError> {
    let maze = PointMaze::downcast_ref(trainer.world()).unwrap().with_map(map.clone());
    trainer.change_world(&maze)
}

/// Returns all state of a run as bits, except for the elapsed time.
fn full_state(trainer: &Trainer) -> Vec<(String, Vec<u64>)> {
    let store = trainer.save().unwrap();
    let bits = |array: &Array| -> Vec<u64> {
        match array {
            Array::F32(v) => v.iter().map(|v| u64::from(v.to_bits())).collect(),
            Array::U16(v) => v.iter().map(|v| u64::from(*v)).collect(),
            Array::U32(v) => v.iter().map(|v| u64::from(*v)).collect(),
            Array::U64(v) => v.clone(),
        }
    };
    let mut all: Vec<_> =
        store.arrays().iter().map(|(name, array)| (name.clone(), bits(array))).collect();
    for (name, text) in store.texts() {
        let text = if name == "trainer" { without_time(text) } else { text.clone() };
        all.push((name.clone(), text.bytes().map(u64::from).collect()));
    }
    all
}

fn without_time(state: &str) -> String {
    let mut state: serde_json::Value = serde_json::from_str(state).unwrap();
    state.as_object_mut().unwrap().remove("seconds").unwrap();
    state.to_string()
}

fn assert_same(a: &Trainer, b: &Trainer) {
    let (a, b) = (full_state(a), full_state(b));
    assert_eq!(a.len(), b.len());
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{name} differs");
    }
}

/// Saves a run to a file in a new folder, and returns what is read from there: the same run.
fn read_back(run: &Trainer, threads: usize) -> Trainer {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new folder/run.safetensors");
    train::save(run, &SaveTo::Replace(path.clone())).unwrap();
    let resumed = train::load(&path, &Registry::builtin(), threads).unwrap().trainer;
    assert_same(run, &resumed);
    resumed
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_seed_a_different_one() {
    let mut runs =
        [trainer(settings(), 1, 1), trainer(settings(), 1, 1), trainer(settings(), 2, 1)];
    runs.iter_mut().for_each(|run| train_to(run, 450));
    assert_same(&runs[0], &runs[1]);
    assert!(full_state(&runs[0]) != full_state(&runs[2]));
}

#[test]
fn the_number_of_threads_does_not_change_the_run() {
    let choices = [1, 2, 4].map(Threads::Fixed).into_iter().chain([Threads::Auto { most: 4 }]);
    let mut runs = choices.map(|threads| trainer(settings(), 3, threads)).collect::<Vec<_>>();
    runs.iter_mut().for_each(|run| train_to(run, 450));
    runs[1..].iter().for_each(|run| assert_same(&runs[0], run));
}

#[test]
fn evaluation_does_not_change_the_run() {
    let (mut watched, mut alone) = (trainer(settings(), 4, 1), trainer(settings(), 4, 1));
    for updates in [150, 300, 450] {
        train_to(&mut watched, updates);
        let tasks = watched.tasks(3).unwrap();
        watched.evaluate(&tasks).unwrap();
    }
    train_to(&mut alone, 450);
    assert_same(&watched, &alone);
}

#[test]
fn a_setting_that_applies_immediately_changes_nothing_else() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 300);
    let learned = |run: &Trainer| {
        let mut store = Store::default();
        run.learner().save(&mut store).unwrap();
        store
    };
    let graphs = |run: &Trainer| -> Vec<_> {
        let (arrays, _) = run.save().unwrap().into_parts();
        arrays
            .into_iter()
            .filter(|(name, _)| name.starts_with("graph.") || name.starts_with("bridge."))
            .collect()
    };
    let (before, replay, graph) = (learned(&run), run.replay().snapshot(), graphs(&run));
    assert!(graph.iter().any(|(name, _)| name.starts_with("graph.")), "the run has a graph by now");
    let mut changed = run.run().clone();
    changed.settings.learn.learning_rate = 1e-4;
    changed.settings.train.random_actions = 0.9;
    let kept = run.change_run(changed).unwrap();
    assert!(kept.networks && kept.agents);
    assert_eq!(learned(&run), before);
    assert_eq!(run.replay().snapshot(), replay);
    assert!(graphs(&run) == graph, "plans go on");
    assert_eq!(run.counters().updates, 300);
    train_to(&mut run, 400);
}

#[test]
fn changing_any_setting_keeps_the_documented_state() {
    let mut base = settings();
    base.learn.buffer_size = 5_000;
    // So few that there are more than the limit of planners that verify nothing.
    base.bridge.candidates = 6;
    base.bridge.candidate_spacing = 0.6;
    for (name, value) in train::list_settings(&base) {
        let other = match (name.as_str(), value.as_str()) {
            ("backend", _) => "tape".to_owned(),
            ("loss", _) => "log".to_owned(),
            ("update_when", _) => "episode-end".to_owned(),
            ("restart", _) => "anywhere".to_owned(),
            ("goals", _) => "map".to_owned(),
            ("episode_steps", _) => "77".to_owned(),
            ("frontier_epsilon" | "hop_steps", _) => "0.3".to_owned(),
            ("critics", "2") => "1".to_owned(),
            ("critics", _) => "2".to_owned(),
            (_, "true") => "false".to_owned(),
            (_, "false") => "true".to_owned(),
            (_, list) if list.starts_with('[') => "[1.0,3.0]".to_owned(),
            ("buffer_size", _) => "6000".to_owned(),
            ("batch_size" | "hidden", _) => "8".to_owned(),
            (_, number) if number.parse::<u64>().is_ok() => {
                (number.parse::<u64>().unwrap() + 1).to_string()
            }
            (_, number) => (number.parse::<f64>().unwrap() * 0.5 + 0.12).to_string(),
        };
        // Two of the defaults already add up to their joint maximum.
        let Ok(settings) = train::with_setting(&base, &name, &other) else {
            panic!("{name} can be {other}")
        };
        assert_ne!(settings, base, "{name}");
        let mut run = trainer(base.clone(), 5, 1);
        if name == "goals" {
            let marked = parse_map("marked", marked_rooms().as_bytes()).unwrap();
            change_map(&mut run, &Arc::new(marked)).unwrap();
        }
        train_to(&mut run, 20);
        let stored = run.replay().len();
        assert!(
            run.candidates().len()
                > BridgeSettings { verify_edges: false, ..base.bridge.clone() }.max_candidates()
        );
        let kept = run.change_run(Run { settings, ..run.run().clone() }).unwrap();
        let effect = train::Setting::named(&name).unwrap().effect;
        assert_eq!(kept.networks, effect != Effect::NewNetworks, "{name}");
        assert_eq!(kept.agents, effect != Effect::NewAgents, "{name}");
        assert!(run.replay().len() > stored / 2, "{name} loses the replay");
        let mut resumed = Trainer::load(&run.save().unwrap(), &Registry::builtin(), 1)
            .unwrap_or_else(|error| panic!("after a change of {name}: {error}"));
        for run in [&mut run, &mut resumed] {
            train_to(run, 40);
        }
        assert_same(&run, &resumed);
    }
}

#[test]
fn an_evaluation_that_nobody_wants_builds_no_graph() {
    let mut run = trainer(settings(), 11, 2);
    train_to(&mut run, 50);
    let (job, tasks) = (run.evaluation().unwrap(), run.tasks(1).unwrap());
    let cancelled = Cancelled::default();
    assert!(job.graph(&cancelled).is_some());
    drop(Wanted::from(&cancelled));
    assert!(job.run_unless(&cancelled, &tasks).unwrap().is_none());
    assert_eq!(cancelled.progress().share(), Some(0.0), "not even its first row");
}

#[test]
fn updates_follow_steps_at_the_set_ratio_after_the_warm_up() {
    let mut run = trainer(settings(), 13, 1);
    let mut updates = 0;
    while updates < 100 {
        updates += u64::from(run.tick().unwrap() == Tick::Update);
    }
    let settings = &run.run().settings.train;
    let due = (run.counters().env_steps - settings.learning_starts) / settings.env_steps_per_update;
    assert!(due - updates <= 2, "{due} due, {updates} done");
}

#[test]
fn without_a_warm_up_the_first_update_waits_for_a_transition() {
    let mut eager = settings();
    eager.train.learning_starts = 0;
    let mut run = trainer(eager, 14, 1);
    assert_eq!(
        [run.tick().unwrap(), run.tick().unwrap(), run.tick().unwrap()],
        [Tick::Step, Tick::Step, Tick::Update]
    );
}

#[test]
fn the_paper_preset_makes_one_update_per_step_after_each_episode() {
    let map = parse_map("two-rooms", TWO_ROOMS.as_bytes()).unwrap();
    let mut settings = Preset::Paper.settings();
    settings.train.learning_starts = 0;
    let run = Run { method: Method::default(), preset: Preset::Paper, seed: 1, settings };
    let mut run =
        Trainer::new(run, &PointMaze::new(Arc::new(map), 0), &Registry::builtin(), 1).unwrap();
    let episode = u64::from(run.episode_steps());
    for tick in 0..2 * episode {
        assert_eq!(
            run.tick().unwrap(),
            if tick < episode { Tick::Step } else { Tick::Update },
            "tick {tick}"
        );
    }
    assert_eq!(run.tick().unwrap(), Tick::Step, "the next episode begins");
    assert_eq!((run.counters().updates, run.counters().episodes), (episode, 1));
}
