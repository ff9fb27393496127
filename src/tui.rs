//! The terminal trainer: draws what the engine publishes and forwards user input.
//!
//! Three threads: the engine trains, the viewer ([`gdg::viewer`]) computes distance fields and
//! walks the test agent, and this one draws. No thread waits for another: each reads the latest
//! state that the others have published.
//!
//! The parts, each of which uses only those before it:
//!
//! * `theme`, `choices`, `pane_text`: colours, what there is to choose from, and words of other parts.
//! * `viewport`: what of a scene is shown, and where; `canvas`: its pixels, at any resolution;
//!   `characters` and `graphics` send them.
//! * `action`, `keymap`, `config`: the actions, their keys, and the user's configuration. The table
//!   of actions alone names what comes later: the functions that carry them out.
//! * `dialog`, `layout`, `log`: what a screen consists of besides the scene.
//! * `screen`: all of that, and the ways to trainer and viewer.
//! * `scene`: what is drawn in the place of the map, and how it reacts: a folder for each kind of
//!   world, with its state.
//! * `render`: the panes, dialogs and everything else around it; `lists`: what there is to pick from;
//!   `drawings`: writes what is shown to files.
//! * `interface`, `input`, `terminal`: what fills the screen, what comes from the terminal, and the
//!   terminal itself with the loop that forwards events and draws frames.
//! * `session`: a run on the screen, and what commands do with it; `compare`: two of them.
//! * `app`: the application, which gives events to the topmost dialog, or else to what is below.
//! * `runs`: the list of saved runs.

mod action;
mod app;
mod canvas;
mod characters;
mod choices;
mod compare;
mod config;
mod dialog;
mod drawings;
mod graphics;
mod input;
mod interface;
mod keymap;
mod layout;
mod lists;
mod log;
mod pane_text;
mod render;
mod runs;
mod scene;
mod screen;
mod session;
mod terminal;
#[cfg(test)]
mod tests;
mod theme;
mod viewport;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use crate::process::signals::TerminationSignal;
use crate::setup::{self, Setup};
use app::App;
pub use choices::Marker;
use compare::Comparison;
pub use compare::{ComparisonOptions, Contender, Contestants, prepare as prepare_comparison};
pub use config::{
    UiConfig, load as load_config, parse as parse_config, template as config_template,
};
use gdg::engine::{Engine, EngineCommand};
use gdg::learn::Threads;
use gdg::map::Reading;
use gdg::train::{Limits, Registry, SaveTo, Trainer};
use gdg::viewer::Viewer;
pub use keymap::Keymap;
pub use runs::{NO_RUNS, Opened, Opener, RunsScreen, Wish};
use session::Session;
pub use session::elsewhere::TrainedElsewhere;
use terminal::TerminalStage;

#[derive(Clone, Debug, clap::Args)]
pub struct InterfaceOptions {
    /// Configuration file for theme, keys etc., instead of the default one
    #[arg(long, value_name = "FILE")]
    pub ui_config: Option<PathBuf>,

    /// What the map is drawn with [default: auto: pixels where the terminal shows pictures, else
    /// half blocks or quadrants]
    #[arg(long, value_name = "MARKER", value_enum)]
    pub marker: Option<Marker>,
}

/// The configuration and the signals, opened before the interface starts.
pub struct PreparedInterface {
    config: UiConfig,
    keymap: Keymap,
    termination: TerminationSignal,
    /// Whether quitting leads back to a list of runs.
    pub from_list: bool,
    stage: TerminalStage,
}

impl PreparedInterface {
    /// Returns the exit status if a signal has ended the program.
    #[must_use]
    pub fn ended(&self) -> Option<u8> {
        self.termination.status()
    }
}

/// Open files that the interface needs besides: for terminal, signals and checkpoints.
const MIN_OPEN_FILES: usize = 24;

