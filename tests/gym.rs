//! Gymnasium environments as worlds, and what can go wrong with them.
//!
//! What needs Python with numpy and gymnasium is ignored otherwise: set `GDG_PYTHON` to such an
//! interpreter, as `.ci/run` does; some need gymnasium-robotics and mujoco as well.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::ran::{one_line, words};
use gdg::env::gym::Address;
use gdg::env::{Environment, GymOptions, WorldScene};
use gdg::train::{Preset, Registry, Run, Trainer};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::support::{kill, wait_until};

/// Settings that keep a run small.
const SMALL: &str = "--set hidden=16 --set candidates=30 --set buffer_size=20000 --set learning_starts=200 \
    --set env_steps_per_update=8 --threads 1";

/// Steps after which something goes wrong: beyond those of the first look.
const AFTER: &str = "900";

/// Returns the interpreter to test with.
fn python() -> PathBuf {
    std::env::var_os("GDG_PYTHON").map_or_else(|| "python3".into(), PathBuf::from)
}

/// Returns the program in a folder, with the environments of these tests.
fn program(folder: &Path) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui"));
    command.current_dir(folder).env_remove("VIRTUAL_ENV");
    for name in ["HOME", "XDG_CONFIG_HOME", "XDG_STATE_HOME"] {
        command.env(name, folder);
    }
    command.env("PYTHONPATH", Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gym"));
    command
}

/// Trains in an environment of `awkward.py`, with other arguments.
fn train(folder: &Path, name: &str, args: &[&str]) -> Command {
    let mut command = program(folder);
    command.args(["--no-ui", &format!("gym:awkward:{name}-v0")]);
    command.arg("--python").arg(python()).args(words(SMALL)).args(["--eval-tasks", "4"]).args(args);
    command
}

/// Resumes a run, with other arguments and the interpreter that its checkpoint names.
fn resume(folder: &Path, file: &str, args: &[&str]) -> Command {
    let mut command = program(folder);
    command.args(["--no-ui", "--resume", file, "--threads", "1", "--eval-tasks", "4"]).args(args);
    command
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Returns the records of a kind, without times.
fn records(output: &Output, event: &str) -> Vec<Value> {
    let lines = String::from_utf8_lossy(&output.stdout).into_owned();
    let parsed = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let of_kind = parsed.filter(|record| record["event"] == event);
    of_kind
        .map(|mut record| {
            for time in ["seconds", "updates_per_second", "left"] {
                record.as_object_mut().unwrap().remove(time);
            }
            record
        })
        .collect()
}

/// Returns an interpreter that is none: a shell script.
fn fake_python(folder: &Path, script: &str) -> PathBuf {
    let path = folder.join("python");
    std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).unwrap();
    path
}

/// Opens an environment of `awkward.py`.
fn open(folder: &Path, name: &str) -> Box<dyn Environment> {
    let packages = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gym");
    let script =
        format!("PYTHONPATH='{}' exec '{}' \"$@\"", packages.display(), python().display());
    let options =
        GymOptions { python: Some(fake_python(folder, &script)), ..GymOptions::default() };
    let registry = Registry::builtin().with(|own| own.options = options);
    registry.open(&format!("gym:awkward:{name}-v0")).unwrap().unwrap()
}

/// Opens an environment with a fake interpreter; returns the error and how long it took.
fn error_with(script: &str) -> (String, Duration) {
    let folder = tempfile::tempdir().unwrap();
    let path = fake_python(folder.path(), script);
    let began = Instant::now();
    let output = program(folder.path())
        .args(["--no-ui", "gym:Maze-v0", "--env-timeout", "2", "--python"])
        .arg(path)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    (one_line(&stderr(&output)), began.elapsed())
}

/// Checks that an error names the environment and says this.
fn assert_says(error: &str, what: &str) {
    let error = one_line(error);
    assert!(error.contains("-v0: "), "the environment is named: {error}");
    assert!(error.contains(what), "{what:?} in {error}");
    assert!(!error.contains('\u{1b}'), "safe to show: {error:?}");
}

#[test]
fn without_an_interpreter_the_error_says_how_to_get_one() {
    let folder = tempfile::tempdir().unwrap();
    let output = program(folder.path())
        .args(["--no-ui", "gym:Maze-v0", "--python", "nowhere/python"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_says(&stderr(&output), "there is no Python interpreter nowhere/python");
    assert_says(&stderr(&output), "--python PATH");
}

#[test]
fn an_address_that_is_none_is_refused_before_anything_starts() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = program(folder.path());
    command.args(["--no-ui", "gym:os.x y:M-v0", "--python", "nowhere/python"]);
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("is not the name of a Python package"), "{}", stderr(&output));
    for text in ["my.own_package:Maze-v0", "space/Maze-v0"] {
        let address: Address = text.parse().unwrap();
        assert_eq!(
            (address.to_string(), &*address.id == text),
            (text.to_owned(), !text.contains(':'))
        );
    }
    for (text, wrong) in [
        ("", "is not the ID"),
        ("a b:Maze-v0", "is not the name of a Python package"),
        ("os;x:Maze-v0", "is not the name of a Python package"),
        ("package:", "is not the ID"),
        ("package:two:Maze-v0", "is not the ID"),
        ("mazes.py:Maze-v0", "is named without .py: give gym:mazes:Maze-v0"),
        ("\u{1b}[2J", "is not the ID"),
    ] {
        let error = text.parse::<Address>().unwrap_err();
        assert!(error.contains(wrong) && !error.contains('\u{1b}'), "{text:?}: {error}");
    }
}

#[test]
fn an_interpreter_that_ends_at_once_is_quoted() {
    let (error, took) = error_with("echo 'this is \x1b[1mno Python' >&2; exit 3");
    assert_says(&error, "its Python process has ended: exit status: 3");
    assert_says(&error, "no Python");
    assert!(took < Duration::from_secs(20), "{took:?}");
}

#[test]
fn an_interpreter_that_writes_garbage_or_huge_lengths_is_none() {
    // To the socket, which is the standard input.
    let (error, _) = error_with("echo 'Hello, world! This is more than a header.' >&0; sleep 9");
    assert_says(&error, "its worker answers something else than asked");
    // A reply of 2 GB, and one of no bytes.
    let (error, _) = error_with(r"printf '\000\000\000\000\000\000\000\200' >&0; sleep 9");
    assert_says(&error, "its worker answers with 2147483648 bytes: too many");
    let (error, _) = error_with(r"printf '\000\000\000\000\000\000\000\000' >&0; sleep 9");
    assert_says(&error, "describes it in a way that makes no sense");
    // A header in part.
    let (error, _) = error_with(r"printf '\000\000' >&0");
    assert_says(&error, "its Python process has ended");
}

