//! Signals, and output that nobody reads: neither loses a run.

use std::fs::File;
use std::io::{PipeReader, Write};

use super::*;

/// Sends signals one right after the other, by a single shell.
fn kill_at_once(process: u32, signals: &[&str]) {
    let kills: Vec<String> =
        signals.iter().map(|signal| format!("kill -{signal} {process}")).collect();
    assert!(
        Command::new("sh").args(["-c", &kills.join("; ")]).status().unwrap().success(),
        "{signals:?}"
    );
}

/// Waits for a program to exit; returns its status and how long that took.
fn end_of(mut child: Child) -> (i32, Duration) {
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status;
        }
        if began.elapsed() > Duration::from_mins(1) {
            child.kill().unwrap();
            panic!("the program does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    };
    (status.code().unwrap_or(-1), began.elapsed())
}

/// Returns a pipe that is full: whoever writes to it waits.
#[cfg(target_os = "linux")]
fn full_pipe() -> (PipeReader, File) {
    use nix::fcntl::{FcntlArg, fcntl};

    let (reader, mut writer) = std::io::pipe().unwrap();
    let size = fcntl(&writer, FcntlArg::F_SETPIPE_SZ(4096)).unwrap();
    writer.write_all(&vec![b'#'; size as usize]).unwrap();
    (reader, File::from(std::os::fd::OwnedFd::from(writer)))
}

/// Starts a suite of one job in `folder`, whose checkpoint is saved on a signal.
fn suite(folder: &Path, errors: Stdio) -> Child {
    let mut command = isolated_command(folder);
    command.args(words("suite trap --budget 10000000 --out results --set hidden=16"));
    command.args(words("--set candidates=50 --set buffer_size=20000 --set learning_starts=200"));
    let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(errors).spawn().unwrap();
    // The log is written once signals are heard and the job runs.
    wait_until("the job does not begin", || folder.join("results/jobs").is_dir());
    child
}

#[test]
fn every_signal_that_would_end_the_program_saves_the_run() {
    // Of batch systems, a clock, SIGPWR and a real-time signal.
    let of_linux = if cfg!(target_os = "linux") { &["30", "64"][..] } else { &[] };
    for signal in ["USR1", "XCPU", "ALRM"].iter().chain(of_linux) {
        let folder = folder();
        let mut run = RunningProgram::start(&mut headless(
            folder.path(),
            &["trap", "--save", "kept.safetensors"],
        ));
        run.wait_for("progress");
        let (status, _) = run.end_with_signal(signal);
        assert!((129..=192).contains(&status), "{signal}: {status}");
        assert!(assert_loads(&folder.path().join("kept.safetensors")) > 0, "{signal}");
    }
}

#[test]
fn a_limit_of_cpu_time_saves_the_run() {
    // The signal comes again and again, after every second of both threads.
    let folder = folder();
    let program =
        headless(folder.path(), &["trap", "--save", "kept.safetensors", "--threads", "2"]);
    assert_eq!(outcome(&mut after("ulimit -S -t 2; ulimit -H -t 60", &program)).0, 152);
    assert!(assert_loads(&folder.path().join("kept.safetensors")) > 0);
}

#[test]
fn a_stop_of_the_program_is_no_training_time() {
    let (folder, began, stop) = (folder(), Instant::now(), Duration::from_secs(5));
    let args = ["trap", "--max-updates", "1000", "--eval-tasks", "1"];
    let mut run = RunningProgram::start(&mut headless(folder.path(), &args));
    run.wait_for("start");
    kill(run.child.id(), "STOP");
    std::thread::sleep(stop);
    kill(run.child.id(), "CONT");
    let mut rest = String::new();
    run.out.read_to_string(&mut rest).unwrap();
    let seconds = events(&rest).last().unwrap()["seconds"].as_f64().unwrap();
    let most = began.elapsed().as_secs_f64() - stop.as_secs_f64() + 1.5;
    assert!(run.child.wait().unwrap().success() && seconds < most, "{seconds} of {most}");
}

#[test]
fn sigquit_ends_the_program_at_once() {
    let folder = folder();
    let program = headless(folder.path(), &["trap", "--save", "kept.safetensors"]);
    let mut run = RunningProgram::start(&mut after("ulimit -c 0", &program));
    run.wait_for("progress");
    assert_eq!(run.end_with_signal("QUIT").0, -1);
    assert!(!folder.path().join("kept.safetensors").exists());
}

#[test]
fn signals_that_come_together_are_one() {
    // `timeout` sends its signal to the program, and then to its group.
    for signals in [&["HUP", "TERM", "CONT"][..], &["TERM", "USR1", "INT"], &["TERM", "TERM"]] {
        let folder = folder();
        let kept = folder.path().join("kept.safetensors");
        let mut run = RunningProgram::start(&mut headless(
            folder.path(),
            &["trap", "--save", "kept.safetensors"],
        ));
        run.wait_for("progress");
        kill_at_once(run.child.id(), signals);
        let mut rest = String::new();
        run.out.read_to_string(&mut rest).unwrap();
        assert!(run.child.wait().unwrap().code().is_some_and(|status| status > 128), "{signals:?}");
        let is_short = !rest.contains("\"evaluation\"") && rest.contains("\"interrupted\"");
        assert!(is_short, "{signals:?}: {rest}");
        assert!(assert_loads(&kept) > 0, "{signals:?}");

        std::fs::remove_file(&kept).unwrap();
        let mut session = Session::start(folder.path(), &["trap", "--save", "kept.safetensors"]);
        session.wait_for("training");
        kill_at_once(session.child.process_id().unwrap(), signals);
        assert!(session.status() > 128, "{signals:?}");
        assert!(kept.is_file(), "{signals:?}");

        let suite = suite(folder.path(), Stdio::null());
        kill_at_once(suite.id(), signals);
        assert!(end_of(suite).0 > 128, "{signals:?}");
        assert_eq!(checkpoints(&folder.path().join("results")).len(), 1, "{signals:?}");
    }
}

#[test]
fn a_signal_that_comes_during_slow_saving_ends_it_only_if_it_is_the_same_again() {
    let start = || {
        let folder = folder();
        let args = ["trap", "--save", "kept.safetensors"];
        let mut run =
            RunningProgram::start(headless(folder.path(), &args).env(FAULTS, "save=delay:9000@1"));
        run.wait_for("start");
        kill(run.child.id(), "TERM");
        std::thread::sleep(Duration::from_millis(400));
        (folder, run)
    };
    let (folder, run) = start();
    assert_eq!(run.end_with_signal("HUP").0, 143);
    assert_loads(&folder.path().join("kept.safetensors"));
    let (folder, run) = start();
    assert_eq!(run.end_with_signal("TERM").0, 143);
    assert!(!folder.path().join("kept.safetensors").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn records_that_nobody_reads_delay_neither_checkpoints_nor_signals() {
    let folder = folder();
    let kept = folder.path().join("kept.safetensors");
    let (_reader, pipe) = full_pipe();
    // A checkpoint every 60 ms.
    let args = ["trap", "--save", "kept.safetensors", "--save-every", "0.001"];
    let mut command = headless(folder.path(), &args);
    let child = command.stdin(Stdio::null()).stdout(pipe).stderr(Stdio::null()).spawn().unwrap();
    wait_until("no checkpoint", || kept.is_file());
    kill(child.id(), "TERM");
    let (ended, took) = end_of(child);
    assert!(ended == 143 && took < TIMEOUT, "{ended} after {took:?}");
    assert!(assert_loads(&kept) > 0);
}

#[cfg(target_os = "linux")]
#[test]
fn errors_that_nobody_reads_delay_neither_training_nor_signals() {
    let folder = folder();
    let records = folder.path().join("records");
    let (_reader, pipe) = full_pipe();
    let mut command = isolated_command(folder.path());
    // Without --no-ui, the first line says on standard error why there is no interface.
    command.args(["trap", "--save", "kept.safetensors", "--set", "hidden=16"]);
    let out = File::create(&records).unwrap();
    let child = command.stdin(Stdio::null()).stdout(out).stderr(pipe).spawn().unwrap();
    wait_until("no records", || std::fs::read_to_string(&records).unwrap().contains("progress"));
    kill(child.id(), "HUP");
    let (ended, took) = end_of(child);
    assert!(ended == 129 && took < TIMEOUT, "{ended} after {took:?}");
    assert!(assert_loads(&folder.path().join("kept.safetensors")) > 0);
}

#[cfg(target_os = "linux")]
#[test]
fn a_suite_whose_errors_nobody_reads_is_saved_on_a_signal() {
    let folder = folder();
    let (_reader, pipe) = full_pipe();
    let suite = suite(folder.path(), pipe.into());
    kill_at_once(suite.id(), &["TERM"]);
    let (status, took) = end_of(suite);
    assert!(status == 143 && took < TIMEOUT, "{status} after {took:?}");
    assert_eq!(checkpoints(&folder.path().join("results")).len(), 1);
}

#[cfg(target_os = "linux")]
#[test]
fn a_reader_that_comes_late_gets_all_records_in_order() {
    let folder = folder();
    let (mut reader, pipe) = full_pipe();
    let args = ["trap", "--max-updates", "3000", "--eval-tasks", "1", "--save", "kept.safetensors"];
    let mut command = headless(folder.path(), &args);
    let child = command.stdin(Stdio::null()).stdout(pipe).stderr(Stdio::null()).spawn().unwrap();
    drop(command);
    // Training ends although nobody reads.
    wait_until("no checkpoint", || folder.path().join("kept.safetensors").is_file());
    let mut text = String::new();
    reader.read_to_string(&mut text).unwrap();
    let names: Vec<String> = events(text.trim_start_matches('#'))
        .iter()
        .map(|event| format!("{} {}", event["event"].as_str().unwrap(), event["updates"]))
        .collect();
    let expected = [
        "start 0",
        "progress 1000",
        "progress 2000",
        "progress 3000",
        "saved 3000",
        "evaluation 3000",
    ];
    assert!(
        names.iter().take(6).map(String::as_str).eq(expected)
            && names.last().unwrap() == "end 3000",
        "{names:?}"
    );
    assert_eq!(end_of(child).0, 0);
}

#[test]
fn a_program_that_takes_long_to_end_says_what_it_waits_for() {
    let (folder, faults) = (folder(), [(FAULTS, "save=delay:60000@1")]);
    let args = ["trap", "--save", "kept.safetensors"];
    let mut run = RunningProgram::start(headless(folder.path(), &args).envs(faults));
    run.wait_for("start");
    kill(run.child.id(), "TERM");
    let (mut line, mut errors) = (String::new(), BufReader::new(run.child.stderr.take().unwrap()));
    errors.read_line(&mut line).unwrap();
    assert!(line.contains("saving (") && line.contains("twice"), "{line}");
    assert_eq!(run.end_with_signal("TERM").0, 143);
    // After one Ctrl-C, another one suffices.
    let mut run = RunningProgram::start(headless(folder.path(), &args).envs(faults));
    run.wait_for("start");
    kill(run.child.id(), "INT");
    let (mut line, mut errors) = (String::new(), BufReader::new(run.child.stderr.take().unwrap()));
    errors.read_line(&mut line).unwrap();
    assert!(line.contains("; Ctrl-C ends at once"), "{line}");
    assert_eq!(run.end_with_signal("INT").0, 130);

    // The interface leaves its screen for it.
    let session = Session::start_with(folder.path(), &args, &faults);
    session.wait_for("training");
    session.signal("TERM");
    session.wait_for(" s so far");
    session.signal("TERM");
    assert_eq!(session.end(), 143);
}

#[test]
fn updates_that_are_lost_without_a_file_to_save_to_are_said() {
    let folder = folder();
    checkpoint(folder.path());
    let end = |args: &[&str], signal: bool| {
        let mut run = RunningProgram::start(&mut headless(folder.path(), args));
        let mut errors = run.child.stderr.take().unwrap();
        if signal {
            run.wait_for("progress");
            kill(run.child.id(), "TERM");
        }
        run.out.read_to_string(&mut String::new()).unwrap();
        let mut text = String::new();
        errors.read_to_string(&mut text).unwrap();
        (run.child.wait().unwrap().code(), text)
    };
    let resumed = ["--resume", "small.safetensors", "--max-updates", "360", "--eval-tasks", "1"];
    let said = "not saved: give --save FILE, which may be the file resumed\n\
                not saved: 10 updates; give --save FILE to keep them\n";
    assert_eq!(end(&resumed, false), (Some(0), said.to_owned()));
    let (status, errors) = end(&["trap"], true);
    assert!(
        status == Some(143) && errors.starts_with("not saved: ") && errors.contains("--save"),
        "{errors}"
    );
    let saved = [&resumed[..], &["--save", "small.safetensors"]].concat();
    assert_eq!(end(&saved, false), (Some(0), String::new()));
    assert_eq!(
        end(&["trap", "--max-updates", "20", "--eval-tasks", "1"], false),
        (Some(0), String::new()),
        "meant"
    );
}
