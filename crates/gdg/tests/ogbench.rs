//! The built-in point mazes of OGBench.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use gdg::env::{Editable, Environment, Episodes, PointMaze};
use gdg::map::{self, Cell, MapScale, Ogbench};
use gdg::pulse::Progress;
use gdg::train::{
    self, Dataset, LeftOut, Preset, Registry, Run, SaveTo, Settings, Trainer, data_file,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn maze(benchmark: Ogbench, agents: usize) -> PointMaze {
    PointMaze::new(Arc::new(map::builtin(benchmark.name()).unwrap()), agents)
}

/// Returns the position at a row and a column of blocks, with a fraction.
fn block(row: f64, column: f64) -> [f64; 2] {
    [20.0 * column + 10.0, 20.0 * row + 10.0]
}

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// Returns 10,000 recorded steps of OGBench's own environments.
fn recordings() -> impl Iterator<Item = (Ogbench, PathBuf)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ogbench");
    let named = [("medium", Ogbench::Medium), ("large", Ogbench::Large), ("giant", Ogbench::Giant)];
    named.into_iter().map(move |(name, maze)| (maze, folder.join(format!("{name}.npz"))))
}

/// Returns how far each recorded step leads from where it led there, along the axis where it is
/// farther.
fn errors_of_steps(benchmark: Ogbench, file: &Path) -> Vec<f32> {
    let mut world = maze(benchmark, 1);
    let data = Dataset::read(file, &world, &Progress::default()).unwrap();
    let mut rows: Vec<(Vec<f32>, Vec<f32>, bool)> = Vec::new();
    data.replay(1, || vec![0.0; 2]).visit_rows(|state, action, is_last| {
        rows.push((state.to_vec(), action.to_vec(), is_last));
    });
    let steps = rows.windows(2).filter(|rows| !rows[0].2);
    let error = |rows: &[(Vec<f32>, Vec<f32>, bool)]| {
        let [(state, action, _), (next, ..)] = rows else { unreachable!("two rows") };
        world.set_full_state(0, &[state[0], state[1]].map(f64::from));
        world.step(action, &mut rng(0));
        let off = |axis: usize| (world.states()[axis] - next[axis]).abs();
        off(0).max(off(1))
    };
    steps.map(error).collect()
}

#[test]
fn steps_lead_where_the_real_environment_leads() {
    let mut errors: Vec<f32> =
        recordings().flat_map(|(benchmark, file)| errors_of_steps(benchmark, &file)).collect();
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
        let set = world.tasks(50, &mut rng(1));
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
    let far = maze(Ogbench::Giant, 0).tasks(1, &mut rng(1)).tasks[0].shortest.unwrap();
    assert!((380..461).contains(&far), "through the whole maze: {far}");
}

#[test]
fn its_map_is_the_layout_with_walls_widened_by_the_ball() {
    let giant = map::builtin("ogbench-pointmaze-giant").unwrap();
    assert_eq!((giant.width(), giant.height()), (320, 240));
    let [x, y] = block(1.0, 1.0).map(|at| at as usize);
    // Its sides are at 20, and cells are walls whose middles are less than 3.5 away from there.
    let free = |cells: [Cell; 2]| cells.map(|cell| giant.is_free(cell));
    assert_eq!(free([Cell::new(22, y), Cell::new(23, y)]), [false, true]);
    assert_eq!(free([Cell::new(x, 22), Cell::new(x, 23)]), [false, true]);
    assert_eq!(giant.scale(), MapScale { cell: 20, margin: 3.5, ..giant.scale() });
    assert_eq!(giant.scale().goal_radius, 5.0);
    let refused = MapScale { cell: 2, ..MapScale::default() }.of("giant", &giant).unwrap_err();
    assert!(refused.to_string().contains("scale of its own"), "{refused}");
}

#[test]
fn a_teleport_leads_to_each_exit_as_often() {
    let mut world = maze(Ogbench::Teleport, 1);
    let [x, y] = block(4.0, 6.0);
    let exits = [block(1.0, 7.0), block(6.0, 1.0), block(6.0, 10.0)];
    let (mut counts, mut rng) = ([0; 3], rng(3));
    for _ in 0..300 {
        world.set_full_state(0, &[x, y + 7.4]);
        world.step(&[0.5, -1.0], &mut rng);
        let here = [world.states()[0], world.states()[1]];
        let exit = exits.iter().position(|[x, y]| {
            (here[0] - *x as f32 - 0.5).abs() < 1e-3 && (here[1] - *y as f32 + 1.0).abs() < 1e-3
        });
        counts[exit.unwrap()] += 1;
        assert!(world.is_possible(&[x as f32, y as f32 + 7.4], &[0.5, -1.0], &here));
    }
    assert!(counts.iter().all(|count| (70..130).contains(count)), "{counts:?}");
    let beside = [x as f32, y as f32 + 7.6];
    world.set_full_state(0, &beside.map(f64::from));
    world.step(&[0.5, -1.0], &mut rng);
    let off = [world.states()[0] - beside[0] - 0.5, world.states()[1] - beside[1] + 1.0];
    assert!(off.iter().all(|off| off.abs() < 1e-3), "{off:?}");
    assert!(!world.is_possible(&beside, &[0.5, -1.0], &exits[1].map(|at| at as f32)));
}

