//! One job: a run in a world, and its result.

use miette::{IntoDiagnostic, Report};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::measure::Measured;
use super::plan::{Length, Plan};
use super::world::JobWorld;
use gdg::map::fingerprint;
use gdg::text::safe_file_name;
use gdg::train::{Evaluation, History, Method, Preset, Run, Trainer};

/// Hexadecimal digits of the key in the job's name.
const NAME_DIGITS: usize = 6;

/// Part of every key. Raise it with any change of what a run learns or measures, so that no folder
/// mixes results of different programs.
const RESULTS_VERSION: u32 = 3;

/// A run in a world, its length, and what is measured.
#[derive(Clone, Debug)]
pub struct Job {
    /// The world's name, the label if any (method and variant), the seed and the beginning of the key.
    pub name: String,
    /// Checksum of everything that the result depends on, in hexadecimal digits.
    pub key: String,
    /// Name of the variant, if its settings have one. The result does not depend on it.
    pub variant: Option<String>,
    /// The world.
    pub world: JobWorld,
    /// Method, settings and seed.
    pub run: Run,
    /// Length, evaluations and what is measured at the end.
    pub plan: Plan,
}

impl Job {
    /// Creates the job of `run` in `world`; `label` becomes part of its name.
    ///
    /// # Errors
    /// The run cannot be written as JSON.
    pub fn new(world: JobWorld, label: Option<&str>, run: Run, plan: Plan) -> Result<Self, Report> {
        let version = (env!("CARGO_PKG_VERSION"), RESULTS_VERSION);
        let determines = (version, world.name(), world.content(), &run, &plan);
        let mut determines = serde_json::to_value(determines).into_diagnostic()?;
        // The order in which settings are listed means nothing.
        determines.sort_all_objects();
        let key = format!("{:08x}", crc32fast::hash(determines.to_string().as_bytes()));
        let label = label.map_or(String::new(), |label| format!("{}-", file_stem(label)));
        let name =
            format!("{}-{label}{}-{}", file_stem(world.name()), run.seed, &key[..NAME_DIGITS]);
        Ok(Self { name, key, variant: None, world, run, plan })
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

    /// Returns the settings that differ from the preset's, as `--set` takes them.
    pub fn changed_settings(&self) -> Vec<String> {
        let changed = self.run.changed_settings();
        changed.iter().map(|(name, value)| setting_text(name, value)).collect()
    }

    /// Returns the result of a finished `trainer`, with what was measured at the end.
    pub fn result(&self, trainer: &Trainer, measured: Option<Measured>) -> JobResult {
        JobResult {
            name: self.name.clone(),
            key: self.key.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            method: self.run.method.clone(),
            variant: self.variant.clone(),
            preset: self.run.preset,
            settings: self.changed_settings(),
            seed: self.run.seed,
            world: self.world.name().to_owned(),
            map: MapFacts::of(&self.world),
            updates: trainer.counters().updates,
            seconds: trainer.seconds(),
            evaluations: evaluations(trainer.history()),
            measured,
        }
    }
}

/// Returns a setting as `--set` takes it.
pub fn setting_text(name: &str, value: &Value) -> String {
    let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    format!("{name}={value}")
}

/// Returns the evaluations of a run, oldest first.
pub fn evaluations(history: &History) -> Vec<EvaluationAt> {
    let evaluation = |(updates, evaluation): &(u64, Evaluation)| {
        let made = history.moment(*updates);
        EvaluationAt {
            updates: *updates,
            env_steps: made.map(|made| made.env_steps),
            seconds: made.map(|made| made.seconds),
            evaluation: evaluation.clone(),
        }
    };
    history.evaluations().iter().map(evaluation).collect()
}

/// A finished job, as stored in its JSON file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JobResult {
    /// The job's name.
    pub name: String,
    /// The job's key.
    pub key: String,
    /// Version of the program.
    pub version: String,
    /// The method.
    pub method: Method,
    /// Name of the variant, if its settings have one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<String>,
    /// The preset that the settings are based on.
    pub preset: Preset,
    /// Settings that differ from the preset's, as `--set` takes them.
    pub settings: Vec<String>,
    /// The seed.
    pub seed: u64,
    /// Name of the map, or of the world if it has none.
    #[serde(rename = "map")]
    pub world: String,
    /// The map, if there is one.
    #[serde(flatten)]
    pub map: Option<MapFacts>,
    /// Updates done.
    pub updates: u64,
    /// Training time in seconds, without evaluation.
    pub seconds: f64,
    /// All evaluations, oldest first.
    pub evaluations: Vec<EvaluationAt>,
    /// Further measurements at the end, if the job's plan asks for any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<Measured>,
}

