//! One job: a run in a world, and its result.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::measure::Measured;
use super::plan::{JobData, JobPlan, Length};
pub use crate::headless::records::EvaluationAt;
use crate::setup::find_maps::find_map;
use gdg::env::{Environment, PointMaze};
use gdg::map::{Grid, MapScale, Reading, fingerprint, print_ascii, with_start};
use gdg::text::safe_file_name;
use gdg::train::{Evaluation, History, Method, Moment, Preset, Registry, Run, Trainer};

const NAME_DIGITS: usize = 6;

/// Part of every key. Raise it with any change of what a run learns or measures, so that no folder
/// mixes results of different programs.
const RESULTS_VERSION: u32 = 3;

#[derive(Clone, Debug)]
pub enum JobWorld {
    /// A map, with a start once a seed has drawn one.
    Maze(Arc<Grid>),
    /// A world that needs no file: the name that opens it, and what tells it apart from others of
    /// that name, as other versions of its package.
    Named(String, Option<String>),
}

impl JobWorld {
    /// Returns the maze on `map`. A map without a start gets one drawn by `seed`.
    pub fn maze(map: &Grid, seed: u64) -> Self {
        Self::Maze(Arc::new(with_start(map.clone(), seed)))
    }

    /// Returns it with a start drawn by `seed`, if it has a map without one.
    pub fn with_start(&self, seed: u64) -> Self {
        self.map().map_or_else(|| self.clone(), |map| Self::maze(map, seed))
    }

    /// Opens the world called `name`, if it needs no map.
    pub fn named(name: &str, registry: &Registry) -> Result<Option<Self>, Report> {
        let world = registry.open(name).transpose().into_diagnostic()?;
        Ok(world.map(|world| Self::Named(name.to_owned(), world.fingerprint())))
    }

    pub fn find(name: &str, seed: u64, registry: &Registry) -> Result<Self, Report> {
        let map = || find_map(Path::new(name), &Reading::default(), registry);
        Self::named(name, registry)?.map_or_else(|| Ok(Self::maze(&map()?, seed)), Ok)
    }

    pub fn name(&self) -> &str {
        match self {
            Self::Maze(map) => map.name(),
            Self::Named(name, _) => name,
        }
    }

    pub fn map(&self) -> Option<&Arc<Grid>> {
        match self {
            Self::Maze(map) => Some(map),
            Self::Named(..) => None,
        }
    }

    fn fingerprint(&self) -> Option<String> {
        match self {
            Self::Maze(map) => Some(fingerprint(map)),
            Self::Named(_, fingerprint) => fingerprint.clone(),
        }
    }

    /// Checks that `world`, opened by its name, is still what it was when it was named.
    pub fn check(&self, world: &dyn Environment) -> Result<(), Report> {
        if matches!(self, Self::Maze(_)) || self.fingerprint() == world.fingerprint() {
            return Ok(());
        }
        let help = "run it again: it is a job of another name now";
        Err(miette!(help = help, "{}: has changed since the experiment began", self.name()))
    }

    pub fn create(&self, registry: &Registry) -> Result<Box<dyn Environment>, Report> {
        match self {
            Self::Maze(map) => Ok(Box::new(PointMaze::new(map.clone(), 0))),
            Self::Named(name, _) => match registry.open(name) {
                Some(opened) => opened.into_diagnostic(),
                None => Err(miette!("{name}: this build has no such world")),
            },
        }
    }

    fn is(&self, world: &dyn Environment) -> bool {
        match self {
            Self::Maze(map) => PointMaze::downcast_ref(world)
                .is_some_and(|maze| content(maze.map()) == content(map)),
            Self::Named(name, _) => match name.split_once(':') {
                Some((kind, argument)) => world.kind() == kind && argument.ends_with(world.title()),
                None => world.kind() == name,
            },
        }
    }
}

/// Returns a map as text, with its scale unless that is the default.
fn content(map: &Grid) -> String {
    let scale = map.scale();
    let scale = if scale == MapScale::default() { String::new() } else { format!("{scale:?}") };
    print_ascii(map) + &scale
}

