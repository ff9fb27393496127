//! How the walking agent of any scene finds its way: the current policy, and a plan through the
//! bridge graph.

use std::sync::Arc;
use std::time::Instant;

use rand_chacha::ChaCha8Rng;

use super::{RefreshTimer, pause_factor};
use crate::bridge::{BridgeGraph, BridgeSettings, EdgeStatus, Guide, Walker};
use crate::engine::{Networks, Snapshot};
use crate::env::{EnvError, Environment, Spec};
use crate::learn::Scratch;
use crate::train::Run;

/// What the walking agent does after arriving.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnArrival {
    /// Starts again.
    #[default]
    Again,
    /// Continues to another goal.
    Visit,
    /// Stays there.
    Stay,
    /// Waits for another start or goal, also where it gives up.
    Wait,
}

impl OnArrival {
    /// Returns the next choice of the user.
    #[must_use]
    pub fn next(self) -> Self {
        match self {
            Self::Again => Self::Visit,
            Self::Visit => Self::Stay,
            Self::Stay => Self::Again,
            Self::Wait => Self::Wait,
        }
    }

    /// Returns its name on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Again => "restart",
            Self::Visit => "visit other goals",
            Self::Stay => "stay",
            Self::Wait => "wait",
        }
    }
}

/// A bridge candidate, at a position of `N` numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate<const N: usize = 2> {
    /// Its position.
    pub at: [f32; N],
    /// Its out-degree, relative to the largest of any candidate.
    pub degree: f32,
}

/// An edge between two positions, and its record in practice.
pub type ShownEdge<const N: usize = 2> = ([[f32; N]; 2], EdgeStatus);

/// An edge between two candidates, by their numbers, and its record in practice.
pub type NumberedEdge = ([usize; 2], EdgeStatus);

/// Policy and plan of the walking agent.
pub(super) struct Pilot {
    run: Arc<Run>,
    bridge: BridgeSettings,
    /// Networks that the graph was built from and the agent uses.
    networks: Arc<Networks>,
    graph: Option<BridgeGraph>,
    walker: Option<Walker>,
    timer: RefreshTimer,
    scratch: Scratch,
}

impl Pilot {
    pub fn new(snapshot: &Snapshot) -> Self {
        Self {
            run: snapshot.run.clone(),
            bridge: snapshot.run.bridge(),
            networks: snapshot.networks.clone(),
            graph: None,
            walker: None,
            timer: RefreshTimer::default(),
            scratch: Scratch::default(),
        }
    }

    /// Changes to the run and the networks of `snapshot` and rebuilds the graph, if that is due;
    /// returns whether it did.
    pub fn refresh(&mut self, snapshot: &Snapshot, spec: &Spec) -> bool {
        if !Arc::ptr_eq(&snapshot.run, &self.run) {
            (self.run, self.bridge) = (snapshot.run.clone(), snapshot.run.bridge());
            self.forget_graph();
        }
        let changed = !Arc::ptr_eq(&snapshot.networks, &self.networks);
        let due = self.timer.is_urgent() || changed && self.timer.is_due(pause_factor(snapshot));
        if due {
            let began = Instant::now();
            self.networks = snapshot.networks.clone();
            let Networks { policy, candidates } = &*self.networks;
            self.graph = self.run.method.plans().then(|| {
                BridgeGraph::build(spec, &self.bridge, candidates, &**policy, &mut self.scratch)
            });
            // Candidates may have moved, so the walk is replanned.
            self.walker = None;
            self.timer.done(began);
        }
        due
    }

    /// Forgets the graph, which the next refresh rebuilds.
    pub fn forget_graph(&mut self) {
        (self.graph, self.walker) = (None, None);
        self.timer.make_due();
    }

    /// Forgets the plan: another walk begins.
    pub fn forget_plan(&mut self) {
        self.walker = None;
    }

    /// Returns the bridge graph, if the method plans.
    pub fn graph(&self) -> Option<&BridgeGraph> {
        self.graph.as_ref()
    }

    /// Returns the candidates and edges of the graph, whose goals have `N` numbers.
    pub fn shown_graph<const N: usize>(&self) -> (Vec<Candidate<N>>, Vec<ShownEdge<N>>) {
        let Some(graph) = &self.graph else { return (Vec::new(), Vec::new()) };
        let at = |i: usize| position(graph.point(i));
        let edges =
            graph.edges().iter().map(|edge| ([at(edge.from), at(edge.to)], edge.status)).collect();
        let mut degrees = vec![0u32; self.networks.candidates.len()];
        graph.edges().iter().for_each(|edge| degrees[edge.from] += 1);
        let most = degrees.iter().copied().max().unwrap_or(0).max(1) as f32;
        let candidate =
            |(i, degree): (usize, &u32)| Candidate { at: at(i), degree: *degree as f32 / most };
        (degrees.iter().enumerate().map(candidate).collect(), edges)
    }

    /// Returns the candidates of the graph, `(goal_dim)` each, and the edges between them.
    pub fn candidates_and_edges(&self) -> (Vec<Vec<f32>>, Vec<NumberedEdge>) {
        let Some(graph) = &self.graph else { return (Vec::new(), Vec::new()) };
        let candidates = (0..graph.candidates().len()).map(|i| graph.point(i).to_vec());
        let edges = graph.edges().iter().map(|edge| ([edge.from, edge.to], edge.status));
        (candidates.collect(), edges.collect())
    }

    /// Returns D from a state to a goal.
    pub fn distance(&mut self, state: &[f32], goal: &[f32]) -> f32 {
        self.networks.policy.distance(state, goal, &mut self.scratch)
    }

    /// Moves the agent of `world` by one step towards `goal`; returns the waypoints that were ahead
    /// of it, the next one first and the goal last.
    ///
    /// # Errors
    /// The world fails.
    pub fn step(
        &mut self,
        world: &mut dyn Environment,
        goal: &[f32],
        rng: &mut ChaCha8Rng,
    ) -> Result<Vec<Vec<f32>>, EnvError> {
        let guide = Guide { policy: &*self.networks.policy, graph: self.graph.as_ref() };
        let (walker, scratch) = (&mut self.walker, &mut self.scratch);
        if walker.is_none() {
            *walker = guide.plan(goal, scratch);
        }
        let aim = guide.aim(walker.as_mut(), world.states(), goal, scratch).to_vec();
        let mut action = vec![0.0; world.spec().action_dim];
        let walkers = std::iter::once(walker.as_ref());
        guide.act(walkers, world.states(), &aim, &mut action, scratch);
        world.step(&action, rng)?;
        let mut waypoints = match (walker, guide.graph) {
            (Some(walker), Some(graph)) => {
                walker.waypoints_ahead().into_iter().map(|i| graph.point(i).to_vec()).collect()
            }
            _ => Vec::new(),
        };
        waypoints.push(goal.to_vec());
        Ok(waypoints)
    }
}

/// Returns the first `N` numbers of a position.
pub(super) fn position<const N: usize>(at: &[f32]) -> [f32; N] {
    std::array::from_fn(|i| at[i])
}
