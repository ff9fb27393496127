//! The log file, for diagnosing failures afterwards.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use clap::ValueEnum;
use directories::ProjectDirs;
use tracing::level_filters::LevelFilter;
use tracing_appender::rolling::{RollingFileAppender, Rotation};

/// Number of days to keep.
const KEPT_DAYS: usize = 5;

/// Beginning and end of the files' names, with the date between.
const PREFIX: &str = "gdg-tui";
const SUFFIX: &str = "log";

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// Severity of messages for the log file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogLevel {
    /// No log file
    Off,
    /// Errors
    Error,
    /// Also recovered problems
    Warn,
    /// Also runs started, saved, loaded and changed
    Info,
    /// Everything
    Debug,
}

/// Opens today's log file. If that fails, the program continues without a log.
pub fn start(level: LogLevel) {
    let level = match level {
        LogLevel::Off => return,
        LogLevel::Error => LevelFilter::ERROR,
        LogLevel::Warn => LevelFilter::WARN,
        LogLevel::Info => LevelFilter::INFO,
        LogLevel::Debug => LevelFilter::DEBUG,
    };
    let Some(dirs) = ProjectDirs::from("", "", "gdg-tui") else { return };
    let folder = dirs.state_dir().unwrap_or(dirs.data_local_dir()).join("log");
    // The library would report a missing folder on standard error.
    if std::fs::create_dir_all(&folder).is_err() || !holds_only_files(&folder) {
        return;
    }
    let file = RollingFileAppender::builder()
        .rotation(Rotation::DAILY)
        .filename_prefix(PREFIX)
        .filename_suffix(SUFFIX);
    let Ok(file) = file.max_log_files(KEPT_DAYS).build(&folder) else { return };
    let log =
        tracing_subscriber::fmt().with_max_level(level).with_ansi(false).log_internal_errors(false);
    if log.with_writer(std::sync::Mutex::new(file)).try_init().is_ok() {
        let _ = FOLDER.set(folder);
        tracing::info!(
            "gdg-tui {} started, process {}",
            env!("CARGO_PKG_VERSION"),
            std::process::id()
        );
    }
}

/// Returns whether everything named like a log file is a regular file: opening a FIFO would block.
fn holds_only_files(folder: &Path) -> bool {
    let has_name = |path: &Path| {
        path.extension().is_some_and(|end| end == SUFFIX)
            && path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(PREFIX))
    };
    let mut entries =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    // A dangling link does no harm.
    entries.all(|path| {
        !has_name(&path) || path.metadata().is_ok_and(|file| file.is_file()) || !path.exists()
    })
}

/// Returns the folder of the log files, if logging is active.
pub fn folder() -> Option<&'static Path> {
    FOLDER.get().map(PathBuf::as_path)
}

/// Returns the location of the log, to append to an error; empty if there is none.
pub fn hint() -> String {
    folder().map_or(String::new(), |folder| format!("log: {}", folder.display()))
}
