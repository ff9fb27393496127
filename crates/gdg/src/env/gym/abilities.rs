//! The abilities of an environment of Gymnasium beyond stepping.

use std::sync::Arc;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Map, Value, json};

use super::{
    Address, EnvDescription, EnvFacts, Gym, NO_TASK, Result, STORED, Stored, TASKS_AT_ONCE,
    UNCHECKED,
};
use crate::env::{
    Drawn, Environment, Episodes, Evaluated, Explored, FirstLook, GoalSpace, Recorded, Spec, Task,
    TaskSet, WorldScene,
};
use crate::store::Store;

impl Recorded for Gym {
    fn title(&self) -> &str {
        &self.pool.address.id
    }

    fn fingerprint(&self) -> Option<String> {
        let about = &self.pool.about;
        let package = self.pool.address.package.as_deref().unwrap_or("gymnasium");
        let own = package.split('.').next().and_then(|name| about.versions.get(name));
        let version = own.map_or(String::new(), |version| format!(" {version}"));
        let limit = about.time_limit.map_or(String::new(), |limit| format!(", {limit} steps"));
        let mut sum = crc32fast::Hasher::new();
        for (name, checksum) in &about.sources {
            sum.update(&[name.as_bytes(), &checksum.to_be_bytes()].concat());
        }
        let is_known = !about.sources.is_empty();
        let source = if is_known { format!(", {:08x}", sum.finalize()) } else { String::new() };
        let Spec { achieved, goal_radius, .. } = self.spec();
        let is_given = about.achieved == 0 && *achieved != about.usual_goal();
        let components = achieved.iter().map(|i| format!(" {i}")).collect::<String>();
        let goal = if is_given { format!(" in components{components}") } else { String::new() };
        Some(format!("{package}{version}, goal radius {goal_radius}{goal}{limit}{source}"))
    }

    fn facts(&self) -> Map<String, Value> {
        let (Address { package, id }, about) = (&self.pool.address, &self.pool.about);
        let spec = self.spec();
        let facts = json!({
            "id": id,
            "package": package,
            "versions": about.versions,
            "state": spec.state_dim(),
            "actions": spec.action_dim,
            "achieved": spec.achieved,
            "goal_radius": spec.goal_radius,
            "episode_steps": about.episode_steps(),
            "tasks": about.tasks,
            "centre": spec.state_centre,
            "half_range": spec.state_half_range,
            "change_per_step": spec.change_scale,
            "position_scale": spec.position_scale,
            "workers": self.pool.options.workers,
        });
        Map::from_iter([("gym".to_owned(), facts)])
    }

    fn interface(&self) -> Option<Value> {
        let (Address { package, id }, about) = (&self.pool.address, &self.pool.about);
        let found = &self.found;
        Some(json!({
            "id": id,
            "package": package,
            "observation": about.observed,
            "achieved_goal": about.achieved,
            "desired_goal": about.goal,
            "state_columns": found.columns,
            "goal_columns": found.goal_columns,
            "low": about.low,
            "high": about.high,
        }))
    }

    fn take_warnings(&self) -> Vec<String> {
        std::mem::take(&mut *self.pool.warnings.lock())
    }

    fn first_look(&self) -> Option<FirstLook<'_>> {
        let (EnvFacts { effects, columns, .. }, about) = (&*self.found, &self.pool.about);
        let EnvDescription { bounds, low, high, .. } = about;
        Some(FirstLook { effects, bounds, columns, low, high })
    }

    fn save(&self, store: &mut Store) {
        let (address, about) = (self.pool.address.clone(), self.pool.about.clone());
        let python = self.pool.options.python.as_ref().and_then(|path| path.to_str());
        let (found, python) = ((*self.found).clone(), python.map(str::to_owned));
        // All its numbers are finite, so this cannot fail.
        let _ = store.put_json(STORED, &Stored { address, found, about, python });
    }
}

impl Episodes for Gym {
    fn episode_steps(&self) -> Option<u32> {
        self.pool.about.episode_steps()
    }
}

impl Explored for Gym {
    fn places(&self) -> usize {
        self.maze().map_or(0, |maze| maze.cells() + 1)
    }

    /// Returns the cell of the maze; the last place is outside.
    fn place(&self, state: &[f32]) -> usize {
        let mut position = self.spec().achieved(state);
        let at = [(); 2].map(|()| position.next().unwrap_or(f32::NAN));
        self.maze().map_or(0, |maze| maze.cell_at(at).unwrap_or(maze.cells()))
    }

    fn coverage(&self, visits: &[u32]) -> f64 {
        let Some(maze) = self.maze() else { return 0.0 };
        let free: Vec<usize> = (0..maze.cells()).filter(|cell| !maze.is_wall(*cell)).collect();
        let visited = free.iter().filter(|cell| visits[**cell] > 0).count();
        visited as f64 / free.len().max(1) as f64
    }
}

impl Drawn for Gym {
    fn scene(&self, _: &Arc<Vec<u32>>) -> WorldScene {
        WorldScene::Goals(Box::new(GoalSpace::of(self, self.maze())))
    }
}

impl Evaluated for Gym {
    /// Takes the starts and goals of the environment's own resets: all in one group, or `per_group`
    /// of each of its tasks.
    fn tasks(&self, per_group: usize, rng: &mut ChaCha8Rng) -> Result<TaskSet> {
        let groups = self.pool.about.tasks.unwrap_or(1);
        // As many environments as its tasks need of each worker later.
        let together = TASKS_AT_ONCE.min(per_group * groups as usize);
        let each = together.div_ceil(self.pool.options.workers.max(1)).max(1);
        let mut world = self.with_agents(vec![(self.pool.take(each)?, 0..1)], 1);
        let mut set = TaskSet { distances: vec![None; groups as usize], ..TaskSet::default() };
        for group in 0..groups {
            let task = self.pool.about.tasks.map(|_| 1 + group);
            for _ in 0..per_group {
                let seed = rng.next_u32();
                let goal = world.begin(0, seed, task)?;
                let mut start = world.state_of(0);
                start.extend([f64::from(seed), task.map_or(NO_TASK, f64::from), UNCHECKED, 0.0]);
                set.tasks.push(Task { start, goal, shortest: None, group: group as usize });
            }
        }
        Ok(set)
    }

    fn tasks_at_once(&self) -> usize {
        TASKS_AT_ONCE
    }
}
