//! Mazes, seen from above.

mod editor;
mod facts;
mod map_pixels;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crossterm::event::{MouseButton, MouseEventKind};
use rand::RngExt;
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::legend::{contour_text, draw_scale};
use super::{Drawing, SceneKind};
use crate::tui::action::Action;
use crate::tui::dialog::{Prompt, Question};
use crate::tui::layout::ScreenLayout;
use crate::tui::pane_text::fitted_line;
use crate::tui::screen::Screen;
use crate::tui::viewport::{MapFrame, Viewport};
pub use editor::Editor;
use editor::offset_cell;
use facts::{cell_facts, legend, scaled_down_text};
use gdg::engine::{EngineCommand, MakeWorld};
use gdg::env::PointMaze;
use gdg::files::named;
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

const WHEEL_ZOOM_FACTOR: f32 = 1.25;

/// The fewest cells shown across at maximum zoom.
const MIN_VISIBLE_CELLS: f32 = 4.0;

/// Share of the visible part that panning moves by.
const PAN_SHARE: f32 = 0.2;

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

    fn draw(&self, [area, info]: [Rect; 2], mut on: Drawing) {
        map_pixels::draw(area, self, &mut on);
        if let Some(cell) = self.inspecting.or(self.hovered) {
            let facts = Line::from(cell_facts(self, cell));
            return on.frame.render_widget(fitted_line(facts, info.width), info);
        }
        let (screen, layout) = (on.screen, &*on.layout);
        let (interval, scaled) = (contour_text(screen, layout), scaled_down_text(screen, layout));
        let texts = [interval.clone() + &scaled, interval, scaled, String::new()];
        draw_scale(info, self, on, &texts);
    }

    fn start(&mut self, screen: &mut Screen) {
        let Some(scene) = screen.snapshot.scene.maze() else { return };
        let map = scene.map.clone();
        // A new run on a drawn map leaves it in no file.
        if screen.snapshot.saved.is_some() || map.name() != self.map.name() {
            self.kept_map = map.clone();
        }
        self.map = map.clone();
        self.editor.clear_history();
        self.viewport = Viewport::default();
        self.inspect(None, screen);
        let method = screen.run().method.name();
        let (name, width, height) = (map.name(), map.width(), map.height());
        let text = format!("{method} on {name}, {width} x {height} cells");
        screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
        let saved = cell_of_goal(&screen.snapshot.notes.goal, &map);
        let goal =
            saved.or(map.goals().first().copied()).unwrap_or_else(|| self.random_cell(screen));
        self.set_goal(goal, screen);
    }

    fn act(&mut self, action: Action, screen: &mut Screen) {
        let at_cursor = self.inspecting.unwrap_or(self.goal);
        match action {
            Action::NewGoal => {
                let cell = self.random_cell(screen);
                self.set_goal(cell, screen);
            }
            Action::Move(dx, dy) => self.move_by([dx, dy], screen),
            Action::GoalHere => self.set_goal(at_cursor, screen),
            Action::StartHere => place_walker(Some(at_cursor), screen),
            Action::NewStart => place_walker(None, screen),
            Action::ZoomIn => self.zoom(1.5, None, &screen.layout),
            Action::ZoomOut => self.zoom(1.0 / 1.5, None, &screen.layout),
            Action::ZoomOff => self.zoom(0.0, None, &screen.layout),
            Action::Pan(dx, dy) => self.pan(dx, dy, &screen.layout),
            Action::Inspect => {
                let at = self.inspecting.is_none().then_some(self.goal);
                self.inspect(at, screen);
            }
            Action::SaveMap => self.ask_file(screen),
            _ => self.edit(action, screen),
        }
    }

    fn on_mouse(&mut self, kind: MouseEventKind, mut at: Position, screen: &mut Screen) {
        let Some(frame) = &screen.layout.map.clone() else { return };
        let drawing = self.editor.is_drawing();
        // A stroke that leaves the map continues along its edge.
        if drawing && matches!(kind, MouseEventKind::Drag(_)) {
            let area = frame.area;
            at.x = at.x.min(area.right().saturating_sub(1)).max(area.left());
            at.y = at.y.min(area.bottom().saturating_sub(1)).max(area.top());
        }
        let cell = frame.cell_at(at, &self.map);
        let dragged_from = self.dragged_from.take();
        if self.is_on_minimap(kind, at, &screen.layout) {
            return;
        }
        let layout = &screen.layout;
        match kind {
            MouseEventKind::Moved => self.hover(cell, screen),
            MouseEventKind::ScrollUp if cell.is_some() => {
                self.zoom(WHEEL_ZOOM_FACTOR, Some(at), layout);
            }
            MouseEventKind::ScrollDown if cell.is_some() => {
                self.zoom(1.0 / WHEEL_ZOOM_FACTOR, Some(at), layout);
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
                self.change_map_or_say(new, ["", refusal.unwrap_or_default()], screen);
            }
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left) => {
                cell.into_iter().for_each(|cell| self.on_click(cell, 'G', screen));
            }
            MouseEventKind::Down(MouseButton::Right) => {
                cell.into_iter().for_each(|cell| self.on_click(cell, '@', screen));
            }
            _ => {}
        }
    }

    fn close(&mut self, screen: &mut Screen) -> bool {
        if self.editor.is_open() {
            self.editor.close();
        } else if self.inspecting.is_some() {
            self.inspect(None, screen);
        } else {
            return false;
        }
        true
    }

    fn drawn(&self, before: ScreenLayout, screen: &mut Screen) {
        match &screen.layout.map {
            Some(frame) if before.map.as_ref() != Some(frame) => {
                let planes = Arc::new(vec![Plane::of_maze(frame.raster)]);
                screen.request(Request::Planes(planes));
            }
            Some(_) => {}
            // The map is hidden behind a maximised pane.
            None => screen.layout.map = before.map,
        }
    }

    fn show(&mut self, view: Arc<View>, screen: &mut Screen) {
        // Follow goals that the walking agent chooses, but none older than the latest request.
        if let (Some(goal), number) = &view.goal
            && screen.on_arrival == OnArrival::Visit
            && *number == screen.goal_request
            && let Some(cell) = cell_of_goal(goal, &self.map)
        {
            self.goal = cell;
        }
        self.view = view;
        self.warn_of_cut_off_goal(screen);
    }
}

