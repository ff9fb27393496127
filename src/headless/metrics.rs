//! The metrics of a run as CSV: a line per evaluation, and per point of the curves of losses and the share explored.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use miette::{IntoDiagnostic, Report, WrapErr};

use crate::setup::Setup;
use gdg::files;
use gdg::printing::eprint_line;
use gdg::train::{CurvePoint, Evaluation, Methods, Moment, Run, Trainer};

/// Columns of every line.
const CURVES: &str = "event,seconds,updates,env_steps,critic_loss,model_loss,actor_loss,explored";

type Metric = fn(&Evaluation) -> Option<f64>;

/// Columns of evaluations, besides success at each distance.
const EVALUATION: [(&str, Metric); 11] = [
    ("alone_success", |found| found.alone.success),
    ("alone_spl", |found| found.alone.spl),
    ("planned_success", |found| found.planned.as_ref()?.success),
    ("planned_spl", |found| found.planned.as_ref()?.spl),
    ("error", |found| Some(found.error?.mape)),
    ("near_error", |found| Some(found.error?.near_mape)),
    ("graph_error", |found| Some(found.error?.graph?.mape)),
    ("candidates", |found| Some(found.bridges.as_ref()?.candidates as f64)),
    ("edges", |found| Some(found.bridges.as_ref()?.edges as f64)),
    ("false_edges", |found| Some(found.bridges.as_ref()?.false_edges? as f64)),
    ("goal_distance_left", |found| {
        let marked = found.marked?;
        Some(f64::from(marked.planned.unwrap_or(marked.alone).left_straight?))
    }),
];

/// Distances at which tasks are evaluated, at most.
const DISTANCES: usize = 6;

/// Minimum time between two looks at the run while it trains.
const INTERVAL: Duration = Duration::from_secs(10);

/// Size limit of a table that may be replaced: no history makes a larger one.
const MAX_BYTES: u64 = 1 << 26;

/// What a table is made of: curves, evaluations, when those were made if it is known, and methods.
pub struct Curves<'a> {
    pub points: &'a [CurvePoint],
    pub evaluations: &'a [(u64, Evaluation)],
    pub moment: &'a dyn Fn(usize) -> Option<Moment>,
    pub methods: &'a Methods,
    pub run: &'a Run,
}

impl Curves<'_> {
    /// Returns the table. No name and no number contains a comma.
    pub fn table(&self) -> String {
        let none = vec![String::new(); EVALUATION.len() + 2 * DISTANCES];
        let line = |updates: u64, [event, seconds, env_steps]: [String; 3], cells: Vec<String>| {
            let method = self.methods.name(updates).map(str::to_owned);
            let method = method.unwrap_or_else(|| self.run.method.name());
            let cells = [&[event, seconds, updates.to_string(), env_steps], &cells[..], &[method]];
            (updates, cells.concat().join(",") + "\n")
        };
        let points = self.points.iter().map(|point| {
            let losses = point.losses.iter().map(f32::to_string);
            let cells = losses.chain([number(point.coverage)]).chain(none.clone());
            line(point.updates, ["progress".into(), String::new(), String::new()], cells.collect())
        });
        let evaluations = self.evaluations.iter().enumerate().map(|(i, (updates, found))| {
            let made = (self.moment)(i);
            let seconds = made.map_or(String::new(), |made| format!("{:.3}", made.seconds));
            let scores = [Some(&found.alone), found.planned.as_ref()];
            let by_distance = scores
                .into_iter()
                .flat_map(|score| (0..DISTANCES).map(move |i| score?.by_distance.get(i)?.success));
            let cells = [None, None, None, found.explored].into_iter();
            let cells = cells.chain(EVALUATION.map(|(_, metric)| metric(found))).chain(by_distance);
            let steps = number(made.map(|made| made.env_steps));
            line(*updates, ["evaluation".into(), seconds, steps], cells.map(number).collect())
        });
        let mut lines: Vec<(u64, String)> = points.chain(evaluations).collect();
        lines.sort_by_key(|(updates, _)| *updates);
        head() + &lines.into_iter().map(|(_, line)| line).collect::<String>()
    }
}

fn head() -> String {
    let names = CURVES.split(',').chain(EVALUATION.map(|(name, _)| name)).map(str::to_owned);
    let at = |actor: &'static str| (1..=DISTANCES).map(move |i| format!("{actor}_success_{i}"));
    let names = names.chain(at("alone")).chain(at("planned")).chain(["method".to_owned()]);
    names.collect::<Vec<_>>().join(",") + "\n"
}

