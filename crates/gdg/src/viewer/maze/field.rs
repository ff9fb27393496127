//! The quantity shown by the map's colours at each pixel, and the actor's directions.

use std::sync::Arc;
use std::time::Instant;

use super::{FilmedMap, MazeWorker, cell_of};
use crate::draw::Raster;
use crate::learn::Policy;
use crate::map::UNREACHABLE;
use crate::viewer::Field;

/// Candidates considered at each pixel for D along the bridge graph.
const LINK_CANDIDATES_PER_PIXEL: usize = 6;

impl MazeWorker {
    pub(super) fn refresh_field(&mut self) {
        let began = Instant::now();
        self.view.past = self.shown.past.clone();
        if let (Some(frame), Some((raster, _))) = (self.shown.past.clone(), &self.frame) {
            let raster = *raster;
            self.view.field = Arc::new(self.filmed_map().field(&frame, raster));
            (self.view.farthest, self.view.raster) = (frame.farthest(), Some(raster));
            self.view.directions = Arc::default();
        } else if let (Some(goal), Some((raster, arrows))) = (self.view.goal.0, self.frame.clone())
        {
            let shown = self.shown.networks.clone();
            let policy = &*shown.policy;
            self.view.field = Arc::new(self.field(raster, goal.centre(), policy));
            self.view.farthest =
                self.view.field.iter().copied().filter(|d| d.is_finite()).fold(1.0, f32::max);
            self.view.raster = Some(raster);
            self.view.directions = Arc::default();
            if self.directions {
                let map = self.world.map();
                let free = arrows.iter().filter(|at| map.is_free_at(at[0], at[1]));
                let at: Vec<[f32; 2]> = free.copied().collect();
                let mut actions = vec![0.0; 2 * at.len()];
                let goals = goal.centre().repeat(at.len());
                policy.actions(at.as_flattened(), &goals, &mut actions, &mut self.scratch);
                let (actions, _) = actions.as_chunks::<2>();
                self.view.directions =
                    Arc::new(at.into_iter().zip(actions.iter().copied()).collect());
            }
        }
        self.shown.timer.done(began);
        self.shown.changed = true;
    }

    /// Returns the map as it is filmed.
    pub(super) fn filmed_map(&mut self) -> &FilmedMap {
        let map = self.world.map();
        let known = self.filmed.take().filter(|filmed| Arc::ptr_eq(filmed.map(), map));
        self.filmed.insert(known.unwrap_or_else(|| FilmedMap::new(map.clone())))
    }

    /// Computes the value of every pixel that shows free ground; the others are NaN.
    fn field(&mut self, raster: Raster, goal: [f32; 2], policy: &dyn Policy) -> Vec<f32> {
        let (columns, rows) = raster.pixels;
        let map = self.world.map();
        let (free, positions) = raster.free_ground(map);
        let states = positions.as_flattened();
        let values = match (self.shown.kind, self.pilot.graph()) {
            (Field::Plain, _) => return vec![f32::NAN; columns * rows],
            (Field::Visits, _) => {
                let of = |at: &[f32; 2]| {
                    self.latest_visits.get(map.index(cell_of(*at))).copied().unwrap_or(0)
                };
                positions.iter().map(|at| of(at) as f32).collect()
            }
            (Field::True, _) => self.true_distances(&positions, goal),
            (Field::FromStart, _) => {
                let mut distances = vec![0.0; free.len()];
                let start = self.view.walk.start.repeat(free.len());
                policy.distances(&start, states, &mut distances, &mut self.scratch);
                distances
            }
            (Field::OverEach, _) => {
                let [start, goal] = [self.view.walk.start, goal].map(|end| end.repeat(free.len()));
                let [mut distances, mut rest] = [0.0; 2].map(|zero| vec![zero; free.len()]);
                policy.distances(&start, states, &mut distances, &mut self.scratch);
                policy.distances(states, &goal, &mut rest, &mut self.scratch);
                distances.iter_mut().zip(rest).for_each(|(d, rest)| *d += rest);
                distances
            }
            (Field::Composed, Some(graph)) => {
                let route = graph.route(&goal, policy, &mut self.scratch);
                graph.composed_distances(
                    states,
                    &route,
                    LINK_CANDIDATES_PER_PIXEL,
                    policy,
                    &mut self.scratch,
                )
            }
            (kind, _) => {
                let mut distances = vec![0.0; free.len()];
                policy.distances(
                    states,
                    &goal.repeat(free.len()),
                    &mut distances,
                    &mut self.scratch,
                );
                if kind == Field::Error {
                    let truth = self.true_distances(&positions, goal);
                    distances.iter_mut().zip(truth).for_each(|(d, t)| *d = (*d - t) / t.max(1.0));
                }
                distances
            }
        };
        let mut field = vec![f32::NAN; columns * rows];
        free.iter().zip(values).for_each(|(i, value)| field[*i] = value);
        field
    }

    /// Returns the true steps to the goal; NaN where it is unreachable.
    fn true_distances(&mut self, positions: &[[f32; 2]], goal: [f32; 2]) -> Vec<f32> {
        let steps = self.point_search().steps_to(goal);
        let of = |at: &[f32; 2]| match steps(*at) {
            UNREACHABLE => f32::NAN,
            steps => steps as f32,
        };
        positions.iter().map(of).collect()
    }
}
