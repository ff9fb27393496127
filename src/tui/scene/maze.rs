//! Mazes, seen from above.

mod act;
mod editor;
mod map_pixels;

use std::sync::Arc;

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::{Line, Span};

use super::SceneKind;
use super::legend::{contour_text, draw_scale, edge_lines, sample, sign};
use super::overlays::{FRONTIER_SIGN, MAX_EDGES, TRAIL_MARK};
use crate::tui::action::Action;
use crate::tui::layout::ScreenLayout;
use crate::tui::link::TrainerLink;
use crate::tui::pane_text::{fitted_line, short};
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Rgb};
use crate::tui::viewport::Viewport;
pub use act::{maze_on, place_walker};
pub use editor::Editor;
use gdg::bridge::EdgeStatus;
use gdg::map::{Cell, Grid};
use gdg::viewer::{OnArrival, Plane, Request, View, cell_of_goal};
pub use map_pixels::Cache;

pub struct MazeState {
    /// The map as the user last edited it; the trainer follows.
    pub map: Arc<Grid>,
    /// The map as last opened or saved.
    pub kept_map: Arc<Grid>,
    pub editor: Editor,
    pub view: Arc<View>,
    /// The goal that distances are measured to.
    pub goal: Cell,
    /// The cursor whose cell is described.
    pub inspecting: Option<Cell>,
    pub hovered: Option<Cell>,
    pub viewport: Viewport,
    dragged_from: Option<Position>,
    /// The goal request, and the cells cut off from it, that the user has been warned of.
    warned_of: Option<(u64, Arc<Vec<bool>>)>,
}

impl MazeState {
    pub fn new(map: Arc<Grid>) -> Self {
        Self {
            kept_map: map.clone(),
            map,
            editor: Editor::default(),
            view: Arc::default(),
            goal: Cell::new(0, 0),
            inspecting: None,
            hovered: None,
            viewport: Viewport::default(),
            dragged_from: None,
            warned_of: None,
        }
    }

    pub fn walker(&self) -> Option<[f32; 2]> {
        self.view.reach.at.first_chunk().copied()
    }

    pub fn way(&self) -> Vec<[f32; 2]> {
        self.view.reach.way.iter().filter_map(|at| at.first_chunk().copied()).collect()
    }
}

pub const NOUN: &str = "map";

pub const INTRODUCTION: &str = "Colours show the learned distance D to the goal G: light near, \
     dark far. The agents see no walls and get no reward. @ walks to G with what it has learned \
     so far; click on the map to set another goal. The editor draws walls and closes doors.";

