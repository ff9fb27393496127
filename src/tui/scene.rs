//! The kinds of worlds that the screen draws: a folder each, with its state, drawing and input
//! handling. This file dispatches to them.

pub mod arm;
pub mod goals;
mod legend;
pub mod maze;
mod scale;
mod walk;

use crossterm::event::MouseEventKind;
use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::action::{Action, Binding, Mode};
use super::layers::Overlay;
use super::layout::ScreenLayout;
use super::link::Link;
use super::screen::Screen;
pub use arm::ArmState;
use gdg::bridge::EdgeStatus;
use gdg::engine::Snapshot;
use gdg::env::Scene as World;
use gdg::viewer::{Field, View};
pub use goals::GoalsState;
pub use maze::{Cache, MazeState};
pub use walk::MEANINGS as WALK_MEANINGS;

/// The scene in the main area of the screen.
pub enum Scene {
    /// A maze, seen from above.
    Maze(Box<MazeState>),
    /// An arm, in projections.
    Arm(ArmState),
    /// The space of goals of any other world.
    Goals(GoalsState),
}

impl Scene {
    /// Creates the scene of a run.
    pub fn of(snapshot: &Snapshot) -> Self {
        match &snapshot.scene {
            World::Arm(_) => Self::Arm(ArmState::default()),
            World::Maze(scene) => Self::Maze(Box::new(MazeState::new(scene.map.clone()))),
            World::Goals(_) => Self::Goals(GoalsState::default()),
        }
    }

    /// Returns the maze, if it is one.
    pub fn maze(&self) -> Option<&MazeState> {
        match self {
            Self::Maze(maze) => Some(maze),
            Self::Arm(_) | Self::Goals(_) => None,
        }
    }

    /// Returns the maze mutably, if it is one.
    pub fn maze_mut(&mut self) -> Option<&mut MazeState> {
        match self {
            Self::Maze(maze) => Some(maze),
            Self::Arm(_) | Self::Goals(_) => None,
        }
    }
}