#[test]
fn a_missing_module_is_named_with_where_it_was_looked_for() {
    let reply = r#"{"unsupported":false,"missing":"my_mazes","error":"","searched":["/here"]}"#;
    let length = format!(r"\001\000\000\000\{:03o}\000\000\000", reply.len());
    let (error, _) = error_with(&format!("printf '{length}{reply}' >&0; sleep 9"));
    assert_says(&error, "there is no Python module my_mazes: looked for in /here");
    assert!(!error.contains("pip"), "it may be anybody's: {error}");
}

#[test]
fn an_interpreter_that_hangs_is_given_up_after_the_time_limit() {
    let (error, took) = error_with("exec sleep 1000");
    assert_says(&error, "took more than 2 seconds to be opened (--env-timeout sets the limit)");
    assert!(took < Duration::from_secs(30), "{took:?}");
    // One that answers byte by byte is no better.
    let (error, _) = error_with(r"while :; do printf '\000' >&0; sleep 1; done");
    assert_says(&error, "took more than 2 seconds");
}

#[test]
fn the_time_limit_does_not_count_while_the_program_is_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let reply = r#"{"unsupported":true,"error":"this is in time"}"#;
    let reply = format!(r"\001\000\000\000\{:03o}\000\000\000{reply}", reply.len());
    // It answers while the program is stopped, after more than the limit.
    let script = format!(
        "touch asked; until [ -e stopped ]; do sleep .05; done; sleep 3
         printf '{reply}' >&0; touch answered; sleep 9"
    );
    let mut program = program(folder.path());
    program.args(["--no-ui", "gym:Maze-v0", "--env-timeout", "2", "--python"]);
    program.arg(fake_python(folder.path(), &script)).stderr(Stdio::piped());
    let program = program.spawn().unwrap();
    let wait_for = |file: &str| wait_until(file, || folder.path().join(file).exists());
    wait_for("asked");
    kill(program.id(), "STOP");
    std::fs::write(folder.path().join("stopped"), "").unwrap();
    wait_for("answered");
    kill(program.id(), "CONT");
    assert_says(&stderr(&program.wait_with_output().unwrap()), "this is in time");
}

