//! File systems, names and other programs: what was saved is never lost.

use std::path::PathBuf;

use gdg::files;

use super::*;

/// Arguments of a short run that is saved several times.
const SHORT: [&str; 6] = ["--eval-tasks", "1", "--save-every", "0.002", "--max-updates", "200"];

/// Returns the names of the files in a folder, sorted; the user's own folder is not among them.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name());
    let names = entries.map(|name| name.to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|name| name != "home").collect();
    names.sort();
    names
}

/// File systems that refuse system calls.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
mod lacking {
    use std::collections::BTreeMap;

    use nix::libc;
    use seccompiler::{
        BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
        SeccompRule, TargetArch, apply_filter,
    };

    use super::*;

    /// System calls, and how they fail.
    type Refused<'a> = (&'a [i64], i32);

    const LINKS: &[i64] = &[libc::SYS_link, libc::SYS_linkat];
    const MODES: &[i64] =
        &[libc::SYS_chmod, libc::SYS_fchmod, libc::SYS_fchmodat, libc::SYS_fchown];
    const SYNC: &[i64] = &[libc::SYS_fsync, libc::SYS_fdatasync];
    const LOCKS: &[i64] = &[libc::SYS_flock];
    const RENAMES: &[i64] = &[libc::SYS_rename, libc::SYS_renameat];
    /// Renames that do not replace are a kind of [`libc::SYS_renameat2`].
    const NO_REPLACE: &[i64] = &[libc::SYS_renameat2];

    /// Runs `work` where system calls fail, for it and for the programs that it starts.
    fn without<T: Send>(refused: &[Refused], work: impl FnOnce() -> T + Send) -> T {
        let refuse = |(calls, error): &Refused| {
            let has_flags =
                SeccompCondition::new(4, SeccompCmpArgLen::Dword, SeccompCmpOp::Ne, 0).unwrap();
            let rules = |call: i64| match call {
                libc::SYS_renameat2 => vec![SeccompRule::new(vec![has_flags.clone()]).unwrap()],
                _ => Vec::new(),
            };
            let rules: BTreeMap<i64, Vec<SeccompRule>> =
                calls.iter().map(|call| (*call, rules(*call))).collect();
            let fails = SeccompAction::Errno(*error as u32);
            let filter =
                SeccompFilter::new(rules, SeccompAction::Allow, fails, TargetArch::x86_64).unwrap();
            let program: BpfProgram = filter.try_into().unwrap();
            apply_filter(&program).unwrap();
        };
        let within = || {
            refused.iter().for_each(refuse);
            work()
        };
        std::thread::scope(|scope| scope.spawn(within).join().unwrap())
    }

    #[test]
    fn what_a_file_system_lacks_is_done_without() {
        let cases: [&[Refused]; 4] = [
            &[(LINKS, libc::EIO), (NO_REPLACE, libc::EIO)],
            &[(SYNC, libc::EINVAL), (MODES, libc::EPERM)],
            &[(LINKS, libc::EOPNOTSUPP), (NO_REPLACE, libc::EPERM), (LOCKS, libc::ENOLCK)],
            &[
                (LINKS, libc::EPERM),
                (NO_REPLACE, libc::EINVAL),
                (MODES, libc::EPERM),
                (SYNC, libc::ENOSYS),
                (LOCKS, libc::ENOSYS),
            ],
        ];
        for (case, refused) in cases.into_iter().enumerate() {
            let folder = folder();
            let path = folder.path().join("x.safetensors");
            let often = ["--save", "x.safetensors", "--save-every", "0.002", "--eval-tasks", "1"];
            let first: &[&str] = &["trap", "--max-updates", "40"];
            let second: &[&str] = &["--resume", "x.safetensors", "--max-updates", "80"];
            for (args, updates) in [(first, 40), (second, 80)] {
                if path.exists() {
                    // Not what a new file has.
                    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o666)).unwrap();
                }
                let mut command = headless(folder.path(), &[args, &often].concat());
                let (status, output, errors) = without(refused, || outcome(&mut command));
                assert_eq!((status, errors.as_str()), (0, ""), "{case}");
                let saved =
                    events(&output).iter().filter(|event| event["event"] == "saved").count();
                assert!(saved > 1, "{case}: {output}");
                assert_eq!(assert_loads(&path), updates, "{case}");
                assert_eq!(names(folder.path()), ["x.safetensors"], "{case}");
            }
        }
    }

    #[test]
    fn a_file_system_that_loses_what_is_written_is_refused_before_training() {
        for error in [libc::EIO, libc::EDQUOT] {
            let folder = folder();
            let mut command = headless(
                folder.path(),
                &[&["trap", "--save", "x.safetensors"][..], &SHORT].concat(),
            );
            let (status, output, errors) = without(&[(SYNC, error)], || outcome(&mut command));
            assert_eq!((status, output.as_str()), (2, ""), "{errors}");
            assert!(one_line(&errors).contains("a checkpoint cannot be saved here"), "{errors}");
            assert!(names(folder.path()).is_empty());
        }
    }

    #[test]
    fn a_file_system_that_cannot_rename_is_refused_before_training() {
        let folder = folder();
        let mut command = headless(
            folder.path(),
            &[&["trap", "--save", "new/x.safetensors"][..], &SHORT].concat(),
        );
        let refused = [(RENAMES, libc::EPERM), (NO_REPLACE, libc::EPERM)];
        let (status, output, errors) = without(&refused, || outcome(&mut command));
        assert_eq!((status, output.as_str()), (2, ""), "{errors}");
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn experiments_need_neither_links_nor_permissions() {
        let folder = folder();
        let refused = [
            (LINKS, libc::EPERM),
            (NO_REPLACE, libc::EINVAL),
            (MODES, libc::EPERM),
            (LOCKS, libc::ENOSYS),
        ];
        let (status, _, errors) = without(&refused, || outcome(&mut suite(folder.path(), "30")));
        assert_eq!(status, 0, "{errors}");
        let jobs = names(&folder.path().join("out/jobs"));
        assert_eq!(jobs.len(), 2, "the result and the checkpoint: {jobs:?}");
        assert!(folder.path().join("out/report.md").is_file());
    }

    #[test]
    fn a_file_that_cannot_be_replaced_stays_as_it_was() {
        let folder = folder();
        let path = checkpoint(folder.path());
        let before = std::fs::read(&path).unwrap();
        let save = |path: &Path| {
            let trainer = train::load(path, &Registry::builtin(), 1).unwrap();
            train::save(&trainer, &SaveTo::Replace(path.to_owned()))
        };
        without(&[(RENAMES, libc::EPERM)], || save(&path).unwrap_err());
        assert_eq!(std::fs::read(&path).unwrap(), before);
        assert_eq!(save(&path).unwrap(), path);
        assert_eq!(names(folder.path()), ["small.safetensors"]);
    }

    #[test]
    fn without_locks_an_autosave_that_another_program_has_saved_to_is_kept() {
        let (folder, mut session, autosave) = autosaving();
        let written = without(&[(LOCKS, libc::ENOSYS)], || {
            let mut other = train::load(&autosave, &Registry::builtin(), 1).unwrap();
            // The same contents would count as the run's own.
            other.tick().unwrap();
            train::save(&other, &SaveTo::Replace(autosave.clone())).unwrap()
        });
        assert_eq!(written, autosave);
        outlives_the_run_that_made_it(&autosave, folder.path(), &mut session);
    }
}

