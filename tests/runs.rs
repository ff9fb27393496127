//! `gdg-tui runs`: lines of JSON for scripts, and the screen on a terminal.

use std::path::Path;
use std::time::{Duration, SystemTime};

use crate::ran::{Ran, SMALL, has_parts, in_folder, program_in, ran, words};
use crate::support::{headless, kill, wait_until};
use serde_json::{Value, json};

/// Returns the records of a run that ends as `end` says.
fn records(seed: u64, end: &Value) -> String {
    let start = json!({
        "event": "start", "version": "0.2.0", "world": "maze", "map": {"name": "room"},
        "method": "her", "preset": "tuned", "settings": {"hidden": 64}, "seed": seed,
        "threads": "auto", "updates": 0,
    });
    let score = json!({"success": 0.25, "spl": 0.2, "steps_ratio": null, "by_distance": []});
    let evaluation = json!({
        "event": "evaluation", "seconds": 1.5, "updates": 1000, "env_steps": 16000,
        "greedy": score, "planned": null, "distance_error": null, "bridges": null,
        "coverage": 0.75,
    });
    [&start, &evaluation, end].map(|record| record.to_string() + "\n").concat()
}

/// Trains for 20 updates, with the arguments of `line`.
fn trained(folder: &Path, line: &str) -> Ran {
    let more = words("--no-ui --max-updates 20 --eval-tasks 1");
    in_folder(folder, &[&words(line)[..], &more, &SMALL].concat())
}

