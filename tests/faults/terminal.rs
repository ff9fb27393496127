//! Terminals that send, or do not read, what no user would.

use super::*;

/// What the program takes for one reply may pause this long after ESC.
const LONGEST_PAUSE: Duration = Duration::from_millis(140);

/// How often a test is tried on a machine that is too busy to be on time.
const MOST_TRIES: usize = 10;

/// Starts the program and waits until it trains.
fn training(folder: &Path, args: &[&str]) -> Session {
    let session = Session::start(folder, args);
    session.wait_for("training");
    session
}

#[test]
fn replies_of_the_terminal_are_not_taken_for_keys() {
    let replies = [
        "\x1b]11;rgb:1e1e/1e1e/2e2e\x1b\\",
        "\x1bP>|tmux 3.4 :\x1b\\",
        "\x1b[>1;10;0c",
        "\x1b[?2026;1$y",
    ];
    for _ in 0..MOST_TRIES {
        let folder = folder();
        let mut session = training(folder.path(), &["trap"]);
        let mut longest = Duration::ZERO;
        for reply in replies {
            session.press(reply);
            // Cut anywhere, by pauses longer than a key takes.
            let mut sent = Instant::now();
            for byte in reply.chars() {
                longest = longest.max(sent.elapsed());
                session.press(byte.encode_utf8(&mut [0; 4]));
                sent = Instant::now();
                std::thread::sleep(Duration::from_millis(60));
            }
        }
        // The first key that is one: before it, others would have paused, opened the palette, or
        // said that they do nothing.
        session.press(" ");
        let unwanted =
            |session: &Session| session.count(b"find an action") + session.count(b"does nothing");
        if longest < LONGEST_PAUSE {
            session.wait_for("paused");
            assert_eq!(unwanted(&session), 0);
            return assert_eq!(session.interrupt(), 0);
        }
        // A busy machine has sent what a person might have typed.
        session.child.kill().unwrap();
    }
    panic!("the machine was too busy each time");
}

#[test]
fn an_answer_that_comes_while_the_program_ends_is_not_left_to_the_shell() {
    let folder = folder();
    let mut session = Session::start_shell(folder.path());
    session.press("\"$PROGRAM\" trap --set hidden=16\r");
    session.wait(|session| session.count(b"\x1b[c") == 1);
    session.press("\x03");
    // While the program waits for it.
    std::thread::sleep(Duration::from_millis(100));
    session.press_for("\x1b_Gi=31;OK\x1b\\\x1b[6;20;10t\x1b[?62;c", "gdg-bridge on trap, seed 0");
    session.press_for("echo an''swer is $((1+1))\r", "answer is 2");
    assert!(!session.screen_text().contains("31;OK"), "{}", session.screen_text());
}

#[test]
fn a_paste_without_an_end_does_not_keep_the_keyboard() {
    let folder = folder();
    let mut session = training(folder.path(), &["trap"]);
    session.press("\x1b[200~abc");
    // Longer than a paste pauses.
    std::thread::sleep(Duration::from_millis(1500));
    session.press_for(" ", "paused");
    assert_eq!(session.interrupt(), 0);
}

#[test]
fn much_input_at_the_start_delays_neither_frames_nor_signals() {
    let folder = folder();
    let mut session = Session::start(folder.path(), &["trap"]);
    session.wait(|session| session.count(b"\x1b[c") == 1);
    let mut keys = std::mem::replace(&mut session.keys, Box::new(std::io::sink()));
    // It ends when the program does.
    std::thread::spawn(move || std::io::Write::write_all(&mut keys, &vec![b'z'; 6 << 20]));
    session.wait_for("training");
    session.signal("TERM");
    assert_eq!(session.status(), 143);
}