/// Reads the configuration and listens to signals. Called before anything else of the interface,
/// since both can fail.
pub fn prepare(options: &InterfaceOptions) -> Result<PreparedInterface, Report> {
    check_open_files()?;
    let (mut config, keymap) = config::load(options.ui_config.as_deref())?;
    config.marker = options.marker.unwrap_or(config.marker);
    let termination = TerminationSignal::listen_in_interface(terminal::restore)?;
    let stage = TerminalStage::new(config.marker, termination.clone());
    Ok(PreparedInterface { config, keymap, termination, from_list: false, stage })
}

/// Checks that as many files can be open as are needed: libraries panic otherwise.
fn check_open_files() -> Result<(), Report> {
    use std::os::fd::AsFd;
    let stdin = std::io::stdin();
    let opened: std::io::Result<Vec<_>> =
        (0..MIN_OPEN_FILES).map(|_| stdin.as_fd().try_clone_to_owned()).collect();
    opened.map(drop).map_err(|error| {
        let help = "raise the limit, e.g. ulimit -n 256, or train with --no-ui";
        miette!(help = help, "the interface needs {MIN_OPEN_FILES} more open files: {error}")
    })
}

/// The exit status, and the summary of files.
pub type Closing = Result<(u8, String), Report>;

/// Runs the trainer, or shows a run that another program trains.
pub fn run(
    setup: Setup,
    elsewhere: Option<TrainedElsewhere>,
    interface: &mut PreparedInterface,
) -> Closing {
    let Setup { trainer, limits, save, resumed, warnings, .. } = setup;
    // A resumed run is what the user wants.
    let is_new = resumed.is_none();
    // What is to be saved elsewhere is not saved yet.
    let resumed = resumed.filter(|_| save.is_none());
    // What is opened in a list is shown as it was saved, one run as well as two.
    let is_paused = elsewhere.is_some() || interface.from_list;
    let at_first = is_paused.then_some(EngineCommand::Pause);
    interface.show(trainer, (limits, at_first), resumed, save, |session| {
        session.screen.explains = is_new;
        warnings.iter().for_each(|warning| session.screen.notify(warning));
        elsewhere.into_iter().for_each(|files| session.watch(files));
    })
}

impl PreparedInterface {
    fn show(
        &mut self,
        trainer: Trainer,
        (limits, at_first): (Limits, Option<EngineCommand>),
        resumed: Option<PathBuf>,
        save: Option<SaveTo>,
        begin: impl FnOnce(&mut Session),
    ) -> Closing {
        let engine = Engine::resume(trainer, limits, resumed, at_first).into_diagnostic()?;
        let viewer = Viewer::start(&engine).into_diagnostic()?;
        let keymap = self.keymap.clone();
        let mut session = Session::new(engine.link(), viewer, &self.config, keymap, save);
        session.screen.from_list = self.from_list;
        begin(&mut session);
        self.stage.show(App::new(session), |app| app.close(vec![engine]))
    }
}

pub fn prepare_tour(threads: Threads, registry: &Arc<Registry>) -> Result<Trainer, Report> {
    let run = session::tour_run();
    let maze = setup::open_maze(Path::new(session::TOUR_MAP), &Reading::default(), &run, registry)?;
    setup::begin(run, &maze, registry, threads)
}

pub fn take_tour(trainer: Trainer, interface: &mut PreparedInterface) -> Closing {
    interface.show(trainer, (Limits::default(), None), None, None, Session::begin_tour)
}

pub fn compare(contestants: Contestants, interface: &mut PreparedInterface) -> Closing {
    let Contestants { both, warnings } = contestants;
    let PreparedInterface { config, keymap, from_list, stage, .. } = interface;
    let (mut comparison, engines) = Comparison::start(both, config, keymap, Limits::default())?;
    comparison.sessions.iter_mut().for_each(|s| s.screen.from_list = *from_list);
    if !warnings.is_empty() {
        comparison.notify(&warnings.join("; "));
    }
    stage.show(App::of(comparison), |app| app.close(engines.into()))
}
