//! Exported policies act and plan the same in numpy, and reach goals in the real FetchReach-v4.
//!
//! What needs Python is ignored otherwise: set `GDG_PYTHON` to an interpreter (default `python3`) that
//! has numpy, gymnasium-robotics 1.4.2 and mujoco 3.3.7, as `.ci/run` does.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::Arc;

use gdg::bridge::{Candidates, Guide};
use gdg::env::{Environment, FetchReach, PointMaze};
use gdg::job::Job;
use gdg::learn::Scratch;
use gdg::map::RandomMapKind;
use gdg::train::{Preset, Registry, Run, SaveTo, Saved, Settings, Trainer, policy_file, save};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use crate::ran::one_line;

/// Returns the Python interpreter to test with.
fn python() -> String {
    std::env::var("GDG_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

fn trained(world: &dyn Environment, method: &str, updates: u64) -> Trainer {
    trained_with(world, method, updates, |_| {})
}

/// Trains with other settings.
fn trained_with(
    world: &dyn Environment,
    method: &str,
    updates: u64,
    change: impl Fn(&mut Settings),
) -> Trainer {
    let mut settings = Preset::Default.settings();
    settings.train.agents = 8;
    (settings.train.learning_starts, settings.train.env_steps_per_update) = (200, 1);
    change(&mut settings);
    let run = Run { method: method.parse().unwrap(), preset: Preset::Default, seed: 1, settings };
    let mut run = Trainer::new(run, world, &Registry::builtin(), 2).unwrap();
    while run.counters().updates < updates {
        run.tick().unwrap();
    }
    run
}

/// Returns the interpreter with the module of `python/` and a script.
fn running(script: &str) -> Command {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::new(python());
    command.arg("-B").arg(root.join(script)).env("PYTHONPATH", root.join("python"));
    command
}

/// Has the module follow the lines of a trace with an exported policy, without some of its rules.
fn followed(run: &Trainer, with_plans: bool, trace: &[Value], without: &[&str]) -> Output {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), policy_file(run, with_plans, &Job::default()).unwrap()).unwrap();
    let mut child = running("tests/same_walks.py")
        .arg(file.path())
        .args(without)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let lines: String = trace.iter().map(|line| line.to_string() + "\n").collect();
    // It ends early where something differs.
    let _ = child.stdin.take().unwrap().write_all(lines.as_bytes());
    child.wait_with_output().unwrap()
}

/// Compares the lines of a trace with what the module computes from an exported policy; returns
/// what it has counted.
fn compared(run: &Trainer, with_plans: bool, trace: &[Value]) -> Value {
    let output = followed(run, with_plans, trace, &[]);
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{}: {error}", run.world().kind());
    let counts: Value = serde_json::from_slice(&output.stdout).unwrap();
    println!("{}, {}: {counts}", run.world().kind(), run.run().method);
    assert_eq!(counts["steps"], trace.len());
    counts
}

#[test]
#[ignore = "needs Python with numpy"]
fn numpy_computes_the_same_actions() {
    let rooms = gdg::map::builtin("fourrooms").unwrap();
    // The maze's actor reads grids.
    let worlds: [Box<dyn Environment>; 2] =
        [Box::new(FetchReach::new(0)), Box::new(PointMaze::new(Arc::new(rooms), 0))];
    for world in worlds {
        let (run, spec) = (trained(&*world, "gdg", 150), world.spec());
        let (policy, mut scratch) = (run.policy().unwrap(), Scratch::default());
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        // Also beyond the usual range.
        let mut near = |i: usize| {
            spec.state_centre[i] + rng.random_range(-1.3..1.3) * spec.state_half_range[i].max(0.1)
        };
        let (mut trace, mut spread) = (Vec::new(), 0.0_f32);
        for _ in 0..40 {
            let state: Vec<f32> = (0..spec.state_dim()).map(&mut near).collect();
            let goal: Vec<f32> = spec.achieved.iter().map(|i| near(*i)).collect();
            let mut action = vec![0.0; spec.action_dim];
            policy.actions(&state, &goal, &mut action, &mut scratch);
            spread = spread.max((action[0] - action[1]).abs());
            trace.push(json!({ "state": state, "goal": goal, "action": action }));
        }
        assert!(spread > 0.1, "the actor has learned something");
        compared(&run, false, &trace);
    }
}

