//! Maps and scenarios: folders of valid and invalid files, properties of parsing and geometry, the
//! built-in maps.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gdg::env::{EnvSettings, Environment, PointMaze};
use gdg::job::Job;
use gdg::map::{
    self, Cell, Components, Diameter, Grid, PointSearch, RandomMapKind, ScenarioTask, parse_map,
    print_ascii, random,
};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn samples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maps")
}

fn folder(name: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(samples().join(name)).unwrap();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
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
            assert_eq!((tasks[0].start, tasks[0].goal), (Cell::new(0, 0), Cell::new(2, 2)));
        } else {
            let grid = map::load_map(&path).unwrap_or_else(|e| panic!("{e}"));
            assert!(grid.free_count() > 0);
        }
    }
}

#[test]
fn line_endings_and_byte_order_marks_do_not_matter() {
    let read = |name: &str| map::load_map(&samples().join("valid").join(name));
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
    let expected = samples().join("invalid-errors.txt");
    if std::env::var_os("UPDATE_EXPECTED").is_some() {
        fs::write(&expected, &report).unwrap();
    }
    let expected = fs::read_to_string(expected).unwrap();
    for (found, expected) in report.lines().zip(expected.lines()) {
        assert_eq!(found, expected);
    }
    assert_eq!(report.lines().count(), expected.lines().count());
}

/// Generates maps of up to `most` by `most` cells with at least one free cell.
pub fn grids(most: usize) -> impl Strategy<Value = Grid> {
    let cells = prop::collection::vec(prop::sample::select(b".#SGC".to_vec()), 1..=most * most);
    (1..=most, cells).prop_filter_map("a free cell", |(width, cells)| {
        let text: Vec<u8> =
            cells.chunks_exact(width).flat_map(|row| [row, b"\n"].concat()).collect();
        parse_map("random", &text).ok()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn parsing_any_bytes_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = parse_map("random", &bytes);
    }

    #[test]
    fn the_diameter_agrees_with_a_search_over_all_pairs(grid in grids(10)) {
        let mut search = PointSearch::new(&grid);
        let components = Components::of(&grid);
        let all: Vec<[f32; 2]> = components.largest_cells(&grid).map(Cell::centre).collect();
        let mut steps = |goal: [f32; 2]| all.iter().copied().map(search.steps_to(goal)).collect();
        let from: Vec<Vec<u32>> = all.iter().map(|goal| steps(*goal)).collect();
        let diameter = Diameter::within(usize::MAX, &grid, &components, &Job::default());
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
        let components = Components::of(&grid);
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
fn random_maps_are_connected_and_reproducible_and_differ_by_seed() {
    for (kind, side) in
        [(RandomMapKind::Maze, 44), (RandomMapKind::City, 101), (RandomMapKind::Perfect, 33)]
    {
        for seed in 0..20 {
            let grid = random(kind, None, seed);
            assert_eq!((grid.width(), grid.height()), (side, side));
            assert_eq!(Components::of(&grid).sizes.len(), 1, "{}", grid.name());
            assert_eq!(grid, random(kind, None, seed));
            assert_ne!(grid, random(kind, None, seed + 1).named(grid.name()));
        }
        assert_eq!(random(kind, Some(60), 1).width(), 60);
    }
    for (size, rooms) in [(5, 2), (33, 16), (34, 16), (128, 63)] {
        let grid = random(RandomMapKind::Perfect, Some(size), 1);
        // A tree on the rooms has one passage less than rooms; more free cells would close a loop.
        assert_eq!(grid.free_count(), 2 * rooms * rooms - 1);
        assert_eq!(Components::of(&grid).sizes.len(), 1);
    }
}
