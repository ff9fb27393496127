//! Failure handling: nothing is lost, and every failure is reported.

mod command_line;
mod foreign_files;
mod inputs;
mod resources;
mod saving;
mod signals;
mod terminal;

use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use crate::ran::{one_line, words};
use crate::support::{
    Session, after, checkpoints, headless, isolated_command, kill, outcome, wait_until,
};
use gdg::job::Job;
use gdg::train::{self, Registry, SaveTo, Saved, Trainer};
use serde_json::Value;

/// The environment variable that injects faults.
const FAULTS: &str = "GDG_TUI_FAULTS";

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn assert_loads(path: &Path) -> u64 {
    let trainer = train::load(path, &Registry::builtin(), 1).unwrap_or_else(|e| panic!("{e}"));
    trainer.counters().updates
}

/// Trains a small run and returns its checkpoint.
fn checkpoint(folder: &Path) -> std::path::PathBuf {
    let path = folder.join("small.safetensors");
    let args = [
        "trap",
        "--max-updates",
        "350",
        "--eval-tasks",
        "1",
        "--save",
        "small.safetensors",
        // Short episodes, so that some have ended.
        "--set",
        "episode_steps=100",
    ];
    let (status, _, errors) = outcome(&mut headless(folder, &args));
    assert_eq!((status, errors.as_str()), (0, ""));
    path
}

fn events(output: &str) -> Vec<Value> {
    output.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// A run in the background whose records can be waited for.
struct RunningProgram {
    child: Child,
    out: BufReader<std::process::ChildStdout>,
}

impl RunningProgram {
    fn start(command: &mut Command) -> Self {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let out = BufReader::new(child.stdout.take().unwrap());
        Self { child, out }
    }

    fn wait_for(&mut self, event: &str) {
        let mut line = String::new();
        while !line.contains(&format!("\"event\":\"{event}\"")) {
            line.clear();
            assert!(self.out.read_line(&mut line).unwrap() > 0, "{event} did not appear");
        }
    }

    /// Sends a signal; returns the exit status and the time until exit.
    fn end_with_signal(mut self, signal: &str) -> (i32, Duration) {
        let asked = Instant::now();
        kill(self.child.id(), signal);
        let mut rest = String::new();
        self.out.read_to_string(&mut rest).unwrap();
        (self.child.wait().unwrap().code().unwrap_or(-1), asked.elapsed())
    }
}

/// "Within a second", with a margin for busy machines.
const TIMEOUT: Duration = Duration::from_secs(4);

#[test]
fn closing_the_terminal_saves_the_run() {
    let folder = folder();
    let session = Session::start(folder.path(), &["trap"]);
    session.wait_for("elapsed    0:00:03");
    let mut child = session.close_terminal();
    let began = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().unwrap() {
            break status.exit_code();
        }
        assert!(began.elapsed() < Duration::from_secs(30), "the program does not exit");
        std::thread::sleep(Duration::from_millis(20));
    };
    assert_eq!(status, 129);
    let saved = checkpoints(folder.path());
    assert_eq!(saved, [folder.path().join("saves/trap-gdg-bridge-seed0.safetensors")]);
    assert!(assert_loads(&saved[0]) > 0);
}

#[test]
fn a_new_run_does_not_replace_the_checkpoint_of_another() {
    let folder = folder();
    let first = checkpoint(folder.path());
    let before = std::fs::read(&first).unwrap();
    let args = ["trap", "--max-updates", "20", "--eval-tasks", "1", "--save", "small.safetensors"];
    let (status, output, errors) = outcome(&mut headless(folder.path(), &args));
    assert_eq!(status, 0);
    assert!(
        errors.contains("small.safetensors belongs to another run")
            && errors.contains("small-2.safetensors"),
        "{errors}"
    );
    assert!(
        events(&output).iter().any(|e| e["event"] == "saved" && e["path"] == "small-2.safetensors"),
        "{output}"
    );
    assert_eq!(std::fs::read(&first).unwrap(), before);
    let args = words(
        "--resume small.safetensors --max-updates 360 --eval-tasks 1 --save \
        small.safetensors",
    );
    let (status, _, errors) = outcome(&mut headless(folder.path(), &args));
    assert_eq!((status, errors.as_str()), (0, ""), "its own file");
    assert_eq!(assert_loads(&first), 360);
    let args = words("trap --max-updates 20 --eval-tasks 1 --overwrite --save small.safetensors");
    assert_eq!(outcome(&mut headless(folder.path(), &args)).0, 0);
    assert_eq!(assert_loads(&first), 20);
    assert_eq!(checkpoints(folder.path()).len(), 2);
}

