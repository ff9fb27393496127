//! Mazes of other programs: each format's samples are the same map, and what is written is read.

use std::path::Path;

use crate::maps::grids;
use gdg::map::{
    Cell, FORMATS, Grid, MapScale, Reading, load_map, load_map_as, load_map_like, load_scenario,
    parse_map, print_ascii,
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
    fn what_is_written_in_a_format_is_read(grid in grids(12)) {
        let folder = tempfile::tempdir().unwrap();
        for (format, ending) in FORMATS.iter().flat_map(|f| f.endings.iter().map(move |e| (f, e))) {
            let file = folder.path().join("random").with_extension(ending);
            for (path, bytes) in format.write(&grid, &file) {
                std::fs::write(path, bytes).unwrap();
            }
            // Of the formats in YAML, the content says which it is.
            let read = load_map(&file).unwrap_or_else(|error| panic!("{error}"));
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
}

#[test]
fn plain_maps_may_end_in_map_and_broken_headers_are_still_named() {
    let read = |text: &str| parse_map("maze.map", text.as_bytes());
    let plain = read("S.#\n..G\n").expect("a plain map");
    assert_eq!((plain.starts().len(), plain.goals().len(), plain.free_count()), (1, 1, 5));
    let error = read("height 2\nwidth 2\nmap\n..\n..\n").expect_err("no type");
    assert!(error.problem.contains("type octile"), "{error}");
}
