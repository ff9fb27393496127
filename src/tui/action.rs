//! User actions. Keys, footer, help and what an action does all come from one table.

mod table;

use super::compare::Comparison;
use super::session::Session;
use crate::tui::choices::{Overlay, Pane, Tool};
pub use table::SECTIONS;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    TogglePause,
    StepUpdate,
    StepEpisode,
    Slower,
    Faster,
    Evaluate,
    NewSeed,
    Settings,
    Method,
    Preset,
    NewGoal,
    /// Move the goal or the cursor by one cell, given as (columns to the right, rows down).
    Move(isize, isize),
    GoalHere,
    StartHere,
    NewStart,
    OnArrival,
    /// Colour the map by the next (`true`) or the previous field.
    Field(bool),
    Toggle(Overlay),
    Marker,
    ZoomIn,
    ZoomOut,
    ZoomOff,
    Pan(isize, isize),
    Inspect,
    Back,
    Forth,
    Projection,
    Alone,
    Theme,
    Show(Pane),
    NextPane,
    Messages,
    Maximise,
    ToggleEdit,
    Tool(Tool),
    Apply,
    Undo,
    Redo,
    SaveMap,
    OpenMap,
    Save,
    SaveAs,
    TrainCopy,
    Load,
    Export,
    NextTourStep,
    EndTour,
    Help,
    Close,
    Redraw,
    Suspend,
    Quit,
    Axis,
    List(ListAction),
}

/// What can be done with a list of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListAction {
    /// Selects a run by its row, or moves the selection by pages.
    Select(usize),
    Page(isize),
    Mark,
    Filter,
    /// Sorts by the next column, or by the one before.
    Sort(bool),
    Reverse,
    Measure,
    Axis,
    Open,
    Delete,
}

/// What the screen shows, which determines the active bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Watching,
    Editing,
    /// During the tour: the keys added to those of [`Self::Watching`].
    Touring,
    /// The same while another program trains the run.
    Elsewhere,
    Comparing,
    EditingBoth,
    /// In a list of runs.
    Listing,
}

/// What an action does in a comparison.
#[derive(Clone, Copy, Debug)]
pub enum Both {
    /// The same as in a single run, on each side.
    Each,
    /// The same as in a single run, on the side that holds the dialogs.
    First,
    /// Something of its own.
    Own(fn(&mut Comparison, Action)),
    Refused,
}

pub type Keys = &'static [&'static str];

#[derive(Debug)]
pub struct Binding {
    pub action: Action,
    pub name: &'static str,
    /// The mode in which its keys are active; `None` while a run is watched or edited.
    pub when: Option<Mode>,
    pub keys: Keys,
    /// One word for the footer; empty to omit it there.
    pub short: &'static str,
    pub long: &'static str,
    pub words: &'static str,
    pub run: fn(&mut Session, Action),
    pub both: Both,
    /// Whether it shows or changes something that the past does not have: it returns to the present.
    pub is_about_present: bool,
    /// Whether lists of runs have it as well.
    pub is_in_lists: bool,
}

#[derive(Debug)]
pub struct Section {
    pub title: &'static str,
    pub bindings: &'static [Binding],
}

pub fn bindings() -> impl Iterator<Item = &'static Binding> {
    SECTIONS.iter().flat_map(|section| section.bindings)
}

/// Returns the row of an action, the first of several.
pub fn binding_of(action: Action) -> Option<&'static Binding> {
    bindings().find(|binding| binding.action == action)
}

impl Binding {
    /// Returns where its keys are active, for the help; empty if obvious.
    pub fn place(&self) -> &'static str {
        match self.when {
            Some(Mode::Editing) => " (in the editor)",
            Some(Mode::Touring) => " (in the tour)",
            Some(Mode::Elsewhere) => " (gdg-tui watch)",
            _ => "",
        }
    }
}
