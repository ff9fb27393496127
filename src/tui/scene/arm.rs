//! Arms, in projections.

mod act;
mod draw;
mod legend;
mod mouse;
mod shapes;
mod walk;

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::scale::{BAR_WIDTH, draw_scale, scale};
use crate::tui::contours;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::projection::{ShownAngles, arrange};
use crate::tui::screen::Screen;
pub use act::{offers, wording};
use gdg::bridge::EdgeStatus;
use gdg::env::ArmScene;
use gdg::train::FilmFrame;
use gdg::viewer::arm::film_goal;
use gdg::viewer::{ArmView, Field};
pub use legend::lines as legend_lines;
pub use walk::lines as walk_lines;

/// The state of an arm on the screen.
#[derive(Debug, Default)]
pub struct ArmState {
    /// The view shown.
    pub view: Arc<ArmView>,
    /// The goal that distances are measured to, in metres.
    pub goal: [f32; 3],
    /// Which projections are shown, and how.
    pub shown: ShownAngles,
    /// Whether a drag has turned the free projection since the button was pressed.
    turned: bool,
    /// The mouse position the arm is being dragged from.
    dragged_from: Option<Position>,
}

impl ArmState {
    /// Returns the frame of the film that is shown: the viewer's latest, to avoid flicker.
    pub fn past(&self) -> Option<&FilmFrame> {
        self.view.past.as_deref()
    }

    /// Returns the field that the colours show: for the past, only D is available.
    pub fn shown_field(&self, screen: &Screen) -> Field {
        if self.past().is_some() { Field::Learned } else { screen.field }
    }

    /// Returns the largest value of the field, at least 1.
    pub fn own_farthest(&self) -> f32 {
        self.view.farthest.max(1.0)
    }

    /// Returns the largest value that the colours show.
    pub fn farthest(&self, screen: &Screen) -> f32 {
        self.own_farthest().max(screen.least_farthest)
    }

    /// Returns the colour scale with a bar of `bar` characters.
    pub fn scale(&self, screen: &Screen, bar: usize) -> Line<'static> {
        scale(&screen.theme, self.shown_field(screen), self.farthest(screen), bar)
            .unwrap_or_else(|| Line::raw(format!(" {NOUN} only ")))
    }

    /// Returns the number of edges of the bridge graph with this record.
    pub fn edge_count(&self, status: EdgeStatus) -> usize {
        self.view.edges.iter().filter(|(_, own)| *own == status).count()
    }
}

/// The word for what is drawn.
pub const NOUN: &str = "arm";

/// The text that begins the help.
pub const INTRODUCTION: &str = "Colours show the learned distance D to the goal G: light near, \
     dark far. The agents do not see joints and get no reward. @ reaches for G with what it has \
     learned so far; a click sets the two coordinates that are shown.";

/// Returns whether the colours can show a field.
pub fn shows(field: Field) -> bool {
    matches!(field, Field::Learned | Field::FromStart | Field::Composed | Field::Plain)
}

/// Draws the arm into the first area, and the line below it into the second.
pub fn draw(
    frame: &mut Frame,
    [area, info]: [Rect; 2],
    scene: &ArmScene,
    arm: &ArmState,
    screen: &Screen,
    layout: &mut ScreenLayout,
) {
    layout.projections = arrange(area, &arm.shown, screen.marker);
    layout.contour_interval = contour_interval(arm, screen);
    for projection in &layout.projections {
        draw::draw(frame, projection, scene, arm, screen, layout);
    }
    draw_scale(frame, info, arm.scale(screen, BAR_WIDTH), screen, layout);
}

/// Returns the steps between two contour lines, the same in all projections, if there are any.
fn contour_interval(arm: &ArmState, screen: &Screen) -> Option<f32> {
    let view = &arm.view;
    let shown = arm.shown_field(screen).is_distance()
        && shows_field(arm, screen)
        && screen.overlays.has(Overlay::Contours);
    let fields = view.fields.iter().zip(view.planes.iter());
    let fields: Vec<_> = fields.map(|(field, plane)| (&**field, plane.raster.pixels.0)).collect();
    contours::interval(&fields, contours::SPACING, None).filter(|_| shown)
}

/// Returns whether the viewer has computed the field to be shown.
fn shows_field(arm: &ArmState, screen: &Screen) -> bool {
    arm.past().is_some() || arm.view.kind == screen.field
}

/// Returns the goal that distances are shown to, in metres.
fn shown_goal(arm: &ArmState) -> [f32; 3] {
    arm.past().map_or(arm.goal, film_goal)
}

/// Formats the position with which a state or goal begins, in centimetres.
fn centimetres(at: &[f32]) -> String {
    match at {
        [x, y, z, ..] => {
            let [x, y, z] = [x, y, z].map(|metres| 100.0 * metres);
            format!("{x:.1}, {y:.1}, {z:.1}")
        }
        _ => "-".to_owned(),
    }
}
