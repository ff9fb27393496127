//! The real program in a pseudo-terminal: what a user sees and presses, and what remains on the
//! terminal.

use crate::support::{Session, kill};

#[test]
fn the_interface_opens_pauses_shows_help_saves_and_leaves_a_summary() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start(folder.path(), &["trap", "--seed", "4"]);
    session.wait_for("gdg-tui");
    session.wait_for("training");
    session.wait_for("quit");
    session.press_for("?", "pause or resume training");
    // An escape immediately followed by other bytes would be a different key.
    session.close("pause or resume training");
    session.press_for(" ", "paused");
    session.press_for("s", "saved saves/trap-gdg-bridge-seed4.safetensors");
    session.press("n");
    session.press("q");
    let screen = session.screen.clone();
    assert_eq!(session.end(), 0);
    let left = screen.lock().unwrap().screen().contents();
    assert!(left.contains("gdg-bridge on trap, seed 4"), "{left}");
    assert!(folder.path().join("saves/trap-gdg-bridge-seed4.safetensors").is_file());
    let mut short = Session::start(folder.path(), &["--max-updates", "1"]);
    short.wait_for("done");
    short.press("\x03");
    assert_eq!(short.end(), 0);
}

/// Gymnasium-Robotics' maze for points, with a start and a goal.
const U_MAZE: &str = "\
# As in gymnasium_robotics.envs.maze.maps
U_MAZE = [[1, 1, 1, 1, 1],
          [1, 'r', 0, 0, 1],
          [1, 1, 1, 0, 1],
          [1, 'g', 0, 0, 1],
          [1, 1, 1, 1, 1]]
";

#[test]
fn a_maze_of_another_program_is_opened_and_trained_on() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("umaze.py"), U_MAZE).unwrap();
    let args = ["umaze.py", "--cell", "4", "--goal-radius", "1.5", "--seed", "2"];
    let mut session = Session::start(folder.path(), &args);
    session.wait_for("training");
    assert!(session.screen_text().contains("umaze"), "{}", session.screen_text());
    session.press_for("3", "to G       6.5, 14.5");
    // Between the goal and the start is a wall, which can be opened.
    session.press_for("e", "EDIT");
    session.press_for("kkk2\r", "1 cell opened");
    session.press_for("u", "1 cell walled");
    session.close("EDIT");
    session.press_for("s", "saved saves/umaze-gdg-bridge-seed2.safetensors");
    assert_eq!(session.quit(), 0);
    // The checkpoint keeps the map and its scale.
    let mut again =
        Session::start(folder.path(), &["--resume", "saves/umaze-gdg-bridge-seed2.safetensors"]);
    again.wait_for("training");
    again.press_for("3", "to G       6.5, 14.5");
    assert_eq!(again.quit(), 0);
}

/// A map of two rooms joined by a door, small enough to learn in seconds.
const ROOMS: &str = "\
S.....#......
......#......
.............
......#......
......#.....G
";

#[test]
fn a_user_can_train_edit_place_a_goal_save_quit_and_resume() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("rooms.txt"), ROOMS).unwrap();
    let mut session = Session::start(folder.path(), &["rooms.txt", "--seed", "3"]);
    session.wait_for("training");
    session.press_for(" ", "paused");
    // Draw a wall at the cursor, which starts at the goal, and undo it.
    session.press_for("e", "EDIT");
    session.press_for("k\r", "1 cell walled");
    session.press_for("u", "1 cell opened");
    session.press("\x1b");
    session.wait_for("Tab panes");
    session.press(" ");
    // Move the goal two cells left of the map's; the agent reaches it repeatedly.
    session.press_for("3hh", "to G       10.5, 4.5");
    for arrivals in ["arrivals   1 of", "arrivals   2 of"] {
        session.wait_for(arrivals);
    }
    session.press_for("s", "saved saves/rooms-gdg-bridge-seed3.safetensors");
    assert_eq!(session.quit(), 0);
    let mut again =
        Session::start(folder.path(), &["--resume", "saves/rooms-gdg-bridge-seed3.safetensors"]);
    again.wait_for("rooms gdg-bridge default (3 changed) seed 3");
    again.wait_for("training");
    // What has been trained until then would be asked about.
    again.press_for(" ", "paused");
    again.press_for("s", "saved saves/rooms-gdg-bridge-seed3.safetensors");
    // The checkpoint list shows it too.
    again.press_for("L", "checkpoint");
    again.wait_for("rooms gdg-bridge");
    again.press_for("\r", "loaded saves/rooms-gdg-bridge-seed3.safetensors");
    // Maps in the folder are listed below the built-in ones.
    again.press_for("O", "built in");
    again.close("built in");
    assert_eq!(again.interrupt(), 0);
}

#[test]
fn a_run_has_one_file_however_impatiently_it_is_quit_and_is_saved_at_its_limit() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("rooms.txt"), ROOMS).unwrap();
    let checkpoints = || {
        let entries =
            std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
        entries.filter(|name| name.to_string_lossy().ends_with(".safetensors")).collect::<Vec<_>>()
    };
    let mut session =
        Session::start(folder.path(), &["rooms.txt", "--seed", "3", "--save", "own.safetensors"]);
    session.wait_for("training");
    session.press_for("e", "EDIT");
    session.press("kxlxlxuuqq");
    assert_eq!(session.end(), 0);
    assert_eq!(checkpoints(), ["own.safetensors"]);
    let args = ["rooms.txt", "--seed", "4", "--save", "limit.safetensors", "--max-updates", "100"];
    let mut session = Session::start(folder.path(), &args);
    session.wait_for("saved limit.safetensors at update 100");
    assert!(folder.path().join("limit.safetensors").is_file());
    session.press("q");
    assert_eq!(session.end(), 0);
    assert_eq!(checkpoints().len(), 2);
}

