//! The workers of one environment that no world uses at the moment.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use parking_lot::Mutex;

use super::description::{Description, describe};
use super::facts::{self, Found};
use super::options::{Address, GymOptions};
use super::process::Worker;
use super::{MAX_STATE_BYTES, slots};
use crate::env::EnvError;
use crate::pulse::Pulse;
use crate::store::StoreError;

/// What all worlds of one environment share.
pub struct Pool {
    pub address: Address,
    pub options: GymOptions,
    /// What its workers say of it.
    pub about: Description,
    /// What has been found out.
    pub found: Found,
    /// Length of full states, if the environment is not opened: its agents cannot act.
    pub only_read: Option<usize>,
    /// Says when training is to stop.
    pub pulse: Arc<Mutex<Pulse>>,
    /// What its users should know and have not been told yet.
    pub warnings: Mutex<Vec<String>>,
    /// Whether it has been said that states cannot be saved.
    said_of_states: AtomicBool,
    idle: Mutex<Vec<Worker>>,
}

impl Pool {
    /// Opens an environment and finds out what the learner needs.
    ///
    /// # Errors
    /// It cannot be opened, is not supported, or fails.
    pub fn open(address: &Address, options: &GymOptions) -> Result<Self, EnvError> {
        let pulse = Arc::default();
        let (mut worker, about) = start(address, options, &pulse)?;
        let found = facts::find(&mut worker, &about, options)?;
        found.check(&about)?;
        let pool = Self::new(address, options, (about, found), Some(worker), pulse);
        pool.about.warnings().into_iter().for_each(|warning| pool.warn(&warning));
        Ok(pool)
    }

    /// Opens an environment that has been found out about before.
    ///
    /// # Errors
    /// It cannot be opened, is not supported, or has changed.
    pub fn resume(address: &Address, options: &GymOptions, found: Found) -> Result<Self, EnvError> {
        let pulse = Arc::default();
        let (worker, about) = start(address, options, &pulse)?;
        found.check(&about)?;
        Ok(Self::new(address, options, (about, found), Some(worker), pulse))
    }

    /// Returns what a checkpoint knows of an environment with full states of this length, which is
    /// not opened and has no workers.
    ///
    /// # Errors
    /// What is known makes no sense.
    pub fn only_read(
        address: &Address,
        options: &GymOptions,
        (about, full_state): (Description, usize),
        found: Found,
    ) -> Result<Self, EnvError> {
        if !about.is_sound() || full_state > MAX_STATE_BYTES / 8 {
            let problem = "what it stores of its environment makes no sense";
            return Err(StoreError::inconsistent(problem).into());
        }
        found.check(&about)?;
        let mut pool = Self::new(address, options, (about, found), None, Arc::default());
        pool.only_read = Some(full_state);
        Ok(pool)
    }

    fn new(
        address: &Address,
        options: &GymOptions,
        (about, found): (Description, Found),
        worker: Option<Worker>,
        pulse: Arc<Mutex<Pulse>>,
    ) -> Self {
        let (address, options) = (address.clone(), options.clone());
        let idle = Mutex::new(Vec::from_iter(worker));
        Self {
            address,
            options,
            about,
            found,
            only_read: None,
            pulse,
            warnings: Mutex::default(),
            said_of_states: AtomicBool::new(false),
            idle,
        }
    }

    /// Keeps a warning until it is shown.
    fn warn(&self, warning: &str) {
        log::warn!("{}: {warning}", self.address.id);
        self.warnings.lock().push(format!("warning: {}: {warning}", self.address.id));
    }

    /// Warns, once, that and why states cannot be saved.
    pub fn warn_of_states(&self, why: &str) {
        if !self.said_of_states.swap(true, Ordering::Relaxed) {
            self.warn(&format!("agents begin new episodes on resuming: {why}"));
        }
    }

    /// Returns a worker with at least this number of environments.
    ///
    /// # Errors
    /// None can be started.
    pub fn take(&self, environments: usize) -> Result<Worker, EnvError> {
        let idle = {
            let mut idle = self.idle.lock();
            let enough = idle.iter().position(|worker| worker.environments >= environments);
            let found = enough.or_else(|| idle.len().checked_sub(1));
            found.map(|i| idle.swap_remove(i))
        };
        let mut worker = match idle {
            Some(worker) => worker,
            None => start(&self.address, &self.options, &self.pulse)?.0,
        };
        slots::make(&mut worker, environments)?;
        Ok(worker)
    }

    /// Takes a worker back, unless it has failed.
    pub fn give_back(&self, worker: Worker) {
        if !worker.is_broken {
            self.idle.lock().push(worker);
        }
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
    pulse: &Arc<Mutex<Pulse>>,
) -> Result<(Worker, Description), EnvError> {
    let (python, timeout) = (options.interpreter(), options.timeout);
    let mut worker = Worker::start(&python, &address.id, timeout, pulse.clone())?;
    let about = describe(&mut worker, address.package.as_deref(), &address.id)?;
    worker.forget_output();
    Ok((worker, about))
}
