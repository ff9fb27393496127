//! A run's history: curves of losses and coverage, evaluations and event log. Checkpoints contain
//! it; training does not depend on it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::score::{Evaluation, SuccessSummary};
use crate::env::Spec;
use crate::store::StoreError;

const POINT_EVERY_UPDATES: u64 = 50;

/// Maximum number of points; beyond it, every other point is dropped.
const MAX_POINTS: usize = 2048;

/// Maximum number of evaluations, thinned in the same way.
const MAX_EVALUATIONS: usize = 1000;

/// Maximum number of edits of the world (the oldest are dropped).
const MAX_EDITS: usize = 1000;

/// Maximum number of log entries (the oldest are dropped), and of characters per entry.
pub const MAX_LOG_ENTRIES: usize = 1000;
const MAX_CHARACTERS: usize = 500;

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    pub updates: u64,
    /// Running means of the losses of critic, model and actor.
    pub losses: [f32; 3],
    /// Fraction of the world explored by the agents, if defined.
    pub coverage: Option<f32>,
}

/// How far a run was when it was evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Moment {
    pub updates: u64,
    /// Environment steps, summed over all agents.
    pub env_steps: u64,
    /// Training time in seconds, without evaluation.
    pub seconds: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LogEntry {
    /// Training time at the event, in seconds.
    pub seconds: f64,
    pub updates: u64,
    pub text: String,
}

/// State of a front end that is restored when a run is resumed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Notes {
    pub log: Vec<LogEntry>,
    /// The goal that was shown, `(goal_dim)`; empty if there was none.
    pub goal: Vec<f32>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct History {
    every: u64,
    points: Arc<Vec<CurvePoint>>,
    evaluations: Arc<Vec<(u64, Evaluation)>>,
    moments: Vec<Moment>,
    /// The methods used; only in runs whose method has changed.
    pub(super) methods: Methods,
    edits: Vec<u64>,
    #[serde(flatten)]
    pub notes: Notes,
}

impl Default for History {
    fn default() -> Self {
        Self {
            every: POINT_EVERY_UPDATES,
            points: Arc::default(),
            evaluations: Arc::default(),
            moments: Vec::new(),
            methods: Methods::default(),
            edits: Vec::new(),
            notes: Notes::default(),
        }
    }
}

impl History {
    /// Adds losses and coverage at an update; every `every`-th update becomes a point of the
    /// curves.
    pub fn add_point(
        &mut self,
        updates: u64,
        losses: [f64; 3],
        coverage: impl FnOnce() -> Option<f64>,
    ) {
        if !updates.is_multiple_of(self.every) {
            return;
        }
        let points = Arc::make_mut(&mut self.points);
        let losses = losses.map(|loss| loss as f32);
        points.push(CurvePoint { updates, losses, coverage: coverage().map(|share| share as f32) });
        if points.len() > MAX_POINTS {
            self.every *= 2;
            points.retain(|point| point.updates.is_multiple_of(self.every));
        }
    }

    pub fn add_evaluation(&mut self, made: Moment, evaluation: Evaluation) {
        let evaluations = Arc::make_mut(&mut self.evaluations);
        evaluations.push((made.updates, evaluation));
        self.moments.push(made);
        if evaluations.len() > MAX_EVALUATIONS {
            // Always keeps the latest one.
            let last = evaluations.len() - 1;
            let mut i = 0;
            evaluations.retain(|_| {
                i += 1;
                (i - 1) % 2 == last % 2
            });
            self.moments.retain(|made| evaluations.iter().any(|(at, _)| *at == made.updates));
        }
    }

    pub(super) fn add_edit(&mut self, updates: u64) {
        if self.edits.last() != Some(&updates) {
            let surplus = (self.edits.len() + 1).saturating_sub(MAX_EDITS);
            self.edits.drain(..surplus);
            self.edits.push(updates);
        }
    }

    pub fn edits(&self) -> &[u64] {
        &self.edits
    }

    pub fn points(&self) -> &Arc<Vec<CurvePoint>> {
        &self.points
    }

    /// Returns the evaluations with their updates, oldest first.
    pub fn evaluations(&self) -> &Arc<Vec<(u64, Evaluation)>> {
        &self.evaluations
    }

