//! Mazes of other programs: each format's samples are the same map, and what is written is read.

use std::path::Path;

use crate::maps::grids;
use gdg::map::{
    Cell, FORMATS, Grid, MapFormat, MapScale, Reading, Scenario, StepSearch, load_map, load_map_as,
    load_map_like, load_scenario, parse_map, print_ascii,
};
use proptest::prelude::*;

/// The maze of all samples.
const MAZE: &str = "#####\n#S..#\n###.#\n#G.C#\n#####\n";

/// Returns the maze without what a format lacks.
fn maze(without: &[char]) -> Grid {
    let text: String = MAZE.chars().map(|c| if without.contains(&c) { '.' } else { c }).collect();
    parse_map("maze", text.as_bytes()).unwrap()
}

fn sample(name: &str) -> Grid {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maps/valid");
    load_map(&folder.join(name)).unwrap_or_else(|error| panic!("{error}: {}", error.help))
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
                "digits-one-line.txt",
                "numbers-numpy.txt",
                "numbers-trailing-comma.csv",
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
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maps/valid/mapf.yaml");
    let scale = MapScale { cell: 4, margin: 1.5, goal_radius: 2.0, benchmark: None };
    let map = load_map_as(&file, &Reading { scale, ..Reading::default() }).unwrap();
    assert_eq!((map.width(), map.height(), map.scale()), (20, 20, scale));
    for (map, to) in [(maze(&['S', 'G', 'C']), 1_usize), (map, 4)] {
        let tasks = load_scenario(&file, &map).unwrap();
        let cells: Vec<[Cell; 2]> = tasks.iter().map(|task| [task.start, task.goal]).collect();
        let at = |x, y| Cell::new(to * x + to / 2, to * y + to / 2);
        assert_eq!(cells, [[at(1, 1), at(3, 3)], [at(3, 2), at(1, 3)]]);
    }
}

#[test]
fn a_goal_radius_in_a_file_is_that_of_the_map_unless_another_is_given() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("maze.yaml");
    let text = "map:\n  dimensions: [3, 1]\n  obstacles:\n  - [1, 0]\ngoal_radius: ";
    let read = |radius: &str, reading: &Reading| {
        std::fs::write(&file, format!("{text}{radius}\n")).unwrap();
        load_map_as(&file, reading).map(|map| map.scale().goal_radius)
    };
    let usual = Reading::default();
    assert_eq!(read("0.5", &usual).ok(), Some(0.5));
    let scale = MapScale { cell: 4, ..usual.scale };
    assert_eq!(read("0.5", &Reading { scale, ..usual }).ok(), Some(2.0), "four cells are a block");
    assert_eq!(read("0.5", &Reading { goal_radius: Some(1.0), ..usual }).ok(), Some(1.0));
    for wrong in ["0", "-1", "wide", "[1]"] {
        let error = read(wrong, &usual).unwrap_err();
        assert_eq!(error.at, Some((5, 14)), "{error}");
    }
}

#[test]
fn what_a_comment_or_a_map_of_ros_says_is_that_of_the_map_and_faults_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, text: &str| {
        let file = folder.path().join(name);
        std::fs::write(&file, text).unwrap();
        load_map(&file).map(|map| map.named("maze"))
    };
    let list = |comment: &str| read("m.py", &format!("# {comment}\nMAZE = [[0, 0],\n [1, 0]]\n"));
    let map =
        list("by hand; gdg-tui: {margin: 0.5, cells_per_block: 4, starts: [[1, 1]]}").unwrap();
    assert_eq!((map.scale().cell, map.scale().margin), (4, 0.5));
    assert_eq!((map.starts(), map.goals()), (&[Cell::new(1, 1)][..], &[][..]));
    for (wrong, column) in [
        ("gdg-tui: {margin: -1}", 21),
        ("gdg-tui: {starts: [[0, 1]]}", 22),
        ("gdg-tui: {goals: [[2, 0]]}", 21),
        ("gdg-tui: {goals: 3}", 20),
        ("gdg-tui: {goals: [[0]]}", 21),
        ("gdg-tui: {", 12),
    ] {
        let error = list(wrong).unwrap_err();
        assert_eq!(error.at, Some((1, column)), "{wrong}: {error}");
    }
    assert!(list("gdg-tui is not asked here").unwrap().starts().is_empty());
    std::fs::write(folder.path().join("m.pgm"), b"P2 3 2 1\n1 1 1\n1 1 1\n").unwrap();
    let ros = "image: m.pgm\nresolution: 0.5\norigin: [-1, 2, 0]\n";
    let map =
        read("m.yaml", &format!("{ros}starts: [[0.4, 2.1]]\ngoals: [[-0.9, 2.9]]\n")).unwrap();
    assert_eq!((map.starts(), map.goals()), (&[Cell::new(2, 1)][..], &[Cell::new(0, 0)][..]));
    let error = read("m.yaml", &format!("{ros}starts: [[0.6, 2.1]]\n")).unwrap_err();
    assert_eq!(error.at, Some((4, 10)), "{error}");
}

