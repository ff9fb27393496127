//! Checks that the code follows the layout drawn in `crates/gdg/src/lib.rs` and `src/lib.rs`.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

mod imports;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use imports::{Crate, Name};

/// The library's modules: each depends only on those before it.
const LIBRARY: [&str; 15] = [
    "text", "printing", "faults", "job", "files", "store", "settings", "map", "env", "learn",
    "bridge", "train", "engine", "draw", "viewer",
];

/// The program's modules: each depends only on those before it, and on the library.
const PROGRAM: [&str; 7] = ["host", "figure", "headless", "experiment", "tui", "cli", "commands"];

/// Modules that work with states, goals and actions, and do not depend on maps.
const MAP_FREE_MODULES: [&str; 4] = ["learn", "bridge", "train", "engine"];

/// The most lines that each room may have: a room that grows gives something up elsewhere. A room is a
/// module with its folder, tests in it included.
const ROOMS: [(&str, usize); 28] = [
    ("crates/gdg/src/text", 600),
    ("crates/gdg/src/printing", 350),
    ("crates/gdg/src/faults", 140),
    ("crates/gdg/src/job", 350),
    ("crates/gdg/src/files", 1_200),
    ("crates/gdg/src/store", 350),
    ("crates/gdg/src/settings", 500),
    ("crates/gdg/src/map", 4_950),
    ("crates/gdg/src/env", 6_850),
    ("crates/gdg/src/learn", 10_700),
    ("crates/gdg/src/bridge", 4_000),
    ("crates/gdg/src/train", 8_150),
    ("crates/gdg/src/engine", 1_500),
    ("crates/gdg/src/draw", 800),
    ("crates/gdg/src/viewer", 2_300),
    ("crates/gdg/src/lib", 110),
    ("src/host", 1_450),
    ("src/figure", 1_100),
    ("src/headless", 1_100),
    ("src/experiment", 6_250),
    ("src/tui", 24_700),
    ("src/cli", 1_350),
    ("src/commands", 1_150),
    ("src/lib", 40),
    ("src/main", 60),
    ("crates/gdg/tests", 2_450),
    ("examples", 500),
    ("benches", 1_250),
];

/// The only folder with unsafe code.
const UNSAFE_FOLDER: &str = "learn/kernels";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Reads both crates, with the order of their modules.
fn crates() -> [(Crate, &'static [&'static str]); 2] {
    [
        (Crate::read(&root().join("crates/gdg/src")), &LIBRARY),
        (Crate::read(&root().join("src")), &PROGRAM),
    ]
}

#[test]
fn modules_depend_only_on_those_before_them() {
    for (modules, layers) in crates() {
        let layer =
            |name: &Name| name.first().map(|first| layers.iter().position(|layer| layer == first));
        for (name, module) in &modules.0 {
            assert!(layer(name) != Some(None), "{} has no layer", module.file.display());
        }
        let arrows = modules.arrows();
        assert!(arrows.len() > 100, "only {} imports were found", arrows.len());
        for ((from, to), paths) in arrows {
            if let (Some(own), Some(other)) = (layer(&from), layer(&to)) {
                assert!(
                    other <= own,
                    "{} uses {}: {}",
                    from.join("::"),
                    to.join("::"),
                    paths.join(", ")
                );
            }
        }
    }
}

/// The table of commands, whose rows name the functions that carry them out: those lie above what
/// reads names and keys from the table.
const COMMANDS: [&str; 2] = ["tui", "action"];

/// Within a module, its parts, each with all that is inside it, form no circle either.
#[test]
fn parts_of_a_module_form_no_circle() {
    for (modules, _) in crates() {
        let mut parts: BTreeMap<Name, BTreeMap<String, BTreeSet<String>>> = BTreeMap::new();
        for (from, to) in modules.arrows().into_keys() {
            if from.starts_with(&COMMANDS.map(str::to_owned)) {
                continue;
            }
            let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
            if common < from.len() && common < to.len() {
                let uses = parts.entry(from[..common].to_vec()).or_default();
                uses.entry(from[common].clone()).or_default().insert(to[common].clone());
            }
        }
        for (module, uses) in parts {
            let circle = circle(&uses);
            assert!(circle.is_empty(), "a circle in {}: {}", module.join("::"), circle.join(", "));
        }
    }
}

