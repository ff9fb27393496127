//! The world of a job.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};

use crate::host::maps::find_map;
use gdg::env::{Environment, PointMaze};
use gdg::map::{Grid, MapScale, Reading, print_ascii, with_start};
use gdg::train::Registry;

/// A world to train in.
#[derive(Clone, Debug)]
pub enum JobWorld {
    /// The maze on a map.
    Maze {
        /// The map, with a start.
        map: Arc<Grid>,
        /// Whether that start was drawn, as the map itself has none.
        start_drawn: bool,
    },
    /// A world that needs no file, by the name of its kind.
    Named(String),
}

impl JobWorld {
    /// Returns the maze on `map`. A map without a start gets one drawn by `seed`.
    pub fn maze(map: &Grid, seed: u64) -> Self {
        Self::Maze {
            start_drawn: map.starts().is_empty(),
            map: Arc::new(with_start(map.clone(), seed)),
        }
    }

    /// Returns the world that `name` opens, as [`JobWorld::maze`] if that is a map.
    ///
    /// # Errors
    /// `name` is neither a world of `registry` nor a map.
    pub fn find(name: &str, seed: u64, registry: &Registry) -> Result<Self, Report> {
        match registry.world_opened_by(name) {
            Some(kind) if kind.create.is_some() || kind.open.is_some() => {
                Ok(Self::Named(name.to_owned()))
            }
            _ => Ok(Self::maze(&find_map(Path::new(name), &Reading::default(), registry)?, seed)),
        }
    }

    /// Returns the name of the map, or of the world.
    pub fn name(&self) -> &str {
        match self {
            Self::Maze { map, .. } => map.name(),
            Self::Named(name) => name,
        }
    }

    /// Returns the map, if there is one.
    pub fn map(&self) -> Option<&Arc<Grid>> {
        match self {
            Self::Maze { map, .. } => Some(map),
            Self::Named(_) => None,
        }
    }

    /// Returns what distinguishes it from other worlds of the same name: the map as text.
    pub fn content(&self) -> String {
        self.map().map_or(String::new(), |map| content(map))
    }

    /// Creates it, without agents.
    ///
    /// # Errors
    /// `registry` has no such world.
    pub fn create(&self, registry: &Registry) -> Result<Box<dyn Environment>, Report> {
        match self {
            Self::Maze { map, .. } => Ok(Box::new(PointMaze::new(map.clone(), 0))),
            Self::Named(name) => match registry.open(name) {
                Some(opened) => opened.into_diagnostic(),
                None => Err(miette!("{name}: this build has no such world")),
            },
        }
    }

    /// Whether `world` is this one.
    pub fn is(&self, world: &dyn Environment) -> bool {
        match self {
            Self::Maze { .. } => PointMaze::downcast_ref(world)
                .is_some_and(|maze| content(maze.map()) == self.content()),
            Self::Named(name) => match name.split_once(':') {
                Some((kind, argument)) => world.kind() == kind && argument.ends_with(world.title()),
                None => world.kind() == name,
            },
        }
    }
}

/// Returns the name of each world, given with its fingerprint. Where names of different worlds are
/// equal, they get what tells all of them apart: `hall (11 x 7)`, `hall (21 x 21)`.
pub fn told_apart(worlds: &[(&str, Option<&str>)]) -> Vec<String> {
    let mut known: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (name, fingerprint) in worlds {
        known.entry(name).or_default().extend(*fingerprint);
    }
    let fact = |fingerprint: &str, i| fingerprint.split(", ").nth(i).map(str::to_owned);
    let named = |(name, fingerprint): &(&str, Option<&str>)| match (&known[name], fingerprint) {
        (all, Some(own)) if all.len() > 1 => {
            let is_own = |i: &usize| {
                let facts: BTreeSet<_> = all.iter().map(|each| fact(each, *i)).collect();
                facts.len() == all.len() && !facts.contains(&None)
            };
            // The last fact is a checksum.
            let own = (0..own.split(", ").count()).find(is_own).and_then(|i| fact(own, i));
            format!("{name} ({})", own.as_deref().or(*fingerprint).unwrap_or_default())
        }
        _ => (*name).to_owned(),
    };
    worlds.iter().map(named).collect()
}

/// Returns a map as text, with its scale unless that is the default.
fn content(map: &Grid) -> String {
    let scale = map.scale();
    let scale = if scale == MapScale::default() { String::new() } else { format!("{scale:?}") };
    print_ascii(map) + &scale
}

#[cfg(test)]
mod tests {
    use super::told_apart;

    #[test]
    fn equal_names_of_different_worlds_get_the_first_fact_that_tells_all_apart() {
        let named = |worlds: &[(&str, &str)]| {
            let known = |(name, own)| (name, Some(own).filter(|own: &&str| !own.is_empty()));
            told_apart(&worlds.iter().copied().map(known).collect::<Vec<_>>()).join("; ")
        };
        let (small, wide) = (("hall", "4 x 2, radius 1, a"), ("hall", "4 x 2, radius 2, b"));
        assert_eq!(named(&[small, ("city", "9 x 9, radius 1, c"), small]), "hall; city; hall");
        assert_eq!(named(&[small, ("hall", "")]), "hall; hall", "older records");
        assert_eq!(named(&[small, wide]), "hall (radius 1); hall (radius 2)");
        let large = ("hall", "9 x 9, radius 1, d");
        assert_eq!(named(&[small, large]), "hall (4 x 2); hall (9 x 9)");
        assert_eq!(named(&[small, wide, large]), "hall (a); hall (b); hall (d)");
    }
}