/// Names and capabilities.
impl Scene {
    /// Returns the word for what is drawn.
    pub fn noun(&self) -> &'static str {
        match self {
            Self::Maze(_) => maze::NOUN,
            Self::Arm(_) => arm::NOUN,
            Self::Goals(_) => goals::NOUN,
        }
    }

    /// Returns the word for what other scenes draw.
    pub fn other_noun(&self) -> &'static str {
        match self {
            Self::Maze(_) => arm::NOUN,
            Self::Arm(_) | Self::Goals(_) => maze::NOUN,
        }
    }

    /// Returns the world's title: of a map, its name as last edited.
    pub fn title<'a>(&'a self, snapshot: &'a Snapshot) -> &'a str {
        match self {
            Self::Maze(maze) => maze.map.name(),
            Self::Arm(_) | Self::Goals(_) => &snapshot.title,
        }
    }

    /// Returns whether an action applies here.
    pub fn offers(&self, action: Action) -> bool {
        match self {
            Self::Maze(_) => maze::offers(action),
            Self::Arm(_) => arm::offers(action),
            Self::Goals(_) => goals::offers(action),
        }
    }

    /// Returns whether the colours can show `field`.
    pub fn has_field(&self, field: Field, screen: &Screen) -> bool {
        let shows = match self {
            Self::Maze(_) => true,
            Self::Arm(_) => arm::shows(field),
            Self::Goals(_) => goals::shows(field),
        };
        shows && (field != Field::Composed || screen.run().method.plans())
    }

    /// Returns whether true distances are known here.
    pub fn has_true_distances(&self) -> bool {
        matches!(self, Self::Maze(_))
    }

    /// Returns the description of a binding for help and palette.
    pub fn wording(&self, binding: &Binding) -> &'static str {
        match self {
            Self::Maze(_) => binding.long,
            Self::Arm(_) => arm::wording(binding.action).unwrap_or(binding.long),
            Self::Goals(_) => goals::wording(binding.action).unwrap_or(binding.long),
        }
    }

    /// Returns the text that begins the help.
    pub fn introduction(&self) -> &'static str {
        match self {
            Self::Maze(_) => maze::INTRODUCTION,
            Self::Arm(_) => arm::INTRODUCTION,
            Self::Goals(_) => goals::INTRODUCTION,
        }
    }

    /// Returns the title of the pane about the walking agent.
    pub fn walk_title(&self) -> &'static str {
        match self {
            Self::Maze(_) => "walk @ \u{2192} G",
            Self::Arm(_) | Self::Goals(_) => "reach @ \u{2192} G",
        }
    }

    /// Returns whether the frame of the film shows D to another goal than the present one.
    pub fn shows_other_goal(&self) -> bool {
        match self {
            Self::Maze(maze) => maze::shown_goal(maze) != maze.goal,
            Self::Arm(_) | Self::Goals(_) => true,
        }
    }

    /// Returns the largest value of the field, at least 1.
    pub fn own_farthest(&self) -> f32 {
        match self {
            Self::Maze(maze) => maze.own_farthest(),
            Self::Arm(arm) => arm.own_farthest(),
            Self::Goals(goals) => goals.own_farthest(),
        }
    }

    /// Returns the screen's mode.
    pub fn mode(&self, screen: &Screen) -> Mode {
        match screen.offer {
            _ if self.is_editing() => Mode::Editing,
            _ if screen.tour.is_some() => Mode::Touring,
            Some(_) => Mode::Offered,
            None => Mode::Watching,
        }
    }

    /// Describes the phase of training in a word or two.
    pub fn phase(&self, screen: &Screen) -> String {
        // The trainer does not know the latest edit of the map yet: it rebuilds the bridge graph
        // first.
        let is_behind = |maze: &MazeState| match &screen.snapshot.scene {
            World::Maze(scene) => scene.map != maze.map,
            _ => false,
        };
        screen.phase(self.maze().is_some_and(is_behind))
    }

    /// Returns whether the map's editor is open.
    pub fn is_editing(&self) -> bool {
        self.maze().is_some_and(|maze| maze.editor.is_open())
    }

    /// Returns whether a stroke of the editor has begun.
    pub fn is_drawing(&self) -> bool {
        self.maze().is_some_and(|maze| maze.editor.is_drawing())
    }

    /// Returns whether the map has edits that are in no file.
    pub fn has_unsaved_map(&self) -> bool {
        self.maze().is_some_and(|maze| maze.map != maze.kept_map)
    }

    /// Marks the map as saved.
    pub fn keep_map(&mut self) {
        if let Self::Maze(maze) = self {
            maze.kept_map = maze.map.clone();
        }
    }

    /// Returns the goal that is shown in the present, `(goal_dim)`.
    pub fn goal(&self) -> Vec<f32> {
        match self {
            Self::Maze(maze) => maze.goal.centre().to_vec(),
            Self::Arm(arm) => arm.goal.to_vec(),
            Self::Goals(goals) => goals.goal.clone(),
        }
    }

    /// Returns the number of bridge candidates.
    pub fn candidate_count(&self) -> usize {
        match self {
            Self::Maze(maze) => maze.view.candidates.len(),
            Self::Arm(arm) => arm.view.candidates.len(),
            Self::Goals(goals) => goals.view.candidates.len(),
        }
    }

    /// Returns the number of edges of the bridge graph with this record.
    pub fn edge_count(&self, status: EdgeStatus) -> usize {
        match self {
            Self::Maze(maze) => maze.edge_count(status),
            Self::Arm(arm) => arm.edge_count(status),
            Self::Goals(goals) => goals.edge_count(status),
        }
    }
}

/// The line of the first overlay in the legend.
pub const FIRST_OVERLAY: usize = 2;

/// Drawing.
impl Scene {
    /// Draws the scene into the first area, and the line below it into the second.
    pub fn draw(
        &self,
        frame: &mut Frame,
        areas: [Rect; 2],
        screen: &Screen,
        layout: &mut ScreenLayout,
        cache: &mut Cache,
    ) {
        match (self, &screen.snapshot.scene) {
            (Self::Maze(maze), _) => maze::draw(frame, areas, maze, screen, layout, cache),
            (Self::Arm(arm), World::Arm(world)) => {
                arm::draw(frame, areas, world, arm, screen, layout);
            }
            (Self::Goals(state), _) => goals::draw(frame, areas, state, screen, layout),
            // A maze run has begun and replaces the arm from the next frame on.
            (Self::Arm(_), _) => {}
        }
    }

