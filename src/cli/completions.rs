//! Scripts that complete the command line in shells.

use clap::{Arg, Command, CommandFactory};
use clap_complete::Shell;

use super::Cli;
use gdg::map::BUILTIN;
use gdg::train::Registry;

/// The program's name on the command line.
const PROGRAM: &str = "gdg-tui";

/// Returns the script that completes the command line in `shell`.
pub fn completions(shell: Shell) -> String {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut completed(), PROGRAM, &mut script);
    let script = String::from_utf8_lossy(&script);
    match shell {
        // clap_complete names the function of a program with a hyphen in one way, and refers to its
        // commands in another.
        Shell::Bash => {
            script.replace(&PROGRAM.replace('-', "__subcmd__"), &PROGRAM.replace('-', "__"))
        }
        // The first word may also be a file.
        Shell::Zsh => {
            let commands = format!("_describe -t commands '{PROGRAM} commands' commands \"$@\"\n");
            script.replace(&commands, &format!("{commands}    _files\n"))
        }
        _ => script.into_owned(),
    }
}

/// Returns the command line for completion. Maps and worlds become commands with the options of
/// training, as scripts accept either a command or a value as the first word, not both.
fn completed() -> Command {
    let cli = Cli::command();
    let options: Vec<Arg> =
        cli.get_arguments().filter(|arg| !arg.is_positional()).cloned().collect();
    let registry = Registry::builtin();
    let worlds = registry
        .worlds()
        .iter()
        .filter(|kind| kind.create.is_some())
        .map(|kind| (kind.name, "world"));
    let maps = BUILTIN.iter().map(|(name, _)| (*name, "built-in map"));
    let trained =
        maps.chain(worlds).map(|(name, about)| Command::new(name).about(about).args(&options));
    Command::new(PROGRAM)
        .args(&options)
        .subcommands(cli.get_subcommands().cloned())
        .subcommands(trained)
        .disable_help_subcommand(true)
}
