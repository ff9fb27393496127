//! Where things were drawn: clicks are understood by it.

use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::{Line, Span};

use super::action::Action;
use super::raster::MapFrame;

/// What a click does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Click {
    /// As the action's key.
    Act(Action),
    /// Takes what is picked or typed in the dialog on top.
    Answer,
    /// Closes the dialog on top.
    Close,
}

/// Where things were drawn.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// Everything.
    pub screen: Rect,
    /// The map.
    pub map: Option<MapFrame>,
    /// The pane with the map and the line below it.
    pub map_pane: Rect,
    /// The whole map in the corner, where there is one.
    pub minimap: Option<MapFrame>,
    /// What lies on top.
    pub dialog: Rect,
    /// The rows of the list on top, and the number of the first of them.
    pub rows: (Rect, usize),
    /// The first line of the help that is shown.
    pub help_line: Option<usize>,
    clicks: Vec<(Rect, Click)>,
}

impl Places {
    /// Nothing yet, on a screen of this size.
    pub fn on(screen: Rect) -> Self {
        Self { screen, ..Self::default() }
    }

    /// Forgets what could be clicked on.
    pub fn forget_clicks(&mut self) {
        self.clicks.clear();
    }

    /// Clicking in `area` does this.
    pub fn add(&mut self, area: Rect, click: Click) {
        self.clicks.push((area, click));
    }

    /// What a click there does.
    pub fn click(&self, at: Position) -> Option<Click> {
        self.clicks.iter().find(|(area, _)| area.contains(at)).map(|(_, click)| *click)
    }
}

/// A line of which parts can be clicked on.
#[derive(Debug, Default)]
pub struct Bar {
    parts: Vec<(Span<'static>, Option<Click>)>,
}

impl Bar {
    /// Columns it takes.
    pub fn width(&self) -> usize {
        self.parts.iter().map(|(span, _)| span.width()).sum()
    }

    /// Adds a part.
    pub fn push(&mut self, span: Span<'static>, click: impl Into<Option<Click>>) {
        self.parts.push((span, click.into()));
    }

    /// Draws it from the left edge of `area` on; what does not fit is cut off.
    pub fn draw(self, frame: &mut Frame, area: Rect, places: &mut Places) {
        let mut at = area.x;
        let mut line = Line::default();
        for (span, click) in self.parts {
            let width = (span.width() as u16).min(area.right().saturating_sub(at));
            if let Some(click) = click {
                places.add(Rect { x: at, width, ..area }, click);
            }
            at += width;
            line.push_span(span);
        }
        frame.render_widget(line, area);
    }
}
