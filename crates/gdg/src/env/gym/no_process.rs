//! Workers where there are no Unix sockets: none.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use parking_lot::Mutex;

use super::frames::{Expected, Request};
use crate::env::EnvError;
use crate::pulse::Pulse;

/// A worker, of which there are none.
pub struct Worker {
    title: String,
    pub environments: usize,
    pub is_broken: bool,
}

impl Worker {
    /// # Errors
    /// Always.
    pub fn start(
        _: &Path,
        title: &str,
        _: Duration,
        _: Arc<Mutex<Pulse>>,
    ) -> Result<Self, EnvError> {
        let problem = "environments in Python need Linux, macOS or another Unix".to_owned();
        Err(failed(title, problem, Vec::new()))
    }

    pub fn ask(&mut self, _: Request, _: &[u8], _: Expected) -> Result<Vec<u8>, EnvError> {
        Err(self.fail(String::new()))
    }

    pub fn send(&mut self, _: Request, _: &[u8]) -> Result<(), EnvError> {
        Err(self.fail(String::new()))
    }

    pub fn answer(&mut self, _: Request, _: Expected) -> Result<Vec<u8>, EnvError> {
        Err(self.fail(String::new()))
    }

    pub fn begin_to_end(&mut self) {}

    pub fn forget_output(&mut self) {}

    pub fn fail(&mut self, problem: String) -> EnvError {
        failed(&self.title, problem, Vec::new())
    }
}

/// Returns the error about the environment called `title`.
pub fn failed(title: &str, problem: String, details: Vec<String>) -> EnvError {
    EnvError::Failed { world: title.to_owned(), problem, details }
}
