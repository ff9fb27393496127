//! Joins what was read from several files of one run.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::path::{Path, PathBuf, absolute};
use std::sync::Arc;
use std::time::SystemTime;

use super::{EDITED, Ending, Kind, SavedRun};
use gdg::text::safe_file_name;

/// A run, and when its file was written.
pub type Dated = (Arc<SavedRun>, Option<SystemTime>);

/// Leaves one of the runs that were read from several files of the same: a job's result instead of
/// its records and checkpoint, and records instead of the checkpoint that they name, and of
/// earlier records that name it.
pub fn join(mut runs: Vec<Dated>) -> Vec<Dated> {
    let into = hosts(&runs);
    let mut parts: Vec<(usize, usize)> =
        into.iter().enumerate().filter_map(|(i, host)| Some((i, (*host)?))).collect();
    // Each part of the records goes before those that it was resumed in.
    parts.sort_by_key(|(i, _)| (runs[*i].0.kind == Kind::Checkpoint, Reverse(runs[*i].0.place())));
    for (i, host) in parts {
        let (part, written) = runs[i].clone();
        let (run, newest) = &mut runs[host];
        Arc::make_mut(run).absorb(&part);
        *newest = (*newest).max(written);
    }
    let kept = runs.into_iter().zip(into).filter(|(_, into)| into.is_none());
    kept.map(|(run, _)| run).collect()
}

/// Joins records that were resumed from others, whatever checkpoints they name.
pub fn join_resumed(runs: &[SavedRun]) -> Vec<SavedRun> {
    let mut joined: Vec<(usize, SavedRun)> = Vec::new();
    let mut parts: Vec<(usize, &SavedRun)> = runs.iter().enumerate().collect();
    parts.sort_by_key(|(_, run)| run.place());
    for (i, run) in parts {
        let before = joined.iter_mut().find(|(_, part)| run.is_resumed_from(part));
        if let Some((_, part)) = before.filter(|(_, part)| part.settings == run.settings) {
            let before = std::mem::replace(part, run.clone());
            part.continue_from(before);
        } else {
            joined.push((i, run.clone()));
        }
    }
    joined.sort_by_key(|(i, _)| *i);
    joined.into_iter().map(|(_, run)| run).collect()
}

/// Returns, for each run that is part of another, the index of that one.
fn hosts(runs: &[Dated]) -> Vec<Option<usize>> {
    let mut into = vec![None; runs.len()];
    let indices = |kind: fn(Kind) -> bool| {
        let all = runs.iter().enumerate();
        all.filter(move |(_, (run, _))| kind(run.kind)).map(|(i, (run, _))| (i, &**run))
    };
    let stem = |run: &SavedRun| run.source.with_extension("");
    let results: HashMap<PathBuf, usize> =
        indices(|kind| kind == Kind::Result).map(|(i, run)| (stem(run), i)).collect();
    for (i, run) in indices(|kind| kind != Kind::Result) {
        into[i] = results.get(&stem(run)).copied();
    }
    let mut naming: HashMap<PathBuf, Vec<usize>> = HashMap::new();
    for (i, run) in indices(|kind| matches!(kind, Kind::Records(_))) {
        if let (Some(path), None) = (&run.checkpoint, into[i]) {
            naming.entry(whole(path)).or_default().push(i);
        }
    }
    for (i, run) in indices(|kind| kind == Kind::Checkpoint) {
        let Some(named) = naming.get(&whole(&run.source)) else { continue };
        let parts = || named.iter().copied().filter(|part| runs[*part].0.is_same(run));
        if let (Some(host), None) = (parts().max_by_key(|part| runs[*part].0.place()), into[i]) {
            // Others may have begun anew and replaced the file.
            let was_resumed = runs[host].0.begun > 0;
            parts()
                .filter(|part| *part != host && was_resumed)
                .chain([i])
                .for_each(|part| into[part] = Some(host));
        }
    }
    into
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
        (&self.method, self.seed) == (&other.method, other.seed)
            && (has_same_map || self.is_edited() || other.is_edited())
    }

    /// Whether its map was edited while it trained.
    pub fn is_edited(&self) -> bool {
        self.fingerprint.as_deref() == Some(EDITED)
    }

    /// Whether these records go on from a checkpoint of `other`.
    pub fn is_resumed_from(&self, other: &Self) -> bool {
        // Older records name only the checkpoint that they write, which was often the same.
        let from = self.resumed.as_ref().or(self.checkpoint.as_ref()).map(|path| whole(path));
        let written = other.checkpoint.iter().chain([&other.source]).chain(&other.others);
        self.begun > other.begun
            && self.is_same(other)
            && from.is_some_and(|from| written.into_iter().any(|path| whole(path) == from))
    }

    /// Returns its place among the parts of a run that was resumed: the last one began last.
    pub fn place(&self) -> (u64, u64) {
        (self.begun, self.updates)
    }

    /// Takes in what was read from another file of this run, and is left out besides.
    fn absorb(&mut self, part: &Self) {
        self.others.push(part.source.clone());
        self.others.extend(part.others.iter().cloned());
        if self.kind == Kind::Result {
            return;
        }
        if part.kind != Kind::Checkpoint {
            return self.continue_from(part.clone());
        }
        let at = |last: bool| {
            let own = if last { self.evaluations.last() } else { self.evaluations.first() };
            own.map_or(u64::MAX, |at| at.updates)
        };
        let (first, last) = (at(false), at(true));
        let of_part = |is_new: &dyn Fn(u64) -> bool| {
            let new = part.evaluations.iter().filter(|at| is_new(at.updates));
            new.cloned().collect::<Vec<_>>()
        };
        let (earlier, later) = (of_part(&|at| at < first), of_part(&|at| at > last));
        self.evaluations.splice(0..0, earlier);
        self.evaluations.extend(later);
        if part.updates > self.updates && self.kind != Kind::Records(Ending::Open) {
            self.kind = Kind::Records(Ending::Continued);
        }
        self.updates = self.updates.max(part.updates);
    }
}

