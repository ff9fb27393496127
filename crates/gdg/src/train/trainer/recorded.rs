//! Learning from recorded transitions instead of acting.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::{RandomStream, Result, Trainer, stream};
use crate::files::FileFacts;
use crate::job::Job;
use crate::learn::{Replay, ReplaySizes};
use crate::store::{Store, StoreError};
use crate::train::DataError;
use crate::train::dataset::{DataSource, Dataset};
use crate::train::memory;
use crate::train::rollout::Rollout;

const DATA: &str = "data";
const REPLAY: &str = "replay";

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Data {
    source: DataSource,
    acts: bool,
    /// Room in the replay buffer if a checkpoint contains the buffer, which differs from the file.
    own_replay: Option<usize>,
    /// What the file was like when it was read.
    #[serde(skip)]
    facts: Option<FileFacts>,
    /// Why no file can be read again.
    #[serde(skip)]
    missing: Option<DataError>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeftOut {
    /// Those that are impossible in the world, if it knows that.
    pub impossible: usize,
    /// Steps that lead far, and not always to the same place: chance decides where.
    pub by_chance: usize,
}

impl Trainer {
    /// Learns from `data` instead of acting: its transitions fill the replay buffer, and its states
    /// are goals and bridge candidates. Call it before the first update. Returns how many
    /// transitions are left out, and says how far it is, as one stage of `progress`.
    ///
    /// # Errors
    /// The world cannot be copied, or the learner refuses the scales that the data have.
    pub fn learn_from(&mut self, data: &Dataset, progress: &Job) -> Result<LeftOut> {
        if self.rollout.env.rescale(&data.walks().collect::<Vec<_>>(), false) {
            let (run, job) = (self.run.clone(), self.job.clone());
            *self = Self::new(run, self.world(), &self.registry, self.threads)?;
            self.set_job(job);
        }
        self.replay = self.replay_of(data);
        let editable = self.rollout.env().abilities().editable;
        let (impossible, _) = self.replay.retain_possible(|s, a, next| {
            Some(editable.is_none_or(|editable| editable.is_possible(s, a, next)))
        });
        let by_chance = self.leave_out_leaps();
        let removed = impossible + by_chance;
        let Self { visits, replay, rollout, .. } = self;
        replay.visit_rows(|state, _, _| visits.add(rollout.env(), state));
        self.note_recorded();
        self.rebuild_candidates(progress);
        // Paths from where candidates were found later.
        self.revisit_everything(&Job::default());
        let source = data.source().clone();
        let own_replay = (removed > 0).then(|| self.replay.capacity());
        let facts = data.facts;
        self.data = Some(Data { source, acts: false, own_replay, facts, missing: None });
        Ok(LeftOut { impossible, by_chance })
    }

    /// Finds out what tells places apart from what the replay buffer has seen.
    fn note_recorded(&mut self) {
        let Rollout { env, excursions, .. } = &mut self.rollout;
        let spec = env.spec();
        if spec.state_dim() > spec.goal_dim() {
            self.replay.visit_steps(|from, to| excursions.note_recorded(spec, [from, to]));
        }
        excursions.look(spec);
    }

    /// Leaves out leaps that chance may have decided; returns how many.
    fn leave_out_leaps(&mut self) -> usize {
        let spec = self.rollout.env().spec().clone();
        let leaps = &mut self.rollout.leaps;
        self.replay.visit_steps(|from, to| leaps.note(&spec, from, to));
        if leaps.is_empty() {
            return 0;
        }
        let is_sure = |s: &[f32], next: &[f32]| leaps.is_sure(&spec, s, next);
        self.replay.retain_possible(|s, _, next| (!is_sure(s, next)).then_some(false)).0
    }

    fn replay_of(&self, data: &Dataset) -> Replay {
        let (spec, mut rng) = (self.spec(), stream(self.run.seed, RandomStream::Data));
        let (editable, idle) = (self.world().abilities().editable, vec![0.0; spec.action_dim]);
        let is_place = |state: &[f32]| editable.is_none_or(|e| e.is_possible(state, &idle, state));
        let mut places: Vec<usize> =
            (0..data.rows()).filter(|row| is_place(data.state(*row))).collect();
        if places.is_empty() {
            places.push(0);
        }
        data.replay(self.run.settings.train.agents, || {
            let row = places[rng.random_range(0..places.len())];
            spec.achieved(data.state(row)).collect()
        })
    }

    pub fn data(&self) -> Option<&DataSource> {
        self.data.as_ref().map(|data| &data.source)
    }

    /// Returns whether agents act: without data, or once they do beside it.
    pub fn acts(&self) -> bool {
        self.data.as_ref().is_none_or(|data| data.acts)
    }

    pub fn check_data(&self) -> Result<()> {
        let Some(data) = self.data.as_ref().filter(|data| !data.acts) else { return Ok(()) };
        if let Some(error) = &data.missing {
            return Err(error.clone().into());
        }
        if self.replay.has_transitions() {
            return Ok(());
        }
        let file = data.source.file.to_string_lossy().into_owned();
        let problem = "no transition is left that the world allows".to_owned();
        Err(DataError { file, problem }.into())
    }

    /// Returns whether a checkpoint reads its transitions from the file.
    pub fn reads_data(&self) -> bool {
        self.data.as_ref().is_some_and(|data| data.own_replay.is_none())
    }

    /// Has agents act as well once the run has learned from data alone for as long as it should.
    pub(super) fn begin_to_act(&mut self) {
        let alone = self.run.settings.train.offline_updates;
        if self.acts() || alone == 0 || self.counters.updates < alone {
            return;
        }
        let room = self.replay.capacity() + self.run.settings.learn.buffer_size;
        let mut replay =
            Replay::new(ReplaySizes::of(self.spec()), self.run.settings.train.agents, room);
        self.replay.copy_episodes_into(&mut replay);
        self.replay = replay;
        if let Some(data) = &mut self.data {
            (data.acts, data.own_replay) = (true, Some(room));
        }
    }

    pub(super) fn own_replay(&mut self) {
        if let Some(data) = &mut self.data {
            data.own_replay = Some(self.replay.capacity());
        }
    }

    /// Says that the file which fills the replay buffer is no longer the one that was read.
    fn lost_data(&self) -> Option<String> {
        let Data { source, facts, .. } = self.data.as_ref().filter(|_| self.reads_data())?;
        let is_lost = facts.is_some() && FileFacts::of(&source.file) != *facts;
        let file = source.file.display();
        let said = "has changed or is gone: checkpoints contain the data from now on";
        is_lost.then(|| format!("{file} {said}"))
    }

    /// Looks for what users should be told now; returns whether there is anything.
    pub(in crate::train) fn look_for_warnings(&mut self) -> bool {
        self.warnings.extend(self.world().take_warnings());
        !self.warnings.is_empty()
    }

    /// Returns what to tell the user of, now and when a checkpoint is saved.
    pub fn take_warnings(&mut self) -> Vec<String> {
        self.look_for_warnings();
        if let Some(lost) = self.lost_data() {
            self.own_replay();
            self.warnings.push(lost);
        }
        std::mem::take(&mut self.warnings)
    }

    pub(super) fn save_replay(&self, store: &mut Store) -> Result<()> {
        let has_file = self.reads_data() && self.lost_data().is_none();
        let room = (!has_file).then(|| self.replay.capacity());
        let data = self.data.clone();
        store.put(DATA, &data.map(|data| Data { own_replay: data.own_replay.or(room), ..data }))?;
        if !has_file {
            store.put(REPLAY, &self.replay.stored())?;
        }
        Ok(())
    }

    /// Restores what [`Self::save_replay`] wrote. Without its file, a run can be loaded, but not go
    /// on.
    pub(super) fn load_replay(&mut self, store: &Store, progress: &Job) -> Result<()> {
        let mut data: Option<Data> = store.get(DATA)?;
        match &mut data {
            Some(data @ Data { own_replay: None, .. }) => {
                let (moved, world) = (self.registry.data.as_deref(), self.world());
                match Dataset::reread(&data.source, moved, world, progress) {
                    Ok(read) => {
                        self.replay = self.replay_of(&read);
                        (data.source, data.facts) = (read.source().clone(), read.facts);
                    }
                    Err(error) => data.missing = Some(error),
                }
            }
            other => {
                if let Some(room) = other.as_ref().and_then(|data| data.own_replay) {
                    let sizes = ReplaySizes::of(self.spec());
                    let fits = sizes.bytes(room) <= memory::available_bytes();
                    StoreError::unless(fits, "its replay buffer does not fit into memory")?;
                    self.replay = Replay::new(sizes, self.run.settings.train.agents, room);
                }
                self.replay.restore(store.get(REPLAY)?)?;
            }
        }
        self.data = data;
        Ok(())
    }
}
