//! Rivals that learn from rewards: they learn what they can, reproducibly, and planners work over
//! them. Whether runs repeat is also tested for the goal-distance gradient with D given.

use std::sync::Arc;

use crate::runs::{state, train_to};
use gdg::env::PointMaze;
use gdg::learn::Scratch;
use gdg::map::{Grid, parse_map};
use gdg::train::{self, Method, Registry, Run, SaveTo, Settings, Trainer};

const RIVALS: [&str; 3] = ["ddpg", "her", "ddpg-distance"];

/// Returns the preset of `method` with small networks.
fn settings(method: &Method) -> Settings {
    let mut settings = Registry::builtin().preset_of(method).settings();
    settings.learn.hidden = 48;
    settings.learn.batch_size = 96;
    settings.learn.buffer_size = 50_000;
    settings.train.learning_starts = 1_000;
    settings.bridge.candidates = 60;
    settings.bridge.graph_every_updates = 200;
    settings
}

fn trainer(method: &str, map: Grid, seed: u64, threads: usize) -> Trainer {
    let method: Method = method.parse().unwrap();
    let (preset, settings) = (Registry::builtin().preset_of(&method), settings(&method));
    let run = Run { method, preset, seed, settings };
    Trainer::new(run, &PointMaze::new(Arc::new(map), 0), &Registry::builtin(), threads).unwrap()
}

fn empty(side: usize) -> Grid {
    Grid::empty("empty", side, side)
}

/// Two rooms joined by a door.
fn two_rooms() -> Grid {
    let row = |i: usize| if i == 4 { "...............\n" } else { ".......#.......\n" };
    parse_map("two-rooms", (0..9).map(row).collect::<String>().as_bytes()).unwrap()
}

#[test]
fn every_rival_learns_a_small_empty_map() {
    for rival in RIVALS {
        let mut run = trainer(rival, empty(8), 1, 2);
        train_to(&mut run, 2_500);
        let found = run.evaluate(&run.tasks(20).unwrap()).unwrap();
        let (success, straight) =
            (found.greedy.success.unwrap(), found.straight.unwrap().success.unwrap());
        assert_eq!(straight, 1.0, "nothing is in the way");
        assert!(success >= 0.85, "{rival}: {success}");
        // D is in steps, also where the reward is a distance.
        let error = found.distance_error.unwrap();
        assert!(error.mape < 1.0 && error.spearman > 0.7, "{rival}: {error:?}");
    }
}

#[test]
fn the_floor_is_lower_where_walls_are_in_the_way() {
    let run = trainer("her", two_rooms(), 1, 1);
    let found = run.evaluate(&run.tasks(40).unwrap()).unwrap();
    let straight = found.straight.unwrap().success.unwrap();
    assert!((0.1..0.9).contains(&straight), "{straight}");
}

#[test]
fn rivals_are_reproducible_on_any_number_of_threads() {
    for rival in ["ddpg", "her+bridges", "ddpg-distance+sorb", "gdg-distance"] {
        let mut runs = [1, 2].map(|threads| trainer(rival, two_rooms(), 3, threads));
        runs.iter_mut().for_each(|run| train_to(run, 450));
        assert!(state(&runs[0]) == state(&runs[1]), "{rival}");
        let mut other = trainer(rival, two_rooms(), 4, 1);
        train_to(&mut other, 450);
        assert!(state(&runs[0]) != state(&other), "{rival}");
    }
}

#[test]
fn resumed_rivals_continue_bitwise() {
    let folder = tempfile::tempdir().unwrap();
    for rival in ["ddpg", "her", "ddpg-distance", "her+bridges", "gdg-distance"] {
        let path = folder.path().join(format!("{rival}.safetensors"));
        let mut straight = trainer(rival, two_rooms(), 5, 1);
        train_to(&mut straight, 500);
        let mut first = trainer(rival, two_rooms(), 5, 1);
        train_to(&mut first, 233);
        train::save(&first, &SaveTo::Replace(path.clone())).unwrap();
        let mut resumed = train::load(&path, &Registry::builtin(), 2).unwrap().trainer;
        assert!(state(&first) == state(&resumed), "{rival}");
        train_to(&mut resumed, 500);
        assert!(state(&straight) == state(&resumed), "{rival}");
    }
}

#[test]
fn planners_work_over_a_rival() {
    // SoRB's edges are not verified: its plans may lead through the wall.
    for (planner, least) in [("sorb", 0.45), ("bridges", 0.9)] {
        let mut run = trainer(&format!("her+{planner}"), two_rooms(), 1, 2);
        train_to(&mut run, 4_000);
        let found = run.evaluate(&run.tasks(15).unwrap()).unwrap();
        let (planned, bridges) = (found.planned.unwrap().success.unwrap(), found.bridges.unwrap());
        assert!(
            bridges.candidates > 30 && bridges.edges > bridges.candidates,
            "{planner}: {bridges:?}"
        );
        assert!(planned >= least, "{planner}: planned {planned}");
    }
}

#[test]
fn distances_are_finite_before_and_after_training() {
    for rival in RIVALS {
        let mut run = trainer(rival, two_rooms(), 2, 1);
        for updates in [0, 300] {
            train_to(&mut run, updates);
            let mut distances = vec![0.0; 3];
            let (states, goals) =
                ([0.5, 0.5, 14.5, 8.5, 3.0, 3.0], [14.5, 8.5, 0.5, 0.5, 3.0, 3.0]);
            let policy = run.policy().unwrap();
            policy.distances(&states, &goals, &mut distances, &mut Scratch::default());
            assert!(distances.iter().all(|d| d.is_finite() && *d >= 0.0), "{rival}: {distances:?}");
        }
    }
}

#[test]
fn networks_are_kept_between_methods_of_the_same_values_only() {
    let mut run = trainer("ddpg", two_rooms(), 1, 1);
    train_to(&mut run, 200);
    let mut change = |method: &str| {
        let mut changed = run.run().clone();
        changed.set_method(method.parse().unwrap(), &Registry::builtin());
        let kept = run.change_run(changed).unwrap();
        assert_eq!(run.run().method.name(), method);
        train_to(&mut run, 250);
        kept.networks
    };
    assert_eq!(
        ["her", "her+sorb", "ddpg-distance", "ddpg"].map(&mut change),
        [true, true, false, false]
    );
    assert!(!change("gdg"));
}