#[test]
fn tables_and_exports_never_replace_a_checkpoint() {
    let folder = folder();
    let path = checkpoint(folder.path());
    let before = std::fs::read(&path).unwrap();
    let run = |args: &[&str]| {
        let mut command = isolated_command(folder.path());
        let (status, _, errors) = outcome(command.args(args));
        assert_eq!(status, 2, "{errors}");
        assert!(
            errors.contains("small.safetensors: is a checkpoint and is not replaced"),
            "{errors}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), before);
    };
    run(&["export-policy", "small.safetensors", "--out", "small.safetensors", "--overwrite"]);
    run(&["--no-ui", "trap", "--max-updates", "5", "--csv", "small.safetensors", "--overwrite"]);
    run(&["--no-ui", "--resume", "small.safetensors", "--csv", "small.safetensors", "--overwrite"]);
    let both = words("--no-ui trap --save new.safetensors --csv ./new.safetensors");
    let (status, _, errors) = outcome(isolated_command(folder.path()).args(both));
    assert!(status == 2 && errors.contains("is used by this run"), "{errors}");
}

#[test]
fn tables_never_replace_what_the_run_reads() {
    let folder = folder();
    let trap = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("maps/trap.txt"))
        .unwrap();
    let names = ["own.txt", "edit.txt", "settings.json"];
    let texts = [trap.as_str(), &trap, "{\"hidden\": 16}\n"];
    for (name, text) in names.iter().zip(texts) {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    for (name, text) in names.iter().zip(texts) {
        let mut command = isolated_command(folder.path());
        let args = words(
            "--no-ui own.txt --edit-at 3:edit.txt --config settings.json \
            --max-updates 5",
        );
        let (status, _, errors) = outcome(command.args(args).args(["--csv", name, "--overwrite"]));
        assert_eq!(status, 2, "{errors}");
        assert!(
            errors.contains(&format!("{name}: is used by this run and is not replaced")),
            "{errors}"
        );
        assert_eq!(std::fs::read_to_string(folder.path().join(name)).unwrap(), text);
    }
    // Nor anything else that is no table, such as what a checkpoint names or a module of Python.
    std::fs::write(folder.path().join("own.py"), "import numpy\n").unwrap();
    for args in ["--no-ui own.txt --max-updates 5 --csv own.py", "export-data none --out own.py"] {
        let command = &mut isolated_command(folder.path());
        let (status, _, errors) = outcome(command.args(words(args)).arg("--overwrite"));
        assert!(status == 2 && errors.contains("own.py: is not "), "{errors}");
    }
    // Nor the image of a map, nor where the records go.
    let scan = ["scan.yaml", "scan.pgm"].map(|name| folder.path().join(name));
    std::fs::write(&scan[0], "image: scan.pgm\nresolution: 1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.6\nfree_thresh: 0.2\n").unwrap();
    std::fs::write(&scan[1], "P2 2 1 9 9 9").unwrap();
    let args = words("--no-ui scan.yaml --max-updates 5 --csv scan.pgm --overwrite");
    let (status, _, errors) = outcome(isolated_command(folder.path()).args(args));
    assert!(status == 2 && errors.contains("is used by this run"), "{errors}");
    let records = std::fs::File::create(folder.path().join("own.jsonl")).unwrap();
    let args = words("--no-ui own.txt --max-updates 5 --csv own.jsonl --overwrite");
    let mut command = isolated_command(folder.path());
    assert_eq!(command.args(args).stdout(records).status().unwrap().code(), Some(2));
}

#[test]
fn a_file_that_is_not_a_checkpoint_is_never_replaced() {
    let folder = folder();
    let path = folder.path().join("notes.safetensors");
    std::fs::write(&path, "mine").unwrap();
    let args = ["trap", "--max-updates", "20", "--eval-tasks", "1", "--save", "notes.safetensors"];
    let began = Instant::now();
    let (status, output, errors) =
        outcome(&mut headless(folder.path(), &[&args[..], &["--overwrite"]].concat()));
    assert_eq!((status, output.as_str()), (2, ""), "refused before training: {errors}");
    assert!(errors.contains("is not a checkpoint") && errors.contains("another name"), "{errors}");
    assert!(began.elapsed() < TIMEOUT);
    let (status, output, errors) = outcome(&mut headless(folder.path(), &args));
    assert_eq!(status, 0);
    assert!(errors.contains("is not a checkpoint") && !errors.contains("another run"), "{errors}");
    assert!(
        events(&output).iter().any(|e| e["event"] == "saved" && e["path"] == "notes-2.safetensors"),
        "{output}"
    );
    // Not even one that appeared after the check.
    let trainer =
        train::load(&folder.path().join("notes-2.safetensors"), &Registry::builtin(), 1).unwrap();
    assert_eq!(
        train::save(&trainer, &SaveTo::Replace(path.clone())).unwrap(),
        folder.path().join("notes-3.safetensors")
    );
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "mine");
    // A damaged checkpoint is one.
    let damaged = folder.path().join("notes-2.safetensors");
    std::fs::OpenOptions::new().write(true).open(&damaged).unwrap().set_len(100_000).unwrap();
    let args = words(
        "trap --max-updates 20 --eval-tasks 1 --save notes-2.safetensors \
        --overwrite",
    );
    assert_eq!(outcome(&mut headless(folder.path(), &args)).0, 0);
    assert_eq!(assert_loads(&damaged), 20);
}

