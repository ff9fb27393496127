//! `gdg-tui runs`: lists saved runs, as a table or on the screen.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, miette};

use super::train::{obstacle, registry_for};
use super::{CommandFailure, CommandOutcome, bad_input, failure, prepare, print, print_safely};
use crate::cli::{Cli, RunsArgs, TrainArgs};
use crate::experiment::saved_runs::{RunReader, SavedRun, table};
use crate::process::waiting::Waiting;
use crate::setup::saves::SAVES;
use crate::tui::{self, ComparisonOptions, Contender, Opened, Opener, RunsScreen};
use gdg::learn::Threads;
use gdg::map::Reading;
use gdg::printing::eprint_line;
use gdg::text::escape_json_line;
use gdg::train::Registry;

/// Shows the runs of folders: on a terminal as a screen, otherwise as a table or as JSON.
pub fn run(args: &RunsArgs, registry: &Arc<Registry>) -> CommandOutcome {
    for folder in args.folders.iter().filter(|folder| !is_missing_default(folder)) {
        let unreadable = |error| {
            let help = "give folders of checkpoints, of records, or of gdg-tui suite";
            miette!(help = help, "{}: cannot be read: {error}", folder.display())
        };
        std::fs::read_dir(folder).map_err(unreadable).map_err(bad_input)?;
    }
    if args.json {
        let line = |run: &Arc<SavedRun>| escape_json_line(&run.json().to_string()) + "\n";
        return print(&read(&args.folders).iter().map(line).collect::<String>());
    }
    if obstacle().is_none() {
        return show(args, registry);
    }
    let runs = read(&args.folders);
    if !runs.is_empty() {
        return print_safely(&table(runs));
    }
    if args.folders.iter().all(|folder| is_missing_default(folder)) {
        return print("no saved runs yet: train with --save FILE, or press s in the interface\n");
    }
    print("no runs here\n")
}

/// Whether a folder is the usual one, which the first run that is saved creates.
fn is_missing_default(folder: &Path) -> bool {
    folder.as_os_str() == SAVES && !folder.exists()
}

/// Reads the runs of folders; says on standard error what is left out.
fn read(folders: &[PathBuf]) -> Vec<Arc<SavedRun>> {
    let reading = Waiting::on("reading the runs");
    reading.begin(0, 1);
    let found = RunReader::new(folders).read(|[file, files], _| {
        reading.set(file, files);
        ControlFlow::Continue(())
    });
    drop(reading);
    found.runs.iter().filter_map(|run| run.note()).for_each(|note| eprint_line(&note));
    found.runs.into_iter().filter(|run| !run.is_damaged()).collect()
}

/// Shows the list, and what is opened in it, in turns.
fn show(args: &RunsArgs, registry: &Arc<Registry>) -> CommandOutcome {
    crate::process::logging::start(args.screen.log_level);
    let opener = opener(args, registry)?;
    let mut interface = tui::prepare(&args.screen.interface).map_err(bad_input)?;
    let mut list = RunsScreen::open(&args.folders, opener, &interface).map_err(failure)?;
    let (mut status, mut notice) = (0, String::new());
    loop {
        interface.notice = None;
        let (left, opened, signalled) = list.show(&mut interface, &notice).map_err(failure)?;
        interface.notice = Some("q leads back to the list of runs");
        let ended = match opened {
            None => return Ok(status.max(signalled)),
            Some(Opened::Run(setup)) => tui::run(*setup, &mut interface),
            Some(Opened::Comparison(both)) => tui::compare(*both, &mut interface),
        };
        let (ended, files) = ended.map_err(failure)?;
        if let Some(signalled) = interface.ended() {
            return Ok(signalled);
        }
        (list, status, notice) = (left, status.max(ended), files);
    }
}

/// Returns what opens runs, as the commands that show one or two of them do.
fn opener(args: &RunsArgs, registry: &Arc<Registry>) -> Result<Opener, CommandFailure> {
    use clap::Parser;
    let mut train = Cli::try_parse_from(["gdg-tui"]).into_diagnostic().map_err(failure)?.train;
    train.log_level = args.screen.log_level;
    let registry = registry_for(&train, registry);
    Ok(Arc::new(move |wish, progress| match wish.beside {
        None => {
            let resume = Some(Some(wish.file));
            let args = TrainArgs { resume, ..train.clone() };
            let mut setup = prepare::prepare(&args, &registry, progress)?;
            setup.warnings.extend(wish.warning);
            Ok(Opened::Run(Box::new(setup)))
        }
        Some(other) => {
            let options = ComparisonOptions {
                a: Contender::Checkpoint(wish.file),
                b: Contender::Checkpoint(other),
                map: None,
                seed: None,
                set: Vec::new(),
                threads: Threads::auto(),
            };
            let reading = Reading::default();
            let mut both = tui::prepare_comparison(&options, &reading, &registry, progress)?;
            both.warnings.extend(wish.warning);
            Ok(Opened::Comparison(Box::new(both)))
        }
    }))
}
