//! The kinds of worlds that the screen draws: a folder each, with its state, what it draws and how
//! it reacts. This file picks one of them.

mod arm;
mod legend;
pub mod maze;
mod scale;
mod walk;

use crossterm::event::MouseEventKind;
use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::action::{Action, Binding};
use super::app::App;
use super::layers::Overlay;
use super::layout::ScreenLayout;
use super::screen::Screen;
pub use arm::ArmState;
use gdg::bridge::EdgeStatus;
use gdg::env::{Scene, fetch_reach, maze as maze_world};
use gdg::viewer::Field;
pub use maze::{Cache, MazeState, shown_goal};
pub use walk::MEANINGS as WALK_MEANINGS;

/// A kind of world that the screen draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneKind {
    /// A maze, seen from above.
    Maze,
    /// An arm, in projections.
    Arm,
}

impl SceneKind {
    /// Returns the kind that draws `scene`.
    pub fn of(scene: &Scene) -> Self {
        match scene {
            Scene::Arm(_) => Self::Arm,
            Scene::Maze(_) | Scene::Nothing => Self::Maze,
        }
    }

    /// Returns whether worlds of the kind called `name` in checkpoints can be drawn.
    pub fn draws(name: &str) -> bool {
        [maze_world::KIND.name, fetch_reach::KIND.name, fetch_reach::WALL_KIND.name].contains(&name)
    }

    /// Returns what is drawn, in a word.
    pub fn noun(self) -> &'static str {
        match self {
            Self::Maze => "map",
            Self::Arm => "arm",
        }
    }

    /// Returns whether an action makes sense here.
    pub fn offers(self, action: Action) -> bool {
        match self {
            Self::Maze => !matches!(action, Action::Projection | Action::Alone),
            Self::Arm => arm::offers(action),
        }
    }

    /// Returns whether a quantity can be shown by colours here.
    pub fn shows(self, field: Field) -> bool {
        match self {
            Self::Maze => true,
            Self::Arm => {
                matches!(field, Field::Learned | Field::FromStart | Field::Composed | Field::Plain)
            }
        }
    }

    /// Returns the description of a binding for help and palette.
    pub fn wording(self, binding: &Binding) -> &'static str {
        match self {
            Self::Maze => binding.long,
            Self::Arm => arm::wording(binding.action).unwrap_or(binding.long),
        }
    }

    /// Returns the text that begins the help.
    pub fn introduction(self) -> &'static str {
        match self {
            Self::Maze => {
                "Colours show the learned distance D to the goal G: light near, dark far. The agents see no walls and get no \
                 reward. @ walks to G with what it has learned so far; click on the map to set another goal. The editor \
                 draws walls and closes doors."
            }
            Self::Arm => {
                "Colours show the learned distance D to the goal G: light near, dark far. The agents do not see joints and get \
                 no reward. @ reaches for G with what it has learned so far; a click sets the two coordinates that are shown."
            }
        }
    }

    /// Returns the title of the pane about the walking agent.
    pub fn walk_title(self) -> &'static str {
        match self {
            Self::Maze => "walk @ \u{2192} G",
            Self::Arm => "reach @ \u{2192} G",
        }
    }
}

/// Draws the scene into the first area, and the line below it into the second.
pub fn draw(
    frame: &mut Frame,
    areas: [Rect; 2],
    screen: &Screen,
    layout: &mut ScreenLayout,
    cache: &mut Cache,
) {
    match &screen.snapshot.scene {
        Scene::Arm(scene) => arm::draw(frame, areas, scene, screen, layout),
        Scene::Maze(_) | Scene::Nothing => maze::draw(frame, areas, screen, layout, cache),
    }
}

/// The line of the first overlay in the legend.
pub const FIRST_OVERLAY: usize = 2;

/// Returns the overlays that make sense here.
pub fn overlays(screen: &Screen) -> impl Iterator<Item = Overlay> {
    let kind = screen.scene();
    Overlay::ALL.into_iter().filter(move |overlay| kind.offers(Action::Toggle(*overlay)))
}

/// Returns the lines of the legend.
pub fn legend_lines(screen: &Screen) -> Vec<Line<'static>> {
    match screen.scene() {
        SceneKind::Maze => maze::legend_lines(screen),
        SceneKind::Arm => arm::legend_lines(screen),
    }
}

/// Returns the lines about the followed agent.
pub fn walk_lines(screen: &Screen) -> Vec<Line<'static>> {
    match screen.scene() {
        SceneKind::Maze => maze::walk_lines(screen),
        SceneKind::Arm => arm::walk_lines(screen),
    }
}

/// Returns the width and height of what is drawn, in a unit of its own.
pub fn proportions(screen: &Screen) -> (f32, f32) {
    match screen.scene() {
        SceneKind::Maze => (screen.maze.map.width() as f32, screen.maze.map.height() as f32),
        SceneKind::Arm => (1.0, 1.0),
    }
}

/// Returns the number of bridge candidates.
pub fn candidate_count(screen: &Screen) -> usize {
    match screen.scene() {
        SceneKind::Maze => screen.maze.view.candidates.len(),
        SceneKind::Arm => screen.arm.view.candidates.len(),
    }
}

/// Returns the number of edges of the bridge graph with this record.
pub fn edge_count(screen: &Screen, status: EdgeStatus) -> usize {
    match screen.scene() {
        SceneKind::Maze => screen.maze.view.edges.iter().filter(|(_, s)| *s == status).count(),
        SceneKind::Arm => screen.arm.view.edges.iter().filter(|(_, s)| *s == status).count(),
    }
}

impl App {
    /// Begins to show another run.
    pub(super) fn start_scene(&mut self) {
        match self.screen.scene() {
            SceneKind::Maze => self.start_maze(),
            SceneKind::Arm => self.start_arm(),
        }
    }

    /// Returns the goal that is shown in the present, `(goal_dim)`.
    pub(super) fn goal(&self) -> Vec<f32> {
        match self.screen.scene() {
            SceneKind::Maze => self.screen.maze.goal.centre().to_vec(),
            SceneKind::Arm => self.screen.arm.goal.to_vec(),
        }
    }

    /// Performs an action on the scene.
    pub(super) fn act_in_scene(&mut self, action: Action) {
        match self.screen.scene() {
            SceneKind::Maze => self.act_in_maze(action),
            SceneKind::Arm => self.act_on_arm(action),
        }
    }

    /// Handles the mouse on the scene, or where nothing is clickable; returns whether it did
    /// anything.
    pub(super) fn on_mouse_in_scene(&mut self, kind: MouseEventKind, at: Position) -> bool {
        match self.screen.scene() {
            SceneKind::Maze => self.on_mouse_in_maze(kind, at),
            SceneKind::Arm => self.on_mouse_on_arm(kind, at),
        }
    }

    /// Returns to showing everything; returns whether anything changed.
    pub(super) fn close_in_scene(&mut self) -> bool {
        match self.screen.scene() {
            SceneKind::Maze => self.close_in_maze(),
            SceneKind::Arm => self.close_on_arm(),
        }
    }

    /// Handles a drawn frame: has the viewer compute what the pixels show.
    pub(super) fn scene_drawn(&mut self, before: ScreenLayout) {
        match self.screen.scene() {
            SceneKind::Maze => self.maze_drawn(before),
            SceneKind::Arm => self.arm_drawn(before),
        }
    }
}
