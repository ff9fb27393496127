//! The built-in point mazes of OGBench.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::{assert_same, resumed, rng};
use gdg::env::{Editable, Environment, Episodes, Evaluated, PointMaze};
use gdg::job::Job;
use gdg::map::{self, Ogbench};
use gdg::train::{Dataset, LeftOut, Settings, Trainer, data_file};

fn maze(benchmark: Ogbench, agents: usize) -> PointMaze {
    PointMaze::new(Arc::new(map::builtin(benchmark.name()).unwrap()), agents)
}

/// Returns the position at a row and a column of blocks, with a fraction.
fn block(row: f64, column: f64) -> [f64; 2] {
    [20.0 * column + 10.0, 20.0 * row + 10.0]
}

/// Returns recorded steps of OGBench's own environments.
fn recorded(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ogbench");
    folder.join(name).with_extension("npz")
}

fn read(file: &Path, world: &PointMaze) -> Dataset {
    Dataset::read(file, world, &Job::default()).unwrap()
}

/// Returns how far each recorded step leads from where it led there, along the axis where it is
/// farther.
fn errors_of_steps((benchmark, name): (Ogbench, &str)) -> Vec<f32> {
    let mut world = maze(benchmark, 1);
    let data = read(&recorded(name), &world);
    let mut rows: Vec<(Vec<f32>, Vec<f32>, bool)> = Vec::new();
    data.replay(1, || vec![0.0; 2]).visit_rows(|state, action, is_last| {
        rows.push((state.to_vec(), action.to_vec(), is_last));
    });
    let steps = rows.windows(2).filter(|rows| !rows[0].2);
    let error = |rows: &[(Vec<f32>, Vec<f32>, bool)]| {
        let [(state, action, _), (next, ..)] = rows else { unreachable!("two rows") };
        world.set_full_state(0, &[state[0], state[1]].map(f64::from)).unwrap();
        world.step(action, &mut rng(0)).unwrap();
        let off = |axis: usize| (world.states()[axis] - next[axis]).abs();
        off(0).max(off(1))
    };
    steps.map(error).collect()
}

#[test]
fn steps_lead_where_the_real_environment_leads() {
    let named = [(Ogbench::Medium, "medium"), (Ogbench::Large, "large"), (Ogbench::Giant, "giant")];
    let mut errors: Vec<f32> = named.into_iter().flat_map(errors_of_steps).collect();
    errors.sort_by(f32::total_cmp);
    assert_eq!(errors.len(), 10_000);
    let [most, of_99] = [errors[9_999], errors[9_899]];
    println!("largest error {most} of a step; 99 % of the steps are exact to {of_99}");
    assert!(of_99 < 2e-4, "{of_99}");
    assert!(most < 1.5, "only contacts differ: {most}");
}

#[test]
fn tasks_are_the_five_of_the_benchmark_with_noise() {
    for benchmark in Ogbench::ALL {
        let world = maze(benchmark, 0);
        let set = world.tasks(50, &mut rng(1)).unwrap();
        assert_eq!((set.distances.len(), set.tasks.len()), (5, 250));
        let mut farthest: f32 = 0.0;
        for task in &set.tasks {
            let ends = [[task.start[0] as f32, task.start[1] as f32], [task.goal[0], task.goal[1]]];
            for (at, [row, column]) in ends.into_iter().zip(benchmark.tasks()[task.group]) {
                assert!(world.map().is_free_at(at[0], at[1]), "{at:?}");
                let middle = block(row as f64, column as f64);
                let off = [0, 1].map(|axis| (at[axis] - middle[axis] as f32).abs());
                assert!(off[0].max(off[1]) <= 5.0, "{off:?}");
                farthest = farthest.max(off[0]);
            }
            let has_teleports = benchmark == Ogbench::Teleport;
            assert_eq!(task.shortest.is_none(), has_teleports);
        }
        assert!(farthest > 4.9, "{farthest}");
        assert_eq!(world.episode_steps(), Some(1_000));
    }
    let far = maze(Ogbench::Giant, 0).tasks(1, &mut rng(1)).unwrap().tasks[0].shortest.unwrap();
    assert!((380..461).contains(&far), "through the whole maze: {far}");
}