#[test]
fn runs_of_every_kind_are_lines_of_json() {
    let folder = tempfile::tempdir().unwrap();
    let stopped = json!({"event": "end", "reason": "interrupted", "seconds": 2.0, "updates": 1500, "updates_per_second": 500.0});
    let grows = json!({"event": "progress", "seconds": 2.0, "updates": 2000, "env_steps": 0, "episodes": 0, "updates_per_second": 1.0, "losses": {}});
    for (name, text) in [
        ("stopped.jsonl", records(1, &stopped)),
        ("grows.jsonl", records(2, &grows) + "{\"event\":\"evalu"),
        ("damaged.jsonl", "[]\n".to_owned()),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    trained(folder.path(), "trap --seed 4 --save own.safetensors").success();
    let done = in_folder(folder.path(), &["runs", ".", "--json"]);
    done.success();
    has_parts(&done.err, &["damaged.jsonl:1: not a record", ": left out"]);
    let lines = done.records();
    let found = |file: &str| lines.iter().find(|run| run["file"] == file).unwrap();
    assert_eq!(lines.len(), 3, "{}", done.out);
    let stopped = found("stopped.jsonl");
    let wanted = json!({
        "kind": "records", "state": "stopped", "map": "room", "method": "her", "seed": 1,
        "settings": {"preset": "tuned", "hidden": 64}, "updates": 1500, "evaluated_at": 1000,
        "success": 0.25, "alone": 0.25, "error": null, "explored": 0.75,
        "checkpoint": null,
    });
    for (name, value) in wanted.as_object().unwrap() {
        assert_eq!(stopped[name], *value, "{name} of {stopped}");
    }
    let grows = found("grows.jsonl");
    assert_eq!([&grows["state"], &grows["updates"]], [&json!("training"), &json!(2000)]);
    let own = found("own.safetensors");
    assert_eq!(own["checkpoint"], "own.safetensors");
    assert_eq!(
        [&own["map"], &own["updates"], &own["kind"]],
        [&json!("trap"), &json!(20), &json!("checkpoint")]
    );
    assert!(own["success"].is_number() && own["written"].is_string(), "{own}");

    let refused = in_folder(folder.path(), &["runs", "elsewhere", "--json"]).refusal();
    has_parts(&refused, &["elsewhere: cannot be read"]);
}

const START: &str = r#"{"event":"start","world":"maze","map":{"name":"room"},"method":"gdg","preset":"default","settings":{},"seed":3,"updates":0}"#;

#[test]
fn a_line_that_is_no_record_is_named_and_explained() {
    let folder = tempfile::tempdir().unwrap();
    let listed = |text: String| {
        std::fs::write(folder.path().join("run.jsonl"), text).unwrap();
        let done = in_folder(folder.path(), &["runs", "--json"]);
        (done.records(), done.err.trim_end().to_owned())
    };
    let long = "x".repeat(17 << 20);
    for (line, problem) in [
        ("[1]", ": not a record: no object with an \"event\""),
        ("{\"event\":", ":9: not a record: not JSON"),
        (
            "{\"event\":\"progress\",\"updates\":-3}",
            ": not a record: invalid value: integer `-3`, expected u64",
        ),
        (&long, ": not a record: longer than 16 MB"),
    ] {
        let none = listed(line.to_owned() + "\n");
        assert_eq!(none, (Vec::new(), format!("run.jsonl:1{problem}: left out")));
        let [one, nine] = [1, 9].map(|n| json!({"event": "progress", "updates": n}).to_string());
        let (found, note) = listed([START, &one, line, &nine, ""].join("\n"));
        assert_eq!(found[0]["updates"], 9, "the others are read");
        assert_eq!(note, format!("run.jsonl:3{problem}: left out"));
    }
    let (_, note) = listed("version https://git-lfs.github.com/spec/v1\n".to_owned());
    let pointer = "is a Git LFS pointer, which stands for the file, not records of a run";
    assert_eq!(note, format!("run.jsonl: {pointer}: left out"));
}

#[test]
fn a_checkpoint_is_found_from_above_its_records_and_null_in_json_once_it_is_gone() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let write = |file: &Path, text: &str| {
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        std::fs::write(file, text).is_ok()
    };
    let listed = |place: &str| {
        in_folder(folder.path(), &["runs", path(place).to_str().unwrap(), "--json"]).records()
    };
    let text = |saved: &str| {
        let saved = json!({"event": "saved", "updates": 1, "path": saved});
        format!("{START}\n{saved}\n")
    };
    write(&path("saves/a.safetensors"), "");
    write(&path("records/a.jsonl"), &text("saves/a.safetensors"));
    let found = |place: &str| listed(place)[0]["checkpoint"].clone();
    assert_eq!(found("records"), json!(path("saves/a.safetensors")));
    std::fs::remove_file(path("saves/a.safetensors")).unwrap();
    assert_eq!(found("records"), Value::Null);
    // Not every file system has names that are no text.
    let odd = path("odd").join(std::ffi::OsStr::from_bytes(b"a\xff.jsonl"));
    if write(&odd, START) {
        assert!(listed("odd")[0]["file"].as_str().unwrap().ends_with("a\u{fffd}.jsonl"));
    }
    // The present folder, or one above, may have another of that name.
    write(&path("b/Cargo.toml"), "");
    for named in ["Cargo.toml", "saves/Cargo.toml"] {
        write(&path(named), "");
        write(&path("b/a.jsonl"), &text(named));
        assert_eq!(found("b"), json!(path("b/Cargo.toml")));
    }
}

#[test]
fn a_run_that_could_not_be_saved_in_its_folder_is_found_from_any() {
    let folder = tempfile::tempdir().unwrap();
    let saved = "gdg-tui/recovered/own.safetensors";
    trained(folder.path(), &format!("trap --save {saved}")).success();
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    let run = |args: &[&str]| ran(program_in(folder.path()).current_dir(&other).args(args));
    has_parts(&run(&["runs"]).out, &["trap", saved]);
    assert_eq!(run(&["runs", ".."]).out.matches(saved).count(), 1);
    assert!(!run(&["runs", "../other"]).out.contains(saved));
    has_parts(
        &run(&["--no-ui", "--resume"]).refusal(),
        &["one was saved elsewhere: gdg-tui --resume", saved],
    );
}

