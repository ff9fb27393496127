//! A run's definition, progress and limits.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::registry::{Method, Registry};
use super::settings::Settings;
use super::settings_file::{changed_from, list_settings, with_setting};
use crate::bridge::BridgeSettings;
use crate::settings::Preset;
use crate::store::StoreError;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    pub method: Method,
    /// The preset that the settings are based on.
    pub preset: Preset,
    pub seed: u64,
    pub settings: Settings,
}

impl Run {
    /// Changes the method, whose learner is in `registry`. If the run is based on the former
    /// method's preset, it is then based on the new method's; settings that differ from the former
    /// preset are kept.
    pub fn set_method(&mut self, method: Method, registry: &Registry) {
        let (before, now) = (registry.preset_of(&self.method), registry.preset_of(&method));
        self.method = method;
        if self.preset != before || before == now {
            return;
        }
        let of_preset = list_settings(&before.settings());
        let own = list_settings(&self.settings)
            .into_iter()
            .filter(|setting| !of_preset.contains(setting));
        let settings = own.fold(now.settings(), |settings, (name, value)| {
            // A value may be out of range together with the other preset's.
            with_setting(&settings, &name, &value).unwrap_or(settings)
        });
        (self.preset, self.settings) = (now, settings);
    }

    /// Returns the settings that differ from the preset's, by name: the world's defaults and those
    /// given by the user.
    pub fn changed_settings(&self) -> Map<String, Value> {
        changed_from(&self.settings, &self.preset.settings())
    }

    pub fn bridge(&self) -> BridgeSettings {
        self.settings.bridge.for_planner(self.method.planner)
    }
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Network updates. With the learner `random`, which makes none, those that would have been due
    /// (see [`super::Methods`]).
    pub updates: u64,
    /// Environment steps, summed over all agents.
    pub env_steps: u64,
    pub episodes: u64,
    pub goals_reached: u64,
    /// Environment steps whose updates are due but not done.
    pub(super) owed_steps: u64,
    /// Environment steps whose updates become due when an episode ends.
    pub(super) deferred_steps: u64,
    /// The last update at which changed distances are relearned.
    pub(super) relearns_until: u64,
    /// Environment steps at the latest change of the world.
    pub(super) changed_at_step: u64,
    pub(super) losses: [f64; 3],
    /// Number of rollbacks to earlier networks.
    pub recoveries: u32,
}

impl Counters {
    pub fn relearning(&self) -> Option<u64> {
        self.relearns_until.checked_sub(self.updates).filter(|left| *left > 0)
    }

    /// Exclusive upper bound of plausible counts.
    const MAX_COUNT: u64 = 1 << 53;

    pub(super) fn check(&self) -> Result<(), StoreError> {
        let Self { updates, env_steps, episodes, goals_reached, .. } = *self;
        let owed = [self.owed_steps, self.deferred_steps];
        let counts = [updates, env_steps, episodes, goals_reached];
        let sound = counts.iter().chain(&owed).all(|n| *n < Self::MAX_COUNT)
            && self.losses.iter().all(|loss| loss.is_finite());
        StoreError::unless(sound, "the stored counters are out of range")
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tick {
    Update,
    Step,
}

/// Limits of a run, all counted from the start of its training.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Maximum number of updates, done or (learner `random`) only counted.
    pub updates: Option<u64>,
    /// Maximum training time in seconds.
    pub seconds: Option<f64>,
    pub episodes: Option<u64>,
    /// Maximum number of environment steps, summed over all agents; the updates due then are still
    /// done. As all agents step at once, it is exceeded by less than their number.
    pub env_steps: Option<u64>,
}

/// How much longer updates take with a bridge graph: 1.1 (the arm) to 1.8 times (four rooms).
const WITH_GRAPH: f64 = 1.4;

#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Counters and seconds of training at the first update that counts, and now.
    pub(super) from: (Counters, f64),
    pub(super) now: (Counters, f64),
    pub(super) first_graph_at: Option<u64>,
}

impl Pace {
    /// Returns how much of what `count` returns has come per second, if any has.
    pub fn per_second(&self, count: impl Fn(&Counters) -> u64) -> Option<f64> {
        let ((before, from), (after, now)) = (&self.from, &self.now);
        let done = count(after).saturating_sub(count(before)) as f64;
        let seconds = now - from;
        (done > 0.0 && seconds > 0.0).then(|| done / seconds)
    }