    /// Returns when an evaluation was made. There may be several before the first update.
    pub fn moment(&self, i: usize) -> Option<Moment> {
        let (updates, _) = self.evaluations.get(i)?;
        let own = self.moments.get(i).filter(|_| self.moments.len() == self.evaluations.len());
        own.or_else(|| self.moments.iter().rev().find(|made| made.updates == *updates)).copied()
    }

    pub fn methods(&self) -> &Methods {
        &self.methods
    }

    /// Returns the summary of the latest evaluation, if it was of the current method.
    pub fn success(&self) -> Option<SuccessSummary> {
        let own = self.evaluations.last().filter(|(updates, _)| self.methods.is_current(*updates));
        own.map(|(updates, evaluation)| evaluation.success(*updates))
    }

    pub fn check(&self, spec: &Spec) -> Result<(), StoreError> {
        let Notes { log, goal } = &self.notes;
        let short = |entry: &LogEntry| {
            entry.seconds.is_finite() && entry.text.chars().count() <= MAX_CHARACTERS
        };
        let sound = self.every > 0
            && self.points.len() <= MAX_POINTS
            && self.points.iter().all(|CurvePoint { losses, coverage, .. }| {
                losses.iter().all(|loss| loss.is_finite())
                    && coverage.is_none_or(|share| (0.0..=1.0).contains(&share))
            })
            && self.points.is_sorted_by_key(|point| point.updates)
            && self.evaluations.len() <= MAX_EVALUATIONS
            && self.evaluations.iter().all(|(_, evaluation)| evaluation.is_finite())
            && self.moments.len() <= MAX_EVALUATIONS
            && self.moments.iter().all(|made| made.seconds.is_finite())
            && self.methods.is_sound()
            && self.edits.len() <= MAX_EDITS
            && self.edits.is_sorted()
            && log.len() <= MAX_LOG_ENTRIES
            && log.iter().all(short)
            && (goal.is_empty() || goal.len() == spec.goal_dim())
            && goal.iter().all(|coordinate| coordinate.is_finite());
        StoreError::unless(sound, "its history is out of range")
    }
}

impl LogEntry {
    /// Creates an entry, truncating the text to the maximum length.
    pub fn new(seconds: f64, updates: u64, text: &str) -> Self {
        Self { seconds, updates, text: crate::text::truncated(text, MAX_CHARACTERS) }
    }
}

const MAX_STRETCHES: usize = 200;

const MAX_NAME_BYTES: usize = 200;

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stretch {
    pub from: u64,
    /// Updates that a learner had done when it began.
    pub learned: u64,
    pub method: String,
    /// Whether its learner learns; if not, updates are counted when due but not done.
    pub learns: bool,
}

/// The methods of a run, in order. Empty if the method never changed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Methods(Vec<Stretch>);

impl Methods {
    /// Records a change of the method after `updates`: names, and whether their learners learn.
    pub(super) fn change(&mut self, updates: u64, before: (String, bool), now: (String, bool)) {
        let learned = self.learned(updates, before.1);
        let stretch = |from, learned, (method, learns)| Stretch { from, learned, method, learns };
        if self.0.is_empty() {
            self.0.push(stretch(0, 0, before));
        }
        // A method that ran for no update leaves no stretch.
        self.0.pop_if(|last| last.from == updates);
        if self.0.last().is_none_or(|last| last.method != now.0) {
            self.0.push(stretch(updates, learned, now));
        }
        if self.0.len() > MAX_STRETCHES {
            self.0.remove(0);
        }
    }

    pub fn stretches(&self) -> &[Stretch] {
        &self.0
    }

    /// Returns how many of the first `updates` were done by a learner, given whether the current
    /// one learns.
    pub fn learned(&self, updates: u64, learns_now: bool) -> u64 {
        match self.0.iter().rev().find(|stretch| stretch.from <= updates) {
            Some(stretch) if stretch.learns => stretch.learned + (updates - stretch.from),
            Some(stretch) => stretch.learned,
            None if learns_now || !self.0.is_empty() => updates,
            None => 0,
        }
    }

    /// Returns the index of the stretch that an evaluation made at `updates` belongs to.
    pub fn index(&self, updates: u64) -> usize {
        self.0.iter().rposition(|stretch| stretch.from < updates).unwrap_or(0)
    }

