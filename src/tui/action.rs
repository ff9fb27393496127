//! What the user can do. Keys, footer and help all come from this one table.

use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

/// Something the user can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Pause training, or go on.
    TogglePause,
    /// A random goal.
    NewGoal,
    /// Move the goal by one cell: columns to the right, rows down.
    MoveGoal(isize, isize),
    /// A random place for the walking agent.
    NewStart,
    /// Show another distance by colours and contours.
    NextLayer,
    /// Show or hide the bridge candidates.
    ToggleBridges,
    /// Show or hide the exploring agents.
    ToggleAgents,
    /// Open or close the map editor.
    ToggleEdit,
    /// Turn the cell at the editor's cursor from wall to floor or back.
    Paint,
    /// Take the latest edit back.
    Undo,
    /// Make the edit taken back last again.
    Redo,
    /// Save a checkpoint.
    Save,
    /// Show or hide the help.
    ToggleHelp,
    /// Close the help.
    Close,
    /// Leave.
    Quit,
}

/// One line of the table.
pub struct Binding {
    /// What happens.
    pub action: Action,
    /// Keys that do it.
    pub keys: &'static [(KeyCode, KeyModifiers)],
    /// The keys as the user reads them.
    pub shown: &'static str,
    /// One or two words for the footer; empty to leave it out there.
    pub short: &'static str,
    /// A line for the help.
    pub long: &'static str,
}

const NONE: KeyModifiers = KeyModifiers::NONE;

/// Every action.
pub const BINDINGS: &[Binding] = &[
    Binding {
        action: Action::TogglePause,
        keys: &[(KeyCode::Char(' '), NONE)],
        shown: "Space",
        short: "pause",
        long: "pause training, or go on",
    },
    Binding {
        action: Action::NewGoal,
        keys: &[(KeyCode::Char('n'), NONE)],
        shown: "n",
        short: "new goal",
        long: "a random new goal",
    },
    Binding {
        action: Action::MoveGoal(-1, 0),
        keys: &[(KeyCode::Left, NONE), (KeyCode::Char('h'), NONE)],
        shown: "\u{2190}\u{2193}\u{2191}\u{2192}/click",
        short: "goal",
        long: "move the goal (also h j k l, or click on the map)",
    },
    Binding {
        action: Action::MoveGoal(0, 1),
        keys: &[(KeyCode::Down, NONE), (KeyCode::Char('j'), NONE)],
        shown: "",
        short: "",
        long: "",
    },
    Binding {
        action: Action::MoveGoal(0, -1),
        keys: &[(KeyCode::Up, NONE), (KeyCode::Char('k'), NONE)],
        shown: "",
        short: "",
        long: "",
    },
    Binding {
        action: Action::MoveGoal(1, 0),
        keys: &[(KeyCode::Right, NONE), (KeyCode::Char('l'), NONE)],
        shown: "",
        short: "",
        long: "",
    },
    Binding {
        action: Action::NewStart,
        keys: &[(KeyCode::Char('w'), NONE)],
        shown: "w",
        short: "",
        long: "put the walking agent @ somewhere else",
    },
    Binding {
        action: Action::NextLayer,
        keys: &[(KeyCode::Char('v'), NONE)],
        shown: "v",
        short: "view",
        long: "show D as learned, D by the graph, or true steps",
    },
    Binding {
        action: Action::ToggleBridges,
        keys: &[(KeyCode::Char('b'), NONE)],
        shown: "b",
        short: "",
        long: "show or hide the bridge candidates",
    },
    Binding {
        action: Action::ToggleAgents,
        keys: &[(KeyCode::Char('a'), NONE)],
        shown: "a",
        short: "",
        long: "show or hide the exploring agents",
    },
    Binding {
        action: Action::ToggleEdit,
        keys: &[(KeyCode::Char('e'), NONE)],
        shown: "e",
        short: "edit",
        long: "edit the map: drag, right-drag, or arrows and x",
    },
    Binding { action: Action::Paint, keys: &[(KeyCode::Char('x'), NONE)], shown: "x", short: "", long: "" },
    Binding {
        action: Action::Undo,
        keys: &[(KeyCode::Char('u'), NONE)],
        shown: "u",
        short: "",
        long: "undo an edit (Ctrl-R: redo)",
    },
    Binding {
        action: Action::Redo,
        keys: &[(KeyCode::Char('r'), KeyModifiers::CONTROL)],
        shown: "Ctrl-R",
        short: "",
        long: "",
    },
    Binding {
        action: Action::Save,
        keys: &[(KeyCode::Char('s'), NONE)],
        shown: "s",
        short: "",
        long: "save a checkpoint",
    },
    Binding {
        action: Action::ToggleHelp,
        keys: &[(KeyCode::Char('?'), NONE), (KeyCode::F(1), NONE)],
        shown: "?",
        short: "help",
        long: "show or hide this help",
    },
    Binding {
        action: Action::Close,
        keys: &[(KeyCode::Esc, NONE)],
        shown: "Esc",
        short: "",
        long: "close the help or the editor",
    },
    Binding {
        action: Action::Quit,
        keys: &[(KeyCode::Char('q'), NONE), (KeyCode::Char('c'), KeyModifiers::CONTROL)],
        shown: "q",
        short: "quit",
        long: "quit (also Ctrl-C)",
    },
];

/// The action of a key, if it has one. Shift is part of the character already.
pub fn action_of(key: KeyEvent) -> Option<Action> {
    let pressed = (key.code, key.modifiers - KeyModifiers::SHIFT);
    BINDINGS.iter().find(|b| b.keys.contains(&pressed)).map(|b| b.action)
}