#[cfg(test)]
mod tests {
    use super::super::records;
    use super::*;
    use crate::experiment::job::EvaluationAt;

    const SEED: u64 = 3;

    /// Returns a run with evaluations after these thousands of updates, the last of them its end.
    fn run(kind: Kind, source: &str, checkpoint: Option<&str>, evaluated: &[u64]) -> Dated {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.jsonl");
        let score = r#"{"success":0.5,"spl":null,"steps_ratio":null,"by_distance":[]}"#;
        let mut text = format!(
            "{{\"event\":\"start\",\"world\":\"maze\",\"map\":{{\"name\":\"room\"}},\
             \"method\":\"gdg\",\"preset\":\"default\",\"settings\":{{}},\"seed\":{SEED}}}\n"
        );
        for thousands in evaluated {
            text += &format!(
                "{{\"event\":\"evaluation\",\"updates\":{thousands}000,\"greedy\":{score},\
                 \"planned\":null}}\n"
            );
        }
        std::fs::write(&path, text).expect("a file");
        let mut run = records::read(&path).expect("a run").remove(0);
        run.kind = kind;
        run.source = source.into();
        run.checkpoint = checkpoint.map(PathBuf::from);
        (Arc::new(run), None)
    }

    /// Returns each run's file, the others that belong to it, and thousands of updates at its
    /// evaluations.
    fn joined(runs: &[&Dated]) -> Vec<String> {
        let runs = join(runs.iter().map(|run| (*run).clone()).collect());
        let text = |(run, _): &Dated| {
            let others: Vec<String> =
                run.others.iter().map(|path| path.display().to_string()).collect();
            let at: Vec<u64> = run.evaluations.iter().map(|at| at.updates / 1_000).collect();
            format!("{} [{}] {at:?}", run.source.display(), others.join(" "))
        };
        runs.iter().map(text).collect()
    }

    #[test]
    fn records_and_the_checkpoint_that_they_name_are_one_run() {
        let done = Kind::Records(Ending::Finished);
        let records = run(done, "run.jsonl", Some("./saves/a.safetensors"), &[1, 2]);
        let same = run(Kind::Checkpoint, "saves/a.safetensors", None, &[1, 2]);
        assert_eq!(joined(&[&records, &same]), ["run.jsonl [saves/a.safetensors] [1, 2]"]);
        let further = run(Kind::Checkpoint, "saves/a.safetensors", None, &[1, 2, 3]);
        assert_eq!(joined(&[&records, &further]), ["run.jsonl [saves/a.safetensors] [1, 2, 3]"]);
        let resumed = join(vec![records.clone(), further.clone()]).remove(0).0;
        assert_eq!((resumed.state(None).name(), resumed.updates), ("saved", 3_000));
        let other = run(Kind::Checkpoint, "saves/b.safetensors", None, &[1, 2]);
        assert_eq!(joined(&[&records, &other]).len(), 2, "it does not name that one");
        let mut replaced = further.clone();
        Arc::make_mut(&mut replaced.0).seed = SEED + 1;
        assert_eq!(joined(&[&records, &replaced]).len(), 2, "another run has replaced it");
    }

