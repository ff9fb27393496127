//! Joins what was read from several files, or from parts of one, of the same run.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf, absolute};
use std::sync::Arc;

use super::{RunKind, RunState, SavedRun};
use crate::experiment::spec::EvaluationAt;
use gdg::files::has_extension;
use gdg::text::safe_file_name;

/// Joins parts of runs that were resumed, or begun again, in the order in which they began.
pub fn merged(parts: Vec<SavedRun>) -> Vec<SavedRun> {
    let mut runs: Vec<SavedRun> = Vec::new();
    let mut places: HashMap<_, Vec<usize>> = HashMap::new();
    for part in parts {
        let facts = (part.map.clone(), part.method.clone(), part.settings.clone(), part.seed);
        let alike = places.entry(facts).or_default();
        // It goes on, or has begun anew with the same edits and tasks.
        let is_before = |before: &SavedRun| {
            let mut both = part.circumstances().into_iter().zip(before.circumstances());
            let is_again = both.all(|(own, other)| own == other || own.and(other).is_none());
            is_again && before.fingerprint == part.fingerprint
                || part.begun > 0 && before.is_same(&part)
        };
        if let Some(place) = alike.iter().rev().find(|place| is_before(&runs[**place])) {
            let before = std::mem::replace(&mut runs[*place], part);
            runs[*place].continue_from(before);
        } else {
            alike.push(runs.len());
            runs.push(part);
        }
    }
    runs
}

/// Leaves one of the runs that were read from several files of the same: a job's result instead of
/// its records and checkpoint, the records that go on instead of those before, and records instead
/// of the checkpoint that they name.
pub fn join(mut runs: Vec<Arc<SavedRun>>) -> Vec<Arc<SavedRun>> {
    let mut into = vec![None; runs.len()];
    let all =
        |kind: RunKind| (0..runs.len()).filter(|i| runs[*i].kind == kind).collect::<Vec<usize>>();
    let (mut records, checkpoints) = (all(RunKind::Records), all(RunKind::Checkpoint));
    records.sort_by_key(|i| (runs[*i].begun, runs[*i].updates));
    let stem = |i: usize| runs[i].source.with_extension("");
    let results: HashMap<PathBuf, usize> =
        all(RunKind::Result).into_iter().map(|i| (stem(i), i)).collect();
    for i in records.iter().chain(&checkpoints) {
        // A checkpoint may have been trained on.
        into[*i] = results.get(&stem(*i)).copied().filter(|result| {
            runs[*i].kind == RunKind::Records || runs[*i].updates <= runs[*result].updates
        });
    }
    let of_another = checkpoints.iter().filter(|i| into[**i].is_none());
    for result in of_another.filter_map(|i| results.get(&stem(*i))).collect::<Vec<_>>() {
        let result = Arc::make_mut(&mut runs[*result]);
        result.checkpoint = None;
        result.others.retain(|file| has_extension(file, "png"));
    }
    let mut naming: HashMap<PathBuf, Vec<usize>> = HashMap::new();
    let is_open = |into: &[Option<usize>], all: &[usize]| -> Vec<usize> {
        all.iter().copied().filter(|i| into[*i].is_none()).collect()
    };
    let open = is_open(&into, &records);
    // Of several that go on from one, the longest.
    for (n, i) in open.iter().enumerate().rev() {
        let run = &runs[*i];
        let is_before =
            |part: &&usize| into[**part].is_none() && run.is_resumed_from(&runs[**part]);
        if let Some(before) = open[..n].iter().rfind(is_before).copied() {
            into[before] = Some(*i);
        }
        run.checkpoint.iter().for_each(|path| naming.entry(whole(path)).or_default().push(*i));
    }
    for i in is_open(&into, &checkpoints) {
        let file = whole(&runs[i].source);
        let named = naming.get(&file).into_iter().flatten().copied();
        // Another run may have replaced the file. A part that continues it, unsaved or saved
        // elsewhere, lacks what it holds.
        let last = |part| std::iter::successors(Some(part), |part| into[*part]).last();
        into[i] = named
            .filter(|part| runs[*part].has_saved(&runs[i]))
            .filter_map(last)
            .find(|last| runs[*last].checkpoint.as_ref().is_some_and(|path| whole(path) == file));
    }
    for i in records.into_iter().chain(checkpoints) {
        if let Some(host) = into[i] {
            let part = runs[i].clone();
            Arc::make_mut(&mut runs[host]).absorb(&part);
        }
    }
    let kept = runs.into_iter().zip(into).filter(|(_, into)| into.is_none());
    kept.map(|(run, _)| run).collect()
}

