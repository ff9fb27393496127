//! How an environment is opened, and the pool of its idle workers.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use parking_lot::Mutex;
use serde::{Deserialize, Serialize};

use super::Result;
use super::facts::{self, EnvFacts};
use super::worker::{EnvDescription, GymWorker, failed};
use crate::job::Job;
use crate::text::truncated;

/// Most characters of a name, and of one that is quoted.
const MAX_CHARS: usize = 200;

/// How a Gymnasium environment is called, and the package to import first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Address {
    /// The package, if it is not one of those that are tried.
    pub package: Option<String>,
    pub id: String,
}

impl FromStr for Address {
    type Err = String;

    /// Parses `ID` or `PACKAGE:ID`.
    fn from_str(text: &str) -> Result<Self, String> {
        let (package, id) = match text.split_once(':') {
            Some((package, id)) => (Some(package), id),
            None => (None, text),
        };
        let is_name = |part: &str| {
            part.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
                && part.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        };
        if let Some(package) = package.filter(|package| !package.split('.').all(is_name)) {
            return Err(format!(
                "{} is not the name of a Python package: give gym:ID or gym:PACKAGE:ID",
                truncated(package, MAX_CHARS)
            ));
        }
        if let Some(module) = package.and_then(|package| package.strip_suffix(".py")) {
            return Err(format!("a Python module is named without .py: give gym:{module}:{id}"));
        }
        let is_id = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
        if id.is_empty() || id.len() > MAX_CHARS || !id.chars().all(is_id) {
            return Err(format!(
                "{:?} is not the ID of an environment: give gym:ID, as gym:PointMaze_UMaze-v3",
                truncated(id, MAX_CHARS)
            ));
        }
        Ok(Self { package: package.map(str::to_owned), id: id.to_owned() })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let package = self.package.iter().flat_map(|package| [package.as_str(), ":"]);
        package.chain([self.id.as_str()]).try_for_each(|part| f.write_str(part))
    }
}

/// How environments of Gymnasium are run, and what is not found out about them.
#[derive(Clone, Debug, PartialEq)]
pub struct GymOptions {
    /// The interpreter; by default that of the active virtual environment, or else `python3`.
    pub python: Option<PathBuf>,
    /// Components of the observation that are the goal, for environments without `achieved_goal`.
    pub goal: Option<Vec<usize>>,
    /// Distance below which a goal is reached, in the environment's unit.
    pub goal_radius: Option<f32>,
    /// Processes that the environments of the agents are spread over.
    pub workers: usize,
    /// Longest time for any answer.
    pub timeout: Duration,
    /// Whether worlds of checkpoints are only looked at, without a process: their agents cannot act.
    pub reads_only: bool,
}

impl Default for GymOptions {
    fn default() -> Self {
        let timeout = Duration::from_mins(1);
        Self { python: None, goal: None, goal_radius: None, workers: 1, timeout, reads_only: false }
    }
}

impl GymOptions {
    pub fn interpreter(&self) -> PathBuf {
        let active = || {
            let folder = PathBuf::from(std::env::var_os("VIRTUAL_ENV")?);
            let own = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
            Some(folder.join(own)).filter(|python| python.exists())
        };
        self.python.clone().or_else(active).unwrap_or_else(|| "python3".into())
    }
}

/// What all worlds of one environment share.
pub struct Pool {
    pub address: Address,
    pub options: GymOptions,
    /// What its workers say of it.
    pub about: EnvDescription,
    pub job: Arc<Mutex<Job>>,
    /// What its users should know and have not been told yet.
    pub warnings: Mutex<Vec<String>>,
    /// Whether its desired goal moves within episodes.
    pub moves_goal: bool,
    /// Warnings that are given once.
    said: Mutex<Vec<&'static str>>,
    pub idle: Mutex<Vec<GymWorker>>,
}

