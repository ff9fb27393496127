//! The kinds of worlds that the screen draws, mazes and spaces of goals: state, drawing and input.
//! Both are painted on a canvas: `ground` and what lies over it, `overlays`; `legend` has their texts.

mod ground;
pub mod legend;
pub mod maze;
mod overlays;
mod space;

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use crossterm::event::MouseEventKind;
use ratatui::Frame;
use ratatui::layout::{Position, Rect};
use ratatui::text::Line;

use super::action::{Action, Binding, Mode};
use super::layout::ScreenLayout;
use super::pane_text::fact;
use super::screen::Screen;
use gdg::engine::Snapshot;
use gdg::env::WorldScene;
use gdg::train::FilmFrame;
use gdg::viewer::{Field, Graph, View};
pub use maze::{Cache, MazeState};
pub use space::SpaceState;

pub enum Scene {
    /// A maze, seen from above.
    Maze(Box<MazeState>),
    /// An arm, or the space of goals of any other world.
    Space(SpaceState),
}

/// What a scene is drawn on: `layout` says where things are then, and `cache` what can stay.
pub struct Drawing<'a, 'b> {
    pub frame: &'a mut Frame<'b>,
    pub screen: &'a Screen,
    pub layout: &'a mut ScreenLayout,
    pub cache: &'a mut Cache,
}

/// How a kind of world is shown. Goals and places are `(goal_dim)`.
pub trait SceneKind {
    fn noun(&self) -> &'static str;

    fn introduction(&self) -> &'static str;

    fn offers(&self, action: Action) -> bool;

    fn wording(&self, binding: &Binding) -> &'static str {
        binding.long
    }

    fn shows(&self, _field: Field) -> bool {
        true
    }

    fn has_true_distances(&self) -> bool {
        false
    }

    /// The width and height of what is drawn, in the scene's own unit.
    fn proportions(&self) -> [f32; 2] {
        [1.0; 2]
    }

    fn view(&self) -> &View;

    fn goal(&self) -> Vec<f32>;

    fn format_place(&self, place: &[f32]) -> String;

    fn format_length(&self, length: f32) -> String;

    fn places(&self, [start, at, goal]: [&[f32]; 3], _screen: &Screen) -> Vec<Line<'static>> {
        vec![
            fact("from", self.format_place(start)),
            fact("at @", self.format_place(at)),
            fact("to G", self.format_place(goal)),
        ]
    }

    fn signs(&self, screen: &Screen) -> Vec<Line<'static>>;

    /// Draws the scene into the first area, and the line below it into the second.
    fn draw(&self, areas: [Rect; 2], on: Drawing);

    fn start(&mut self, screen: &mut Screen);

    fn show(&mut self, view: Arc<View>, screen: &mut Screen);

    fn act(&mut self, action: Action, screen: &mut Screen);

    /// Handles the mouse where nothing is clickable; returns whether it did anything.
    fn on_mouse(&mut self, kind: MouseEventKind, at: Position, screen: &mut Screen);

    /// Returns to showing everything; returns whether anything changed.
    fn close(&mut self, screen: &mut Screen) -> bool;

    /// Has the viewer compute what the pixels show; `before` is the previous layout.
    fn drawn(&self, before: ScreenLayout, screen: &mut Screen);

    /// The frame of the film that is shown: the viewer's latest, to avoid flicker.
    fn past(&self) -> Option<&FilmFrame> {
        self.view().past.as_deref()
    }

    fn shown_goal(&self) -> Vec<f32> {
        self.past().map_or_else(|| self.goal(), |frame| frame.goal.clone())
    }

    /// The field that the colours show: for the past, only D is available.
    fn shown_field(&self, screen: &Screen) -> Field {
        if self.past().is_some() { Field::Learned } else { screen.field }
    }

    /// The largest value of the field, at least 1.
    fn own_farthest(&self) -> f32 {
        self.view().farthest.max(1.0)
    }

    fn farthest(&self, screen: &Screen) -> f32 {
        self.own_farthest().max(screen.least_farthest)
    }
}

impl Deref for Scene {
    type Target = dyn SceneKind;

    fn deref(&self) -> &Self::Target {
        match self {
            Self::Maze(maze) => &**maze,
            Self::Space(space) => space,
        }
    }
}

impl DerefMut for Scene {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            Self::Maze(maze) => &mut **maze,
            Self::Space(space) => space,
        }
    }
}

impl Scene {
    pub fn of(snapshot: &Snapshot) -> Self {
        match &snapshot.scene {
            WorldScene::Maze(scene) => Self::Maze(Box::new(MazeState::new(scene.map.clone()))),
            WorldScene::Arm(_) | WorldScene::Goals(_) => Self::Space(SpaceState::of(snapshot)),
        }
    }

    pub fn enter(&mut self, snapshot: &Snapshot) {
        let stays = match self {
            Self::Maze(_) => matches!(snapshot.scene, WorldScene::Maze(_)),
            Self::Space(space) => space.draws(&snapshot.scene),
        };
        if !stays {
            *self = Self::of(snapshot);
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

    /// Returns the world's title: of a map, its name as last edited.
    pub fn title<'a>(&'a self, snapshot: &'a Snapshot) -> &'a str {
        self.maze().map_or(&snapshot.title, |maze| maze.map.name())
    }

    pub fn has_field(&self, field: Field, screen: &Screen) -> bool {
        self.shows(field) && (field != Field::Composed || screen.run().method.plans())
    }

    pub fn mode(&self, screen: &Screen) -> Mode {
        match &screen.tour {
            _ if self.is_editing() => Mode::Editing,
            Some(_) => Mode::Touring,
            None if screen.elsewhere.is_some() => Mode::Elsewhere,
            None => Mode::Watching,
        }
    }

    pub fn phase(&self, screen: &Screen) -> String {
        // The trainer rebuilds the bridge graph before it knows the latest edit of the map.
        let drawn = screen.snapshot.scene.maze().map(|scene| &scene.map);
        screen.phase(self.maze().is_some_and(|maze| drawn.is_some_and(|map| *map != maze.map)))
    }

    pub fn is_editing(&self) -> bool {
        self.maze().is_some_and(|maze| maze.editor.is_open())
    }

    pub fn is_drawing(&self) -> bool {
        self.maze().is_some_and(|maze| maze.editor.is_drawing())
    }

    pub fn has_unsaved_map(&self) -> bool {
        self.maze().is_some_and(|maze| maze.map != maze.kept_map)
    }

    pub fn graph(&self) -> &Graph {
        &self.view().graph
    }
}