#[test]
#[ignore = "needs Python with numpy"]
fn the_python_module_reads_files_and_observations_and_says_what_is_wrong() {
    let output = running("tests/python_module.py").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// Walks tasks as planned evaluations do, `steps` steps each; returns what the walks headed for and
/// did. Agents that do not move stay where they are, whatever they do.
fn walks(run: &Trainer, count: usize, steps: usize, move_on: bool) -> Vec<Value> {
    let (job, mut scratch) = (run.evaluation().unwrap(), Scratch::default());
    let graph = job.graph(&Job::default()).unwrap();
    let guide = Guide { policy: job.policy(), graph: Some(&graph) };
    let (mut world, mut rng) = (run.world().fork(1).unwrap(), ChaCha8Rng::seed_from_u64(4));
    let tasks = job.tasks(count).unwrap().tasks;
    let (mut trace, mut action) = (Vec::new(), vec![0.0; world.spec().action_dim]);
    for task in tasks.iter().step_by(tasks.len() / count) {
        world.set_full_state(0, &task.start).unwrap();
        let mut walker = guide.plan(&task.goal, &mut scratch);
        for step in 0..steps {
            let state = world.states().to_vec();
            let aim = guide.aim(walker.as_mut(), &state, &task.goal, &mut scratch).to_vec();
            let walkers = [walker.as_ref()].into_iter();
            guide.act(walkers, &state, &aim, &mut action, &mut scratch);
            trace.push(json!({
                "begins": step == 0, "state": state, "goal": task.goal, "waypoint": aim,
                "action": action,
            }));
            if move_on {
                world.step(&action, &mut rng).unwrap();
            }
        }
    }
    trace
}

/// Trains a small run that plans.
fn planner(world: &dyn Environment, method: &str, updates: u64) -> Trainer {
    trained_with(world, method, updates, |settings| {
        settings.learn.hidden = 32;
        settings.bridge.graph_every_updates = 200;
    })
}

/// Returns the run with another setting.
fn with_settings(run: &Trainer, change: impl Fn(&mut Settings)) -> Trainer {
    let mut changed = again(run.save().unwrap());
    let mut run = run.run().clone();
    change(&mut run.settings);
    changed.change_run(run).unwrap();
    changed
}

/// Returns the run after hops of three steps and more have failed, so that plans expect delays.
fn with_failed_hops(run: &Trainer) -> Trainer {
    let mut saved = run.save().unwrap();
    let mut candidates: Candidates = saved.state.get("candidates").unwrap();
    for (steps, walk) in (0..32).flat_map(|steps| (0..6).map(move |walk| (steps, walk))) {
        if walk < 2 || steps >= 3 {
            // Between candidates that are not there.
            candidates.record_walk(u32::MAX, u32::MAX, steps as f32, walk < 2);
        }
    }
    saved.state.put("candidates", &candidates).unwrap();
    again(saved)
}

fn again(saved: Saved) -> Trainer {
    Trainer::load(saved, &Registry::builtin(), 2, &Job::default()).unwrap()
}

#[test]
#[ignore = "needs Python with numpy"]
fn each_rule_of_walks_matters_and_is_that_of_the_program() {
    let maze = gdg::map::random(RandomMapKind::Perfect, Some(17), 3);
    let maze = PointMaze::new(Arc::new(maze), 0);
    let late = planner(&maze, "gdg-bridge", 1_200);
    let failing = with_failed_hops(&late);
    let single = with_settings(&late, |settings| settings.bridge.open_loop = true);
    // With so few candidates and short edges there is often no way.
    let few = with_settings(&late, |settings| {
        (settings.bridge.candidates, settings.bridge.candidate_spacing) = (2, 9.0);
        settings.bridge.edge_cutoff_steps = 5.0;
    });
    let traces = [
        (&failing, walks(&failing, 6, 100, true)),
        (&single, walks(&single, 6, 100, true)),
        (&few, walks(&few, 3, 250, false)),
        // Where nothing helps, waypoints are banned for longer and longer.
        (&late, walks(&late, 1, 500, false)),
    ];
    for (run, trace) in &traces {
        compared(run, true, trace);
    }
    let rules = ["delays", "steps walked", "circles", "longer bans", "single plan"];
    let is_free = rules.map(|rule| {
        traces.iter().all(|(run, trace)| {
            let output = followed(run, true, trace, &[rule]);
            !String::from_utf8_lossy(&output.stderr).contains("heads for")
        })
    });
    assert_eq!(is_free, [false; 5], "walks that do not depend on one of {rules:?}");
}

#[test]
#[ignore = "needs Python with numpy"]
fn numpy_follows_bridges_step_by_step_as_the_program_does() {
    let maze = gdg::map::random(RandomMapKind::Perfect, Some(17), 3);
    let maze = PointMaze::new(Arc::new(maze), 0);
    let compare = |world: &dyn Environment, method: &str, updates: u64, count, steps| {
        let run = planner(world, method, updates);
        let counts = compared(&run, true, &walks(&run, count, steps, true));
        let number = |name: &str| counts[name].as_u64().unwrap();
        assert!(number("rounded") * 100 <= number("steps"), "{counts}");
        ["late", "looked_ahead", "waypoints"].map(number)
    };
    // Little trained, so that walks are late and agents get stuck.
    let happens = compare(&maze, "gdg-bridge", 1_200, 4, 200);
    assert!(happens.iter().all(|count| *count >= 10), "what is compared happens: {happens:?}");
    // Early, with few candidates and paths.
    compare(&maze, "gdg-bridge", 60, 10, 20);
    let [_, _, waypoints] = compare(&maze, "sorb", 1_200, 6, 100);
    assert!(waypoints > 6, "{waypoints}");
    let [_, _, waypoints] = compare(&FetchReach::new(0), "gdg-bridge", 600, 6, 50);
    assert!(waypoints > 6, "{waypoints}");
}

#[test]
#[ignore = "needs Python with gymnasium-robotics 1.4.2 and mujoco 3.3.7"]
fn an_exported_actor_solves_the_real_fetch_reach() {
    let folder = tempfile::tempdir().unwrap();
    let (checkpoint, policy) = (folder.path().join("run"), folder.path().join("policy"));
    save(&trained(&FetchReach::new(0), "gdg", 1_000), &SaveTo::CreateNew(checkpoint.clone()))
        .unwrap();
    assert_cmd::Command::cargo_bin("gdg-tui")
        .unwrap()
        .arg("export-policy")
        .args([&checkpoint, Path::new("--out"), &policy])
        .assert()
        .success();
    let output =
        running("examples/policy_in_gymnasium.py").arg(&policy).arg("100").output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    let result: Value = serde_json::from_str(text.lines().last().unwrap_or_default())
        .unwrap_or_else(|e| panic!("{e}: {text}{}", String::from_utf8_lossy(&output.stderr)));
    println!("{result}");
    assert!(result["reached"].as_u64().unwrap() >= 99, "{result}");
}

#[test]
fn export_refuses_what_it_cannot_read_or_must_not_replace() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.safetensors");
    let arm = FetchReach::new(0);
    save(&trained(&arm, "gdg", 1), &SaveTo::CreateNew(path.clone())).unwrap();
    let other = folder.path().join("her.safetensors");
    save(&trained(&arm, "her", 1), &SaveTo::CreateNew(other.clone())).unwrap();
    let export = |more: &[&str]| {
        assert_cmd::Command::cargo_bin("gdg-tui")
            .unwrap()
            .arg("export-policy")
            .current_dir(&folder)
            .args(more)
            .output()
            .unwrap()
    };
    let own = path.to_str().unwrap();
    assert!(export(&[own]).status.success());
    let policy = folder.path().join("exports/run.policy.safetensors");
    let written = std::fs::read(&policy).unwrap();
    for (args, problem) in [
        (&[own][..], "already exists"),
        (&[policy.to_str().unwrap(), "--out", "x"], "not a checkpoint"),
        (&["no-such-file", "--out", "x"], "cannot be read"),
        (&[own, "--plans", "--overwrite"], "the method gdg does not plan"),
        (&[other.to_str().unwrap(), "--plans"], "the actor of the learner her cannot be exported"),
    ] {
        let output = export(args);
        let text = one_line(&String::from_utf8_lossy(&output.stderr));
        assert!(output.status.code() == Some(2) && text.contains(problem), "{text}");
    }
    assert!(export(&[own, "--overwrite"]).status.success());
    assert_eq!(std::fs::read(&policy).unwrap(), written);
}
