//! Draws two components of a space of goals.

use ratatui::Frame;
use ratatui::layout::{Constraint, Direction, Layout, Rect};
use ratatui::text::Line;

use super::{GoalsState, picture, space};
use crate::tui::canvas::{CANDIDATE_MARK, Canvas, Pen, WALL_MARK, shade};
use crate::tui::contours::{self, Label};
use crate::tui::glyphs::Glyphs;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::scene::scale::{BAR_WIDTH, draw_scale};
use crate::tui::screen::Screen;
use crate::tui::slice::ShownSlice;
use crate::tui::style::BOLD;
use crate::tui::theme::ColourDepth;
use gdg::bridge::EdgeStatus;
use gdg::env::GoalSpace;

/// Corners of the outline of a goal.
const CORNERS: usize = 90;

/// Draws the space into the first area, and the line below it into the second.
pub fn draw(
    frame: &mut Frame,
    [area, info]: [Rect; 2],
    state: &GoalsState,
    screen: &Screen,
    layout: &mut ScreenLayout,
) {
    let parts = Layout::vertical([Constraint::Length(1), Constraint::Fill(1)]);
    let [name, area] = parts.areas(area);
    let Some(space) = space(screen) else { return };
    let area = if state.has_picture {
        let is_wide = area.width > 2 * area.height;
        let direction = if is_wide { Direction::Horizontal } else { Direction::Vertical };
        let [area, beside] = Layout::new(direction, [Constraint::Fill(1); 2]).areas(area);
        layout.picture = picture::draw(frame, beside, state, screen);
        area
    } else {
        area
    };
    let spec = space.spec();
    let axes = state.axes(spec.goal_dim());
    let ranges = axes.map(|axis| state.range(axis, space));
    let to_scale = spec.position_scale.is_some() && axes[0] != axes[1];
    layout.goals = ShownSlice::fit(area, axes, ranges, to_scale, screen.marker);
    if let Some(shown) = &layout.goals {
        layout.contour_interval = contour_interval(shown, state, screen);
        let sketch = Sketch { shown, state, screen, space };
        sketch.draw(frame, layout.contour_interval);
        frame.render_widget(sketch.title(), name);
    }
    draw_scale(frame, info, state.scale(screen, BAR_WIDTH), screen, layout);
}

/// Returns the steps between two contour lines, if there are any.
fn contour_interval(shown: &ShownSlice, state: &GoalsState, screen: &Screen) -> Option<f32> {
    let drawn = screen.field.is_distance()
        && screen.overlays.has(Overlay::Contours)
        && state.view.kind == screen.field
        && state.view.slice == Some(shown.slice);
    let fields = [(&**state.view.field, shown.slice.raster.pixels.0)];
    contours::interval(&fields, contours::SPACING, None).filter(|_| drawn)
}

/// What is drawn, and where.
struct Sketch<'a> {
    shown: &'a ShownSlice,
    state: &'a GoalsState,
    screen: &'a Screen,
    space: &'a GoalSpace,
}

