//! The guided tour by the real program, in a pseudo-terminal and without one.

use crate::support::Session;

#[test]
fn the_tour_goes_on_by_enter() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start(folder.path(), &["tour", "--threads", "1"]);
    session.wait_for("1/6 No reward");
    session.press_for("\r", "2/6 D bends");
    session.close("2/6 D bends");
    session.signal("TERM");
    assert_eq!(session.end(), 143);
}

#[test]
fn a_tour_needs_a_terminal() {
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui"));
    let command = command.arg("tour").env("XDG_STATE_HOME", env!("CARGO_TARGET_TMPDIR"));
    let output = command.env("NO_COLOR", "1").output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("needs a terminal"));
}
