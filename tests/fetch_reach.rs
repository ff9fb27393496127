//! The arm against recordings and facts of the reference, FetchReach-v4 of gymnasium-robotics 1.4.2.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

use std::path::Path;

use gdg_tui::env::{Environment, FetchReach};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn rng() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(1)
}

/// An arm at reset.
fn arm() -> Box<dyn Environment> {
    FetchReach::new(None, 0).fork(1)
}

fn grip(world: &dyn Environment) -> [f64; 3] {
    std::array::from_fn(|i| f64::from(world.states()[i]))
}

fn pull(world: &mut dyn Environment, action: [f64; 3]) {
    let [x, y, z] = action.map(|v| v as f32);
    world.step(&[x, y, z, 0.0], &mut rng());
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn a_full_pull_sets_the_grip_in_motion_as_in_the_reference() {
    let mut world = arm();
    let moved: Vec<f64> = (0..4)
        .map(|_| {
            let before = grip(&*world);
            pull(&mut *world, [0.0, 1.0, 0.0]);
            1000.0 * (grip(&*world)[1] - before[1])
        })
        .collect();
    assert!((moved[0] - 30.8).abs() < 0.1 && (moved[1] - 33.4).abs() < 0.1, "{moved:?} mm");
    assert!((moved[3] - 33.0).abs() < 0.5, "{moved:?} mm");
}

#[test]
fn gravity_makes_an_arm_at_rest_sink_by_7_mm_in_an_episode() {
    let mut world = arm();
    let before = grip(&*world);
    (0..50).for_each(|_| pull(&mut *world, [0.0; 3]));
    let sunk = 1000.0 * (before[2] - grip(&*world)[2]);
    assert!((sunk - 7.0).abs() < 1.0, "{sunk} mm");
}

#[test]
fn the_table_stops_the_fingers() {
    let mut world = arm();
    (0..50).for_each(|_| pull(&mut *world, [0.0, 0.0, -1.0]));
    let z = grip(&*world)[2];
    assert!((z - 0.4153).abs() < 5e-4, "stopped at {z} m");
}

#[test]
fn proportional_control_reaches_every_goal() {
    let tasks = arm().tasks(20, &mut rng()).tasks;
    let steps = tasks.iter().map(|task| {
        let mut world = arm();
        let goal = [0, 1, 2].map(|i| f64::from(task.goal[i]));
        (0..50).find(|_| {
            let at = grip(&*world);
            let reached = distance(at, goal) < 0.05;
            pull(&mut *world, [0, 1, 2].map(|i| (15.0 * (goal[i] - at[i])).clamp(-1.0, 1.0)));
            reached
        })
    });
    let steps: Option<Vec<i32>> = steps.collect();
    let steps = steps.expect("every goal is reached within 50 steps");
    let mean = f64::from(steps.iter().sum::<i32>()) / steps.len() as f64;
    assert_eq!(steps.len(), 100);
    // The reference takes 2.65 over its own 100 goals; the mean over 100 goals varies by about 0.15.
    assert!((mean - 2.65).abs() < 0.45, "{mean} steps on average");
}

#[test]
fn positions_stay_close_to_the_recorded_episodes_of_the_reference() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data/fetch-reach/replay.jsonl");
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: there is no {}", path.display());
        return;
    };
    let mut errors = [const { Vec::new() }; 3];
    for line in text.lines() {
        let episode: serde_json::Value = serde_json::from_str(line).unwrap();
        let points = |name: &str| -> Vec<[f64; 3]> { serde_json::from_value(episode[name].clone()).unwrap() };
        let (actions, recorded) = (points("actions"), points("grip"));
        let mut world = arm();
        let of_kind = &mut errors[episode["kind"].as_u64().unwrap() as usize];
        assert!(distance(grip(&*world), recorded[0]) < 1e-6);
        for (action, recorded) in actions.iter().zip(&recorded[1..]) {
            pull(&mut *world, *action);
            of_kind.push(1000.0 * distance(grip(&*world), *recorded));
        }
    }
    // Millimetres: the mean and the largest error that are allowed for uniform random actions, correlated noise that may
    // leave the task's space, and proportional control.
    let bounds = [(1.5, 25.0), (f64::INFINITY, f64::INFINITY), (1.0, 15.0)];
    for (kind, (errors, (mean_bound, largest_bound))) in errors.iter().zip(bounds).enumerate() {
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let largest = errors.iter().copied().fold(0.0, f64::max);
        println!("kind {kind}: mean {mean:.2} mm, largest {largest:.1} mm over {} steps", errors.len());
        assert!(errors.len() >= 50 && mean <= mean_bound && largest <= largest_bound);
    }
}