/// Returns a path in one form, as the same file may be named in several ways.
pub fn whole(path: &Path) -> PathBuf {
    absolute(path).unwrap_or_else(|_| path.to_owned())
}

impl SavedRun {
    /// Whether `other` is the same run at another time.
    pub fn is_same(&self, other: &Self) -> bool {
        // A checkpoint has its map's name as files have it.
        let fingerprints = self.fingerprint.as_ref().zip(other.fingerprint.as_ref());
        let has_same_map = safe_file_name(&self.map) == safe_file_name(&other.map)
            && fingerprints.is_none_or(|(own, other)| own == other);
        (&self.method, &self.settings, self.seed) == (&other.method, &other.settings, other.seed)
            && (has_same_map || self.is_edited() || other.is_edited())
    }

    /// Whether an evaluation of both was the same, at the same time: settings may have changed since.
    pub fn is_of_one_run(&self, other: &Self) -> bool {
        // Records round times.
        let moment = |at: &EvaluationAt| (at.updates, (1_000.0 * at.seconds).round() as u64);
        let own: HashSet<_> = self.evaluations.iter().map(moment).collect();
        other.evaluations.iter().any(|at| own.contains(&moment(at)))
    }

    pub fn is_edited(&self) -> bool {
        !self.edits.is_empty()
    }

    /// Whether these records go on from a checkpoint of `other`.
    fn is_resumed_from(&self, other: &Self) -> bool {
        // Older records name only the checkpoint that they write, which was often the same.
        let from = self.resumed.as_ref().or(self.checkpoint.as_ref()).map(|path| whole(path));
        let written = other.checkpoint.iter().chain([&other.source]).chain(&other.others);
        self.begun > other.begun
            && other.saved_at.is_none_or(|at| at <= self.begun)
            && self.is_same(other)
            && from.is_some_and(|from| written.into_iter().any(|path| whole(path) == from))
    }

    /// Whether these records can be of the run in a checkpoint that they name: it has what was
    /// evaluated before their last save. Others may have replaced the file.
    pub fn has_saved(&self, checkpoint: &Self) -> bool {
        let at = self.saved_at.unwrap_or(0);
        let is_evaluated = self.evaluations.iter().any(|evaluated| evaluated.updates <= at);
        self.is_same(checkpoint)
            && checkpoint.updates >= at
            && (!is_evaluated || self.is_of_one_run(checkpoint))
    }

    /// Adds the part that it was resumed from.
    pub fn continue_from(&mut self, mut before: Self) {
        // It may have been resumed from before that one's end.
        let from = self.evaluations.first().map(|at| at.updates);
        let from = from.or((self.begun > 0).then_some(self.begun + 1));
        before.evaluations.retain(|at| from.is_none_or(|from| at.updates < from));
        if before.is_edited() {
            (self.map, self.fingerprint) = (before.map, before.fingerprint);
        }
        let is_own = |at: u64| self.edits.iter().all(|(own, _)| *own != at);
        before.edits.retain(|(at, _)| *at <= self.begun && is_own(*at));
        self.edits.splice(0..0, before.edits);
        self.evaluations.splice(0..0, before.evaluations);
        (self.begun, self.resumed) = (before.begun, before.resumed);
        self.checkpoint = self.checkpoint.take().or(before.checkpoint);
        self.saved_at = self.saved_at.or(before.saved_at);
        self.problem = before.problem.or(self.problem.take());
    }

