//! User actions. Keys, footer, help, command palette and what an action does all come from one table.

mod table;

use super::compare::Comparison;
use super::layers::Overlay;
use super::panes::Pane;
use super::session::Session;
use super::tool::Tool;
pub use table::SECTIONS;

/// A user action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    TogglePause,
    StepUpdate,
    StepEpisode,
    Slower,
    Faster,
    Freeze,
    Evaluate,
    NewSeed,
    Settings,
    ResetSetting,
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
    Maximise,
    Scroll(isize),
    LogScale,
    LayUnder,
    ToggleEdit,
    Tool(Tool),
    Apply,
    Undo,
    Redo,
    SaveMap,
    OpenMap,
    RandomMap,
    NewMap,
    ResizeMap,
    Save,
    SaveAs,
    Load,
    Resume,
    Autosave,
    Export,
    Compare,
    Tour,
    NextTourStep,
    EndTour,
    Palette,
    Help,
    SearchHelp,
    Close,
    Redraw,
    Suspend,
    Quit,
    NextLarger,
    Axis,
    List(ListAction),
}

/// What can be done with a list of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListAction {
    Mark,
    Filter,
    Sort,
    Reverse,
    Measure,
    Axis,
    Resume,
    Compare,
    Delete,
}

/// What the screen shows, which determines the active bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Watching,
    Editing,
    /// While a saved run is offered: the keys added to those of [`Self::Watching`].
    Offered,
    /// During the tour: the keys added to those of [`Self::Watching`].
    Touring,
    Comparing,
    EditingBoth,
    /// In the list of settings.
    Settings,
    Help,
    /// In a list of runs.
    Listing,
}

impl Mode {
    const ALL: [Self; 9] = [
        Self::Watching,
        Self::Editing,
        Self::Offered,
        Self::Touring,
        Self::Comparing,
        Self::EditingBoth,
        Self::Settings,
        Self::Help,
        Self::Listing,
    ];

    /// The modes of comparisons.
    pub const OF_COMPARISONS: [Self; 2] = [Self::Comparing, Self::EditingBoth];
}

/// When a binding's keys are active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    Always,
    /// While the editor is open.
    Editing,
    /// While the editor is closed.
    Watching,
    Comparing,
    /// These keys take precedence over those of [`Self::Watching`].
    Offered,
    /// So do these.
    Touring,
    Settings,
    Help,
    Listing,
}

impl When {
    /// Returns where the keys are active, for the help; empty if obvious.
    pub fn place(self) -> &'static str {
        match self {
            Self::Always | Self::Watching | Self::Comparing | Self::Listing => "",
            Self::Editing => " (in the editor)",
            Self::Offered => " (while it is offered)",
            Self::Touring => " (in the tour)",
            Self::Settings => " (in the list)",
            Self::Help => " (in the help)",
        }
    }
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
    /// Nothing, and why.
    Refused(&'static str),
}

/// An action: its names, its keys, and what it does.
#[derive(Debug)]
pub struct Binding {
    pub action: Action,
    /// Its name in the configuration.
    pub name: &'static str,
    pub when: When,
    /// Default keys, which the configuration can replace.
    pub keys: &'static [&'static str],
    /// One word for the footer; empty to omit it there.
    pub short: &'static str,
    /// Description for help and palette.
    pub long: &'static str,
    /// Other words that users may search for.
    pub words: &'static str,
    /// What it does to a run.
    pub run: fn(&mut Session, Action),
    pub both: Both,
    /// Whether it shows or changes something that the past does not have: it returns to the present.
    pub is_about_present: bool,
    /// Whether lists of runs have it as well.
    pub is_in_lists: bool,
}

/// A group of bindings.
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
    /// Returns whether its keys are active in `mode`.
    pub fn is_active(&self, mode: Mode) -> bool {
        let in_comparisons = !matches!(self.both, Both::Refused(_));
        match (mode, self.when) {
            (Mode::Watching, when) => matches!(when, When::Always | When::Watching),
            (Mode::Editing, when) => matches!(when, When::Always | When::Editing),
            (Mode::Offered, when) => matches!(when, When::Always | When::Offered),
            (Mode::Touring, When::Touring)
            | (Mode::Comparing | Mode::EditingBoth, When::Comparing)
            | (Mode::Settings, When::Settings)
            | (Mode::Help, When::Help)
            | (Mode::Listing, When::Listing) => true,
            (Mode::Listing, When::Always) => self.is_in_lists,
            (Mode::Comparing | Mode::EditingBoth, When::Always)
            | (Mode::Comparing, When::Watching)
            | (Mode::EditingBoth, When::Editing) => in_comparisons,
            _ => false,
        }
    }

    /// Returns whether it and `other` must not share a key.
    pub fn excludes(&self, other: &Self) -> bool {
        Mode::ALL.into_iter().any(|mode| self.is_active(mode) && other.is_active(mode))
    }
}