/// What keys and the mouse ask for: edits, goals, zooming and panning.
impl MazeState {
    fn edit(&mut self, action: Action, screen: &mut Screen) {
        let map = self.map.clone();
        if matches!(action, Action::ToggleEdit | Action::Tool(_)) {
            screen.banner = Some(Instant::now());
        }
        match action {
            Action::ToggleEdit => self.toggle_edit(screen),
            Action::Tool(tool) => {
                if !self.editor.is_open() {
                    self.toggle_edit(screen);
                }
                self.editor.select_tool(tool);
            }
            Action::Apply => {
                let new = self.editor.apply(&map);
                let refusal = self.editor.tool.refusal();
                self.change_map_or_say(new, ["", refusal.unwrap_or_default()], screen);
            }
            Action::Undo => {
                let new = self.editor.undo();
                self.change_map_or_say(new, ["undone: ", "nothing to undo"], screen);
            }
            Action::Redo => {
                let new = self.editor.redo();
                self.change_map_or_say(new, ["redone: ", "nothing to redo"], screen);
            }
            _ => {}
        }
    }

    fn ask_file(&self, screen: &mut Screen) {
        let stem = self.map.name().trim_end_matches("-edited");
        let name = named(Path::new(""), stem, "-edited.txt").to_string_lossy().into_owned();
        let hint = "NAME.map: Moving AI, without S and G; NAME.txt: plain text";
        screen.open(Prompt::new(Question::SaveMap, "name of the map's file", hint, name));
    }

    fn random_cell(&self, screen: &mut Screen) -> Cell {
        let cells: Vec<Cell> = self.map.free_cells().collect();
        cells[screen.rng.random_range(0..cells.len())]
    }

    /// Puts the goal at `cell`, or at the free cell nearest to it.
    pub fn set_goal(&mut self, cell: Cell, screen: &mut Screen) {
        if let Some(cell) = self.map.nearest_free(cell) {
            screen.return_to_present();
            self.goal = cell;
            let request = Request::Goal(Some(cell.centre().to_vec()), screen.next_goal_request());
            screen.request(request);
        }
    }

    fn inspect(&mut self, cell: Option<Cell>, screen: &mut Screen) {
        self.inspecting = cell;
        screen.request(Request::Inspect(cell.or(self.hovered)));
    }

