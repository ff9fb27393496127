//! A custom world and learner: a bead on a wire, and a Q-table.
//!
//! Neither is part of the library. The bead has a speed that is hidden from the learner; the table
//! learns D by Q-learning on intervals of the wire. The library `gdg` does everything else:
//! exploration, bridges, evaluation, checkpoints.
//!
//! ```sh
//! cargo run --release --example own_world
//! ```

use std::error::Error;
use std::sync::Arc;

use gdg::env::{EnvError, Environment, Spec, WorldKind};
use gdg::learn::{
    LearnError, Learner, LearnerKind, Losses, Policy, Profile, Scratch, StoredStep, TrainingData,
};
use gdg::store::{Store, StoreError};
use gdg::train::{Overrides, Preset, Registry, Run, Trainer, settings_from};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Length of the wire.
const LENGTH: f32 = 20.0;

/// Returns the built-in worlds and learners plus these two.
pub fn registry() -> Arc<Registry> {
    let bead = WorldKind {
        name: "bead",
        about: "a bead on a wire",
        create: Some(|| Box::new(Bead::new(0))),
        open: None,
        load: |_, _| Ok(Box::new(Bead::new(0))),
        // A short wire needs less than a maze before learning starts.
        defaults: &["learning_starts=1000"],
    };
    let table = LearnerKind {
        name: "table",
        about: "Q-learning on intervals of a wire",
        is_rewarded: false,
        create: |spec, _, _, _| Ok(Box::new(Table::new(spec)?)),
        parameters: |_, _| (BINS * ACTIONS.len() * BINS) as u64,
    };
    Registry::builtin().with_world(bead).with_learner(table)
}

/// Beads pushed along a wire, with some momentum.
///
/// The wire has no start of its own and no noise: both settings of [`Environment::configure`] are
/// ignored.
struct Bead {
    spec: Spec,
    positions: Vec<f32>,
    /// Hidden from the learner.
    speeds: Vec<f32>,
}

impl Bead {
    fn new(agents: usize) -> Self {
        let spec = Spec {
            state_centre: vec![LENGTH / 2.0],
            state_half_range: vec![LENGTH / 2.0],
            change_scale: vec![1.0],
            achieved: vec![0],
            action_dim: 1,
            goal_radius: 0.6,
            position_scale: Some(0.6),
            contacts: Vec::new(),
            time_limit: None,
        };
        Self { spec, positions: vec![0.0; agents], speeds: vec![0.0; agents] }
    }
}

impl Environment for Bead {
    fn kind(&self) -> &'static str {
        "bead"
    }

    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn states(&self) -> &[f32] {
        &self.positions
    }

    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        (self.positions[agent], self.speeds[agent]) = (rng.random_range(0.0..LENGTH), 0.0);
        Ok(())
    }

    fn sample_goal(&self, _: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        goal[0] = rng.random_range(0.0..LENGTH);
    }

    fn step(&mut self, actions: &[f32], _: &mut ChaCha8Rng) -> Result<(), EnvError> {
        for ((position, speed), action) in
            self.positions.iter_mut().zip(&mut self.speeds).zip(actions)
        {
            *speed = 0.5 * (*speed + action.clamp(-1.0, 1.0));
            *position = (*position + *speed).clamp(0.0, LENGTH);
        }
        Ok(())
    }

    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError> {
        Ok(Box::new(Self::new(agents)))
    }

    // Optional: with these two, resumed runs go on exactly where they were, and evaluations begin
    // where their tasks say.

    fn full_state(&self, agent: usize) -> Vec<f64> {
        vec![f64::from(self.positions[agent]), f64::from(self.speeds[agent])]
    }

    fn set_full_state(&mut self, agent: usize, full_state: &[f64]) -> Result<bool, EnvError> {
        // The numbers may come from a file: keep the bead on the wire, and its speed within what
        // actions can reach.
        self.positions[agent] = (full_state[0] as f32).clamp(0.0, LENGTH);
        self.speeds[agent] = (full_state[1] as f32).clamp(-1.0, 1.0);
        Ok(true)
    }
}

/// The table's actions, and its number of intervals of the wire.
const ACTIONS: [f32; 3] = [-1.0, 0.0, 1.0];
const BINS: usize = 40;

/// Learning rate, and transitions per update.
const RATE: f32 = 0.2;
const BATCH: usize = 64;

/// Q(s, a, g): steps from interval s by action a to the middle of interval g.
#[derive(Clone)]
struct Table {
    spec: Spec,
    steps: Vec<f32>,
}

