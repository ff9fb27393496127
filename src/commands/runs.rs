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
use crate::host::{report::print_error, setup};
#[cfg(feature = "tui")]
use crate::tui::{
    self, ComparisonOptions, Contender, NextAfterRuns, PreparedInterface, RunsScreen,
};
#[cfg(feature = "tui")]
use gdg::learn::Threads;
#[cfg(feature = "tui")]
use gdg::map::Reading;
use gdg::printing::eprint_line;
use gdg::train::Registry;

/// What a run or a comparison that was opened from the list says.
#[cfg(feature = "tui")]
const BACK: &str = "q leads back to the list of runs";

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

/// Shows the list, and what the user asks for in it, after which the list comes back.
#[cfg(feature = "tui")]
fn show(args: &RunsArgs, registry: &Arc<Registry>) -> Outcome {
    check(&args.folders).or_bad_input()?;
    crate::host::logging::start(args.screen.log_level);
    let options = args.screen.interface.options(args.screen.overwrite);
    let mut interface = tui::prepare(&options).or_bad_input()?;
    let mut list = RunsScreen::open(&args.folders, &interface).or_failure()?;
    let (mut problem, mut status) = (None, 0);
    loop {
        let following = interface.following(None);
        let (left, next, shown) = list.show(interface, problem.as_deref()).or_failure()?;
        list = left;
        let ended = match next {
            NextAfterRuns::Quit => return Ok(shown.max(status)),
            NextAfterRuns::Compare(files) => {
                compare(files, following.following(Some(BACK)), registry)
            }
            NextAfterRuns::Resume(file) => {
                resume(file, args, following.following(Some(BACK)), registry)
            }
        };
        if let Some(ended) = following.ended() {
            return Ok(ended);
        }
        problem = ended.as_ref().err().map(|failure| failure.error.to_string());
        // Of all that failed, the last one.
        match ended {
            Ok(0) => {}
            Ok(failed) => status = failed,
            Err(failure) => {
                status = failure.status;
                // The terminal shows it again after the list.
                print_error(failure.error);
            }
        }
        interface = following;
    }
}

#[cfg(feature = "tui")]
fn compare(files: [PathBuf; 2], to: PreparedInterface, registry: &Arc<Registry>) -> Outcome {
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
    tui::compare(contestants, to).or_failure()
}

#[cfg(feature = "tui")]
fn resume(
    file: PathBuf,
    args: &RunsArgs,
    to: PreparedInterface,
    registry: &Arc<Registry>,
) -> Outcome {
    let train = resuming(file, args)?;
    let registry = super::train::registry_for(&train, registry);
    let setup = setup::prepare(&train.request(), &registry).or_bad_input()?;
    tui::run(setup, to, None).or_failure()
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
    runs.iter().filter_map(|(run, _)| run.note()).for_each(|note| eprint_line(&note));
    let lines = runs.iter().map(|(run, written)| serde_json::to_string(&run.line(*written)));
    let lines: Result<Vec<String>, _> = lines.collect();
    Ok(lines.into_diagnostic()?.into_iter().map(|line| line + "\n").collect())
}
