//! Distance is learned, and the actor follows it.

use super::*;

/// Networks that hardly change show that the thresholds detect learning.
#[test]
fn two_rooms_are_learned_and_not_by_frozen_networks() {
    let [mut learning, mut frozen] = [settings(), settings()];
    (frozen.learn.learning_rate, frozen.learn.grid_learning_rate) = (1e-8, 1e-8);
    let [[planned, greedy], [idle, greedy_idle]] = [&mut learning, &mut frozen].map(|settings| {
        let mut run = trainer(settings.clone(), 11, 2);
        train_to(&mut run, 4_000);
        let bridges = run.evaluate(&run.tasks(1).unwrap()).unwrap().bridges.unwrap();
        assert_eq!(bridges.false_edges, Some(0));
        assert!(bridges.candidates > 10 && bridges.edges > bridges.candidates);
        success(&run, 20)
    });
    assert!(planned >= 0.9 && greedy >= 0.6, "planned {planned}, greedy {greedy}");
    assert!(idle < 0.6 && greedy_idle < 0.3, "planned {idle}, greedy {greedy_idle}");
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
    let [planned, _] = success(&run, 20);
    assert!(planned >= 0.85, "planned {planned}");
}

/// Returns planned and greedy success on `map` with the default preset and a `change`.
fn success_with(map: &Arc<Grid>, seed: u64, change: impl Fn(&mut LearnSettings)) -> [f64; 2] {
    let mut settings = Settings::default();
    change(&mut settings.learn);
    let mut run = trainer_on(map, settings, seed, 2);
    train_to(&mut run, 4_000);
    success(&run, 60)
}

#[test]
fn waypoints_on_the_way_through_the_graph_lead_the_actor() {
    let map = Arc::new(builtin("fourrooms").unwrap());
    let [with, without] =
        [true, false].map(|led| success_with(&map, 1, |learn| learn.actor_waypoints = led)[1]);
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
    let solved = |seed, helped| {
        success_with(&map, seed, |learn| {
            (learn.unblock_actor, learn.model_check) = (helped, helped);
            // What else helps in clutter is off.
            learn.actor_waypoints = false;
            (learn.distillation, learn.short_pairs, learn.imagined_walks) = (0.0, 0.0, 0.0);
        })
    };
    let (mut with, mut without) = (0.0, 0.0);
    for seed in [1, 2, 3] {
        let [planned, alone] = solved(seed, true);
        assert!(planned > 0.9, "on plans {planned}, seed {seed}");
        (with, without) = (with + alone / 3.0, without + solved(seed, false)[1] / 3.0);
    }
    assert!(without < with - 0.05, "alone, with ways out {with}, without {without}");
}