#[test]
fn a_checkpoint_belongs_to_records_of_the_same_data_and_tasks() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("room.txt"), "....\n....\n").unwrap();
    std::fs::write(path("room.scen"), "version 1\n0 room.txt 4 2 0 0 3 0 3\n").unwrap();
    let data = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = data.join("crates/gdg/tests/data/ogbench/giant.npz");
    for (fact, map, option, file) in [
        ("data", "ogbench-pointmaze-giant", "--data", data),
        ("scenario", "room.txt", "--scen", "room.scen".into()),
    ] {
        let mut command = program_in(folder.path());
        command.args(["--no-ui", map, option]).arg(file).args(SMALL).args(["--max-updates", "5"]);
        command.args(["--eval-tasks", "1", "--save", "a.safetensors", "--overwrite"]);
        let done = ran(command);
        done.success();
        let listed = |records: String| {
            std::fs::write(path("a.jsonl"), records).unwrap();
            in_folder(folder.path(), &["runs", ".", "--json"]).records()
        };
        let one = listed(done.out.clone());
        assert!(one.len() == 1 && one[0]["settings"][fact].is_string(), "{one:?}");
        // Its records would have said so.
        let two = listed(done.out.replace(&format!("\"{fact}\":"), "\"other\":"));
        assert!(two.iter().filter(|run| run["settings"][fact].is_string()).count() == 1, "{two:?}");
        assert_eq!(two.len(), 2);
    }
}

#[test]
fn a_run_is_found_and_resumed_on_a_terminal() {
    use crate::support::Session;
    let folder = tempfile::tempdir().unwrap();
    let mut session = Session::start(folder.path(), &["runs"]);
    session.wait_for("no runs here yet");
    session.press("q");
    assert_eq!(session.end(), 0);
    trained(folder.path(), "trap --save saves/own.safetensors").success();
    let stopped = json!({"event": "end", "reason": "interrupted", "seconds": 2.0, "updates": 1500, "updates_per_second": 500.0});
    std::fs::write(folder.path().join("saves/her.jsonl"), records(1, &stopped)).unwrap();
    let mut session = Session::start(folder.path(), &["runs"]);
    session.wait_for("2 runs");
    session.press_for("/trap\r", "1 of 2 runs");
    session.press_for("\r", "q list");
    session.press_for("q", "1 of 2 runs");
    session.press("q");
    assert_eq!(session.end(), 0);
}

#[test]
fn runs_of_a_sweep_are_told_apart_and_deleted_with_their_pictures() {
    use crate::support::Session;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join("saves/suite").join(name);
    let line = "suite trap --sweep hidden=16,128 --max-updates 20 --eval-tasks 1";
    let done = in_folder(folder.path(), &words(line));
    // The preset's own value has a name, too.
    has_parts(done.success(), &["gdg-bridge, hidden=16 ", "gdg-bridge, hidden=128 "]);
    let mut session = Session::start(folder.path(), &["runs"]);
    session.wait_for("hidden=16 ");
    session.wait_for("hidden=128 ");
    assert!(!session.screen_text().contains(".json"), "files have no endings");
    session.press_for("/hidden=16\r", "1 of 2 runs");
    session.press_for("D", "; the report stays");
    session.press_for("d", "deleted 3 files");
    session.press("q");
    assert_eq!(session.end(), 0);
    for folder in ["jobs", "pictures"] {
        let left = std::fs::read_dir(path(folder)).unwrap().map(|file| file.unwrap().file_name());
        let left: Vec<String> = left.map(|file| file.into_string().unwrap()).collect();
        assert!(
            left.iter().all(|file| file.contains("hidden_128")) && !left.is_empty(),
            "{left:?}"
        );
    }
    assert!(path("report.md").is_file());
}

#[test]
fn a_run_that_is_slow_or_stopped_has_not_ended() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.jsonl");
    let state = || {
        let long_ago = SystemTime::now() - Duration::from_secs(999);
        std::fs::File::options().append(true).open(&path).unwrap().set_modified(long_ago).unwrap();
        let listed = in_folder(folder.path(), &["runs", "--json"]);
        serde_json::from_str::<Value>(listed.success()).unwrap()["state"].clone()
    };
    // The command itself keeps the file open.
    let mut run = {
        let mut command = headless(folder.path(), &["trap"]);
        command.stdout(std::fs::File::create(&path).unwrap()).spawn().unwrap()
    };
    wait_until("records", || std::fs::read(&path).unwrap().contains(&b'\n'));
    kill(run.id(), "STOP");
    assert_eq!(state(), "training");
    kill(run.id(), "KILL");
    run.wait().unwrap();
    assert_eq!(state(), "cut off");
}

