//! Maps and scenarios: folders of valid and invalid files, properties of parsing and geometry, the
//! built-in maps.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::support::rng;
use gdg::env::{EnvSettings, Environment, Evaluated, PointMaze};
use gdg::job::Job;
use gdg::map::{
    Cell, Components, Diameter, FORMATS, Grid, MapScale, PointSearch, RandomMapKind, Reading,
    ScenarioTask, load_map, load_map_as, load_map_like, lost_from, parse_map, print_ascii, random,
    read_scenario,
};
use proptest::prelude::*;

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
            let tasks = read_scenario(&path)
                .and_then(|read| read.tasks(&plain()))
                .unwrap_or_else(|e| panic!("{e}"));
            assert_eq!((tasks[0].start, tasks[0].goal), (Cell::new(0, 0), Cell::new(2, 2)));
        } else {
            let grid = load_map(&path).unwrap_or_else(|e| panic!("{e}"));
            assert!(grid.free_count() > 0);
        }
    }
    let lost = |name: &str| lost_from(&samples().join("valid").join(name), &plain()).unwrap();
    assert!(lost("ros.yaml").starts_with("resolution") && lost("one-cell.txt").contains("1 x 1"));
}

#[test]
fn line_endings_and_byte_order_marks_do_not_matter() {
    let read = |name: &str| load_map(&samples().join("valid").join(name));
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
            read_scenario(&path).and_then(|read| read.tasks(&plain())).map(|_| ()).expect_err(&name)
        } else {
            load_map(&path).map(|_| ()).expect_err(&name)
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
    assert_eq!(report.lines().collect::<Vec<_>>(), expected.lines().collect::<Vec<_>>());
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

    /// What a format has no place for is what it says.
    #[test]
    fn what_is_written_in_a_format_is_read(grid in grids(12)) {
        let folder = tempfile::tempdir().unwrap();
        for (format, ending) in FORMATS.iter().flat_map(|f| f.endings.iter().map(move |e| (f, e))) {
            let file = folder.path().join("random").with_extension(ending);
            for (path, bytes) in format.write(&grid, &file) {
                std::fs::write(path, bytes).unwrap();
            }
            // Of the formats in YAML, the content says which it is.
            let read = load_map(&file).unwrap_or_else(|error| panic!("{error}"));
            prop_assert!(lost_from(&file, &grid).is_none() || format.name == "mapf");
            std::fs::remove_file(&file).unwrap();
            let lost = format.lost(&grid);
            let kept = |name, cells: &[Cell]| if lost.contains(&name) { Vec::new() } else { cells.to_vec() };
            let expected = grid.with_marks(kept("starts", grid.starts()), kept("goals", grid.goals()));
            prop_assert_eq!(&read, &expected, "{} in {}", format.name, ending);
        }
    }

    #[test]
    fn parsing_what_resembles_a_format_never_panics(
        text in r#"(A = |P[2356] |<map |image: a\nresolution: |map:\n dimensions: \[1, 2\]\n obstacles: )?["\[1#-][0-9rgc,#O '"\[\]\n\\{}:&*-]{0,60}"#,
    ) {
        if let Err(error) = parse_map("random", text.as_bytes()) {
            prop_assert!(!error.help.is_empty());
        }
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
        let mut rng = rng(seed);
        let mut world = PointMaze::new(grid.clone(), 2);
        world.configure(&EnvSettings { noise: 0.3, ..EnvSettings::default() });
        world.restart(0, &mut rng).unwrap();
        world.restart(1, &mut rng).unwrap();
        let components = Components::of(&grid);
        let component = |x: f32, y: f32| components.of_cell[grid.index(Cell::new(x as usize, y as usize))];
        for action in actions.chunks_exact(4) {
            let before: Vec<f32> = world.states().to_vec();
            world.step(action, &mut rng).unwrap();
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
    let mut rng = rng(1);
    let mut world = PointMaze::new(grid, 1);
    world.set_full_state(0, &[0.5, 0.5]).unwrap();
    world.step(&[1.0, 1.0], &mut rng).unwrap();
    let at = world.states();
    assert!((at[0] - 1.5).abs() < 1e-3, "it slides to the right: {at:?}");
    assert!(at[1] < 1.0, "the wall holds: {at:?}");
    world.set_full_state(0, &[1.5, 1.4]).unwrap();
    assert_eq!(world.states(), [1.5, 0.5]);
}

#[test]
fn a_scenario_stays_on_an_edited_map_and_not_on_one_of_another_size() {
    let map = |text: &str| Arc::new(parse_map("map", text.as_bytes()).unwrap());
    let mut maze = PointMaze::new(map("....\n....\n"), 0);
    let task =
        ScenarioTask { start: Cell::new(0, 0), goal: Cell::new(3, 1), optimal_octile: Some(3.4) };
    maze.set_scenario(vec![task]);
    let tasks = |maze: &PointMaze| Evaluated::tasks(maze, 1, &mut rng(1)).unwrap().tasks;
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

/// The maze of all samples.
const MAZE: &str = "#####\n#S..#\n###.#\n#G.C#\n#####\n";

/// Returns the maze without what a format lacks.
fn maze(without: &[char]) -> Grid {
    let text: String = MAZE.chars().map(|c| if without.contains(&c) { '.' } else { c }).collect();
    parse_map("maze", text.as_bytes()).unwrap()
}

fn sample(name: &str) -> Grid {
    load_map(&samples().join("valid").join(name))
        .unwrap_or_else(|error| panic!("{error}: {}", error.help))
}

#[test]
fn samples_of_each_format_are_the_same_maze() {
    for (names, expected) in [
        (&["list.json", "list-gymnasium.py", "list-ogbench-crlf.txt"][..], maze(&[])),
        (&["colours.png", "palette.png", "image-p6.ppm"], maze(&[])),
        (&["tiled.tmx", "tiled-two-layers.tmx", "tiled-objects.tmx"], maze(&[])),
        (&["d4rl.txt", "d4rl-source.py", "d4rl-bare"], maze(&['C'])),
        (
            &[
                "digits.txt",
                "numbers-numpy.txt",
                "numbers-padded-trailing-comma.csv",
                "numbers-savetxt.txt",
                "grey-alpha.png",
                "grey16.png",
                "one-bit.png",
                "image-p5.pgm",
                "image-p5-16-bit.pgm",
                "image-p2.pgm",
                "image-p2-comments.pgm",
                "image-p5-comment.pgm",
                "ros.yaml",
                "ros-negate.yaml",
                "ros-scale.yaml",
                "ros-raw.yaml",
                "mapf.yaml",
                "mapf-tuples.yaml",
            ],
            maze(&['S', 'G', 'C']),
        ),
    ] {
        for name in names {
            assert_eq!(sample(name).named("maze"), expected, "{name}");
        }
    }
    // An empty cell of Tiled is -1, and 0 its first tile.
    let tiled = "#####\n#...#\n###.#\n#...#\n#####\n";
    let tiled = parse_map("maze", tiled.as_bytes()).unwrap();
    assert_eq!(sample("numbers-tiled.csv").named("maze"), tiled);
}

#[test]
fn agents_of_a_planner_s_map_are_tasks_on_it_at_any_scale() {
    let file = samples().join("valid/mapf.yaml");
    let scale = MapScale { cell: 4, margin: 1.5, goal_radius: 2.0, benchmark: None };
    let map = load_map_as(&file, &Reading { scale, ..Reading::default() }).unwrap();
    assert_eq!((map.width(), map.height(), map.scale()), (20, 20, scale));
    for (map, to) in [(maze(&['S', 'G', 'C']), 1_usize), (map, 4)] {
        let tasks = read_scenario(&file).and_then(|read| read.tasks(&map)).unwrap();
        let cells: Vec<[Cell; 2]> = tasks.iter().map(|task| [task.start, task.goal]).collect();
        let at = |x, y| Cell::new(to * x + to / 2, to * y + to / 2);
        assert_eq!(cells, [[at(1, 1), at(3, 3)], [at(3, 2), at(1, 3)]]);
    }
}

#[test]
fn the_threshold_says_which_pixels_are_walls() {
    let file = samples().join("valid/grey16.png");
    let free = |threshold| {
        load_map_as(&file, &Reading { threshold, ..Reading::default() }).map(|map| map.free_count())
    };
    assert_eq!((free(0.05).unwrap(), free(0.5).unwrap()), (25, 7));
    assert!(free(0.9).unwrap_err().help.contains("--threshold"));
}

#[test]
fn an_edited_maze_gets_the_scale_of_the_run_and_an_enlarged_one_keeps_its_cells() {
    let folder = tempfile::tempdir().unwrap();
    let scale = MapScale { cell: 3, margin: 1.0, goal_radius: 2.0, benchmark: None };
    let run = scale.of("maze", &maze(&[])).unwrap();
    let like = |text: &str| {
        let path = folder.path().join("maze.txt");
        std::fs::write(&path, text).unwrap();
        load_map_like(&path, &run, 0.5).unwrap().named("maze")
    };
    assert_eq!([like(MAZE), like(&print_ascii(&run))], [run.clone(), run.clone()]);
    let other = like("...\n");
    assert_eq!((other.width(), other.scale()), (3, MapScale::default()));
}

#[test]
fn plain_maps_may_end_in_map_and_broken_headers_are_still_named() {
    let read = |text: &str| parse_map("maze.map", text.as_bytes());
    let plain = read("S.#\n..G\n").expect("a plain map");
    assert_eq!((plain.starts().len(), plain.goals().len(), plain.free_count()), (1, 1, 5));
    let error = read("height 2\nwidth 2\nmap\n..\n..\n").expect_err("no type");
    assert!(error.problem.contains("type octile"), "{error}");
}
