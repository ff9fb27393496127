//! Comparisons by the real program, in a pseudo-terminal and without one.

use crate::support::{Session, non_zero, size};

#[test]
fn two_methods_train_side_by_side_and_the_terminal_is_restored() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["compare", "gdg-bridge", "her", "trap", "--seed", "4", "--set", "B:agents=8"];
    let mut session = Session::start(folder.path(), &args);
    session.wait_for("A gdg-bridge default");
    session.wait_for("B her tuned agents=8");
    session.wait_for("Space pause");
    session.press_for("?", "Two methods, A and B");
    // An escape immediately followed by other bytes would be a different key.
    session.close("Two methods, A and B");
    session.press_for(" ", "paused");
    session.press_for("E", "map as PNG");
    session.press_for("\r", "B: wrote");
    let files = std::fs::read_dir(folder.path().join("exports")).unwrap();
    let mut files: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
    files.sort();
    let begins = |i: usize, with| files[i].to_string_lossy().starts_with(with);
    assert!(files.len() == 2 && begins(0, "trap-gdg-bridge-") && begins(1, "trap-her-"));
    session.press_for("?axis\r", "success over environment steps");
    for (cols, rows) in [(1, 1), (200, 60), (40, 10)] {
        session.master.resize(size(cols, rows)).unwrap();
        session.screen.lock().unwrap().screen_mut().set_size(non_zero(rows), non_zero(cols));
    }
    session.wait_for("a comparison needs 60 x 18");
    session.master.resize(size(80, 24)).unwrap();
    session.screen.lock().unwrap().screen_mut().set_size(non_zero(24), non_zero(80));
    session.wait_for("Space train");
    session.press("q");
    let screen = session.screen.clone();
    assert_eq!(session.end(), 0);
    let left = screen.lock().unwrap().screen().contents();
    assert!(
        left.contains("A: gdg-bridge on trap, seed 4") && left.contains("B: her on trap, seed 4"),
        "{left}"
    );
    assert!(!folder.path().join("saves").exists(), "nothing is saved");
}

#[test]
fn signals_end_a_comparison_and_restore_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    for (signal, status) in [("TERM", 143), ("HUP", 129)] {
        let session = Session::start(folder.path(), &["compare", "gdg", "random", "trap"]);
        session.wait_for("Space pause");
        session.signal(signal);
        assert_eq!(session.end(), status);
    }
    let mut session = Session::start(folder.path(), &["compare", "gdg", "gdg", "trap"]);
    session.wait_for("Space pause");
    session.press("\x03");
    assert_eq!(session.end(), 0);
    assert!(!folder.path().join("saves").exists(), "nothing is saved");
}

#[test]
fn mistakes_are_reported_before_anything_trains() {
    for (args, problems) in [
        (&["gdg", "her"][..], &["needs a terminal", "gdg-tui reproduce", "gdg-tui suite"][..]),
        (&["gdg", "hr"], &["invalid value 'hr'", "LEARNER+PLANNER"]),
        (&["gdg"], &["<B>"]),
        (&["city", "gdg"], &["invalid value 'city'", "a map comes last: gdg-tui compare A B city"]),
        (&["gdg", "her", "fetch-reach"], &["is a world without a map"]),
        (&["gdg", "her", "--set", "C:hidden=8"], &["no side called \"C\"", "A:NAME=VALUE"]),
        (&["gdg", "her", "--set", "A:hiden=8"], &["unknown setting \"hiden\""]),
    ] {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui"));
        let command =
            command.arg("compare").args(args).env("XDG_STATE_HOME", env!("CARGO_TARGET_TMPDIR"));
        let output = command.env("NO_COLOR", "1").output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(problems.iter().all(|problem| errors.contains(problem)), "{args:?}: {errors}");
        assert!(output.stdout.is_empty());
    }
}