#[derive(Clone, Debug)]
pub struct JobSpec {
    /// The world's name, the label if any (method and variant), the seed and the beginning of the
    /// key.
    pub name: String,
    /// Checksum of everything that the result depends on, in hexadecimal digits.
    pub key: String,
    /// Name of the variant, if its settings have one. The result does not depend on it.
    pub variant: Option<String>,
    pub world: JobWorld,
    pub run: Run,
    pub plan: JobPlan,
}

impl JobSpec {
    pub fn new(world: JobWorld, label: &str, run: Run, plan: JobPlan) -> Result<Self, Report> {
        let version = (env!("CARGO_PKG_VERSION"), RESULTS_VERSION);
        let named = || world.fingerprint().unwrap_or_default();
        let content = world.map().map_or_else(named, |map| content(map));
        let determines = (version, world.name(), content, &run, &plan);
        let mut determines = serde_json::to_value(determines).into_diagnostic()?;
        // The order in which settings are listed means nothing.
        determines.sort_all_objects();
        let key = format!("{:08x}", crc32fast::hash(determines.to_string().as_bytes()));
        let [world_name, label] = [world.name(), label].map(file_stem);
        let name = format!("{world_name}-{label}-seed{}-{}", run.seed, &key[..NAME_DIGITS]);
        Ok(Self { name, key, variant: None, world, run, plan })
    }

    /// Whether `result` is of this job with any seed: of this version, too, and on as many tasks.
    pub fn is_seed(&self, result: &JobResult) -> bool {
        if (self.world.name(), &self.run.method) != (&*result.world, &result.method) {
            return false;
        }
        let run = || Run { seed: result.seed, ..self.run.clone() };
        // The start is the map's own, or drawn by the seed.
        let bare = self.world.map().map(|map| map.with_marks(Vec::new(), map.goals().to_vec()));
        let drawn = bare.map(|map| JobWorld::maze(&map, result.seed));
        [Some(self.world.clone()), drawn].into_iter().flatten().any(|world| {
            let job = Self::new(world, "", run(), self.plan.clone());
            job.is_ok_and(|job| job.key == result.key)
        })
    }

    /// Whether `trainer` is this job, begun earlier.
    pub fn is_run_of(&self, trainer: &Trainer) -> bool {
        let beyond = match self.plan.length {
            Length::Updates(updates) => trainer.counters().updates > updates,
            // Several agents may end their last episodes, or take their last steps, at once.
            Length::Episodes(_) | Length::Steps(_) => false,
        };
        *trainer.run() == self.run && self.world.is(trainer.world()) && !beyond
    }

    /// Returns what is known of its result before it has begun.
    pub fn open_result(&self) -> JobResult {
        let changed = self.run.changed_settings();
        JobResult {
            name: self.name.clone(),
            key: self.key.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            method: self.run.method.clone(),
            variant: self.variant.clone(),
            preset: self.run.preset,
            settings: changed.iter().map(|(name, value)| setting_text(name, value)).collect(),
            seed: self.run.seed,
            world: self.world.name().to_owned(),
            fingerprint: self.world.fingerprint(),
            updates: self.plan.length.amount(),
            eval_tasks: Some(self.plan.eval_tasks),
            data: self.plan.data.clone(),
            seconds: 0.0,
            evaluations: Vec::new(),
            measured: None,
        }
    }

    /// Returns the result of a finished `trainer`, with what was measured at the end.
    pub fn result(&self, trainer: &Trainer, measured: Option<Measured>) -> JobResult {
        JobResult {
            updates: trainer.counters().updates,
            seconds: trainer.seconds(),
            evaluations: evaluations(trainer.history()),
            measured,
            ..self.open_result()
        }
    }
}

pub fn setting_text(name: &str, value: &Value) -> String {
    let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    format!("{name}={value}")
}

pub fn evaluations(history: &History) -> Vec<EvaluationAt> {
    let evaluation = |(i, (updates, evaluation)): (usize, &(u64, Evaluation))| {
        let Moment { env_steps, seconds, .. } = history.moment(i)?;
        Some(EvaluationAt { updates: *updates, env_steps, seconds, evaluation: evaluation.clone() })
    };
    history.evaluations().iter().enumerate().filter_map(evaluation).collect()
}

