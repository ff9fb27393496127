//! Looks for a saved run that may be resumed instead of the new one.

use std::thread::JoinHandle;

use crate::host::runs;
use gdg::train::Description;

/// The search for a saved run, on its own thread: a folder with many large checkpoints takes a
/// while.
pub type Search = JoinHandle<Option<Description>>;

/// Starts looking for the newest saved run of the world with this title.
///
/// # Errors
/// The thread cannot be started.
pub fn search(title: String) -> std::io::Result<Search> {
    let find = move || runs::newest(std::path::Path::new(runs::SAVES), Some(&title));
    std::thread::Builder::new().name("saved runs".to_owned()).spawn(find)
}