#[test]
fn suspending_restores_the_terminal_and_resuming_reopens_the_interface() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start_shell(folder.path());
    session.press("sh -c 'echo $$ > id; exec \"$PROGRAM\" trap --set hidden=16'\r");
    session.wait_for("quit");
    let id: u32 =
        std::fs::read_to_string(folder.path().join("id")).unwrap().trim().parse().unwrap();
    let (opened, closed) = (b"\x1b[?1049h", b"\x1b[?1049l");
    for (round, by_key) in [(1, false), (2, true)] {
        if by_key {
            session.press("\x1a");
        } else {
            kill(id, "TSTP");
        }
        session.wait(|session| session.count(closed) == round);
        // The shell reads it once the program has stopped.
        session.press(&format!("echo round''-{round}\r"));
        session.wait_for(&format!("round-{round}"));
        let before = session.count(opened);
        session.press("fg\r");
        session.wait(|session| session.count(opened) > before);
        session.wait_for("training");
    }
    // Stopped so that it could not restore the terminal, and by key.
    let before = session.count(opened);
    kill(id, "STOP");
    let state = || {
        std::process::Command::new("ps")
            .args(["-o", "stat=", "-p", &id.to_string()])
            .output()
            .unwrap()
            .stdout
    };
    session.wait(|_| state().starts_with(b"T"));
    // The terminal is still in raw mode.
    session.press("fg\n");
    session.wait(|session| session.count(opened) > before);
    let before = session.count(opened);
    session.press("\x0c");
    session.wait(|session| session.count(opened) > before);
    session.press("q");
    session.wait(|session| {
        session.screen_text().contains("quit without saving") || session.count(closed) > 2
    });
    session.press("\x03");
    session.wait(|session| session.count(closed) > 2);
    session.assert_terminal_restored();
}

#[test]
fn signals_while_the_terminal_is_asked_what_it_shows_are_handled() {
    for (name, status) in [("TERM", 143), ("HUP", 129)] {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::start(folder.path(), &["trap"]);
        session.wait(|session| session.raw.lock().unwrap().windows(3).any(|w| w == b"\x1b[c"));
        kill(session.child.process_id().unwrap(), name);
        assert_eq!(session.end(), status);
    }
}

#[test]
fn completions_manual_and_configuration_are_printed() {
    let run = |args: &[&str]| {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui"));
        let output = command.args(args).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        assert!(run(&["completions", shell]).contains("max-updates"));
    }
    let manual = run(&["man"]);
    assert!(manual.contains(".TH gdg-tui") && manual.contains("max\\-updates"), "{manual}");
    assert!(run(&["--print-config-template"]).contains("[keys]"));
}

#[test]
fn a_configuration_sets_keys_and_theme_and_its_errors_are_reported() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("own.toml"), "theme = \"light\"\n[keys]\npause = [\"f5\"]\n")
        .unwrap();
    let mut session = Session::start(folder.path(), &["trap", "--ui-config", "own.toml"]);
    session.wait_for("F5 pause");
    session.press_for("\x1b[15~", "paused");
    session.press("q");
    assert_eq!(session.end(), 0);
    std::fs::write(folder.path().join("wrong.toml"), "theme = \"dark\"\nkeys = 3\n").unwrap();
    let mut session = Session::start(folder.path(), &["trap", "--ui-config", "wrong.toml"]);
    session.wait_for("wrong.toml:2:8:");
    assert_eq!(session.child.wait().unwrap().exit_code(), 2);
    assert!(
        !session.raw.lock().unwrap().windows(8).any(|w| w == b"\x1b[?1049h"),
        "the terminal is left alone"
    );
}

#[test]
fn the_interface_survives_huge_pastes() {
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start(folder.path(), &["trap"]);
    session.wait_for("quit");
    session.press("\x1b[200~");
    session.press(&"q".repeat(1 << 20));
    session.press("\x1b[201~");
    session.wait_for("updates");
    // A paste into a text field is cut to the maximum length of the field.
    session.press(":\x1b[200~");
    session.press(&"pause ".repeat(200_000));
    session.press_for("\x1b[201~", "> ");
    session.close("Esc close");
    assert_eq!(session.interrupt(), 0);
}

#[test]
fn an_edit_to_come_is_made_in_the_interface_too() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.txt"), "S.#..\n.....\n....G\n").unwrap();
    std::fs::write(folder.path().join("b.txt"), "S.#..\n..#..\n....G\n").unwrap();
    let args = ["--no-ui", "a.txt", "--edit-at", "20:b.txt", "--max-seconds", "0"];
    let more = ["--save", "run.safetensors", "--eval-tasks", "1"];
    let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui"));
    command.current_dir(folder.path()).args(args).args(more);
    assert!(command.output().unwrap().status.success());
    let mut session = Session::start(folder.path(), &["--resume", "run.safetensors"]);
    session.wait_for("edited as planned: 1 cell walled");
    // What is shown is the trainer's map.
    session.wait_for("seed 0  relearning");
    // It asks only about more than a few seconds of training.
    session.press("qd");
    session.end();
}
