//! Distance is learned, and the actor follows it.

use super::*;

/// Trains for `updates` and returns planned and greedy success.
fn success(settings: Settings, updates: u64) -> (f64, f64) {
    let mut run = trainer(settings, 11, 2);
    train_to(&mut run, updates);
    let tasks = run.tasks(20).unwrap();
    let found = run.evaluate(&tasks).unwrap();
    let bridges = found.bridges.unwrap();
    assert_eq!(bridges.false_edges, Some(0));
    assert!(bridges.candidates > 10 && bridges.edges > bridges.candidates);
    (found.planned.unwrap().success.unwrap(), found.greedy.success.unwrap())
}

#[test]
fn two_rooms_are_learned() {
    let (planned, greedy) = success(settings(), 4_000);
    assert!(planned >= 0.9, "planned {planned}");
    assert!(greedy >= 0.6, "greedy {greedy}");
}

/// Shows that the test above detects learning: networks that hardly change stay far below its
/// thresholds.
#[test]
fn two_rooms_are_not_learned_by_frozen_networks() {
    let mut idle = settings();
    idle.learn.learning_rate = 1e-8;
    idle.learn.grid_learning_rate = 1e-8;
    let (planned, greedy) = success(idle, 4_000);
    assert!(planned < 0.6 && greedy < 0.3, "planned {planned}, greedy {greedy}");
}

#[test]
fn learned_distances_bend_around_the_wall() {
    let mut run = trainer(settings(), 12, 2);
    train_to(&mut run, 4_000);
    let policy = run.policy().unwrap();
    let distance =
        |from: [f32; 2], to: [f32; 2]| policy.distance(&from, &to, &mut Scratch::default());
    // Close to each other, with the wall between: 2 steps through it, 17 around it.
    let (through, round) = (distance([9.5, 0.5], [11.5, 0.5]), distance([9.5, 0.5], [7.5, 0.5]));
    assert!(through > 8.0, "across the wall D is {through}");
    assert!(round < 5.0, "along the wall D is {round}");
}

#[test]
fn a_maze_with_corridors_one_cell_wide_is_learned_from_one_cell() {
    let mut settings = settings();
    settings.bridge.candidates = 300;
    let mut run = trainer_on(&perfect_maze(21), settings, 4, 2);
    train_to(&mut run, 4_000);
    let found = run.evaluate(&run.tasks(20).unwrap()).unwrap();
    let planned = found.planned.unwrap().success.unwrap();
    assert!(planned >= 0.85, "planned {planned}");
}

/// Evaluates a run on `map` after `updates` with the default preset and
/// a `change`.
fn evaluated_after(
    updates: u64,
    map: &Arc<Grid>,
    seed: u64,
    change: impl Fn(&mut LearnSettings),
) -> Evaluation {
    let mut settings = Settings::default();
    change(&mut settings.learn);
    let mut run = trainer_on(map, settings, seed, 2);
    train_to(&mut run, updates);
    run.evaluate(&run.tasks(60).unwrap()).unwrap()
}

#[test]
fn waypoints_on_the_way_through_the_graph_lead_the_actor() {
    let map = Arc::new(builtin("fourrooms").unwrap());
    let greedy = |led| {
        let evaluation = evaluated_after(4_000, &map, 1, |learn| learn.actor_waypoints = led);
        evaluation.greedy.success.unwrap()
    };
    let (with, without) = (greedy(true), greedy(false));
    assert!(without < with - 0.1, "with waypoints {with}, without {without}");
}

/// Clutter of single cells.
const CLUTTER: &str = "
#.......##...#.....#
#.....#........#...#
..#.............#...
#..........##....#..
...........#........
#..#........#.#.....
...###..#..##.#.....
#..##.....###.#.....
........#..........#
.#...#.........##...
...#................
##............#.###.
........#........###
#.#...##..#.......#.
##.....#...#........
..#.................
.###.##.....#..#.#..
..#....#.#.......#.#
.............#...#.#
#......#............
";

#[test]
fn an_actor_that_clutter_blocks_is_shown_the_way_out() {
    let map = Arc::new(parse_map("clutter", CLUTTER.trim().as_bytes()).unwrap());
    let success = |seed, helped| {
        let evaluation = evaluated_after(4_000, &map, seed, |learn| {
            (learn.unblock_actor, learn.model_check) = (helped, helped);
            // What else helps in clutter is off.
            learn.actor_waypoints = false;
            (learn.distillation, learn.short_pairs, learn.imagined_walks) = (0.0, 0.0, 0.0);
        });
        [evaluation.planned.unwrap(), evaluation.greedy].map(|own| own.success.unwrap())
    };
    let (mut with, mut without) = (0.0, 0.0);
    for seed in [1, 2, 3] {
        let [planned, alone] = success(seed, true);
        assert!(planned > 0.9, "on plans {planned}, seed {seed}");
        (with, without) = (with + alone / 3.0, without + success(seed, false)[1] / 3.0);
    }
    assert!(without < with - 0.05, "alone, with ways out {with}, without {without}");
}
