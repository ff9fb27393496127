//! Worlds without a map: planes in the space of goals. An arm is seen from three sides, and from
//! any other; of other worlds, two components of goals at a time.

mod planes;

use std::sync::Arc;

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::{Drawing, SceneKind};
use crate::tui::action::{Action, Binding};
use crate::tui::choices::{Overlay, Pane};
use crate::tui::layout::ScreenLayout;
use crate::tui::pane_text::{fact, heading};
use crate::tui::screen::Screen;
use crate::tui::viewport::{Angle, Camera, Projection, ShownAngles, has_room};
use gdg::engine::Snapshot;
use gdg::env::{GoalSpace, WorldScene};
use gdg::viewer::{Field, Request, View};
use planes::short;

/// How far a key moves the goal: of an arm in metres, else as a share of what is shown.
const NUDGE: f32 = 0.01;
const NUDGE_SHARE: f32 = 0.02;

/// How far a key turns the free projection, in rad, and moves others, as a share of what they show.
const TURN: f32 = 0.15;
const PAN_SHARE: f32 = 0.1;

/// How far a drag by a character turns the free projection, in rad: around the vertical, and up.
const DRAG_TURN: [f32; 2] = [0.04, 0.08];

/// The greatest magnification, and the zoom factor of one wheel step.
const MAX_ZOOM: f32 = 12.0;
const WHEEL_ZOOM_FACTOR: f32 = 1.25;

/// Margin around the components that are shown, as a share of their range.
const MARGIN: f32 = 0.05;

const MOST_COMPONENTS: usize = 8;

#[derive(Debug, Default)]
pub struct SpaceState {
    pub view: Arc<View>,
    /// The goal that distances are measured to, `(goal_dim)`; empty until there is one.
    pub goal: Vec<f32>,
    is_arm: bool,
    /// Which projections of an arm are shown, and how.
    pub shown: ShownAngles,
    /// Which pair of components of others is shown.
    pair: usize,
    /// The mouse position of a drag, and whether it has turned the free projection.
    dragged_from: Option<Position>,
    turned: bool,
}

fn space(screen: &Screen) -> Option<&GoalSpace> {
    match &screen.snapshot.scene {
        WorldScene::Goals(space) => Some(space),
        _ => None,
    }
}

impl SpaceState {
    pub fn of(snapshot: &Snapshot) -> Self {
        Self { is_arm: matches!(snapshot.scene, WorldScene::Arm(_)), ..Self::default() }
    }

    pub fn draws(&self, scene: &WorldScene) -> bool {
        matches!((self.is_arm, scene), (true, WorldScene::Arm(_)) | (false, WorldScene::Goals(_)))
    }

    /// Returns the components shown, to the right and upwards, for goals of `count` components.
    fn axes(&self, count: usize) -> [usize; 2] {
        let mut pairs = (0..count).flat_map(|up| (0..up).map(move |across| [across, up]));
        let all = (count * count.saturating_sub(1) / 2).max(1);
        pairs.nth(self.pair % all).unwrap_or([0, 0])
    }

    /// Returns the range of a component: that in `space`, and all places known.
    fn range(&self, axis: usize, space: &GoalSpace) -> [f32; 2] {
        let candidates = self.view.graph.candidates.iter().map(|candidate| &candidate.at);
        let places = candidates.chain([&self.goal, &self.view.reach.at]);
        let values = places.filter_map(|place| place.get(axis).copied()).chain(space.range(axis));
        let nothing = [f32::INFINITY, f32::NEG_INFINITY];
        let [low, high] = values.fold(nothing, |[low, high], at| [low.min(at), high.max(at)]);
        let margin = (MARGIN * (high - low)).max(f32::MIN_POSITIVE.sqrt());
        [low - margin, high + margin]
    }

    /// Returns the chosen projection, if it has been drawn.
    fn chosen<'a>(&self, layout: &'a ScreenLayout) -> Option<&'a Projection> {
        let chosen = self.is_arm.then_some(self.shown.angle);
        layout.projections.iter().find(|projection| projection.angle == chosen)
    }
}

impl SpaceState {
    fn draw_goal(&mut self, screen: &mut Screen) {
        if let WorldScene::Arm(arm) = &screen.snapshot.scene {
            let goal = arm.random_goal(&mut screen.rng).to_vec();
            return self.set_goal(goal, screen);
        }
        screen.return_to_present();
        let request = Request::Goal(None, screen.next_goal_request());
        screen.request(request);
    }

