//! Files of other programs.

use std::ffi::{OsStr, OsString};
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

use super::*;

/// A map of 8 x 3 cells whose middle row is almost all wall.
const ARENA: &str = "type octile\nheight 3\nwidth 8\nmap\n........\n.@@@@@@.\n........\n";

const SMALL: [&str; 10] = [
    "--max-updates",
    "2",
    "--eval-tasks",
    "1",
    "--set",
    "hidden=8",
    "--set",
    "learning_starts=100",
    "--set",
    "buffer_size=20000",
];

/// Arguments that need not be UTF-8.
fn run(folder: &Path, args: &[impl AsRef<OsStr>]) -> (i32, String, String) {
    outcome(isolated_command(folder).args(args))
}

/// Runs the program, which must refuse its arguments; returns the message without its line breaks.
fn refusal(folder: &Path, args: &[impl AsRef<OsStr> + std::fmt::Debug]) -> String {
    let (status, _, errors) = run(folder, args);
    assert_eq!(status, 2, "{args:?}: {errors}");
    one_line(&errors)
}

/// Returns words and further arguments, which need not be UTF-8.
fn with<'a>(words: &'a str, last: &[&'a OsStr]) -> Vec<&'a OsStr> {
    words.split(' ').map(OsStr::new).chain(last.iter().copied()).collect()
}

fn arena_with(name: &str, scenario: &str) -> tempfile::TempDir {
    let folder = folder();
    std::fs::write(folder.path().join("arena.map"), ARENA).unwrap();
    std::fs::write(folder.path().join(name), scenario).unwrap();
    folder
}

#[test]
fn scenarios_that_cannot_fit_are_refused_with_line_and_column() {
    for (task, place, what) in [
        (
            "arena.map\t3\t8\t2\t0\t0\t7\t5.0",
            "2:13",
            "3 x 8 cells does not fit arena, which has 8 x 3",
        ),
        (
            "arena.map\t16\t3\t0\t0\t10\t0\t10.0",
            "2:13",
            "16 x 3 cells does not fit arena, which has 8 x 3",
        ),
        ("arena.map\t9\t3\t0\t0\t5\t0\t5.0", "2:13", "9 x 3 cells does not fit arena"),
        ("arena.map\t8\t3\t1\t1\t1\t2\t3", "2:17", "the start (1, 1) is a wall of arena"),
    ] {
        let folder = arena_with("a.scen", &format!("version 1\n0\t{task}\n"));
        for args in [&["check", "a.scen"][..], &["--no-ui", "arena.map", "--scen", "a.scen"]] {
            let errors = refusal(folder.path(), args);
            assert!(
                errors.contains(&format!("a.scen:{place}")) && errors.contains(what),
                "{task}: {errors}"
            );
        }
    }
    let folder = arena_with("a.scen", "version 1\n0\tb.txt\t3\t1\t0\t0\t2\t0\t2\n");
    std::fs::write(folder.path().join("b.txt"), ".#.\n").unwrap();
    assert!(
        refusal(folder.path(), &["check", "a.scen"])
            .contains("no path leads from this start to this goal")
    );
}

#[test]
fn a_scenario_is_parsed_before_its_map_is_looked_for() {
    for (text, what) in [
        ("0\tarena.map\t8\t3\t0\t0\t5\t0\t5.0\n", "a.scen:1:1: not a scenario of version 1"),
        ("version 1\n", "a.scen:1:1: the scenario has no tasks"),
        ("version 1\n0\tnone.map\t8\t3\t0\t0\t5\n", "a.scen:2:1: 7 fields instead of 9"),
        (
            "version 1\n0\tmaps\\none.map\t8\t3\t0\t0\t5\t0\t5\n",
            "its map none.map is not in the same folder",
        ),
    ] {
        let folder = arena_with("a.scen", text);
        let errors = refusal(folder.path(), &["check", "a.scen"]);
        assert!(errors.contains(what), "{text:?}: {errors}");
    }
    let folder = folder();
    let endless = std::fs::File::create(folder.path().join("endless.scen")).unwrap();
    endless.set_len(1 << 40).unwrap();
    assert!(
        refusal(folder.path(), &["check", "endless.scen"]).contains("too large for a scenario")
    );
}

#[test]
fn scenarios_of_other_programs_find_their_map() {
    for text in [
        "version 1\n0 arena.map 8 3 0 0 5 0 5.0\n",
        "version 1\r\n0\tMaps\\dao\\arena.map\t8\t3\t0\t0\t5\t0\t5.0\r\n",
        "version 1\n0\tmaps/ARENA.MAP\t16\t6\t0\t0\t10\t0\t10.0\n",
        "VERSION 1.0\n0\tarena.map\t8\t3\t1\t0\t1\t2\t4\n",
    ] {
        let folder = arena_with("TASKS.SCEN", text);
        let (status, facts, errors) = run(folder.path(), &["check", "TASKS.SCEN"]);
        assert_eq!((status, errors.as_str()), (0, ""), "{text:?}");
        assert!(
            facts.contains("1 task") && facts.contains("arena") && !facts.contains("warning"),
            "{facts}"
        );
    }
    let folder = arena_with("other.scen", "version 1\n0\tother.map\t8\t3\t0\t0\t5\t0\t5.0\n");
    let warning = "line 2 is a task on other.map, but the map is arena";
    let (_, facts, _) = run(folder.path(), &["check", "other.scen", "--map", "arena.map"]);
    assert!(facts.contains(&format!("warning:    {warning}")), "{facts}");
    let args = [&["--no-ui", "arena.map", "--scen", "other.scen"][..], &SMALL].concat();
    let (status, _, errors) = run(folder.path(), &args);
    assert_eq!((status, errors), (0, format!("warning: other.scen: {warning}\n")));
}

#[test]
fn letters_that_mean_floor_elsewhere_are_refused_and_tiny_maps_warned_of() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    std::fs::write(folder.path().join("d4rl.txt"), "#####\n#GOO#\n###O#\n#OOO#\n#####\n").unwrap();
    let errors = refusal(folder.path(), &["check", "d4rl.txt"]);
    assert!(errors.contains("d4rl.txt:2:3") && errors.contains("a free cell"), "{errors}");
    std::fs::write(folder.path().join("maps/tiny.txt"), "###\n#G#\n###\n").unwrap();
    let train = [&["--no-ui", "maps/tiny.txt"][..], &SMALL].concat();
    for args in [&["check", "maps/tiny.txt"][..], &train, &["suite", "maps", "--list"]] {
        let (status, output, errors) = run(folder.path(), args);
        assert_eq!(status, 0, "{errors}");
        let all = output + &errors;
        assert!(all.contains("only 1 free cell") && all.contains("warning:"), "{args:?}: {all}");
    }
    // Moving AI's own walls are no reason to warn.
    std::fs::write(
        folder.path().join("own.map"),
        "type octile\nheight 2\nwidth 3\nmap\n...\n.OT\n",
    )
    .unwrap();
    std::fs::write(folder.path().join("own.txt"), "....\n.##.\n").unwrap();
    for file in ["own.map", "own.txt"] {
        assert!(!run(folder.path(), &["check", file]).1.contains("warning"), "{file}");
    }
    let session = Session::start(folder.path(), &["maps/tiny.txt"]);
    session.wait_for("only 1 free cell");
    session.signal("TERM");
    assert_eq!(session.end(), 143);
}

