//! Aborts a long update when training is to stop and undoes its changes, so that the run continues
//! as if it had not begun.

use std::time::Duration;

use rand_chacha::ChaCha8Rng;

use super::{Result, Trainer};
use crate::store::Store;
use crate::train::run::Counters;

/// An update is long if the latest one took at least this long. Shorter ones are finished: that
/// takes less time than copying the networks before each.
const LONG_UPDATE: Duration = Duration::from_millis(500);

/// What an update changes, as it was before.
pub(super) struct Undo {
    counters: Counters,
    batch_rng: ChaCha8Rng,
    learner: Store,
}

impl Trainer {
    /// Returns whether the next update may be a long one.
    pub(super) fn updates_are_long(&self) -> bool {
        self.update_took.is_none_or(|took| took >= LONG_UPDATE)
    }

    /// Returns what is needed to undo the next update; `None` for the few that change the bridge
    /// graph and the plans, too, and must be finished.
    pub(super) fn undo_for_update(&self) -> Result<Option<Undo>> {
        if self.changes_graph_at(self.counters.updates + 1) || !self.learns() {
            return Ok(None);
        }
        let mut learner = Store::default();
        self.learner.save(&mut learner)?;
        Ok(Some(Undo { counters: self.counters, batch_rng: self.batch_rng.clone(), learner }))
    }

    /// Undoes the update in progress.
    pub(super) fn undo(&mut self, Undo { counters, batch_rng, learner }: Undo) -> Result<()> {
        self.learner.load(&learner)?;
        (self.counters, self.batch_rng, self.in_update) = (counters, batch_rng, false);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Instant;

    use super::*;
    use crate::env::{Abilities, EnvError, Environment, PointMaze, Spec};
    use crate::learn::{LearnError, Learner, Losses, Policy, Profile, TrainingData};
    use crate::train::{Method, Preset, Registry, Run, Settings, Tick};

    /// A world whose steps are computed elsewhere: their outcome shows when they end.
    struct Elsewhere {
        world: Box<dyn Environment>,
        before: Option<Vec<f32>>,
    }

    impl Environment for Elsewhere {
        fn kind(&self) -> &'static str {
            self.world.kind()
        }

        fn spec(&self) -> &Spec {
            self.world.spec()
        }

        fn states(&self) -> &[f32] {
            self.before.as_deref().unwrap_or(self.world.states())
        }

        fn restart(
            &mut self,
            agent: usize,
            rng: &mut ChaCha8Rng,
        ) -> std::result::Result<(), EnvError> {
            assert!(self.before.is_none());
            self.world.restart(agent, rng)
        }

        fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
            self.world.sample_goal(agent, rng, goal);
        }

        fn step(
            &mut self,
            actions: &[f32],
            rng: &mut ChaCha8Rng,
        ) -> std::result::Result<(), EnvError> {
            self.begin_step(actions, rng)?;
            self.end_step()
        }

        fn begin_step(
            &mut self,
            actions: &[f32],
            rng: &mut ChaCha8Rng,
        ) -> std::result::Result<bool, EnvError> {
            self.before = Some(self.world.states().to_vec());
            self.world.step(actions, rng).map(|()| true)
        }

        fn end_step(&mut self) -> std::result::Result<(), EnvError> {
            self.before.take().map(drop).ok_or_else(|| unreachable!("no step has begun"))
        }

        fn fork(&self, agents: usize) -> std::result::Result<Box<dyn Environment>, EnvError> {
            Ok(Box::new(Self { world: self.world.fork(agents)?, before: None }))
        }

        fn full_state(&self, agent: usize) -> Vec<f64> {
            assert!(self.before.is_none());
            self.world.full_state(agent)
        }

        fn set_full_state(
            &mut self,
            agent: usize,
            state: &[f64],
        ) -> std::result::Result<bool, EnvError> {
            self.world.set_full_state(agent, state)
        }