/// Returns a command for a suite of one small job.
fn suite(folder: &Path, budget: &str) -> Command {
    std::fs::create_dir_all(folder.join("maps")).unwrap();
    std::fs::write(
        folder.join("maps/open.map"),
        "type octile\nheight 2\nwidth 6\nmap\n......\n......\n",
    )
    .unwrap();
    let mut command = isolated_command(folder);
    command.args(["suite", "maps", "--out", "out", "--budget", budget, "--eval-tasks", "1"]);
    command.args(["--set", "hidden=16", "--set", "buffer_size=20000", "--set", "candidates=50"]);
    command
}

#[test]
fn autosaves_go_elsewhere_where_their_folder_takes_nothing() {
    let folder = folder();
    std::fs::create_dir(folder.path().join("gdg-tui")).unwrap();
    std::fs::write(folder.path().join("gdg-tui/config.toml"), "autosave_minutes = 0.01\n").unwrap();
    std::fs::write(folder.path().join("saves"), "in the way").unwrap();
    let mut session = Session::start(folder.path(), &["trap"]);
    session.wait_for("recovered");
    session.signal("KILL");
    session.status();
    let found = checkpoints(folder.path());
    assert!(found.iter().any(|path| train::describe(path).is_ok()), "{found:?}");
}

/// Starts a run in the interface that autosaves all the time, and pauses it, as it would soon remove
/// its autosaves; returns its folder and the autosave that it would remove last.
fn autosaving() -> (tempfile::TempDir, Session, PathBuf) {
    let folder = folder();
    std::fs::create_dir(folder.path().join("gdg-tui")).unwrap();
    std::fs::write(folder.path().join("gdg-tui/config.toml"), "autosave_minutes = 0.01\n").unwrap();
    let mut session = Session::start(folder.path(), &["trap"]);
    let updates = |path: &PathBuf| train::describe(path).map_or(0, |found| found.updates);
    session.wait(|_| checkpoints(folder.path()).iter().any(|path| updates(path) > 0));
    session.press_for(" ", "paused");
    let autosave = checkpoints(folder.path()).into_iter().max_by_key(updates).unwrap();
    assert!(autosave.to_string_lossy().contains("-auto-"), "{}", autosave.display());
    (folder, session, autosave)
}

