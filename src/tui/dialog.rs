//! Dialogs on top of the screen: the help, a list to pick from, a question to answer.

mod help;
mod item;
mod picker;
mod prompt;
mod ranking;

pub use help::Help;
pub use item::Item;
pub use picker::{Picker, Row};
pub use prompt::{Prompt, Question};

use std::path::PathBuf;
use std::sync::Arc;

use super::action::Action;
use super::output::ExportKind;
use super::theme::ThemeName;
use gdg::map::{Grid, RandomMapKind};
use gdg::train::{Method, Preset, Run};
use gdg::viewer::Field;

/// A dialog on top of the screen.
#[derive(Debug)]
pub enum Dialog {
    /// The help.
    Help(Help),
    /// A list to pick from.
    Pick(Picker),
    /// A question.
    Ask(Prompt),
}

impl From<Picker> for Dialog {
    fn from(picker: Picker) -> Self {
        Self::Pick(picker)
    }
}

impl From<Prompt> for Dialog {
    fn from(prompt: Prompt) -> Self {
        Self::Ask(prompt)
    }
}

/// What picking an item does.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// Saves the run, then does something else.
    SaveFirst(Box<Choice>),
    /// Continues with another method, preset or settings, without asking what becomes of the
    /// networks.
    Change(Box<Run>),
    /// Performs an action.
    Act(Action),
    /// Asks for a setting's new value.
    Setting(String),
    /// Continues with a method.
    Method(Method),
    /// Continues with a preset's settings.
    Preset(Preset),
    /// Changes the colours.
    Theme(ThemeName),
    /// Lists a folder.
    Folder(PathBuf),
    /// Opens a map file.
    OpenMap(PathBuf),
    /// Opens a built-in map.
    OpenBuiltin(&'static str),
    /// Opens a random map.
    OpenRandom(RandomMapKind),
    /// Asks whether to start a new run in the world called so, which needs no file.
    OpenWorld(&'static str),
    /// Starts a new run in that world.
    StartIn(&'static str),
    /// Starts the run again with another seed.
    Restart(u64),
    /// Colours the map by a quantity.
    Field(Field),
    /// Starts a new run on a map, which may come from a file.
    StartOn(Arc<Grid>, Option<PathBuf>),
    /// Continues with the same networks on another map of the current size, which may come from a
    /// file.
    ContinueOn(Arc<Grid>, Option<PathBuf>),
    /// Loads a checkpoint; asks first if much would be lost.
    Load(PathBuf),
    /// Lays the curves of a checkpoint's run under those of this one.
    LayUnder(PathBuf),
    /// Loads a checkpoint without saving.
    LoadUnsaved(PathBuf),
    /// Starts the guided tour.
    Tour,
    /// Writes an export to a file.
    Export(ExportKind),
    /// Quits, saving first or not.
    Quit {
        /// Whether to save.
        save: bool,
    },
    /// Does nothing.
    Nothing,
}