#[test]
fn a_checkpoint_of_another_machines_environment_stays_sound() {
    let folder = tempfile::tempdir().unwrap();
    let output = program(folder.path())
        .args(["--no-ui", "gym:Maze-v0", "--resume", "--python", "nowhere/python"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("there is no checkpoint of Maze-v0"), "{}", stderr(&output));
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn what_is_missing_or_unsupported_is_said() {
    let folder = tempfile::tempdir().unwrap();
    for (name, wrong) in [
        ("Discrete", "its actions are Discrete(4): only continuous ones (Box) are supported"),
        ("Image", "its observations are images: only vectors of numbers are supported"),
        ("Goalless", "it has no goals: its observations need observation, achieved_goal and"),
        ("Dense", "does not say when a goal is reached: give --goal-radius"),
        ("Absent", "Environment `Absent` doesn't exist"),
        ("Whole", "its actions are whole numbers"),
        ("Empty", "its observations are no numbers at all"),
        ("Aimless", "its goals are no numbers at all"),
        ("OldStep", "has to return observation, reward, terminated, truncated, info"),
        ("OldReset", "the old gym: reset takes seed and options"),
        ("NoInfo", "this has to return observation, info"),
        ("Zero", "does not say when a goal is reached: give --goal-radius"),
        ("Shares", "changes another in the same process"),
    ] {
        let output = train(folder.path(), name, &["--max-updates", "10"]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{name}: {}", stderr(&output));
        assert_says(&stderr(&output), wrong);
    }
    let output = program(folder.path())
        .args(["--no-ui", "gym:no_such_package:Maze-v0", "--python"])
        .arg(python())
        .output()
        .unwrap();
    assert_says(&stderr(&output), "there is no Python module no_such_package: looked for in ");
    assert!(!stderr(&output).contains("pip"), "{}", stderr(&output));
    let old = "import sys; sys.version_info = (3, 7, 9); exec(sys.argv[1])";
    let (error, _) = error_with(&format!("exec '{}' -c '{old}' \"$3\"", python().display()));
    assert_says(&error, "Python 3.8 or later is needed, and this is 3.7: --python PATH names");
    // What is not found out can be given.
    for (name, option, given) in [("Dense", "--goal-radius", "0.7"), ("Shares", "--workers", "16")]
    {
        let args = ["--max-updates", "10", option, given];
        let output = train(folder.path(), name, &args).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn what_the_learner_needs_is_found_out() {
    let folder = tempfile::tempdir().unwrap();
    let record = |name: &str, args: &[&str]| {
        let args = [&["--max-updates", "5"], args].concat();
        let output = train(folder.path(), name, &args).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        records(&output, "start")[0].clone()
    };
    let start = |name: &str, args: &[&str]| record(name, args)["gym"].clone();
    let found = start("Point", &[]);
    assert_eq!(found["achieved"], serde_json::json!([1, 2]), "within the observation");
    assert!((found["goal_radius"].as_f64().unwrap() - 0.5).abs() < 1e-3, "by asking for rewards");
    assert_eq!((&found["state"], &found["episode_steps"]), (&3.into(), &40.into()));
    let change = found["change_per_step"][1].as_f64().unwrap();
    assert!((0.3..0.6).contains(&change), "actions up to 0.5: {change}");
    let half = found["half_range"][1].as_f64().unwrap();
    assert!((5.0..8.0).contains(&half), "goals within 5: {half}");
    start("Strict", &[]);
    let tasks = record("Tasks", &[]);
    let own = &tasks["gym"];
    assert_eq!((&own["achieved"], &own["tasks"]), (&serde_json::json!([0, 1]), &3.into()));
    let given = record("Tasks", &["--goal", "1"]);
    assert_eq!(given["gym"]["achieved"], serde_json::json!([1]));
    // What `--goal` is by default is not said.
    let known = [&tasks, &given].map(|start| start["fingerprint"].as_str().unwrap());
    assert!(known[0].starts_with("awkward, goal radius 0.5, 40 steps, "), "{known:?}");
    assert!(
        known[1].starts_with("awkward, goal radius 0.5 in components 1, 40 steps, "),
        "{known:?}"
    );
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn the_same_seed_gives_the_same_run_resumed_or_not_and_with_any_number_of_workers() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, args: &[&str]| {
        let output = train(folder.path(), name, args).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        output
    };
    let whole = ["--max-updates", "120"];
    let first = records(&run("Point", &whole), "evaluation");
    assert_eq!(first.len(), 1);
    assert_eq!(first, records(&run("Point", &whole), "evaluation"));
    assert_eq!(
        first,
        records(&run("Point", &[&whole[..], &["--workers", "3"]].concat()), "evaluation")
    );
    let other = records(&run("Point", &[&whole[..], &["--seed", "7"]].concat()), "evaluation");
    assert_ne!(first, other);
    run("Point", &["--max-updates", "50", "--save", "half.safetensors"]);
    let resumed = resume(folder.path(), "half.safetensors", &whole).output().unwrap();
    assert!(resumed.status.success(), "{}", stderr(&resumed));
    assert_eq!(first, records(&resumed, "evaluation"), "resumed in the middle of episodes");
    assert!(!stderr(&resumed).contains("new episodes"));
    // What was drawn when the module was imported is the same in all processes.
    let twice = [(), ()].map(|()| records(&run("Imports", &whole), "evaluation"));
    assert_eq!(twice[0], twice[1]);
    // So does what draws from the random numbers that all environments of a process share.
    let drawn = records(&run("Global", &whole), "evaluation");
    run("Global", &["--max-updates", "50", "--save", "global.safetensors"]);
    let resumed = resume(folder.path(), "global.safetensors", &whole).output().unwrap();
    let workers = run("Global", &[&whole[..], &["--workers", "3"]].concat());
    for other in [resumed, workers] {
        assert_eq!(drawn, records(&other, "evaluation"), "{}", stderr(&other));
    }
    // What comes out differently begins anew, with a warning; resumed twice, it does the same.
    run("Elsewhere", &["--max-updates", "50", "--save", "elsewhere.safetensors"]);
    let twice =
        [(), ()].map(|()| resume(folder.path(), "elsewhere.safetensors", &whole).output().unwrap());
    assert!(stderr(&twice[0]).contains("the agents begin new episodes"), "{}", stderr(&twice[0]));
    assert_eq!(records(&twice[0], "evaluation"), records(&twice[1], "evaluation"));
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn a_point_learns_and_tasks_are_the_environments_own() {
    let folder = tempfile::tempdir().unwrap();
    // All tasks of the second begin in one corner, which takes longer to learn.
    let worlds = [
        ("Point", 1, "600", &[("alone", 0.75)][..]),
        ("Tasks", 3, "2400", &[("alone", 0.1), ("planned", 0.4)]),
        ("Writes", 1, "600", &[("alone", 0.75)]),
    ];
    for (name, groups, updates, least) in worlds {
        let args =
            ["--max-updates", updates, "--set", "env_steps_per_update=2", "--set", "hidden=32"];
        let output = train(folder.path(), name, &args).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        for (by, least) in least {
            let found = &records(&output, "evaluation")[0][by];
            assert_eq!(found["by_distance"].as_array().unwrap().len(), groups);
            assert!(found["success"].as_f64().unwrap() >= *least, "{name}: {found}");
        }
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn jobs_with_another_goal_radius_are_others_and_with_options_of_maps_none() {
    let folder = tempfile::tempdir().unwrap();
    let list = |args: &[&str]| {
        let mut command = program(folder.path());
        command.env("VIRTUAL_ENV", python().ancestors().nth(2).unwrap());
        let output = command.args(["suite", "gym:awkward:Point-v0", "--list"]).args(args).output();
        let output = output.unwrap();
        (String::from_utf8_lossy(&output.stdout).into_owned(), stderr(&output))
    };
    let [own, near, far] =
        [&[][..], &["--goal-radius", "0.1"], &["--goal-radius", "0.2"]].map(list);
    assert!(own.0.contains("gymawkwardPoint-v0-gdg-bridge-seed1-"), "{own:?}");
    let mut command = program(folder.path());
    command.args(["suite", "gym:awkward:Point-v0", "--list", "--python"]).arg(python());
    assert_eq!(String::from_utf8_lossy(&command.output().unwrap().stdout), own.0);
    assert!(own.0 != far.0 && near.0 != far.0, "{own:?} {near:?} {far:?}");
    assert!(list(&["--cell", "2"]).1.contains("--cell applies only to maps"));
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn the_example_of_an_environment_of_ones_own_trains_and_its_tasks_are_far() {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    let mut command = program(folder.path());
    command.env("PYTHONPATH", examples);
    command
        .args(["--no-ui", "gym:thin_rooms:ThinRooms-v0", "--python"])
        .arg(python())
        .args(words(SMALL));
    let output = command.args(["--max-updates", "60", "--eval-tasks", "3"]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let start = &records(&output, "start")[0]["gym"];
    let facts = ["goal_radius", "episode_steps", "tasks"].map(|name| &start[name]);
    assert_eq!(facts.map(Value::to_string), ["1.0", "600", "1"]);
    let evaluations = records(&output, "evaluation");
    let reached = evaluations.last().unwrap()["planned"]["success"].as_f64().unwrap();
    assert!(reached < 1.0, "nobody knows the way to the farthest rooms yet");
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn no_plan_leads_through_a_locked_door_without_the_key() {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    let mut command = program(folder.path());
    command.env("PYTHONPATH", &examples);
    command.args(["--no-ui", "gym:key_room:KeyRoom-v0", "--python"]).arg(python());
    command.args(["--max-updates", "9000", "--eval-tasks", "20", "--save", "key.safetensors"]);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    // Without the key, half of the goals are out of reach. Plans that take no account of it reach .75.
    let last = records(&output, "evaluation").pop().unwrap();
    let reached = last["planned"]["success"].as_f64().unwrap();
    assert!(reached >= 0.9, "{last}");
    let moved = records(&output, "progress").pop().unwrap()["goal_moved"].as_f64().unwrap();
    assert!((0.5..=1.0).contains(&moved), "{moved}");
    let mut export = program(folder.path());
    export.args(["export-policy", "key.safetensors", "--plans", "--out", "policy.safetensors"]);
    assert!(export.output().unwrap().status.success());
    let walks = "
import gymnasium, gdg_tui, key_room
policy, env, reached = gdg_tui.load_policy('policy.safetensors'), gymnasium.make('KeyRoom-v0'), 0
for seed in range(20):
    seen, info = env.reset(seed=seed)
    walk, ended = policy.walk(policy.goal(seen, info)), False
    while not ended:
        seen, reward, _, ended, info = env.step(walk.step(policy.state(seen)))
        ended = ended or reward == 0
    reached += reward == 0
print(reached)";
    let walks = Command::new(python())
        .args(["-B", "-c", walks])
        .env("PYTHONPATH", examples)
        .current_dir(folder.path())
        .output()
        .unwrap();
    let count: u32 = String::from_utf8_lossy(&walks.stdout).trim().parse().unwrap_or_default();
    assert!(count >= 17, "{count} {}", stderr(&walks));
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn a_disc_that_a_finger_pushes_is_learned_from_recordings_and_without() {
    let folder = tempfile::tempdir().unwrap();
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("python");
    let record = Command::new(python())
        .arg("-B")
        .arg(examples.join("contact.py"))
        .arg(folder.path().join("push.npz"))
        .output()
        .unwrap();
    assert!(record.status.success(), "{}", stderr(&record));
    for data in [&["--data", "push.npz"][..], &[]] {
        let mut command = program(folder.path());
        command.env("PYTHONPATH", &examples);
        command.args(["--no-ui", "gym:contact:PushDisc-v0", "--python"]).arg(python());
        command.args(["--max-updates", "30000", "--eval-tasks", "20"]).args(data);
        let output = command.output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let last = records(&output, "evaluation").pop().unwrap();
        assert!(last["planned"]["success"].as_f64().unwrap() >= 0.8, "{data:?}: {last}");
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn a_goal_radius_that_is_too_large_and_a_goal_that_moves_are_said() {
    let folder = tempfile::tempdir().unwrap();
    for (name, radius, status, said) in [
        ("Point", "20", 2, "256 of 256 goals are reached at the start: the goal radius of 20"),
        ("Point", "7", 0, "goals are reached at the start: the goal radius of 7 is large for it"),
        ("Wanders", "0.5", 0, "its desired goal moves within episodes: agents head for the one"),
        (
            "Moved",
            "0.5",
            0,
            "its walls are left out, as it begins in none of its maze's free cells",
        ),
        ("Extra", "0.5", 0, "its observations are read without time"),
        ("Brief", "0.5", 0, "warning: Brief-v0: every episode ends with its first step"),
        ("Still", "0.5", 0, "warning: Still-v0: nothing has moved in the random steps"),
    ] {
        let args = ["--goal-radius", radius, "--max-updates", "3"];
        let output = train(folder.path(), name, &args).output().unwrap();
        assert_eq!(output.status.code(), Some(status), "{}", stderr(&output));
        assert_says(&stderr(&output), said);
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn data_that_cannot_be_of_the_environment_are_doubted() {
    let folder = tempfile::tempdir().unwrap();
    let script = "
import sys
import gymnasium, numpy
import awkward
env = gymnasium.make('awkward:Point-v0')
rng = numpy.random.default_rng(0)
rows = []
for seed in range(40):
    seen, _ = env.reset(seed=seed)
    for i in range(30):
        action = rng.uniform(-1, 1, 2)
        rows.append((seen['observation'], action, i == 29))
        seen = env.step((0.5 * action).astype('float32'))[0]
states, actions, ends = map(numpy.array, zip(*rows))
for name, data in {
    'right': (states, actions, ends),
    'gusty': (states * [45, 1, 1], actions, ends),
    'scaled': (10 * states, actions, ends),
    'reversed': (states[::-1].copy(), actions[::-1].copy(), numpy.roll(ends[::-1], -1)),
    'shifted': (states, numpy.roll(actions, 1, 0), ends),
    'late': (states, actions, numpy.roll(ends, 1)),
    'early': (states, actions, numpy.roll(ends, -1)),
    'still': (states, 0 * actions, ends),
    'idle': (states, actions * [1, 0], ends),
    'mirrored': (states, actions * [1, -1], ends),
    'negated': (states, actions * numpy.repeat(1 - 2 * (rng.permutation(40) % 3 == 0), 30)[:, None], ends),
    'swapped': (states, numpy.vstack((actions[:720], actions[720:, ::-1])), ends),
    'raw': (states, 0.5 * actions, ends),
}.items():
    numpy.savez(name + '.npz', observations=data[0], actions=data[1], terminals=data[2])
";
    let mut record = Command::new(python());
    record.current_dir(folder.path()).arg("-c").arg(script);
    record.env("PYTHONPATH", Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gym"));
    let recorded = record.output().unwrap();
    assert!(recorded.status.success(), "{}", stderr(&recorded));
    for (name, doubt) in [
        ("right", None),
        ("gusty", None),
        ("scaled", Some("which its space does not contain; component 1 is mostly far")),
        ("reversed", Some("actions do not lead where")),
        ("shifted", Some("rows may be shifted")),
        ("late", Some("ends may be a row off")),
        ("early", Some("ends may be a row off")),
        ("still", Some("component 0 of its actions is always 0")),
        ("idle", Some("component 1 of its actions is always 0")),
        ("mirrored", Some("actions move component 2 the other way than here")),
        ("negated", Some("% of the steps (episodes ")),
        ("swapped", Some("% of the steps (episodes 25 to 4")),
        ("raw", Some("component 0 stays within the environment's bounds, -0.5 to 0.5")),
    ] {
        let data = format!("{name}.npz");
        let args = ["--data", &data, "--max-updates", "3"];
        let output = train(folder.path(), "Point", &args).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let said = stderr(&output);
        assert_eq!(said.contains("warning"), doubt.is_some(), "{name}: {said}");
        assert!(said.contains(doubt.unwrap_or_default()), "{name}: {said}");
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn an_environment_that_does_not_do_what_it_did_or_says_otherwise_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let trained = |name: &str, after: &str| {
        let args = ["--max-updates", "700", "--save", "a.safetensors", "--overwrite"];
        let output =
            train(folder.path(), name, &args).env("AWKWARD_AFTER", after).output().unwrap();
        let warned = records(&output, "warning");
        (warned.iter().map(|warning| warning["text"].to_string()).collect(), stderr(&output))
    };
    let cases = [
        ("Point", AFTER, ""),
        ("Tells", AFTER, "its own success is not what the goal radius says"),
        ("Freezes", "0", "its actions have no effect: others lead to the same observations"),
        ("Freezes", "2000", "Freezes-v0: since step "),
    ];
    for (name, after, said) in cases {
        let (records, errors): (Vec<String>, _) = trained(name, after);
        assert_eq!(records.len(), usize::from(!said.is_empty()), "{records:?}");
        assert!(records.concat().contains(said) && errors.contains(said), "{records:?} {errors}");
    }
    // A run from data, whose agents do not act, with the same files.
    let folder = folder.path();
    let export = program(folder).args(["export-data", "a.safetensors"]).output().unwrap();
    assert!(export.status.success(), "{}", stderr(&export));
    let args = ["--data", "exports/a.npz", "--max-updates", "3", "--save", "b.safetensors"];
    assert!(train(folder, "Point", &args).output().unwrap().status.success());
    for (speed, is_said) in [("1", false), ("0.5", true)] {
        let mut resumed = resume(folder, "b.safetensors", &["--max-updates", "4"]);
        let errors = stderr(&resumed.env("AWKWARD_SPEED", speed).output().unwrap());
        assert_eq!(errors.contains("the same actions lead elsewhere"), is_said, "{errors}");
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn a_maze_has_goals_everywhere_and_its_walls_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let free = [[-4.0, 4.0], [0.0, 2.0], [0.9, 2.9], [4.0, 0.0], [-4.9, -0.9]];
    let walls = [[-4.0, 2.0], [2.0, 0.0], [-1.1, 1.1], [5.1, 4.0], [0.0, -1.1]];
    // Walls are what the environment takes for walls, also as floats or booleans.
    for name in ["FloatMaze", "BoolMaze", "Maze"] {
        let world = open(folder.path(), name);
        let WorldScene::Goals(space) = world.abilities().drawn.unwrap().scene(&Arc::default())
        else {
            panic!("a space of goals")
        };
        assert_eq!([0, 1].map(|i| space.range(i)), [[-5.0, 5.0]; 2]);
        assert_eq!(free.map(|at| space.is_wall(at)), [false; 5], "{name}");
        assert_eq!(walls.map(|at| space.is_wall(at)), [true; 5], "{name}, also outside");
    }
    let world = open(folder.path(), "Maze");
    // Its five tasks would be three goals and one start.
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let (mut goal, mut cells) = ([0.0; 2], BTreeSet::new());
    for _ in 0..3_000 {
        world.sample_goal(0, &mut rng, &mut goal);
        cells.insert(goal.map(|v| (v / 2.0).round() as i32));
    }
    for cell in [[-2, 2], [2, 2], [0, 1], [2, 1], [-2, 0], [-1, 0], [0, 0], [2, 0]] {
        assert!(cells.contains(&cell), "{cell:?} in {cells:?}");
    }
    // An agent passes the environment's own goal, (4, -4) from (-4, -4), as it may have another.
    let mut agents = world.fork(1).unwrap();
    agents.restart(0, &mut rng).unwrap();
    let mut nearest = f32::INFINITY;
    for _ in 0..16 {
        agents.step(&[1.0, 0.0], &mut rng).unwrap();
        nearest = nearest.min((agents.states()[0] - 4.0).hypot(agents.states()[1] + 4.0));
        assert!(!agents.has_ended(0));
    }
    assert!(nearest < 0.5, "{nearest}");
    let output = train(folder.path(), "Maze", &["--max-updates", "20"]).output().unwrap();
    let coverage = records(&output, "evaluation")[0]["explored"].as_f64().unwrap();
    assert!(coverage > 0.0 && coverage <= 1.0, "{coverage}");
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn no_transition_leads_from_where_the_environment_ends_an_episode_to_the_next_start() {
    let folder = tempfile::tempdir().unwrap();
    let world = open(folder.path(), "Pit");
    let mut settings = Preset::Default.settings();
    (settings.learn.hidden, settings.learn.buffer_size) = (16, 20_000);
    (settings.train.agents, settings.train.learning_starts) = (4, 100_000);
    let run = Run { method: "gdg".parse().unwrap(), preset: Preset::Default, seed: 1, settings };
    let mut trainer = Trainer::new(run, &*world, &Registry::builtin(), 1).unwrap();
    for _ in 0..400 {
        trainer.tick().unwrap();
    }
    // If none had ended in the pit, there would be 40, of 40 steps each.
    assert!(trainer.counters().episodes > 45, "{:?}", trainer.counters());
    let mut last: Vec<Option<[f32; 2]>> = vec![None; 4];
    let mut longest: f32 = 0.0;
    trainer.replay().visit_episodes(|agent, state| {
        let at = state.map(|state| [state[1], state[2]]);
        if let (Some(before), Some(at)) = (last[agent], at) {
            longest = longest.max((at[0] - before[0]).hypot(at[1] - before[1]));
        }
        last[agent] = at;
    });
    assert!(longest < 1.0, "a step is at most 0.5 along each axis: {longest}");
}

/// Returns two agents of an environment of `awkward.py`, at the starts of episodes.
fn two_agents(folder: &Path, name: &str) -> Box<dyn Environment> {
    let mut agents = open(folder, name).fork(2).unwrap();
    for i in 0..2 {
        agents.restart(i, &mut ChaCha8Rng::seed_from_u64(i as u64)).unwrap();
    }
    agents
}

/// Walks on; returns all states.
fn walk(agents: &mut dyn Environment, steps: usize) -> Vec<Vec<f32>> {
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let step = |i: usize| {
        let wave = (i as f32).sin();
        agents.step(&[0.7, wave, -0.3, 0.9 * wave], &mut rng).unwrap();
        agents.states().to_vec()
    };
    (0..steps).map(step).collect()
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn what_a_first_look_has_found_of_observations_and_actions_has_to_stay() {
    let folder = tempfile::tempdir().unwrap();
    for (name, said) in [
        (
            "Strengthens",
            "the space of its action had component 1 from -0.5 to 0.5 when it was opened, and has \
             component 1 from -0.5 to 2 now",
        ),
        (
            "Rescales",
            "the space of its observation had component 0 from -5 to 5 when it was opened",
        ),
        (
            "Lengthens",
            "the space of its achieved_goal had shape (2,) when it was opened, and has shape",
        ),
        ("Chooses", "had shape (2,) when it was opened, and has Discrete(3) now"),
        ("Regroups", "its desired goal has shape (3,) of float64, but its spaces say 2 numbers"),
        ("Drifts", ""),
    ] {
        let mut agents = two_agents(folder.path(), name);
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut step = || {
            agents.restart(0, &mut rng)?;
            (0..30).try_for_each(|_| agents.step(&[0.1; 4], &mut rng))
        };
        let ended = (0..4).try_for_each(|_| step());
        let problem = ended.map_or_else(|error| error.to_string(), |()| String::new());
        assert!(
            problem.contains(said) && problem.is_empty() == said.is_empty(),
            "{name}: {problem}"
        );
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn an_episode_is_repeated_exactly_or_begins_anew_which_is_said_once() {
    let folder = tempfile::tempdir().unwrap();
    // The third one keeps what matters in an object, the last one in numbers of all.
    for (name, before) in [("Point", 0), ("Point", 20), ("Hidden", 30), ("Global", 20)] {
        let mut agents = two_agents(folder.path(), name);
        walk(&mut *agents, before);
        // Episodes of several lengths have full states of one.
        agents.restart(1, &mut ChaCha8Rng::seed_from_u64(7)).unwrap();
        walk(&mut *agents, 5);
        let saved = [0, 1].map(|i| agents.full_state(i));
        assert_eq!(saved[0].len(), saved[1].len());
        let next = walk(&mut *agents, 15);
        for (i, state) in saved.iter().enumerate() {
            agents.restart(i, &mut ChaCha8Rng::seed_from_u64(9)).unwrap();
            assert!(agents.set_full_state(i, state).unwrap(), "{name}");
        }
        assert_eq!(walk(&mut *agents, 15), next, "{name} after {before} steps");
        assert!(agents.take_warnings().is_empty());
    }
    for name in ["Counts", "Elsewhere"] {
        let mut agents = two_agents(folder.path(), name);
        walk(&mut *agents, 3);
        for i in 0..2 {
            let state = agents.full_state(i);
            assert!(!agents.set_full_state(i, &state).unwrap(), "{name}");
        }
        let said = agents.take_warnings();
        assert!(said.len() == 1 && said[0].contains("have come out of 3 steps"), "{said:?}");
    }
    // One that raises meanwhile gets another process, in which all begin.
    let mut agents = two_agents(folder.path(), "Once");
    (0..2).for_each(|i| agents.restart(i, &mut ChaCha8Rng::seed_from_u64(7 + i as u64)).unwrap());
    walk(&mut *agents, 32);
    let state = agents.full_state(1);
    assert!(!agents.set_full_state(1, &state).unwrap());
    let said = agents.take_warnings();
    let why = "begin new episodes: while 32 steps were repeated, the environment raised an exception in \
               step: ValueError: not again";
    assert!(said.len() == 1 && said[0].contains(why), "{said:?}");
    (0..2).for_each(|i| agents.restart(i, &mut ChaCha8Rng::seed_from_u64(9)).unwrap());
    walk(&mut *agents, 3);
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn an_episode_ends_where_the_environment_says_so_but_not_at_its_time_limit() {
    let folder = tempfile::tempdir().unwrap();
    let mut cut = two_agents(folder.path(), "Cut");
    walk(&mut *cut, 6);
    assert!(!cut.has_ended(0));
    walk(&mut *cut, 1);
    assert!(cut.has_ended(0) && cut.has_ended(1));
    let mut point = two_agents(folder.path(), "Point");
    walk(&mut *point, 50);
    assert!(!point.has_ended(0), "agents have other goals than the environment");
    let endless = open(folder.path(), "Endless");
    assert_eq!(endless.abilities().episodes.unwrap().episode_steps(), None);
    let warnings = endless.take_warnings();
    assert!(warnings[0].contains("is ignored: episodes have at most 60,000"), "{warnings:?}");
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn an_exported_policy_reaches_goals_in_its_environment() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["--max-updates", "900", "--set", "env_steps_per_update=2", "--set", "hidden=32"];
    let more = ["--set", "graph_every_updates=100", "--save", "run.safetensors"];
    let output = train(folder.path(), "Point", &[&args[..], &more].concat()).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for more in [&["--overwrite"][..], &["--overwrite", "--plans"]] {
        let mut export = program(folder.path());
        let output = export.args(["export-policy", "run.safetensors"]).args(more).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let packages = [root.join("python"), root.join("tests/gym")];
        let output = Command::new(python())
            .current_dir(folder.path())
            .env("PYTHONPATH", std::env::join_paths(packages).unwrap())
            .arg(root.join("examples/policy_in_gymnasium.py"))
            .args(["exports/run.policy.safetensors", "50"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let result: Value = serde_json::from_slice(&output.stdout).unwrap();
        println!("{result}");
        // As many as of the program itself, above.
        assert!(result["reached"].as_u64().unwrap() >= 38, "{more:?}: {result}");
    }
}

/// What goes wrong in the middle of a run, and the messages about it.
const FAULTS: [(&str, &str); 8] = [
    ("Raises", "the environment raised an exception in step: ValueError: the point is ?[31mlost"),
    ("Misnames", "exception in step: ModuleNotFoundError: the third module"),
    ("Shouts", "ValueError: no such file: ?!!!"),
    ("Shrinks", "its achieved goal has shape (1,) of float64, but its spaces say 2 numbers"),
    ("Unknown", "step returned NaN as component 0 of its observation"),
    ("Dies", "its Python process has ended: signal: 11 (SIGSEGV)"),
    ("Exits", "the environment raised an exception in step: SystemExit: that was all"),
    ("Hangs", "took more than 3 seconds to step"),
];

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn whatever_goes_wrong_the_run_is_saved_and_goes_on() {
    for (name, said) in FAULTS {
        let folder = tempfile::tempdir().unwrap();
        let args = ["--max-updates", "300", "--save", "run.safetensors", "--env-timeout", "3"];
        let output =
            train(folder.path(), name, &args).env("AWKWARD_AFTER", AFTER).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{name}: {}", stderr(&output));
        assert_says(&stderr(&output), said);
        assert_says(
            &stderr(&output),
            "the run is saved to run.safetensors: gdg-tui --resume run.safetensors --env-timeout",
        );
        if name == "Raises" {
            assert_says(&stderr(&output), "awkward.py, line");
        }
        let saved = &records(&output, "saved")[0];
        let updates = saved["updates"].as_u64().unwrap();
        assert!(updates > 10, "{name}: {updates}");
        // The agents were in the middle of episodes.
        let resumed =
            resume(folder.path(), "run.safetensors", &["--max-updates", "150"]).output().unwrap();
        assert!(resumed.status.success(), "{name}: {}", stderr(&resumed));
        assert_eq!(records(&resumed, "start")[0]["updates"], updates);
        assert_eq!(records(&resumed, "end")[0]["updates"], 150);
        assert!(stderr(&resumed).contains("the agents begin new episodes"), "{}", stderr(&resumed));
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn an_evaluation_whose_environment_fails_is_tried_once_more_and_then_left_out() {
    // The first process trains, the others evaluate.
    let run = |slow: &str, every: &str| {
        let folder = tempfile::tempdir().unwrap();
        let args = ["--max-updates", "60", "--env-timeout", "4", "--save", "run.safetensors"];
        let args = [&args[..], &["--eval-every-updates", every]].concat();
        let mut command = train(folder.path(), "Dawdles", &args);
        (command.env("AWKWARD_SLOW", slow).output().unwrap(), folder)
    };
    let (undisturbed, _) = run("", "20");
    let whole = records(&undisturbed, "evaluation");
    assert_eq!((whole.len(), undisturbed.status.code()), (3, Some(0)));
    let (once, _) = run("2", "20");
    assert_eq!((records(&once, "evaluation"), once.status.code()), (whole.clone(), Some(0)));
    let (twice, _) = run("2,3", "20");
    assert_eq!(records(&twice, "evaluation"), whole[1..], "the first one is left out");
    assert_eq!(twice.status.code(), Some(0));
    let warning = stderr(&twice);
    assert_says(&warning, "training continues without the evaluation at update 20");
    assert_says(&warning, "took more than 4 seconds to step");
    // The last one is what was asked for.
    let (always, folder) = run("2,3", "60");
    assert_eq!((records(&always, "evaluation").len(), always.status.code()), (0, Some(1)));
    assert_says(
        &stderr(&always),
        "the run is saved to run.safetensors: gdg-tui --resume run.safetensors --env-timeout",
    );
    let resumed =
        resume(folder.path(), "run.safetensors", &["--max-updates", "60"]).output().unwrap();
    assert_eq!(records(&resumed, "evaluation"), whole[2..], "{}", stderr(&resumed));
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn an_environment_whose_file_changes_during_a_run_is_not_evaluated_nor_a_job() {
    let folder = tempfile::tempdir().unwrap();
    let awkward = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gym/awkward.py");
    // Each process edits its own file.
    let edit = "with open(__file__, 'a') as own:\n    own.write('# edited\\n')\n";
    let text = std::fs::read_to_string(awkward).unwrap() + "\n" + edit;
    std::fs::write(folder.path().join("awkward.py"), text).unwrap();
    let args = ["--max-updates", "60", "--eval-every-updates", "20", "--save", "run.safetensors"];
    let mut command = train(folder.path(), "Point", &args);
    let output = command.env("PYTHONPATH", folder.path()).output().unwrap();
    let cause = "awkward.py has changed since the run began";
    assert_says(&stderr(&output), "training continues without the evaluation at update 20");
    assert_says(&stderr(&output), cause);
    assert_eq!((records(&output, "evaluation").len(), output.status.code()), (0, Some(1)));
    let mut suite = program(folder.path());
    suite.env("PYTHONPATH", folder.path()).env("VIRTUAL_ENV", python().ancestors().nth(2).unwrap());
    suite
        .args(["suite", "gym:awkward:Point-v0", "--budget", "20", "--seeds", "1"])
        .args(&words(SMALL)[..8]);
    let output = suite.output().unwrap();
    assert_says(&stderr(&output), "has changed since the experiment began");
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn what_a_checkpoint_knows_is_exported_without_its_environment() {
    let folder = tempfile::tempdir().unwrap();
    let args =
        ["--max-updates", "300", "--set", "graph_every_updates=100", "--save", "run.safetensors"];
    assert!(train(folder.path(), "Point", &args).output().unwrap().status.success());
    let nowhere = |args: &[&str]| {
        let mut command = program(folder.path());
        command.env("PATH", "").args(args).output().unwrap()
    };
    let exported = nowhere(&["export-policy", "run.safetensors", "--plans"]);
    assert!(exported.status.success(), "{}", stderr(&exported));
    let exported = nowhere(&["export-data", "run.safetensors"]);
    assert!(exported.status.success(), "{}", stderr(&exported));
    // To go on, it needs it.
    let args = ["--no-ui", "--resume", "run.safetensors", "--python", "nowhere/python"];
    let resumed = nowhere(&args);
    assert_says(&stderr(&resumed), "there is no Python interpreter");
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn a_run_is_refused_where_its_environment_is_missing_or_another() {
    let folder = tempfile::tempdir().unwrap();
    // It imports a file beside it, and one of a virtual environment there.
    let own = folder.path().join("mazes");
    let installed = own.join("venv/lib/python3.9/site-packages");
    std::fs::create_dir_all(&installed).unwrap();
    let awkward = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gym/awkward.py");
    let text = std::fs::read_to_string(awkward).unwrap()
        + "
import beside, other
";
    std::fs::write(own.join("awkward.py"), text).unwrap();
    std::fs::write(own.join("beside.py"), "").unwrap();
    std::fs::write(installed.join("other.py"), "").unwrap();
    let paths = std::env::join_paths([&own, &installed]).unwrap();
    let mut first =
        train(folder.path(), "Point", &["--max-updates", "30", "--save", "run.safetensors"]);
    first.env("PYTHONPATH", &paths).env("AWKWARD_VERSION", "1.0");
    assert!(first.output().unwrap().status.success());
    let before = std::fs::read(folder.path().join("run.safetensors")).unwrap();
    let resumed = |change: &dyn Fn(&mut Command)| {
        let mut command = resume(folder.path(), "run.safetensors", &["--max-updates", "40"]);
        command.env("PYTHONPATH", &paths).env("AWKWARD_VERSION", "1.0");
        change(&mut command);
        command.output().unwrap()
    };
    let elsewhere = resumed(&|command| {
        command.env_remove("PYTHONPATH");
    });
    let other = resumed(&|command| {
        command.env("AWKWARD_EXTRA", "1");
    });
    let weaker = resumed(&|command| {
        command.env("AWKWARD_BOUND", "0.05");
    });
    for output in [&elsewhere, &other, &weaker] {
        assert_eq!(output.status.code(), Some(2), "{}", stderr(output));
        assert_eq!(before, std::fs::read(folder.path().join("run.safetensors")).unwrap());
    }
    assert_says(&stderr(&elsewhere), "there is no Python module awkward");
    assert!(stderr(&elsewhere).contains("the checkpoint itself is sound"));
    assert_says(&stderr(&other), "components of its observations was 3 and is 4 now: install the");
    assert_says(&stderr(&weaker), "its lowest action[0] was -0.5 and is -0.05 now: install the");
    let shorter = resumed(&|command| {
        command.env("AWKWARD_LIMIT", "7").env("AWKWARD_VERSION", "1.1");
        command.env("AWKWARD_SIDE", "6").env("AWKWARD_RADIUS", "0.4");
    });
    assert!(shorter.status.success());
    for change in ["awkward was 1.0 and is 1.1", "was 40 and is 7", "[0][0] was -5.0 and is -6.0"] {
        assert_says(&stderr(&shorter), &format!("{change} now"));
    }
    assert_says(&stderr(&shorter), "keeps that of its beginning) was 0.5 and is 0.4 now");
    std::fs::write(installed.join("other.py"), "edited = True").unwrap();
    let same = resumed(&|_| {});
    assert!(same.status.success() && !stderr(&same).contains(" now"), "{}", stderr(&same));
    std::fs::write(own.join("beside.py"), "edited = True").unwrap();
    let edited = resumed(&|_| {});
    assert!(edited.status.success(), "{}", stderr(&edited));
    assert_says(&stderr(&edited), "beside.py has changed since the run was saved: it goes on");
    // Beside a package, too.
    let package = own.join("awkward");
    std::fs::create_dir(&package).unwrap();
    std::fs::rename(own.join("awkward.py"), package.join("__init__.py")).unwrap();
    let mut first =
        train(folder.path(), "Point", &["--max-updates", "30", "--save", "run-2.safetensors"]);
    assert!(first.env("PYTHONPATH", &paths).output().unwrap().status.success());
    std::fs::write(own.join("beside.py"), "edited = 2").unwrap();
    let mut again = resume(folder.path(), "run-2.safetensors", &["--max-updates", "40"]);
    let again = again.env("PYTHONPATH", &paths).output().unwrap();
    assert_says(&stderr(&again), "beside.py has changed since the run was saved: it goes on");
    let known = [&same, &edited].map(|run| records(run, "start")[0]["fingerprint"].clone());
    assert_ne!(known[0], known[1]);
    // What was found out belongs to the run.
    let mut again = resume(folder.path(), "run.safetensors", &["--goal-radius", "2"]);
    assert_eq!(again.output().unwrap().status.code(), Some(2));
}

#[cfg(target_os = "linux")]
#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn all_that_environments_start_ends_with_the_program_however_that_ends() {
    for (after, updates, signal, status) in [
        ("1000000000", "20", None, Some(0)),
        (AFTER, "100000", Some("TERM"), Some(143)),
        (AFTER, "100000", Some("KILL"), None),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let started = || {
            let text = std::fs::read_to_string(folder.path().join("started")).unwrap_or_default();
            text.lines().map(str::to_owned).collect::<Vec<_>>()
        };
        let program = train(
            folder.path(),
            "Simulator",
            &["--max-updates", updates, "--save", "run.safetensors"],
        )
        .env("AWKWARD_AFTER", after)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
        if let Some(name) = signal {
            while !started().iter().any(|line| line == "hangs") {
                std::thread::sleep(Duration::from_millis(20));
            }
            kill(program.id(), name);
        }
        let output = program.wait_with_output().unwrap();
        assert_eq!(output.status.code(), status, "{}", stderr(&output));
        assert_eq!(records(&output, "saved").is_empty(), status.is_none());
        let (began, started) = (Instant::now(), started());
        // A process may have ended without anybody having asked how.
        let is_left = |what: &&String| match what.parse::<u32>() {
            Ok(process) => {
                std::fs::read_to_string(format!("/proc/{process}/stat")).is_ok_and(|stat| {
                    stat.rsplit(") ").next().is_some_and(|rest| !rest.starts_with('Z'))
                })
            }
            Err(_) => signal.is_none() && Path::new(what).exists(),
        };
        while let Some(left) = started.iter().find(is_left) {
            assert!(began.elapsed() < Duration::from_secs(10), "{signal:?}: {left} is left");
            std::thread::sleep(Duration::from_millis(20));
        }
        assert!(started.len() >= 8 * 5, "each agent has an environment: {started:?}");
        let closed = started.iter().filter(|line| *line == "closed").count();
        let all = (started.len() - closed) / 5;
        assert_eq!(closed, if signal.is_none() { all } else { 0 }, "of {all}");
    }
}

/// Batch systems signal all processes of a job.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn a_signal_to_all_processes_saves_the_run_in_the_middle_of_episodes() {
    for (name, status) in [("TERM", 143), ("INT", 130), ("USR1", 138)] {
        let folder = tempfile::tempdir().unwrap();
        let args = ["--max-updates", "100000", "--save", "run.safetensors"];
        let mut program = train(folder.path(), "Simulator", &args)
            .env("AWKWARD_AFTER", "1000000000")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut out = BufReader::new(program.stdout.take().unwrap());
        let mut line = String::new();
        while !line.contains("\"event\":\"progress\"") {
            line.clear();
            assert!(out.read_line(&mut line).unwrap() > 0, "nothing is trained");
        }
        let children = format!("/proc/{0}/task/{0}/children", program.id());
        for worker in std::fs::read_to_string(children).unwrap().split_whitespace() {
            kill(worker.parse().unwrap(), name);
        }
        // The program may be told later.
        std::thread::sleep(Duration::from_millis(100));
        kill(program.id(), name);
        std::io::copy(&mut out, &mut std::io::sink()).unwrap();
        let output = program.wait_with_output().unwrap();
        let errors = stderr(&output);
        assert_eq!(output.status.code(), Some(status), "{errors}");
        let is_saved = errors.contains("the run is saved to run.safetensors");
        assert!(is_saved && !errors.contains("has ended"), "{errors}");
        let mut resumed = resume(folder.path(), "run.safetensors", &["--max-updates", "1"]);
        let resumed = resumed.output().unwrap();
        assert!(resumed.status.success(), "{}", stderr(&resumed));
        assert!(!stderr(&resumed).contains("new episodes"), "{}", stderr(&resumed));
    }
}

#[test]
#[ignore = "needs Python with numpy and gymnasium"]
fn files_in_the_present_folder_are_imported_only_as_the_package_that_is_named() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["types", "random", "socket", "numpy", "gymnasium", "gymnasium_robotics"] {
        std::fs::write(folder.path().join(format!("{name}.py")), "raise OSError('no')").unwrap();
    }
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/gym/awkward.py");
    std::fs::copy(own, folder.path().join("my_package.py")).unwrap();
    let open = |world: &str| {
        let mut command = program(folder.path());
        command.env_remove("PYTHONPATH").args(["--no-ui", world, "--python"]).arg(python());
        let args = ["--max-updates", "5", "--eval-tasks", "2", "--save", "run.safetensors"];
        command.args(words(SMALL)).args(args).output().unwrap()
    };
    let output = open("gym:my_package:Point-v0");
    assert!(output.status.success(), "{}", stderr(&output));
    assert_says(&stderr(&open("gym:Absent-v0")), "Environment `Absent` doesn't exist");
    // To print settings, nothing is imported.
    let python = fake_python(folder.path(), "echo no >&2");
    let mut command = program(folder.path());
    command.args(["--print-config", "--resume", "run.safetensors", "--python"]).arg(python);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
}

#[test]
#[ignore = "needs Python with gymnasium-robotics 1.4.2 and mujoco 3.3.7"]
fn the_real_arm_is_learned_and_resumed_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let train = |args: &[&str]| {
        let output = program(folder.path())
            .args(["--no-ui", "gym:FetchReach-v4", "--method", "gdg", "--threads", "2", "--python"])
            .arg(python())
            .args(["--set", "hidden=64"])
            .args(args)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        output
    };
    let whole = train(&["--max-updates", "800"]);
    let found = &records(&whole, "evaluation")[0];
    assert!(found["alone"]["success"].as_f64().unwrap() >= 0.9, "{found}");
    train(&["--max-updates", "333", "--save", "reach.safetensors"]);
    let resumed = program(folder.path())
        .args(words("--no-ui --resume reach.safetensors --threads 2 --max-updates 800"))
        .arg("--python")
        .arg(python())
        .output()
        .unwrap();
    assert_eq!(&records(&resumed, "evaluation")[0], found, "{}", stderr(&resumed));
}
