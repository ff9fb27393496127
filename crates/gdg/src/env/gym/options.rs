//! Which environment to open, and how.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::text::truncated;

/// Most characters of a name, and of one that is quoted.
const MAX_CHARS: usize = 200;

/// How a Gymnasium environment is called, and the package to import first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Address {
    /// The package, if it is not one of those that are tried.
    pub package: Option<String>,
    /// The environment's ID.
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
    /// Whether worlds of checkpoints are only looked at: no process is started, and their agents
    /// cannot act.
    pub reads_only: bool,
}

impl Default for GymOptions {
    fn default() -> Self {
        Self {
            python: None,
            goal: None,
            goal_radius: None,
            workers: 1,
            timeout: Duration::from_mins(1),
            reads_only: false,
        }
    }
}

impl GymOptions {
    /// Returns the interpreter to start.
    pub fn interpreter(&self) -> PathBuf {
        let active = || {
            let folder = PathBuf::from(std::env::var_os("VIRTUAL_ENV")?);
            let own = if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" };
            Some(folder.join(own)).filter(|python| python.exists())
        };
        self.python.clone().or_else(active).unwrap_or_else(|| "python3".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_package_and_an_id_are_told_apart() {
        let parse = |text: &str| text.parse::<Address>();
        let both = parse("my.own_package:Maze-v0").expect("an address");
        assert_eq!((both.package.as_deref(), &*both.id), (Some("my.own_package"), "Maze-v0"));
        assert_eq!(both.to_string(), "my.own_package:Maze-v0");
        assert_eq!(parse("space/Maze-v0").expect("an address").package, None);
    }

    #[test]
    fn what_is_no_name_is_refused_and_safe_to_show() {
        for (text, wrong) in [
            ("", "is not the ID"),
            ("a b:Maze-v0", "is not the name of a Python package"),
            ("os;x:Maze-v0", "is not the name of a Python package"),
            ("package:", "is not the ID"),
            ("package:two:Maze-v0", "is not the ID"),
            ("mazes.py:Maze-v0", "is named without .py: give gym:mazes:Maze-v0"),
            ("\u{1b}[2J", "is not the ID"),
        ] {
            let error = text.parse::<Address>().expect_err(text);
            assert!(error.contains(wrong) && !error.contains('\u{1b}'), "{text:?}: {error}");
        }
    }
}
