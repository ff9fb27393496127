//! What takes long says what it does, from half a second on.

use std::process::Stdio;

use crate::ran::{SMALL, has_parts, program_in, ran};

const FAULTS: &str = "GDG_TUI_FAULTS";

/// A fault that makes the work of a command take as long as a log waits before it says so.
const SLOW: &str = "work=delay:2400@1";

#[test]
fn commands_say_what_they_wait_for() {
    let folder = tempfile::tempdir().unwrap();
    let mut train = program_in(folder.path());
    train.args(["--no-ui", "trap", "--max-updates", "20", "--eval-tasks", "1"]).args(SMALL);
    train.args(["--save", "saves/own.safetensors"]);
    assert_eq!(ran(train).status, Some(0));
    let commands = [
        ("check trap", "the map to be measured"),
        ("maps", "the maps to be measured"),
        ("maps convert trap trap.png", "the map to be converted"),
        ("export-policy saves/own.safetensors", "the checkpoint to be read"),
        ("export-data saves/own.safetensors", "the checkpoint to be read"),
        ("film saves/own.safetensors", "the checkpoint to be read"),
        ("plot saves/own.safetensors", "the runs to be read"),
        ("runs", "the checkpoints to be read"),
        ("runs --json", "the runs to be read"),
        ("--no-ui trap --max-updates 1", "the world to open"),
        ("--no-ui --resume saves/own.safetensors --max-updates 21", "the run to be opened"),
    ];
    let started = commands.map(|(line, what)| {
        let mut command = program_in(folder.path());
        command.args(line.split(' ')).env(FAULTS, SLOW);
        command.stdout(Stdio::null()).stderr(Stdio::piped()).stdin(Stdio::null());
        (line, what, command.spawn().unwrap())
    });
    for (line, what, child) in started {
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains(&format!("waiting for {what} (")), "{line}: {said}");
        has_parts(&said, &[" s so far", "; Ctrl-C cancels"]);
    }
}

#[cfg(unix)]
#[test]
fn on_a_terminal_waiting_is_one_line_that_is_removed() {
    use crate::support::Session;
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start_with(folder.path(), &["check", "trap"], &[(FAULTS, SLOW)]);
    session.wait_for("waiting for the map to be measured");
    session.wait_for("farthest:");
    let left = session.screen_text();
    assert!(left.starts_with("map:        trap") && !left.contains("waiting for"), "{left}");
    assert_eq!(session.status(), 0);
}
