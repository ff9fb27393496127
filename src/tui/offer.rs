//! A saved run that may be resumed instead of the new one.

use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::host::runs;
use gdg::train::Description;

/// How long a saved run is offered.
const OFFER_DURATION: Duration = Duration::from_secs(30);

/// A saved run that is offered for a while.
#[derive(Debug)]
pub struct Offer {
    /// The saved run.
    pub found: Description,
    since: Instant,
}

impl Offer {
    /// Offers a run from now on.
    pub fn new(found: Description) -> Self {
        Self { found, since: Instant::now() }
    }

    /// Returns whether the offer has expired.
    pub fn is_over(&self) -> bool {
        self.since.elapsed() > OFFER_DURATION
    }
}

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