#[test]
fn a_diverging_run_rolls_back_and_finally_stops() {
    let folder = folder();
    let args = ["trap", "--max-updates", "400", "--eval-tasks", "1", "--save", "back.safetensors"];
    let (status, output, errors) =
        outcome(headless(folder.path(), &args).env(FAULTS, "loss=once@300"));
    assert_eq!(status, 0, "{errors}");
    let all = events(&output);
    let recovery = all.iter().find(|e| e["event"] == "recovery").unwrap();
    assert_eq!(
        (&recovery["updates"], &recovery["back_to"], &recovery["times"]),
        (&300.into(), &0.into(), &1.into())
    );
    assert!(
        (recovery["learning_rate"].as_f64().unwrap() - 5e-4).abs() < 1e-9
            && errors.contains("diverged"),
        "{errors}"
    );
    let resumed =
        train::load(&folder.path().join("back.safetensors"), &Registry::builtin(), 1).unwrap();
    assert!((resumed.run().settings.learn.learning_rate - 5e-4).abs() < 1e-9);
    // Divergence that rolling back cannot cure.
    let args = words("trap --max-updates 400 --set learning_rate=3e38 --save lost.safetensors");
    let (status, output, errors) = outcome(&mut headless(folder.path(), &args));
    assert_eq!(status, 1);
    assert_eq!(events(&output).iter().filter(|e| e["event"] == "recovery").count(), 3, "{output}");
    assert!(errors.contains("diverged again"), "{errors}");
    assert_loads(&folder.path().join("lost.safetensors"));
}

#[test]
fn a_diverging_run_does_not_depend_on_when_it_is_saved() {
    let folder = folder();
    let recoveries = |more: &[&str]| {
        let args = ["trap", "--max-updates", "400", "--set", "learning_rate=3e38"];
        let (_, output, _) = outcome(&mut headless(folder.path(), &[&args[..], more].concat()));
        let recoveries: Vec<Value> =
            events(&output).into_iter().filter(|e| e["event"] == "recovery").collect();
        recoveries
    };
    let without = recoveries(&[]);
    assert_eq!(without.len(), 3, "{without:?}");
    assert_eq!(recoveries(&["--save", "often.safetensors", "--save-every", "1e-6"]), without);
}