    /// Returns the seconds of training until the first of `limits`, if that can be told: of
    /// episodes it cannot, as they become shorter the more is learned.
    pub fn seconds_left(&self, limits: &Limits) -> Option<f64> {
        let (counters, seconds) = &self.now;
        let until = |limit: Option<u64>, count: fn(&Counters) -> u64| {
            let left = limit?.saturating_sub(count(counters)) as f64;
            if left > 0.0 { Some(left / self.per_second(count)?) } else { Some(0.0) }
        };
        let graph = until(self.first_graph_at, |done| done.updates).unwrap_or(f64::INFINITY);
        let slowed = |left: f64| left + (WITH_GRAPH - 1.0) * (left - graph).max(0.0);
        let all = [
            limits.seconds.map(|limit| (limit - seconds).max(0.0)),
            until(limits.updates, |counters| counters.updates).map(slowed),
            until(limits.env_steps, |counters| counters.env_steps).map(slowed),
        ];
        all.into_iter().flatten().min_by(f64::total_cmp)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndReason {
    MaxUpdates,
    MaxSeconds,
    MaxEpisodes,
    MaxSteps,
    /// Training was asked to stop, as by a signal.
    Interrupted,
}

#[cfg(test)]
pub(crate) mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::env::PointMaze;
    use crate::train::Trainer;

    pub fn small_run(method: &str, threads: usize) -> Trainer {
        let mut settings = Settings::default();
        (settings.learn.hidden, settings.learn.batch_size) = (16, 64);
        settings.learn.buffer_size = 2_000;
        settings.train.learning_starts = 200;
        (settings.bridge.candidates, settings.bridge.graph_every_updates) = (20, 8);
        let method = method.parse().expect("a method");
        let run = Run { method, preset: Preset::Default, seed: 1, settings };
        let trap = crate::map::builtin("trap").expect("a built-in map");
        let world = PointMaze::new(Arc::new(trap), 0);
        Trainer::new(run, &world, &Registry::builtin(), threads).expect("a trainer")
    }

    #[test]
    fn another_method_brings_its_preset_and_keeps_what_was_changed() {
        let (preset, registry) = (Preset::Default, Registry::builtin());
        let method = |name: &str| name.parse::<Method>().expect("a method");
        let mut run = Run { method: method("gdg"), preset, seed: 1, settings: preset.settings() };
        run.settings.learn.hidden = 33;
        for (name, preset) in [
            ("random", Preset::Default),
            ("her+sorb", Preset::Tuned),
            ("gdg-bridge", Preset::Default),
        ] {
            run.set_method(method(name), &registry);
            let mut expected = preset.settings();
            expected.learn.hidden = 33;
            let found = (run.method.name(), run.preset, &run.settings);
            assert_eq!(found, (name.to_owned(), preset, &expected));
        }
        // A preset that was chosen stays.
        (run.preset, run.settings) = (Preset::Paper, Preset::Paper.settings());
        run.set_method(method("ddpg"), &registry);
        assert_eq!((run.preset, &run.settings), (Preset::Paper, &Preset::Paper.settings()));
    }

    #[test]
    fn the_time_left_follows_from_the_mean_pace_since_the_first_update() {
        let at = |updates, seconds| (Counters { updates, ..Counters::default() }, seconds);
        // The warm-up took 60 s, and then 999 updates 10 s.
        let pace = Pace { from: at(1, 60.0), now: at(1_000, 70.0), first_graph_at: None };
        let updates = Limits { updates: Some(8_000), ..Limits::default() };
        let episodes = Limits { episodes: Some(80), ..Limits::default() };
        for (limits, left) in [
            (updates, Some(7_000.0 / 99.9)),
            (Limits { seconds: Some(100.0), ..updates }, Some(30.0)),
            (Limits { updates: Some(500), ..updates }, Some(0.0)),
            (episodes, None),
        ] {
            assert_eq!(pace.seconds_left(&limits), left, "{limits:?}");
        }
        let planning = Pace { first_graph_at: Some(1_999), ..pace };
        let left = 10.0 + WITH_GRAPH * 6_001.0 / 99.9;
        assert!((planning.seconds_left(&updates).expect("an estimate") - left).abs() < 1e-9);
        let soon = Limits { updates: Some(1_500), ..updates };
        assert_eq!(planning.seconds_left(&soon), pace.seconds_left(&soon), "no graph before");
        let resumed = Pace { from: pace.now, ..pace };
        assert_eq!(resumed.seconds_left(&updates), None, "nothing is known yet");
    }
}
