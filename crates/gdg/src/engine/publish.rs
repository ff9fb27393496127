//! Publishing snapshots.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::Worker;
use super::snapshot::{self, FollowedAgent, Networks};
use crate::learn::Policy;
use crate::train::{Counters, Limits, TrainError, Trainer};

const SNAPSHOT_INTERVAL: Duration = Duration::from_millis(66);

/// Minimum interval between copies of networks and candidates for a snapshot. Copying blocks
/// training, so it is limited to one part in [`NETWORKS_PAUSE_FACTOR`] of the time.
const MIN_NETWORKS_INTERVAL: Duration = Duration::from_millis(300);

/// See [`MIN_NETWORKS_INTERVAL`].
const NETWORKS_PAUSE_FACTOR: u32 = 60;

/// Number of recent states per agent in a snapshot.
const TRAIL_STATES: usize = 8;

pub struct PublishTimer {
    published: Instant,
    refresh_networks_at: Instant,
    /// Training time and counters when rates were last computed.
    rates_from: (f64, Counters),
}

impl PublishTimer {
    pub fn new(trainer: &Trainer) -> Self {
        let now = Instant::now();
        let rates_from = (trainer.seconds(), trainer.counters());
        Self { published: now, refresh_networks_at: now, rates_from }
    }

    pub fn is_due(&self) -> bool {
        self.published.elapsed() >= SNAPSHOT_INTERVAL
    }
}

/// Returns the estimated seconds until a limit is reached, with at most so many updates per second.
fn seconds_left(trainer: &Trainer, limits: &Limits, at_most: Option<f64>) -> Option<f64> {
    let pace = trainer.pace();
    // Time spent waiting is none of training.
    let per_second = pace.per_second(|counters| counters.updates);
    let slowed = per_second.zip(at_most).map_or(1.0, |(own, most)| (own / most).max(1.0));
    Some(slowed * pace.seconds_left(limits)?)
}

impl Worker {
    pub(super) fn report_progress(&mut self, timer: &mut PublishTimer) -> Result<(), TrainError> {
        timer.published = Instant::now();
        let networks = timer.published >= timer.refresh_networks_at;
        let (seconds, counters) = (self.trainer.seconds(), self.trainer.counters());
        let (since, before) = timer.rates_from;
        if seconds < since || counters.updates < before.updates {
            timer.rates_from = (seconds, counters);
        } else if seconds - since > 1.0 {
            let per_second = |now: u64, then: u64| (now - then) as f64 / (seconds - since);
            self.current.rates = (
                per_second(counters.updates, before.updates),
                per_second(counters.env_steps, before.env_steps),
            );
            timer.rates_from = (seconds, counters);
        }
        self.refresh_snapshot(networks)?;
        if networks {
            timer.refresh_networks_at = Instant::now()
                + MIN_NETWORKS_INTERVAL.max(NETWORKS_PAUSE_FACTOR * timer.published.elapsed());
        }
        Ok(())
    }

    /// Updates and publishes the snapshot. `networks` says whether to include the networks, which
    /// are slow to copy.
    pub(super) fn refresh_snapshot(&mut self, networks: bool) -> Result<(), TrainError> {
        self.current.next_evaluation = self.next_evaluation();
        let (trainer, pace) = (&self.trainer, self.pace());
        let current = &mut self.current;
        current.counters = trainer.counters();
        current.seconds = trainer.seconds();
        current.seconds_left = seconds_left(trainer, &current.limits, pace);
        current.profile = *trainer.profile();
        current.losses = trainer.losses();
        current.curve = trainer.history().points().clone();
        current.film = trainer.film().frames().clone();
        current.replay.0 = trainer.replay().len();
        if !current.phase.is_training() {
            // Nothing moves.
            current.rates = (0.0, 0.0);
        }
        current.agents = Arc::new(snapshot::agents(trainer));
        current.data = snapshot::data(trainer);
        let trail = |agent| {
            trainer.replay().latest_states(agent, TRAIL_STATES).flatten().copied().collect()
        };
        let acting = if trainer.acts() { trainer.rollout().agents().len() } else { 0 };
        current.trails = Arc::new((0..acting).map(trail).collect());
        current.frontier_goals = snapshot::frontier_goals(trainer.rollout());
        current.search = trainer.last_search().cloned();
        if networks {
            current.networks = Networks::capture(trainer)?;
            current.scene = trainer.scene();
        }
        self.current.followed = self.followed()?.map(Arc::new);
        self.publish();
        Ok(())
    }

    fn followed(&mut self) -> Result<Option<FollowedAgent>, TrainError> {
        let (trainer, scratch) = (&self.trainer, &mut self.scratch);
        let rollout = trainer.rollout();
        let acts = |agent: &usize| *agent < rollout.agents().len() && trainer.acts();
        let Some(agent) = self.follow.filter(acts) else {
            return Ok(None);
        };
        let s = trainer.spec().state_dim();
        let state = rollout.env().states()[agent * s..(agent + 1) * s].to_vec();
        let own = &rollout.agents()[agent];
        let (goal, waypoints) = rollout.goal_and_waypoints(agent);
        let frontier = rollout.excursions().destination(agent);
        let (aim, goal) =
            frontier.as_deref().map_or((&own.goal[..], goal), |frontier| (frontier, frontier));
        let mut distances = (0.0, 0.0);
        let mut measure = |policy: &dyn Policy| {
            distances =
                (policy.distance(&state, aim, scratch), policy.distance(&state, goal, scratch));
        };
        trainer.learner().with_policy(false, &mut measure)?;
        // Before the first step of an episode, the replay buffer holds none of its states.
        let start =
            trainer.replay().latest_states(agent, usize::MAX).next().unwrap_or(&state).to_vec();
        let (aim, goal, planned) = (aim.to_vec(), goal.to_vec(), !waypoints.is_empty());
        let steps = (own.steps, trainer.episode_steps());
        Ok(Some(FollowedAgent { agent, start, state, steps, aim, goal, distances, planned }))
    }
}