#[test]
fn an_evaluation_that_a_signal_ended_is_made_after_resuming() {
    let folder = folder();
    let args = ["trap", "--max-updates", "40", "--eval-tasks", "1", "--save", "there.safetensors"];
    assert_eq!(outcome(&mut headless(folder.path(), &args)).0, 0);
    let there = folder.path().join("there.safetensors");
    let evaluations = |file: &str| -> Vec<Value> {
        let line = format!(
            "--resume {file} --max-updates 60 --eval-tasks 1 --eval-every-updates \
            20"
        );
        let args = words(&line);
        let (status, output, errors) = outcome(&mut headless(folder.path(), &args));
        assert_eq!(status, 0, "{errors}");
        events(&output)
            .iter()
            .filter(|e| e["event"] == "evaluation")
            .map(|e| e["updates"].clone())
            .collect()
    };
    assert_eq!(evaluations("there.safetensors"), [60], "it was evaluated");
    let mut trainer = train::load(&there, &Registry::builtin(), 1).unwrap();
    while trainer.counters().updates < 50 {
        trainer.tick().unwrap();
    }
    train::save(&trainer, &SaveTo::CreateNew(folder.path().join("between.safetensors"))).unwrap();
    assert_eq!(evaluations("between.safetensors"), [60], "none is due");
    // As if a signal had arrived in the evaluation after 40 updates.
    let mut fresh =
        Trainer::new(trainer.run().clone(), trainer.world(), trainer.registry(), 1).unwrap();
    while fresh.counters().updates < 40 {
        fresh.tick().unwrap();
    }
    train::save(&fresh, &SaveTo::CreateNew(folder.path().join("missed.safetensors"))).unwrap();
    assert_eq!(evaluations("missed.safetensors"), [40, 60]);
}

#[cfg(unix)]
#[test]
fn a_limit_on_the_size_of_files_is_an_error_like_a_full_disk() {
    let folder = folder();
    let line = "--no-ui trap --max-updates 20 --eval-tasks 1 --save big.safetensors";
    let mut program = isolated_command(folder.path());
    let (status, _, errors) = outcome(&mut after("ulimit -f 100", program.args(words(line))));
    assert_eq!(status, 1, "{errors}");
    assert!(
        errors.contains("File too large") && !folder.path().join("big.safetensors").exists(),
        "{errors}"
    );
}

#[test]
fn divergence_is_shown_in_the_interface_and_the_program_stays_usable() {
    let folder = folder();
    let mut session = Session::start(folder.path(), &["trap", "--set", "learning_rate=3e38"]);
    session.wait_for("training has stopped");
    session.close("training has stopped");
    session.press_for("s", "saved saves/trap");
    session.press("q");
    assert_eq!(session.end(), 1);
    assert_loads(&folder.path().join("saves/trap-gdg-bridge-seed0.safetensors"));
}

#[test]
fn a_file_replaced_by_another_program_is_left_alone() {
    let folder = folder();
    let other = std::fs::read(checkpoint(folder.path())).unwrap();
    let path = folder.path().join("mine.safetensors");
    let args = ["trap", "--save", "mine.safetensors", "--save-every", "0.01"];
    let mut run = RunningProgram::start(&mut headless(folder.path(), &args));
    run.wait_for("saved");
    std::fs::write(folder.path().join("new"), &other).unwrap();
    std::fs::rename(folder.path().join("new"), &path).unwrap();
    let own = folder.path().join("mine-2.safetensors");
    wait_until("no new file is written", || own.exists());
    assert_eq!(run.end_with_signal("TERM").0, 143);
    assert!(std::fs::read(&path).unwrap() == other && assert_loads(&own) > 0);
    assert_eq!(checkpoints(folder.path()).len(), 3, "and keeps to that");
}

#[test]
fn a_failed_periodic_save_does_not_end_the_run() {
    let folder = folder();
    let args = words(
        "trap --max-updates 400 --eval-tasks 1 --save a.safetensors --save-every \
        0.002",
    );
    let (status, _, errors) = outcome(headless(folder.path(), &args).env(FAULTS, "save=once@2"));
    assert_eq!(status, 0, "{errors}");
    assert!(
        errors.contains("tried again") && assert_loads(&folder.path().join("a.safetensors")) == 400,
        "{errors}"
    );
    assert!(!folder.path().join("a-2.safetensors").exists(), "what was saved instead is older");
}

