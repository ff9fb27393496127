//! How commands print and fail.

use std::path::Path;

use miette::{Report, miette};

use crate::host::{EXIT_BAD_INPUT, EXIT_FAILURE};
use gdg::files;
use gdg::printing::print_text;
use gdg::text::sanitized_lines;

/// Why a command failed.
pub struct Failure {
    /// The error for the user.
    pub error: Report,
    /// The exit status.
    pub status: u8,
}

/// The exit status of a command.
pub type Outcome = Result<u8, Failure>;

/// Gives an error the exit status of its cause.
pub trait OrFail<T> {
    /// Marks an error as bad input.
    fn or_bad_input(self) -> Result<T, Failure>;

    /// Marks an error as a failure while running.
    fn or_failure(self) -> Result<T, Failure>;
}

impl<T> OrFail<T> for Result<T, Report> {
    fn or_bad_input(self) -> Result<T, Failure> {
        self.map_err(|error| Failure { error, status: EXIT_BAD_INPUT })
    }

    fn or_failure(self) -> Result<T, Failure> {
        self.map_err(|error| Failure { error, status: EXIT_FAILURE })
    }
}

/// Writes a file and returns a line that says where.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<String, Report> {
    files::write_atomically(path, bytes).map_err(|error| {
        miette!(
            help = "give --out a file in a writable folder",
            "{}: cannot be written: {error}",
            path.display()
        )
    })?;
    Ok(format!("{}\n", path.display()))
}

/// Prints text that may quote user input, made safe to display, to standard output.
pub fn print_safely(text: &str) -> Outcome {
    print(&sanitized_lines(text))
}

/// Prints to standard output. An early close (`| head`) is not an error.
pub fn print(text: &str) -> Outcome {
    let printed = print_text(text);
    printed.map_err(|error| Report::msg(error).wrap_err("standard output")).or_failure()?;
    Ok(0)
}
