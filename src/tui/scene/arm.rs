//! Arms, in projections.

mod act;
mod draw;
mod info;
mod legend;
mod mouse;
mod shapes;
mod walk;

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::Rect;

use crate::tui::contours;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::projection::{ShownAngles, arrange};
use crate::tui::screen::Screen;
pub use act::{offers, wording};
use gdg::env::ArmScene;
use gdg::viewer::ArmView;
use gdg::viewer::arm::film_goal;
pub use legend::lines as legend_lines;
pub use walk::lines as walk_lines;

/// What the screen shows of an arm.
#[derive(Debug, Default)]
pub struct ArmState {
    /// The view shown.
    pub view: Arc<ArmView>,
    /// The goal that distances are measured to, in metres.
    pub goal: [f32; 3],
    /// Which projections are shown, and how.
    pub shown: ShownAngles,
    /// Whether a drag has turned the free projection since the button was pressed.
    pub turned: bool,
}

/// Draws the arm into the first area, and the line below it into the second.
pub fn draw(
    frame: &mut Frame,
    [area, info]: [Rect; 2],
    scene: &ArmScene,
    screen: &Screen,
    layout: &mut ScreenLayout,
) {
    layout.projections = arrange(area, &screen.arm.shown, screen.marker);
    layout.contour_interval = contour_interval(screen);
    for projection in &layout.projections {
        draw::draw(frame, projection, scene, screen, layout);
    }
    info::draw(frame, info, screen, layout);
}

/// Returns the steps between two contour lines, the same in all projections, if there are any.
fn contour_interval(screen: &Screen) -> Option<f32> {
    let view = &screen.arm.view;
    let shown = screen.shown_field().is_distance()
        && shows_field(screen)
        && screen.overlays.has(Overlay::Contours);
    let fields = view.fields.iter().zip(view.planes.iter());
    let fields: Vec<_> = fields.map(|(field, plane)| (&**field, plane.raster.pixels.0)).collect();
    contours::interval(&fields, contours::SPACING, None).filter(|_| shown)
}

/// Returns whether the viewer has computed the field to be shown.
fn shows_field(screen: &Screen) -> bool {
    screen.shown_past().is_some() || screen.arm.view.kind == screen.field
}

/// Returns the goal that distances are shown to, in metres.
fn shown_goal(screen: &Screen) -> [f32; 3] {
    screen.shown_past().map_or(screen.arm.goal, film_goal)
}

/// Formats a position in centimetres.
fn centimetres(at: [f32; 3]) -> String {
    let [x, y, z] = at.map(|metres| 100.0 * metres);
    format!("{x:.1}, {y:.1}, {z:.1}")
}