#[test]
fn a_run_that_cannot_be_saved_to_its_path_is_saved_elsewhere() {
    let folder = folder();
    let start = |path| {
        let args = ["trap", "--save", path, "--save-every", "0.002"];
        RunningProgram::start(&mut headless(folder.path(), &args))
    };
    let mut run = start("sub/a.safetensors");
    run.wait_for("progress");
    // A file in the place of the folder, which saving creates.
    std::fs::remove_dir_all(folder.path().join("sub")).unwrap_or_default();
    std::fs::write(folder.path().join("sub"), b"").unwrap();
    assert_eq!(run.end_with_signal("TERM").0, 1);
    assert!(assert_loads(&folder.path().join("saves/a.safetensors")) >= 1000);
    // Also by autosaves, of which nothing at the end is needed, beside a file that cannot be replaced.
    let run = start("b.safetensors");
    let [own, instead] = ["b", "b-2"].map(|name| folder.path().join(format!("{name}.safetensors")));
    wait_until("no autosave", || own.exists());
    std::fs::set_permissions(&own, PermissionsExt::from_mode(0o444)).unwrap();
    let updates = || train::describe(&instead).map_or(0, |found| found.updates);
    wait_until("nothing is saved instead", || updates() > 0);
    let first = updates();
    wait_until("nothing is saved again", || updates() > first);
    run.end_with_signal("KILL");
    assert!(assert_loads(&instead) > first && !folder.path().join("b-3.safetensors").exists());
}

#[test]
fn an_unwritable_path_is_refused_before_training() {
    let folder = folder();
    std::fs::write(folder.path().join("file"), b"").unwrap();
    std::fs::write(folder.path().join("protected"), b"").unwrap();
    std::fs::set_permissions(folder.path().join("protected"), PermissionsExt::from_mode(0o444))
        .unwrap();
    for path in [".", "file/below", "/dev/null", "protected", "/proc/nothing/x"] {
        let (status, output, errors) =
            outcome(&mut headless(folder.path(), &["trap", "--save", path]));
        assert_eq!((status, output.as_str()), (2, ""), "{path}: {errors}");
        assert!(errors.contains("cannot be saved here"), "{path}: {errors}");
    }
}

