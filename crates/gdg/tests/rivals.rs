//! Rivals that learn from rewards: they learn what they can, reproducibly, and planners work over
//! them. Whether runs repeat is also tested for the goal-distance gradient with D given.

use crate::support::{
    assert_resumes, assert_same, evaluated, maze, state, success, train_all, train_to,
};
use gdg::train::{Registry, Trainer};

/// Two rooms joined by a door.
const TWO_ROOMS: &str = "\
.......#.......
.......#.......
.......#.......
.......#.......
...............
.......#.......
.......#.......
.......#.......
.......#.......
";

const RIVALS: [&str; 3] = ["ddpg", "her", "ddpg-distance"];

/// Returns a run with the preset of `method` and small networks.
fn trainer(method: &str, map: &str, seed: u64, threads: usize) -> Trainer {
    let preset = Registry::builtin().preset_of(&method.parse().unwrap());
    let mut settings = preset.settings();
    (settings.learn.hidden, settings.learn.batch_size) = (48, 96);
    settings.learn.buffer_size = 50_000;
    settings.train.learning_starts = 1_000;
    (settings.bridge.candidates, settings.bridge.graph_every_updates) = (60, 200);
    crate::support::trainer(&maze(map), method, settings, seed, threads)
}

#[test]
fn every_rival_learns_a_small_empty_map() {
    for rival in RIVALS {
        let mut run = trainer(rival, &"........\n".repeat(8), 1, 2);
        train_to(&mut run, 2_500);
        let found = evaluated(&run, 20);
        let success = found.alone.success.unwrap();
        assert_eq!(found.straight.unwrap().success, Some(1.0), "nothing is in the way");
        assert!(success >= 0.85, "{rival}: {success}");
        // D is in steps, also where the reward is a distance.
        let error = found.error.unwrap();
        assert!(error.mape < 1.0 && error.spearman > 0.7, "{rival}: {error:?}");
    }
}

#[test]
fn rivals_are_reproducible_on_any_number_of_threads_and_after_a_break() {
    for rival in ["ddpg", "her", "her+bridges", "ddpg-distance+sorb", "gdg-distance"] {
        let straight = assert_resumes(|| trainer(rival, TWO_ROOMS, 3, 1), 233, 450);
        let [mut again, mut other] =
            [(3, 2), (4, 1)].map(|(seed, threads)| trainer(rival, TWO_ROOMS, seed, threads));
        train_all([&mut again, &mut other], 450);
        assert_same(&straight, &again);
        assert!(state(&straight) != state(&other), "{rival}");
    }
}

#[test]
fn planners_work_over_a_rival() {
    // SoRB's edges are not verified: its plans may lead through the wall.
    for (planner, least) in [("sorb", 0.45), ("bridges", 0.9)] {
        let mut run = trainer(&format!("her+{planner}"), TWO_ROOMS, 1, 2);
        train_to(&mut run, 4_000);
        let bridges = evaluated(&run, 1).bridges.unwrap();
        assert!(bridges.candidates > 30 && bridges.edges > bridges.candidates, "{bridges:?}");
        let [planned, _] = success(&run, 15);
        assert!(planned >= least, "{planner}: planned {planned}");
    }
}

#[test]
fn networks_are_kept_between_methods_of_the_same_values_only() {
    let mut run = trainer("ddpg", TWO_ROOMS, 1, 1);
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
