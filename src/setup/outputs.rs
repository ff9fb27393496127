//! The files that a run writes: which may be replaced, and where the others go.

use std::io::Read;
use std::path::{Path, PathBuf, absolute};

use miette::{Report, miette};

use crate::setup::saves::{SAVES, is_named_like_one, recovered};
use gdg::files;
use gdg::map::image_named_in;
use gdg::train::{self, SaveTo};

/// Returns how to save to the path of `--save`: neither another run's file nor one that is not a
/// checkpoint is replaced.
pub fn save_to(path: &Path, resumed: Option<&Path>, overwrite: bool) -> Result<SaveTo, Report> {
    files::check_writable(path).map_err(|error| {
        let help = "give --save a file in a writable folder";
        miette!(help = help, "{}: a checkpoint cannot be saved here: {error}", path.display())
    })?;
    let own = resumed.is_some_and(|resumed| is_same_file(resumed, path));
    if !own && !is_named_like_one(path) {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let stem = stem.strip_suffix(".policy").unwrap_or(&stem).trim_start_matches('.');
        let name = path.with_file_name(format!("{stem}.safetensors"));
        return Err(miette!(
            help = format!("--save {}", name.display()),
            "{}: checkpoints end in .safetensors; gdg-tui runs lists no others",
            path.display()
        ));
    }
    if own && belongs_to_result(path) {
        let help = "give --save another name: the report has the job as it ended";
        return Err(miette!(help = help, "{}: belongs to a finished job", path.display()));
    }
    if overwrite && !own && path.exists() && !train::is_checkpoint(path) {
        let help = "give --save another name: --overwrite replaces only checkpoints of gdg-tui";
        let problem = "is not a checkpoint of gdg-tui: it is not replaced";
        return Err(miette!(help = help, "{}: {problem}", path.display()));
    }
    let to = if own || overwrite { SaveTo::Replace } else { SaveTo::CreateNew };
    Ok(to(path.to_owned()))
}

/// Whether a checkpoint is that of a finished job, whose result lies beside it.
pub fn belongs_to_result(checkpoint: &Path) -> bool {
    let is_job = |path: PathBuf| path.parent().is_some_and(|folder| folder.ends_with("jobs"));
    absolute(checkpoint).is_ok_and(is_job) && checkpoint.with_extension("json").is_file()
}

/// Checks that the output file of an `option` is not one of the command's inputs, the image of one, or
/// where its records go.
pub fn refuse_input<'a>(
    option: &str,
    path: &Path,
    inputs: impl Iterator<Item = &'a Path>,
) -> Result<(), Report> {
    let output = Path::new("/dev/stdout");
    let reads =
        |input: &Path| image_named_in(input).is_some_and(|image| is_same_file(&image, path));
    let of_image = |input: &Path| path.is_file() && reads(input);
    if inputs.chain([output]).any(|input| is_same_file(input, path) || of_image(input)) {
        let (file, help) = (path.display(), format!("give {option} another name"));
        return Err(miette!(help = help, "{file}: is used by this run and is not replaced"));
    }
    Ok(())
}

pub fn is_same_file(a: &Path, b: &Path) -> bool {
    // Comparing opens them, which would block on a pipe. Neither may be there yet.
    let is_one = a.is_file() && b.is_file() && same_file::is_same_file(a, b).unwrap_or(false);
    is_one || absolute(a).is_ok_and(|a| absolute(b).is_ok_and(|b| a == b))
}

/// Rejects the path of an existing file unless it may be replaced: only regular files are, and
/// checkpoints only by checkpoints.
pub fn refuse_existing(path: &Path, overwrite: bool) -> Result<(), Report> {
    if path.symlink_metadata().is_err() {
        return Ok(());
    }
    if train::is_checkpoint(path) {
        let (file, help) = (path.display(), "give another name");
        return Err(miette!(help = help, "{file}: is a checkpoint and is not replaced"));
    }
    if let Ok(found) = path.metadata()
        && !found.is_file()
    {
        let (file, help) = (path.display(), "give the name of a file");
        return Err(miette!(help = help, "{file}: cannot be written: it is not a regular file"));
    }
    if overwrite {
        return Ok(());
    }
    let help = "give another name, or --overwrite";
    Err(miette!(help = help, "{}: the file already exists", path.display()))
}

/// Checks that an existing file, which `--overwrite` would replace, is empty or begins as `what` does:
/// it may be what a run has learned from, or a program.
pub fn refuse_other_kind(path: &Path, what: &str, is: fn(&[u8]) -> bool) -> Result<(), Report> {
    let mut start = Vec::new();
    let read = files::open(path).and_then(|file| file.take(32).read_to_end(&mut start));
    if read.is_err() || start.is_empty() || is(&start) {
        return Ok(());
    }
    let (file, help) = (path.display(), "give another name");
    Err(miette!(help = help, "{file}: is not {what} and is not replaced"))
}

/// Writes a file, and the folders that it is in, under another name; returns what gives it its own, and
/// returns a line that says where: of several files, all are written before any is replaced.
pub fn prepare_file<'a>(
    path: &'a Path,
    bytes: &[u8],
) -> Result<impl FnOnce() -> Result<String, Report> + use<'a>, Report> {
    let failed = |error: std::io::Error| {
        let help = "give --out a file in a writable folder";
        miette!(help = help, "{}: cannot be written: {error}", path.display())
    };
    let place = files::prepare(path, bytes).map_err(failed)?;
    Ok(move || place().map_err(failed).map(|()| format!("{}\n", path.display())))
}

/// Returns where a file that cannot be saved to `path` goes instead: beside it, as the file itself may
/// be what cannot be replaced, in `saves/`, in the user's state folder, or in that for temporary files.
pub fn elsewhere(path: &Path) -> Vec<PathBuf> {
    let name = path.file_name().unwrap_or_default();
    let folders =
        [Some(SAVES.into()), recovered(), Some(std::env::temp_dir())].into_iter().flatten();
    let others = folders.map(|folder| folder.join(name));
    std::iter::once(files::numbered(path, 2)).chain(others).collect()
}

/// Returns the ways to save a run to one of the files [`elsewhere`]; the last has a name that every file
/// system accepts.
pub fn to_elsewhere(path: &Path) -> impl Iterator<Item = SaveTo> {
    let places = elsewhere(path).into_iter().chain(elsewhere(Path::new("recovered.safetensors")));
    places.map(|place| {
        if train::is_own(&place) { SaveTo::Replace(place) } else { SaveTo::CreateNew(place) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_is_saved_only_where_it_is_listed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("lab.txt"), "S.G").expect("a map");
        for name in ["lab.txt", "lab", "lab.policy.safetensors", ".lab.safetensors"] {
            let error = save_to(&path(name), None, true).expect_err("no name of a checkpoint");
            let help = error.help().map(|help| help.to_string()).unwrap_or_default();
            assert!(help.ends_with("/lab.safetensors"), "{name}: {help}");
        }
        assert!(save_to(&path("LAB.SAFETENSORS"), None, false).is_ok());
        // As earlier versions have saved it.
        assert!(save_to(&path("lab.txt"), Some(&path("lab.txt")), false).is_ok());
    }
}