#[test]
fn every_reader_says_what_a_file_of_another_kind_is() {
    let folder = folder();
    let kinds: [(&[u8], &str, &str); 4] = [
        (
            b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 1\n",
            "a Git LFS pointer",
            "git lfs pull",
        ),
        (b"\xff\xfe{\0}\0", "text in UTF-16", "UTF-8"),
        (b"\x1f\x8b\x08\0\0\0\0\0\0\x03", "a compressed file or archive (GZIP)", "unpack it first"),
        (b"\x80\x02}q\0.", "a Python pickle", "give a|plain text"),
    ];
    let readers: [(&[&str], &str); 6] = [
        (&["check", "FILE"], "a map"),
        (&["--no-ui", "trap", "--edit-at", "1:FILE"], "a map"),
        (&["--no-ui", "trap", "--scen", "FILE"], "a scenario"),
        (&["--no-ui", "--resume", "FILE"], "a checkpoint"),
        (&["export-data", "FILE"], "a checkpoint"),
        (&["--no-ui", "--config", "FILE"], "a settings file"),
    ];
    for (bytes, kind, help) in kinds {
        std::fs::write(folder.path().join("FILE"), bytes).unwrap();
        for (args, wanted) in &readers {
            let errors = refusal(folder.path(), args);
            assert!(
                errors.contains(kind) && errors.contains(&format!("not {wanted}")),
                "{args:?}: {errors}"
            );
            assert!(help.split('|').any(|help| errors.contains(help)), "{args:?}: {errors}");
        }
    }
}

#[test]
fn the_interface_says_what_its_configuration_is_instead() {
    let folder = folder();
    std::fs::write(folder.path().join("ui.toml"), b"\xff\xfet\0h\0").unwrap();
    let mut session = Session::start(folder.path(), &["trap", "--ui-config", "ui.toml"]);
    session.wait_for("is text in UTF-16");
    assert_eq!(session.status(), 2);
}

