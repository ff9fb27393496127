//! Mazes of other programs on the command line: converted, checked, trained on and edited.

use std::path::Path;

use gdg::map::{Cell, FORMATS, load_map};
use serde_json::Value;

use super::ran::{SMALL, in_folder};

/// A maze of Gymnasium-Robotics.
const MAZE: &str =
    "[[1,1,1,1,1],\n [1,'r',0,0,1],\n [1,1,1,0,1],\n [1,'g',0,0,1],\n [1,1,1,1,1]]\n";

/// A folder with that maze.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("u.json"), MAZE).unwrap();
    folder
}

/// Runs the program, which must succeed; returns both of its outputs.
fn run(folder: &Path, args: &[&str]) -> (String, String) {
    let ran = in_folder(folder, args);
    ran.success();
    (ran.out, ran.err)
}

/// Returns the message with which the program refuses its arguments.
fn refusal(folder: &Path, args: &[&str]) -> String {
    in_folder(folder, args).refusal()
}

/// Trains for two updates; returns what the first record says of the map.
fn trained(folder: &Path, args: &[&str]) -> Value {
    let end = ["--no-ui", "--max-updates", "2", "--eval-tasks", "1"];
    let (records, _) =
        run(folder, &[args, &end, if args.contains(&"--resume") { &[] } else { &SMALL }].concat());
    let first: Value = serde_json::from_str(records.lines().next().unwrap()).unwrap();
    first["map"].clone()
}

#[test]
fn a_maze_is_converted_to_every_format_and_checked() {
    let folder = folder();
    let path = folder.path();
    let maze = load_map(&path.join("u.json")).unwrap();
    for format in &FORMATS {
        let name = format!("{}.{}", format.name, format.endings[0]);
        let (written, warnings) =
            run(path, &["maps", "convert", "u.json", &name, "--format", format.name]);
        assert!(written.contains(&name), "{written}");
        assert_eq!(warnings.contains("the file has no"), !format.loses.is_empty(), "{warnings}");
        run(path, &["maps", "convert", &name, "back.txt", "--overwrite"]);
        let read = load_map(&path.join("back.txt")).unwrap();
        let kept = |name: &str, cells: &[Cell]| {
            if format.loses.contains(name) { Vec::new() } else { cells.to_vec() }
        };
        let marks = (kept("starts", maze.starts()), kept("goals", maze.goals()));
        assert_eq!(read.named("u"), maze.with_marks(marks.0, marks.1), "{name}");
        let (facts, _) = run(path, &["check", &name]);
        assert!(facts.contains("size:       5 x 5") && facts.contains("free cells: 7"), "{facts}");
        assert_eq!(facts.contains("scenario: 1 task"), format.name == "mapf", "{facts}");
    }
    let refused = refusal(path, &["maps", "convert", "u.json", "ros.yaml"]);
    assert!(refused.contains("ros.pgm: the file already exists"), "{refused}");
    let refused = refusal(path, &["maps", "convert", "u.json", "u.json", "--overwrite"]);
    assert!(refused.contains("is used by this run and is not replaced"), "{refused}");
    let refused = refusal(path, &["maps", "convert", "u.json", "u.xyz"]);
    assert!(refused.contains("this ending says no format"), "{refused}");
}