    /// Returns the overlays that are available here.
    pub fn overlays(&self) -> impl Iterator<Item = Overlay> {
        legend::overlays(|action| self.offers(action))
    }

    /// Returns the lines of the legend.
    pub fn legend_lines(&self, screen: &Screen) -> Vec<Line<'static>> {
        match self {
            Self::Maze(maze) => maze::legend_lines(maze, screen),
            Self::Arm(arm) => arm::legend_lines(arm, screen),
            Self::Goals(goals) => goals::legend_lines(goals, screen),
        }
    }

    /// Returns the lines about the followed agent, with sentences within `width` columns.
    pub fn walk_lines(&self, screen: &Screen, width: usize) -> Vec<Line<'static>> {
        match self {
            Self::Maze(maze) => maze::walk_lines(maze, screen, width),
            Self::Arm(arm) => arm::walk_lines(arm, screen),
            Self::Goals(goals) => goals::walk_lines(goals, screen),
        }
    }

    /// Returns the width and height of what is drawn, in the scene's own unit.
    pub fn proportions(&self) -> [f32; 2] {
        match self {
            Self::Maze(maze) => [maze.map.width() as f32, maze.map.height() as f32],
            Self::Arm(_) | Self::Goals(_) => [1.0, 1.0],
        }
    }
}

/// Input.
impl Scene {
    /// Switches to the kind of scene that a run has.
    pub fn enter(&mut self, snapshot: &Snapshot) {
        let stays = match &snapshot.scene {
            World::Arm(_) => matches!(self, Self::Arm(_)),
            World::Maze(_) => matches!(self, Self::Maze(_)),
            World::Goals(_) => matches!(self, Self::Goals(_)),
        };
        if !stays {
            *self = Self::of(snapshot);
        }
    }

    /// Starts showing the run on the screen.
    pub fn start(&mut self, screen: &mut Screen, link: &mut Link) {
        match self {
            Self::Maze(maze) => maze.start(screen, link),
            Self::Arm(arm) => arm.start(screen, link),
            Self::Goals(goals) => goals.start(screen, link),
        }
    }

    /// Shows a new view, unless it is of an earlier run's scene.
    pub fn show(&mut self, view: View, screen: &mut Screen, link: &Link) {
        match (self, view) {
            (Self::Maze(maze), View::Maze(view)) => maze.show(view, screen, link),
            (Self::Arm(arm), View::Arm(view)) => arm.show(view, screen, link),
            (Self::Goals(goals), View::Goals(view)) => goals.show(view, screen, link),
            _ => {}
        }
    }

    /// Performs an action on the scene.
    pub fn act(&mut self, action: Action, screen: &mut Screen, link: &mut Link) {
        match self {
            Self::Maze(maze) => maze.act(action, screen, link),
            Self::Arm(arm) => arm.act(action, screen, link),
            Self::Goals(goals) => goals.act(action, screen, link),
        }
    }

    /// Handles the mouse on the scene, or where nothing is clickable; returns whether it did
    /// anything.
    pub fn on_mouse(
        &mut self,
        kind: MouseEventKind,
        at: Position,
        screen: &mut Screen,
        link: &mut Link,
    ) -> bool {
        match self {
            Self::Maze(maze) => maze.on_mouse(kind, at, screen, link),
            Self::Arm(arm) => arm.on_mouse(kind, at, screen, link),
            Self::Goals(goals) => goals.on_mouse(kind, at, screen, link),
        }
    }

    /// Returns to showing everything; returns whether anything changed.
    pub fn close(&mut self, link: &Link) -> bool {
        match self {
            Self::Maze(maze) => maze.close(link),
            Self::Arm(arm) => arm.close(),
            Self::Goals(_) => false,
        }
    }

    /// Handles a drawn frame: has the viewer compute what the pixels show. `before` is the previous
    /// layout.
    pub fn drawn(&self, before: ScreenLayout, screen: &mut Screen, link: &Link) {
        match self {
            Self::Maze(_) => MazeState::drawn(before, screen, link),
            Self::Arm(_) => ArmState::drawn(before, screen, link),
            Self::Goals(_) => GoalsState::drawn(before, screen, link),
        }
    }
}