/// Checks that a file stays as it is when the paused run goes on and its autosaves beside it are
/// removed: in turn, and when it is saved.
fn outlives_the_run_that_made_it(file: &Path, folder: &Path, session: &mut Session) {
    let before = std::fs::read(file).unwrap();
    let updates = |path: &PathBuf| train::describe(path).map_or(0, |found| found.updates);
    let later = || checkpoints(folder).iter().map(updates).max().unwrap_or(0);
    session.press(" ");
    for _ in 0..5 {
        let latest = later();
        session.wait(|_| later() > latest);
    }
    session.press_for(" ", "paused");
    session.press_for("s", "saved saves/trap");
    session.press("q");
    assert_eq!(session.status(), 0);
    assert_eq!(std::fs::read(file).unwrap(), before);
    let left = checkpoints(folder);
    assert!(
        left.len() == 2 && left.contains(&file.to_owned()),
        "its own and the other's: {left:?}"
    );
}

#[test]
fn an_autosave_of_a_living_run_is_resumed_under_another_name() {
    let (folder, mut session, autosave) = autosaving();
    let name = autosave.strip_prefix(folder.path()).unwrap().to_str().unwrap();
    let updates = (train::describe(&autosave).unwrap().updates + 20).to_string();
    let args = ["--resume", name, "--save", name, "--eval-tasks", "1", "--max-updates", &updates];
    let (status, output, errors) = outcome(&mut headless(folder.path(), &args));
    assert_eq!(status, 0, "{errors}");
    assert!(errors.contains("another program still trains this run"), "{errors}");
    let saved = events(&output).into_iter().find(|event| event["event"] == "saved").unwrap();
    let other = folder.path().join(saved["path"].as_str().unwrap());
    assert_ne!(other, autosave);
    outlives_the_run_that_made_it(&other, folder.path(), &mut session);
}

#[test]
fn a_file_that_another_program_is_replacing_is_left_to_it() {
    let folder = folder();
    let path = checkpoint(folder.path());
    let args =
        ["--resume", "small.safetensors", "--save", "small.safetensors", "--eval-tasks", "1"];
    let mut command = headless(folder.path(), &[&args[..], &["--max-updates", "360"]].concat());
    let (status, output, errors) = files::while_locked(&path, || outcome(&mut command)).unwrap();
    assert_eq!(status, 0, "{errors}");
    assert!(output.contains("small-2.safetensors"), "{output}");
    let why =
        "small.safetensors is saved by another program as well: saving to small-2.safetensors";
    assert!(one_line(&errors).contains(why), "{errors}");
    assert_eq!(assert_loads(&path), 350);
    assert_eq!(names(folder.path()), ["small-2.safetensors", "small.safetensors"]);
}

