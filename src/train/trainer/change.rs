//! Changes of a run in progress: another world, other settings, another method.

use serde::Serialize;
use serde_json::{Map, Value};

use super::recovery::LastGood;
use super::{Result, Stream, Trainer, learner_of, replay_of, stream, world_of};
use crate::bridge::Candidates;
use crate::env::Environment;
use crate::store::Store;
use crate::train::config::list_settings;
use crate::train::graphs::Graphs;
use crate::train::rollout::Rollout;
use crate::train::run::Run;
use crate::train::settings::reference::Setting;
use crate::train::settings::{Effect, Settings};

/// What a change of the world brought with it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WorldChange {
    /// The change in a few words.
    #[serde(skip)]
    pub what: String,
    /// What to beware of.
    #[serde(skip)]
    pub warning: Option<String>,
    /// Its numbers, by name.
    #[serde(flatten)]
    pub facts: Map<String, Value>,
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
    /// Goes on with the same networks in `world`, an edited one. Transitions that are no longer possible leave the replay,
    /// bridge candidates and edges are found anew from what remains, agents that stand where nobody can are moved.
    ///
    /// # Errors
    /// A world that cannot take the place of the run's; then nothing has changed.
    pub fn change_world(&mut self, world: &dyn Environment) -> Result<WorldChange> {
        let change = world.change_from(self.world())?;
        self.rollout.enter(world_of(&self.run, world), &mut self.replay);
        let world = self.rollout.env();
        let transitions_removed = self.replay.retain_possible(|s, a, next| world.is_possible(s, a, next));
        self.find_candidates_again();
        if change.may_lengthen {
            self.counters.relearns_until = self.counters.updates + self.run.settings.learn.relearn_updates;
        }
        self.graphs = Graphs::default();
        Ok(WorldChange { what: change.what, warning: change.warning, facts: change.facts, transitions_removed })
    }

    /// Goes on with other settings, method or preset: the replay and all counters are kept, and networks and agents
    /// where they fit.
    ///
    /// # Errors
    /// What the learner reports; then nothing has changed.
    pub fn change_run(&mut self, run: Run) -> Result<Kept> {
        let spec = self.spec();
        let fresh = || learner_of(&run, spec, &self.registry, self.threads);
        let (mut learner, mut networks) = (fresh()?, false);
        if keeps_networks(&self.run.settings, &run.settings) {
            let mut store = Store::default();
            self.learner.save(&mut store)?;
            networks = learner.load(&store).is_ok();
            if !networks {
                // What restoring began is undone.
                learner = fresh()?;
            }
        }
        let last_good = LastGood::of(self.counters.updates, self.counters.losses, &*learner)?;
        let before = std::mem::replace(&mut self.run, run);
        (self.learner, self.last_good) = (learner, last_good);
        self.graphs = Graphs::default();
        self.rollout.drop_plans();
        // Whoever changes a setting may have mended what made it diverge.
        self.counters.recoveries = 0;
        let agents = self.fit_agents(&before);
        Ok(Kept { networks, agents })
    }

    /// Fits world, agents, replay and candidates to the settings, which were those of `before`; whether the agents go on.
    fn fit_agents(&mut self, before: &Run) -> bool {
        let (now, then) = (&self.run.settings, &before.settings);
        let same_agents = now.train.agents == then.train.agents;
        let same_replay = same_agents && now.learn.buffer_size == then.learn.buffer_size;
        let agents = same_replay && now.train.restart == then.train.restart;
        if agents {
            self.rollout.env_mut().configure(&now.train.env());
        } else {
            self.begin_afresh(same_replay);
        }
        if !agents || candidates_of(&self.run.settings) != candidates_of(&before.settings) {
            self.find_candidates_again();
        }
        agents
    }

    /// Other agents begin at starts of the same world; the replay is kept, in another shape if need be.
    fn begin_afresh(&mut self, same_replay: bool) {
        // Ends all episodes.
        let same = self.world().fork(self.world().agents());
        let mut statistics = Store::default();
        self.world().save(&mut statistics);
        self.rollout.enter(same, &mut self.replay);
        if !same_replay {
            let mut replay = replay_of(&self.run, self.spec());
            self.replay.copy_episodes_into(&mut replay);
            self.replay = replay;
        }
        let mut world = world_of(&self.run, self.world());
        // They are this world's own: they fit.
        let _ = world.restore_statistics(&statistics);
        self.rollout = Rollout::new(world, stream(self.run.seed, Stream::Explore));
    }

    /// Finds the bridge candidates, and what was seen between them, from the replay alone.
    fn find_candidates_again(&mut self) {
        let settings = &self.run.settings;
        let fresh = Candidates::new(self.spec(), settings.train.agents, &settings.bridge);
        let Self { candidates, replay, .. } = self;
        candidates.reset_to(fresh);
        replay.visit_episodes(|agent, state| match state {
            Some(state) => candidates.visit(agent, state),
            None => candidates.end_episode(agent),
        });
    }
}

/// Whether networks of one run can go on in another. Numbers of the same count can mean something else: with another
/// scale of D, say.
fn keeps_networks(before: &Settings, now: &Settings) -> bool {
    let mut settings = list_settings(now).into_iter().zip(list_settings(before));
    let of_networks = |name: &str| Setting::named(name).is_some_and(|setting| setting.effect == Effect::NewNetworks);
    settings.all(|(now, before)| !of_networks(&now.0) || now == before)
}

/// What bridge candidates depend on.
fn candidates_of(settings: &Settings) -> (usize, f32, usize) {
    (settings.bridge.candidates, settings.bridge.candidate_spacing, settings.bridge.window_steps())
}