    /// Takes in what was read from another file of this run, and is left out besides.
    fn absorb(&mut self, part: &Self) {
        self.others.push(part.source.clone());
        self.others.extend(part.others.iter().cloned());
        self.written = self.written.max(part.written);
        if self.kind == RunKind::Result {
            return;
        }
        if part.kind != RunKind::Checkpoint {
            return self.continue_from(part.clone());
        }
        let first = self.evaluations.first().map_or(u64::MAX, |at| at.updates);
        let last = self.evaluations.last().map_or(u64::MAX, |at| at.updates);
        let of_part = part.evaluations.iter().filter(|at| at.updates < first || at.updates > last);
        self.evaluations.extend(of_part.cloned());
        self.evaluations.sort_by_key(|at| at.updates);
        if part.updates > self.updates && self.end.is_some() {
            self.end = Some(RunState::Ended);
        }
        self.updates = self.updates.max(part.updates);
        // Its records may be of its last part alone, or end before the last edit.
        if part.edits.len() > self.edits.len() {
            self.edits.clone_from(&part.edits);
            self.fingerprint.take_if(|_| self.begun > 0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::spec::EvaluationAt;
    use gdg::train::{Evaluation, Score};

    const PATH: &str = "saves/a.safetensors";

    /// Returns a run that begins and was evaluated at these thousands of updates; records name a
    /// checkpoint.
    fn run(kind: RunKind, source: &str, begun: u64, evaluated: &[u64]) -> SavedRun {
        let score =
            Score { success: Some(0.5), spl: None, steps_ratio: None, by_distance: Vec::new() };
        let evaluation = |thousands: &u64| EvaluationAt {
            updates: 1_000 * thousands,
            env_steps: 0,
            // Each part has its own.
            seconds: begun as f64,
            evaluation: Evaluation { alone: score.clone(), ..Evaluation::default() },
        };
        SavedRun {
            source: source.into(),
            kind,
            end: Some(RunState::Ended),
            map: "room".to_owned(),
            begun: 1_000 * begun,
            updates: 1_000 * evaluated.last().copied().unwrap_or(begun),
            evaluations: evaluated.iter().map(evaluation).collect(),
            checkpoint: (kind == RunKind::Records).then(|| format!("./{PATH}").into()),
            ..SavedRun::default()
        }
    }

    /// Returns each run's file, the others that belong to it, and thousands of updates at its
    /// evaluations, with the part that they are of.
    fn joined(runs: &[&SavedRun]) -> Vec<String> {
        let runs = join(runs.iter().map(|run| Arc::new((*run).clone())).collect());
        let text = |run: &Arc<SavedRun>| {
            let others = run.others.iter().map(|path| format!("{} ", path.display()));
            let at = run.evaluations.iter();
            let at = at.map(|at| format!(" {}.{}", at.updates / 1_000, at.seconds));
            let (others, at) = (others.collect::<String>(), at.collect::<String>());
            format!("{} [{}]{at}", run.source.display(), others.trim_end())
        };
        runs.iter().map(text).collect()
    }

    #[test]
    fn what_is_in_several_files_is_one_run() {
        let checkpoint = |at: &[u64]| run(RunKind::Checkpoint, PATH, 0, at);
        let part = |source, begun, at: &[u64]| run(RunKind::Records, source, begun, at);
        let (first, saved) = (part("1.jsonl", 0, &[1, 2]), checkpoint(&[1, 2]));
        let (second, third) = (part("2.jsonl", 2, &[3, 4, 5]), part("3.jsonl", 4, &[5, 6]));
        let other = run(RunKind::Checkpoint, "saves/b.safetensors", 0, &[1]);
        let replaced = SavedRun { seed: 4, ..checkpoint(&[1]) };
        let unsaved =
            SavedRun { checkpoint: None, resumed: Some(PATH.into()), ..part("2.jsonl", 2, &[3]) };
        let ended = SavedRun { saved_at: Some(2_000), ..first.clone() };
        let edited =
            SavedRun { saved_at: Some(5_000), edits: vec![(1, "b".to_owned())], ..first.clone() };
        let mut other_times = checkpoint(&[1, 2, 3]);
        other_times.evaluations.iter_mut().for_each(|at| at.seconds = 9.0);
        let renamed =
            SavedRun { checkpoint: Some("saves/b.safetensors".into()), ..unsaved.clone() };
        let elsewhere =
            SavedRun { resumed: Some("saves/c.safetensors".into()), ..part("3.jsonl", 2, &[3]) };
        let set = SavedRun { settings: vec!["n_step=1".to_owned()], ..first.clone() };
        let of_job = |kind, end| run(kind, &format!("jobs/a.{end}"), 0, &[4]);
        let job = [
            (RunKind::Records, "jsonl"),
            (RunKind::Result, "json"),
            (RunKind::Checkpoint, "safetensors"),
        ]
        .map(|(kind, end)| of_job(kind, end));
        // Its result names the file as it was.
        let trained_on = run(RunKind::Checkpoint, "jobs/a.safetensors", 0, &[4, 9]);
        let result = SavedRun { others: vec![trained_on.source.clone()], ..job[1].clone() };
        for (runs, expected) in [
            (
                &[&result, &trained_on][..],
                &["jobs/a.json [] 4.0", "jobs/a.safetensors [] 4.0 9.0"][..],
            ),
            (&[&first, &saved], &["1.jsonl [saves/a.safetensors] 1.0 2.0"]),
            (&[&first, &checkpoint(&[1, 2, 3])], &["1.jsonl [saves/a.safetensors] 1.0 2.0 3.0"]),
            // It does not name that one; and another run has replaced the file.
            (&[&first, &other], &["1.jsonl [] 1.0 2.0", "saves/b.safetensors [] 1.0"]),
            (&[&first, &replaced], &["1.jsonl [] 1.0 2.0", "saves/a.safetensors [] 1.0"]),
            (&job.each_ref(), &["jobs/a.json [jobs/a.jsonl jobs/a.safetensors] 4.0"]),
            // One with other settings has, and is resumed.
            (
                &[&set, &part("2.jsonl", 0, &[2]), &saved, &part("3.jsonl", 2, &[3])],
                &["1.jsonl [] 1.0 2.0", "3.jsonl [2.jsonl saves/a.safetensors] 1.0 2.0 3.2"],
            ),
            // What goes on from it is not saved yet.
            (
                &[&first, &saved, &unsaved],
                &["saves/a.safetensors [] 1.0 2.0", "2.jsonl [1.jsonl] 1.0 2.0 3.2"],
            ),
            // It is saved to another file.
            (
                &[&first, &saved, &renamed],
                &["saves/a.safetensors [] 1.0 2.0", "2.jsonl [1.jsonl] 1.0 2.0 3.2"],
            ),
            // Another run has replaced the file: with fewer updates, or other evaluations.
            (&[&ended, &checkpoint(&[1])], &["1.jsonl [] 1.0 2.0", "saves/a.safetensors [] 1.0"]),
            (
                &[&ended, &other_times],
                &["1.jsonl [] 1.0 2.0", "saves/a.safetensors [] 1.9 2.9 3.9"],
            ),
            // And another goes on from it, on an edited map.
            (&[&edited, &second], &["1.jsonl [] 1.0 2.0", "2.jsonl [] 3.2 4.2 5.2"]),
            // A run that began anew has replaced the file.
            (
                &[&first, &saved, &part("2.jsonl", 0, &[3])],
                &["1.jsonl [] 1.0 2.0", "2.jsonl [saves/a.safetensors] 1.0 2.0 3.0"],
            ),
            (
                &[&part("2.jsonl", 2, &[]), &saved, &first],
                &["2.jsonl [1.jsonl saves/a.safetensors] 1.0 2.0"],
            ),
            (&[&first, &elsewhere], &["1.jsonl [] 1.0 2.0", "3.jsonl [] 3.2"]),
            // The later part where they overlap.
            (
                &[&third, &second, &saved, &first],
                &["3.jsonl [2.jsonl 1.jsonl saves/a.safetensors] 1.0 2.0 3.2 4.2 5.4 6.4"],
            ),
        ] {
            assert_eq!(joined(runs), expected);
        }
        let end = |end, at: &[u64]| {
            let runs = vec![Arc::new(SavedRun { end, ..first.clone() }), Arc::new(checkpoint(at))];
            join(runs).remove(0).end
        };
        assert_eq!(end(Some(RunState::Interrupted), &[1, 3]), Some(RunState::Ended), "resumed");
        assert_eq!(end(None, &[1, 3]), None, "a checkpoint is written between two records");
    }
}
