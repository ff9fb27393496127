//! Carries out actions and clicks on a space of goals.

use std::sync::Arc;

use crossterm::event::{MouseButton, MouseEventKind};
use ratatui::layout::Position;

use super::{GoalsState, space};
use crate::tui::action::Action;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::link::Link;
use crate::tui::panes::Pane;
use crate::tui::scene::arm;
use crate::tui::screen::Screen;
use gdg::viewer::GoalsView;
use gdg::viewer::goals::Request;

/// How far a key moves the goal, as a share of what is shown.
const NUDGE: f32 = 0.02;

/// Returns whether an action applies to a space of goals: as to an arm, but for those that need to
/// put an agent somewhere, a camera or a film.
pub fn offers(action: Action) -> bool {
    arm::offers(action)
        && !matches!(
            action,
            Action::StartHere
                | Action::ZoomIn
                | Action::ZoomOut
                | Action::ZoomOff
                | Action::Pan(..)
                | Action::Back
                | Action::Forth
                | Action::ExportFilm
        )
}

/// Returns the description of an action if its meaning differs from that on a map.
pub fn wording(action: Action) -> Option<&'static str> {
    Some(match action {
        Action::NewGoal => "a random new goal (or click)",
        Action::Move(-1, 0) => "move the goal left, in the components shown",
        Action::NewStart => "put @ at a start of the world (or right-click)",
        Action::Projection => "show the next two components of goals",
        Action::Alone => "the picture that the world renders, beside it, on or off",
        Action::Field(true) => "colour the space by the next quantity",
        Action::Toggle(Overlay::Candidates) => "bridge candidates: where agents have been",
        Action::Show(Pane::Legend) => "legend of the space",
        Action::Export => "export the space, curves or screen",
        Action::OpenMap => "open a map instead",
        _ => return None,
    })
}

impl GoalsState {
    /// Shows the world of another run, with the goal that it was saved with or a random one.
    pub fn start(&mut self, screen: &mut Screen, link: &mut Link) {
        *self = Self::default();
        let run = screen.run();
        let agents = run.settings.train.agents;
        let text = format!("{} on {}, {agents} agents", run.method.name(), screen.snapshot.title);
        screen.log.record(&text, screen.snapshot.seconds, screen.snapshot.updates());
        let saved = screen.snapshot.notes.goal.clone();
        if space(screen).is_some_and(|space| space.spec().goal_dim() == saved.len()) {
            self.set_goal(saved, screen, link);
        } else {
            draw_goal(screen, link);
        }
    }

    fn set_goal(&mut self, goal: Vec<f32>, screen: &mut Screen, link: &mut Link) {
        link.return_to_present(screen);
        self.goal.clone_from(&goal);
        let request = Request::Goal(Some(goal), link.next_goal_request());
        link.request(request);
    }

    /// Performs an action that is about the space.
    pub fn act(&mut self, action: Action, screen: &mut Screen, link: &mut Link) {
        match action {
            Action::NewGoal => draw_goal(screen, link),
            Action::Move(right, down) => self.nudge([right as f32, down as f32], screen, link),
            Action::NewStart => link.request(Request::Restart),
            Action::Projection => self.show_next_pair(screen),
            Action::Alone => self.has_picture = !self.has_picture,
            _ => {}
        }
    }

    fn show_next_pair(&mut self, screen: &mut Screen) {
        self.pair += 1;
        match space(screen).map(|space| space.spec().goal_dim()) {
            Some(1) => screen.say("goals have only the component that is shown"),
            Some(2) => screen.say("goals have only the two components that are shown"),
            _ => {}
        }
    }

    /// Moves the goal in the components shown.
    fn nudge(&mut self, [right, down]: [f32; 2], screen: &mut Screen, link: &mut Link) {
        let Some(shown) = screen.layout.goals.clone() else { return };
        if self.goal.is_empty() {
            return;
        }
        let [x, y] = shown.slice.flat(&self.goal);
        let [_, _, width, height] = shown.slice.raster.window;
        let by = NUDGE * width.min(height);
        let goal = shown.slice.point([x + by * right, y + by * down], &self.goal);
        self.set_goal(goal, screen, link);
    }

    /// Handles the mouse on the space; returns whether it did anything.
    pub fn on_mouse(
        &mut self,
        kind: MouseEventKind,
        at: Position,
        screen: &mut Screen,
        link: &mut Link,
    ) -> bool {
        let shown = screen.layout.goals.clone();
        let Some(shown) = shown.filter(|shown| shown.frame.area.contains(at)) else { return false };
        match kind {
            MouseEventKind::Down(MouseButton::Left) | MouseEventKind::Drag(MouseButton::Left) => {
                screen.on_first_use();
                if !self.goal.is_empty() {
                    self.set_goal(shown.point_at(at, &self.goal), screen, link);
                }
            }
            MouseEventKind::Down(MouseButton::Right) => link.request(Request::Restart),
            _ => return false,
        }
        true
    }

    /// Has the viewer compute what the pixels shown need; `before` is the previous layout.
    pub fn drawn(before: ScreenLayout, screen: &mut Screen, link: &Link) {
        if before.picture != screen.layout.picture {
            link.request(Request::Picture(screen.layout.picture));
        }
        let shown = &mut screen.layout.goals;
        match shown {
            // Hidden behind a maximised pane.
            None => *shown = before.goals,
            Some(own) if before.goals.as_ref() != Some(own) => {
                link.request(Request::Slice(own.slice));
            }
            Some(_) => {}
        }
    }

    /// Shows a new view.
    pub fn show(&mut self, view: Arc<GoalsView>, screen: &mut Screen, link: &Link) {
        // Also goals that the viewer has drawn, but none older than the latest request.
        if let (Some(goal), number) = &view.goal
            && *number == link.goal_request()
        {
            self.goal.clone_from(goal);
        }
        if let (true, Some(Err(why))) = (self.has_picture, &view.picture) {
            // Nothing but that would be shown in its place.
            self.has_picture = false;
            let why = why.lines().collect::<Vec<_>>().join(" ");
            screen.report(&format!("no picture of the world: {why}"));
        }
        self.view = view;
    }
}

/// Has the viewer draw a goal, as the world draws them.
fn draw_goal(screen: &mut Screen, link: &mut Link) {
    link.return_to_present(screen);
    let request = Request::Goal(None, link.next_goal_request());
    link.request(request);
}
