//! User actions. Keys, footer, help and command palette all come from this one table.

mod table;

use super::layers::Overlay;
use super::panes::Pane;
use super::tool::Tool;
pub use table::SECTIONS;

/// A user action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Pause or resume training.
    TogglePause,
    /// Run one update, then pause.
    StepUpdate,
    /// Train until an episode ends, then pause.
    StepEpisode,
    /// Fewer updates per second.
    Slower,
    /// More updates per second.
    Faster,
    /// Freeze the screen while training continues, or unfreeze it.
    Freeze,
    /// Evaluate now.
    Evaluate,
    /// Restart with another seed.
    NewSeed,
    /// Change a setting.
    Settings,
    /// Give the selected setting its default.
    ResetSetting,
    /// Continue with another method.
    Method,
    /// Continue with a preset's settings.
    Preset,
    /// Set a random goal.
    NewGoal,
    /// Move the goal or the cursor by one cell, given as (columns to the right, rows down).
    Move(isize, isize),
    /// Put the goal at the cursor.
    GoalHere,
    /// Put the walking agent at the cursor, or else at the goal.
    StartHere,
    /// Put the walking agent at a random place.
    NewStart,
    /// Change what the walking agent does when it arrives.
    OnArrival,
    /// Follow the next exploring agent.
    Follow,
    /// Colour the map by the next (`true`) or the previous field.
    Field(bool),
    /// Show or hide an overlay.
    Toggle(Overlay),
    /// Draw the map with other characters.
    Marker,
    /// Zoom in.
    ZoomIn,
    /// Zoom out.
    ZoomOut,
    /// Show the whole map.
    ZoomOff,
    /// Move the visible part of the map.
    Pan(isize, isize),
    /// Show or hide a cursor that describes its cell.
    Inspect,
    /// Go back in time, to an earlier picture of the film.
    Back,
    /// Go forward in time, to a later picture or to the present.
    Forth,
    /// Choose the next projection of an arm.
    Projection,
    /// Show the chosen projection alone, or all of them.
    Alone,
    /// Change the colours.
    Theme,
    /// Select a pane.
    Show(Pane),
    /// Select the next pane.
    NextPane,
    /// Maximise the selected pane, or restore it.
    Maximise,
    /// Scroll curves and log back or forward.
    Scroll(isize),
    /// Switch curves between linear and logarithmic scales.
    LogScale,
    /// Lay the curves of a saved run under those of this one, or take them away.
    LayUnder,
    /// Open or close the map editor.
    ToggleEdit,
    /// Select an editor tool.
    Tool(Tool),
    /// Use the tool at the cursor.
    Apply,
    /// Undo the latest edit.
    Undo,
    /// Redo the edit undone last.
    Redo,
    /// Write the map to a file.
    SaveMap,
    /// Open another map.
    OpenMap,
    /// Open a random map.
    RandomMap,
    /// Create an empty map.
    NewMap,
    /// Resize the map.
    ResizeMap,
    /// Save a checkpoint.
    Save,
    /// Save a checkpoint under a name.
    SaveAs,
    /// Load a checkpoint.
    Load,
    /// Resume the saved run that is offered.
    Resume,
    /// Set the interval of automatic checkpoints.
    Autosave,
    /// Export the map, the curves or the screen to a file.
    Export,
    /// Export the film as an animation.
    ExportFilm,
    /// Explain how to compare two methods.
    Compare,
    /// Take the guided tour.
    Tour,
    /// Go to the next step of the tour.
    NextTourStep,
    /// End the tour.
    EndTour,
    /// Find an action by name.
    Palette,
    /// Show or hide the help.
    Help,
    /// Search the help.
    SearchHelp,
    /// Close the topmost dialog or mode.
    Close,
    /// Draw the whole screen again.
    Redraw,
    /// Stop the program until the shell resumes it.
    Suspend,
    /// Quit.
    Quit,
    /// Show the other side of a comparison, or both, larger.
    NextLarger,
    /// Show this side of a comparison larger, or both equally large.
    Larger(usize),
    /// Draw a comparison's curves over another quantity.
    Axis,
    /// Something with the runs of a list.
    List(ListAction),
}

/// What can be done with a list of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ListAction {
    /// Mark the selected run, or unmark it.
    Mark,
    /// Type words that runs must have.
    Filter,
    /// Sort by the next column.
    Sort,
    /// Reverse the order.
    Reverse,
    /// Draw curves of the next measure.
    Measure,
    /// Draw curves over the next quantity.
    Axis,
    /// Resume the selected run.
    Resume,
    /// Show what two runs have learned side by side.
    Compare,
    /// Write the curves to files.
    Plot,
    /// Delete the files of runs.
    Delete,
}

