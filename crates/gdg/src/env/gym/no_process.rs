//! Workers where there are no Unix sockets: none.

use std::convert::Infallible;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use parking_lot::Mutex;

use super::messages::{Expected, Request};
use crate::env::EnvError;
use crate::job::Job;

pub struct Worker {
    pub environments: usize,
    pub is_broken: bool,
    none: Infallible,
}

impl Worker {
    pub fn start(_: &Path, title: &str, _: Duration, _: Arc<Mutex<Job>>) -> Result<Self, EnvError> {
        let problem = "environments in Python need Linux, macOS or another Unix".to_owned();
        Err(failed(title, problem, Vec::new()))
    }

    pub fn ask(&mut self, _: Request, _: &[u8], _: Expected) -> Result<Vec<u8>, EnvError> {
        match self.none {}
    }

    pub fn send(&mut self, _: Request, _: &[u8]) -> Result<(), EnvError> {
        match self.none {}
    }

    pub fn answer(&mut self, _: Request, _: Expected) -> Result<Vec<u8>, EnvError> {
        match self.none {}
    }

    pub fn begin_to_end(&mut self) {
        match self.none {}
    }

    pub fn forget_output(&mut self) {
        match self.none {}
    }

    pub fn fail(&mut self, _: String) -> EnvError {
        match self.none {}
    }
}

pub fn failed(title: &str, problem: String, details: Vec<String>) -> EnvError {
    EnvError::Failed { world: title.to_owned(), problem, details }
}
