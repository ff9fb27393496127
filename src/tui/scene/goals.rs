//! Spaces of goals, of worlds without a picture of their own: two components of goals at a time.

mod act;
mod draw;
mod legend;
mod picture;
mod walk;

use std::sync::Arc;

use ratatui::text::Line;

use super::scale::scale;
use crate::tui::screen::Screen;
pub use act::{offers, wording};
pub use draw::draw;
use gdg::bridge::EdgeStatus;
use gdg::env::{GoalSpace, Scene};
use gdg::viewer::{Field, GoalsView};
pub use legend::lines as legend_lines;
pub use walk::lines as walk_lines;

/// The state of a space of goals on the screen.
#[derive(Debug, Default)]
pub struct GoalsState {
    /// The view shown.
    pub view: Arc<GoalsView>,
    /// The goal that distances are measured to, `(goal_dim)`; empty until there is one.
    pub goal: Vec<f32>,
    /// Which pair of components is shown.
    pair: usize,
    /// Whether the world's own picture is shown beside them.
    has_picture: bool,
}

/// The word for what is drawn.
pub const NOUN: &str = "goals";

/// The text that begins the help.
pub const INTRODUCTION: &str = "Colours show the learned distance D to the goal G over two \
     components of the space of goals: light near, dark far. The agents get no reward. @ reaches \
     for G with what it has learned so far; a click sets the two components that are shown.";

/// Returns whether the colours can show a field.
pub fn shows(field: Field) -> bool {
    matches!(field, Field::Learned | Field::FromStart | Field::Composed | Field::Plain)
}

/// Returns the space of the run shown.
fn space(screen: &Screen) -> Option<&GoalSpace> {
    match &screen.snapshot.scene {
        Scene::Goals(space) => Some(space),
        _ => None,
    }
}

/// Margin around what is shown, as a share of its size.
const MARGIN: f32 = 0.05;

impl GoalsState {
    /// Returns the largest value of the field, at least 1.
    pub fn own_farthest(&self) -> f32 {
        self.view.farthest.max(1.0)
    }

    /// Returns the colour scale with a bar of `bar` characters.
    fn scale(&self, screen: &Screen, bar: usize) -> Line<'static> {
        scale(&screen.theme, screen.field, self.own_farthest(), bar)
            .unwrap_or_else(|| Line::raw(format!(" {NOUN} only ")))
    }

    /// Returns the number of edges of the bridge graph with this record.
    pub fn edge_count(&self, status: EdgeStatus) -> usize {
        self.view.edges.iter().filter(|(_, own)| *own == status).count()
    }

    /// Returns the components shown, to the right and upwards, for goals of `count` components.
    fn axes(&self, count: usize) -> [usize; 2] {
        let mut pairs = (0..count).flat_map(|up| (0..up).map(move |across| [across, up]));
        let all = (count * count.saturating_sub(1) / 2).max(1);
        pairs.nth(self.pair % all).unwrap_or([0, 0])
    }

    /// Returns the lowest and the highest value of a component to show: its range in `space`, and
    /// all places known.
    fn range(&self, axis: usize, space: &GoalSpace) -> [f32; 2] {
        let places = self.view.candidates.iter().chain([&self.goal, &self.view.reach.at]);
        let values = places.filter_map(|place| place.get(axis).copied()).chain(space.range(axis));
        let nothing = [f32::INFINITY, f32::NEG_INFINITY];
        let [low, high] =
            values.fold(nothing, |[low, high], value| [low.min(value), high.max(value)]);
        let margin = (MARGIN * (high - low)).max(f32::MIN_POSITIVE.sqrt());
        [low - margin, high + margin]
    }
}