impl Sketch<'_> {
    /// Returns the components' names and the range that is shown, and the values of the goal's other
    /// components.
    fn title(&self) -> Line<'static> {
        let slice = &self.shown.slice;
        let [across, up] = slice.axes;
        let [left, top, width, height] = slice.raster.window;
        let range = |low: f32, high: f32| format!("{} to {}", short(low), short(high));
        let mut text =
            format!(" {}\u{2192} {}", self.space.name(across), range(left, left + width));
        if across != up {
            let [low, high] = [-(top + height), -top].map(|at| at / slice.stretch);
            text += &format!("  {}\u{2191} {}", self.space.name(up), range(low, high));
        }
        for (i, value) in self.state.goal.iter().enumerate() {
            if !slice.axes.contains(&i) {
                text += &format!("  {} {}", self.space.name(i), short(*value));
            }
        }
        Line::styled(text, BOLD)
    }

    fn draw(&self, frame: &mut Frame, contour_interval: Option<f32>) {
        let mut canvas = Canvas::new(&self.shown.frame);
        let labels = self.draw_field(&mut canvas, contour_interval);
        let colours = |label: &Label, canvas: &Canvas| {
            label.pixels(&self.shown.frame).map(|i| canvas.colour(i)).collect::<Vec<_>>()
        };
        let labels: Vec<_> =
            labels.into_iter().map(|label| (colours(&label, &canvas), label)).collect();
        self.draw_graph(&mut canvas);
        self.draw_search(&mut canvas);
        self.draw_agents(&mut canvas);
        self.draw_plan(&mut canvas);
        self.draw_goal(&mut canvas);
        let theme = &self.screen.theme;
        canvas.paint(frame.buffer_mut(), &self.shown.frame, theme);
        let mut glyphs = Glyphs { map_frame: &self.shown.frame, theme, buffer: frame.buffer_mut() };
        // Only where nothing else has been drawn since.
        let free = labels.iter().filter(|(before, label)| colours(label, &canvas) == *before);
        free.for_each(|(_, label)| glyphs.label(label));
        self.draw_symbols(&mut glyphs);
    }

    /// Draws D, with contour lines; returns their labels.
    fn draw_field(&self, canvas: &mut Canvas, contour_interval: Option<f32>) -> Vec<Label> {
        let (theme, view) = (&self.screen.theme, &self.state.view);
        for i in 0..canvas.len() {
            let is_wall = self.shown.slice.is_wall(i, self.space);
            let (rgb, mark) = if is_wall { (theme.wall, WALL_MARK) } else { (theme.unknown, ' ') };
            canvas.set(i, Some(rgb), mark);
        }
        if view.slice != Some(self.shown.slice) || view.kind != self.screen.field {
            return Vec::new();
        }
        let (farthest, mono) = (self.state.own_farthest(), theme.depth == ColourDepth::Mono);
        for (i, value) in view.field.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let share = value / farthest;
            let mark = if mono { shade(share) } else { ' ' };
            canvas.set(i, Some(theme.distance_colour(share)), mark);
        }
        let Some(interval) = contour_interval else { return Vec::new() };
        let near = self.flat(&self.state.goal).and_then(|at| self.shown.slice.raster.pixel_of(at));
        let near = near.unwrap_or_default();
        contours::draw(canvas, &self.shown.frame, &view.field, interval, near, theme)
    }

    /// Returns where a place is shown: the first numbers of a goal; `None` if they are too few.
    fn flat(&self, place: &[f32]) -> Option<[f32; 2]> {
        (place.len() >= self.space.spec().goal_dim()).then(|| self.shown.slice.flat(place))
    }

    /// Returns where a state is shown.
    fn flat_state(&self, state: &[f32]) -> Option<[f32; 2]> {
        let place = || self.space.spec().achieved(state).collect::<Vec<_>>();
        (state.len() == self.space.spec().state_dim()).then(|| self.shown.slice.flat(&place()))
    }

    /// Draws lines through places.
    fn line(&self, canvas: &mut Canvas, places: &[Option<[f32; 2]>], pen: Pen) {
        let pairs = places.windows(2).filter_map(|ends| Some([ends[0]?, ends[1]?]));
        canvas.lines(&self.shown.frame, pairs, pen);
    }

    fn draw_graph(&self, canvas: &mut Canvas) {
        let (theme, view) = (&self.screen.theme, &self.state.view);
        if self.screen.overlays.has(Overlay::Edges) {
            let kinds = [
                (EdgeStatus::Untried, 2, 0.3, '-'),
                (EdgeStatus::Confirmed, 0, 0.6, '='),
                (EdgeStatus::Demoted, 1, 0.9, 'x'),
            ];
            for (kind, colour, share, mark) in kinds {
                let own = view.edges.iter().filter(|(_, status)| *status == kind);
                let ends =
                    own.map(|(ends, _)| ends.map(|i| self.shown.slice.flat(&view.candidates[i])));
                canvas.lines(
                    &self.shown.frame,
                    ends,
                    Pen { rgb: theme.edges[colour], share, mark },
                );
            }
        }
        if self.screen.overlays.has(Overlay::Candidates) {
            for at in view.candidates.iter().map(|place| self.shown.slice.flat(place)) {
                let mark = Some(CANDIDATE_MARK);
                canvas.faint_dot(&self.shown.frame, at, theme.cursor, 0.35, mark);
            }
        }
    }

    /// Draws the latest search for a bridge point.
    fn draw_search(&self, canvas: &mut Canvas) {
        let Some(search) = self.screen.search() else { return };
        if !self.screen.overlays.has(Overlay::Search) {
            return;
        }
        let [accepted, rejected] = self.screen.theme.search;
        for place in search.rejected.chunks_exact(self.space.spec().goal_dim()) {
            canvas.dot(&self.shown.frame, self.shown.slice.flat(place), rejected, 'x');
        }
        if let Some(bridge) = &search.found {
            let pen = Pen { rgb: accepted, share: 0.9, mark: '=' };
            let middle = self.flat(&bridge.point);
            let stops = [self.flat_state(&search.state), middle, self.flat(&search.goal)];
            self.line(canvas, &stops, pen);
        }
    }

    /// Draws the exploring agents, and their trails.
    fn draw_agents(&self, canvas: &mut Canvas) {
        if !self.screen.overlays.has(Overlay::Agents) {
            return;
        }
        let (snapshot, rgb) = (&self.screen.snapshot, self.screen.theme.frontier);
        let places = |states: &[f32]| {
            states
                .chunks_exact(self.space.spec().state_dim())
                .map(|state| self.flat_state(state))
                .collect::<Vec<_>>()
        };
        for trail in snapshot.trails.iter() {
            self.line(canvas, &places(trail), Pen { rgb, share: 0.4, mark: '.' });
        }
        for at in places(&snapshot.agents).into_iter().flatten() {
            canvas.dot(&self.shown.frame, at, rgb, 'o');
        }
    }

    /// Draws the waypoints ahead, and where the agent has been.
    fn draw_plan(&self, canvas: &mut Canvas) {
        let (theme, reach) = (&self.screen.theme, &self.state.view.reach);
        let through = |first: &Vec<f32>, places: &[Vec<f32>]| -> Vec<Option<[f32; 2]>> {
            std::iter::once(first).chain(places).map(|place| self.flat(place)).collect()
        };
        if self.screen.overlays.has(Overlay::Path) && reach.path.len() > 1 {
            let stops = through(&reach.at, &reach.path);
            self.line(canvas, &stops, Pen { rgb: theme.path, share: 1.0, mark: '+' });
        }
        let trail = through(&reach.start, &reach.trail);
        self.line(canvas, &trail, Pen { rgb: theme.walker, share: 0.7, mark: ',' });
    }

    /// Draws the outline of where the goal counts as reached.
    fn draw_goal(&self, canvas: &mut Canvas) {
        let Some([x, y]) = self.flat(&self.state.goal) else { return };
        let (radius, stretch) = (self.space.spec().goal_radius, self.shown.slice.stretch);
        for n in 0..CORNERS {
            let (sin, cos) = (std::f32::consts::TAU * n as f32 / CORNERS as f32).sin_cos();
            let at = [x + radius * cos, y + stretch * radius * sin];
            canvas.dot(&self.shown.frame, at, self.screen.theme.goal, '*');
        }
    }

    fn draw_symbols(&self, glyphs: &mut Glyphs) {
        let (theme, reach) = (&self.screen.theme, &self.state.view.reach);
        if let Some(followed) = &self.screen.snapshot.followed {
            if let Some(at) = self.flat(&followed.goal) {
                glyphs.symbol(at, '\u{2691}', Some(theme.frontier));
            }
            if let Some(at) = self.flat_state(&followed.state) {
                glyphs.letter(at, 'A', theme.frontier);
            }
        }
        let letters = [(&self.state.goal, 'G', theme.goal), (&reach.at, '@', theme.walker)];
        for (place, letter, rgb) in letters {
            if let Some(at) = self.flat(place) {
                glyphs.letter(at, letter, rgb);
            }
        }
    }
}

/// Formats a value with three significant digits.
pub fn short(value: f32) -> String {
    let digits = match value.abs() {
        100.0.. => 0,
        10.0.. => 1,
        _ => 2,
    };
    format!("{value:.digits$}")
}
