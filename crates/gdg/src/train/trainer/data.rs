//! Learning from recorded transitions instead of acting.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::{Result, Stream, Trainer, stream};
use crate::env::Region;
use crate::learn::{Replay, ReplaySizes, ReplayState};
use crate::store::{Store, StoreError};
use crate::train::dataset::{DataError, DataSource, Dataset};
use crate::train::error::TrainError;

/// Name in the store.
const DATA: &str = "data";

/// Largest replay of a run with data that a checkpoint may ask for, in transitions.
const MOST_TRANSITIONS: usize = 1 << 30;

/// The data of a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Data {
    source: DataSource,
    /// Whether agents act as well.
    acts: bool,
    /// Room in the replay buffer if a checkpoint contains it, as it is no longer what the file has.
    own_replay: Option<usize>,
    /// Why the file cannot be read again.
    #[serde(skip)]
    missing: Option<String>,
}

impl Trainer {
    /// Learns from `data` instead of acting: its transitions fill the replay buffer, and its states
    /// are goals and bridge candidates. Call it before the first update.
    pub fn learn_from(&mut self, data: &Dataset) {
        self.replay = self.replay_of(data);
        self.visits.add(self.rollout.env(), data.states());
        self.rebuild_candidates();
        // Paths from where candidates were found later.
        let everything = Region::everything(self.spec().goal_dim());
        let Self { candidates, replay, rollout, .. } = self;
        super::change::revisit(replay, candidates, rollout.env().spec(), &everything);
        let source = data.source().clone();
        self.data = Some(Data { source, acts: false, own_replay: None, missing: None });
    }

    /// Returns the replay buffer that holds `data`; goals are states of it, drawn at random.
    fn replay_of(&self, data: &Dataset) -> Replay {
        let (spec, mut rng) = (self.spec(), stream(self.run.seed, Stream::Data));
        data.replay(self.run.settings.train.agents, || {
            let row = rng.random_range(0..data.rows());
            spec.achieved(data.state(row)).collect()
        })
    }

    /// Returns the data that the run learns from, if it does.
    pub fn data(&self) -> Option<&DataSource> {
        self.data.as_ref().map(|data| &data.source)
    }

    /// Returns whether agents act: without data, or once they do beside it.
    pub fn acts(&self) -> bool {
        self.data.as_ref().is_none_or(|data| data.acts)
    }

    /// Checks that the data of a resumed run are there.
    ///
    /// # Errors
    /// They are not.
    pub fn check_data(&self) -> Result<()> {
        match self.data.as_ref().and_then(|data| Some((data, data.missing.as_ref()?))) {
            None => Ok(()),
            Some((data, problem)) => {
                let file = data.source.file.to_string_lossy().into_owned();
                Err(TrainError::Data(DataError::Unfit { file, problem: problem.clone() }))
            }
        }
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

    /// Takes note that the replay buffer is no longer what the file has.
    pub(super) fn own_replay(&mut self) {
        if let Some(data) = &mut self.data {
            data.own_replay = Some(self.replay.capacity());
        }
    }

    /// Writes the replay buffer, or which file fills it.
    pub(super) fn save_replay(&self, store: &mut Store) -> Result<()> {
        if let Some(data) = &self.data {
            store.put_json(DATA, data)?;
        }
        if self.data.as_ref().is_none_or(|data| data.own_replay.is_some()) {
            self.replay.snapshot().write(store);
        }
        Ok(())
    }

    /// Restores what [`Self::save_replay`] wrote. Without its file, a run can be loaded, but not go
    /// on.
    pub(super) fn load_replay(&mut self, store: &Store) -> Result<()> {
        let mut data: Option<Data> =
            store.texts().contains_key(DATA).then(|| store.json(DATA)).transpose()?;
        match &mut data {
            Some(data @ Data { own_replay: None, .. }) => {
                match Dataset::reread(&data.source, self.registry.data(), self.spec()) {
                    Ok(read) => self.replay = self.replay_of(&read),
                    Err(error) => data.missing = Some(error.problem()),
                }
            }
            other => {
                if let Some(room) = other.as_ref().and_then(|data| data.own_replay) {
                    if room > MOST_TRANSITIONS {
                        let problem = "its replay buffer would have too many transitions";
                        return Err(StoreError::inconsistent(problem).into());
                    }
                    let sizes = ReplaySizes::of(self.spec());
                    self.replay = Replay::new(sizes, self.run.settings.train.agents, room);
                }
                self.replay.restore(&ReplayState::read(store)?)?;
            }
        }
        self.data = data;
        Ok(())
    }
}