#[test]
fn programs_that_resume_one_file_lose_nothing() {
    let folder = folder();
    let path = checkpoint(folder.path());
    for round in 0..3 {
        let updates = (400 + round).to_string();
        let args =
            ["--resume", "small.safetensors", "--save", "small.safetensors", "--eval-tasks", "1"];
        let args =
            [&args[..], &["--save-every", "0.00001", "--threads", "1", "--max-updates", &updates]]
                .concat();
        let start = |_| {
            headless(folder.path(), &args)
                .stdout(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .unwrap()
        };
        let both = [0, 1].map(start).map(|child| child.wait_with_output().unwrap());
        let saved = both.map(|output| {
            assert!(output.status.success());
            let events = events(&String::from_utf8(output.stdout).unwrap());
            events.into_iter().rfind(|event| event["event"] == "saved").unwrap()["path"]
                .as_str()
                .unwrap()
                .to_owned()
        });
        assert_ne!(saved[0], saved[1], "the last save of each stays");
        assert!(
            saved.iter().all(|name| assert_loads(&folder.path().join(name)) == 400 + round),
            "{saved:?}"
        );
        assert!(saved.contains(&"small.safetensors".to_owned()), "{saved:?}");
        assert!(
            path.is_file() && !names(folder.path()).iter().any(|name| name.starts_with(".gdg-"))
        );
    }
}

#[test]
fn a_file_whose_inode_or_time_changes_is_still_the_runs_own() {
    let folder = folder();
    let path = checkpoint(folder.path());
    let trainer = train::load(&path, &Registry::builtin(), 1).unwrap();
    // As file systems do that have no lasting inodes, or round times later.
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(train::save(&trainer, &SaveTo::Replace(path.clone())).unwrap(), path);
}

#[test]
fn names_of_any_length_work_for_every_save_or_are_refused_before_training() {
    let folder = folder();
    for bytes in [231, 243, 255] {
        let name = "x".repeat(bytes - 12) + ".safetensors";
        let (status, output, errors) = outcome(&mut headless(
            folder.path(),
            &[&["trap", "--save", &name], &SHORT[..]].concat(),
        ));
        assert_eq!((status, errors.as_str()), (0, ""), "{bytes}");
        assert!(
            events(&output).iter().filter(|event| event["event"] == "saved").count() > 1,
            "{output}"
        );
        assert_eq!(names(folder.path()), [name.as_str()], "{bytes}");
        // Another run's, and what is made from it.
        let (status, _, errors) = outcome(&mut headless(
            folder.path(),
            &[&["trap", "--save", &name], &SHORT[..]].concat(),
        ));
        assert!(status == 0 && one_line(&errors).contains("belongs to another run"), "{errors}");
        for command in ["export-policy", "export-data"] {
            let (status, output, errors) =
                outcome(isolated_command(folder.path()).args([command, &name]));
            assert_eq!(status, 0, "{errors}");
            assert!(folder.path().join(output.trim_end()).is_file());
        }
        let made = [names(folder.path()), names(&folder.path().join("exports"))].concat();
        assert!(made.len() == 5 && made.iter().all(|name| name.len() <= 255), "{made:?}");
        std::fs::remove_dir_all(folder.path()).unwrap();
        std::fs::create_dir(folder.path()).unwrap();
    }
    let name = "x".repeat(256);
    let (status, output, errors) =
        outcome(&mut headless(folder.path(), &["trap", "--save", &name]));
    assert_eq!((status, output.as_str()), (2, ""));
    assert!(one_line(&errors).contains("its name has 256 bytes"), "{errors}");
}

#[test]
fn a_map_with_a_long_name_is_saved_by_interface_autosave_and_hangup() {
    let folder = folder();
    let map = "迷".repeat(80) + ".txt";
    std::fs::write(folder.path().join(&map), "S.......\n........\n.......G\n").unwrap();
    std::fs::create_dir(folder.path().join("gdg-tui")).unwrap();
    std::fs::write(folder.path().join("gdg-tui/config.toml"), "autosave_minutes = 0.01\n").unwrap();
    let mut session = Session::start(folder.path(), &[&map]);
    let found = |folder: &Path| checkpoints(folder);
    session.wait(|_| found(folder.path()).iter().any(|path| train::describe(path).is_ok()));
    session.press("s");
    session.wait(|_| {
        found(folder.path()).iter().any(|path| !path.to_string_lossy().contains("-auto-"))
    });
    session.press("q");
    session.wait_for_end_or("quit");
    session.press("\r");
    assert_eq!(session.status(), 0);
    let saved = found(folder.path());
    let name = saved[0].file_name().unwrap().to_str().unwrap();
    assert!(
        saved.len() == 1
            && name.starts_with('迷')
            && name.ends_with("-gdg-bridge-seed0.safetensors"),
        "{saved:?}"
    );
    assert!(assert_loads(&saved[0]) > 0);
    std::fs::remove_dir_all(folder.path().join("saves")).unwrap();
    std::fs::remove_dir_all(folder.path().join("gdg-tui")).unwrap();
    let session = Session::start(folder.path(), &[&map]);
    session.wait_for("elapsed    0:00:03");
    let mut child = session.close_terminal();
    assert_eq!(child.wait().unwrap().exit_code(), 129);
    assert_eq!(found(folder.path()), saved);
}

#[test]
fn a_name_that_is_too_long_is_refused_where_it_is_typed() {
    let folder = folder();
    let mut session = Session::start(folder.path(), &["trap"]);
    session.wait_for("training");
    session.press(":");
    session.press_for("save-as\r", "name of the checkpoint");
    session.press(&format!("{}\r", "x".repeat(300)));
    session.wait_for("more than the 255");
    session.signal("KILL");
    session.status();
}

#[test]
fn what_is_in_the_way_of_an_experiments_files_is_refused() {
    let folder = folder();
    let (status, _, errors) = outcome(&mut suite(folder.path(), "30"));
    assert_eq!(status, 0, "{errors}");
    let jobs = folder.path().join("out/jobs");
    let job = names(&jobs)
        .into_iter()
        .find_map(|name| name.strip_suffix(".json").map(str::to_owned))
        .unwrap();
    std::fs::remove_file(jobs.join(format!("{job}.json"))).unwrap();
    let refused = |path: PathBuf, why: &str| {
        let before = std::fs::read(&path).ok();
        let _ = std::fs::remove_file(&path);
        std::fs::create_dir(&path).unwrap();
        let (status, _, errors) = outcome(&mut suite(folder.path(), "30"));
        assert!(
            status != 0 && one_line(&errors).contains(why) && !errors.contains("begins"),
            "{}: {errors}",
            path.display()
        );
        std::fs::remove_dir(&path).unwrap();
        if let Some(bytes) = before {
            std::fs::write(&path, bytes).unwrap();
        }
    };
    for path in ["report.md".into(), format!("jobs/{job}.json"), format!("pictures/{job}.png")] {
        refused(folder.path().join("out").join(path), "is a directory");
    }
    let checkpoint = jobs.join(format!("{job}.safetensors"));
    std::fs::write(&checkpoint, "mine").unwrap();
    let (status, _, errors) = outcome(&mut suite(folder.path(), "30"));
    assert!(status == 1 && one_line(&errors).contains("is not a checkpoint of"), "{errors}");
    assert_eq!(std::fs::read_to_string(&checkpoint).unwrap(), "mine");
}

/// Starts a suite and waits until its job has begun; returns it with the job's name.
fn begun(command: &mut Command) -> (Child, String) {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let begins = lines
        .find_map(|line| line.unwrap().split_once(": begins").map(|(name, _)| name.to_owned()));
    // Read to the end: a program whose standard error is closed could not write to it.
    std::thread::spawn(move || lines.count());
    (child, begins.unwrap())
}

#[test]
fn a_picture_that_cannot_be_written_does_not_cost_the_result() {
    let folder = folder();
    let others = checkpoint(folder.path());
    let (mut child, job) = begun(suite(folder.path(), "1500").arg("--no-keep"));
    std::fs::write(folder.path().join("out/pictures"), "mine").unwrap();
    let kept = folder.path().join(format!("out/jobs/{job}.safetensors"));
    std::fs::copy(others, &kept).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(1), "it says so");
    assert!(folder.path().join(format!("out/jobs/{job}.json")).is_file());
    assert!(kept.is_file(), "what another program has saved there is not removed");
}

#[test]
fn a_job_that_cannot_be_saved_to_its_folder_is_saved_elsewhere_and_found_again() {
    let folder = folder();
    let (mut child, job) = begun(&mut suite(folder.path(), "200000"));
    let (jobs, moved) = (folder.path().join("out/jobs"), folder.path().join("moved"));
    std::fs::rename(&jobs, &moved).unwrap();
    std::fs::write(&jobs, "in the way").unwrap();
    kill(child.id(), "TERM");
    assert_eq!(child.wait().unwrap().code(), Some(143));
    let kept = folder.path().join(format!("saves/{job}.safetensors"));
    let updates = assert_loads(&kept);
    std::fs::remove_file(&jobs).unwrap();
    std::fs::rename(&moved, &jobs).unwrap();
    let mut again = suite(folder.path(), "200000")
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(again.stderr.take().unwrap()).lines();
    let resumes =
        lines.find_map(|line| line.ok().filter(|line| line.contains(": resumes after"))).unwrap();
    assert!(resumes.contains(&format!("resumes after {updates} of")), "{resumes}");
    kill(again.id(), "TERM");
    again.wait().unwrap();
}
