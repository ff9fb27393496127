//! The kinds of worlds that the screen draws, mazes and spaces of goals: state, drawing and input.
//! Both are painted on a canvas: `ground` and what lies over it, `overlays`; `legend` has texts that
//! they share.

mod ground;
mod legend;
pub mod maze;
mod overlays;
mod space;

use std::sync::Arc;

use crossterm::event::MouseEventKind;
use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::action::{Action, Binding, Mode};
use super::layers::Overlay;
use super::layout::ScreenLayout;
use super::link::Link;
use super::screen::Screen;
use gdg::engine::Snapshot;
use gdg::env::Scene as World;
use gdg::map::Grid;
use gdg::viewer::{Field, Graph, View};
pub use legend::MEANINGS as WALK_MEANINGS;
pub use maze::{Cache, MazeState};
pub use space::SpaceState;

/// The scene in the main area of the screen.
pub enum Scene {
    /// A maze, seen from above.
    Maze(Box<MazeState>),
    /// An arm, or the space of goals of any other world.
    Space(SpaceState),
}

impl Scene {
    pub fn of(snapshot: &Snapshot) -> Self {
        match &snapshot.scene {
            World::Maze(scene) => Self::Maze(Box::new(MazeState::new(scene.map.clone()))),
            World::Arm(_) | World::Goals(_) => Self::Space(SpaceState::of(snapshot)),
        }
    }

    pub fn maze(&self) -> Option<&MazeState> {
        match self {
            Self::Maze(maze) => Some(maze),
            Self::Space(_) => None,
        }
    }

    pub fn maze_mut(&mut self) -> Option<&mut MazeState> {
        match self {
            Self::Maze(maze) => Some(maze),
            Self::Space(_) => None,
        }
    }
}

/// Names and capabilities.
impl Scene {
    /// Returns the word for what is drawn.
    pub fn noun(&self) -> &'static str {
        match self {
            Self::Maze(_) => maze::NOUN,
            Self::Space(space) => space.noun(),
        }
    }

    /// Returns the word for what other scenes draw.
    pub fn other_noun(&self) -> &'static str {
        match self {
            Self::Maze(_) => "arm",
            Self::Space(_) => maze::NOUN,
        }
    }

    /// Returns the world's title: of a map, its name as last edited.
    pub fn title<'a>(&'a self, snapshot: &'a Snapshot) -> &'a str {
        match self {
            Self::Maze(maze) => maze.map.name(),
            Self::Space(_) => &snapshot.title,
        }
    }

    pub fn offers(&self, action: Action) -> bool {
        match self {
            Self::Maze(_) => maze::offers(action),
            Self::Space(space) => space.offers(action),
        }
    }

    pub fn has_field(&self, field: Field, screen: &Screen) -> bool {
        let shows = match self {
            Self::Maze(_) => true,
            Self::Space(_) => space::shows(field),
        };
        shows && (field != Field::Composed || screen.run().method.plans())
    }

    pub fn has_true_distances(&self) -> bool {
        matches!(self, Self::Maze(_))
    }

    /// Returns the description of a binding for help and palette.
    pub fn wording(&self, binding: &Binding) -> &'static str {
        match self {
            Self::Maze(_) => binding.long,
            Self::Space(space) => space.wording(binding.action).unwrap_or(binding.long),
        }
    }

    pub fn introduction(&self) -> &'static str {
        match self {
            Self::Maze(_) => maze::INTRODUCTION,
            Self::Space(space) => space.introduction(),
        }
    }

    /// Returns the title of the pane about the walking agent.
    pub fn walk_title(&self) -> &'static str {
        match self {
            Self::Maze(_) => "walk @ \u{2192} G",
            Self::Space(_) => "reach @ \u{2192} G",
        }
    }

    /// Returns whether the frame of the film shows D to another goal than the present one.
    pub fn shows_other_goal(&self) -> bool {
        match self {
            Self::Maze(maze) => maze::shown_goal(maze) != maze.goal,
            Self::Space(_) => true,
        }
    }

    /// Returns the largest value of the field, at least 1.
    pub fn own_farthest(&self) -> f32 {
        match self {
            Self::Maze(maze) => maze.own_farthest(),
            Self::Space(space) => space.own_farthest(),
        }
    }

    pub fn mode(&self, screen: &Screen) -> Mode {
        match &screen.tour {
            _ if self.is_editing() => Mode::Editing,
            Some(_) => Mode::Touring,
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

    pub fn is_editing(&self) -> bool {
        self.maze().is_some_and(|maze| maze.editor.is_open())
    }

    pub fn is_drawing(&self) -> bool {
        self.maze().is_some_and(|maze| maze.editor.is_drawing())
    }

    /// Returns whether the map has edits that are in no file.
    pub fn has_unsaved_map(&self) -> bool {
        self.maze().is_some_and(|maze| maze.map != maze.kept_map)
    }

    /// Notes that `map` is in a file now.
    pub fn keep_map(&mut self, map: Arc<Grid>) {
        if let Self::Maze(maze) = self {
            maze.kept_map = map;
        }
    }

    /// Returns the goal that is shown in the present, `(goal_dim)`.
    pub fn goal(&self) -> Vec<f32> {
        match self {
            Self::Maze(maze) => maze.goal.centre().to_vec(),
            Self::Space(space) => space.goal.clone(),
        }
    }

    pub fn graph(&self) -> &Graph {
        match self {
            Self::Maze(maze) => &maze.view.graph,
            Self::Space(space) => &space.view.graph,
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
        match self {
            Self::Maze(maze) => maze::draw(frame, areas, maze, screen, layout, cache),
            Self::Space(space) => space::draw(frame, areas, space, screen, layout),
        }
    }

    pub fn overlays(&self) -> impl Iterator<Item = Overlay> {
        legend::overlays(|action| self.offers(action))
    }

    pub fn legend_lines(&self, screen: &Screen) -> Vec<Line<'static>> {
        match self {
            Self::Maze(maze) => maze::legend_lines(maze, screen),
            Self::Space(space) => space::legend_lines(space, screen),
        }
    }

    /// Returns the lines about the followed agent, with sentences within `width` columns.
    pub fn walk_lines(&self, screen: &Screen, width: usize) -> Vec<Line<'static>> {
        match self {
            Self::Maze(maze) => maze::walk_lines(maze, screen, width),
            Self::Space(space) => space::walk_lines(space, screen),
        }
    }

    /// Returns the width and height of what is drawn, in the scene's own unit.
    pub fn proportions(&self) -> [f32; 2] {
        match self {
            Self::Maze(maze) => [maze.map.width() as f32, maze.map.height() as f32],
            Self::Space(_) => [1.0, 1.0],
        }
    }
}