#[test]
fn signals_interrupt_an_evaluation_and_the_run_is_saved_before_it() {
    let folder = folder();
    let args = ["trap", "--max-updates", "50", "--save", "kept.safetensors"];
    let mut run =
        RunningProgram::start(headless(folder.path(), &args).env(FAULTS, "evaluation=delay:60000"));
    run.wait_for("saved");
    assert_eq!(assert_loads(&folder.path().join("kept.safetensors")), 50);
    let (status, took) = run.end_with_signal("TERM");
    assert!(status == 143 && took < TIMEOUT, "{status} after {took:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn ignored_signals_stay_ignored() {
    let folder = folder();
    let program = headless(folder.path(), &["trap"]);
    let mut run = RunningProgram::start(&mut after("trap '' HUP", &program));
    run.wait_for("start");
    kill(run.child.id(), "HUP");
    run.wait_for("progress");
    assert_eq!(run.end_with_signal("TERM").0, 143);
}

/// Waits for the message about an internal error, saves and quits, and checks what is left.
fn fails_in_the_interface(fault: &str, message: &str) {
    let folder = folder();
    let args = ["trap", "--set", "graph_every_updates=100", "--threads", "2"];
    let mut session = Session::start_with(folder.path(), &args, &[(FAULTS, fault)]);
    session.wait_for(message);
    session.wait_for("save and quit");
    session.press("\r");
    assert_eq!(session.end(), 1, "{fault}");
    let saved = folder.path().join("saves/trap-gdg-bridge-seed0.safetensors");
    assert!(assert_loads(&saved) > 0, "{fault}");
    let log =
        std::fs::read_dir(folder.path().join("gdg-tui/log")).unwrap().next().unwrap().unwrap();
    let log = std::fs::read_to_string(log.path()).unwrap();
    assert!(log.contains("injected fault") && log.contains("saved"), "{fault}: {log}");
}

#[test]
fn a_panic_in_the_trainer_is_shown_and_the_run_is_saved() {
    fails_in_the_interface("trainer=panic@800", "internal error");
}

#[test]
fn a_panic_in_an_update_thread_is_shown_and_the_run_is_saved() {
    fails_in_the_interface("helper=panic@3000", "internal error");
}

#[test]
fn a_panic_in_the_graph_builder_is_shown_and_the_run_is_saved() {
    fails_in_the_interface("graph=panic@1", "internal error");
}

#[test]
fn a_panic_in_the_viewer_is_shown_and_the_run_is_saved() {
    fails_in_the_interface("viewer=panic@60", "internal error");
}

#[test]
fn a_panic_in_an_evaluation_is_shown_and_the_run_is_saved() {
    fails_in_the_interface("evaluation=panic@1", "internal error");
}

#[test]
fn a_panic_in_the_interface_restores_the_terminal_and_saves_the_run() {
    let folder = folder();
    let args = ["trap", "--save", "kept.safetensors"];
    let mut session = Session::start_with(folder.path(), &args, &[(FAULTS, "interface=panic@25")]);
    assert_eq!(session.status(), 1);
    session.assert_terminal_restored();
    assert!(session.screen_text().contains("internal error"), "{}", session.screen_text());
    assert_loads(&folder.path().join("kept.safetensors"));
}

#[test]
fn the_interface_stays_responsive_while_other_threads_hang() {
    for thread in ["trainer", "viewer", "evaluation", "graph"] {
        let folder = folder();
        let fault = format!("{thread}=delay:3000@1");
        let mut session = Session::start_with(folder.path(), &["trap"], &[(FAULTS, &fault)]);
        session.wait_for("quit");
        session.press_for("?", "pause or resume training");
        session.close("pause or resume training");
        session.press("q");
        assert_eq!(session.end(), 0, "{thread}");
    }
}

#[test]
fn headless_panics_are_errors_and_the_run_is_saved() {
    for (fault, updates) in [
        ("trainer=panic@500", 1..500),
        ("graph=panic@1", 1..400),
        ("graph=panic@4", 1..401),
        ("evaluation=panic@1", 400..401),
    ] {
        let folder = folder();
        let args =
            ["trap", "--max-updates", "400", "--eval-tasks", "1", "--save", "kept.safetensors"];
        let (status, _, errors) = outcome(headless(folder.path(), &args).env(FAULTS, fault));
        assert_eq!(status, 1, "{fault}: {errors}");
        assert!(errors.contains("internal error") && errors.contains("log"), "{fault}: {errors}");
        let saved = assert_loads(&folder.path().join("kept.safetensors"));
        assert!(updates.contains(&saved), "{fault}: {saved}");
    }
}

#[test]
fn settings_that_exceed_the_memory_are_refused_with_the_amount_needed() {
    let folder = folder();
    let limited = |args: &[&str]| {
        outcome(&mut after("ulimit -v 2000000", isolated_command(folder.path()).args(args)))
    };
    for setting in ["hidden=4096", "buffer_size=100000000"] {
        let line = format!("--no-ui trap --max-updates 9 --set layers=8 --set {setting}");
        let (status, output, errors) = limited(&words(&line));
        assert_eq!((status, output.as_str()), (2, ""), "{setting}: {errors}");
        assert!(errors.contains("GB of memory"), "{setting}: {errors}");
    }
    let (status, _, errors) =
        limited(&["--no-ui", "trap", "--max-updates", "50", "--eval-tasks", "1", "--threads", "2"]);
    assert_eq!(status, 0, "the default fits: {errors}");
}

#[test]
fn curves_evaluations_and_log_survive_resuming() {
    let folder = folder();
    let path = checkpoint(folder.path());
    let history = train::load(&path, &Registry::builtin(), 1).unwrap().history().clone();
    assert_eq!(
        history.points().iter().map(|p| p.updates).collect::<Vec<_>>(),
        [50, 100, 150, 200, 250, 300, 350]
    );
    assert_eq!(history.evaluations().iter().map(|(at, _)| *at).collect::<Vec<_>>(), [350]);
    let mut session = Session::start(folder.path(), &["--resume", "small.safetensors"]);
    session.wait_for("training");
    session.press_for(" ", "paused");
    session.press_for("s", "saved small.safetensors");
    session.press("q");
    assert_eq!(session.end(), 0);
    let again = train::load(&path, &Registry::builtin(), 1).unwrap().history().clone();
    assert_eq!(again.points()[..7], history.points()[..]);
    assert!(
        again.notes.log.iter().any(|entry| entry.text.contains("gdg-bridge on trap")),
        "{:?}",
        again.notes.log
    );
}

#[test]
fn a_checkpoints_names_and_numbers_are_not_trusted() {
    let folder = folder();
    let path = checkpoint(folder.path());
    let good = train::read_saved(&std::fs::read(&path).unwrap()).unwrap();
    let changed = |change: &dyn Fn(&mut Saved)| {
        let mut saved = good.clone();
        change(&mut saved);
        train::to_bytes(&saved, &Job::default()).unwrap()
    };
    let evil = changed(&|saved| {
        let name = "../../evil/\x1b[2Jx";
        saved.state.put_text("map_name", name);
        saved.about.title = name.to_owned();
    });
    std::fs::write(&path, evil).unwrap();
    let loaded = train::load(&path, &Registry::builtin(), 1).unwrap();
    assert_eq!(loaded.world().title(), "[2Jx");
    assert_eq!(train::describe(&path).unwrap().title, "[2Jx");
    let numbers = |name: &str, number: f32| {
        changed(&|saved| {
            let mut numbers = saved.state.numbers(name).unwrap().to_vec();
            numbers[0] = number;
            saved.state.put_numbers(name, numbers);
        })
    };
    for (bytes, expected) in [
        (numbers("critic0.dense", f32::NAN), "non-finite"),
        (numbers("actor.table", f32::INFINITY), "non-finite"),
        (numbers("critic0.table_last", 1.0), "in the future"),
        (changed(&|saved| saved.state.put("seconds", &-1.0).unwrap()), "out of range"),
        (changed(&|saved| saved.state.put("counters", &"x").unwrap()), "its counters cannot be"),
        (changed(&|saved| saved.state.put("candidates", &0).unwrap()), "its candidates cannot be"),
        (changed(&|saved| saved.about.run.settings.learn.hidden = 0), "hidden must be"),
        (changed(&|saved| saved.about.run.method.learner = "\x1b[2J".to_owned()), "learner"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        let (status, _, errors) =
            outcome(&mut headless(folder.path(), &["--resume", "small.safetensors"]));
        assert!(status == 2 && !errors.contains('\x1b'), "{errors:?}");
        assert!(one_line(&errors).contains(expected), "{errors}");
    }
}

#[test]
fn checkpoints_of_other_versions_are_refused_with_the_version_that_opens_them() {
    let folder = folder();
    let header = r#"{"__metadata__":{"format":"gdg-tui checkpoint 4","version":"0.2.0"}}"#;
    let bytes = [&(header.len() as u64).to_le_bytes(), header.as_bytes()].concat();
    std::fs::write(folder.path().join("old.safetensors"), bytes).unwrap();
    for args in [&["--no-ui", "--resume", "old.safetensors"][..], &["runs", "."]] {
        let (_, output, errors) = outcome(isolated_command(folder.path()).args(args));
        let text = one_line(&[output, errors].concat());
        assert!(text.contains("was saved by version 0.2.0 of gdg-tui"), "{args:?}: {text}");
    }
}

#[test]
fn special_files_are_refused_without_blocking() {
    let folder = folder();
    nix::unistd::mkfifo(&folder.path().join("fifo"), nix::sys::stat::Mode::S_IRWXU).unwrap();
    symlink("/dev/zero", folder.path().join("zero")).unwrap();
    for file in ["fifo", "zero"] {
        for args in [
            &["check", file][..],
            &["--no-ui", file],
            &["--no-ui", "--resume", file],
            &["--no-ui", "--config", file],
            &["--no-ui", "trap", "--scen", file],
            &["--no-ui", file, "--csv", "q.csv"],
            &["--no-ui", "trap", "--scen", file, "--csv", "q.csv"],
            &["--no-ui", "trap", "--config", file, "--csv", "q.csv"],
            &["--no-ui", "trap", "--csv", file, "--overwrite"],
            &["suite", file],
        ] {
            let began = Instant::now();
            let (status, _, errors) = outcome(isolated_command(folder.path()).args(args));
            assert_eq!(status, 2, "{args:?}: {errors}");
            assert!(
                errors.contains("not a regular file") && began.elapsed() < TIMEOUT,
                "{args:?}: {errors}"
            );
        }
    }
    std::fs::create_dir(folder.path().join("saves")).unwrap();
    std::fs::rename(folder.path().join("fifo"), folder.path().join("saves/fifo.safetensors"))
        .unwrap();
    let mut session = Session::start(folder.path(), &["trap"]);
    session.wait_for("training");
    session.press_for("L", "not a regular file");
    session.close("not a regular file");
    session.press("q");
    assert_eq!(session.end(), 0);
}

#[test]
fn saving_keeps_private_permissions_and_links() {
    let folder = folder();
    let path = checkpoint(folder.path());
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o600)).unwrap();
    symlink("small.safetensors", folder.path().join("link.safetensors")).unwrap();
    let args = words(
        "--resume link.safetensors --max-updates 360 --eval-tasks 1 --save \
        link.safetensors",
    );
    assert_eq!(outcome(&mut headless(folder.path(), &args)).0, 0);
    assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    assert!(folder.path().join("link.safetensors").symlink_metadata().unwrap().is_symlink());
    assert_eq!(assert_loads(&path), 360);
}

