//! Training: runs are reproducible, changed settings keep what they should, and updates follow steps.

mod edits;
mod exploration;
mod goals;
mod learning;
mod resume;

use std::sync::Arc;

use crate::support::{
    assert_resumes, assert_same, evaluated, maze, resumed, rng, state, success, train_all, train_to,
};
use gdg::bridge::{BridgeSettings, Planner};
use gdg::env::{Goals, PointMaze, Restart};
use gdg::job::Job;
use gdg::learn::{LearnSettings, Scratch, Threads};
use gdg::map::{Cell, Grid, RandomMapKind, parse_map, random};
use gdg::settings::{Auto, Effect};
use gdg::store::Store;
use gdg::train::{self, Method, Preset, Registry, Run, SaveTo, Settings, Tick, Trainer};

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

fn trainer(settings: Settings, seed: u64, threads: impl Into<Threads>) -> Trainer {
    crate::support::trainer(&maze(TWO_ROOMS), "gdg-bridge", settings, seed, threads)
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

#[test]
fn neither_threads_nor_evaluations_change_the_run_but_another_seed_does() {
    let mut alone = trainer(settings(), 3, 1);
    train_to(&mut alone, 450);
    for threads in [1, 2, 4].map(Threads::Fixed).into_iter().chain([Threads::Auto { most: 4 }]) {
        let mut watched = trainer(settings(), 3, threads);
        for updates in [150, 300, 450] {
            train_to(&mut watched, updates);
            evaluated(&watched, 1);
        }
        assert_same(&watched, &alone);
    }
    let mut other = trainer(settings(), 2, 1);
    train_to(&mut other, 450);
    assert!(state(&alone) != state(&other));
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
            ("loss", _) => "log".to_owned(),
            ("update_when", _) => "episode-end".to_owned(),
            ("restart", _) => "anywhere".to_owned(),
            ("goals", _) => "map".to_owned(),
            ("episode_steps", _) => "77".to_owned(),
            ("frontier_epsilon" | "hop_steps", _) => "0.3".to_owned(),
            ("critics", _) => "1".to_owned(),
            (_, "true") => "false".to_owned(),
            (_, "false") => "true".to_owned(),
            (_, list) if list.starts_with('[') => "[1.0,3.0]".to_owned(),
            ("buffer_size", _) => "6000".to_owned(),
            ("batch_size" | "hidden", _) => "8".to_owned(),
            (_, number) => match number.parse::<u64>() {
                Ok(number) => (number + 1).to_string(),
                Err(_) => (number.parse::<f64>().unwrap() * 0.5 + 0.12).to_string(),
            },
        };
        let settings = train::with_setting(&base, &name, &other).expect(&name);
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
        let mut again = resumed(&run, 1);
        train_all([&mut run, &mut again], 40);
        assert_same(&run, &again);
    }
}

#[test]
fn an_evaluation_that_nobody_wants_builds_no_graph() {
    let mut run = trainer(settings(), 11, 2);
    train_to(&mut run, 50);
    let job = run.evaluation().unwrap();
    let cancelled = Job::default();
    assert!(job.graph(&cancelled).is_some());
    cancelled.cancel();
    assert_eq!(
        job.run_unless(&cancelled, &job.tasks(1).unwrap()).err(),
        Some(gdg::env::EnvError::Stopped)
    );
    assert_eq!(cancelled.share(), Some(0.0), "not even its first row");
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
fn the_paper_preset_makes_one_update_per_step_after_each_episode() {
    let mut settings = Preset::Paper.settings();
    settings.train.learning_starts = 0;
    let mut run = trainer(settings, 1, 1);
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
