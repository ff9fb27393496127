//! The binary: parses the command line, and turns errors into messages and exit statuses.
#![forbid(unsafe_code)]

use std::process::ExitCode;

use gdg::printing::{eprint_line, print_text};
use gdg::text::{sanitized_lines, terminal_obeys_escapes};
use gdg::train::Registry;
use gdg::{faults, printing};
use gdg_tui::cli::Cli;
use gdg_tui::commands;
use gdg_tui::process::EXIT_FAILURE;
use gdg_tui::process::{errors, signals};
use miette::Report;

fn main() -> ExitCode {
    faults::install_panic_hook();
    errors::set_up();
    if let Err(error) = signals::survive_file_size_limit() {
        eprint_line(&format!("files that become too large will end the program: {error}"));
    }
    let status = match Cli::from_arguments() {
        Ok(cli) => commands::run(cli, &Registry::builtin())
            .unwrap_or_else(|failure| fail(&failure.error, failure.status)),
        Err(error) => usage(&error),
    };
    printing::finish();
    ExitCode::from(status)
}

/// Prints the error in the arguments, or the requested help, and returns the exit status.
fn usage(error: &clap::Error) -> u8 {
    let status = error.exit_code() as u8;
    let text = error.to_string();
    let printed = if sanitized_lines(&text) == text && terminal_obeys_escapes() {
        error.print()
    } else if error.use_stderr() {
        // It quotes an argument that contains terminal control characters, or colours mean nothing
        // here.
        eprint_line(text.trim_end());
        return status;
    } else {
        print_text(&text)
    };
    match printed {
        Err(problem) if !error.use_stderr() && problem.kind() != std::io::ErrorKind::BrokenPipe => {
            fail(&Report::msg(problem).wrap_err("standard output"), EXIT_FAILURE)
        }
        _ => status,
    }
}

fn fail(error: &Report, status: u8) -> u8 {
    log::error!("{error}");
    errors::print_error(error);
    status
}