/// A job's map.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MapFacts {
    /// Number of free cells.
    pub free_cells: usize,
    /// Column and row of each start.
    pub starts: Vec<[usize; 2]>,
    /// Whether the start was drawn, as the map itself has none.
    pub start_drawn: bool,
    /// What tells the map apart from others of its name; older results do not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fingerprint: Option<String>,
}

impl MapFacts {
    fn of(world: &JobWorld) -> Option<Self> {
        let JobWorld::Maze { map, start_drawn } = world else { return None };
        Some(Self {
            free_cells: map.free_count(),
            starts: map.starts().iter().map(|start| [start.x, start.y]).collect(),
            start_drawn: *start_drawn,
            fingerprint: Some(fingerprint(map)),
        })
    }
}

/// An evaluation after a number of updates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluationAt {
    /// Updates done before it.
    pub updates: u64,
    /// Environment steps before it, summed over all agents; older results do not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub env_steps: Option<u64>,
    /// Training time before it in seconds; older results do not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Its results.
    #[serde(flatten)]
    pub evaluation: Evaluation,
}

impl JobResult {
    /// Returns what tells its map apart from others of its name, if that is known.
    pub fn fingerprint(&self) -> Option<&str> {
        self.map.as_ref()?.fingerprint.as_deref()
    }

    /// Returns the last evaluation.
    pub fn last(&self) -> Option<&Evaluation> {
        self.evaluations.last().map(|at| &at.evaluation)
    }
}

/// Returns a map's name as part of file names and links: only letters, digits and `-_.`.
fn file_stem(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    safe_file_name(name).chars().map(plain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::map::parse_map;

    fn run(seed: u64) -> Run {
        Run {
            method: Method::default(),
            preset: Preset::Default,
            seed,
            settings: Preset::Default.settings(),
        }
    }

    fn job(map: &str, run: Run, updates: u64) -> Job {
        let map = parse_map("a map|(1).map", map.as_bytes()).expect("a map");
        Job::new(JobWorld::maze(&map, run.seed), None, run, Plan::suite(updates, 2)).expect("a job")
    }

    #[test]
    fn the_name_is_plain_and_the_key_depends_on_all_that_the_result_does() {
        let one = job("...\n", run(1), 100);
        assert!(one.name.starts_with("a_map_1_-1-"), "{}", one.name);
        assert!(
            MapFacts::of(&one.world).is_some_and(|map| map.start_drawn && map.starts.len() == 1)
        );
        assert_eq!(job("...\n", run(1), 100).key, one.key);
        let mut other = run(1);
        other.settings.learn.hidden = 17;
        assert_eq!(job("...\n", other.clone(), 100).changed_settings(), ["hidden=17"]);
        let others =
            [job("..#\n", run(1), 100), job("...\n", run(2), 100), job("...\n", run(1), 101)];
        assert!(others.into_iter().chain([job("...\n", other, 100)]).all(|job| job.key != one.key));
    }

    #[test]
    fn the_key_depends_on_the_plan_and_the_name_on_the_label() {
        let map = parse_map("map", b"...\n").expect("a map");
        let world = JobWorld::maze(&map, 1);
        let job = |plan: &Plan| {
            Job::new(world.clone(), Some("gdg"), run(1), plan.clone()).expect("a job")
        };
        let plan = Plan { max_steps: Some(500), ..Plan::suite(100, 2) };
        assert!(job(&plan).name.starts_with("map-gdg-1-"));
        let others = [
            Plan::suite(100, 2),
            Plan { length: Length::Episodes(100), ..plan.clone() },
            Plan { walks: vec![90], ..plan.clone() },
            Plan { last_tasks: 3, ..plan.clone() },
        ];
        assert!(others.iter().all(|other| job(other).key != job(&plan).key));
    }
}
