//! The log file, for diagnosing failures afterwards.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use directories::ProjectDirs;
use jiff::Timestamp;
use log::{LevelFilter, Log, Metadata, Record};
use parking_lot::Mutex;

use gdg::text::sanitized_lines;

/// Number of days to keep.
const KEPT_DAYS: usize = 5;

/// Beginning and end of the files' names, with the date between.
const PREFIX: &str = "gdg-tui.";
const SUFFIX: &str = ".log";

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// The file of the day, in UTC, on which the program was started. Programs that share a folder add
/// to the same file.
struct LogFile(Mutex<File>);

impl Log for LogFile {
    fn enabled(&self, metadata: &Metadata) -> bool {
        // Nothing of other libraries.
        metadata.target().starts_with("gdg")
    }

    fn log(&self, record: &Record) {
        if !self.enabled(record.metadata()) {
            return;
        }
        let (now, level, target) = (Timestamp::now(), record.level(), record.target());
        // It may quote names and files.
        let text = sanitized_lines(&record.args().to_string());
        let line = format!("{now:.6} {level:>5} {target}: {text}\n");
        // Without space for a log, the program goes on.
        let _ = self.0.lock().write_all(line.as_bytes());
    }

    fn flush(&self) {}
}

/// Opens the file of a day and removes the oldest ones. Returns nothing if that fails, or if there
/// is something other than a file: opening a FIFO would block.
fn open(folder: &Path, date: &str) -> Option<File> {
    let path = folder.join(format!("{PREFIX}{date}{SUFFIX}"));
    if path.metadata().is_ok_and(|found| !found.is_file()) {
        return None;
    }
    let file = File::options().append(true).create(true).open(path).ok()?;
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_log = |name: &str| name.starts_with(PREFIX) && name.ends_with(SUFFIX);
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| is_log(name)).collect();
    names.sort();
    for oldest in &names[..names.len().saturating_sub(KEPT_DAYS)] {
        // Not a folder.
        let _ = std::fs::remove_file(folder.join(oldest));
    }
    Some(file)
}

/// Opens today's log file. If that fails, the program continues without a log.
pub fn start(level: LevelFilter) {
    let Some(dirs) = ProjectDirs::from("", "", "gdg-tui") else { return };
    let folder = dirs.state_dir().unwrap_or(dirs.data_local_dir()).join("log");
    if level == LevelFilter::Off || std::fs::create_dir_all(&folder).is_err() {
        return;
    }
    let today = Timestamp::now().strftime("%F").to_string();
    let Some(file) = open(&folder, &today) else { return };
    if log::set_boxed_logger(Box::new(LogFile(Mutex::new(file)))).is_ok() {
        log::set_max_level(level);
        let _ = FOLDER.set(folder);
        log::info!("gdg-tui {} started, process {}", env!("CARGO_PKG_VERSION"), std::process::id());
    }
}

/// Returns the folder of the log files, if logging is active.
pub fn folder() -> Option<&'static Path> {
    FOLDER.get().map(PathBuf::as_path)
}

/// Returns the location of the log, to append to an error; empty if there is none.
pub fn hint() -> String {
    folder().map_or(String::new(), |folder| format!("log: {}", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_day_has_a_file_of_safe_lines_and_only_the_newest_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |day: u8| folder.path().join(format!("gdg-tui.2026-03-0{day}.log"));
        for day in 1..=7 {
            let file = open(folder.path(), &format!("2026-03-0{day}")).expect("a file");
            let log = LogFile(Mutex::new(file));
            for (target, text) in
                [("gdg_tui::process", "ours\u{9b}31m\x7f\u{202e}"), ("mio::poll", "theirs")]
            {
                log.log(&Record::builder().target(target).args(format_args!("{text}")).build());
            }
        }
        let kept: Vec<u8> = (1..=7).filter(|day| path(*day).exists()).collect();
        assert_eq!(kept, [3, 4, 5, 6, 7]);
        // A file is continued.
        open(folder.path(), "2026-03-07").expect("a file").write_all(b"y").expect("space");
        let written = std::fs::read_to_string(path(7)).expect("a file");
        assert!(written.ends_with(" INFO gdg_tui::process: ours¿31m?\u{fffd}\ny"), "{written}");
        std::fs::create_dir(path(8)).expect("a folder");
        assert!(open(folder.path(), "2026-03-08").is_none());
    }
}