    /// Sets the goal: of an arm, to the valid position nearest to it.
    pub fn set_goal(&mut self, goal: Vec<f32>, screen: &mut Screen) {
        screen.return_to_present();
        self.goal = match (&screen.snapshot.scene, <[f32; 3]>::try_from(&*goal)) {
            (WorldScene::Arm(arm), Ok(at)) => arm.nearest_goal(at).to_vec(),
            _ => goal,
        };
        let request = Request::Goal(Some(self.goal.clone()), screen.next_goal_request());
        screen.request(request);
    }

    fn nudge(&mut self, [right, down]: [f32; 2], screen: &mut Screen) {
        let Some(plane) = self.chosen(&screen.layout).map(|shown| &shown.plane) else { return };
        if self.goal.is_empty() {
            return;
        }
        let [_, _, width, height] = plane.raster.window;
        let by = if self.is_arm { NUDGE } else { NUDGE_SHARE * width.min(height) };
        let [x, y] = plane.flat(&self.goal);
        let goal = plane.point([x + by * right, y + by * down], &self.goal);
        self.set_goal(goal, screen);
    }

    /// Moves what is shown, to the right and downwards.
    fn pan(&mut self, projection: &Projection, [right, down]: [f32; 2]) {
        let focus = self.shown.camera.focus;
        let [x, y] = projection.plane.flat(&focus);
        let moved = projection.plane.point([x + right, y + down], &focus);
        self.shown.camera.focus = <[f32; 3]>::try_from(moved).unwrap_or(focus);
    }

    /// Magnifies by a factor, keeping `fixed` (by default the goal) where it is on the screen.
    fn zoom(&mut self, by: f32, fixed: Option<Vec<f32>>) {
        let (before, fixed) = (self.shown.camera.zoom, fixed.unwrap_or_else(|| self.goal.clone()));
        let camera = &mut self.shown.camera;
        camera.zoom = (before * by).clamp(1.0, MAX_ZOOM);
        if camera.zoom < 1.01 {
            *camera = Camera::default();
            return;
        }
        let share = before / camera.zoom;
        for (focus, fixed) in camera.focus.iter_mut().zip(fixed) {
            *focus = fixed + share * (*focus - fixed);
        }
    }
}

