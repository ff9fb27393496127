//! Saved runs: a folder's checkpoints, the newest of them, and the command that continues one.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use directories::ProjectDirs;
use jiff::tz::TimeZone;
use jiff::{Timestamp, Zoned};

use gdg::env::{GymOptions, gym};
use gdg::files::{has_extension, is_hidden};
use gdg::text::safe_file_name;
use gdg::train::{RunDescription, describe};

/// Default folders for checkpoints and for exports.
pub const SAVES: &str = "saves";
pub const EXPORTS: &str = "exports";

/// Returns the folder for what cannot be saved where it should be, in the user's state folder.
pub fn recovered() -> Option<PathBuf> {
    let own = ProjectDirs::from("", "", "gdg-tui")?;
    Some(own.state_dir().unwrap_or(own.data_local_dir()).join("recovered"))
}

/// Extensions of checkpoints, and of exported policies, which are not checkpoints.
const EXTENSION: &str = ".safetensors";
const POLICY_EXTENSION: &str = ".policy.safetensors";

/// Returns whether a file is named like a checkpoint, in capitals or not.
pub fn is_named_like_one(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    name.ends_with(EXTENSION) && !name.ends_with(POLICY_EXTENSION) && !is_hidden(file)
}

/// Returns the files in `folder` that are named like checkpoints, in capitals or not, sorted.
pub fn files_in(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if is_named_like_one(&path) && !path.is_dir() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Returns the file of the checkpoint called `name`, which may be a path.
pub fn checkpoint_file(name: &str) -> PathBuf {
    // A dot within a name does not begin an extension.
    let is_whole = has_extension(Path::new(name), "safetensors");
    let path = PathBuf::from(if is_whole { name.to_owned() } else { name.to_owned() + EXTENSION });
    let plain = path.parent().is_none_or(|folder| folder.as_os_str().is_empty());
    if plain { Path::new(SAVES).join(path) } else { path }
}

/// Returns the checkpoint in `folder` that was written last, of the world with this title if one is
/// given. Damaged files are skipped; a folder that cannot be read counts as empty.
pub fn newest(folder: &Path, title: Option<&str>) -> Option<RunDescription> {
    let title = title.map(safe_file_name);
    let files = newest_first(files_in(folder).unwrap_or_default()).into_iter();
    let mut found = files.filter_map(|path| describe(&path).ok());
    found.find(|found| title.as_ref().is_none_or(|title| *title == found.title))
}

/// Returns the files that are there, the one written last first.
pub fn newest_first(files: impl IntoIterator<Item = PathBuf>) -> Vec<PathBuf> {
    let written = |path: PathBuf| Some((std::fs::metadata(&path).ok()?.modified().ok()?, path));
    let mut files: Vec<_> = files.into_iter().filter_map(written).collect();
    files.sort();
    files.into_iter().rev().map(|(_, path)| path).collect()
}

/// Returns a success rate, or a dash if there is none.
pub fn rate(rate: Option<f64>) -> String {
    rate.map_or("-".to_owned(), |rate| format!("{rate:.2}"))
}

/// Returns the command that continues the run saved in `file`, quoted for a shell, with the `options`
/// that an environment in Python needs again.
pub fn resume_command(file: &Path, options: &GymOptions) -> String {
    let quoted = |path: &Path| {
        let text = path.to_string_lossy();
        // Otherwise, it would look like an option.
        let text = if text.starts_with('-') { format!("./{text}").into() } else { text };
        shlex::try_quote(&text).unwrap_or_else(|_| text.clone()).into_owned()
    };
    let (GymOptions { workers, timeout, .. }, default) = (options, GymOptions::default());
    let workers = (*workers != default.workers).then(|| format!(" --workers {workers}"));
    let seconds = (*timeout != default.timeout).then_some(timeout.as_secs_f64());
    let timeout = seconds.map(|seconds| format!(" --env-timeout {seconds}"));
    let is_python = describe(file).is_ok_and(|found| found.world == gym::KIND.name);
    let more = workers.into_iter().chain(timeout).filter(|_| is_python);
    format!("gdg-tui --resume {}{}", quoted(file), more.collect::<String>())
}

/// Describes how long ago something happened, if that is known: `25 minutes ago`, `yesterday`.
pub fn ago(at: SystemTime) -> Option<String> {
    let at = Timestamp::try_from(at).ok()?.to_zoned(TimeZone::system());
    Some(age(&at, &Zoned::now()))
}

fn age(at: &Zoned, now: &Zoned) -> String {
    let minutes = (now.timestamp().as_second() - at.timestamp().as_second()) / 60;
    let days = (now.date() - at.date()).get_days();
    match (minutes, days) {
        (..=0, _) => "just now".to_owned(),
        (1, _) => "a minute ago".to_owned(),
        (2..=59, _) => format!("{minutes} minutes ago"),
        (_, ..=0) => format!("today, {}", at.strftime("%R")),
        (_, 1) => "yesterday".to_owned(),
        (_, 2..=6) => format!("{days} days ago"),
        _ => at.strftime("%F").to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ages_are_given_as_people_say_them() {
        let now: Zoned = "2026-03-10T09:30:00[UTC]".parse().expect("a time");
        for (at, expected) in [
            ("03-10T09:29:50", "just now"),
            // Another machine's clock may be ahead.
            ("03-10T10:29:50", "just now"),
            ("03-10T09:28:50", "a minute ago"),
            ("03-10T09:05:00", "25 minutes ago"),
            ("03-10T00:05:00", "today, 00:05"),
            ("03-09T23:50:00", "yesterday"),
            ("03-07T23:50:00", "3 days ago"),
            ("01-02T03:04:05", "2026-01-02"),
        ] {
            assert_eq!(age(&format!("2026-{at}[UTC]").parse().expect("a time"), &now), expected);
        }
    }

    #[test]
    fn the_command_survives_a_shell() {
        let command = |file: &str| resume_command(Path::new(file), &GymOptions::default());
        assert_eq!(command("saves/a.safetensors"), "gdg-tui --resume saves/a.safetensors");
        let odd = command("my runs/it's.safetensors");
        assert_eq!(shlex::split(&odd).expect("words")[2], "my runs/it's.safetensors", "{odd}");
    }

    #[test]
    fn policies_and_damaged_files_are_no_newest_checkpoint() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["a.policy.safetensors", "b.safetensors"] {
            std::fs::write(folder.path().join(name), "damaged").expect("a file");
        }
        assert!(newest(folder.path(), None).is_none());
        assert!(newest(&folder.path().join("none"), None).is_none());
        let found = files_in(folder.path()).expect("the folder");
        assert_eq!(found, [folder.path().join("b.safetensors")]);
    }
}