    /// Returns the name of the method at `updates`, if the method ever changed.
    pub fn name(&self, updates: u64) -> Option<&str> {
        self.0.get(self.index(updates)).map(|stretch| stretch.method.as_str())
    }

    pub fn is_current(&self, updates: u64) -> bool {
        self.index(updates) + 1 >= self.0.len()
    }

    pub(super) fn is_sound(&self) -> bool {
        self.0.len() <= MAX_STRETCHES
            && self.0.is_sorted_by_key(|stretch| (stretch.from, stretch.learned))
            && self.0.iter().all(|stretch| {
                stretch.learned <= stretch.from && stretch.method.len() <= MAX_NAME_BYTES
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::tests::positions;

    fn spec() -> Spec {
        positions(&[(0.0, 1.0); 2])
    }

    #[test]
    fn curves_are_thinned_evenly_and_keep_their_ends() {
        let mut history = History::default();
        let last = 40 * MAX_POINTS as u64 * POINT_EVERY_UPDATES;
        (1..=last).for_each(|updates| history.add_point(updates, [1.0; 3], || Some(0.5)));
        let points = history.points();
        assert!((MAX_POINTS / 2..=MAX_POINTS).contains(&points.len()), "{}", points.len());
        assert!(points.windows(2).all(|pair| pair[1].updates - pair[0].updates == history.every));
        assert!(last - points[points.len() - 1].updates < history.every);
        history.check(&spec()).expect("a sound history");
    }

    #[test]
    fn edits_are_kept_once_an_update_and_the_oldest_are_dropped() {
        let mut history = History::default();
        let most = MAX_EDITS as u64;
        (0..most + 3).for_each(|at| (0..3).for_each(|_| history.add_edit(at)));
        assert_eq!(history.edits(), (3..most + 3).collect::<Vec<_>>());
        history.check(&spec()).expect("a sound history");
        let text = serde_json::to_string(&history).expect("JSON");
        assert_eq!(serde_json::from_str::<History>(&text).expect("a history"), history);
        let refused = |change: fn(&mut History)| {
            let mut history = history.clone();
            change(&mut history);
            history.check(&spec()).is_err()
        };
        assert!(refused(|history| history.edits = vec![2, 1]), "not in order");
        assert!(refused(|history| history.notes.goal = vec![1.0]), "no place in the plane");
        assert!(refused(|history| history.notes.goal = vec![1.0, f32::NAN]));
    }

    fn method(name: &str) -> (String, bool) {
        (name.to_owned(), name != "random")
    }

    #[test]
    fn what_does_not_learn_counts_no_updates_and_evaluations_belong_to_their_method() {
        let mut methods = Methods::default();
        assert_eq!((methods.learned(70, true), methods.learned(70, false)), (70, 0));
        assert!(methods.is_current(0) && methods.is_current(100));
        methods.change(100, method("gdg"), method("random"));
        assert_eq!([0, 100, 101].map(|updates| methods.is_current(updates)), [false, false, true]);
        methods.change(400, method("random"), method("gdg"));
        let learned = [50, 100, 250, 400, 450].map(|updates| methods.learned(updates, true));
        assert_eq!(learned, [50, 100, 100, 100, 150]);
        assert_eq!([100, 101, 400, 401].map(|updates| methods.index(updates)), [0, 1, 1, 2]);
        assert_eq!((methods.name(50), methods.name(200)), (Some("gdg"), Some("random")));
    }

    #[test]
    fn changes_without_an_update_in_between_leave_no_trace() {
        let mut methods = Methods::default();
        methods.change(100, method("gdg"), method("random"));
        methods.change(100, method("random"), method("sorb"));
        assert!(methods.stretches().iter().map(|s| s.method.as_str()).eq(["gdg", "sorb"]));
        methods.change(100, method("sorb"), method("gdg"));
        assert_eq!(methods.stretches().len(), 1);
        assert!(methods.is_current(50), "it is the same method again");
        for i in 0..2 * MAX_STRETCHES as u64 {
            let (a, b) = if i % 2 == 0 { ("gdg", "random") } else { ("random", "gdg") };
            methods.change(200 + i, method(a), method(b));
        }
        assert!(methods.is_sound());
    }
}