#[test]
fn a_run_that_another_program_trains_is_watched_and_a_copy_trained() {
    use crate::support::Session;
    use std::io::Write;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    // As if it went on.
    let records: String = trained(folder.path(), "trap --save own.safetensors")
        .out
        .lines()
        .filter(|line| !line.contains("\"end\""))
        .map(|line| format!("{line}\n"))
        .collect();
    std::fs::write(path("own.jsonl"), records).unwrap();
    let checkpoint = std::fs::read(path("own.safetensors")).unwrap();
    // Before the first save.
    std::fs::remove_file(path("own.safetensors")).unwrap();
    let mut session = Session::start(folder.path(), &["watch", "own.safetensors"]);
    session.wait_for("own.safetensors: not saved yet; after 15 s");
    std::fs::write(path("own.safetensors"), &checkpoint).unwrap();
    std::fs::File::options()
        .append(true)
        .open(path("own.jsonl"))
        .unwrap()
        .write_all(b"\n")
        .unwrap();
    session.wait_for("watching own ");
    for key in [" ", "o", "e"] {
        session.press(key);
        session.wait_for("this run is only watched: C trains a copy");
    }
    // What is refused is not in the help.
    session.press_for("?throttle", "nothing fits");
    session.close("nothing fits");
    session.press_for("?learning_rate", "setting: Adam's");
    session.press("\r");
    session.wait_until_gone("setting: Adam's");
    assert!(!session.screen_text().contains("value of learning_rate"));
    let progress = json!({"event": "progress", "seconds": 2.0, "updates": 7777, "env_steps": 9,
        "episodes": 0, "updates_per_second": 1.0, "left": 4000.0, "losses": {}});
    let mut file = std::fs::File::options().append(true).open(path("own.jsonl")).unwrap();
    writeln!(file, "{progress}").unwrap();
    session.wait_for("7,777");
    session.wait_for("1:06:");
    std::fs::write(path("own.safetensors"), &checkpoint[..999]).unwrap();
    session.wait_for("not loaded: own.safetensors is damaged");
    session.wait_for("cannot be read");
    std::fs::remove_file(path("own.safetensors")).unwrap();
    session.wait_for("file is gone");
    std::fs::write(path("own.safetensors"), &checkpoint).unwrap();
    session.wait_for("just now");
    std::fs::remove_file(path("own.jsonl")).unwrap();
    session.wait_for("records are gone");
    trained(folder.path(), "trap --seed 5 --save other.safetensors").success();
    std::fs::rename(path("other.safetensors"), path("own.safetensors")).unwrap();
    session.wait_for(" seed 5");
    std::fs::write(path("own.safetensors"), &checkpoint).unwrap();
    session.wait_for(" seed 0");
    session.press_for("C", "name of the copy");
    session.press_for("\u{15}own.safetensors\r", "saved saves/own.safetensors at update 20");
    session.press("q");
    assert_eq!(session.end(), 0);
    assert_eq!(std::fs::read(path("own.safetensors")).unwrap(), checkpoint);
    // A job of an experiment that goes on.
    std::fs::create_dir(path("jobs")).unwrap();
    std::fs::write(path("jobs/job.safetensors"), &checkpoint).unwrap();
    for (held, state) in [(true, "\"training\""), (false, "\"saved\"")] {
        if held {
            std::fs::write(path("jobs/job.lock"), "").unwrap();
        } else {
            std::fs::remove_file(path("jobs/job.lock")).unwrap();
        }
        let out = in_folder(folder.path(), &["runs", "--json"]).out;
        let job = out.lines().find(|line| line.contains("jobs/job")).unwrap();
        assert!(job.contains(state), "{job}");
    }
    // One that nothing here knows of yet.
    let session = Session::start(folder.path(), &["watch", "later.safetensors"]);
    session.wait_for("waiting for later.safetensors, which is not there yet: Ctrl-C ends");
    std::fs::write(path("later.safetensors"), &checkpoint).unwrap();
    session.wait_for("watching later ");
    in_folder(folder.path(), &["watch", "none.jsonl"]).refusal();
}
