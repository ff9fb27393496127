//! The workers of one environment that no world uses at the moment.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use parking_lot::Mutex;

use super::facts::{self, Found};
use super::messages::Description;
use super::options::{Address, GymOptions};
use super::process::Worker;
use crate::env::EnvError;
use crate::job::Job;
use crate::store::StoreError;

/// What all worlds of one environment share.
pub struct Pool {
    pub address: Address,
    pub options: GymOptions,
    /// What its workers say of it.
    pub about: Description,
    /// What has been found out.
    pub found: Found,
    /// Says when training is to stop.
    pub job: Arc<Mutex<Job>>,
    /// What its users should know and have not been told yet.
    pub warnings: Mutex<Vec<String>>,
    /// Whether it has been said that an episode could not be repeated.
    said: AtomicBool,
    idle: Mutex<Vec<Worker>>,
}

impl Pool {
    /// Opens an environment and finds out what the learner needs.
    pub fn open(address: &Address, options: &GymOptions) -> Result<Self, EnvError> {
        let job = Arc::default();
        let (mut worker, about) = start(address, options, &job)?;
        let found = facts::find(&mut worker, &about, options)?;
        let pool = Self::new(address, options, about, found, job)?;
        pool.about.warnings().into_iter().for_each(|warning| pool.warn(&warning));
        pool.idle.lock().push(worker);
        Ok(pool)
    }

    /// Opens an environment that has been found out about before.
    pub fn resume(address: &Address, options: &GymOptions, found: Found) -> Result<Self, EnvError> {
        let job = Arc::default();
        let (worker, about) = start(address, options, &job)?;
        let pool = Self::new(address, options, about, found, job)?;
        pool.idle.lock().push(worker);
        Ok(pool)
    }

    /// Returns what a checkpoint knows of an environment, which is not opened.
    pub fn only_read(
        address: &Address,
        options: &GymOptions,
        about: Description,
        found: Found,
    ) -> Result<Self, EnvError> {
        if !about.is_sound() {
            let problem = "what it stores of its environment makes no sense";
            return Err(StoreError::inconsistent(problem).into());
        }
        Self::new(address, options, about, found, Arc::default())
    }

    fn new(
        address: &Address,
        options: &GymOptions,
        about: Description,
        found: Found,
        job: Arc<Mutex<Job>>,
    ) -> Result<Self, EnvError> {
        found.check(&about)?;
        Ok(Self {
            address: address.clone(),
            options: options.clone(),
            about,
            found,
            job,
            warnings: Mutex::default(),
            said: AtomicBool::new(false),
            idle: Mutex::default(),
        })
    }

    /// Keeps a warning until it is shown.
    fn warn(&self, warning: &str) {
        log::warn!("{}: {warning}", self.address.id);
        self.warnings.lock().push(format!("warning: {}: {warning}", self.address.id));
    }

    /// Warns, once, that an agent begins a new episode, and why.
    pub fn warn_of_new_episode(&self, why: &str) {
        if !self.said.swap(true, Ordering::Relaxed) {
            self.warn(&format!("the agents begin new episodes: {why}"));
        }
    }

    /// Returns a worker with at least this number of environments.
    pub fn take(&self, environments: usize) -> Result<Worker, EnvError> {
        let idle = {
            let mut idle = self.idle.lock();
            let enough = idle.iter().position(|worker| worker.environments >= environments);
            let found = enough.or_else(|| idle.len().checked_sub(1));
            found.map(|i| idle.swap_remove(i))
        };
        let mut worker = idle.map_or_else(|| self.start(), Ok)?;
        worker.make(environments, false)?;
        Ok(worker)
    }

    /// Starts a worker.
    pub fn start(&self) -> Result<Worker, EnvError> {
        Ok(start(&self.address, &self.options, &self.job)?.0)
    }

    /// Takes a worker back.
    pub fn give_back(&self, worker: Worker) {
        self.idle.lock().push(worker);
    }
}

impl Drop for Pool {
    /// Has all workers end at once; each is then waited for.
    fn drop(&mut self) {
        self.idle.get_mut().iter_mut().for_each(Worker::begin_to_end);
    }
}

/// Starts a worker and has it open its environment.
fn start(
    address: &Address,
    options: &GymOptions,
    job: &Arc<Mutex<Job>>,
) -> Result<(Worker, Description), EnvError> {
    let (python, timeout) = (options.interpreter(), options.timeout);
    let mut worker = Worker::start(&python, &address.id, timeout, job.clone())?;
    let about = worker.open(address.package.as_deref(), &address.id)?;
    worker.forget_output();
    Ok((worker, about))
}
