//! Tasks run in lockstep, one agent per task, as many at once as the world allows.

use std::ops::Range;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::bridge::{Guide, Walker};
use crate::env::{EnvError, Environment, Episodes, Evaluated, StraightAction, Task};
use crate::learn::{Acting, Scratch};
use crate::train::settings::RANDOM_HOLD_STEPS;

/// How the evaluated agents act.
#[derive(Clone, Copy)]
pub struct Actor<'a> {
    pub guide: Guide<'a>,
    pub acting: Acting,
    /// What acts instead.
    pub straight: Option<StraightAction>,
    /// Steps within which every goal has to be reached, instead of the task's own budget.
    pub max_steps: Option<u32>,
}

impl Actor<'_> {
    pub fn budget(&self, world: &dyn Environment, task: &Task) -> u32 {
        let own = || world.abilities().episodes.and_then(Episodes::episode_steps);
        self.max_steps.or_else(own).unwrap_or_else(|| task.budget())
    }
}

pub struct TaskRuns {
    /// Steps per task; `None` if the goal was not reached in time.
    pub taken: Vec<Option<u32>>,
    /// The environment with the agents of the tasks that ran last, in their final states.
    pub env: Box<dyn Environment>,
}

struct ActiveAgent<'a> {
    index: usize,
    goal: &'a [f32],
    budget: u32,
    walker: Option<Walker>,
}

impl ActiveAgent<'_> {
    fn row(&self, width: usize) -> Range<usize> {
        width * self.index..width * (self.index + 1)
    }
}

/// Runs all tasks, each until its goal is reached or its steps are used up. Calls `watch` with the
/// states of all agents that walk together and the number of tasks that are over, at the start and
/// after every step, and ends when it returns `false`.
pub fn run_tasks(
    world: &dyn Environment,
    tasks: &[Task],
    actor: &Actor,
    rng: &mut ChaCha8Rng,
    watch: &mut dyn FnMut(&[f32], usize) -> bool,
) -> Result<TaskRuns, EnvError> {
    let at_once = world.abilities().evaluated.map_or(usize::MAX, Evaluated::tasks_at_once).max(1);
    let (tasks, rest) = tasks.split_at(at_once.min(tasks.len()));
    let mut env = world.fork(tasks.len())?;
    let (s, a) = (env.spec().state_dim(), env.spec().action_dim);
    let (mut states, mut aims, mut chosen) = (Vec::new(), Vec::new(), Vec::new());
    let mut scratch = Scratch::default();
    for (i, task) in tasks.iter().enumerate() {
        if !env.set_full_state(i, &task.start)? {
            env.restart(i, rng)?;
        }
    }
    let active = tasks.iter().enumerate().map(|(index, task)| ActiveAgent {
        index,
        goal: &task.goal,
        budget: actor.budget(world, task),
        walker: actor.guide.plan(&task.goal, &mut scratch),
    });
    let mut active: Vec<ActiveAgent> = active.collect();
    let mut taken: Vec<Option<u32>> = vec![None; tasks.len()];
    let mut actions = vec![0.0; a * tasks.len()];
    for clock in 0.. {
        if !watch(env.states(), tasks.len() - active.len()) {
            break;
        }
        active.retain(|agent| {
            if env.spec().reached(&env.states()[agent.row(s)], agent.goal) {
                taken[agent.index] = Some(clock);
            }
            let goes_on =
                taken[agent.index].is_none() && clock < agent.budget && !env.has_ended(agent.index);
            if !goes_on {
                actions[agent.row(a)].fill(0.0);
                env.retire(agent.index);
            }
            goes_on
        });
        if active.is_empty() {
            break;
        }
        match (actor.straight, actor.acting) {
            (None, Acting::Policy) => {
                states.clear();
                aims.clear();
                for agent in &mut active {
                    let state = &env.states()[agent.row(s)];
                    states.extend(state);
                    let walker = agent.walker.as_mut();
                    aims.extend(actor.guide.aim(walker, state, agent.goal, &mut scratch));
                }
                chosen.resize(active.len() * a, 0.0);
                let walkers = active.iter().map(|agent| agent.walker.as_ref());
                actor.guide.act(walkers, &states, &aims, &mut chosen, &mut scratch);
                for (agent, action) in active.iter().zip(chosen.chunks_exact(a)) {
                    actions[agent.row(a)].copy_from_slice(action);
                }
            }
            (Some(action), _) => active.iter().for_each(|agent| {
                action(&env.states()[agent.row(s)], agent.goal, &mut actions[agent.row(a)]);
            }),
            (None, Acting::AtRandom) => {
                for agent in &active {
                    if clock == 0 || rng.random::<f32>() < 1.0 / RANDOM_HOLD_STEPS {
                        actions[agent.row(a)].fill_with(|| rng.random_range(-1.0..=1.0));
                    }
                }
            }
        }
        env.step(&actions, rng)?;
    }
    if rest.is_empty() {
        return Ok(TaskRuns { taken, env });
    }
    // Its agents can be used again.
    drop(env);
    let before = taken.len();
    let mut watch = |states: &[f32], over: usize| watch(states, before + over);
    let later = run_tasks(world, rest, actor, rng, &mut watch)?;
    taken.extend(later.taken);
    Ok(TaskRuns { taken, env: later.env })
}
