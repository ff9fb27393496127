//! What can lie on top of the screen: the help, a list to pick from, a question to answer.

pub mod lists;
mod picker;
mod prompt;

pub use picker::{Item, Picker};
pub use prompt::{Prompt, Question};

use std::path::PathBuf;
use std::sync::Arc;

use super::action::Action;
use super::output::What;
use super::theme::ThemeName;
use crate::map::Grid;
use crate::train::{Method, Preset};

/// Something on top of the screen.
#[derive(Debug)]
pub enum Dialog {
    /// The help, and the first line that is shown.
    Help(usize),
    /// A list.
    Pick(Picker),
    /// A question.
    Ask(Prompt),
}

/// What picking an item does.
#[derive(Clone, Debug, PartialEq)]
pub enum Choice {
    /// As the action's key does.
    Act(Action),
    /// Asks for a value of this setting.
    Setting(String),
    /// Goes on with a method.
    Method(Method),
    /// Goes on with a preset's settings.
    Preset(Preset),
    /// Other colours.
    Theme(ThemeName),
    /// Looks into a folder.
    Folder(PathBuf),
    /// Opens a map file.
    OpenMap(PathBuf),
    /// Opens a built-in map.
    OpenBuiltin(&'static str),
    /// A new run on a map of another size.
    BeginOn(Arc<Grid>),
    /// That map cut or filled up to the size of this one, with the same networks.
    GoOnWith(Arc<Grid>),
    /// Loads a checkpoint.
    Load(PathBuf),
    /// Writes a picture or numbers to a file.
    Export(What),
    /// Leaves, saving before or not.
    Quit {
        /// Whether to save.
        save: bool,
    },
    /// Nothing.
    Nothing,
}
