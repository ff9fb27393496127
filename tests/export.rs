//! Exported actors act the same in numpy, and reach goals in the real FetchReach-v4.
//!
//! What needs Python is ignored otherwise: set `GDG_PYTHON` to an interpreter (default `python3`) that
//! has numpy, gymnasium-robotics 1.4.2 and mujoco 3.3.7, as `.ci/run` does.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;

use gdg::env::{Environment, FetchReach, PointMaze};
use gdg::learn::Scratch;
use gdg::train::{Preset, Registry, Run, SaveTo, Trainer, policy_file, save};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

/// Returns the Python interpreter to test with.
fn python() -> String {
    std::env::var("GDG_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name)
}

fn trained(world: &dyn Environment, updates: u64) -> Trainer {
    let mut settings = Preset::Default.settings();
    settings.train.agents = 8;
    (settings.train.learning_starts, settings.train.env_steps_per_update) = (200, 1);
    let run = Run { method: "gdg".parse().unwrap(), preset: Preset::Default, seed: 1, settings };
    let mut run = Trainer::new(run, world, &Registry::builtin(), 2).unwrap();
    while run.counters().updates < updates {
        run.tick().unwrap();
    }
    run
}

#[test]
#[ignore = "needs Python with numpy"]
fn numpy_computes_the_same_actions() {
    let folder = tempfile::tempdir().unwrap();
    let rooms = gdg::map::builtin("fourrooms").unwrap();
    // The maze's actor reads grids.
    let worlds: [Box<dyn Environment>; 2] =
        [Box::new(FetchReach::new(None, 0)), Box::new(PointMaze::new(Arc::new(rooms), 0))];
    for world in worlds {
        let (run, path) = (trained(&*world, 150), folder.path().join(world.kind()));
        std::fs::write(&path, policy_file(&run).unwrap()).unwrap();
        let spec = world.spec();
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        // Also beyond the usual range.
        let mut near = |i: usize| {
            spec.state_centre[i] + rng.random_range(-1.3..1.3) * spec.state_half_range[i].max(0.1)
        };
        let pairs: Vec<(Vec<f32>, Vec<f32>)> = (0..40)
            .map(|_| {
                (
                    (0..spec.state_dim()).map(&mut near).collect(),
                    spec.achieved.iter().map(|i| near(*i)).collect(),
                )
            })
            .collect();
        let mut child = Command::new(python())
            .arg(script("policy.py"))
            .arg(&path)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines: String = pairs
            .iter()
            .map(|(state, goal)| json!({ "state": state, "goal": goal }).to_string() + "\n")
            .collect();
        child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success());
        let found: Vec<Vec<f32>> = String::from_utf8(output.stdout)
            .unwrap()
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        assert_eq!(found.len(), pairs.len());
        let (policy, mut scratch) = (run.policy().unwrap(), Scratch::default());
        let mut spread = 0.0_f32;
        for ((state, goal), found) in pairs.iter().zip(found) {
            let mut own = vec![0.0; spec.action_dim];
            policy.actions(state, goal, &mut own, &mut scratch);
            let off = own.iter().zip(&found).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-4, "{}: {found:?}, not {own:?}", world.kind());
            spread = spread.max((own[0] - own[1]).abs());
        }
        assert!(spread > 0.1, "the actor has learned something");
    }
}

#[test]
#[ignore = "needs Python with gymnasium-robotics 1.4.2 and mujoco 3.3.7"]
fn an_exported_actor_solves_the_real_fetch_reach() {
    let folder = tempfile::tempdir().unwrap();
    let (checkpoint, policy) = (folder.path().join("run"), folder.path().join("policy"));
    save(&trained(&FetchReach::new(None, 0), 1_000), &SaveTo::CreateNew(checkpoint.clone()))
        .unwrap();
    assert_cmd::Command::cargo_bin("gdg-tui")
        .unwrap()
        .arg("export-policy")
        .args([&checkpoint, Path::new("--out"), &policy])
        .assert()
        .success();
    let output = Command::new(python())
        .arg(script("fetch_reach_v4.py"))
        .arg(&policy)
        .arg("100")
        .output()
        .unwrap();
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
    save(&trained(&FetchReach::new(None, 0), 1), &SaveTo::CreateNew(path.clone())).unwrap();
    let export = |more: &[&str]| {
        assert_cmd::Command::cargo_bin("gdg-tui")
            .unwrap()
            .arg("export-policy")
            .args(more)
            .output()
            .unwrap()
    };
    let own = path.to_str().unwrap();
    assert!(export(&[own]).status.success());
    let policy = folder.path().join("run.policy.safetensors");
    let written = std::fs::read(&policy).unwrap();
    for (args, problem) in [
        (&[own][..], "already exists"),
        (&[policy.to_str().unwrap(), "--out", "x"], "not a checkpoint"),
        (&["no-such-file", "--out", "x"], "cannot be read"),
    ] {
        let output = export(args);
        // The message is wrapped to the width of the terminal.
        let text = String::from_utf8_lossy(&output.stderr).replace(['│', '\n'], "");
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(output.status.code() == Some(2) && text.contains(problem), "{text}");
    }
    assert!(export(&[own, "--overwrite"]).status.success());
    assert_eq!(std::fs::read(&policy).unwrap(), written);
}
