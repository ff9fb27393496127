//! Maps and scenarios: folders of valid and invalid files, properties of parsing and geometry, the
//! built-in maps.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gdg::env::{EnvSettings, Environment, PointMaze};
use gdg::map::{
    self, BUILTIN, Cell, Diameter, Grid, PointSearch, RandomMapKind, ScenarioTask, StepSearch,
    UNREACHABLE, parse_map, print_ascii, print_movingai, random,
};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn folder(name: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maps").join(name);
    let mut files: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() > 10, "the folder of {name} maps is there");
    files
}

fn is_scenario(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "scen")
}

/// Returns the map that the scenarios of both folders are for.
fn plain() -> Grid {
    parse_map("plain.txt", b"..#\n.#.\n...\n").unwrap()
}

#[test]
fn every_valid_file_is_read() {
    for path in folder("valid") {
        if is_scenario(&path) {
            let tasks = map::load_scenario(&path, &plain()).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(
                (tasks[0].start, tasks[0].goal),
                (Cell::new(0, 0), Cell::new(2, 2)),
                "{}",
                path.display()
            );
        } else {
            let grid = map::load_map(&path).unwrap_or_else(|e| panic!("{e}"));
            assert!(grid.free_count() > 0);
        }
    }
}

#[test]
fn line_endings_and_byte_order_marks_do_not_matter() {
    let read = |name: &str| {
        map::load_map(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maps/valid").join(name))
    };
    let expected = plain();
    for name in ["crlf.txt", "no-final-newline.txt", "byte-order-mark.txt", "plain.txt"] {
        assert_eq!(read(name).unwrap().named(expected.name()), expected, "{name}");
    }
    let marked = read("starts-and-goals.txt").unwrap();
    assert_eq!(marked.starts(), [Cell::new(0, 0), Cell::new(2, 2)]);
    assert_eq!(marked.goals(), [Cell::new(2, 0), Cell::new(0, 2)]);
    let movingai = read("movingai.map").unwrap();
    assert_eq!(print_ascii(&movingai), "..##\n...#\n##..\n");
}

/// Checks the error of each invalid file: where, what, and what is expected instead.
#[test]
fn every_invalid_file_gets_the_expected_error() {
    let mut report = String::new();
    for path in folder("invalid") {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let error = if is_scenario(&path) {
            map::load_scenario(&path, &plain()).map(|_| ()).expect_err(&name)
        } else {
            map::load_map(&path).map(|_| ()).expect_err(&name)
        };
        assert!(error.to_string().contains(&name), "the error names the file: {error}");
        assert!(!error.help.is_empty());
        let place =
            error.at.map_or("whole file".to_owned(), |(line, column)| format!("{line}:{column}"));
        report += &format!("{name}: {place}: {} [{}]\n", error.problem, error.help);
    }
    let expected = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maps/invalid-errors.txt");
    if std::env::var_os("UPDATE_EXPECTED").is_some() {
        fs::write(&expected, &report).unwrap();
    }
    let expected = fs::read_to_string(expected).unwrap();
    for (found, expected) in report.lines().zip(expected.lines()) {
        assert_eq!(found, expected);
    }
    assert_eq!(report.lines().count(), expected.lines().count());
}

#[test]
fn directories_and_missing_files_are_errors_not_panics() {
    let directory = map::load_map(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap_err();
    assert!(directory.problem.contains("directory"), "{directory}");
    let missing = map::load_map(Path::new("no/such.map")).unwrap_err();
    assert!(missing.problem.contains("cannot be read"), "{missing}");
}

#[test]
fn a_map_of_2048_by_2048_is_read() {
    let text = format!("{}\n", ".".repeat(2048)).repeat(2048);
    let grid = parse_map("large", text.as_bytes()).unwrap();
    assert_eq!((grid.width(), grid.height(), grid.free_count()), (2048, 2048, 2048 * 2048));
}

fn built_in(name: &str) -> Grid {
    map::builtin(name).unwrap()
}

#[test]
fn built_in_maps_have_the_expected_diameters() {
    let farthest = |name: &str| {
        let grid = built_in(name);
        let diameter = Diameter::within(100_000, &grid);
        assert!(diameter.exact, "{name}");
        diameter.steps
    };
    assert_eq!((farthest("fourrooms"), farthest("city")), (119, 226));
    assert_eq!(BUILTIN.len(), 8);
}

#[test]
fn fourrooms_is_the_11_by_11_map_enlarged_eight_times() {
    let grid = built_in("fourrooms");
    assert_eq!((grid.width(), grid.height()), (88, 88));
    let small = [
        ".....#.....",
        ".....#.....",
        "...........",
        ".....#.....",
        ".....#.....",
        "#.####.....",
        ".....###.##",
        ".....#.....",
        ".....#.....",
        "...........",
        ".....#.....",
    ];
    for y in 0..88 {
        for x in 0..88 {
            assert_eq!(
                grid.is_free(Cell::new(x, y)),
                small[y / 8].as_bytes()[x / 8] == b'.',
                "({x}, {y})"
            );
        }
    }
}

/// The obstacles of a map: its 8-connected groups of wall cells.
struct Obstacles {
    /// Obstacle of each cell, row-major; `None` for free cells.
    of_cell: Vec<Option<u32>>,
}

impl Obstacles {
    /// Finds the obstacles of `grid`.
    fn new(grid: &Grid) -> Self {
        let mut of_cell = vec![None; grid.free().len()];
        let mut count = 0;
        for i in 0..of_cell.len() {
            if grid.free()[i] || of_cell[i].is_some() {
                continue;
            }
            of_cell[i] = Some(count);
            let mut pending = vec![grid.cell(i)];
            while let Some(at) = pending.pop() {
                for y in at.y.saturating_sub(1)..=(at.y + 1).min(grid.height() - 1) {
                    for x in at.x.saturating_sub(1)..=(at.x + 1).min(grid.width() - 1) {
                        let next = grid.index(Cell::new(x, y));
                        if !grid.free()[next] && of_cell[next].is_none() {
                            of_cell[next] = Some(count);
                            pending.push(Cell::new(x, y));
                        }
                    }
                }
            }
            count += 1;
        }
        Self { of_cell }
    }
}

/// Returns the number of obstacles that the straight line between the centres of `a` and `b`
/// crosses, each of which requires a detour. The line is sampled at every tenth of a cell.
fn obstacles_between(grid: &Grid, obstacles: &Obstacles, a: Cell, b: Cell) -> usize {
    let ([ax, ay], [bx, by]) = (a.centre(), b.centre());
    let samples = 10 * a.x.abs_diff(b.x).max(a.y.abs_diff(b.y)).max(1);
    let mut met = Vec::new();
    for i in 0..=samples {
        let t = i as f32 / samples as f32;
        let cell = Cell::new((ax + t * (bx - ax)) as usize, (ay + t * (by - ay)) as usize);
        if let Some(obstacle) = obstacles.of_cell[grid.index(cell)]
            && !met.contains(&obstacle)
        {
            met.push(obstacle);
        }
    }
    met.len()
}

/// An obstacle (an 8-connected group of wall cells) requires a detour if the straight line from
/// start to goal crosses it. Checks every pair of free cells on one colour of a chessboard, so that
/// every other line runs next to a checked one.
#[test]
fn no_task_of_the_city_has_more_than_nine_obstacles() {
    let grid = built_in("city");
    let obstacles = Obstacles::new(&grid);
    let cells: Vec<Cell> = grid.free_cells().filter(|c| (c.x + c.y).is_multiple_of(2)).collect();
    let mut most = 0;
    for (i, a) in cells.iter().enumerate() {
        for b in &cells[i + 1..] {
            most = most.max(obstacles_between(&grid, &obstacles, *a, *b));
        }
    }
    assert!(most <= 9, "a task has {most} obstacles");
    assert!(most >= 8, "the city is not nearly empty: {most}");
}

/// Within ten steps of the start, a cell of a dead end is nearer to the goal than the start and
/// everything around it; the detour takes more than 80 steps.
#[test]
fn the_trap_and_the_dead_end_are_local_optima() {
    for name in ["trap", "dead-end"] {
        let grid = built_in(name);
        let (start, goal) = (grid.starts()[0], grid.goals()[0]);
        let mut search = StepSearch::new(&grid);
        let to_goal = search.steps_from(goal)[grid.index(start)];
        assert!(to_goal > 80 && to_goal != UNREACHABLE, "{name}: {to_goal}");
        let straight = |c: Cell| (c.x as f64 - goal.x as f64).hypot(c.y as f64 - goal.y as f64);
        let near: Vec<Cell> = {
            let steps = search.steps_from(start).to_vec();
            grid.free_cells().filter(|c| steps[grid.index(*c)] <= 10).collect()
        };
        let end = *near.iter().min_by(|a, b| straight(**a).total_cmp(&straight(**b))).unwrap();
        assert!(straight(end) < straight(start), "{name}");
        // Nothing within ten steps of that cell is nearer either: it is a local optimum, and the
        // start lies in its basin.
        let around = search.steps_from(end).to_vec();
        assert!(
            grid.free_cells()
                .filter(|c| around[grid.index(*c)] <= 10)
                .all(|c| straight(c) >= straight(end)),
            "{name}"
        );
    }
}

/// Generates maps of up to `most` by `most` cells with at least one free cell.
fn grids(most: usize) -> impl Strategy<Value = Grid> {
    (1..=most, 1..=most)
        .prop_flat_map(|(w, h)| {
            (
                Just(w),
                prop::collection::vec(
                    prop::sample::select(vec![b'.', b'#', b'S', b'G', b'C']),
                    w * h,
                ),
            )
        })
        .prop_filter("a free cell", |(_, cells)| cells.iter().any(|c| *c != b'#'))
        .prop_map(|(width, cells)| {
            let text: Vec<u8> = cells.chunks(width).flat_map(|row| [row, b"\n"].concat()).collect();
            parse_map("random", &text).unwrap()
        })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn printed_maps_parse_to_the_same_map(grid in grids(20)) {
        prop_assert_eq!(&parse_map("random", print_ascii(&grid).as_bytes()).unwrap(), &grid);
        let movingai = parse_map("random", print_movingai(&grid).as_bytes()).unwrap();
        prop_assert_eq!(movingai.free(), grid.free());
        prop_assert_eq!(movingai.width(), grid.width());
    }

    #[test]
    fn parsing_any_bytes_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = parse_map("random", &bytes);
    }

    #[test]
    fn steps_agree_with_a_library_search(grid in grids(12)) {
        let mut search = StepSearch::new(&grid);
        let start = grid.free_cells().next().unwrap();
        let steps = search.steps_from(start).to_vec();
        for goal in grid.free_cells() {
            let path = pathfinding::directed::bfs::bfs(&start, |c| grid.neighbours(*c).collect::<Vec<_>>(), |c| *c == goal);
            let expected = path.map_or(UNREACHABLE, |p| p.len() as u32 - 1);
            prop_assert_eq!(steps[grid.index(goal)], expected);
        }
    }

    #[test]
    fn the_diameter_agrees_with_a_search_over_all_pairs(grid in grids(10)) {
        let mut search = PointSearch::new(&grid);
        let components = StepSearch::new(&grid).components(&grid);
        let largest = components.largest();
        let within: Vec<Cell> =
            grid.free_cells().filter(|c| components.of_cell[grid.index(*c)] == Some(largest)).collect();
        let all: Vec<[f32; 2]> = within.iter().map(|cell| cell.centre()).collect();
        let mut steps = |goal: [f32; 2]| all.iter().copied().map(search.steps_to(goal)).collect();
        let from: Vec<Vec<u32>> = all.iter().map(|goal| steps(*goal)).collect();
        let diameter = Diameter::within(usize::MAX, &grid);
        prop_assert!(diameter.exact);
        prop_assert_eq!(Some(&diameter.steps), from.iter().flatten().max());
        let (middle, radius) = diameter.middle.unwrap();
        let to_middle: Vec<u32> = steps(middle.centre());
        for (to_middle, steps) in to_middle.iter().zip(from) {
            prop_assert!(*to_middle <= radius);
            // The middle itself is one goal radius farther.
            prop_assert!(steps.into_iter().max() <= Some(to_middle + 1 + radius));
        }
    }

    #[test]
    fn no_agent_is_ever_inside_a_wall(
        grid in grids(8),
        seed in any::<u64>(),
        actions in prop::collection::vec(-1.5f32..1.5, 8..120),
    ) {
        let grid = Arc::new(grid);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut world = PointMaze::new(grid.clone(), 2)
            .with_settings(EnvSettings { noise: 0.3, ..EnvSettings::default() });
        world.restart(0, &mut rng);
        world.restart(1, &mut rng);
        let components = StepSearch::new(&grid).components(&grid);
        let component = |x: f32, y: f32| components.of_cell[grid.index(Cell::new(x as usize, y as usize))];
        for action in actions.chunks_exact(4) {
            let before: Vec<f32> = world.states().to_vec();
            world.step(action, &mut rng);
            for (at, before) in world.states().chunks_exact(2).zip(before.chunks_exact(2)) {
                prop_assert!(grid.is_free_at(at[0], at[1]), "at {at:?}");
                prop_assert_eq!(component(at[0], at[1]), component(before[0], before[1]), "through a wall");
                // At most one cell per axis and step.
                prop_assert!((at[0] - before[0]).abs() <= 1.001 && (at[1] - before[1]).abs() <= 1.001);
            }
        }
    }
}

#[test]
fn agents_slide_along_walls_and_are_moved_out_of_them() {
    let grid = Arc::new(parse_map("wall", b"...\n###\n...\n").unwrap());
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut world = PointMaze::new(grid, 1);
    world.set_full_state(0, &[0.5, 0.5]);
    world.step(&[1.0, 1.0], &mut rng);
    let at = world.states();
    assert!((at[0] - 1.5).abs() < 1e-3, "it slides to the right: {at:?}");
    assert!(at[1] < 1.0, "the wall holds: {at:?}");
    world.set_full_state(0, &[1.5, 1.4]);
    assert_eq!(world.states(), [1.5, 0.5]);
}

fn shared(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/movingai").join(file)
}

#[test]
fn a_printed_map_and_a_scenario_on_it_are_read() {
    let grid = map::random(RandomMapKind::City, None, 3);
    let read = parse_map("city.map", map::print_movingai(&grid).as_bytes()).unwrap();
    assert_eq!(read.free(), grid.free());
    let cells: Vec<Cell> = grid.free_cells().step_by(97).collect();
    let mut scenario = "version 1\n".to_owned();
    for (start, goal) in cells.iter().zip(cells.iter().rev()) {
        let numbers = [start.x, start.y, goal.x, goal.y].map(|n| n.to_string()).join("\t");
        scenario += &format!("0\tcity.map\t{}\t{}\t{numbers}\t12.5\n", grid.width(), grid.height());
    }
    let tasks = map::parse_scenario_bytes("city.scen", scenario.as_bytes(), &read).unwrap();
    assert_eq!(tasks.len(), cells.len());
    assert!(
        tasks
            .iter()
            .zip(&cells)
            .all(|(task, cell)| task.start == *cell && task.optimal_octile == Some(12.5))
    );
}

#[test]
fn a_scenario_stays_on_an_edited_map_and_not_on_one_of_another_size() {
    let map = |text: &str| Arc::new(parse_map("map", text.as_bytes()).unwrap());
    let mut maze = PointMaze::new(map("....\n....\n"), 0);
    let task =
        ScenarioTask { start: Cell::new(0, 0), goal: Cell::new(3, 1), optimal_octile: Some(3.4) };
    maze.set_scenario(vec![task]);
    let tasks = |maze: &PointMaze| maze.tasks(1, &mut ChaCha8Rng::seed_from_u64(1)).tasks;
    assert_eq!(tasks(&maze).len(), 1);
    let edited = tasks(&maze.with_map(map("....\n.#..\n")));
    assert_eq!((edited.len(), &edited[0].goal), (1, &vec![3.5, 1.5]));
    assert!(tasks(&maze.with_map(map("...\n"))).iter().all(|task| task.goal != edited[0].goal));
}

#[test]
#[ignore = "reads real maps, which are not part of the repository"]
fn real_maps_and_scenarios_are_read() {
    let grid = map::load_map(&shared("Berlin_0_256.map")).unwrap();
    assert_eq!((grid.width(), grid.height()), (256, 256));
    assert!((grid.free_count() as f64 / 65536.0 - 0.735).abs() < 0.001);
    let components = StepSearch::new(&grid).components(&grid);
    let share = components.sizes[components.largest() as usize] as f64 / grid.free_count() as f64;
    assert!((share - 0.955).abs() < 0.001, "{share}");
    assert!(Diameter::within(2_000, &grid).steps >= 290);
    let pairs = [
        ("Berlin_0_256.map", "Berlin_0_256.map.scen"),
        ("room-32-32-4.map", "room-32-32-4-random-1.scen"),
        ("maze-32-32-2.map", "maze-32-32-2-even-1.scen"),
    ];
    for (map_file, scenario) in pairs {
        let grid = map::load_map(&shared(map_file)).unwrap();
        let tasks = map::load_scenario(&shared(scenario), &grid).unwrap();
        let mut search = StepSearch::new(&grid);
        for task in tasks.iter().step_by(7) {
            let steps = f64::from(search.steps_from(task.start)[grid.index(task.goal)]);
            // A diagonal counts sqrt 2 in an octile length, and 1 in a step count.
            let length = task.optimal_octile.unwrap();
            assert!(steps <= length + 1e-6 && length <= steps * 2f64.sqrt() + 1e-6);
        }
    }
}

#[test]
fn random_maps_are_connected_and_reproducible_and_differ_by_seed() {
    for (kind, side) in [(RandomMapKind::Maze, 44), (RandomMapKind::City, 101)] {
        let mut shares = Vec::new();
        for seed in 0..20 {
            let grid = random(kind, None, seed);
            assert_eq!((grid.width(), grid.height()), (side, side));
            assert_eq!(
                StepSearch::new(&grid).components(&grid).sizes.len(),
                1,
                "{} in one piece",
                grid.name()
            );
            assert_eq!(grid, random(kind, None, seed));
            assert_ne!(grid, random(kind, None, seed + 1).named(grid.name()));
            shares.push(grid.free_count());
        }
        let (fewest, most) = (shares.iter().min().unwrap(), shares.iter().max().unwrap());
        assert!(fewest < most && *most < side * side, "{fewest} to {most} free cells");
    }
}

#[test]
fn perfect_mazes_have_one_path_between_any_two_cells_and_the_size_asked_for() {
    for (size, rooms) in [(5, 2), (33, 16), (34, 16), (128, 63)] {
        let grid = random(RandomMapKind::Perfect, Some(size), 1);
        assert_eq!((grid.width(), grid.height()), (size, size));
        // A tree on the rooms has one passage less than rooms; more free cells would close a loop.
        assert_eq!(grid.free_count(), 2 * rooms * rooms - 1);
        assert_eq!(StepSearch::new(&grid).components(&grid).sizes.len(), 1);
        let on_a_crossing = |cell: &Cell| cell.x.is_multiple_of(2) && cell.y.is_multiple_of(2);
        assert!(!grid.free_cells().any(|cell| on_a_crossing(&cell)), "walls are one cell thick");
        let at_the_edge =
            |cell: Cell| cell.x == 0 || cell.y == 0 || cell.x == size - 1 || cell.y == size - 1;
        assert!(!grid.free_cells().any(at_the_edge), "walls surround it");
    }
    for (kind, size) in [(RandomMapKind::Maze, 23), (RandomMapKind::City, 60)] {
        assert_eq!(random(kind, Some(size), 1).width(), size);
    }
}