/// Returns the parts that use each other, directly or through others: what is left when all that
/// use nothing else are taken away, again and again, and then all that nothing uses.
fn circle(uses: &BTreeMap<String, BTreeSet<String>>) -> Vec<String> {
    let mut left: BTreeSet<&String> = uses.keys().collect();
    loop {
        let uses_left = |part: &String| uses[part].iter().any(|used| left.contains(used));
        let used_by_left = |part: &String| left.iter().any(|user| uses[*user].contains(part));
        let kept: BTreeSet<&String> =
            left.iter().copied().filter(|part| uses_left(part) && used_by_left(part)).collect();
        if kept.len() == left.len() {
            return kept.into_iter().cloned().collect();
        }
        left = kept;
    }
}

#[test]
fn circles_are_found() {
    let uses = |pairs: &[(&str, &str)]| {
        let mut uses: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (from, to) in pairs {
            uses.entry((*from).to_owned()).or_default().insert((*to).to_owned());
        }
        circle(&uses)
    };
    assert!(uses(&[("a", "b"), ("b", "c"), ("a", "c")]).is_empty());
    assert_eq!(
        uses(&[("x", "a"), ("a", "b"), ("b", "c"), ("c", "a"), ("b", "y")]),
        ["a", "b", "c"]
    );
}

#[test]
fn learner_bridges_and_trainer_do_not_depend_on_maps() {
    let (library, _) = &crates()[0];
    for ((from, to), paths) in library.arrows() {
        let is_map = to.first().is_some_and(|first| first == "map")
            || to.starts_with(&["env".into(), "maze".into()]);
        let is_free = from.first().is_some_and(|first| MAP_FREE_MODULES.contains(&first.as_str()));
        assert!(
            !(is_map && is_free),
            "{} uses {}: {}",
            from.join("::"),
            to.join("::"),
            paths.join(", ")
        );
    }
}

#[test]
fn only_the_kernels_contain_unsafe_code() {
    for (modules, _) in crates() {
        for module in modules.0.values() {
            let text = std::fs::read_to_string(&module.file).unwrap();
            let is_unsafe = text.contains("allow(unsafe_code)") || text.contains("unsafe {");
            assert!(
                !is_unsafe || module.file.to_string_lossy().contains(UNSAFE_FOLDER),
                "{}",
                module.file.display()
            );
        }
    }
}

fn lines_in(path: &Path) -> usize {
    if path.is_dir() {
        let entries = std::fs::read_dir(path).unwrap();
        return entries.map(|entry| lines_in(&entry.unwrap().path())).sum();
    }
    let is_code = path.extension().is_some_and(|end| end == "rs") || path.ends_with("worker.py");
    if is_code { std::fs::read_to_string(path).map_or(0, |text| text.lines().count()) } else { 0 }
}

#[test]
fn no_room_has_more_lines_than_it_may() {
    let lines = |room: &str| {
        lines_in(&root().join(room)) + lines_in(&root().join(room).with_added_extension("rs"))
    };
    for (room, most) in ROOMS {
        let own = lines(room);
        assert!(own <= most, "{room} has {own} lines, and may have {most}: what can go?");
    }
    // Every file is in a room.
    let folders = ["src", "crates/gdg/src", "crates/gdg/tests", "examples", "benches"];
    let all: usize = folders.iter().map(|folder| lines_in(&root().join(folder))).sum();
    assert_eq!(ROOMS.iter().map(|(room, _)| lines(room)).sum::<usize>(), all);
}
