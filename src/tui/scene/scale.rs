//! The scale of the colours.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use crate::tui::canvas::SHADES;
use crate::tui::layout::ScreenLayout;
use crate::tui::screen::Screen;
use crate::tui::style::DIM;
use crate::tui::text::{fitted_line, short};
use crate::tui::theme::{ColourDepth, Theme};
use gdg::viewer::Field;

/// Width of the colour bar in characters, and its width where room is short.
pub const BAR_WIDTH: usize = 12;
pub const SHORT_BAR_WIDTH: usize = 5;

/// Relative error from which the colour is the strongest.
pub const MAX_SHOWN_ERROR: f32 = 0.5;

/// Returns the scale of a field's colours with the values at its ends, up to `farthest`, and a bar
/// of `bar` characters; `None` for a field that has no colours.
pub fn scale(theme: &Theme, field: Field, farthest: f32, bar: usize) -> Option<Line<'static>> {
    let name = Span::raw(format!(" {} ", field.name()));
    let (low, high) = match field {
        Field::Plain => return None,
        Field::Error => {
            let most = 100.0 * MAX_SHOWN_ERROR;
            (format!("-{most:.0} % short"), format!("+{most:.0} % long"))
        }
        Field::Visits => ("0".to_owned(), short(f64::from(farthest))),
        _ => ("0".to_owned(), format!("{farthest:.0} steps")),
    };
    let mut line = Line::from(vec![name, Span::styled(format!("{low} "), DIM)]);
    if theme.depth == ColourDepth::Mono {
        let shades = SHADES.iter().flat_map(|shade| [*shade; 2]).collect::<String>();
        line.push_span(Span::raw(format!("[{shades}]")));
    } else {
        for i in 0..bar {
            let at = i as f32 / (bar - 1) as f32;
            let rgb = match field {
                Field::Error => theme.error_colour(2.0 * at - 1.0),
                Field::Visits => theme.distance_colour(1.0 - at),
                _ => theme.distance_colour(at),
            };
            line.push_span(Span::styled("\u{2588}", Style::new().fg(theme.colour(rgb))));
        }
    }
    line.push_span(Span::styled(format!(" {high}"), DIM));
    Some(line)
}

/// Draws the line below a scene without a map: the scale, and the interval of the contour lines.
pub fn draw_scale(
    frame: &mut Frame,
    area: Rect,
    mut line: Line<'static>,
    screen: &Screen,
    layout: &ScreenLayout,
) {
    let interval = layout.contour_interval.filter(|_| screen.theme.depth != ColourDepth::Mono);
    let interval = interval
        .map(|steps| format!(", a line every {steps:.0}"))
        .filter(|text| line.width() + text.len() <= usize::from(area.width));
    line.extend(interval.map(|text| Span::styled(text, DIM)));
    frame.render_widget(Paragraph::new(fitted_line(line, area.width)), area);
}
