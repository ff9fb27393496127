//! What a machine, a container or a job leaves to the program: memory, open files, time.

use std::process::Command;

use super::command_line::typed;
use super::{events, folder};
use crate::support::{Session, after, headless, outcome};

const SHORT: [&str; 5] = ["trap", "--max-updates", "5", "--eval-tasks", "1"];

#[test]
#[ignore = "needs a system that lets one hide /proc"]
fn the_program_trains_without_proc() {
    let folder = folder();
    let training = after("mount -t tmpfs none /proc", &headless(folder.path(), &SHORT));
    let mut hidden = Command::new("unshare");
    hidden
        .args(["-r", "-m"])
        .arg(training.get_program())
        .args(training.get_args())
        .current_dir(folder.path());
    hidden.envs(training.get_envs().map(|(name, value)| (name, value.unwrap())));
    let (status, output, errors) = outcome(&mut hidden);
    assert_eq!((status, errors.as_str()), (0, ""));
    assert_eq!(events(&output).last().unwrap()["updates"], 5);
}

#[test]
fn few_open_files_are_an_error_or_enough() {
    let folder = folder();
    let mut ends = std::collections::BTreeSet::new();
    // With fewer than 4, the system itself cannot start a program.
    for files in 4..=16 {
        let args =
            [&SHORT[..], &["--save", "a.safetensors", "--csv", "a.csv", "--overwrite"]].concat();
        let (status, _, errors) =
            outcome(&mut after(&format!("ulimit -n {files}"), &headless(folder.path(), &args)));
        assert!(!errors.contains("internal error"), "{files}: {errors}");
        assert!(
            status == 0 || errors.contains("Too many open files"),
            "{files}: {status}, {errors}"
        );
        ends.insert(status);
    }
    assert!(ends.contains(&0) && ends.len() > 1, "{ends:?}");
    for files in [8, 10, 14, 16, 20] {
        let mut session =
            Session::start_with_limit(folder.path(), &["trap"], &format!("-n {files}"));
        assert_ne!(session.status(), 101, "{files}");
        session.wait_for("open files");
    }
}

#[test]
fn settings_with_which_training_would_never_begin_are_refused() {
    let folder = folder();
    for (setting, range) in [
        ("env_steps_per_update=9007199254740991", "from 1 to 1000000"),
        ("env_steps_per_update=0", "from 1 to 1000000"),
        ("learning_starts=18446744073709551615", "from 0 to 100000000"),
        ("episode_steps=4294967295", "from 1 to 60000"),
    ] {
        let args = ["--no-ui", "trap", "--max-updates", "1", "--set", setting];
        let (status, _, errors) = typed(folder.path(), &args);
        assert!(status == 2 && errors.contains(range), "{setting}: {status}, {errors}");
    }
}

#[test]
fn maps_too_long_for_positions_in_single_precision_are_refused() {
    let folder = folder();
    let check = |file: &str| typed(folder.path(), &["check", file]);
    for (width, height) in [(1 << 15, 1), (1, 1 << 15)] {
        let name = format!("{width}.map");
        let rows = format!("{}\n", ".".repeat(width)).repeat(height);
        std::fs::write(
            folder.path().join(&name),
            format!("type octile\nheight {height}\nwidth {width}\nmap\n{rows}"),
        )
        .unwrap();
        let (status, output, errors) = check(&name);
        assert!(status == 0 && output.contains("32,767 steps"), "{output}{errors}");
    }
    let long = format!("type octile\nheight 1\nwidth 32769\nmap\n{}\n", ".".repeat(32_769));
    std::fs::write(folder.path().join("long.map"), long).unwrap();
    std::fs::write(folder.path().join("long.txt"), ".\n".repeat(32_769)).unwrap();
    for file in ["long.map", "long.txt"] {
        let (status, _, errors) = check(file);
        assert!(status == 2 && errors.contains("32,768"), "{errors}");
    }
}
