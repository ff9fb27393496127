//! The areas of the last frame, to find what a click is on.

use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::{Line, Span};

use super::action::Action;
use super::pane_text::fitted_line;
use super::viewport::MapFrame;
use super::viewport::Projection;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Click {
    Act(Action),
    Answer,
    Close,
}

/// Where things were drawn.
#[derive(Clone, Debug, Default)]
pub struct ScreenLayout {
    pub screen: Rect,
    pub map: Option<MapFrame>,
    /// The contour interval in steps, if lines are drawn.
    pub contour_interval: Option<f32>,
    /// The contour interval outside of a comparison.
    pub own_contour_interval: Option<f32>,
    pub projections: Vec<Projection>,
    /// The pane with the map and the line below it.
    pub map_pane: Rect,
    pub minimap: Option<MapFrame>,
    pub dialog: Rect,
    /// The rows of the topmost list, and the index of the first one shown.
    pub rows: (Rect, usize),
    pub charts: Vec<ChartArea>,
    /// Whether there is no room for panes beside or below the map.
    pub lacks_panel: bool,
    clicks: Vec<(Rect, Click)>,
}

impl ScreenLayout {
    pub fn new(screen: Rect) -> Self {
        Self { screen, ..Self::default() }
    }

    pub fn forget_clicks(&mut self) {
        self.clicks.clear();
        self.charts.clear();
    }

    pub fn add(&mut self, area: Rect, click: Click) {
        self.clicks.push((area, click));
    }

    pub fn click(&self, at: Position) -> Option<Click> {
        self.clicks.iter().find(|(area, _)| area.contains(at)).map(|(_, click)| *click)
    }
}

#[derive(Clone, Copy, Debug)]
pub struct ChartArea {
    pub area: Rect,
    /// The values at its left and right edges.
    pub bounds: [f64; 2],
}

impl ChartArea {
    /// Returns the value that a column shows, if `at` is within the chart.
    pub fn value_at(&self, at: Position) -> Option<f64> {
        let [from, to] = self.bounds;
        let last = f64::from(self.area.width.saturating_sub(1)).max(1.0);
        self.area.contains(at).then(|| from + f64::from(at.x - self.area.x) / last * (to - from))
    }
}

#[derive(Debug, Default)]
pub struct ClickableLine {
    parts: Vec<(Span<'static>, Option<Click>)>,
}

impl ClickableLine {
    pub fn width(&self) -> usize {
        self.parts.iter().map(|(span, _)| span.width()).sum()
    }

    /// Adds a part, clickable if `click` is given.
    pub fn push(&mut self, span: Span<'static>, click: impl Into<Option<Click>>) {
        self.parts.push((span, click.into()));
    }

    /// Draws the line from the left edge of `area`, with dots for what does not fit.
    pub fn draw(self, frame: &mut Frame, area: Rect, layout: &mut ScreenLayout) {
        let mut at = area.x;
        let mut line = Line::default();
        for (span, click) in self.parts {
            let width = (span.width() as u16).min(area.right().saturating_sub(at));
            if let Some(click) = click {
                layout.add(Rect { x: at, width, ..area }, click);
            }
            at += width;
            line.push_span(span);
        }
        frame.render_widget(fitted_line(line, area.width), area);
    }
}
