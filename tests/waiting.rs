//! What takes long says what it does, from half a second on.

use std::path::Path;
use std::process::Stdio;

use tempfile::TempDir;

use crate::ran::{SMALL, has_parts, in_folder, program_in, words};

const FAULTS: &str = "GDG_TUI_FAULTS";

/// A fault that makes the work of a command take as long as a log waits before it says so.
const SLOW: &str = "work=delay:2400@1";

/// Returns a folder with a run, its transitions, and a folder of maps.
fn files() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let train = "--no-ui trap --max-updates 20 --eval-tasks 1 --save saves/own.safetensors";
    in_folder(folder.path(), &[&words(train)[..], &SMALL].concat()).success();
    in_folder(folder.path(), &words("export-data saves/own.safetensors --out own.npz")).success();
    std::fs::create_dir(folder.path().join("maps")).unwrap();
    for name in ["a", "b"] {
        std::fs::write(folder.path().join(format!("maps/{name}.map")), "S....G\n").unwrap();
    }
    folder
}

/// Runs commands at once, each with a fault; returns what they print on standard error.
fn said<const N: usize>(folder: &Path, commands: [(&str, &str); N]) -> [String; N] {
    let started = commands.map(|(line, fault)| {
        let mut command = program_in(folder);
        command.args(line.split(' ')).env(FAULTS, fault);
        command.stdout(Stdio::null()).stderr(Stdio::piped()).stdin(Stdio::null());
        command.spawn().unwrap()
    });
    started.map(|child| {
        let output = child.wait_with_output().unwrap();
        String::from_utf8_lossy(&output.stderr).into_owned()
    })
}

#[test]
fn commands_say_what_they_wait_for() {
    let folder = files();
    let commands = [
        ("check trap", "measuring the map"),
        ("maps", "measuring the maps"),
        ("maps convert trap trap.png", "converting the map"),
        ("export-policy saves/own.safetensors", "reading the checkpoint"),
        ("export-data saves/own.safetensors", "reading the checkpoint"),
        ("suite maps --list --out own", "reading the maps"),
        ("plot saves/own.safetensors", "reading the runs"),
        ("runs", "reading the runs"),
        ("runs --json", "reading the runs"),
        ("--no-ui trap --max-updates 1", "opening the world"),
        ("--no-ui trap --max-updates 1 --data own.npz", "reading the data"),
        ("--no-ui --resume saves/own.safetensors --max-updates 21", "opening the run"),
        ("--print-config --resume saves/own.safetensors", "opening the run"),
    ];
    let said = said(folder.path(), commands.map(|(line, _)| (line, SLOW)));
    for ((line, what), said) in commands.iter().zip(said) {
        assert!(said.contains(&format!("{what} (")), "{line}: {said}");
        has_parts(&said, &[" s so far", "; Ctrl-C cancels"]);
    }
}

#[test]
fn commands_say_how_far_they_are() {
    let folder = files();
    let path = |name: &str| folder.path().join("saves").join(name);
    std::fs::copy(path("own.safetensors"), path("second.safetensors")).unwrap();
    // The pass at which the work is slow, and how far it is by then, in per cent.
    let commands = [
        ("maps", 9, "measuring the maps", 0),
        ("export-policy saves/own.safetensors --plans", 18, "writing the policy", 14),
        ("export-data saves/own.safetensors", 6, "writing the transitions", 17),
        ("export-data saves/own.safetensors", 3, "reading the checkpoint", 67),
        ("suite maps --list --out own", 3, "reading the maps", 50),
        ("runs", 3, "reading the runs", 50),
        ("runs --json", 3, "reading the runs", 50),
        ("--no-ui trap --max-updates 1 --data own.npz", 7, "reading the data", 62),
    ];
    let faults = commands.map(|(_, pass, ..)| format!("progress=delay:2400@{pass}"));
    let lines = std::array::from_fn::<_, 8, _>(|i| (commands[i].0, &*faults[i]));
    let mut shares = Vec::new();
    for ((line, _, what, _), said) in commands.iter().zip(said(folder.path(), lines)) {
        let share = said
            .split_once(&format!("{what} ("))
            .and_then(|(_, told)| told.split_once(" s so far, "))
            .and_then(|(_, told)| told.split_once(" %)"))
            .and_then(|(percent, _)| percent.parse::<u8>().ok());
        shares.push((*line, share));
    }
    assert_eq!(shares, commands.map(|(line, _, _, share)| (line, Some(share))));
}

#[test]
fn on_a_terminal_waiting_is_one_line_that_is_removed() {
    use crate::support::Session;
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start_with(folder.path(), &["check", "trap"], &[(FAULTS, SLOW)]);
    session.wait_for("measuring the map");
    session.wait_for("farthest:");
    let left = session.screen_text();
    assert!(left.starts_with("map:        trap") && !left.contains("measuring"), "{left}");
    assert_eq!(session.status(), 0);
}
