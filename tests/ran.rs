//! What a command printed.

use std::path::Path;
use std::process::Command;

/// Settings that keep a job small.
pub const SMALL: [&str; 8] = [
    "--set",
    "hidden=16",
    "--set",
    "buffer_size=20000",
    "--set",
    "candidates=50",
    "--set",
    "learning_starts=200",
];

/// What a command printed, and its exit status.
pub struct Ran {
    pub status: Option<i32>,
    pub out: String,
    pub err: String,
}

/// Returns a command of the program, to be run in `folder`.
pub fn program_in(folder: &Path) -> Command {
    isolated(Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui")), folder)
}

/// Lets a command run in `folder`, away from the user's files.
pub fn isolated(mut command: Command, folder: &Path) -> Command {
    command.current_dir(folder).env("NO_COLOR", "1").env("XDG_STATE_HOME", folder);
    command
}

/// Runs a command to its end.
pub fn ran(mut command: Command) -> Ran {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ran { status: output.status.code(), out: text(&output.stdout), err: text(&output.stderr) }
}

/// Returns the arguments of a line, none of which has blanks.
pub fn words(line: &str) -> Vec<&str> {
    line.split(' ').collect()
}

/// Asserts that `text` contains all `parts`.
pub fn has_parts(text: &str, parts: &[&str]) {
    parts.iter().for_each(|part| assert!(text.contains(part), "{part:?} is not in {text}"));
}
