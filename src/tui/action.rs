//! User actions. Keys, footer, help and command palette all come from this one table.

use super::layers::Overlay;
use super::panes::Pane;
use super::scene::Tool;

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
    /// Restart with another seed.
    NewSeed,
    /// Change a setting.
    Settings,
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
    /// Find an action by name.
    Palette,
    /// Show or hide the help.
    Help,
    /// Close the topmost dialog or mode.
    Close,
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
}

/// What the screen is used for: which bindings are active.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Watching a run.
    Watching,
    /// Editing its map.
    Editing,
    /// Watching a run while a saved one is offered: only the keys that are not those of [`Self::Watching`].
    Offered,
    /// Comparing two runs.
    Comparing,
}

impl Mode {
    /// All modes.
    const ALL: [Self; 4] = [Self::Watching, Self::Editing, Self::Offered, Self::Comparing];
}

impl Action {
    /// Whether it means the same for two runs as for one.
    fn applies_to_two(self) -> bool {
        use Action as A;
        matches!(
            self,
            A::TogglePause
                | A::StepUpdate
                | A::StepEpisode
                | A::Freeze
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
                | A::Marker
                | A::Help
                | A::Close
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
    /// While a saved run is offered: these keys go before those of [`Self::Watching`].
    Offered,
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

const fn bind(
    action: Action,
    name: &'static str,
    keys: &'static [&'static str],
    short: &'static str,
    long: &'static str,
) -> Binding {
    Binding { action, name, when: When::Always, keys, short, long }
}

impl Binding {
    /// Makes the binding active only while the editor is open.
    const fn editing(self) -> Self {
        Self { when: When::Editing, ..self }
    }

    /// Makes the binding active only while a saved run is offered.
    const fn offered(self) -> Self {
        Self { when: When::Offered, ..self }
    }

    /// Makes the binding active only while the editor is closed.
    const fn watching(self) -> Self {
        Self { when: When::Watching, ..self }
    }

    /// Makes the binding active only in comparisons.
    const fn comparing(self) -> Self {
        Self { when: When::Comparing, ..self }
    }

    /// Returns whether its keys are active in `mode`.
    pub fn is_active(&self, mode: Mode) -> bool {
        match (mode, self.when) {
            (Mode::Watching, when) => matches!(when, When::Always | When::Watching),
            (Mode::Editing, when) => matches!(when, When::Always | When::Editing),
            (Mode::Offered, when) => matches!(when, When::Always | When::Offered),
            (Mode::Comparing, When::Comparing) => true,
            (Mode::Comparing, when) => when != When::Editing && self.action.applies_to_two(),
        }
    }

    /// Returns whether it and `other` cannot have the same key.
    pub fn excludes(&self, other: &Self) -> bool {
        Mode::ALL.into_iter().any(|mode| self.is_active(mode) && other.is_active(mode))
    }
}

/// All actions, by section.
pub const SECTIONS: &[Section] = &[
    Section {
        title: "training",
        bindings: &[
            bind(Action::TogglePause, "pause", &["space"], "pause", "pause or resume training"),
            bind(Action::StepUpdate, "step-update", &["."], "", "run one update, then pause"),
            bind(Action::StepEpisode, "step-episode", &[","], "", "train until an episode ends, then pause"),
            bind(Action::Slower, "slower", &["<"], "", "fewer updates per second"),
            bind(Action::Faster, "faster", &[">"], "", "more updates per second"),
            bind(Action::Freeze, "freeze", &["shift-f"], "", "freeze the screen while training continues").watching(),
            bind(Action::NewSeed, "new-seed", &["shift-r"], "", "restart with another seed").watching(),
            bind(Action::Settings, "settings", &["o"], "", "change a setting during training").watching(),
            bind(Action::Method, "method", &[], "", "continue with another method"),
            bind(Action::Preset, "preset", &[], "", "continue with the settings of a preset"),
        ],
    },
    Section {
        title: "goal and agent",
        bindings: &[
            bind(Action::NewGoal, "new-goal", &["n"], "goal", "a random new goal (or click on the map)").watching(),
            bind(Action::Move(-1, 0), "left", &["left", "h"], "", "move the goal or cursor left"),
            bind(Action::Move(0, 1), "down", &["down", "j"], "", "... down"),
            bind(Action::Move(0, -1), "up", &["up", "k"], "", "... up"),
            bind(Action::Move(1, 0), "right", &["right", "l"], "", "... to the right"),
            bind(Action::NewStart, "new-start", &["w"], "", "put @ at a random place (right-click: at that cell)")
                .watching(),
            bind(Action::StartHere, "start-here", &["shift-s"], "", "put @ at the cursor or goal").watching(),
            bind(Action::GoalHere, "goal-here", &["enter"], "", "put the goal at the cursor").watching(),
            bind(Action::OnArrival, "tour", &["t"], "", "when @ arrives: restart, visit other goals, or stay")
                .watching(),
            bind(Action::Follow, "follow", &["f"], "", "follow the next exploring agent").watching(),
        ],
    },
    Section {
        title: "view",
        bindings: &[
            bind(Action::Field(true), "next-field", &["v"], "view", "colour the map by the next quantity").watching(),
            bind(Action::Field(false), "previous-field", &["shift-v"], "", "... by the previous one").watching(),
            bind(Action::Toggle(Overlay::Contours), "contours", &["c"], "", "contour lines, on or off").watching(),
            bind(Action::Toggle(Overlay::Directions), "directions", &["r"], "", "the actor's directions").watching(),
            bind(Action::Toggle(Overlay::Unexplored), "unvisited", &["x"], "", "unvisited cells and their edge")
                .watching(),
            bind(Action::Toggle(Overlay::Agents), "agents", &["a"], "", "exploring agents, trails, frontier goals")
                .watching(),
            bind(Action::Toggle(Overlay::Candidates), "candidates", &["b"], "", "bridge candidates").watching(),
            bind(Action::Toggle(Overlay::Edges), "edges", &["d"], "", "edges of the bridge graph").watching(),
            bind(Action::Toggle(Overlay::Search), "search", &["shift-b"], "", "the latest search for a bridge point")
                .watching(),
            bind(Action::Toggle(Overlay::Path), "path", &["p"], "", "the path planned by @").watching(),
            bind(Action::Inspect, "inspect", &["i"], "", "inspect cells with a cursor").watching(),
            bind(Action::ZoomIn, "zoom-in", &["+", "="], "", "zoom in (or mouse wheel)"),
            bind(Action::ZoomOut, "zoom-out", &["-"], "", "zoom out"),
            bind(Action::ZoomOff, "whole-map", &["0"], "", "show the whole map").watching(),
            bind(Action::Pan(-1, 0), "pan-left", &["shift-left", "alt-left"], "", "pan the map"),
            bind(Action::Pan(1, 0), "pan-right", &["shift-right", "alt-right"], "", ""),
            bind(Action::Pan(0, -1), "pan-up", &["shift-up", "alt-up"], "", ""),
            bind(Action::Pan(0, 1), "pan-down", &["shift-down", "alt-down"], "", ""),
            bind(Action::Projection, "projection", &["shift-p"], "turn", "choose the next projection").watching(),
            bind(Action::Alone, "alone", &["shift-z"], "", "show the chosen projection alone, or all").watching(),
            bind(Action::Marker, "marker", &["m"], "", "half blocks, quadrants or braille").watching(),
            bind(Action::Theme, "theme", &["shift-t"], "", "dark, light, colour-blind-safe, or no colours").watching(),
        ],
    },
    Section {
        title: "panes",
        bindings: &[
            bind(Action::Show(Pane::Training), "training", &["1"], "", "training progress and success").watching(),
            bind(Action::Show(Pane::Curves), "curves", &["2"], "", "curves of success, coverage, losses and errors")
                .watching(),
            bind(Action::Show(Pane::Walk), "walk", &["3"], "", "the followed agent").watching(),
            bind(Action::Show(Pane::Legend), "legend", &["4"], "", "legend of the map").watching(),
            bind(Action::Show(Pane::Log), "log", &["5"], "", "event log").watching(),
            bind(Action::NextPane, "next-pane", &["tab"], "panes", "select the next pane"),
            bind(Action::Maximise, "maximise", &["z"], "", "maximise or restore the pane").watching(),
            bind(Action::Scroll(-1), "scroll-back", &["pageup"], "", "scroll curves and log back"),
            bind(Action::Scroll(1), "scroll-on", &["pagedown"], "", "scroll curves and log forward"),
            bind(Action::LogScale, "log-scale", &["g"], "", "toggle logarithmic curves").watching(),
        ],
    },
    Section {
        title: "map editor",
        bindings: &[
            bind(Action::ToggleEdit, "edit", &["e"], "edit", "open or close the editor"),
            bind(Action::Tool(Tool::Pencil), "pencil", &["1"], "", "draw walls (drag; right-drag: floor)").editing(),
            bind(Action::Tool(Tool::Eraser), "eraser", &["2"], "", "draw floor").editing(),
            bind(Action::Tool(Tool::Line), "line", &["3"], "", "draw a straight wall").editing(),
            bind(Action::Tool(Tool::Rectangle), "rectangle", &["4"], "", "draw walls around a rectangle").editing(),
            bind(Action::Tool(Tool::Fill), "fill", &["5"], "", "fill an area with wall, or a wall with floor")
                .editing(),
            bind(Action::Tool(Tool::Start), "start", &["6"], "", "add or remove a start S").editing(),
            bind(Action::Tool(Tool::Goal), "goal", &["7"], "", "add or remove a goal G").editing(),
            bind(Action::Apply, "apply", &["x", "enter"], "", "use the tool at the cursor; twice for a line").editing(),
            bind(Action::Undo, "undo", &["u"], "", "undo an edit"),
            bind(Action::Redo, "redo", &["ctrl-r"], "", "redo an edit"),
            bind(Action::NewMap, "new-map", &[], "", "create an empty map"),
            bind(Action::ResizeMap, "resize-map", &[], "", "resize the map"),
            bind(Action::SaveMap, "save-map", &["ctrl-w"], "", "write the map to a file"),
            bind(Action::OpenMap, "open-map", &["shift-o"], "", "open another map"),
        ],
    },
    Section {
        title: "files",
        bindings: &[
            bind(Action::Save, "save", &["s"], "save", "save a checkpoint"),
            bind(Action::SaveAs, "save-as", &[], "", "save a checkpoint under a name"),
            bind(Action::Load, "load", &["shift-l"], "", "load a checkpoint").watching(),
            bind(Action::Resume, "resume", &["r"], "", "resume the saved run").offered(),
            bind(Action::Autosave, "autosave", &[], "", "set the autosave interval"),
            bind(Action::Export, "export", &["shift-e"], "", "export map, curves or screen").watching(),
        ],
    },
    Section {
        title: "program",
        bindings: &[
            bind(Action::Palette, "palette", &[":", "ctrl-p"], "all", "find an action by name"),
            bind(Action::Help, "help", &["?", "f1"], "help", "show or hide this help"),
            bind(Action::Close, "close", &["esc"], "", "close the topmost dialog or mode"),
            bind(Action::Suspend, "suspend", &["ctrl-z"], "", "suspend to the shell; fg resumes"),
            bind(Action::Quit, "quit", &["q", "ctrl-c"], "quit", "quit"),
        ],
    },
    Section {
        title: "comparison (gdg-tui compare)",
        bindings: &[
            bind(Action::Axis, "axis", &["g"], "axis", "curves over environment steps, updates or seconds").comparing(),
            bind(Action::NextLarger, "next-larger", &["tab"], "size", "left or right side larger, or both equal")
                .comparing(),
            bind(Action::Larger(0), "left-larger", &["1"], "", "left side larger, or both equal").comparing(),
            bind(Action::Larger(1), "right-larger", &["2"], "", "right side larger, or both equal").comparing(),
        ],
    },
];