impl SceneKind for SpaceState {
    fn noun(&self) -> &'static str {
        if self.is_arm { "arm" } else { "goals" }
    }

    fn introduction(&self) -> &'static str {
        if self.is_arm {
            "Colours show the learned distance D to the goal G: light near, dark far. The agents do \
             not see joints and get no reward. @ reaches for G with what it has learned so far; a \
             click sets the two coordinates that are shown."
        } else {
            "Colours show the learned distance D to the goal G over two components of the space of \
             goals: light near, dark far. The agents get no reward. @ reaches for G with what it \
             has learned so far; a click sets the two components that are shown."
        }
    }

    /// All but those that need a map, and without an arm those
    /// that need to put an agent somewhere, a camera or the past, or that there are other components.
    fn offers(&self, action: Action) -> bool {
        match action {
            Action::Inspect
            | Action::GoalHere
            | Action::ToggleEdit
            | Action::Tool(_)
            | Action::Apply
            | Action::Undo
            | Action::Redo
            | Action::SaveMap
            | Action::Toggle(Overlay::Ghost) => false,
            Action::Toggle(Overlay::Unexplored) => !self.is_arm,
            Action::Projection => self.is_arm || self.goal.len() > 2,
            Action::StartHere
            | Action::ZoomIn
            | Action::ZoomOut
            | Action::ZoomOff
            | Action::Pan(..)
            | Action::Alone
            | Action::Back
            | Action::Forth => self.is_arm,
            _ => true,
        }
    }

    fn wording(&self, binding: &Binding) -> &'static str {
        let both = |arm, other| if self.is_arm { arm } else { other };
        match binding.action {
            Action::NewGoal => "a random new goal (or click)",
            Action::Move(-1, 0) => both(
                "move the goal left by 1 cm, in the chosen projection",
                "move the goal left, in the components shown",
            ),
            Action::NewStart => both(
                "put @ at a start position of the world (right-click: there)",
                "put @ at a start of the world (or right-click)",
            ),
            Action::StartHere => "put @ at the goal",
            Action::Projection if !self.is_arm => "show the next two components of goals",
            Action::Field(true) => both(
                "colour the plane through G by the next quantity",
                "colour the space by the next quantity",
            ),
            Action::Toggle(Overlay::Agents) if self.is_arm => {
                "grips of exploring agents, and their trails"
            }
            Action::Toggle(Overlay::Contours) if self.is_arm => {
                "contour lines on that plane, on or off"
            }
            Action::Toggle(Overlay::Candidates) if !self.is_arm => {
                "bridge candidates: where agents have been"
            }
            Action::ZoomOff => "show everything",
            Action::Pan(-1, 0) => "turn the free projection (or drag), pan the others",
            Action::Show(Pane::Legend) => both("legend of the arm", "legend of the space"),
            Action::Export => both("export arm or curves", "export the space or curves"),
            Action::OpenMap => "open a map instead",
            _ => binding.long,
        }
    }

    fn shows(&self, field: Field) -> bool {
        matches!(field, Field::Learned | Field::FromStart | Field::Composed | Field::Plain)
    }

    fn view(&self) -> &View {
        &self.view
    }

    fn goal(&self) -> Vec<f32> {
        self.goal.clone()
    }

    /// In centimetres for an arm; at most three components.
    fn format_place(&self, at: &[f32]) -> String {
        let format = |value: &f32| {
            if self.is_arm { format!("{:.1}", 100.0 * value) } else { short(*value) }
        };
        let shown: Vec<String> = at.iter().take(3).map(format).collect();
        if at.is_empty() { "-".to_owned() } else { shown.join(", ") }
    }

    fn format_length(&self, length: f32) -> String {
        match length {
            _ if length.is_nan() => "-".to_owned(),
            _ if self.is_arm => format!("{:.1} cm", 100.0 * length),
            _ => short(length),
        }
    }

    fn places(&self, [start, at, goal]: [&[f32]; 3], screen: &Screen) -> Vec<Line<'static>> {
        let Some(space) = space(screen) else {
            return vec![
                heading("x, y, z in cm"),
                fact("from", self.format_place(start)),
                fact("grip @", self.format_place(at)),
                fact("to G", self.format_place(goal)),
            ];
        };
        let mut lines = vec![heading("agent @ \u{2192} goal G")];
        let both = at.iter().zip(goal).enumerate().take(MOST_COMPONENTS);
        lines.extend(both.map(|(i, (at, goal))| {
            fact(&space.name(i), format!("{} \u{2192} {}", short(*at), short(*goal)))
        }));
        if at.len() > MOST_COMPONENTS {
            lines.push(Line::from(format!(" and {} more", at.len() - MOST_COMPONENTS)));
        }
        lines
    }

    fn signs(&self, screen: &Screen) -> Vec<Line<'static>> {
        planes::legend(self, screen)
    }

    fn draw(&self, areas: [Rect; 2], on: Drawing) {
        planes::draw(areas, self, on);
    }

    fn start(&mut self, screen: &mut Screen) {
        *self = Self {
            shown: ShownAngles { camera: Camera::default(), ..self.shown },
            ..Self::of(&screen.snapshot)
        };
        let run = screen.run();
        let agents = run.settings.train.agents;
        let text = format!("{} on {}, {agents} agents", run.method.name(), screen.snapshot.title);
        screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
        let saved = screen.snapshot.notes.goal.clone();
        let count = space(screen).map_or(3, |space| space.spec().goal_dim());
        if saved.len() == count {
            self.set_goal(saved, screen);
        } else {
            self.draw_goal(screen);
        }
    }

    fn act(&mut self, action: Action, screen: &mut Screen) {
        match action {
            Action::NewGoal => self.draw_goal(screen),
            Action::Move(dx, dy) => self.nudge([dx as f32, dy as f32], screen),
            Action::StartHere => screen.request(Request::Start(Some(self.goal.clone()))),
            Action::NewStart => screen.request(Request::Start(None)),
            Action::Projection if self.is_arm => self.shown.angle = self.shown.angle.next(),
            Action::Projection => self.pair += 1,
            Action::Alone if has_room(screen.layout.map_pane) => {
                self.shown.alone = !self.shown.alone;
            }
            Action::Alone => screen.notify("there is only room for one projection"),
            Action::ZoomIn => self.zoom(1.5, None),
            Action::ZoomOut => self.zoom(1.0 / 1.5, None),
            Action::ZoomOff => self.shown.camera = Camera::default(),
            Action::Pan(dx, dy) if self.shown.angle == Angle::Free => {
                self.shown.orbit.turn(TURN * dx as f32, -TURN * dy as f32);
            }
            Action::Pan(dx, dy) => {
                let Some(projection) = self.chosen(&screen.layout) else { return };
                let [_, _, width, height] = projection.frame.raster.window;
                let by = [PAN_SHARE * width * dx as f32, PAN_SHARE * height * dy as f32];
                self.pan(projection, by);
            }
            _ => {}
        }
    }

    fn close(&mut self, _screen: &mut Screen) -> bool {
        std::mem::take(&mut self.shown.alone)
    }

    fn on_mouse(&mut self, kind: MouseEventKind, at: Position, screen: &mut Screen) {
        let shown = &screen.layout.projections;
        let found = shown.iter().find(|projection| projection.frame.area.contains(at)).cloned();
        let from = self.dragged_from.take();
        let is_free = self.is_arm && self.shown.angle == Angle::Free;
        if let (MouseEventKind::Drag(button), Some(from)) = (kind, from) {
            self.dragged_from = Some(at);
            let chosen =
                self.chosen(&screen.layout).cloned().filter(|own| Some(own) == found.as_ref());
            match (button, chosen) {
                (MouseButton::Left, _) if is_free => {
                    let moved = |from: u16, to: u16| f32::from(to) - f32::from(from);
                    let (right, down) = (moved(from.x, at.x), moved(from.y, at.y));
                    self.turned = true;
                    self.shown.orbit.turn(-DRAG_TURN[0] * right, DRAG_TURN[1] * down);
                }
                (MouseButton::Left, Some(projection)) if !self.goal.is_empty() => {
                    self.set_goal(projection.point_at(at, &self.goal), screen);
                }
                (MouseButton::Middle, Some(projection)) => {
                    let [was, now] = [from, at].map(|at| projection.frame.middle_of(at));
                    self.pan(&projection, [was[0] - now[0], was[1] - now[1]]);
                }
                _ => {}
            }
            return;
        }
        let Some(projection) = found.filter(|_| !self.goal.is_empty()) else { return };
        let point = projection.point_at(at, &self.goal);
        match kind {
            MouseEventKind::ScrollUp if self.is_arm => self.zoom(WHEEL_ZOOM_FACTOR, Some(point)),
            MouseEventKind::ScrollDown if self.is_arm => {
                self.zoom(1.0 / WHEEL_ZOOM_FACTOR, Some(point));
            }
            MouseEventKind::Down(button) => {
                self.shown.angle = projection.angle.unwrap_or_default();
                self.turned = false;
                screen.explains = false;
                self.dragged_from = Some(at);
                match button {
                    // There, a drag turns the projection; a click counts on release.
                    MouseButton::Left if projection.angle == Some(Angle::Free) => {}
                    MouseButton::Left => self.set_goal(point, screen),
                    MouseButton::Right => {
                        screen.request(Request::Start(self.is_arm.then_some(point)));
                    }
                    MouseButton::Middle => {}
                }
            }
            MouseEventKind::Up(MouseButton::Left) if is_free && from.is_some() && !self.turned => {
                self.set_goal(point, screen);
            }
            _ => {}
        }
    }

    fn drawn(&self, before: ScreenLayout, screen: &mut Screen) {
        let shown = &mut screen.layout.projections;
        if shown.is_empty() {
            // Hidden behind a maximised pane.
            *shown = before.projections;
        } else if *shown != before.projections {
            let planes = shown.iter().map(|projection| projection.plane.clone()).collect();
            screen.request(Request::Planes(Arc::new(planes)));
        }
    }

    fn show(&mut self, view: Arc<View>, screen: &mut Screen) {
        // Also goals that the viewer has drawn, but none older than the latest request.
        if let (Some(goal), number) = &view.goal
            && *number == screen.goal_request
        {
            self.goal.clone_from(goal);
        }
        self.view = view;
    }
}