#[test]
fn a_terminal_that_does_not_read_delays_neither_saving_nor_the_end() {
    let folder = folder();
    let mut session = training(folder.path(), &["trap", "--save", "kept.safetensors"]);
    session.stall(true);
    // Frames fill what the system buffers.
    std::thread::sleep(Duration::from_secs(3));
    session.signal("INT");
    assert_eq!(session.status(), 130);
    assert!(assert_loads(&folder.path().join("kept.safetensors")) > 0);
    let modes = session.master.get_termios().unwrap();
    assert!(format!("{:?}", modes.local_flags).contains("ECHO |"), "the terminal echoes again");
}

#[test]
fn the_program_does_not_stop_where_nobody_would_resume_it() {
    let folder = folder();
    let mut session = training(folder.path(), &["trap"]);
    for by_key in [true, false] {
        if by_key {
            session.press("\x1a");
        } else {
            session.signal("TSTP");
        }
        session.wait_for("not suspended: no shell");
        session.press("n");
        session.wait_until_gone("not suspended");
    }
    assert_eq!(session.count(b"\x1b[?1049l"), 0);
    assert_eq!(session.interrupt(), 0);
}

#[test]
fn within_a_script_the_shell_is_back_at_once() {
    let folder = folder();
    std::fs::write(
        folder.path().join("train.sh"),
        "\"$PROGRAM\" trap --set hidden=16\necho af''ter\n",
    )
    .unwrap();
    let mut session = Session::start_shell(folder.path());
    session.press_for("sh train.sh\r", "training");
    session.press_for("\x1a", "Stopped");
    session.press_for("echo the pr''ompt\r", "the prompt");
    assert!(!session.screen_text().contains("after"), "the script waits too");
    session.press_for("fg\r", "training");
    session.press("\x03");
    let asks = |session: &Session| session.screen_text().contains("quit without saving");
    session.wait(|session| asks(session) || session.screen_text().contains("after"));
    session.press_for("\x03", "after");
    session.assert_terminal_restored();
}

/// The escape sequences that open and close the interface.
const OPENED: &[u8] = b"\x1b[?1049h";
const CLOSED: &[u8] = b"\x1b[?1049l";

/// Returns a process's state as `ps` shows it; empty if there is none.
fn state_of(id: u32) -> String {
    let shown =
        Command::new("ps").args(["-o", "stat=", "-p", &id.to_string()]).output().unwrap().stdout;
    String::from_utf8(shown).unwrap()
}

/// Trains in a shell, stopped by key or from outside; returns the shell and the program's process.
fn stopped(folder: &Path, by_key: bool) -> (Session, u32) {
    let mut shell = Session::start_shell(folder);
    shell.press(
        "sh -c 'echo $$ > id; exec \"$PROGRAM\" trap --set hidden=16 --save kept.safetensors'\r",
    );
    shell.wait_for("training");
    let id = std::fs::read_to_string(folder.join("id")).unwrap().trim().parse().unwrap();
    if by_key {
        shell.press("\x1a");
        shell.wait(|shell| shell.count(CLOSED) == 1);
    } else {
        kill(id, "STOP");
    }
    shell.wait(|_| state_of(id).starts_with('T'));
    // Read once the terminal is the shell's.
    shell.press("echo prompt $((1+1))\n");
    shell.wait(|shell| shell.count(b"prompt 2") == 1);
    (shell, id)
}

#[test]
fn a_stopped_program_is_saved_and_ends_on_a_signal() {
    for (by_key, signals) in [(true, &["TERM", "CONT", "HUP"][..]), (false, &["TERM", "CONT"])] {
        let folder = folder();
        let (shell, id) = stopped(folder.path(), by_key);
        signals.iter().for_each(|signal| kill(id, signal));
        shell.wait(|_| matches!(state_of(id).chars().next(), None | Some('Z')));
        assert!(assert_loads(&folder.path().join("kept.safetensors")) > 0, "{signals:?}");
        shell.wait(|shell| shell.count(CLOSED) == 1);
        assert_eq!(shell.count(OPENED), 1, "the terminal was the shell's");
        shell.assert_terminal_restored();
    }
}