    pub fn change_map(&mut self, map: Option<Arc<Grid>>, screen: &mut Screen) {
        self.change_map_or_say(map, [""; 2], screen);
    }

    /// Switches to `map`, with a notice that begins with `done`, or says why there is `nothing`.
    pub fn change_map_or_say(
        &mut self,
        map: Option<Arc<Grid>>,
        [done, nothing]: [&'static str; 2],
        screen: &mut Screen,
    ) {
        let Some(map) = map else {
            if !nothing.is_empty() {
                screen.notify(nothing);
            }
            return;
        };
        if !screen.command(EngineCommand::ChangeWorld(maze_on(map.clone()), done)) {
            return;
        }
        self.take_map(map, screen);
    }

    /// Takes the trainer's map, which an edit that was to come has changed.
    pub fn follow(&mut self, screen: &mut Screen) {
        if let Some(scene) = screen.snapshot.scene.maze() {
            self.kept_map = scene.map.clone();
            self.take_map(self.kept_map.clone(), screen);
        }
    }

    fn take_map(&mut self, map: Arc<Grid>, screen: &mut Screen) {
        self.editor.settle(&self.map, &map);
        self.map = map;
        if !self.map.is_free(self.goal) {
            self.set_goal(self.goal, screen);
        }
    }

    fn toggle_edit(&mut self, screen: &mut Screen) {
        if self.editor.is_open() {
            self.editor.close();
        } else {
            self.editor.cursor = Some(self.inspecting.unwrap_or(self.goal));
            self.inspect(None, screen);
        }
    }

    /// Moves the editor's cursor, the inspecting one or the goal, right and down.
    fn move_by(&mut self, by: [isize; 2], screen: &mut Screen) {
        if self.editor.is_open() {
            self.editor.move_cursor(by, &self.map.clone());
        } else if let Some(at) = self.inspecting {
            self.inspect(Some(offset_cell(at, by, &self.map)), screen);
        } else {
            self.move_goal(by, screen);
        }
        self.scroll_into_view(&screen.layout);
    }

    /// Moves the goal to the next free cell in that direction, jumping over walls.
    fn move_goal(&mut self, [dx, dy]: [isize; 2], screen: &mut Screen) {
        let mut at = self.goal;
        loop {
            at = Cell::new(at.x.wrapping_add_signed(dx), at.y.wrapping_add_signed(dy));
            if !self.map.contains(at) {
                return;
            }
            if self.map.is_free(at) {
                return self.set_goal(at, screen);
            }
        }
    }

    /// Warns if no path leads from the walking agent to the goal, once per goal and map.
    fn warn_of_cut_off_goal(&mut self, screen: &mut Screen) {
        let view = &self.view;
        let no_path = view.goal.1 == screen.goal_request && view.reach.shortest.is_none();
        let warned = |(goal, cut_off): &(u64, Arc<Vec<bool>>)| {
            *goal == view.goal.1 && Arc::ptr_eq(cut_off, &view.cut_off)
        };
        if no_path && view.cut_off.contains(&true) && !self.warned_of.as_ref().is_some_and(warned) {
            self.warned_of = Some((view.goal.1, view.cut_off.clone()));
            screen.notify("no path leads from @ to G: walls separate them");
        }
    }

    /// Puts the goal, or @, where the user has clicked, or near it with a notice if that is a wall.
    fn on_click(&mut self, cell: Cell, sign: char, screen: &mut Screen) {
        if sign == '@' {
            place_walker(Some(cell), screen);
        } else {
            (self.hovered, screen.explains) = (None, false);
            if self.goal != cell {
                self.set_goal(cell, screen);
            }
        }
        if let Some(near) = self.map.nearest_free(cell).filter(|near| *near != cell) {
            let (wall, at) = (format!("{},{}", cell.x, cell.y), format!("{},{}", near.x, near.y));
            screen.notify(&format!("{wall} is a wall: {sign} is at the nearest free cell, {at}"));
        }
    }

    fn drag_map(&mut self, from: Position, to: Position, layout: &ScreenLayout) {
        let Some(scale) = layout.map.as_ref().map(MapFrame::scale) else { return };
        let moved = |from: u16, to: u16| f32::from(from) - f32::from(to);
        self.pan_by([moved(from.x, to.x) / scale, 2.0 * moved(from.y, to.y) / scale], layout);
        self.dragged_from = Some(to);
    }

    /// Shows the part of the map clicked on the minimap; returns whether it was clicked.
    fn is_on_minimap(&mut self, kind: MouseEventKind, at: Position, layout: &ScreenLayout) -> bool {
        let Some(minimap) = layout.minimap.as_ref().filter(|minimap| minimap.area.contains(at))
        else {
            return false;
        };
        if matches!(
            kind,
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left)
        ) {
            self.viewport.centre = minimap.middle_of(at);
            self.clamp_viewport(layout);
            return true;
        }
        false
    }

