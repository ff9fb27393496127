//! When bridge graphs are built and take effect.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::{Result, Stream, Trainer, stream};
use crate::bridge::BridgeGraph;
use crate::env::Region;
use crate::job::Job;
use crate::learn::Scratch;
use crate::train::graphs::{
    ACTIVATION_DIVISOR, EDIT_ACTIVATION_DIVISOR, GraphJob, GraphSource, Graphs,
};
use crate::train::settings::Settings;

impl Trainer {
    pub(super) fn relearns(&self) -> bool {
        self.counters.updates <= self.counters.relearns_until
    }

    pub(super) fn needs_graph(&self) -> bool {
        let Settings { learn, bridge, .. } = &self.run.settings;
        let wanted = learn.distillation > 0.0 || bridge.planned_episodes > 0.0;
        wanted && self.run.method.bridges()
    }

    /// Swaps in the next bridge graph if it is due, and starts another build if that is due.
    pub(super) fn refresh_graph(&mut self) -> Result<()> {
        if !self.needs_graph() {
            return Ok(());
        }
        let now = self.counters.updates;
        let building = self.graphs.building().filter(|_| self.graphs.is_due(now));
        let _waiting = building.map(|job| self.job.add(job.clone()));
        if self.graphs.activate_due(now) {
            self.with_step_context(|rollout, context| rollout.replan(context))?;
        }
        let is_time = now.is_multiple_of(self.run.settings.bridge.graph_every_updates);
        if is_time && !self.graphs.has_next() {
            self.candidates.adapt_spacing();
            let round = now / self.run.settings.bridge.graph_every_updates;
            let before = match self.graphs.current() {
                Some(built) => built.graph.clone(),
                None => self.empty_graph(),
            };
            self.start_graph(ACTIVATION_DIVISOR, GraphSource::Renewed { before, round })?;
        }
        Ok(())
    }

    /// Adapts the bridge graph to an edit of the world in `region`: at once what depends on that
    /// alone, and in the background its distances and those that have changed.
    pub(super) fn edit_graph(&mut self, region: &Region) -> Result<()> {
        let Some(current) = self.graphs.current() else { return self.replace_graph() };
        let (candidates, policy) = (self.candidates.frozen(), self.policy()?);
        let near = candidates.near(region);
        let mut scratch = Scratch::default();
        let never = Job::default();
        let graph = current.graph.renewed(&never, &candidates, |i| near[i], &*policy, &mut scratch);
        let graph = Arc::new(graph.unwrap_or_else(|| unreachable!("nothing cancels it")));
        self.graphs.edit(self.counters.updates, graph.clone());
        self.start_graph(EDIT_ACTIVATION_DIVISOR, GraphSource::Edited(graph))
    }

    /// Drops the bridge graph, and starts to build another one if needed.
    pub(super) fn replace_graph(&mut self) -> Result<()> {
        self.graphs = Graphs::default();
        if self.needs_graph() {
            let before = self.empty_graph();
            self.start_graph(ACTIVATION_DIVISOR, GraphSource::Renewed { before, round: 0 })?;
        }
        Ok(())
    }

    fn empty_graph(&self) -> Arc<BridgeGraph> {
        Arc::new(BridgeGraph::empty(self.spec(), &self.run.bridge()))
    }

    /// Starts building a bridge graph and finding the distances along it, which take effect after
    /// the interval between builds divided by `activation_divisor`.
    fn start_graph(&mut self, activation_divisor: u64, source: GraphSource) -> Result<()> {
        let now = self.counters.updates;
        let job = GraphJob {
            policy: self.policy()?,
            candidates: self.candidates.frozen(),
            source,
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
