//! Carries out actions on an arm.

use std::sync::Arc;

use super::ArmState;
use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::link::Link;
use crate::tui::panes::Pane;
use crate::tui::projection::{Angle, Camera, Projection, has_room};
use crate::tui::screen::Screen;
use gdg::env::{ArmScene, Scene};
use gdg::viewer::arm::Request;
use gdg::viewer::{ArmView, OnArrival};

/// How far a key moves the goal, in metres.
const NUDGE: f32 = 0.01;

/// How far a key turns the free projection, in rad, and moves the others, as a share of what they
/// show.
const TURN: f32 = 0.15;
const PAN_SHARE: f32 = 0.1;

/// The greatest magnification.
const MAX_ZOOM: f32 = 12.0;

/// Returns whether an action applies to an arm: all but those that need a map.
pub fn offers(action: Action) -> bool {
    !matches!(
        action,
        Action::Inspect
            | Action::GoalHere
            | Action::ToggleEdit
            | Action::Tool(_)
            | Action::Apply
            | Action::Undo
            | Action::Redo
            | Action::SaveMap
            | Action::NewMap
            | Action::ResizeMap
            | Action::Toggle(Overlay::Unexplored | Overlay::Directions)
    )
}

/// Returns the description of an action if its meaning differs from that on a map.
pub fn wording(action: Action) -> Option<&'static str> {
    Some(match action {
        Action::NewGoal => "a random new goal (or click)",
        Action::Move(-1, 0) => "move the goal left by 1 cm, in the chosen projection",
        Action::NewStart => "put @ at a start position of the world (right-click: there)",
        Action::StartHere => "put @ at the goal",
        Action::Field(true) => "colour the plane through G by the next quantity",
        Action::Toggle(Overlay::Agents) => "grips of exploring agents, and their trails",
        Action::Toggle(Overlay::Contours) => "contour lines on that plane, on or off",
        Action::ZoomOff => "show everything",
        Action::Pan(-1, 0) => "turn the free projection (or drag), pan the others",
        Action::Show(Pane::Legend) => "legend of the arm",
        Action::Export => "export arm, curves, screen or film",
        Action::OpenMap => "open a map instead",
        _ => return None,
    })
}

/// Returns the arm's surroundings.
fn arm_scene(screen: &Screen) -> Option<ArmScene> {
    match &screen.snapshot.scene {
        Scene::Arm(scene) => Some(*scene),
        _ => None,
    }
}

impl ArmState {
    /// Shows the arm of another run, with the goal that it was saved with or a random one.
    pub fn start(&mut self, screen: &mut Screen, link: &mut Link) {
        self.shown.camera = Camera::default();
        self.view = Arc::default();
        let run = screen.run();
        let agents = run.settings.train.agents;
        let text = format!("{} on {}, {agents} agents", run.method.name(), screen.snapshot.title);
        screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
        match <[f32; 3]>::try_from(&*screen.snapshot.notes.goal) {
            Ok(saved) => self.set_goal(saved, screen, link),
            Err(_) => self.draw_goal(screen, link),
        }
    }

    /// Sets a random goal.
    fn draw_goal(&mut self, screen: &mut Screen, link: &mut Link) {
        if let Some(scene) = arm_scene(screen) {
            let goal = scene.random_goal(&mut link.rng);
            self.set_goal(goal, screen, link);
        }
    }

    /// Puts the goal at the valid position nearest to `at`.
    pub fn set_goal(&mut self, at: [f32; 3], screen: &mut Screen, link: &mut Link) {
        let Some(scene) = arm_scene(screen) else { return };
        let goal = scene.nearest_goal(at);
        link.return_to_present(screen);
        self.goal = goal;
        let request = Request::Goal(goal, link.next_goal_request());
        link.request(request);
    }

    /// Performs an action that is about the arm.
    pub fn act(&mut self, action: Action, screen: &mut Screen, link: &mut Link) {
        match action {
            Action::NewGoal => self.draw_goal(screen, link),
            Action::Move(dx, dy) => self.nudge([dx as f32, dy as f32], screen, link),
            Action::StartHere => link.request(Request::Start(Some(self.goal))),
            Action::NewStart => link.request(Request::Start(None)),
            Action::Projection => self.shown.angle = self.shown.angle.next(),
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
                self.pan([PAN_SHARE * dx as f32, PAN_SHARE * dy as f32], &screen.layout);
            }
            _ => {}
        }
    }

    /// Moves the goal in the plane of the chosen projection.
    fn nudge(&mut self, [right, down]: [f32; 2], screen: &mut Screen, link: &mut Link) {
        let Some(plane) = self.chosen_projection(&screen.layout).map(|shown| shown.plane) else {
            return;
        };
        let goal = self.goal;
        let moved = std::array::from_fn(|i| {
            goal[i] + NUDGE * (right * plane.across[i] - down * plane.up[i])
        });
        self.set_goal(moved, screen, link);
    }

    /// Returns the chosen projection, if it has been drawn.
    fn chosen_projection<'a>(&self, layout: &'a ScreenLayout) -> Option<&'a Projection> {
        layout.projections.iter().find(|projection| projection.angle == self.shown.angle)
    }

    /// Moves what is shown by a share of the chosen projection's size.
    fn pan(&mut self, [right, down]: [f32; 2], layout: &ScreenLayout) {
        let Some(projection) = self.chosen_projection(layout) else { return };
        let [_, _, width, height] = projection.frame.raster.window;
        let (plane, focus) = (projection.plane, self.shown.camera.focus);
        self.shown.camera.focus = std::array::from_fn(|i| {
            focus[i] + right * width * plane.across[i] - down * height * plane.up[i]
        });
    }

    /// Magnifies by a factor, keeping `fixed` (by default the goal) where it is on the screen.
    pub fn zoom(&mut self, by: f32, fixed: Option<[f32; 3]>) {
        let (before, fixed) = (self.shown.camera.zoom, fixed.unwrap_or(self.goal));
        let camera = &mut self.shown.camera;
        camera.zoom = (before * by).clamp(1.0, MAX_ZOOM);
        if camera.zoom < 1.01 {
            *camera = Camera::default();
            return;
        }
        let share = before / camera.zoom;
        let focus = camera.focus;
        camera.focus = std::array::from_fn(|i| fixed[i] + share * (focus[i] - fixed[i]));
    }

    /// Shows all projections again; returns whether the chosen one was alone.
    pub fn close(&mut self) -> bool {
        std::mem::take(&mut self.shown.alone)
    }

    /// Has the viewer compute D for the pixels of all projections; `before` is the previous layout.
    pub fn drawn(before: ScreenLayout, screen: &mut Screen, link: &Link) {
        let shown = &mut screen.layout.projections;
        if shown.is_empty() {
            // The arm is hidden behind a maximised pane.
            *shown = before.projections;
        } else if *shown != before.projections {
            let planes = shown.iter().map(|projection| projection.plane).collect();
            link.request(Request::Planes(Arc::new(planes)));
        }
    }

    /// Shows a new view.
    pub fn show(&mut self, view: Arc<ArmView>, screen: &Screen, link: &Link) {
        // As in a maze: goals that the walking agent has chosen itself.
        if let (Some(goal), number) = view.goal
            && screen.on_arrival == OnArrival::Visit
            && number == link.goal_request()
        {
            self.goal = goal;
        }
        self.view = view;
    }
}