#[test]
fn recorded_steps_through_teleports_are_possible() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/ogbench/teleport.npz");
    let world = maze(Ogbench::Teleport, 0);
    let data = Dataset::read(&file, &world, &Progress::default()).unwrap();
    let (mut before, mut jumps, mut possible) = (None::<(Vec<f32>, Vec<f32>)>, 0, 0);
    data.replay(1, || vec![0.0; 2]).visit_rows(|state, action, is_last| {
        if let Some((from, action)) = before.take()
            && (from[0] - state[0]).hypot(from[1] - state[1]) > 10.0
        {
            jumps += 1;
            possible += usize::from(world.is_possible(&from, &action, state));
        }
        before = (!is_last).then(|| (state.to_vec(), action.to_vec()));
    });
    assert_eq!((jumps, possible), (2, 2));
    let mut trainer = trainer(Ogbench::Teleport, 0);
    let left_out = trainer.learn_from(&data, &Progress::default());
    assert_eq!(left_out.by_chance, 2, "{left_out:?}");
    assert_eq!(leaps_in(&trainer), 0);
}

/// Steps of more than ten cells in a run's replay buffer.
fn leaps_in(trainer: &Trainer) -> usize {
    let (mut before, mut leaps) = (None::<Vec<f32>>, 0);
    trainer.replay().visit_rows(|state, _, is_last| {
        if let Some(from) = before.take() {
            leaps += usize::from((from[0] - state[0]).hypot(from[1] - state[1]) > 10.0);
        }
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
        been_through += states.filter(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) > 10.0).count();
    }
    assert!(been_through > 10, "{been_through}");
    assert_eq!(leaps_in(&trainer), 0);
    // What is known of them is part of a checkpoint.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("t.safetensors");
    let file = train::save(&trainer, &SaveTo::CreateNew(file)).unwrap();
    let mut resumed = train::load(&file, &Registry::builtin(), 1).unwrap().trainer;
    for trainer in [&mut trainer, &mut resumed] {
        trainer.tick().unwrap();
    }
    let rows = |trainer: &Trainer| {
        data_file(trainer.replay(), trainer.world(), &Progress::default()).unwrap()
    };
    assert!(rows(&trainer) == rows(&resumed));
}

fn trainer(benchmark: Ogbench, seed: u64) -> Trainer {
    let mut settings = Settings::default();
    settings.learn.hidden = 32;
    settings.bridge.candidates = 60;
    settings.train.agents = 4;
    // Nobody learns here.
    settings.train.learning_starts = 1_000_000;
    let method = "gdg-bridge".parse().unwrap();
    let run = Run { method, preset: Preset::Default, seed, settings };
    Trainer::new(run, &maze(benchmark, 0), &Registry::builtin(), 1).unwrap()
}

#[test]
fn recorded_states_are_in_the_benchmarks_unit() {
    let mut own = trainer(Ogbench::Large, 0);
    for _ in 0..300 {
        own.tick().unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("d.npz");
    std::fs::write(&file, data_file(own.replay(), own.world(), &Progress::default()).unwrap())
        .unwrap();
    // Read as it is, by a world without a unit of its own.
    let map = map::parse_map("map", b"....\n....\n").unwrap();
    let plain =
        Dataset::read(&file, &PointMaze::new(Arc::new(map), 0), &Progress::default()).unwrap();
    let data = Dataset::read(&file, own.world(), &Progress::default()).unwrap();
    for (cells, lengths) in data.states().iter().zip(plain.states()) {
        assert!((lengths - (0.2 * cells - 6.0)).abs() < 1e-4, "{lengths} {cells}");
    }
    let mut same = trainer(Ogbench::Large, 0);
    let left_out = LeftOut { impossible: 0, by_chance: 0 };
    assert_eq!(
        same.learn_from(&data, &Progress::default()),
        left_out,
        "every transition is possible"
    );
}

#[test]
fn a_resumed_run_has_the_same_tasks() {
    let folder = tempfile::tempdir().unwrap();
    let before = trainer(Ogbench::Teleport, 0);
    let file = train::save(&before, &SaveTo::CreateNew(folder.path().join("t.safetensors")));
    let after = train::load(&file.unwrap(), &Registry::builtin(), 1).unwrap().trainer;
    let tasks = |trainer: &Trainer| trainer.world().tasks(2, &mut rng(5)).unwrap();
    assert_eq!(tasks(&before), tasks(&after));
    assert_eq!(after.world().tasks(2, &mut rng(5)).unwrap().distances, vec![None; 5]);
}