impl Pool {
    /// Opens an environment. What the learner needs is found out unless a checkpoint has `kept` it;
    /// it is returned beside it.
    pub fn open(
        address: Address,
        options: &GymOptions,
        kept: Option<(EnvFacts, EnvDescription)>,
    ) -> Result<(Self, EnvFacts)> {
        let job = Arc::default();
        let mut worker = start(&address, options, &job)?;
        let about = worker.about.clone();
        let another = |why| failed(&address.id, why, Vec::new());
        let (found, warnings) = if let Some((found, was)) = kept {
            let mut changes = about.changes_since(&was).map_err(another)?;
            found.check(&about)?;
            changes.extend(found.leads_elsewhere(&mut worker)?);
            (found, changes)
        } else {
            let (goal, radius) = (options.goal.as_deref(), options.goal_radius);
            let (found, reached) = facts::find(&mut worker, goal, radius)?;
            let moves =
                "its desired goal moves within episodes: agents head for the one of the reset";
            let moves = worker.moves_goal.then(|| moves.to_owned());
            (found, about.warnings().chain(reached).chain(moves).collect())
        };
        let (mut pool, found) = Self::only_read(address, options, about, found)?;
        (pool.job, pool.moves_goal) = (job, worker.moves_goal);
        pool.idle.lock().push(worker);
        warnings.iter().for_each(|warning| pool.warn(warning));
        Ok((pool, found))
    }

    /// Returns what a checkpoint knows of an environment, which is not opened.
    pub fn only_read(
        address: Address,
        options: &GymOptions,
        about: EnvDescription,
        found: EnvFacts,
    ) -> Result<(Self, EnvFacts)> {
        found.check(&about)?;
        let pool = Self {
            address,
            options: options.clone(),
            about,
            job: Arc::default(),
            warnings: Mutex::default(),
            moves_goal: false,
            said: Mutex::default(),
            idle: Mutex::default(),
        };
        Ok((pool, found))
    }

    /// Keeps a warning until it is shown.
    fn warn(&self, warning: &str) {
        log::warn!("{}: {warning}", self.address.id);
        self.warnings.lock().push(format!("{}: {warning}", self.address.id));
    }

    pub fn warn_once(&self, what: &'static str, why: &str) {
        let mut said = self.said.lock();
        if !said.contains(&what) {
            said.push(what);
            self.warn(&format!("{what}: {why}"));
        }
    }

    /// Returns a worker with at least this number of environments.
    pub fn take(&self, environments: usize) -> Result<GymWorker> {
        let idle = {
            let mut idle = self.idle.lock();
            let enough = idle.iter().position(|worker| worker.environments >= environments);
            enough.or_else(|| idle.len().checked_sub(1)).map(|i| idle.swap_remove(i))
        };
        let new = || {
            let worker = start(&self.address, &self.options, &self.job)?;
            // Walls are those of the first look, whatever a later process says.
            let maze = self.about.maze.clone();
            let about = EnvDescription { maze, ..worker.about.clone() };
            let files = about.changed_files(&self.about);
            let files = files.map(|files| files + " began: put back what was there");
            let why = files.or(about.changes_since(&self.about).err());
            why.map_or(Ok(worker), |why| Err(failed(&self.address.id, why, Vec::new())))
        };
        let mut worker = idle.map_or_else(new, Ok)?;
        worker.make(environments)?;
        Ok(worker)
    }
}

impl Drop for Pool {
    /// Has all workers end at once; each is then waited for.
    fn drop(&mut self) {
        self.idle.get_mut().iter_mut().for_each(GymWorker::begin_to_end);
    }
}

/// Starts a worker and has it open its environment.
fn start(address: &Address, options: &GymOptions, job: &Arc<Mutex<Job>>) -> Result<GymWorker> {
    let (python, timeout) = (options.interpreter(), options.timeout);
    let mut worker = GymWorker::start(&python, &address.id, timeout, job.clone())?;
    worker.open(address.package.as_deref(), &address.id)?;
    Ok(worker)
}
