//! Counts how often the agents have visited each place, in worlds that have places.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::env::{Environment, Explored, GoalSpace, WorldScene};
use crate::store::StoreError;

/// Visits to each place; empty if the world has no places.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Visits(Arc<Vec<u32>>);

impl Visits {
    pub fn none(world: &dyn Environment) -> Self {
        Self(Arc::new(vec![0; world.abilities().explored.map_or(0, Explored::places)]))
    }

    pub fn add(&mut self, world: &dyn Environment, states: &[f32]) {
        let Some(explored) = world.abilities().explored else { return };
        let visits = Arc::make_mut(&mut self.0);
        for state in states.chunks_exact(world.spec().state_dim()) {
            let place = &mut visits[explored.place(state)];
            *place = place.saturating_add(1);
        }
    }

    pub fn enter(&mut self, world: &dyn Environment) {
        let fresh = Self::none(world);
        if fresh.0.len() != self.0.len() {
            *self = fresh;
        }
    }

    pub fn coverage(&self, world: &dyn Environment) -> Option<f64> {
        world.abilities().explored.map(|explored| explored.coverage(&self.0))
    }

    pub fn scene(&self, world: &dyn Environment) -> WorldScene {
        match world.abilities().drawn {
            Some(drawn) => drawn.scene(&self.0),
            None => WorldScene::Goals(Box::new(GoalSpace::of(world, None))),
        }
    }

    pub fn check(&self, world: &dyn Environment) -> Result<(), StoreError> {
        let fits = self.0.len() == Self::none(world).0.len();
        StoreError::unless(fits, "the stored visits do not fit the map")
    }
}
