//! A world of nothing but the seven methods without a default goes through the whole trainer.

use gdg::env::{EnvError, Environment, Spec, WorldKind};
use gdg::job::Job;
use gdg::train::{Preset, Registry, Run, Tick, Trainer};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::support::{evaluated, rng, train_to};

/// Length of the line, in steps.
const LENGTH: f32 = 20.0;

/// Where agents begin.
const START: f32 = 1.0;

const KIND: WorldKind = WorldKind {
    name: "line",
    about: "points on a line",
    create: Some(|| Box::new(Line::new(0))),
    open: None,
    load: |_, _| Ok(Box::new(Line::new(0))),
    defaults: &[],
};

struct Line {
    spec: Spec,
    positions: Vec<f32>,
    /// Whether it computes its steps elsewhere, and the actions of one that has begun.
    is_elsewhere: bool,
    begun: Vec<f32>,
}

impl Line {
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
        Self { spec, positions: vec![0.0; agents], is_elsewhere: false, begun: Vec::new() }
    }
}

impl Environment for Line {
    fn kind(&self) -> &'static str {
        KIND.name
    }

    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn states(&self) -> &[f32] {
        &self.positions
    }

    fn restart(&mut self, agent: usize, _: &mut ChaCha8Rng) -> Result<(), EnvError> {
        self.positions[agent] = START;
        Ok(())
    }

    fn sample_goal(&self, _: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        goal[0] = rng.random_range(0.0..LENGTH);
    }

    fn step(&mut self, actions: &[f32], _: &mut ChaCha8Rng) -> Result<(), EnvError> {
        for (position, action) in self.positions.iter_mut().zip(actions) {
            *position = (*position + action.clamp(-1.0, 1.0)).clamp(0.0, LENGTH);
        }
        Ok(())
    }

    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError> {
        Ok(Box::new(Self { is_elsewhere: self.is_elsewhere, ..Self::new(agents) }))
    }

    fn begin_step(&mut self, actions: &[f32], _: &mut ChaCha8Rng) -> Result<bool, EnvError> {
        if self.is_elsewhere {
            self.begun = actions.to_vec();
        }
        Ok(self.is_elsewhere)
    }

    fn end_step(&mut self) -> Result<(), EnvError> {
        let actions = std::mem::take(&mut self.begun);
        self.step(&actions, &mut rng(0))
    }
}

fn trainer() -> Trainer {
    trainer_in(&Line::new(0))
}

fn trainer_in(line: &Line) -> Trainer {
    let mut settings = Preset::Default.settings();
    settings.learn.buffer_size = 20_000;
    settings.learn.hidden = 16;
    settings.train.learning_starts = 1_000;
    settings.bridge.candidates = 20;
    settings.bridge.graph_every_updates = 100;
    // Near goals need full states, so there are none here.
    settings.train.near_goals = 0.5;
    let run =
        Run { method: "gdg-bridge".parse().unwrap(), preset: Preset::Default, seed: 1, settings };
    Trainer::new(run, line, &Registry::builtin().with_world(KIND), 1).unwrap()
}

#[test]
fn it_is_trained_and_after_a_resume_its_agents_begin_new_episodes() {
    let mut run = trainer();
    train_to(&mut run, 150);
    let found = evaluated(&run, 5);
    assert!(found.alone.success.is_some() && found.planned.is_some());
    assert!(found.explored.is_none() && found.error.is_none() && found.marked.is_none());
    assert!(run.world().states().iter().any(|at| *at != START));
    let mut resumed =
        Trainer::load(run.save().unwrap(), run.registry(), 1, &Job::default()).unwrap();
    assert!(resumed.world().states().iter().all(|at| *at == START));
    assert!(resumed.rollout().agents().iter().all(|agent| agent.steps == 0));
    assert_eq!(resumed.counters().env_steps, run.counters().env_steps);
    train_to(&mut resumed, 200);
    // No stored transition leads from where an agent was to its new start.
    let mut last = vec![None::<f32>; run.world().agents()];
    resumed.replay().visit_episodes(|agent, state| {
        let at = state.map(|state| state[0]);
        let jump = last[agent].zip(at).map_or(0.0, |(before, at)| (at - before).abs());
        assert!(jump <= 1.001, "{jump}");
        last[agent] = at;
    });
    evaluated(&resumed, 2);
}

#[test]
fn updates_do_not_wait_for_a_world_that_computes_elsewhere_and_are_finished_if_training_is_to_stop()
{
    let mut run = trainer_in(&Line { is_elsewhere: true, ..Line::new(0) });
    run.job().cancel();
    let mut meanwhile = 0;
    while run.counters().updates < 30 {
        let steps = run.counters().env_steps;
        let tick = run.tick().unwrap();
        meanwhile += u32::from(tick == Tick::Update && run.counters().env_steps > steps);
    }
    assert!(meanwhile > 10, "{meanwhile}");
}