fn number(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

fn of(trainer: &Trainer) -> String {
    let history = trainer.history();
    let moment = |i: usize| history.moment(i);
    let (points, evaluations) = (history.points(), history.evaluations());
    let (methods, run) = (history.methods(), trainer.run());
    Curves { points, evaluations, moment: &moment, methods, run }.table()
}

/// The table of a run in a file, which is replaced whenever there is more.
pub struct MetricsFile {
    given: PathBuf,
    /// Its path, and its text as last written: a file with another text is not replaced.
    path: PathBuf,
    text: Option<String>,
    written: Instant,
    has_failed: bool,
}

impl MetricsFile {
    /// Writes the table of the run in `setup` to a file that `prepare` has found to be writable. An
    /// earlier table of the same run is replaced; another one only by `overwrite`.
    pub fn open(path: &Path, overwrite: bool, setup: &Setup) -> Result<Self, Report> {
        let now = of(&setup.trainer);
        let found = read(path);
        let text = found
            .filter(|found| overwrite || is_earlier(found, &now, setup.trainer.counters().updates));
        let (given, written) = (path.to_owned(), Instant::now());
        let mut file = Self { path: given.clone(), given, text, written, has_failed: false };
        let put = file.put(now).into_diagnostic();
        put.wrap_err_with(|| format!("{}: cannot be written", path.display()))?;
        Ok(file)
    }

    /// Writes what is new, at most every ten seconds unless it `is_due`. A failure is reported once;
    /// training continues, and it is tried again.
    pub fn write(&mut self, trainer: &Trainer, is_due: bool) {
        if !is_due && self.written.elapsed() < INTERVAL {
            return;
        }
        self.written = Instant::now();
        let put = self.put(of(trainer));
        if let Err(error) = &put
            && !self.has_failed
        {
            let path = self.path.display();
            eprint_line(&format!("{path}: cannot be written, which will be tried again: {error}"));
        }
        self.has_failed = put.is_err();
    }

    /// Writes `text`, to another file if somebody has moved or changed this one, as by an editor.
    fn put(&mut self, text: String) -> std::io::Result<()> {
        let found = read(&self.path);
        if found.as_ref() == Some(&text) {
            return Ok(());
        }
        if found.is_some() && found == self.text {
            files::write_atomically(&self.path, text.as_bytes())?;
        } else {
            let path = files::write_to_unused(&self.given, text.as_bytes())?;
            if path != self.path {
                let (was, now) = (self.path.display(), path.display());
                eprint_line(&format!(
                    "{was}: is not what this run has written: all rows are in {now}"
                ));
                self.path = path;
            }
        }
        self.text = Some(text);
        Ok(())
    }
}

fn read(path: &Path) -> Option<String> {
    files::read(path, MAX_BYTES).ok().map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
}

/// Whether a table is of the same run as `now`, whose losses no other has, and has nothing that the run
/// has yet to do, `updates` from its beginning, nor what somebody has written into it.
fn is_earlier(found: &str, now: &str, updates: u64) -> bool {
    let at = |row: &str| row.split(',').nth(2).and_then(|cell| cell.parse::<u64>().ok());
    let cells = |row: &str| row.split(',').count();
    let own: HashSet<&str> = now.lines().collect();
    let kept: HashSet<Option<u64>> = now.lines().map(at).collect();
    // Points are thinned as they become many.
    let is_thinned = |row: &&str| {
        let is_due = at(row).is_some_and(|at| at <= updates) && !kept.contains(&at(row));
        is_due && row.starts_with('p') && cells(row) == cells(now.lines().next().unwrap_or(""))
    };
    let (own_rows, others): (Vec<_>, Vec<_>) =
        found.lines().skip(1).partition(|row| own.contains(row));
    let has_own = !own_rows.is_empty() || others.is_empty();
    found.lines().next() == now.lines().next() && has_own && others.iter().all(is_thinned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_the_run_has_written_is_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let given = path("m.csv");
        let (written, text) = (Instant::now(), None);
        let mut file = MetricsFile { path: given.clone(), given, text, written, has_failed: false };
        let mut put = |text: &str| file.put(text.to_owned()).expect("written");
        put("1\n");
        put("1\n2\n");
        assert_eq!(read(&path("m.csv")).as_deref(), Some("1\n2\n"));
        std::fs::rename(path("m.csv"), path("moved.csv")).expect("moved");
        put("1\n2\n3\n");
        std::fs::write(path("m.csv"), "mine\n").expect("edited");
        put("1\n2\n3\n4\n");
        for (name, text) in
            [("moved.csv", "1\n2\n"), ("m.csv", "mine\n"), ("m-2.csv", "1\n2\n3\n4\n")]
        {
            assert_eq!(read(&path(name)).as_deref(), Some(text), "{name}");
        }
    }

    #[test]
    fn a_table_of_the_same_run_is_known_by_its_rows() {
        let now = "event,a,updates\np,.5,50\np,.25,100\n";
        for (found, is_own) in [
            ("event,a,updates\n", true),
            ("event,a,updates\r\np,.5,50\r\n", true),
            // Points are thinned as they become many.
            ("event,a,updates\np,.3,25\np,.5,50\n", true),
            ("event,a,updates\np,.6,50\n", false),
            ("event,a,updates\np,.5,50\np,.1,150\n", false),
            ("event,a,updates\np,.5,50\np,.1", false),
            ("event,a,updates\np,.5,50\np,.3,100\n", false),
            ("event,a,updates\nnote,.3,25\np,.5,50\n", false),
            ("event,a,updates\np,.3,25,note\np,.5,50\n", false),
            ("notes\np,.5,50\n", false),
        ] {
            assert_eq!(is_earlier(found, now, 100), is_own, "{found}");
        }
    }
}
