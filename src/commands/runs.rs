//! `gdg-tui runs` lists saved runs, as a table or on the screen; `gdg-tui watch` shows one that another
//! program trains.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use super::train::{obstacle, on_screen, registry_for};
use super::{CommandOutcome, bad_input, failure, prepare, print, print_safely};
use crate::cli::{Cli, RunsArgs, ScreenArgs, TrainArgs, WatchArgs};
use crate::experiment::saved_runs::{RunReader, RunState, SavedRun, table, whole};
use crate::process::waiting::Waiting;
use crate::setup::saves::is_named_like_one;
use crate::tui::{
    self, ComparisonOptions, Contender, Opened, Opener, PreparedInterface, RunsScreen,
    TrainedElsewhere, Wish,
};
use gdg::learn::Threads;
use gdg::map::Reading;
use gdg::printing::eprint_line;
use gdg::text::escape_json_line;
use gdg::train::Registry;

/// Shows the runs of folders: on a terminal as a screen, otherwise as a table or as JSON.
pub fn run(args: &RunsArgs, registry: &Arc<Registry>) -> CommandOutcome {
    for folder in &args.folders {
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
        let opener = || opener(&args.screen, registry);
        return on_screen(&args.screen, [""; 2], opener, |opener, interface| {
            show(&args.folders, None, opener, interface)
        });
    }
    let runs = read(&args.folders);
    if !runs.is_empty() {
        return print_safely(&table(runs));
    }
    print("no saved runs yet: train with --save FILE, or press s in the interface\n")
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

/// Shows the list, and what is opened in it, in turns; ends with the run of `awaited` records, if that
/// is what is shown first.
fn show(
    folders: &[PathBuf],
    awaited: Option<PathBuf>,
    opener: Opener,
    interface: &mut PreparedInterface,
) -> Result<(u8, String), Report> {
    let watches = awaited.is_some();
    let mut list = RunsScreen::open(folders, awaited, opener, interface)?;
    let (mut status, mut notice) = (0, String::new());
    loop {
        interface.notice = None;
        let (left, opened, signalled) = list.show(interface, &notice)?;
        interface.notice = (!watches).then_some("q leads back to the list of runs");
        let Some(opened) = opened else { return Ok((status.max(signalled), String::new())) };
        let (ended, files) = shown(opened, interface)?;
        if let Some(signalled) = interface.ended() {
            return Ok((signalled, String::new()));
        }
        (list, status, notice) = (left, status.max(ended), files);
        if watches {
            return Ok((status, String::new()));
        }
    }
}

pub fn watch(args: &WatchArgs, registry: &Arc<Registry>) -> CommandOutcome {
    let opener = opener(&args.screen, registry).map_err(failure)?;
    let refusal = ["a run", "gdg-tui runs lists runs without one"];
    let found = || {
        let found = to_watch(&args.file)?;
        let open = |wish| opener(wish, &Waiting::on("opening the run"));
        found.map(open).map_or_else(|records| Ok(Err(records)), |opened| opened.map(Ok))
    };
    on_screen(&args.screen, refusal, found, |found, interface| match found {
        Ok(opened) => shown(opened, interface),
        Err((folder, records)) => show(&[folder], Some(records), opener.clone(), interface),
    })
}

/// Returns the wish to watch the run that a file is of, its checkpoint or its records; of a folder,
/// the one that was written last, preferably one that goes on. Of one that goes on and has not been
/// saved yet, returns its folder and its records.
fn to_watch(given: &Path) -> Result<Result<Wish, (PathBuf, PathBuf)>, Report> {
    let file = Some(whole(given)).filter(|_| !given.is_dir());
    let beside =
        given.parent().map(|folder| if folder == Path::new("") { Path::new(".") } else { folder });
    let is_meant = |run: &&Arc<SavedRun>| {
        let saves = run.saves.as_ref().map(|(path, _)| path);
        let mut own =
            [&run.source].into_iter().chain(&run.others).chain(&run.checkpoint).chain(saves);
        file.as_ref().is_none_or(|file| own.any(|own| whole(own) == *file))
    };
    let places = [Some(given), beside.filter(|_| file.is_some())].into_iter().flatten();
    let runs = read(&places.filter(|place| place.exists()).map(Path::to_owned).collect::<Vec<_>>());
    let goes_on = |run: &Arc<SavedRun>| run.state() == RunState::Running;
    let usable = runs.iter().filter(is_meant).filter(|run| goes_on(run) || run.kept().is_some());
    let own = || (given.to_owned(), given.to_owned());
    let (file, records) = match usable.max_by_key(|run| (goes_on(run), run.written)) {
        Some(run) => match run.kept() {
            Some(kept) => (kept, run.source.clone()),
            None => {
                let folder = if given.is_dir() { Some(given) } else { beside };
                let folder = folder.unwrap_or(Path::new(".")).to_owned();
                return Ok(Err((folder, run.source.clone())));
            }
        },
        None if is_named_like_one(given) => own(),
        None => {
            let help = "a run is seen as its checkpoint has it: train with --save FILE";
            return Err(miette!(help = help, "{}: no run with a checkpoint yet", given.display()));
        }
    };
    Ok(Ok(Wish { file, beside: None, warning: None, watches: Some(records) }))
}

fn shown(opened: Opened, interface: &mut PreparedInterface) -> Result<(u8, String), Report> {
    match opened {
        Opened::Run(setup, elsewhere) => tui::run(*setup, elsewhere, interface),
        Opened::Comparison(both) => tui::compare(*both, interface),
    }
}

/// Returns what opens runs, as the commands that show one or two of them do.
fn opener(screen: &ScreenArgs, registry: &Arc<Registry>) -> Result<Opener, Report> {
    use clap::Parser;
    let mut train = Cli::try_parse_from(["gdg-tui"]).into_diagnostic()?.train;
    train.log_level = screen.log_level;
    let registry = registry_for(&train, registry);
    Ok(Arc::new(move |wish, progress| match wish.beside {
        None => {
            let look = |records| TrainedElsewhere::look(wish.file.clone(), records);
            let elsewhere = wish.watches.map(look).transpose().into_diagnostic()?;
            let is_copy = elsewhere.is_none();
            let args = TrainArgs { resume: Some(Some(wish.file)), is_copy, ..train.clone() };
            let mut setup = prepare::prepare(&args, &registry, progress)?;
            setup.warnings.extend(wish.warning);
            Ok(Opened::Run(Box::new(setup), elsewhere))
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