#[test]
fn a_teleport_leads_to_each_exit_as_often() {
    let mut world = maze(Ogbench::Teleport, 1);
    let [x, y] = block(4.0, 6.0);
    let exits = [block(1.0, 7.0), block(6.0, 1.0), block(6.0, 10.0)];
    let (mut counts, mut rng) = ([0; 3], rng(3));
    for _ in 0..300 {
        world.set_full_state(0, &[x, y + 7.4]).unwrap();
        world.step(&[0.5, -1.0], &mut rng).unwrap();
        let here = [world.states()[0], world.states()[1]];
        let exit = exits.iter().position(|[x, y]| {
            (here[0] - *x as f32 - 0.5).abs() < 1e-3 && (here[1] - *y as f32 + 1.0).abs() < 1e-3
        });
        counts[exit.unwrap()] += 1;
        assert!(world.is_possible(&[x as f32, y as f32 + 7.4], &[0.5, -1.0], &here));
    }
    assert!(counts.iter().all(|count| (70..130).contains(count)), "{counts:?}");
    let beside = [x as f32, y as f32 + 7.6];
    world.set_full_state(0, &beside.map(f64::from)).unwrap();
    world.step(&[0.5, -1.0], &mut rng).unwrap();
    let off = [world.states()[0] - beside[0] - 0.5, world.states()[1] - beside[1] + 1.0];
    assert!(off.iter().all(|off| off.abs() < 1e-3), "{off:?}");
    assert!(!world.is_possible(&beside, &[0.5, -1.0], &exits[1].map(|at| at as f32)));
}

fn is_leap(from: &[f32], to: &[f32]) -> bool {
    (from[0] - to[0]).hypot(from[1] - to[1]) > 10.0
}

#[test]
fn recorded_steps_through_teleports_are_possible() {
    let data = read(&recorded("teleport"), &maze(Ogbench::Teleport, 0));
    let mut trainer = trainer(Ogbench::Teleport, 0);
    assert_eq!(trainer.learn_from(&data, &Job::default()).unwrap().by_chance, 2);
    assert_eq!(leaps_in(&trainer), 0);
}

/// Steps of more than ten cells in a run's replay buffer.
fn leaps_in(trainer: &Trainer) -> usize {
    let (mut before, mut leaps) = (None::<Vec<f32>>, 0);
    trainer.replay().visit_rows(|state, _, is_last| {
        leaps += usize::from(before.take().is_some_and(|from| is_leap(&from, state)));
        before = (!is_last).then(|| state.to_vec());
    });
    leaps
}

#[test]
fn teleports_are_no_ways_for_agents_that_act() {
    let mut trainer = trainer(Ogbench::Teleport, 1);
    let mut been_through = 0;
    while trainer.counters().env_steps < 60_000 {
        let before = trainer.world().states().to_vec();
        trainer.tick().unwrap();
        let states = before.chunks(2).zip(trainer.world().states().chunks(2));
        been_through += states.filter(|(a, b)| is_leap(a, b)).count();
    }
    assert!(been_through > 10, "{been_through}");
    assert_eq!(leaps_in(&trainer), 0);
    // What is known of them is part of a checkpoint, as the tasks are.
    let mut again = resumed(&trainer, 1);
    for run in [&mut trainer, &mut again] {
        run.tick().unwrap();
    }
    assert_same(&trainer, &again);
    let [own, tasks] =
        [&trainer, &again].map(|trainer| trainer.world().tasks(2, &mut rng(5)).unwrap());
    assert!(own == tasks && tasks.distances == [None; 5]);
}

fn trainer(benchmark: Ogbench, seed: u64) -> Trainer {
    let mut settings = Settings::default();
    settings.learn.hidden = 32;
    settings.bridge.candidates = 60;
    settings.train.agents = 4;
    // Nobody learns here.
    settings.train.learning_starts = 1_000_000;
    crate::support::trainer(&maze(benchmark, 0), "gdg-bridge", settings, seed, 1)
}

#[test]
fn recorded_states_are_in_the_benchmarks_unit() {
    let mut own = trainer(Ogbench::Large, 0);
    for _ in 0..300 {
        own.tick().unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("d.npz");
    std::fs::write(&file, data_file(own.replay(), own.world(), &Job::default()).unwrap()).unwrap();
    // Read as it is, by a world without a unit of its own.
    let plain = read(&file, &crate::support::maze("....\n....\n"));
    let data = read(&file, &maze(Ogbench::Large, 0));
    for (cells, lengths) in data.states().iter().zip(plain.states()) {
        assert!((lengths - (0.2 * cells - 6.0)).abs() < 1e-4, "{lengths} {cells}");
    }
    let left_out = trainer(Ogbench::Large, 0).learn_from(&data, &Job::default()).unwrap();
    assert_eq!(left_out, LeftOut { impossible: 0, by_chance: 0 });
}