#[test]
fn in_the_background_it_trains_on_leaves_the_terminal_to_the_shell_and_ends_on_a_signal() {
    let folder = folder();
    let (mut shell, id) = stopped(folder.path(), true);
    shell.press("bg\r");
    shell.wait(|_| !state_of(id).starts_with('T'));
    // Keys are the shell's, and nothing is drawn.
    for round in 0..5 {
        shell.press(&format!("echo round''-{round}\r"));
        shell.wait_for(&format!("round-{round}"));
    }
    assert!(shell.count(OPENED) == 1 && !state_of(id).starts_with('T'));
    shell.press("fg\r");
    shell.wait(|shell| shell.count(OPENED) == 2);
    shell.wait_for("training");
    // The shell gives the terminal away before it sends SIGCONT, which would end a stop in between.
    shell.wait(|shell| {
        let state = state_of(shell.child.process_id().unwrap());
        state.starts_with('S') && !state.contains('+')
    });
    shell.press("\x1a");
    shell.wait(|_| state_of(id).starts_with('T'));
    shell.press("bg\r");
    shell.wait(|_| !state_of(id).starts_with('T'));
    shell.press_for("kill %1\r", "saved kept.safetensors");
    assert!(assert_loads(&folder.path().join("kept.safetensors")) > 0);
}

#[test]
fn a_run_without_the_interface_draws_its_progress_in_the_foreground_alone() {
    let folder = folder();
    let records = folder.path().join("records");
    let mut shell = Session::start_shell(folder.path());
    shell.press("$PROGRAM --no-ui trap --set hidden=16 --save kept.safetensors > records &\r");
    let read = || std::fs::read_to_string(&records).unwrap_or_default();
    wait_until("no progress", || read().contains("progress"));
    assert!(!shell.screen_text().contains(" updates, "), "{}", shell.screen_text());
    shell.press_for("fg\r", " updates, ");
    shell.press("\x03");
    wait_until("it does not end", || read().contains("interrupted"));
}

#[test]
fn a_terminal_that_cannot_draw_is_sent_no_escape_sequences() {
    for term in ["dumb", ""] {
        let folder = folder();
        let args = ["trap", "--max-updates", "20", "--eval-tasks", "1"];
        let mut session = Session::start_with(folder.path(), &args, &[("TERM", term)]);
        assert_eq!(session.status(), 0);
        session.wait(|session| session.count(b"\"event\":\"end\"") == 1);
        assert_eq!(
            session.count(b"trains without the interface, as the terminal cannot draw it"),
            1
        );
        assert_eq!(session.count(b"\x1b"), 0, "{}", session.screen_text());
        let mut session = Session::start_with(folder.path(), &["tour"], &[("TERM", term)]);
        assert_eq!(session.status(), 2);
        assert_eq!(session.count(b"\x1b"), 0, "{}", session.screen_text());
    }
}

#[test]
fn a_fifo_in_the_place_of_the_log_does_not_hold_up_the_start() {
    let folder = folder();
    let log = folder.path().join("gdg-tui/log");
    std::fs::create_dir_all(&log).unwrap();
    let now = jiff::Timestamp::now();
    for hours in [-24, 0, 24] {
        let date = (now + jiff::SignedDuration::from_hours(hours)).strftime("%F");
        assert!(
            Command::new("mkfifo")
                .arg(log.join(format!("gdg-tui.{date}.log")))
                .status()
                .unwrap()
                .success()
        );
    }
    assert_eq!(training(folder.path(), &["trap"]).interrupt(), 0);
}

#[test]
fn a_long_name_does_not_hide_the_phase() {
    let folder = folder();
    let name = format!("{}.txt", "a-long-name-".repeat(8));
    std::fs::write(folder.path().join(&name), "S....\n.....\n....G\n").unwrap();
    let mut session = training(folder.path(), &[&name]);
    session.press_for(" ", " paused");
    assert!(
        session.screen_text().lines().next().unwrap().contains("paused"),
        "{}",
        session.screen_text()
    );
    assert_eq!(session.interrupt(), 0);
}
