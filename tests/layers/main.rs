//! Checks that the code follows the layout drawn in `crates/gdg/src/lib.rs` and `src/lib.rs`.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

mod imports;
mod links;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use imports::{Crate, Name};

/// A room: a module with its folder, and the most lines that it may have, tests in it included. A room
/// that grows gives something up elsewhere.
type Room = (&'static str, usize);

/// The library's modules: each depends only on those before it.
const LIBRARY: [Room; 15] = [
    ("text", 482),
    ("printing", 294),
    ("faults", 124),
    ("job", 358),
    ("files", 891),
    ("store", 268),
    ("settings", 392),
    ("map", 3_751),
    ("env", 6_546),
    ("learn", 8_823),
    ("bridge", 4_007),
    ("train", 6_982),
    ("engine", 1_212),
    ("draw", 810),
    ("viewer", 1_670),
];

/// The program's modules: each depends only on those before it, and on the library.
const PROGRAM: [Room; 8] = [
    ("process", 667),
    ("setup", 869),
    ("figure", 855),
    ("headless", 966),
    ("experiment", 5_693),
    ("tui", 19_327),
    ("cli", 601),
    ("commands", 1_003),
];

/// What lies beside the modules.
const OTHERS: [Room; 6] = [
    ("crates/gdg/src/lib", 103),
    ("src/lib", 26),
    ("src/main", 57),
    ("crates/gdg/tests", 2_017),
    ("examples", 257),
    ("benches", 295),
];

/// Modules that work with states, goals and actions, and do not depend on maps.
const MAP_FREE_MODULES: [&str; 4] = ["learn", "bridge", "train", "engine"];

/// The only folder with unsafe code.
const UNSAFE_FOLDER: &str = "learn/kernels";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Reads both crates, with the order of their modules.
fn crates() -> [(Crate, &'static [Room]); 2] {
    [
        (Crate::read(&root().join("crates/gdg/src")), &LIBRARY),
        (Crate::read(&root().join("src")), &PROGRAM),
    ]
}

#[test]
fn modules_depend_only_on_those_before_them() {
    for (modules, layers) in crates() {
        let layer = |name: &Name| {
            name.first().map(|first| layers.iter().position(|(layer, _)| layer == first))
        };
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
    let lines = |room: &Path| lines_in(room) + lines_in(&room.with_added_extension("rs"));
    let rooms = [("crates/gdg/src", &LIBRARY[..]), ("src", &PROGRAM), ("", &OTHERS)];
    let rooms =
        rooms.iter().flat_map(|(folder, rooms)| rooms.iter().map(move |room| (folder, room)));
    let mut sum = 0;
    for (folder, (room, most)) in rooms {
        let own = lines(&root().join(folder).join(room));
        assert!(own <= *most, "{room} has {own} lines, and may have {most}: what can go?");
        sum += own;
    }
    // Every file is in a room.
    let folders = ["src", "crates/gdg/src", "crates/gdg/tests", "examples", "benches"];
    let all: usize = folders.iter().map(|folder| lines_in(&root().join(folder))).sum();
    assert_eq!(sum, all);
}

/// The ways in the documents lead through few rooms, and to every file from one before, of the same
/// crate, that uses it or is used by it.
#[test]
fn the_ways_of_steps_updates_keys_and_pixels_lead_from_file_to_file_through_few_rooms() {
    let text = std::fs::read_to_string(root().join("docs/developing.md")).unwrap();
    let ways: Vec<&str> =
        text.split("\n## ").filter(|part| part.starts_with("The way of")).collect();
    assert_eq!(ways.len(), 4);
    let crates = crates().map(|(modules, _)| (modules.arrows(), modules));
    for way in ways {
        let title = way.lines().next().unwrap_or_default();
        let named = way.split('`').skip(1).step_by(2);
        let is_file = |name: &&str| Path::new(name).extension().is_some_and(|end| end == "rs");
        let files = named.filter(|name| is_file(name) || name.ends_with('/'));
        let (mut rooms, mut before) = (BTreeSet::new(), crates.each_ref().map(|_| Vec::new()));
        for file in files {
            let folder = file.split("NAME").next().unwrap_or_default();
            let places = ["", "crates/gdg/src", "src/tui"];
            let found = places.map(|place| root().join(place).join(folder));
            let found = found.iter().find(|place| place.exists());
            let found = found.unwrap_or_else(|| panic!("{title}: there is no {file}"));
            let own = found.strip_prefix(root()).unwrap();
            let own = own.strip_prefix("crates/gdg").unwrap_or(own).strip_prefix("src").unwrap();
            let room = own.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
            rooms.insert(room.trim_end_matches(".rs").to_owned());
            for ((arrows, modules), before) in crates.iter().zip(&mut before) {
                let module = modules.0.iter().find(|(_, module)| module.file == *found);
                let Some((own, _)) = module else { continue };
                let uses =
                    |from: &Name, to: &Name| arrows.contains_key(&(from.clone(), to.clone()));
                let is_next = |other: &&Name| uses(other, own) || uses(own, other) || *other == own;
                assert!(
                    before.is_empty() || before.iter().any(is_next),
                    "{title}: what leads to {file}?"
                );
                before.push(own);
            }
        }
        assert!((1..=6).contains(&rooms.len()), "{title}: {rooms:?}");
    }
}