/// A finished job, as stored in its JSON file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobResult {
    pub name: String,
    pub key: String,
    pub version: String,
    pub method: Method,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<String>,
    pub preset: Preset,
    pub settings: Vec<String>,
    pub seed: u64,
    /// Name of the map, or of the world if it has none.
    #[serde(rename = "map")]
    pub world: String,
    /// What tells the map or world apart from others of its name; the first part is a map's size.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingerprint: Option<String>,
    pub updates: u64,
    /// Tasks at each distance in its evaluations but the last; older results do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub eval_tasks: Option<u32>,
    /// What it learned from instead of acting.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub data: Option<JobData>,
    /// Training time, without evaluation.
    pub seconds: f64,
    pub evaluations: Vec<EvaluationAt>,
    /// Further measurements at the end, if the job's plan asks for any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<Measured>,
}

impl JobResult {
    pub fn last(&self) -> Option<&Evaluation> {
        self.evaluations.last().map(|at| &at.evaluation)
    }

    /// Returns what all seeds of a thing have in common.
    pub fn thing(&self) -> impl PartialEq {
        let Self { world, fingerprint, method, variant, preset, settings, updates, .. } = self;
        (world, fingerprint, method, variant, preset, settings, updates)
    }
}

/// Returns a name as part of file names and links: only letters, digits and `-_.`.
fn file_stem(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    safe_file_name(name).chars().map(plain).collect()
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

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::map::parse_map;

    #[test]
    fn the_name_is_plain_and_the_key_depends_on_all_that_the_result_does() {
        let job = |map: &str, seed, change: fn(&mut Run, &mut JobPlan)| {
            let (method, settings) = (Method::default(), Preset::Default.settings());
            let mut run = Run { method, preset: Preset::Default, seed, settings };
            let mut plan = JobPlan { max_steps: Some(500), ..JobPlan::suite(100, 2) };
            change(&mut run, &mut plan);
            let map = parse_map("a map|(1).map", map.as_bytes()).expect("a map");
            JobSpec::new(JobWorld::maze(&map, seed), "gdg", run, plan).expect("a job")
        };
        let one = job("...\n", 1, |_, _| {});
        assert!(one.name.starts_with("a_map_1_-gdg-seed1-"), "{}", one.name);
        assert_eq!(job("...\n", 1, |_, _| {}).key, one.key);
        let changed = job("...\n", 1, |run, _| run.settings.learn.hidden = 17);
        assert_eq!(changed.open_result().settings, ["hidden=17"]);
        let others = [
            changed,
            job("..#\n", 1, |_, _| {}),
            job("...\n", 2, |_, _| {}),
            job("...\n", 1, |_, plan| plan.length = Length::Updates(101)),
            job("...\n", 1, |_, plan| plan.length = Length::Episodes(100)),
            job("...\n", 1, |_, plan| plan.walks = vec![90]),
            job("...\n", 1, |_, plan| plan.last_tasks = 3),
            job("...\n", 1, |_, plan| plan.max_steps = None),
        ];
        assert!(others.iter().all(|other| other.key != one.key));
        let named = |fingerprint: &str| {
            let world = JobWorld::Named("gym:a:B-v0".to_owned(), Some(fingerprint.to_owned()));
            JobSpec::new(world, "gdg", one.run.clone(), one.plan.clone()).expect("a job")
        };
        assert_ne!(named("a 1").key, named("a 2").key);
        assert_eq!(named("a 1").open_result().fingerprint.as_deref(), Some("a 1"));
    }

    #[test]
    fn equal_names_of_different_worlds_get_the_first_fact_that_tells_all_apart() {
        let [small, wide] = [("hall", "4 x 2, radius 1, a"), ("hall", "4 x 2, radius 2, b")];
        let large = ("hall", "9 x 9, radius 1, d");
        for (worlds, expected) in [
            (&[small, ("city", "9 x 9, radius 1, c"), small][..], "hall; city; hall"),
            // Older records do not have them.
            (&[small, ("hall", "")], "hall; hall"),
            (&[small, wide], "hall (radius 1); hall (radius 2)"),
            (&[small, large], "hall (4 x 2); hall (9 x 9)"),
            (&[small, wide, large], "hall (a); hall (b); hall (d)"),
        ] {
            let known =
                worlds.iter().map(|(name, own)| (*name, Some(*own).filter(|own| !own.is_empty())));
            assert_eq!(told_apart(&known.collect::<Vec<_>>()).join("; "), expected);
        }
    }
}