    #[test]
    fn the_records_of_both_parts_of_a_resumed_run_are_one_run() {
        let path = Some("saves/a.safetensors");
        let first = run(Kind::Records(Ending::Interrupted), "1.jsonl", path, &[1, 2]);
        let checkpoint = run(Kind::Checkpoint, "saves/a.safetensors", None, &[1, 2, 3]);
        let mut second = run(Kind::Records(Ending::Open), "2.jsonl", path, &[3, 4]);
        assert_eq!(
            joined(&[&first, &checkpoint, &second]),
            ["1.jsonl [] [1, 2]", "2.jsonl [saves/a.safetensors] [1, 2, 3, 4]"],
            "a run that began anew has replaced the file"
        );
        Arc::make_mut(&mut second.0).begun = 2_000;
        assert_eq!(
            joined(&[&first, &checkpoint, &second]),
            ["2.jsonl [1.jsonl saves/a.safetensors] [1, 2, 3, 4]"]
        );
        // A checkpoint is written between two records.
        let later = run(Kind::Checkpoint, "saves/a.safetensors", None, &[1, 2, 3, 4, 5]);
        let now = Some(SystemTime::now());
        let still = join(vec![later, (second.0, now)]).remove(0).0;
        assert_eq!((still.state(now).name(), still.updates), ("running", 5_000));
    }

    #[test]
    fn what_a_part_lacks_comes_from_those_that_it_was_resumed_from() {
        let part = |source, begun: u64, evaluated: &[u64]| {
            let kind = Kind::Records(Ending::Interrupted);
            let mut part = run(kind, source, Some("saves/a.safetensors"), evaluated);
            let run = Arc::make_mut(&mut part.0);
            run.begun = 1_000 * begun;
            run.updates = run.updates.max(run.begun);
            // Tells the parts apart.
            run.evaluations.iter_mut().for_each(|at| at.seconds = Some(begun as f64));
            part
        };
        let checkpoint = run(Kind::Checkpoint, "saves/a.safetensors", None, &[1, 2]);
        let first = part("1.jsonl", 0, &[1, 2, 3, 4]);
        let shorter = part("2.jsonl", 2, &[3]);
        let both = join(vec![first.clone(), shorter, checkpoint.clone()]).remove(0).0;
        assert_eq!((both.source.to_str(), both.updates), (Some("2.jsonl"), 3_000));
        let found = |run: &SavedRun| {
            let at = |at: &EvaluationAt| (at.updates / 1_000, at.seconds.unwrap_or(f64::NAN));
            run.evaluations.iter().map(at).collect::<Vec<_>>()
        };
        assert_eq!(found(&both), [(1, 0.0), (2, 0.0), (3, 2.0)]);
        let unevaluated = part("2.jsonl", 2, &[]);
        let both = join(vec![unevaluated, checkpoint.clone(), first.clone()]).remove(0).0;
        assert_eq!(found(&both), [(1, 0.0), (2, 0.0)]);
        let (second, third) = (part("2.jsonl", 2, &[3, 4, 5]), part("3.jsonl", 4, &[5, 6]));
        let all = join(vec![third, first, checkpoint, second]).remove(0).0;
        assert_eq!(
            found(&all),
            [(1, 0.0), (2, 0.0), (3, 2.0), (4, 2.0), (5, 4.0), (6, 4.0)],
            "the later part where they overlap"
        );
        assert_eq!(all.source.to_str(), Some("3.jsonl"));
    }

    #[test]
    fn results_replace_what_else_there_is_of_their_job() {
        let result = run(Kind::Result, "jobs/a.json", None, &[5]);
        let records = run(Kind::Records(Ending::Open), "jobs/a.jsonl", None, &[4]);
        let checkpoint = run(Kind::Checkpoint, "jobs/a.safetensors", None, &[5]);
        assert_eq!(
            joined(&[&records, &result, &checkpoint]),
            ["jobs/a.json [jobs/a.jsonl jobs/a.safetensors] [5]"]
        );
    }
}