/// The mode of the screen, which determines the active bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Watching a run.
    Watching,
    /// Editing its map.
    Editing,
    /// Watching a run while a saved one is offered: the keys added to those of [`Self::Watching`].
    Offered,
    /// Taking the guided tour: the keys added to those of [`Self::Watching`].
    Touring,
    /// Comparing two runs.
    Comparing,
    /// Editing the map of both.
    EditingBoth,
    /// Choosing a setting from the list.
    Settings,
    /// Reading the help.
    Help,
    /// Looking at a list of runs.
    Listing,
}

impl Mode {
    /// All modes.
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
}

impl Action {
    /// Returns whether it is available in a list of runs.
    fn applies_to_lists(self) -> bool {
        use Action as A;
        matches!(self, A::Move(0, _) | A::Help | A::Close | A::Redraw | A::Suspend | A::Quit)
    }

    /// Returns whether it is available in a comparison, for both sides.
    fn applies_to_two(self) -> bool {
        use Action as A;
        matches!(
            self,
            A::TogglePause
                | A::StepUpdate
                | A::StepEpisode
                | A::Freeze
                | A::Evaluate
                | A::NewGoal
                | A::Move(..)
                | A::NewStart
                | A::StartHere
                | A::GoalHere
                | A::OnArrival
                | A::Field(_)
                | A::Toggle(_)
                | A::Inspect
                | A::ZoomIn
                | A::ZoomOut
                | A::ZoomOff
                | A::Pan(..)
                | A::Back
                | A::Forth
                | A::Marker
                | A::ToggleEdit
                | A::Tool(_)
                | A::Apply
                | A::Undo
                | A::Redo
                | A::SaveMap
                | A::Export
                | A::Palette
                | A::Help
                | A::Close
                | A::Redraw
                | A::Suspend
                | A::Quit
        )
    }
}

/// When a binding's keys are active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// Always.
    Always,
    /// While the editor is open.
    Editing,
    /// While the editor is closed.
    Watching,
    /// Only in comparisons.
    Comparing,
    /// While a saved run is offered: these keys take precedence over those of [`Self::Watching`].
    Offered,
    /// During the tour: these keys take precedence over those of [`Self::Watching`].
    Touring,
    /// In the list of settings.
    Settings,
    /// In the help.
    Help,
    /// In a list of runs.
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

/// One entry of the table.
#[derive(Debug)]
pub struct Binding {
    /// The action performed.
    pub action: Action,
    /// Its name in the configuration.
    pub name: &'static str,
    /// When the keys are active.
    pub when: When,
    /// Default keys, which the configuration can replace.
    pub keys: &'static [&'static str],
    /// One word for the footer; empty to omit it there.
    pub short: &'static str,
    /// Description for help and palette.
    pub long: &'static str,
    /// Other words that users may search for.
    pub words: &'static str,
}

/// A group of bindings.
#[derive(Debug)]
pub struct Section {
    /// The group's title.
    pub title: &'static str,
    /// The bindings.
    pub bindings: &'static [Binding],
}

/// Returns all bindings.
pub fn bindings() -> impl Iterator<Item = &'static Binding> {
    SECTIONS.iter().flat_map(|section| section.bindings)
}

impl Binding {
    /// Returns whether its keys are active in `mode`.
    pub fn is_active(&self, mode: Mode) -> bool {
        match (mode, self.when) {
            (Mode::Watching, when) => matches!(when, When::Always | When::Watching),
            (Mode::Editing, when) => matches!(when, When::Always | When::Editing),
            (Mode::Offered, when) => matches!(when, When::Always | When::Offered),
            (Mode::Touring, When::Touring)
            | (Mode::Comparing, When::Comparing)
            | (Mode::Settings, When::Settings)
            | (Mode::Help, When::Help)
            | (Mode::Listing, When::Listing) => true,
            (Mode::Listing, When::Always) => self.action.applies_to_lists(),
            (Mode::Comparing, when) => {
                !matches!(when, When::Editing | When::Touring) && self.action.applies_to_two()
            }
            // Its other keys choose tools.
            (Mode::EditingBoth, When::Comparing) => !matches!(self.action, Action::Larger(_)),
            (Mode::EditingBoth, when) => {
                matches!(when, When::Always | When::Editing) && self.action.applies_to_two()
            }
            (Mode::Touring | Mode::Settings | Mode::Help | Mode::Listing, _) => false,
        }
    }

    /// Returns whether it and `other` must not share a key.
    pub fn excludes(&self, other: &Self) -> bool {
        Mode::ALL.into_iter().any(|mode| self.is_active(mode) && other.is_active(mode))
    }
}
