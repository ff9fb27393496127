//! Editing the map of both: one side holds the editor, and the other follows it.

use std::sync::Arc;

use super::Comparison;
use crate::tui::action::{Action, Mode};
use crate::tui::app::time;

impl Comparison {
    /// Returns the mode that decides what keys do.
    pub(super) fn mode(&self) -> Mode {
        if self.is_editing() { Mode::EditingBoth } else { Mode::Comparing }
    }

    /// Returns whether the editor is open.
    pub(super) fn is_editing(&self) -> bool {
        self.sides[self.editor_at].maze().editor.is_open()
    }

    /// Moves the editor to a side, with the edits that it can undo.
    pub(super) fn hold_editor(&mut self, own: usize) {
        if self.editor_at == own {
            return;
        }
        let [a, b] = self.sides.each_mut().map(|side| side.app.scene.maze_mut());
        if let (Some(a), Some(b)) = (a, b) {
            std::mem::swap(&mut a.editor, &mut b.editor);
            self.editor_at = own;
        }
    }

    /// Performs an action of the editor on both.
    pub(super) fn edit(&mut self, action: Action) {
        self.sides[self.editor_at].app.act(action);
        self.share_edit();
    }

    /// Has the other side show the editor, and train on the map of the side that holds it. If its
    /// trainer is too busy, it follows later.
    pub(super) fn share_edit(&mut self) {
        let own = self.editor_at;
        let maze = self.sides[own].maze();
        let (map, editor) = (maze.map.clone(), maze.editor.shown());
        let is_edited = *self.race.map() != map;
        self.lags |= is_edited;
        let lags = self.lags;
        self.lags = self.sides[1 - own].app.in_maze(|maze, screen, link| {
            maze.editor = editor;
            time::leave_past(screen, link);
            if lags {
                maze.change_map(Some(map.clone()), screen, link);
            }
            lags && !Arc::ptr_eq(&maze.map, &map)
        });
        if is_edited {
            self.race.change_map(map);
        }
        self.goal_from(own);
        self.mirror(own);
    }
}