    pub fn hover(&mut self, cell: Option<Cell>, screen: &mut Screen) {
        if self.hovered != cell {
            self.hovered = cell;
            if self.inspecting.is_none() {
                screen.request(Request::Inspect(cell));
            }
        }
    }

    /// Magnifies the map by a factor, keeping the place under `at` (by default the cursor or the
    /// goal) fixed; 0 shows the whole map.
    fn zoom(&mut self, by: f32, at: Option<Position>, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let cursor = self.inspecting.or(self.editor.cursor).unwrap_or(self.goal).centre();
        let fixed = at.map_or(cursor, |at| frame.middle_of(at));
        let at = at.or(frame.character_of(fixed));
        let most = (self.map.width().max(self.map.height()) as f32 / MIN_VISIBLE_CELLS).max(1.0);
        let zoom = (self.viewport.zoom * by).clamp(1.0, most);
        if zoom < 1.01 {
            self.viewport = Viewport::default();
            return;
        }
        // A character is twice as high as wide.
        let scale = frame.scale() * zoom / self.viewport.zoom;
        let pane = layout.map_pane;
        let off = at.map_or([0.0; 2], |at| {
            let from_middle = |at: u16, from: u16, size: u16| {
                f32::from(at) + 0.5 - f32::from(from) - f32::from(size) / 2.0
            };
            let down = from_middle(at.y, pane.y, pane.height.saturating_sub(1));
            [from_middle(at.x, pane.x, pane.width) / scale, 2.0 * down / scale]
        });
        self.viewport = Viewport { zoom, centre: [fixed[0] - off[0], fixed[1] - off[1]] };
    }

    fn pan(&mut self, dx: isize, dy: isize, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let [_, _, width, height] = frame.raster.window;
        self.pan_by([PAN_SHARE * width * dx as f32, PAN_SHARE * height * dy as f32], layout);
    }

    fn pan_by(&mut self, [across, down]: [f32; 2], layout: &ScreenLayout) {
        self.viewport.centre[0] += across;
        self.viewport.centre[1] += down;
        self.clamp_viewport(layout);
    }

    /// Keeps the visible part within the map, so that panning back takes effect at once.
    fn clamp_viewport(&mut self, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let [_, _, width, height] = frame.raster.window;
        let within = |middle: f32, shown: f32, all: f32| {
            middle.min(all - shown / 2.0).max((shown / 2.0).min(all / 2.0))
        };
        let [x, y] = self.viewport.centre;
        let (all_x, all_y) = (self.map.width() as f32, self.map.height() as f32);
        self.viewport.centre =
            [within(x, width.min(all_x), all_x), within(y, height.min(all_y), all_y)];
    }

    /// Moves the visible part, if necessary, to show the cursor or else the goal.
    fn scroll_into_view(&mut self, layout: &ScreenLayout) {
        let Some(frame) = &layout.map else { return };
        let at = self.editor.cursor.or(self.inspecting).unwrap_or(self.goal).centre();
        let [left, top, width, height] = frame.raster.window;
        let inside = at[0] >= left && at[1] >= top && at[0] < left + width && at[1] < top + height;
        if self.viewport.zoom > 1.0 && !inside {
            self.viewport.centre = at;
        }
    }
}

/// Returns a function that builds the maze on `map` with the run's settings and scenario.
pub fn maze_on(map: Arc<Grid>) -> MakeWorld {
    Box::new(|world| {
        Ok(match PointMaze::downcast_ref(world) {
            Some(maze) => Box::new(maze.with_map(map)),
            None => Box::new(PointMaze::new(map, 0)),
        })
    })
}

pub fn place_walker(cell: Option<Cell>, screen: &mut Screen) {
    screen.return_to_present();
    screen.request(Request::Start(cell.map(|cell| cell.centre().to_vec())));
}
