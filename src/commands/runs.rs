//! `gdg-tui runs` lists saved runs, as a table or on the screen; `gdg-tui watch` shows one that another
//! program trains.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf, absolute};
use std::sync::Arc;
use std::time::Duration;

use miette::{IntoDiagnostic, Report, miette};

use super::train::{obstacle, on_screen};
use super::{CommandOutcome, bad_input, failure, prepare, print};
use crate::cli::{Cli, OpenArgs, RunsArgs, TrainArgs, WatchArgs};
use crate::experiment::saved_runs::{RunReader, RunState, SavedRun, table, whole};
use crate::process::waiting::Waiting;
use crate::setup::saves::{checkpoint_file, is_named_like_one, recovered};
use crate::tui::{
    self, ComparisonOptions, Contender, NO_RUNS, Opened, Opener, PreparedInterface, RunsScreen,
    TrainedElsewhere, Wish,
};
use gdg::env::GymOptions;
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
    // Where no other folder is named, also what could not be saved in its own.
    let usual = args.folders == [PathBuf::from(".")];
    let elsewhere = recovered().filter(|folder| usual && folder.is_dir());
    let folders: Vec<PathBuf> = args.folders.iter().cloned().chain(elsewhere).collect();
    if args.json {
        let line = |run: &Arc<SavedRun>| escape_json_line(&run.json().to_string()) + "\n";
        return print(&read(&folders).iter().map(line).collect::<String>());
    }
    if obstacle().is_none() {
        let opener = || opener(&args.open, registry);
        let list = |opener, interface: &mut _| show(&folders, false, opener, interface);
        return on_screen(&args.open.screen, [""; 2], opener, list);
    }
    let runs = read(&folders);
    print(&if runs.is_empty() { format!("{NO_RUNS}\n") } else { table(runs) })
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

/// Shows a list, and what is opened in it, in turns; if it `awaits` a first save, only that run.
fn show(
    places: &[PathBuf],
    awaits: bool,
    opener: Opener,
    interface: &mut PreparedInterface,
) -> tui::Closing {
    let awaited = places.first().filter(|_| awaits).cloned();
    let mut list = RunsScreen::open(places, awaited, opener, interface)?;
    let (mut status, mut notice) = (0, String::new());
    loop {
        let (left, opened, signalled) = list.show(interface, &notice)?;
        interface.from_list = !awaits;
        let Some(opened) = opened else { return Ok((status.max(signalled), String::new())) };
        let (ended, files) = shown(opened, interface)?;
        (list, status, notice) = (left, status.max(ended), files);
        if let Some(status) = interface.ended().or(awaits.then_some(status)) {
            return Ok((status, String::new()));
        }
    }
}

pub fn watch(args: &WatchArgs, registry: &Arc<Registry>) -> CommandOutcome {
    let opener = opener(&args.open, registry).map_err(failure)?;
    let refusal = ["a run", "gdg-tui runs lists runs without one"];
    let find = || {
        let (file, records) = to_watch(&args.file)?;
        let Some(file) = file else { return Ok(Err(records)) };
        let wish = Wish { file, beside: None, warning: None, watches: Some(records) };
        opener(wish, &Waiting::on("opening the run")).map(Ok)
    };
    on_screen(&args.open.screen, refusal, find, |found, interface| match found {
        Ok(opened) => shown(opened, interface),
        Err(records) => show(&[records], true, opener.clone(), interface),
    })
}

/// Returns checkpoint, once it is there, and records of a file's run; of a folder, of the latest one.
fn to_watch(given: &Path) -> Result<(Option<PathBuf>, PathBuf), Report> {
    let named = Some(checkpoint_file(&given.to_string_lossy()));
    let named = named.filter(|named| !given.exists() && named.exists());
    let given = named.as_deref().unwrap_or(given);
    let file = Some(whole(given)).filter(|_| !given.is_dir());
    let beside = file.as_deref().and_then(Path::parent);
    let is_meant = |run: &&Arc<SavedRun>| {
        let saves = run.saves.as_ref().map(|(path, _)| path);
        let own = [&run.source].into_iter().chain(&run.others).chain(&run.checkpoint);
        file.as_ref().is_none_or(|file| own.chain(saves).any(|own| whole(own) == *file))
    };
    let places = [Some(given), beside].into_iter().flatten().filter(|place| place.exists());
    let runs = read(&places.map(Path::to_owned).collect::<Vec<_>>());
    let goes_on = |run: &Arc<SavedRun>| run.state() == RunState::Running;
    let usable = runs.iter().filter(is_meant).filter(|run| goes_on(run) || run.kept().is_some());
    let last = usable.max_by_key(|run| (goes_on(run), run.written));
    let found = last.map(|run| (run.kept(), run.source.clone()));
    if found.is_none() && obstacle().is_none() {
        wait_for(given);
    }
    let own = || (Some(given.to_owned()), given.to_owned());
    found.or_else(|| is_named_like_one(given).then(own)).ok_or_else(|| {
        let problem = given.metadata().err().map(|error| format!("cannot be read: {error}"));
        let problem = problem.unwrap_or_else(|| NO_RUNS.to_owned());
        let help = "a run is seen as its checkpoint has it: train with --save FILE";
        miette!(help = help, "{}: {problem}", given.display())
    })
}

fn shown(opened: Opened, interface: &mut PreparedInterface) -> tui::Closing {
    match opened {
        Opened::Run(setup, elsewhere) => tui::run(*setup, elsewhere, interface),
        Opened::Comparison(both) => tui::compare(*both, interface),
    }
}

/// Returns what opens runs, as the commands that show one or two of them do.
fn opener(args: &OpenArgs, registry: &Arc<Registry>) -> Result<Opener, Report> {
    use clap::Parser;
    let mut train = Cli::try_parse_from(["gdg-tui"]).into_diagnostic()?.train;
    train.log_level = args.screen.log_level;
    let options = GymOptions { python: args.python.clone(), ..GymOptions::default() };
    let registry = registry.clone().with(|own| own.options = options);
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

/// Waits for a checkpoint that does not exist yet, in a folder that does, and says so.
fn wait_for(file: &Path) {
    let is_to_come = || {
        !file.exists() && absolute(file).is_ok_and(|file| file.parent().is_some_and(Path::exists))
    };
    if is_named_like_one(file) && is_to_come() {
        let file = file.display();
        eprint_line(&format!("waiting for {file}, which is not there yet: Ctrl-C ends"));
        while is_to_come() {
            std::thread::sleep(Duration::from_secs(1));
        }
    }
}
