//! When bridge graphs are built and take effect.

use rand_chacha::ChaCha8Rng;

use super::{Result, Stream, Trainer, stream};
use crate::train::graphs::{ACTIVATION_DIVISOR, EDIT_ACTIVATION_DIVISOR, GraphJob, Graphs};
use crate::train::settings::Settings;

impl Trainer {
    /// Whether distances that may have changed are being relearned.
    pub(super) fn relearns(&self) -> bool {
        self.counters.updates <= self.counters.relearns_until
    }

    /// Whether training uses bridge graphs.
    pub(super) fn needs_graph(&self) -> bool {
        let Settings { learn, bridge, .. } = &self.run.settings;
        let wanted = learn.distillation > 0.0 || bridge.planned_episodes > 0.0;
        wanted && self.run.method.bridges()
    }

    /// Returns whether update `now` activates a bridge graph or starts building one.
    pub(super) fn changes_graph_at(&self, now: u64) -> bool {
        let builds = now.is_multiple_of(self.run.settings.bridge.graph_every_updates);
        self.needs_graph() && (builds || self.graphs.is_due(now))
    }

    /// Swaps in the next bridge graph if it is due, and starts another build if that is due.
    pub(super) fn refresh_graph(&mut self) -> Result<()> {
        if !self.needs_graph() {
            return Ok(());
        }
        let now = self.counters.updates;
        if self.graphs.activate_due(now) {
            self.with_step_context(|rollout, context| rollout.replan(context))?;
        }
        if now.is_multiple_of(self.run.settings.bridge.graph_every_updates) {
            self.candidates.adapt_spacing();
            self.start_graph(ACTIVATION_DIVISOR)?;
        }
        Ok(())
    }

    /// Drops the bridge graph, and starts to build another one if needed, which soon takes its
    /// place.
    pub(super) fn replace_graph(&mut self) -> Result<()> {
        self.graphs = Graphs::default();
        if self.needs_graph() {
            self.start_graph(EDIT_ACTIVATION_DIVISOR)?;
        }
        Ok(())
    }

    /// Starts building a bridge graph, which takes effect after the interval between builds divided
    /// by `activation_divisor`.
    fn start_graph(&mut self, activation_divisor: u64) -> Result<()> {
        let now = self.counters.updates;
        let job = GraphJob {
            spec: self.spec().clone(),
            settings: self.run.bridge(),
            policy: self.policy()?,
            candidates: self.candidates.frozen(),
            finds_changed: self.relearns(),
            rng: self.graph_rng(now),
        };
        self.graphs.start_build(
            now,
            self.run.settings.bridge.graph_every_updates / activation_divisor,
            job,
        );
        Ok(())
    }

    /// Returns the RNG for the distilled distances of a graph whose build began at update `at`.
    pub(super) fn graph_rng(&self, at: u64) -> ChaCha8Rng {
        let mut rng = stream(self.run.seed, Stream::Graph);
        rng.set_word_pos(u128::from(at) << 34);
        rng
    }
}
