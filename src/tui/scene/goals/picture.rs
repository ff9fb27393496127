//! The picture that a world renders of itself.

use ratatui::Frame;
use ratatui::layout::Rect;

use super::GoalsState;
use crate::tui::canvas::{Canvas, shade};
use crate::tui::screen::Screen;
use crate::tui::slice::ShownSlice;
use gdg::env::Rendering;

/// Draws the latest picture; returns the width and height in pixels that a picture may have here.
pub fn draw(
    frame: &mut Frame,
    area: Rect,
    state: &GoalsState,
    screen: &Screen,
) -> Option<(usize, usize)> {
    match &state.view.picture {
        Some(Ok(picture)) => paint(frame, area, picture, screen),
        _ => frame.render_widget("rendering ...", area),
    }
    let whole = ShownSlice::fit(area, [0, 1], [[0.0, 1.0]; 2], false, screen.marker)?;
    Some(whole.slice.raster.pixels)
}

fn paint(frame: &mut Frame, area: Rect, picture: &Rendering, screen: &Screen) {
    let (width, height) = picture.size();
    // Upwards is more, so that the first row is the last.
    let ranges = [[0.0, width as f32], [-(height as f32), 0.0]];
    let Some(shown) = ShownSlice::fit(area, [0, 1], ranges, true, screen.marker) else { return };
    let mut canvas = Canvas::new(&shown.frame);
    for i in 0..canvas.len() {
        let [red, green, blue] = picture.at(shown.slice.raster.middle_of(i));
        let light = 0.3 * f32::from(red) + 0.59 * f32::from(green) + 0.11 * f32::from(blue);
        canvas.set(i, Some((red, green, blue)), shade(1.0 - light / 255.0));
    }
    canvas.paint(frame.buffer_mut(), &shown.frame, &screen.theme);
}
