//! What the map's colours stand for, pixel by pixel, and where the actor would go.

use std::sync::Arc;
use std::time::Instant;

use ratatui::layout::Position;

use super::{Worker, cell_of};
use crate::learn::Policy;
use crate::map::UNREACHABLE;
use crate::train::Snapshot;
use crate::tui::layers::Field;
use crate::tui::raster::{Ground, Raster};

/// Candidates that composed distances of the field consider at each pixel.
const LINKS_OF_A_PIXEL: usize = 6;

/// Characters from one arrow to the next, across and down.
const ARROWS_APART: (usize, usize) = (4, 2);

impl Worker {
    pub(super) fn renew_field(&mut self, snapshot: &Snapshot) {
        let began = Instant::now();
        if let (Some(goal), Some(frame)) = (self.view.goal.0, self.frame.clone()) {
            let shown = self.shown.clone();
            let policy = &*shown.policy;
            self.view.field = Arc::new(self.field(frame.raster, goal.centre(), policy, snapshot));
            self.view.farthest = self.view.field.iter().copied().filter(|d| d.is_finite()).fold(1.0, f32::max);
            self.view.raster = Some(frame.raster);
            let places = || {
                let (across, down) = ARROWS_APART;
                let rows = (frame.area.y..frame.area.bottom()).step_by(down);
                rows.flat_map(move |y| (frame.area.x..frame.area.right()).step_by(across).map(move |x| (x, y)))
            };
            self.view.directions = Arc::default();
            if self.directions {
                let map = self.world.map();
                let at = places().map(|(x, y)| frame.middle_of(Position::new(x, y)));
                let at: Vec<[f32; 2]> = at.filter(|at| map.is_free_at(at[0], at[1])).collect();
                let mut actions = vec![0.0; 2 * at.len()];
                let goals = goal.centre().repeat(at.len());
                policy.actions(at.as_flattened(), &goals, &mut actions, &mut self.scratch);
                let (actions, _) = actions.as_chunks::<2>();
                self.view.directions = Arc::new(at.into_iter().zip(actions.iter().copied()).collect());
            }
        }
        self.field.done(began);
        self.changed = true;
    }

    /// The value of every pixel that shows free ground.
    fn field(&mut self, raster: Raster, goal: [f32; 2], policy: &dyn Policy, snapshot: &Snapshot) -> Vec<f32> {
        let (columns, rows) = raster.pixels;
        let map = self.world.map();
        let free = (0..columns * rows).filter_map(|i| match raster.ground(map, i % columns, i / columns) {
            Ground::Free(position) => Some((i, position)),
            _ => None,
        });
        let (free, positions): (Vec<usize>, Vec<[f32; 2]>) = free.unzip();
        let states = positions.as_flattened();
        let values = match (self.view.kind, &self.graph) {
            (Field::Plain, _) => return vec![f32::NAN; columns * rows],
            (Field::Visits, _) => {
                let visits = snapshot.scene.maze().visits;
                let of = |at: &[f32; 2]| visits.get(map.index(cell_of(*at))).copied().unwrap_or(0);
                positions.iter().map(|at| of(at) as f32).collect()
            }
            (Field::True, _) => self.true_distances(&positions, goal),
            (Field::FromStart, _) => {
                let mut distances = vec![0.0; free.len()];
                let start = self.view.walk.start.repeat(free.len());
                policy.distances(&start, states, &mut distances, &mut self.scratch);
                distances
            }
            (Field::Composed, Some(graph)) => {
                let route = graph.route(&goal, policy, &mut self.scratch);
                graph.composed(states, &route, LINKS_OF_A_PIXEL, policy, &mut self.scratch)
            }
            (kind, _) => {
                let mut distances = vec![0.0; free.len()];
                policy.distances(states, &goal.repeat(free.len()), &mut distances, &mut self.scratch);
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

    /// The map's own steps to the goal; NaN where there is no way.
    fn true_distances(&mut self, positions: &[[f32; 2]], goal: [f32; 2]) -> Vec<f32> {
        let map = self.world.map();
        let steps = self.search.from(cell_of(goal));
        let of = |at: &[f32; 2]| match steps[map.index(cell_of(*at))] {
            UNREACHABLE => f32::NAN,
            steps => steps as f32,
        };
        positions.iter().map(of).collect()
    }
}
