//! What actions do with an arm.

use std::sync::Arc;

use crate::tui::action::Action;
use crate::tui::app::App;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::panes::Pane;
use crate::tui::projection::{Angle, Camera, Projection, has_room};
use gdg::env::{ArmScene, Scene};
use gdg::viewer::arm::Request;

/// How far a key moves the goal, in metres.
const NUDGE: f32 = 0.01;

/// How far a key turns the free projection, in rad, and moves the others, as a share of what they
/// show.
const TURN: f32 = 0.15;
const PAN_SHARE: f32 = 0.1;

/// The greatest magnification.
const MAX_ZOOM: f32 = 12.0;

/// Returns whether an action makes sense with an arm: what needs a map does not.
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

/// Returns the description of an action where it means something else than on a map.
pub fn wording(action: Action) -> Option<&'static str> {
    Some(match action {
        Action::NewGoal => "a random new goal (or click)",
        Action::Move(-1, 0) => "move the goal left by 1 cm, in the chosen projection",
        Action::NewStart => "put @ at a start of the world's own (right-click: there)",
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

impl App {
    /// Returns what is around the arm.
    fn arm_scene(&self) -> Option<ArmScene> {
        match &self.screen.snapshot.scene {
            Scene::Arm(scene) => Some(*scene),
            _ => None,
        }
    }

    /// Shows the arm of another run, with the goal that it was saved with or a random one.
    pub(in crate::tui) fn start_arm(&mut self) {
        self.screen.arm.shown.camera = Camera::default();
        self.screen.arm.view = Arc::default();
        let run = &self.screen.snapshot.run;
        let agents = run.settings.train.agents;
        let text =
            format!("{} on {}, {agents} agents", run.method.name(), self.screen.snapshot.title);
        self.screen.log.record(&text, self.screen.snapshot.moment());
        match <[f32; 3]>::try_from(&*self.screen.snapshot.notes.goal) {
            Ok(saved) => self.set_arm_goal(saved),
            Err(_) => self.draw_goal(),
        }
    }

    /// Sets a random goal.
    fn draw_goal(&mut self) {
        if let Some(scene) = self.arm_scene() {
            let goal = scene.random_goal(&mut self.rng);
            self.set_arm_goal(goal);
        }
    }

    /// Puts the goal at `at`, or at the place for goals nearest to it.
    pub(in crate::tui) fn set_arm_goal(&mut self, at: [f32; 3]) {
        let Some(scene) = self.arm_scene() else { return };
        let goal = scene.nearest_goal(at);
        self.return_to_present();
        self.screen.arm.goal = goal;
        self.goal_requests += 1;
        self.viewer.request(Request::Goal(goal, self.goal_requests));
    }

    /// Performs an action that is about the arm.
    pub(in crate::tui) fn act_on_arm(&mut self, action: Action) {
        let arm = &mut self.screen.arm;
        match action {
            Action::NewGoal => self.draw_goal(),
            Action::Move(dx, dy) => self.nudge(dx as f32, dy as f32),
            Action::StartHere => {
                let at = arm.goal;
                self.viewer.request(Request::Start(Some(at)));
            }
            Action::NewStart => self.viewer.request(Request::Start(None)),
            Action::Projection => arm.shown.angle = arm.shown.angle.next(),
            Action::Alone if has_room(self.screen.layout.map_pane) => {
                arm.shown.alone = !arm.shown.alone;
            }
            Action::Alone => self.notify("there is only room for one projection"),
            Action::ZoomIn => self.zoom_arm(1.5, None),
            Action::ZoomOut => self.zoom_arm(1.0 / 1.5, None),
            Action::ZoomOff => arm.shown.camera = Camera::default(),
            Action::Pan(dx, dy) if arm.shown.angle == Angle::Free => {
                arm.shown.orbit.turn(TURN * dx as f32, -TURN * dy as f32);
            }
            Action::Pan(dx, dy) => self.pan_arm([PAN_SHARE * dx as f32, PAN_SHARE * dy as f32]),
            _ => {}
        }
    }

    /// Moves the goal in the plane of the chosen projection.
    fn nudge(&mut self, right: f32, down: f32) {
        let Some(plane) = self.chosen_projection().map(|projection| projection.plane) else {
            return;
        };
        let goal = self.screen.arm.goal;
        self.set_arm_goal(std::array::from_fn(|i| {
            goal[i] + NUDGE * (right * plane.across[i] - down * plane.up[i])
        }));
    }

    /// Returns the chosen projection, if it has been drawn.
    fn chosen_projection(&self) -> Option<&Projection> {
        let (shown, angle) = (&self.screen.layout.projections, self.screen.arm.shown.angle);
        shown.iter().find(|projection| projection.angle == angle)
    }

    /// Moves what is shown by a share of the chosen projection's size.
    fn pan_arm(&mut self, [right, down]: [f32; 2]) {
        let Some(projection) = self.chosen_projection() else { return };
        let [_, _, width, height] = projection.frame.raster.window;
        let (plane, focus) = (projection.plane, self.screen.arm.shown.camera.focus);
        self.screen.arm.shown.camera.focus = std::array::from_fn(|i| {
            focus[i] + right * width * plane.across[i] - down * height * plane.up[i]
        });
    }

    /// Magnifies by a factor, keeping `fixed` (by default the goal) where it is on the screen.
    pub(in crate::tui) fn zoom_arm(&mut self, by: f32, fixed: Option<[f32; 3]>) {
        let arm = &mut self.screen.arm;
        let (before, fixed) = (arm.shown.camera.zoom, fixed.unwrap_or(arm.goal));
        arm.shown.camera.zoom = (before * by).clamp(1.0, MAX_ZOOM);
        if arm.shown.camera.zoom < 1.01 {
            arm.shown.camera = Camera::default();
            return;
        }
        let share = before / arm.shown.camera.zoom;
        let focus = arm.shown.camera.focus;
        arm.shown.camera.focus = std::array::from_fn(|i| fixed[i] + share * (focus[i] - fixed[i]));
    }

    /// Shows all projections again; returns whether the chosen one was alone.
    pub(in crate::tui) fn close_on_arm(&mut self) -> bool {
        std::mem::take(&mut self.screen.arm.shown.alone)
    }

    /// Has the viewer compute D for the pixels of all projections.
    pub(in crate::tui) fn arm_drawn(&mut self, before: ScreenLayout) {
        let shown = &mut self.screen.layout.projections;
        if shown.is_empty() {
            // The arm is hidden behind a maximised pane.
            *shown = before.projections;
        } else if *shown != before.projections {
            let planes = shown.iter().map(|projection| projection.plane).collect();
            self.viewer.request(Request::Planes(Arc::new(planes)));
        }
    }
}