impl SceneKind for MazeState {
    fn noun(&self) -> &'static str {
        NOUN
    }

    fn introduction(&self) -> &'static str {
        INTRODUCTION
    }

    /// All but those that turn the view.
    fn offers(&self, action: Action) -> bool {
        !matches!(action, Action::Projection | Action::Alone)
    }

    fn has_true_distances(&self) -> bool {
        true
    }

    fn proportions(&self) -> [f32; 2] {
        [self.map.width() as f32, self.map.height() as f32]
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn goal(&self) -> Vec<f32> {
        self.goal.centre().to_vec()
    }

    fn format_place(&self, place: &[f32]) -> String {
        match place {
            [x, y, ..] => format!("{x:.1}, {y:.1}"),
            _ => "-".to_owned(),
        }
    }

    fn format_length(&self, length: f32) -> String {
        format!("{length:.1}")
    }

    fn signs(&self, screen: &Screen) -> Vec<Line<'static>> {
        legend(self, screen)
    }

    fn draw(
        &self,
        frame: &mut Frame,
        [area, info]: [Rect; 2],
        screen: &Screen,
        layout: &mut ScreenLayout,
        cache: &mut Cache,
    ) {
        map_pixels::draw(frame, area, self, screen, layout, cache);
        if let Some(cell) = self.inspecting.or(self.hovered) {
            let facts = Line::from(cell_facts(self, cell));
            return frame.render_widget(fitted_line(facts, info.width), info);
        }
        let (interval, scaled) = (contour_text(screen, layout), scaled_down_text(screen, layout));
        let texts = [interval.clone() + &scaled, interval, scaled, String::new()];
        draw_scale(frame, info, self, screen, &texts);
    }

    fn start(&mut self, screen: &mut Screen, link: &mut TrainerLink) {
        let Some(scene) = screen.snapshot.scene.maze() else { return };
        let map = scene.map.clone();
        // A new run on a drawn map leaves it in no file.
        if screen.snapshot.saved.is_some() || map.name() != self.map.name() {
            self.kept_map = map.clone();
        }
        self.map = map.clone();
        self.editor.clear_history();
        self.viewport = Viewport::default();
        self.inspect(None, link);
        let method = screen.run().method.name();
        let (name, width, height) = (map.name(), map.width(), map.height());
        let text = format!("{method} on {name}, {width} x {height} cells");
        screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
        let saved = cell_of_goal(&screen.snapshot.notes.goal, &map);
        let goal = saved.or(map.goals().first().copied()).unwrap_or_else(|| self.random_cell(link));
        self.set_goal(goal, screen, link);
    }

    fn act(&mut self, action: Action, screen: &mut Screen, link: &mut TrainerLink) {
        let at_cursor = self.inspecting.unwrap_or(self.goal);
        match action {
            Action::NewGoal => {
                let cell = self.random_cell(link);
                self.set_goal(cell, screen, link);
            }
            Action::Move(dx, dy) => self.move_by([dx, dy], screen, link),
            Action::GoalHere => self.set_goal(at_cursor, screen, link),
            Action::StartHere => place_walker(Some(at_cursor), screen, link),
            Action::NewStart => place_walker(None, screen, link),
            Action::ZoomIn => self.zoom(1.5, None, &screen.layout),
            Action::ZoomOut => self.zoom(1.0 / 1.5, None, &screen.layout),
            Action::ZoomOff => self.zoom(0.0, None, &screen.layout),
            Action::Pan(dx, dy) => self.pan(dx, dy, &screen.layout),
            Action::Inspect => {
                let at = self.inspecting.is_none().then_some(self.goal);
                self.inspect(at, link);
                if at.is_some() {
                    let [goal, close] = [Action::GoalHere, Action::Close]
                        .map(|action| screen.keymap.key_of(action));
                    screen.say(&format!("arrows move, {goal} sets the goal, {close} closes"));
                }
            }
            Action::SaveMap => self.ask_file(screen),
            _ => self.edit(action, screen, link),
        }
    }

    fn on_mouse(
        &mut self,
        kind: MouseEventKind,
        at: Position,
        screen: &mut Screen,
        link: &mut TrainerLink,
    ) -> bool {
        let Some(frame) = &screen.layout.map.clone() else { return false };
        let drawing = self.editor.is_drawing();
        // A stroke that leaves the map continues along its edge.
        let at = if drawing && matches!(kind, MouseEventKind::Drag(_)) {
            act::nearest_within(frame.area, at)
        } else {
            at
        };
        let cell = frame.cell_at(at, &self.map);
        let dragged_from = self.dragged_from.take();
        if self.is_on_minimap(kind, at, &screen.layout) {
            return true;
        }
        let layout = &screen.layout;
        match kind {
            MouseEventKind::Moved => self.hover(cell, link),
            MouseEventKind::ScrollUp if cell.is_some() => {
                self.zoom(act::WHEEL_ZOOM_FACTOR, Some(at), layout);
            }
            MouseEventKind::ScrollDown if cell.is_some() => {
                self.zoom(1.0 / act::WHEEL_ZOOM_FACTOR, Some(at), layout);
            }
            MouseEventKind::Down(MouseButton::Middle) => self.dragged_from = Some(at),
            MouseEventKind::Drag(MouseButton::Middle) => {
                self.drag_map(dragged_from.unwrap_or(at), at, layout);
            }
            MouseEventKind::Down(button) | MouseEventKind::Drag(button)
                if self.editor.is_open() && cell.is_some() =>
            {
                self.editor.draw(at, button == MouseButton::Right, frame, &self.map);
            }
            MouseEventKind::Up(_) if self.editor.is_open() => {
                let new = self.editor.finish(&self.map.clone());
                let refusal = self.editor.tool.refusal().filter(|_| drawing);
                self.change_map_or_say(new, ["", refusal.unwrap_or_default()], screen, link);
            }
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left) => {
                let Some(cell) = cell else { return false };
                self.on_click(cell, screen, link);
            }
            MouseEventKind::Down(MouseButton::Right) => {
                let Some(cell) = cell else { return false };
                self.place_walker_by_click(cell, screen, link);
            }
            _ => return false,
        }
        true
    }

    fn close(&mut self, link: &TrainerLink) -> bool {
        if self.editor.is_open() {
            self.editor.close();
        } else if self.inspecting.is_some() {
            self.inspect(None, link);
        } else {
            return false;
        }
        true
    }

    fn drawn(&self, before: ScreenLayout, screen: &mut Screen, link: &TrainerLink) {
        match &screen.layout.map {
            Some(frame) if before.map.as_ref() != Some(frame) => {
                let planes = Arc::new(vec![Plane::of_maze(frame.raster)]);
                link.request(Request::Planes(planes));
            }
            Some(_) => {}
            // The map is hidden behind a maximised pane.
            None => screen.layout.map = before.map,
        }
    }

    fn show(&mut self, view: Arc<View>, screen: &mut Screen, link: &TrainerLink) {
        // Follow goals chosen by the walking agent itself, but not those older than the latest goal
        // request.
        if let (Some(goal), number) = &view.goal
            && screen.on_arrival == OnArrival::Visit
            && *number == link.goal_request
            && let Some(cell) = cell_of_goal(goal, &self.map)
        {
            self.goal = cell;
        }
        self.view = view;
        self.warn_of_cut_off_goal(screen, link);
    }
}