#[test]
fn external_text_cannot_control_the_terminal() {
    let folder = folder();
    let acts = |c: char| c != '\n' && (c.is_control() || c == '\u{202e}');
    let evil = "evil\x1b]0;title\x07\u{9b}31m\u{202e}.txt";
    std::fs::write(folder.path().join(evil), "..x\n").unwrap();
    std::fs::write(
        folder.path().join("evil.json"),
        "{\"tau\x1b[2J\": 1,\n \"batch\": \"\u{9b}31m\"}",
    )
    .unwrap();
    std::fs::write(folder.path().join("good\u{9b}31m.txt"), "S.G\n...\n").unwrap();
    for args in [
        &["check", evil][..],
        &["--no-ui", evil],
        &["--no-ui", "\x1b[2Jno/such"],
        &["--no-ui", "--config", "evil.json"],
        &["--no-ui", "--set", "tau=\x1b[2J"],
        &["--no-ui", "--set", "\x1b[2J=1"],
        &["--no-ui", "--seed", "\x1b[2J"],
        &["--no-ui", "--resume", evil],
        &["check", "good\u{9b}31m.txt"],
        &words("--no-ui good\u{9b}31m.txt --max-updates 2 --eval-tasks 1 --set hidden=8")[..],
        &words(
            "suite good\u{9b}31m.txt --budget 2 --eval-tasks 1 --set hidden=8 --out out\u{9b}31m",
        ),
        &["runs", "out\u{9b}31m", "--json"],
        &["plot", "out\u{9b}31m"],
    ] {
        let (_, output, errors) = outcome(isolated_command(folder.path()).args(args));
        assert!(!output.is_empty() || !errors.is_empty());
        assert!(
            !output.contains(acts) && !errors.contains(acts),
            "{args:?}: {output:?} {errors:?}"
        );
    }
    for file in ["success.csv", "success.svg", "report.md"] {
        let text = std::fs::read_to_string(folder.path().join("out\u{9b}31m").join(file)).unwrap();
        assert!(!text.contains(acts), "{file}: {text:?}");
    }
}

