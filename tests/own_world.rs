//! A custom world and a custom learner go through the same trainer as the built-in ones.

#[allow(dead_code, reason = "its main function is the example's")]
#[path = "../examples/own_world.rs"]
mod example;
#[path = "../crates/gdg/tests/runs.rs"]
mod runs;

use std::process::{Command, Output};

use clap::Parser;
use gdg::job::Job;
use gdg::train::{self, Preset, Run, SaveTo, Trainer};
use gdg_tui::cli::Cli;
use gdg_tui::commands::prepare::prepare;
use gdg_tui::headless;

use crate::ran::one_line;
use example::registry;
use runs::{state, train_to};

fn trainer(method: &str) -> Trainer {
    let mut settings = Preset::Default.settings();
    settings.learn.buffer_size = 50_000;
    settings.learn.hidden = 16;
    settings.bridge.candidates = 30;
    settings.bridge.graph_every_updates = 200;
    let run = Run { method: method.parse().unwrap(), preset: Preset::Default, seed: 1, settings };
    let registry = registry();
    let world = registry.worlds()[0].create.unwrap()();
    Trainer::new(run, &*world, &registry, 1).unwrap()
}

#[test]
fn a_custom_learner_learns_a_custom_world() {
    let mut run = trainer("table+bridges");
    train_to(&mut run, 3_000);
    let found = run.evaluation().unwrap().evaluate(40, &Job::default()).unwrap();
    let (planned, alone) = (found.planned.unwrap().success.unwrap(), found.alone.success.unwrap());
    assert!(planned >= 0.9 && alone >= 0.9, "planned {planned}, alone {alone}");
    let bridges = found.bridges.unwrap();
    assert!(bridges.candidates > 5 && bridges.edges > bridges.candidates, "{bridges:?}");
    // Metrics that the world does not provide are absent.
    assert!(found.error.is_none() && found.explored.is_none() && found.alone.spl.is_none());
    assert!(
        found
            .alone
            .by_distance
            .iter()
            .all(|group| group.distance_steps.is_none() && group.success.is_some())
    );
}

#[test]
fn random_actions_take_far_longer_ways_in_a_custom_world() {
    // In 500 steps a randomly pushed bead gets everywhere, so compare SPL instead of success. At
    // full speed, the bead moves by one unit a step.
    let spl = |method: &str| {
        let mut run = trainer(method);
        train_to(&mut run, 3_000);
        let evaluation = run.evaluation().unwrap();
        let mut tasks = evaluation.tasks(40).unwrap();
        for task in &mut tasks.tasks {
            task.shortest = Some((task.start[0] as f32 - task.goal[0]).abs().ceil() as u32);
        }
        evaluation.run(&tasks).unwrap().alone.spl.unwrap()
    };
    let (random, learned) = (spl("random"), spl("table+bridges"));
    assert!(random < 0.5 * learned, "{random} at random, {learned} learned");
}

#[test]
fn any_learner_and_planner_combine_and_resume_bitwise() {
    let folder = tempfile::tempdir().unwrap();
    for method in [
        "table+none",
        "table+bridges",
        "table+sorb",
        "gdg",
        "gdg-bridge",
        "gdg-distance+bridges",
        "random",
        "random+bridges",
    ] {
        let path = folder.path().join(method);
        let mut straight = trainer(method);
        train_to(&mut straight, 700);
        let mut first = trainer(method);
        train_to(&mut first, 450);
        train::save(&first, &SaveTo::Replace(path.clone())).unwrap();
        let mut resumed = train::load(&path, &registry(), 1).unwrap();
        assert_eq!(state(&first), state(&resumed), "{method}");
        train_to(&mut resumed, 700);
        assert_eq!(state(&straight), state(&resumed), "{method}");
        let (a, b) = (
            straight.evaluation().unwrap().evaluate(3, &Job::default()),
            resumed.evaluation().unwrap().evaluate(3, &Job::default()),
        );
        assert_eq!(a.unwrap(), b.unwrap(), "{method}");
    }
}

#[test]
fn a_checkpoint_of_an_unknown_world_or_learner_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own");
    train::save(&trainer("table+none"), &SaveTo::Replace(path.clone())).unwrap();
    let error = train::load(&path, &train::Registry::builtin(), 1).err().unwrap().to_string();
    assert!(error.contains("\"bead\""), "{error}");
    let bead = train::Registry::builtin().with_world(registry().worlds()[0]);
    let error = train::load(&path, &bead, 1).err().unwrap().to_string();
    assert!(error.contains("\"table\"") && error.contains("gdg"), "{error}");
}

/// The environment variable with the arguments of a run in a process of its own.
const ARGUMENTS: &str = "OWN_WORLD_ARGUMENTS";

/// Runs this test binary as the program, as records are written to the process's own output.
fn headless_run(arguments: &[&str]) -> Output {
    Command::new(std::env::current_exe().unwrap())
        .args(["own_world::the_program_with_a_custom_world", "--exact", "--ignored", "--nocapture"])
        .env(ARGUMENTS, arguments.join(" "))
        .output()
        .unwrap()
}

#[test]
#[ignore = "a run that another test starts in a process of its own"]
fn the_program_with_a_custom_world() {
    let Ok(arguments) = std::env::var(ARGUMENTS) else { return };
    let common = ["own_world", "--no-ui", "--eval-tasks", "5", "--require-success", "0.8"];
    let args = Cli::try_parse_from(common.into_iter().chain(arguments.split(' '))).unwrap().train;
    let setup = prepare(&args, &registry(), &Job::default()).unwrap();
    let status = headless::run(setup, &args.headless).unwrap();
    std::process::exit(status.into());
}

#[test]
fn a_custom_world_runs_headless_and_resumes_from_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.safetensors");
    let path = path.to_str().unwrap();
    for (more, updates) in [
        (&["bead", "--method", "table+bridges", "--max-updates", "2000", "--save", path][..], 2000),
        (&["--resume", path, "--max-updates", "2500"], 2500),
    ] {
        let output = headless_run(more);
        let records = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let end = records.lines().find(|line| line.contains("\"event\":\"end\"")).unwrap();
        assert!(end.contains(&format!("\"updates\":{updates},")), "{end}");
    }
    for (world, method, expected) in [
        (
            "bead",
            "tabel+none",
            &["\"tabel\"", "table, gdg, gdg-distance, ddpg, her", "LEARNER+PLANNER"][..],
        ),
        ("baed", "gdg", &["did you mean bead", "worlds: bead"]),
        ("trap", "table+none", &["requires positions"]),
    ] {
        let args =
            Cli::try_parse_from(["own_world", world, "--no-ui", "--method", method]).unwrap().train;
        let error = format!("{:?}", prepare(&args, &registry(), &Job::default()).err().unwrap());
        let error = one_line(&error);
        assert!(expected.iter().all(|part| error.contains(part)), "{error}");
    }
}
