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
#[cfg(feature = "tui")]
use crate::cli::Cli;
use crate::cli::RunsArgs;
use crate::experiment::runs::{Found, Reader};
use crate::host::runs::{self, SAVES};
#[cfg(feature = "tui")]
use crate::host::status::{EXIT_BAD_INPUT, EXIT_FAILURE};
use crate::host::waiting::Working;
#[cfg(feature = "tui")]
use crate::host::{report::print_error, setup};
#[cfg(feature = "tui")]
use crate::tui::{
    self, ComparisonOptions, Contender, NextAfterRuns, Opened, Opener, PreparedInterface,
    RunsScreen, Wish,
};
#[cfg(feature = "tui")]
use gdg::learn::Threads;
#[cfg(feature = "tui")]
use gdg::map::Reading;
use gdg::printing::eprint_line;
use gdg::text::escape_json_line;
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
    let opener = opener(args, registry)?;
    let options = args.screen.interface.options(args.screen.overwrite);
    let mut interface = tui::prepare(&options).or_bad_input()?;
    let list = RunsScreen::open(&args.folders, opener, &interface).or_failure()?;
    let (ended, failures) = show_all(list, &mut interface);
    // Restores the terminal, which shows them then.
    drop(interface);
    failures.into_iter().for_each(print_error);
    ended
}

/// Shows the list and what is opened in it, in turns; returns the exit status and what has failed.
#[cfg(feature = "tui")]
fn show_all(mut list: RunsScreen, interface: &mut PreparedInterface) -> (Outcome, Vec<Report>) {
    let (mut since, mut status, mut failures) = (Ok(String::new()), 0, Vec::new());
    loop {
        interface.notice = None;
        let (left, next, shown) = match list.show(interface, &since).or_failure() {
            Ok(shown) => shown,
            Err(failure) => return (Err(failure), failures),
        };
        list = left;
        if !list.failures.is_empty() {
            status = EXIT_BAD_INPUT;
            failures.append(&mut list.failures);
        }
        interface.notice = Some(BACK);
        let ended = match next {
            NextAfterRuns::Quit => return (Ok(shown.max(status)), failures),
            NextAfterRuns::Show(Opened::Run(setup)) => tui::run(*setup, interface, None),
            NextAfterRuns::Show(Opened::Comparison(both)) => tui::compare(*both, interface),
        };
        if let Some(signalled) = interface.ended() {
            return (Ok(signalled), failures);
        }
        // Of all that failed, the last one.
        since = match ended {
            Ok((failed, files)) => {
                status = if failed == 0 { status } else { failed };
                Ok(files)
            }
            Err(error) => {
                status = EXIT_FAILURE;
                let problem = error.to_string();
                failures.push(error);
                Err(problem)
            }
        };
    }
}

/// Returns what opens runs, as the commands that show one or two of them do.
#[cfg(feature = "tui")]
fn opener(args: &RunsArgs, registry: &Arc<Registry>) -> Result<Opener, Failure> {
    use clap::Parser;
    let mut train = Cli::try_parse_from(["gdg-tui"]).into_diagnostic().or_failure()?.train;
    train.log_level = args.screen.log_level;
    let (request, registry) = (train.request(), super::train::registry_for(&train, registry));
    Ok(Arc::new(move |wish, progress| match &wish {
        Wish::Resume(run) => {
            let resume = Some(Some(run.file.clone()));
            let request = setup::Request { resume, ..request.clone() };
            let mut setup = setup::prepare(&request, &registry, progress)?;
            setup.warnings.extend(wish.warning());
            Ok(Opened::Run(Box::new(setup)))
        }
        Wish::Compare(both) => {
            let options = ComparisonOptions {
                contenders: both.each_ref().map(|run| Contender::Checkpoint(run.file.clone())),
                map: None,
                reading: Reading::default(),
                seed: None,
                set: Vec::new(),
                threads: Threads::auto(),
                recording: None,
            };
            let mut both = tui::prepare_comparison(&options, &registry, progress)?;
            both.warnings.extend(wish.warning());
            Ok(Opened::Comparison(Box::new(both)))
        }
    }))
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
    let reading = Working::begin("the runs to be read");
    reading.progress().begin(0, 1);
    let mut reader = Reader::new(folders);
    let Found { runs, problems, .. } = reader.read(|[file, files], _| {
        reading.progress().set(file, files);
        ControlFlow::Continue(())
    });
    drop(reading);
    for (path, problem) in problems {
        eprint_line(&format!("{}: {problem}: left out", path.display()));
    }
    runs.iter().filter_map(|(run, _)| run.note()).for_each(|note| eprint_line(&note));
    let lines = runs.iter().map(|(run, written)| serde_json::to_string(&run.line(*written)));
    let lines: Result<Vec<String>, _> = lines.collect();
    let lines = lines.into_diagnostic()?;
    Ok(lines.iter().map(|line| escape_json_line(line) + "\n").collect())
}
