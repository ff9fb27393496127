//! Mazes of other programs: each format's samples are the same map, and what is written is read.

use std::path::Path;

use gdg::map::{FORMATS, Grid, load_map, parse_map};
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
        (&["d4rl.txt", "d4rl-source.py", "d4rl-bare"], maze(&['C'])),
        (
            &[
                "digits.txt",
                "digits-one-line.txt",
                "numbers-numpy.txt",
                "numbers-trailing-comma.csv",
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

/// Generates maps of up to 12 by 12 cells with a free cell.
fn grids() -> impl Strategy<Value = Grid> {
    let cells = prop::collection::vec(prop::sample::select(b".#SGC".to_vec()), 1..=144);
    (1usize..=12, cells).prop_filter_map("a free cell", |(width, cells)| {
        let text: Vec<u8> =
            cells.chunks_exact(width).flat_map(|row| [row, b"\n"].concat()).collect();
        parse_map("random", &text).ok()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_in_a_format_is_read(grid in grids()) {
        for format in &FORMATS {
            let file = format!("random.{}", format.endings[0]);
            let read = parse_map(&file, &format.write(&grid)).unwrap();
            let starts = if format.loses.contains("starts") { &[] } else { grid.starts() };
            let goals = if format.loses.contains("goals") { &[] } else { grid.goals() };
            prop_assert_eq!(read, grid.with_marks(starts.to_vec(), goals.to_vec()), "{}", format.name);
        }
    }

    #[test]
    fn parsing_what_resembles_a_format_never_panics(
        text in r#"(A = )?["\[1#-][0-9rgc,#O '"\[\]\n\\{}:&*-]{0,60}"#,
    ) {
        if let Err(error) = parse_map("random", text.as_bytes()) {
            prop_assert!(!error.help.is_empty());
        }
    }
}