/// Describes the cell under the cursor or the mouse, walls and D first.
fn cell_facts(maze: &MazeState, cell: Cell) -> String {
    let place = format!("cell {},{}", cell.x, cell.y);
    if !maze.map.is_free(cell) {
        return format!(" {place}: wall");
    }
    let Some(facts) = maze.view.inspected.filter(|facts| facts.cell == cell) else {
        return format!(" {place}");
    };
    let learned = facts.learned;
    let visits = facts.visits.map(|visits| format!(", {} visits", short(f64::from(visits))));
    let visits = visits.unwrap_or_default();
    match facts.truth {
        // There is no relative error of zero steps.
        Some(0) => format!(" {place}: D {learned:.1}, true 0 ({learned:+.1} steps){visits}"),
        Some(truth) => {
            let error = 100.0 * (learned - truth as f32) / truth as f32;
            format!(" {place}: D {learned:.1}, true {truth} ({error:+.0} %){visits}")
        }
        None => format!(" {place}: D {learned:.1}, no path to G"),
    }
}

fn scaled_down_text(screen: &Screen, layout: &ScreenLayout) -> String {
    let cells = layout.map.as_ref().map_or(0.0, |map| match screen.picture_character() {
        Some(character) => 1.0 / (map.scale() * f32::from(character.0)),
        None => map.raster.cells_per_pixel(),
    });
    if cells > 1.01 { format!(", 1 dot = {cells:.1} cells") } else { String::new() }
}

fn legend(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
    let (theme, mono) = (&screen.theme, screen.theme.depth == ColourDepth::Mono);
    let pairs = [
        [('G', theme.goal, "goal"), ('S', theme.walker, "start of @")],
        [('@', theme.walker, "walks to G"), ('s', theme.cursor, "g: map's own")],
    ];
    let mut lines: Vec<Line> = pairs.iter().map(|pair| signs(screen, pair)).collect();
    if screen.run().method.bridges() {
        lines.push(sign(screen, FRONTIER_SIGN, theme.frontier, "frontier goals of agents"));
    }
    if maze.view.cut_off.contains(&true) {
        lines.push(sign(screen, '\\', theme.cursor, "hatched: no path to G"));
    }
    let trail = (if mono { TRAIL_MARK } else { '\u{2500}' }, theme.walker, "trail of @");
    let frontier = ('\u{2500}', theme.frontier, "frontier");
    let has_edge = !mono && !maze.view.exploration.is_complete(&maze.map);
    lines.push(signs(screen, &[trail, frontier][..=usize::from(has_edge)]));
    if screen.run().method.plans() {
        let graph = &maze.view.graph;
        let tried = graph.count(EdgeStatus::Confirmed) + graph.count(EdgeStatus::Demoted);
        let walked = if tried > MAX_EDGES { "walked, near cursor" } else { "edges walked" };
        lines.extend(edge_lines(screen, graph, [walked, "failed", "untried, not shown"]));
    }
    lines
}

fn signs(screen: &Screen, all: &[(char, Rgb, &str)]) -> Line<'static> {
    let mut line = Line::default();
    for (symbol, rgb, meaning) in all {
        let gap = if line.spans.is_empty() { " " } else { "  " };
        line.extend([
            Span::raw(gap),
            sample(screen, *symbol, *rgb),
            Span::raw(format!(" {meaning}")),
        ]);
    }
    line
}
