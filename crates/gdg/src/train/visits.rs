//! How often the agents have been at each place of a world, for worlds that have places.

use std::sync::Arc;

use crate::env::{Environment, Explored, GoalSpace, Scene};
use crate::store::{Store, StoreError};

/// Name in the store.
const VISITED: &str = "visited";

/// Visits to each place; empty if the world has no places.
#[derive(Clone, Debug)]
pub struct Visits(Arc<Vec<u32>>);

impl Visits {
    /// Returns no visits to any place of `world`.
    pub fn none(world: &dyn Environment) -> Self {
        Self(Arc::new(vec![0; world.abilities().explored.map_or(0, Explored::places)]))
    }

    /// Counts the agents' current places.
    pub fn count(&mut self, world: &dyn Environment) {
        self.add(world, world.states());
    }

    /// Counts the places of states, `(states, state_dim)`.
    pub fn add(&mut self, world: &dyn Environment, states: &[f32]) {
        let Some(explored) = world.abilities().explored else { return };
        let visits = Arc::make_mut(&mut self.0);
        for state in states.chunks_exact(world.spec().state_dim()) {
            let place = &mut visits[explored.place(state)];
            *place = place.saturating_add(1);
        }
    }

    /// Keeps the visits if `world` has as many places; otherwise forgets them.
    pub fn enter(&mut self, world: &dyn Environment) {
        let fresh = Self::none(world);
        if fresh.0.len() != self.0.len() {
            *self = fresh;
        }
    }

    /// Returns the share of `world` that has been explored, if it has places.
    pub fn coverage(&self, world: &dyn Environment) -> Option<f64> {
        world.abilities().explored.map(|explored| explored.coverage(&self.0))
    }

    /// Returns what a front end draws of `world`.
    pub fn scene(&self, world: &dyn Environment) -> Scene {
        match world.abilities().drawn {
            Some(drawn) => drawn.scene(&self.0),
            None => Scene::Goals(GoalSpace::of(world)),
        }
    }

    /// Writes the visits, if the world has places.
    pub fn write(&self, store: &mut Store) {
        if !self.0.is_empty() {
            store.put(VISITED, self.0.to_vec());
        }
    }

    /// Reads the visits to the places of `world`.
    ///
    /// # Errors
    /// They are missing or do not fit `world`.
    pub fn read(store: &Store, world: &dyn Environment) -> Result<Self, StoreError> {
        let none = Self::none(world);
        if none.0.is_empty() {
            return Ok(none);
        }
        let visits = store.u32(VISITED)?;
        if visits.len() != none.0.len() {
            return Err(StoreError::inconsistent("the stored visits do not fit the map"));
        }
        Ok(Self(Arc::new(visits.to_vec())))
    }
}
