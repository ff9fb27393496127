//! Changes of a run in progress: another map, other settings, another method.

use std::collections::HashMap;
use std::sync::Arc;

use candle_core::Result;
use serde::Serialize;

use super::recovery::LastGood;
use super::{Trainer, world_on};
use crate::map::Grid;
use crate::train::config::{Effect, effect_of, list_settings};
use crate::train::graphs::Graphs;
use crate::train::run::Run;

/// What a change of the map brought with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct MapChange {
    /// Cells that became wall.
    pub walled: usize,
    /// Cells that became free.
    pub opened: usize,
    /// Transitions that left the replay because they are no longer possible.
    pub transitions_removed: usize,
}

/// What of a run went on when its settings changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kept {
    /// The networks; otherwise they are fresh.
    pub networks: bool,
    /// The agents' states, goals and episodes; otherwise they began anew.
    pub agents: bool,
}

impl Trainer {
    /// Goes on with the same networks on another map of the same size. Transitions that the new walls make impossible
    /// leave the replay, bridge candidates and edges are found anew from what remains, agents in walls are moved.
    ///
    /// # Errors
    /// A map of another size.
    pub fn change_map(&mut self, map: Arc<Grid>) -> std::result::Result<MapChange, String> {
        let size = |map: &Grid| (map.width(), map.height());
        if size(&map) != size(&self.map) {
            let ((w, h), (own_w, own_h)) = (size(&map), size(&self.map));
            return Err(format!("the map is {w} x {h}, the run's {own_w} x {own_h}"));
        }
        let changed =
            |to: bool| map.free().iter().zip(self.map.free()).filter(move |(new, old)| new != old && **new == to);
        let (walled, opened) = (changed(false).count(), changed(true).count());
        let world = world_on(&map, &self.run.settings.train);
        self.rollout.enter(world.clone(), &mut self.replay);
        let transitions_removed = self.replay.keep_possible(|s, a, next| world.possible(s, a, next));
        self.learn_experience_anew();
        if walled > 0 {
            self.counters.relearns_until = self.counters.updates + self.run.settings.learn.relearn_updates;
        }
        self.graphs = Graphs::default();
        self.visited.fill(0);
        self.world = world;
        self.map = map;
        Ok(MapChange { walled, opened, transitions_removed })
    }

    /// Goes on with other settings, method or preset: the replay and all counters are kept, and networks and agents
    /// where they fit.
    ///
    /// # Errors
    /// What candle reports; then nothing has changed.
    pub fn change_run(&mut self, run: Run) -> Result<Kept> {
        let mut new = Self::new(run, self.map.clone(), self.threads)?;
        let networks = new.take_networks(self)?;
        if !networks {
            // Fresh ones: what restoring began is undone.
            new.learner = Self::new(new.run.clone(), self.map.clone(), self.threads)?.learner;
        }
        let agents = new.take_agents(self);
        std::mem::swap(&mut new.visited, &mut self.visited);
        new.counters = self.counters;
        new.seconds = self.seconds;
        new.profile = self.profile;
        new.batch_rng = self.batch_rng.clone();
        std::mem::swap(&mut new.history, &mut self.history);
        new.last_good = LastGood::of(new.counters.updates, new.counters.losses, new.learner.state()?);
        // Whoever changes a setting may have mended what made it diverge.
        new.counters.recoveries = 0;
        *self = new;
        Ok(Kept { networks, agents })
    }

    /// Takes over the networks of `old`; whether they fit.
    fn take_networks(&mut self, old: &Self) -> Result<bool> {
        let state = old.learner.state()?;
        // Numbers of the same count can mean something else: with another scale of D, say.
        let same = list_settings(&self.run.settings)
            .iter()
            .zip(list_settings(&old.run.settings))
            .all(|(now, before)| effect_of(&now.0) != Effect::NewNetworks || *now == before);
        let parts: HashMap<_, _> = state.networks.into_iter().collect();
        let find = |network: &str, part: &str| {
            let parts = parts.get(network)?;
            parts.iter().find(|(name, _)| *name == part).map(|(_, values)| values.clone())
        };
        Ok(same && self.learner.restore(state.updates, find).is_ok())
    }

    /// Takes over replay, bridge candidates and, where there are as many, the agents of `old`; whether there are.
    fn take_agents(&mut self, old: &mut Self) -> bool {
        let (now, before) = (&self.run.settings, &old.run.settings);
        let same_agents = now.train.agents == before.train.agents;
        let same_places = now.train.restart == before.train.restart;
        let same_replay = same_agents && now.learn.replay_capacity == before.learn.replay_capacity;
        if same_replay {
            std::mem::swap(&mut self.replay, &mut old.replay);
        } else {
            // Told again, as far as there is room; the agents go on from new starts.
            old.rollout.enter(old.world.clone(), &mut old.replay);
            old.replay.pour_into(&mut self.replay);
        }
        let agents = same_agents && same_places && same_replay;
        let agents = agents && self.rollout.restore(old.rollout.state_without_plans(), None).is_ok();
        if !agents && same_replay {
            old.rollout.enter(old.world.clone(), &mut self.replay);
        }
        let candidates = |settings: &crate::train::Settings| {
            (settings.bridge.candidates, settings.bridge.candidate_spacing, settings.bridge.window_steps())
        };
        if agents && candidates(now) == candidates(before) {
            std::mem::swap(&mut self.experience, &mut old.experience);
        } else {
            self.learn_experience_anew();
        }
        agents
    }

    /// Finds the bridge candidates, and what was seen between them, from the replay alone.
    fn learn_experience_anew(&mut self) {
        let Self { experience, replay, .. } = self;
        experience.forget(&self.run.settings.bridge);
        replay.retell(|agent, state| match state {
            Some(state) => experience.visit(agent, state),
            None => experience.end_episode(agent),
        });
    }
}