        fn abilities(&self) -> Abilities<'_> {
            self.world.abilities()
        }
    }

    fn trainer(method: &str, threads: usize) -> Trainer {
        trainer_in(method, threads, |world| world)
    }

    /// Returns a trainer in a small maze, as `wrapped` makes it.
    fn trainer_in(
        method: &str,
        threads: usize,
        wrapped: fn(Box<dyn Environment>) -> Box<dyn Environment>,
    ) -> Trainer {
        let mut settings = Settings::default();
        (settings.learn.hidden, settings.learn.batch_size, settings.learn.buffer_size) =
            (16, 64, 2_000);
        (settings.train.learning_starts, settings.bridge.candidates) = (200, 20);
        settings.bridge.graph_every_updates = 8;
        let method: Method = method.parse().expect("a method");
        let run = Run { method, preset: Preset::Default, seed: 1, settings };
        let world =
            PointMaze::new(Arc::new(crate::map::builtin("trap").expect("a built-in map")), 0);
        let world = wrapped(Box::new(world));
        Trainer::new(run, &*world, &Registry::builtin(), threads).expect("a trainer")
    }

    /// Returns everything that the rest of the run depends on.
    fn state(trainer: &mut Trainer) -> Store {
        trainer.seconds = 0.0;
        trainer.save().expect("a state")
    }

    #[test]
    fn an_update_left_unfinished_at_any_part_leaves_no_trace() {
        for (method, threads) in [("gdg-bridge", 1), ("gdg", 2), ("her", 1), ("gdg-distance", 2)] {
            let (mut whole, mut stopped) = (trainer(method, threads), trainer(method, threads));
            let (mut parts, mut undone, mut finished) = (0, 0, 0);
            while whole.counters().updates < 60 {
                let tick = whole.tick().expect("a tick");
                if tick == Tick::Update {
                    let before = state(&mut stopped);
                    // As if the latest update had been a long one.
                    stopped.update_took = None;
                    stopped.pulse.stop_at(stopped.pulse.beats() + 2 + parts % 40);
                    parts += 7;
                    match stopped.tick().expect("a tick") {
                        Tick::Undone => {
                            assert!(
                                state(&mut stopped) == before,
                                "{method}: update {}",
                                whole.counters().updates
                            );
                            undone += 1;
                        }
                        // Almost finished, or a change of the graph.
                        done => {
                            assert_eq!(done, Tick::Update);
                            finished += 1;
                            stopped.pulse.stop_at(u64::MAX);
                            continue;
                        }
                    }
                    stopped.pulse.stop_at(u64::MAX);
                }
                assert_eq!(stopped.tick().expect("a tick"), tick);
            }
            assert!(undone > 10 && finished > 0, "{method}: {undone} undone, {finished} finished");
            assert!(state(&mut whole) == state(&mut stopped), "{method}");
        }
    }

    #[test]
    fn updates_do_not_wait_for_a_world_elsewhere_and_leave_no_trace_if_unfinished() {
        let elsewhere =
            || trainer_in("gdg-bridge", 1, |world| Box::new(Elsewhere { world, before: None }));
        let (mut whole, mut stopped) = (elsewhere(), elsewhere());
        let (mut meanwhile, mut undone) = (0, 0);
        while whole.counters().updates < 60 {
            let before = whole.counters();
            let tick = whole.tick().expect("a tick");
            let took_a_step = whole.counters().env_steps > before.env_steps;
            meanwhile += u32::from(tick == Tick::Update && took_a_step);
            if tick == Tick::Update {
                stopped.update_took = None;
                stopped.pulse.stop_at(stopped.pulse.beats() + 2 + before.updates % 40);
            }
            if stopped.tick().expect("a tick") == Tick::Undone {
                undone += u32::from(stopped.rollout.has_begun());
                // As when it is saved and resumed.
                let saved = serde_json::to_string(&stopped.rollout.state()).expect("JSON");
                let saved = serde_json::from_str(&saved).expect("what has been saved");
                let Trainer { rollout, graphs, replay, candidates, .. } = &mut stopped;
                let graph = graphs.current().map(|built| &*built.graph);
                rollout.restore(saved, graph, replay, candidates).expect("its own state");
                stopped.pulse.stop_at(u64::MAX);
                assert_eq!(stopped.tick().expect("a tick"), Tick::Update);
            }
            stopped.pulse.stop_at(u64::MAX);
        }
        assert!(meanwhile > 20 && undone > 10, "{meanwhile} meanwhile, {undone} undone");
        assert!(state(&mut whole) == state(&mut stopped));
    }

    /// A learner of which a copy takes as long as a long update.
    struct SlowToCopy(Box<dyn Learner>);

    impl Learner for SlowToCopy {
        fn kind(&self) -> &'static str {
            self.0.kind()
        }

        fn update(
            &mut self,
            data: TrainingData,
            profile: &mut Profile,
        ) -> std::result::Result<Losses, LearnError> {
            self.0.update(data, profile)
        }

        fn policy(&self, averaged: bool) -> std::result::Result<Arc<dyn Policy>, LearnError> {
            self.0.policy(averaged)
        }

        fn with_policy(
            &self,
            averaged: bool,
            use_policy: &mut dyn FnMut(&dyn Policy),
        ) -> std::result::Result<(), LearnError> {
            self.0.with_policy(averaged, use_policy)
        }

        fn save(&self, store: &mut Store) -> std::result::Result<(), LearnError> {
            std::thread::sleep(LONG_UPDATE);
            self.0.save(store)
        }

        fn load(&mut self, store: &Store) -> std::result::Result<(), LearnError> {
            self.0.load(store)
        }
    }

    #[test]
    fn a_copy_that_takes_long_does_not_make_updates_long() {
        let Trainer { learner, .. } = trainer("gdg", 1);
        let mut trainer = trainer("gdg", 1);
        trainer.learner = Box::new(SlowToCopy(learner));
        let began = Instant::now();
        while trainer.counters().updates == 0 {
            assert!(trainer.updates_are_long(), "nothing is known of the first one");
            trainer.tick().expect("a tick");
        }
        assert!(began.elapsed() >= LONG_UPDATE, "a copy was made");
        assert!(!trainer.updates_are_long());
    }
}