#[test]
fn scale_and_goal_radius_are_kept_with_the_map() {
    let folder = folder();
    let path = folder.path();
    let scale = ["--cell", "8", "--margin", "2.5", "--goal-radius", "2"];
    let (facts, _) = run(path, &[&["check", "u.json"][..], &scale].concat());
    let expected = "scale:      8 cells a block, walls wider by 2.5, goals reached within 2";
    assert!(facts.contains("40 x 40") && facts.contains(expected), "{facts}");
    let begun = trained(path, &[&["u.json", "--save", "u.safetensors"][..], &scale].concat());
    for (name, value) in [
        ("width", 40.0),
        ("cells_per_block", 8.0),
        ("margin_cells", 2.5),
        ("goal_radius_cells", 2.0),
    ] {
        assert_eq!(begun[name].as_f64(), Some(value), "{name} of {begun}");
    }
    // A maze of the run's, with another wall, gets its scale.
    std::fs::write(path.join("v.json"), MAZE.replace("'g',0", "'g',1")).unwrap();
    assert_eq!(trained(path, &["--resume", "u.safetensors", "--edit-at", "2:v.json"]), begun);
    let refused = refusal(path, &["--no-ui", "--resume", "u.safetensors", "--cell", "4"]);
    assert!(refused.contains("a checkpoint contains its world and its scale"), "{refused}");
    let refused = refusal(path, &["--no-ui", "fetch-reach", "--method", "gdg", "--cell", "4"]);
    assert!(refused.contains("applies only to maps"), "{refused}");
    let refused = refusal(path, &["check", "u.json", "--goal-radius", "1000"]);
    assert!(refused.contains("a goal radius is from 0.1 to 100 cells"), "{refused}");
    let refused = refusal(path, &["check", "u.json", "--margin", "1"]);
    assert!(refused.contains("makes the start or goal in column 2, row 2 a wall"), "{refused}");
    let (_, warnings) = run(path, &[&["maps", "convert", "u.json", "u.map"][..], &scale].concat());
    assert!(warnings.contains("give --goal-radius 2 with it"), "{warnings}");
}

#[test]
fn agents_of_a_planner_are_marks_where_an_option_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let agents =
        "agents:\n- start: [0, 0]\n  goal: [1, 0]\nmap:\n  dimensions: [2, 1]\n  obstacles: []\n";
    std::fs::write(folder.path().join("a.yaml"), agents).unwrap();
    let (_, said) = run(folder.path(), &["maps", "convert", "a.yaml", "a.txt"]);
    assert!(said.contains("--scen a.yaml makes them starts and goals"), "{said}");
    let convert = ["maps", "convert", "a.yaml", "b.txt", "--scen", "a.yaml"];
    assert_eq!(run(folder.path(), &convert).1.matches("agents").count(), 0);
    assert_eq!(std::fs::read_to_string(folder.path().join("b.txt")).unwrap(), "SG\n");
}

#[test]
fn agents_of_a_planner_s_map_are_evaluated() {
    let folder = folder();
    let path = folder.path();
    run(path, &["maps", "convert", "u.json", "agents.yaml", "--format", "mapf"]);
    let args = ["agents.yaml", "--scen", "agents.yaml", "--no-ui", "--max-updates", "2"];
    let (records, _) = run(path, &[&args[..], &SMALL, &["--eval-tasks", "1"]].concat());
    let only = r#""distance_steps":4.0,"tasks":1,"#;
    assert!(
        records.lines().any(|line| line.contains("evaluation") && line.contains(only)),
        "{records}"
    );
}

#[test]
fn strict_checks_say_which_goals_and_starts_are_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let checked = |map: &str| {
        std::fs::write(folder.path().join("m.txt"), map).unwrap();
        let found = in_folder(folder.path(), &["check", "m.txt", "--strict"]);
        let faults = found.out.lines().filter_map(|line| line.strip_prefix("fault:"));
        (found.status, faults.map(|fault| fault.trim().to_owned()).collect::<Vec<_>>())
    };
    assert_eq!(checked("S...G\n"), (Some(0), Vec::new()));
    let apart = checked("S....\n#####\n.S#.G\n");
    assert_eq!(apart.0, Some(3));
    assert_eq!(
        apart.1,
        [
            "the goal G at column 5, row 3 cannot be reached from any start S",
            "the start S at column 1, row 1 reaches no goal G",
            "the start S at column 2, row 3 reaches no goal G",
        ]
    );
    let small = checked(".....\n#####\n.S###\n");
    let cut_off = "the start S at column 2, row 3 is cut off from the largest component, where tasks are drawn";
    assert_eq!(small, (Some(3), vec![cut_off.to_owned()]));
    let drawn = checked(".....\n#####\n..#.G\n");
    assert!(
        drawn.0 == Some(3)
            && drawn.1[0].ends_with("from the largest component, where agents start")
    );
    let (facts, _) = run(folder.path(), &["check", "m.txt"]);
    assert!(!facts.contains("fault:") && facts.contains("warning:"), "{facts}");
}
