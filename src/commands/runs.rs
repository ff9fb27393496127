//! `gdg-tui runs`.

use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

#[cfg(feature = "tui")]
use super::output::Failure;
use super::output::{OrFail, Outcome, print, print_safely};
#[cfg(feature = "tui")]
use super::screen::obstacle;
use crate::cli::RunsArgs;
#[cfg(feature = "tui")]
use crate::cli::{Cli, TrainArgs};
use crate::experiment::runs::{Found, Reader};
use crate::host::runs::{self, SAVES};
#[cfg(feature = "tui")]
use crate::tui::{self, ComparisonOptions, Contender, InterfaceOptions, NextAfterRuns};
#[cfg(feature = "tui")]
use gdg::learn::Threads;
#[cfg(feature = "tui")]
use gdg::map::Reading;
use gdg::printing::eprint_line;
use gdg::train::Registry;

/// Shows the runs of folders: on a terminal as a screen, otherwise as a table or as JSON.
///
/// # Errors
/// A folder cannot be read, or the screen cannot be shown.
pub fn run(args: &RunsArgs, registry: &Arc<Registry>) -> Outcome {
    if args.json {
        return print(&json(&args.folders).or_bad_input()?);
    }
    #[cfg(feature = "tui")]
    if obstacle().is_none() {
        return show(args, registry);
    }
    print_safely(&tables(&args.folders, registry).or_bad_input()?)
}

/// Shows the screen, and then what the user has asked for in it.
#[cfg(feature = "tui")]
fn show(args: &RunsArgs, registry: &Arc<Registry>) -> Outcome {
    check(&args.folders).or_bad_input()?;
    crate::host::logging::start(args.screen.log_level);
    let options = args.screen.interface.options(args.screen.overwrite);
    let prepared = tui::prepare(&options).or_bad_input()?;
    let (next, status) = tui::show_runs(&args.folders, prepared).or_failure()?;
    match next {
        NextAfterRuns::Quit => Ok(status),
        NextAfterRuns::Compare(files) => {
            let options = ComparisonOptions {
                contenders: files.map(Contender::Checkpoint),
                map: None,
                reading: Reading::default(),
                seed: None,
                set: Vec::new(),
                threads: Threads::auto(),
                recording: None,
            };
            let contestants = tui::prepare_comparison(&options, registry).or_bad_input()?;
            let prepared = tui::prepare(&unrecorded(args)).or_bad_input()?;
            tui::compare(contestants, prepared).or_failure()
        }
        NextAfterRuns::Resume(file) => super::train::run(&resuming(file, args)?, registry),
    }
}

/// Returns the options of the interface for what follows the list, which is not recorded.
#[cfg(feature = "tui")]
fn unrecorded(args: &RunsArgs) -> InterfaceOptions {
    InterfaceOptions { record: None, ..args.screen.interface.options(false) }
}

/// Returns the options of the command that resumes a run.
#[cfg(feature = "tui")]
fn resuming(file: PathBuf, args: &RunsArgs) -> Result<TrainArgs, Failure> {
    use clap::Parser;
    let parsed = Cli::try_parse_from(["gdg-tui"]).into_diagnostic().or_failure()?;
    let mut train = parsed.train;
    train.resume = Some(Some(file));
    train.log_level = args.screen.log_level;
    train.interface.ui_config.clone_from(&args.screen.interface.ui_config);
    train.interface.marker = args.screen.interface.marker;
    Ok(train)
}

/// Checks that folders can be read; the default one need not exist.
fn check(folders: &[PathBuf]) -> Result<(), Report> {
    for folder in folders.iter().filter(|folder| folder.as_os_str() != SAVES || folder.exists()) {
        std::fs::read_dir(folder).map_err(|error| {
            let help = "give folders of checkpoints, of records, or of gdg-tui suite";
            miette!(help = help, "{}: cannot be read: {error}", folder.display())
        })?;
    }
    Ok(())
}

/// Returns the tables of the folders' checkpoints, below the folders' names if there are several.
fn tables(folders: &[PathBuf], registry: &Arc<Registry>) -> Result<String, Report> {
    let mut text = String::new();
    for folder in folders {
        if folders.len() > 1 {
            let gap = if text.is_empty() { "" } else { "\n" };
            let _ = writeln!(text, "{gap}{}", folder.display());
        }
        text += &runs::list(folder, registry)?;
    }
    Ok(text)
}

/// Returns a line of JSON for each run; says on standard error what cannot be read.
fn json(folders: &[PathBuf]) -> Result<String, Report> {
    check(folders)?;
    let Found { runs, problems, .. } = Reader::new(folders).read(|_| ControlFlow::Continue(()));
    for (path, problem) in problems {
        eprint_line(&format!("{}: {problem}: left out", path.display()));
    }
    let lines = runs.iter().map(|(run, written)| serde_json::to_string(&run.line(*written)));
    let lines: Result<Vec<String>, _> = lines.collect();
    Ok(lines.into_diagnostic()?.into_iter().map(|line| line + "\n").collect())
}
