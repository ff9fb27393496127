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

    const PATH: &str = "saves/a.safetensors";
    const OPEN: Kind = Kind::Records(Ending::Open);

    /// Returns a run with evaluations after these thousands of updates, the last of them its end;
    /// its records name a checkpoint and begin at thousands of updates.
    fn run(kind: Kind, source: &str, begun: u64, evaluated: &[u64]) -> Dated {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.jsonl");
        let mut text = "{\"event\":\"start\",\"world\":\"maze\",\"map\":{\"name\":\"room\"},\
             \"method\":\"gdg\",\"preset\":\"default\",\"settings\":{},\"seed\":3}\n"
            .to_owned();
        for thousands in evaluated {
            // The time tells the parts apart.
            text += &format!(
                "{{\"event\":\"evaluation\",\"updates\":{thousands}000,\"seconds\":{begun},\
                 \"greedy\":{{\"success\":0.5,\"spl\":null,\"steps_ratio\":null,\
                 \"by_distance\":[]}},\"planned\":null}}\n"
            );
        }
        std::fs::write(&path, text).expect("a file");
        let mut run = records::read(&path).expect("a run").remove(0);
        run.checkpoint = matches!(kind, Kind::Records(_)).then(|| format!("./{PATH}").into());
        (run.kind, run.source, run.begun) = (kind, source.into(), 1_000 * begun);
        run.updates = run.updates.max(run.begun);
        (Arc::new(run), None)
    }

    fn checkpoint(source: &str, evaluated: &[u64]) -> Dated {
        run(Kind::Checkpoint, source, 0, evaluated)
    }

    /// Returns each run's file, the others that belong to it, and thousands of updates at its
    /// evaluations, with the part that they are of.
    fn joined(runs: &[&Dated]) -> Vec<String> {
        let runs = join(runs.iter().map(|run| (*run).clone()).collect());
        let text = |(run, _): &Dated| {
            let others = run.others.iter().map(|path| path.display().to_string());
            let at = run.evaluations.iter();
            let at = at.map(|at| format!("{}.{}", at.updates / 1_000, at.seconds.unwrap_or(9.0)));
            let (others, at) = (others.collect::<Vec<_>>(), at.collect::<Vec<_>>());
            format!("{} [{}] {}", run.source.display(), others.join(" "), at.join(" "))
        };
        runs.iter().map(text).collect()
    }

    #[test]
    fn records_and_the_checkpoint_that_they_name_are_one_run() {
        let records = run(Kind::Records(Ending::Finished), "run.jsonl", 0, &[1, 2]);
        let same = checkpoint(PATH, &[1, 2]);
        assert_eq!(joined(&[&records, &same]), ["run.jsonl [saves/a.safetensors] 1.0 2.0"]);
        let further = checkpoint(PATH, &[1, 2, 3]);
        assert_eq!(joined(&[&records, &further]), ["run.jsonl [saves/a.safetensors] 1.0 2.0 3.0"]);
        let resumed = join(vec![records.clone(), further.clone()]).remove(0).0;
        assert_eq!((resumed.state(None).name(), resumed.updates), ("saved", 3_000));
        let other = checkpoint("saves/b.safetensors", &[1, 2]);
        assert_eq!(joined(&[&records, &other]).len(), 2, "it does not name that one");
        let mut replaced = further;
        Arc::make_mut(&mut replaced.0).seed += 1;
        assert_eq!(joined(&[&records, &replaced]).len(), 2, "another run has replaced it");
        let result = run(Kind::Result, "jobs/a.json", 0, &[5]);
        let records = run(OPEN, "jobs/a.jsonl", 0, &[4]);
        assert_eq!(
            joined(&[&records, &result, &checkpoint("jobs/a.safetensors", &[5])]),
            ["jobs/a.json [jobs/a.jsonl jobs/a.safetensors] 5.0"]
        );
    }

    #[test]
    fn the_records_of_both_parts_of_a_resumed_run_are_one_run() {
        let first = run(Kind::Records(Ending::Interrupted), "1.jsonl", 0, &[1, 2]);
        let saved = checkpoint(PATH, &[1, 2, 3]);
        assert_eq!(
            joined(&[&first, &saved, &run(OPEN, "2.jsonl", 0, &[3, 4])]),
            ["1.jsonl [] 1.0 2.0", "2.jsonl [saves/a.safetensors] 1.0 2.0 3.0 4.0"],
            "a run that began anew has replaced the file"
        );
        let second = run(OPEN, "2.jsonl", 2, &[3, 4]);
        assert_eq!(
            joined(&[&first, &saved, &second]),
            ["2.jsonl [1.jsonl saves/a.safetensors] 1.0 2.0 3.2 4.2"]
        );
        // A checkpoint is written between two records.
        let (later, now) = (checkpoint(PATH, &[1, 2, 3, 4, 5]), Some(SystemTime::now()));
        let still = join(vec![later, (second.0, now)]).remove(0).0;
        assert_eq!((still.state(now).name(), still.updates), ("running", 5_000));
    }

    #[test]
    fn what_a_part_lacks_comes_from_those_that_it_was_resumed_from() {
        let part = |source, begun, evaluated: &[u64]| {
            run(Kind::Records(Ending::Interrupted), source, begun, evaluated)
        };
        let (saved, first) = (checkpoint(PATH, &[1, 2]), part("1.jsonl", 0, &[1, 2, 3, 4]));
        let of = |parts: &[&Dated]| joined(&[parts, &[&saved, &first]].concat());
        let all = "[1.jsonl saves/a.safetensors]";
        assert_eq!(of(&[&part("2.jsonl", 2, &[3])]), [format!("2.jsonl {all} 1.0 2.0 3.2")]);
        assert_eq!(of(&[&part("2.jsonl", 2, &[])]), [format!("2.jsonl {all} 1.0 2.0")]);
        let (second, third) = (part("2.jsonl", 2, &[3, 4, 5]), part("3.jsonl", 4, &[5, 6]));
        assert_eq!(
            of(&[&third, &second]),
            ["3.jsonl [2.jsonl 1.jsonl saves/a.safetensors] 1.0 2.0 3.2 4.2 5.4 6.4"],
            "the later part where they overlap"
        );
    }
}