/// Input.
impl Scene {
    /// Switches to the kind of scene that a run has.
    pub fn enter(&mut self, snapshot: &Snapshot) {
        let stays = match self {
            Self::Maze(_) => matches!(snapshot.scene, World::Maze(_)),
            Self::Space(space) => space.draws(&snapshot.scene),
        };
        if !stays {
            *self = Self::of(snapshot);
        }
    }

    /// Starts showing the run on the screen.
    pub fn start(&mut self, screen: &mut Screen, link: &mut Link) {
        match self {
            Self::Maze(maze) => maze.start(screen, link),
            Self::Space(space) => space.start(screen, link),
        }
    }

    /// Shows a new view, unless it is of an earlier run's scene.
    pub fn show(&mut self, view: View, screen: &mut Screen, link: &Link) {
        match (self, view) {
            (Self::Maze(maze), View::Maze(view)) => maze.show(view, screen, link),
            (Self::Space(space), View::Space(view)) => space.show(view, screen, link),
            _ => {}
        }
    }

    pub fn act(&mut self, action: Action, screen: &mut Screen, link: &mut Link) {
        match self {
            Self::Maze(maze) => maze.act(action, screen, link),
            Self::Space(space) => space.act(action, screen, link),
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
            Self::Space(space) => space.on_mouse(kind, at, screen, link),
        }
    }

    /// Returns to showing everything; returns whether anything changed.
    pub fn close(&mut self, link: &Link) -> bool {
        match self {
            Self::Maze(maze) => maze.close(link),
            Self::Space(space) => space.close(),
        }
    }

    /// Handles a drawn frame: has the viewer compute what the pixels show. `before` is the previous
    /// layout.
    pub fn drawn(&self, before: ScreenLayout, screen: &mut Screen, link: &Link) {
        match self {
            Self::Maze(_) => MazeState::drawn(before, screen, link),
            Self::Space(_) => SpaceState::drawn(before, screen, link),
        }
    }
}
