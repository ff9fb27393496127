//! Checks that the code follows the module layout drawn in `src/lib.rs`.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use std::path::{Path, PathBuf};

/// Modules from the lowest layer to the highest; modules of the same layer may depend on each other.
const LAYERS: [&[&str]; 9] = [
    &["text", "printing", "pulse", "faults", "files", "store"],
    &["map"],
    &["env"],
    &["learn"],
    &["bridge"],
    &["train"],
    &["engine"],
    &["view"],
    &[
        "cli",
        "experiment",
        "export_policy",
        "facts",
        "film",
        "frames",
        "headless",
        "lib",
        "logging",
        "main",
        "report",
        "runs",
        "setup",
        "signals",
        "tui",
        "waiting",
    ],
];

/// Modules that work with states, goals and actions, and do not depend on maps.
const MAP_FREE_MODULES: [&str; 4] = ["learn", "bridge", "train", "engine"];

/// Identifiers that only modules with access to maps use.
const MAP_TYPES: [&str; 10] = [
    "Grid",
    "Cell",
    "PointMaze",
    "MazeScene",
    "StepSearch",
    "Diameter",
    "Flood",
    "HalfCells",
    "PointSearch",
    "ScenarioTask",
];

/// Returns every source file and the top-level module that it belongs to.
fn sources() -> Vec<(String, PathBuf)> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut found = Vec::new();
    walk(&src, &mut found);
    let module = |path: &Path| {
        let first = path.strip_prefix(&src).unwrap().components().next().unwrap().as_os_str().to_str().unwrap();
        first.trim_end_matches(".rs").to_owned()
    };
    found.into_iter().map(|path| (module(&path), path)).collect()
}

/// Returns the code of a file without comments and tests.
fn code(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    code.lines().filter(|line| !line.trim_start().starts_with("//")).map(|line| format!("{line}\n")).collect()
}

/// Returns the top-level modules that `code` names.
fn named(code: &str) -> impl Iterator<Item = &str> {
    code.split("crate::").skip(1).flat_map(|rest| {
        let end = |text: &str| text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
        match rest.strip_prefix('{') {
            // use crate::{a, b::c}
            Some(list) => {
                let list = list.split(';').next().unwrap_or_default();
                list.split(',').map(str::trim).map(|part| &part[..end(part)]).collect::<Vec<_>>()
            }
            None => vec![&rest[..end(rest)]],
        }
    })
}

#[test]
fn modules_depend_only_on_lower_layers() {
    let layer = |module: &str| LAYERS.iter().position(|layer| layer.contains(&module));
    let mut seen = 0;
    for (module, path) in sources() {
        let own = layer(&module).unwrap_or_else(|| panic!("{module} has no layer"));
        // The tests of the interface are in separate files.
        if path.components().any(|part| part.as_os_str() == "tests") || path.ends_with("tests.rs") {
            continue;
        }
        for other in named(&code(&path)).filter_map(layer) {
            assert!(other <= own, "{} depends on layer {other}, above its own layer {own}", path.display());
            seen += 1;
        }
    }
    assert!(seen > 200, "only {seen} imports were found");
}

#[test]
fn learner_bridges_and_trainer_do_not_depend_on_maps() {
    for (module, path) in sources().into_iter().filter(|(module, _)| MAP_FREE_MODULES.contains(&module.as_str())) {
        let code = code(&path);
        assert!(named(&code).all(|other| other != "map"), "{module}: {} depends on map", path.display());
        let mut words = code.split(|c: char| !c.is_alphanumeric() && c != '_');
        let found = words.find(|word| MAP_TYPES.contains(word));
        assert!(found.is_none(), "{module}: {} mentions {}", path.display(), found.unwrap_or_default());
    }
}

#[test]
fn only_front_ends_render_errors() {
    let front = LAYERS[LAYERS.len() - 1];
    for (module, path) in sources().into_iter().filter(|(module, _)| !front.contains(&module.as_str())) {
        assert!(!code(&path).contains("miette"), "{module}: {} renders errors", path.display());
    }
}
