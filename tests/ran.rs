//! What a command printed.

use std::borrow::BorrowMut;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::Value;

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

impl Ran {
    /// Returns what it printed; it must have succeeded.
    pub fn success(&self) -> &str {
        assert_eq!(self.status, Some(0), "{}", self.err);
        &self.out
    }

    /// Returns the message with which it has refused its arguments, in one line.
    pub fn refusal(&self) -> String {
        assert_eq!(self.status, Some(2), "{}", self.err);
        one_line(&self.err)
    }

    /// Returns its records.
    pub fn records(&self) -> Vec<Value> {
        self.out.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }
}

/// Returns an error without the breaks of its lines and what is drawn beside it.
pub fn one_line(error: &str) -> String {
    error.replace('│', " ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns a command of the program, to be run in `folder`.
pub fn program_in(folder: &Path) -> Command {
    isolated(Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui")), folder)
}

/// Runs the program in `folder`.
pub fn in_folder(folder: &Path, args: &[&str]) -> Ran {
    ran(program_in(folder).args(args))
}

/// Lets a command run in `folder`, away from the user's files.
pub fn isolated(mut command: Command, folder: &Path) -> Command {
    command.current_dir(folder).env("NO_COLOR", "1").env("XDG_STATE_HOME", folder);
    command
}

/// Runs a command to its end, without input.
pub fn ran(mut command: impl BorrowMut<Command>) -> Ran {
    let output = command.borrow_mut().stdin(Stdio::null()).output().unwrap();
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