#[test]
fn runs_leaves_out_what_is_no_checkpoint() {
    let folder = folder();
    let good = checkpoint(folder.path());
    let bytes = std::fs::read(&good).unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("CAPITALS.SAFETENSORS", &bytes);
    write(
        "pointer.safetensors",
        b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n",
    );
    write("empty.safetensors", b"");
    write("._small.safetensors", b"\0\x05\x16\x07\0\x02\0\0");
    let args = ["export-policy", "small.safetensors", "--out", "renamed.safetensors"];
    assert_eq!(run(folder.path(), &args).0, 0);
    let (status, table, errors) = run(folder.path(), &["runs", "."]);
    assert_eq!(status, 0);
    assert!(!table.contains("._"), "hidden: {table}");
    for (name, why) in [
        ("pointer", "is a Git LFS pointer"),
        ("empty", "is empty"),
        ("renamed", "is an exported policy, not a checkpoint"),
    ] {
        let line = errors.lines().find(|line| line.contains(name)).unwrap();
        assert!(line.contains("left out") && line.contains(why), "{line}");
        let args = ["--no-ui", "--resume", &format!("{name}.safetensors")];
        assert_eq!(run(folder.path(), &args).0, 2, "{name}");
    }
    for name in ["CAPITALS.SAFETENSORS", "small.safetensors"] {
        assert!(table.lines().any(|line| line.ends_with(name) && line.contains("350")), "{table}");
    }
}

#[test]
fn suites_skip_hidden_files_and_take_extensions_in_capitals() {
    let folder = folder();
    let maps = folder.path().join("maps");
    std::fs::create_dir(&maps).unwrap();
    std::fs::write(maps.join("good.map"), ARENA).unwrap();
    std::fs::write(maps.join("OTHER.MAP"), ARENA).unwrap();
    for name in ["._good.map", ".hidden.map", "._note.txt"] {
        std::fs::write(maps.join(name), b"\0\x05\x16\x07\0\x02\0\0Mac OS X").unwrap();
    }
    let (status, jobs, errors) = run(folder.path(), &["suite", "maps", "--list"]);
    assert_eq!((status, errors.as_str()), (0, ""));
    let names: Vec<&str> = jobs.lines().filter_map(|line| line.split_whitespace().nth(1)).collect();
    assert_eq!(names, ["OTHER", "good"]);
    let errors = refusal(folder.path(), &["check", "maps/._good.map"]);
    assert!(errors.contains("macOS") && errors.contains("without ._"), "{errors}");
}

#[test]
fn names_need_not_be_utf8() {
    let folder = folder();
    let name = OsStr::from_bytes(b"n\xe9.map");
    // Some file systems refuse such names.
    if std::fs::write(folder.path().join(name), ARENA).is_err() {
        return;
    }
    let scenario = OsStr::from_bytes(b"n\xe9.SCEN");
    std::fs::write(
        folder.path().join(scenario),
        "version 1\n0\tarena.map\t8\t3\t0\t0\t5\t0\t5.0\n",
    )
    .unwrap();
    let edit = OsStr::from_bytes(b"1:n\xe9.map");
    let small: Vec<&OsStr> = SMALL.iter().map(OsStr::new).collect();
    for args in [
        with("check", &[name]),
        with("check --map", &[name, scenario]),
        with("suite --list", &[name]),
        with("suite --list", &[OsStr::new(".")]),
        with("--no-ui", &[&[name][..], &small].concat()),
        with("--no-ui --scen", &[&[scenario, name][..], &small].concat()),
        with("--no-ui --edit-at", &[&[edit, name][..], &small].concat()),
    ] {
        let (status, output, errors) = run(folder.path(), &args);
        assert_eq!(status, 0, "{args:?}: {errors}");
        assert!(!output.is_empty());
    }
    let missing = [OsString::from("--no-ui"), PathBuf::from(OsStr::from_bytes(b"m\xe9")).into()];
    assert!(refusal(folder.path(), &missing).contains("is neither a built-in map nor a file"));
}

#[test]
fn names_do_not_act_in_a_report() {
    let folder = folder();
    let name = "<b>*a*_`b|[c](d)#";
    std::fs::write(folder.path().join(format!("{name}.map")), ARENA).unwrap();
    let args = words(
        "suite . --markdown --budget 2 --eval-tasks 1 --set hidden=8 --set \
        learning_starts=100",
    );
    let (status, table, errors) = run(folder.path(), &args);
    assert_eq!(status, 0, "{errors}");
    let escaped = "\\<b\\>\\*a\\*\\_\\`b\\|\\[c\\](d)\\#";
    let report = std::fs::read_to_string(folder.path().join("saves/suite/report.md")).unwrap();
    assert!(report.contains(&format!("\n## {escaped}\n")), "{report}");
    assert!(table.contains(&format!("| {escaped} |")) && report.contains(&table), "{table}");
    assert!(!report.contains("<b>") && !report.contains(name), "{report}");
    let picture =
        report.split("](pictures/").nth(1).and_then(|rest| rest.split(')').next()).unwrap();
    assert!(folder.path().join("saves/suite/pictures").join(picture).is_file(), "{report}");
}