#[test]
fn errors_about_huge_lines_are_short() {
    let folder = folder();
    let line = "x".repeat(50_000_000);
    for text in [
        format!("{{\"{line}\": 1}}"),
        format!("{{\"tau\": \"{line}\"}}"),
        format!("{{\"tau\": {line}}}"),
    ] {
        std::fs::write(folder.path().join("long.json"), text).unwrap();
        let (status, _, errors) =
            outcome(isolated_command(folder.path()).args(["--no-ui", "--config", "long.json"]));
        assert_eq!(status, 2);
        assert!(errors.len() < 5_000, "{} bytes of error", errors.len());
    }
}

#[test]
fn a_full_standard_error_does_not_change_the_exit_status() {
    let folder = folder();
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    for (args, expected) in
        [(&["--no-ui", "nomap"][..], 2), (&["--nonsense"], 2), (&["check", "nomap"], 2)]
    {
        let status = isolated_command(folder.path())
            .args(args)
            .stderr(full())
            .stdout(Stdio::null())
            .status()
            .unwrap();
        assert_eq!(status.code(), Some(expected), "{args:?}");
    }
    let maps = isolated_command(folder.path()).arg("maps").stdout(full()).output().unwrap();
    let message = String::from_utf8_lossy(&maps.stderr);
    assert!(message.contains("standard output") && message.contains("No space left"), "{message}");
    let args = ["trap", "--max-updates", "30", "--eval-tasks", "1", "--save", "kept.safetensors"];
    let trained = headless(folder.path(), &args).stdout(full()).output().unwrap();
    assert_eq!(trained.status.code(), Some(1), "records could not be written");
    let message = String::from_utf8_lossy(&trained.stderr);
    assert!(message.contains("training goes on"), "{message}");
    let kept = gdg::train::describe(&folder.path().join("kept.safetensors")).unwrap();
    assert_eq!(kept.updates, 30, "the whole run");
    assert!(folder.path().join("kept.safetensors").is_file(), "but the run is kept");
    assert!(!folder.path().join("saves").exists(), "once");
}