impl Table {
    fn new(spec: &Spec) -> Result<Self, LearnError> {
        let on_wire =
            spec.state_centre == [LENGTH / 2.0] && spec.state_half_range == [LENGTH / 2.0];
        if !on_wire || spec.achieved != [0] || spec.action_dim != 1 {
            let needed = format!("positions from 0 to {LENGTH} and one action");
            return Err(LearnError::Other(format!("the learner table requires {needed}").into()));
        }
        Ok(Self { spec: spec.clone(), steps: vec![0.0; BINS * ACTIONS.len() * BINS] })
    }

    fn bin(position: f32) -> usize {
        ((position / LENGTH * BINS as f32) as usize).min(BINS - 1)
    }

    fn at(position: f32, action: usize, goal: usize) -> usize {
        (Self::bin(position) * ACTIONS.len() + action) * BINS + goal
    }

    /// Returns the best action and D = min Q.
    fn best(&self, position: f32, goal: usize) -> (f32, f32) {
        let all = ACTIONS
            .iter()
            .enumerate()
            .map(|(i, action)| (*action, self.steps[Self::at(position, i, goal)]));
        all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, 0.0))
    }

    fn distance(&self, position: f32, goal: f32) -> f32 {
        let reached = self.spec.reached(&[position], &[goal]);
        if reached { 0.0 } else { self.best(position, Self::bin(goal)).1 }
    }
}

impl Policy for Table {
    fn distances(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
        for ((state, goal), out) in states.iter().zip(goals).zip(out) {
            *out = self.distance(*state, *goal);
        }
    }

    fn actions(&self, states: &[f32], goals: &[f32], out: &mut [f32], _: &mut Scratch) {
        for ((state, goal), out) in states.iter().zip(goals).zip(out) {
            *out = self.best(*state, Self::bin(*goal)).0;
        }
    }
}

impl Learner for Table {
    fn kind(&self) -> &'static str {
        "table"
    }

    fn update(&mut self, data: TrainingData, _: &mut Profile) -> Result<Losses, LearnError> {
        let mut loss = 0.0;
        for _ in 0..BATCH {
            let (now, _) = data.replay.sample(data.rng);
            let next = data.replay.state(StoredStep { slot: now.slot + 1, ..now })[0];
            let action = (data.replay.action(now)[0].round() + 1.0) as usize;
            for goal in 0..BINS {
                let ahead = self.distance(next, (goal as f32 + 0.5) * LENGTH / BINS as f32);
                let steps = &mut self.steps[Self::at(data.replay.state(now)[0], action, goal)];
                let error = 1.0 + ahead - *steps;
                *steps += RATE * error;
                loss += error * error / (BATCH * BINS) as f32;
            }
        }
        Ok(Losses { critic: loss, ..Losses::default() })
    }

    fn policy(&self, _: bool) -> Result<Arc<dyn Policy>, LearnError> {
        Ok(Arc::new(self.clone()))
    }

    fn with_policy(
        &self,
        _: bool,
        use_policy: &mut dyn FnMut(&dyn Policy),
    ) -> Result<(), LearnError> {
        use_policy(self);
        Ok(())
    }

    fn save(&self, store: &mut Store) -> Result<(), LearnError> {
        store.put_numbers("table.steps", self.steps.clone());
        Ok(())
    }

    fn load(&mut self, store: &Store) -> Result<(), LearnError> {
        let steps = store.numbers("table.steps")?;
        if steps.len() != self.steps.len() {
            return Err(StoreError::inconsistent("the stored table has another size").into());
        }
        self.steps.copy_from_slice(steps);
        Ok(())
    }
}

/// Trains for a few thousand updates and prints how many test walks reach their goals on the way.
fn main() -> Result<(), Box<dyn Error>> {
    let registry = registry();
    let kind = registry.world("bead").ok_or("registered above")?;
    let overrides = Overrides { defaults: kind.defaults, ..Overrides::default() };
    let settings = settings_from(Preset::Default, &overrides)?;
    let run = Run { method: "table+bridges".parse()?, preset: Preset::Default, seed: 1, settings };
    let mut trainer = Trainer::new(run, &Bead::new(0), &registry, 1)?;
    for updates in [1_000, 2_000, 3_000, 4_000, 5_000] {
        while trainer.counters().updates < updates {
            trainer.tick()?;
        }
        let found = trainer.evaluation()?.evaluate(20, &gdg::job::Job::default())?;
        let planned = found.planned.and_then(|planned| planned.success).unwrap_or_default();
        println!("{updates} updates: {planned:.2} reach their goals");
    }
    Ok(())
}
