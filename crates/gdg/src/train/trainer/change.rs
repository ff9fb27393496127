//! Changes to a run in progress: its world, settings, method or scales.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::persistence::LastGood;
use super::{Result, Trainer, fork_world, new_candidates, new_learner, new_rollout};
use crate::bridge::Candidates;
use crate::env::{Change, EnvError, Environment, Region, Spec};
use crate::job::Job;
use crate::learn::{Axis, Replay, ReplaySizes};
use crate::settings::Effect;
use crate::store::Store;
use crate::train::rollout::Rollout;
use crate::train::run::Run;
use crate::train::settings::{SETTINGS, Settings};
use crate::train::settings_file::list_settings;

/// An edit may affect the steps that begin this near to its region, in steps.
const AFFECTED_STEPS: f32 = 2.0;

/// Parts of an edit: what changes, the world, the transitions, the candidates, the graph.
const EDIT_STAGES: usize = 5;

/// Parts of a change of settings: the learner, the agents with their candidates, the graph.
const CHANGE_STAGES: usize = 3;

const TOLD_EVERY: usize = 1000;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct WorldChange {
    #[serde(skip)]
    pub summary: String,
    #[serde(skip)]
    pub warning: Option<String>,
    #[serde(flatten)]
    pub facts: Map<String, Value>,
    /// Transitions removed from the replay buffer because they are no longer possible.
    pub transitions_removed: usize,
    /// Transitions removed by an earlier change that are possible again.
    pub transitions_restored: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptState {
    /// Whether the networks were kept; otherwise they are fresh.
    pub networks: bool,
    pub agents: bool,
}

impl Trainer {
    /// Makes the first edit that is due, if any; it is still to come where that fails.
    pub fn make_edit(&mut self) -> Result<Option<WorldChange>> {
        let updates = self.counters.updates;
        let due = self.edits.iter().position(|edit| edit.updates <= updates);
        let Some(i) = due else { return Ok(None) };
        let edit = self.edits.remove(i);
        let changed = self.change_world(&*edit.world);
        if changed.is_err() {
            self.edits.insert(i, edit);
        }
        changed.map(Some)
    }

    /// Continues with the same networks in `world`, an edited version. Removes transitions that are
    /// no longer possible from the replay buffer, rebuilds bridge candidates and edges from the
    /// rest, and moves agents out of invalid positions.
    /// Where it fails, nothing has changed.
    pub fn change_world(&mut self, world: &dyn Environment) -> Result<WorldChange> {
        self.check_data()?;
        let progress = self.job.part("applying the edit");
        let is_at = |stage| progress.begin(stage, EDIT_STAGES);
        is_at(0);
        let fixed = || EnvError::Unfit(format!("the world {} cannot be edited", world.kind()));
        let editable = world.abilities().editable.ok_or_else(fixed)?;
        let change = editable.change_from(self.world())?;
        is_at(1);
        self.rollout.enter_environment(fork_world(&self.run, world)?, &mut self.replay)?;
        self.visits.enter(self.rollout.env());
        let edited = self.rollout.env().abilities().editable;
        let (spec, region, leaps) =
            (self.rollout.env().spec(), &change.region, &self.rollout.leaps);
        let possible = |s: &[f32], a: &[f32], next: &[f32]| {
            edited.is_none_or(|e| e.is_possible(s, a, next)) && leaps.is_sure(spec, s, next)
        };
        // A step may end in the region or be stopped by it.
        let step = AFFECTED_STEPS * spec.goal_radius;
        let affected = |s: &[f32]| region.distance(spec.achieved(s)) <= step;
        is_at(2);
        let (transitions_removed, transitions_restored) =
            self.replay.retain_possible(|s, a, next| affected(s).then(|| possible(s, a, next)));
        is_at(3);
        let idle = vec![0.0; spec.action_dim];
        self.candidates.forget(region, change.may_lengthen, |state| possible(state, &idle, state));
        if change.may_lengthen || transitions_restored > 0 {
            revisit(&self.replay, &mut self.candidates, spec, region, &progress);
            self.counters.relearns_until =
                self.counters.updates.saturating_add(self.run.settings.learn.relearn_updates);
        }
        self.counters.changed_at_step = self.counters.env_steps;
        self.history.add_edit(self.counters.updates);
        self.own_replay();
        is_at(4);
        self.edit_graph(&change.region)?;
        let Change { summary, warning, facts, .. } = change;
        Ok(WorldChange { summary, warning, facts, transitions_removed, transitions_restored })
    }

    /// Continues with other settings, method or preset. Keeps the replay buffer and all counters,
    /// and networks, agents and bridge graph where they fit.
    /// Where it fails, nothing has changed.
    pub fn change_run(&mut self, run: Run) -> Result<KeptState> {
        self.check_data()?;
        let progress = self.job.part("changing settings");
        progress.begin(0, CHANGE_STAGES);
        let spec = self.spec();
        let fresh = || new_learner(&run, spec, &self.registry, self.threads);
        let (mut learner, mut networks) = (fresh()?, false);
        if keeps_networks(&self.run.settings, &run.settings) {
            let mut store = Store::default();
            self.learner.save(&mut store)?;
            networks = learner.load(&store).is_ok();
            if !networks {
                // Discards a partially restored learner.
                learner = fresh()?;
            }
        }
        let last_good = LastGood::capture(self.counters.updates, self.counters.losses, &*learner)?;
        let kept = |s: &Settings| (s.train.restart, s.train.goals);
        let agents = keeps_replay(&self.run.settings, &run.settings)
            && kept(&self.run.settings) == kept(&run.settings);
        let fresh_agents = if agents { None } else { Some(new_rollout(&run, self.world())?) };
        let used_before = self.used_method();
        let before = std::mem::replace(&mut self.run, run);
        (self.learner, self.last_good) = (learner, last_good);
        if self.run.method != before.method {
            let now = self.used_method();
            self.history.methods.change(self.counters.updates, used_before, now);
        }
        // The change may have fixed the cause of earlier divergence.
        self.counters.recoveries = 0;
        self.paced_from = None;
        progress.begin(1, CHANGE_STAGES);
        match fresh_agents {
            None => self.rollout.env.configure(&self.run.settings.train.env()),
            Some(rollout) => self.replace_agents(rollout, &before.settings),
        }
        // All that makes candidates.
        let read = |run: &Run| {
            let s = run.bridge();
            (s.candidates, s.candidate_spacing, s.edge_cutoff_steps, s.verify_edges)
        };
        if !agents || read(&self.run) != read(&before) {
            self.rebuild_candidates(&progress);
        } else {
            self.candidates.settings = self.run.bridge();
        }
        progress.begin(2, CHANGE_STAGES);
        let same_graph = self.run.bridge() == before.bridge()
            && self.run.method.planner == before.method.planner;
        if !(networks && agents && same_graph) {
            self.rollout.discard_plans();
            self.replace_graph()?;
        }
        Ok(KeptState { networks, agents })
    }

    /// Fits the scales of state components outside the goal to the agents' steps whenever their number
    /// has doubled: an object that has to be touched first does not move in the first look. Networks
    /// are converted; their outputs stay the same.
    pub(super) fn rescale(&mut self, steps_before: u64) -> Result<()> {
        let first = self.run.settings.train.learning_starts.max(1);
        let doublings = |steps: u64| (steps / first).checked_ilog2();
        let s = self.spec().state_dim();
        if doublings(self.counters.env_steps) == doublings(steps_before)
            || s == self.spec().goal_dim()
        {
            return Ok(());
        }
        let _activity = self.job.part("looking at the scales of states");
        let mut walks = vec![Vec::new()];
        self.replay.visit_rows(|state, _, is_last| {
            if let Some(walk) = walks.last_mut() {
                walk.extend_from_slice(state);
            }
            if is_last {
                walks.push(Vec::new());
            }
        });
        let walks: Vec<&[f32]> = walks.iter().map(Vec::as_slice).collect();
        if !self.rollout.env.rescale(&walks, true) {
            return Ok(());
        }
        let mut learner = new_learner(&self.run, self.spec(), &self.registry, self.threads)?;
        // Networks that know nothing yet begin in the new scales.
        if self.counters.updates > 0 {
            let mut store = Store::default();
            self.learner.save_in_scales_of(self.spec(), &mut store)?;
            learner.load(&store)?;
        }
        self.learner = learner;
        self.last_good = self.networks()?;
        Ok(())
    }

    fn used_method(&self) -> (String, bool) {
        (self.run.method.name(), self.learns())
    }

    fn replace_agents(&mut self, rollout: Rollout, before: &Settings) {
        self.rollout.end_episodes(&mut self.replay);
        if !keeps_replay(before, &self.run.settings) {
            // As the settings have it, with room for all that there is.
            let kept = if self.data.is_some() { self.replay.capacity() } else { 0 };
            let Settings { train, learn, .. } = &self.run.settings;
            let room = learn.buffer_size.max(kept);
            let mut replay = Replay::new(ReplaySizes::of(self.spec()), train.agents, room);
            self.replay.copy_episodes_into(&mut replay);
            self.replay = replay;
            self.own_replay();
        }
        let before = std::mem::replace(&mut self.rollout, rollout);
        self.rollout.excursions.keep_places_of(before.excursions);
    }

    pub(super) fn rebuild_candidates(&mut self, progress: &Job) {
        let mut fresh = new_candidates(&self.run, self.spec());
        fresh.tell_apart_by(self.told_apart_by());
        self.candidates.reset_to(fresh);
        self.revisit_everything(progress);
        // The whole replay shows more paths than were known before.
        self.candidates.adapt_spacing();
    }

    /// Returns what tells candidates apart beside the goal: nothing where plans are those of others.
    pub(super) fn told_apart_by(&self) -> &[Axis] {
        let has_kinds = self.run.method.bridges() && self.candidates.settings.verify_edges;
        if has_kinds { self.rollout.excursions.other_axes(self.spec()) } else { &[] }
    }

    /// Plans anew once more than the goal tells places apart.
    pub(super) fn tell_more_apart(&mut self) -> Result<()> {
        let progress = self.job.part("telling places apart");
        self.rebuild_candidates(&progress);
        self.rollout.discard_plans();
        self.replace_graph()
    }

    pub(super) fn revisit_everything(&mut self, progress: &Job) {
        let everything = Region::everything(self.spec().goal_dim());
        let Self { candidates, replay, rollout, .. } = self;
        revisit(replay, candidates, rollout.env().spec(), &everything, progress);
    }
}

/// Lets the candidates visit again what the replay buffer has seen within their reach of `region`.
/// Ends all episodes, and says how far it is.
fn revisit(replay: &Replay, candidates: &mut Candidates, spec: &Spec, region: &Region, job: &Job) {
    let (mut seen, all) = (0, replay.len());
    let reach = candidates.reach();
    // An episode that begins where the agent's last one ended continues its trajectory.
    let mut ends: Vec<Option<Vec<f32>>> = vec![None; replay.agents()];
    let mut last: Vec<Vec<f32>> = vec![Vec::new(); replay.agents()];
    replay.visit_episodes(|agent, state| {
        let Some(state) = state else {
            ends[agent] = Some(std::mem::take(&mut last[agent]));
            return;
        };
        match ends[agent].take() {
            Some(end) if end == state => {}
            ended => {
                if ended.is_some() {
                    candidates.end_episode(agent);
                }
                if region.distance(spec.achieved(state)) <= reach {
                    let before = &last[agent];
                    candidates.visit(agent, state, if before.is_empty() { state } else { before });
                } else {
                    candidates.pass(agent);
                }
            }
        }
        seen += 1;
        if seen % TOLD_EVERY == 0 {
            job.set(seen, all);
        }
        last[agent].clear();
        last[agent].extend(state);
    });
    (0..replay.agents()).for_each(|agent| candidates.end_episode(agent));
}

fn keeps_replay(before: &Settings, now: &Settings) -> bool {
    now.train.agents == before.train.agents && now.learn.buffer_size == before.learn.buffer_size
}

/// Returns whether a change from one run to another gives up what the networks have learned.
pub fn resets_networks(before: &Run, now: &Run) -> bool {
    before.method.learner != now.method.learner || !keeps_networks(&before.settings, &now.settings)
}

/// Whether the networks can be kept after a change of settings. Matching shapes are not enough:
/// with another scale of D, the same parameters mean something else.
fn keeps_networks(before: &Settings, now: &Settings) -> bool {
    let values = list_settings(now).into_iter().zip(list_settings(before));
    SETTINGS
        .iter()
        .zip(values)
        .all(|(s, (now, before))| s.effect != Effect::NewNetworks || now == before)
}