#[test]
fn a_map_that_was_enlarged_is_not_enlarged_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("m.yaml");
    let text = "cells_per_block: 4\nmap:\n  dimensions: [8, 4]\n  obstacles:\n  - [1, 0]\n";
    std::fs::write(&file, text).unwrap();
    let map = load_map(&file).unwrap();
    assert_eq!((map.width(), map.scale().cell), (8, 4));
    let scale = MapScale { cell: 2, ..MapScale::default() };
    let error = load_map_as(&file, &Reading { scale, ..Reading::default() }).unwrap_err();
    assert!(error.problem.contains("a scale of its own"), "{error}");
}

#[test]
fn the_threshold_says_which_pixels_are_walls() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/maps/valid/grey16.png");
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

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// What a format has no place for is what it says.
    #[test]
    fn what_is_written_in_a_format_is_read(
        grid in grids(12),
        goal_radius in prop::sample::select(vec![1.0_f32, 0.3, 2.25]),
        cell in 1usize..3,
        margin in prop::sample::select(vec![0.0_f32, 0.7]),
    ) {
        let grid = grid.with_scale(MapScale { cell, margin, goal_radius, benchmark: None });
        for format in &FORMATS {
            for ending in format.endings {
                let folder = tempfile::tempdir().unwrap();
                let file = folder.path().join("random").with_extension(ending);
                for (path, bytes) in format.write(&grid, &file) {
                    std::fs::write(path, bytes).unwrap();
                }
                // Of the formats in YAML, the content says which it is.
                let read = load_map(&file).unwrap_or_else(|error| panic!("{error}"));
                let lost = format.lost(&grid, &file);
                let is_lost = |what: &str| lost.iter().any(|lost| lost.starts_with(what));
                let kept = |name, cells: &[Cell]| if is_lost(name) { Vec::new() } else { cells.to_vec() };
                let usual = MapScale::default();
                let scale = MapScale {
                    cell: if is_lost("cells per block") { usual.cell } else { cell },
                    margin: if is_lost("margin") { usual.margin } else { margin },
                    goal_radius: if is_lost("goal radius") { usual.goal_radius } else { goal_radius },
                    benchmark: None,
                };
                let (starts, goals) = (kept("starts", grid.starts()), kept("goals", grid.goals()));
                let expected = grid.with_marks(starts, goals).with_scale(scale);
                prop_assert_eq!(&read, &expected, "{} in {}", format.name, ending);
                let is_lossless = MapFormat::lossless().contains(&format.name) && *ending != "json";
                prop_assert!(!is_lossless || read == grid, "{} in {}", format.name, ending);
            }
        }
    }

    /// All starts and goals between which there are paths.
    #[test]
    fn the_scenario_beside_a_map_of_moving_ai_has_its_starts_and_goals(grid in grids(12)) {
        let grid = grid.with_scale(MapScale::default());
        let scenario = FORMATS.iter().find_map(|format| Scenario::beside(&grid, Path::new("random.map"), format));
        let Some((path, scenario)) = scenario else {
            let reaches = |start: &Cell| {
                let apart = grid.with_marks(vec![*start], grid.goals().to_vec());
                StepSearch::new(&apart).components(&apart)
            };
            let pairs = grid.starts().iter().zip(grid.goals());
            for (start, goal) in pairs {
                let of_cell = reaches(start).of_cell;
                prop_assert_ne!(of_cell[grid.index(*start)], of_cell[grid.index(*goal)]);
            }
            return Ok(());
        };
        prop_assert_eq!(path.as_path(), Path::new("random.scen"));
        let read = Scenario::parse("random.scen", scenario.print().as_bytes()).expect("a scenario");
        prop_assert!(read.other_map(&grid).is_none());
        let tasks = read.tasks(&grid).expect("tasks");
        read.check_lengths(&tasks, &grid).expect("lengths of shortest paths");
        let components = StepSearch::new(&grid).components(&grid).of_cell;
        if components.iter().flatten().all(|component| *component == 0) {
            let starts = tasks.iter().map(|task| task.start).collect();
            let goals = tasks.iter().map(|task| task.goal).collect();
            prop_assert_eq!(grid.with_marks(starts, goals), grid);
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
}

#[test]
fn plain_maps_may_end_in_map_and_broken_headers_are_still_named() {
    let read = |text: &str| parse_map("maze.map", text.as_bytes());
    let plain = read("S.#\n..G\n").expect("a plain map");
    assert_eq!((plain.starts().len(), plain.goals().len(), plain.free_count()), (1, 1, 5));
    let error = read("height 2\nwidth 2\nmap\n..\n..\n").expect_err("no type");
    assert!(error.problem.contains("type octile"), "{error}");
}

#[test]
fn what_tiled_never_writes_is_refused_before_it_takes_long() {
    let refused = |layer: &str| {
        let text = format!("<map width=\"1\" height=\"1\"><layer{layer}/></map>");
        parse_map("maze.tmx", text.as_bytes()).expect_err("no map").to_string()
    };
    let many =
        |attribute: &str| (0..=100).map(|i| attribute.replace('N', &i.to_string())).collect();
    let [attributes, names]: [String; 2] = [" aN='='", "><a xmlns:nN='n'/"].map(many);
    assert!(refused(&attributes).contains(":1:27: more than 100 attributes of one element"));
    assert!(refused(&names).contains("more than 100 namespaces"));
    let deep = format!("/>{}{}<layer", "<group>".repeat(101), "</group>".repeat(101));
    assert!(refused(&deep).contains("layers lie within more than 100 others"));
    assert!(refused(" a='====\"'").contains("this layer has no data"));
}
