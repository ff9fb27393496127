//! The methods that a run has used, so that results are attributed to the right one.

use serde::{Deserialize, Serialize};

/// Maximum number of stretches; beyond it, the oldest are forgotten.
const MAX_STRETCHES: usize = 200;

/// Maximum length of a method's name.
const MAX_NAME_BYTES: usize = 200;

/// A part of a run under one method.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stretch {
    /// Updates counted when it began.
    pub from: u64,
    /// Updates that a learner had done when it began.
    pub learned: u64,
    /// The method.
    pub method: String,
    /// Whether its learner learns; if not, updates are counted when due but not done.
    pub learns: bool,
}

/// A method as a run uses it.
#[derive(Clone, Debug)]
pub struct UsedMethod {
    /// Its name.
    pub name: String,
    /// Whether its learner learns.
    pub learns: bool,
}

impl UsedMethod {
    fn stretch(self, from: u64, learned: u64) -> Stretch {
        Stretch { from, learned, method: self.name, learns: self.learns }
    }
}

/// The methods of a run, in order. Empty if the method never changed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Methods(Vec<Stretch>);

impl Methods {
    /// Records a change of the method after `updates`.
    pub fn change(&mut self, updates: u64, before: UsedMethod, now: UsedMethod) {
        let learned = self.learned(updates, before.learns);
        if self.0.is_empty() {
            self.0.push(before.stretch(0, 0));
        }
        // A method that ran for no update leaves no stretch.
        self.0.pop_if(|last| last.from == updates);
        if self.0.last().is_none_or(|last| last.method != now.name) {
            self.0.push(now.stretch(updates, learned));
        }
        if self.0.len() > MAX_STRETCHES {
            self.0.remove(0);
        }
    }

    /// Returns all of them, oldest first.
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

    /// Returns whether an evaluation made at `updates` was of the current method.
    pub fn is_current(&self, updates: u64) -> bool {
        self.index(updates) + 1 >= self.0.len()
    }

    /// Returns whether the values are plausible.
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

    fn method(name: &str) -> UsedMethod {
        UsedMethod { name: name.to_owned(), learns: name != "random" }
    }

    #[test]
    fn what_does_not_learn_counts_no_updates() {
        let mut methods = Methods::default();
        assert_eq!((methods.learned(70, true), methods.learned(70, false)), (70, 0));
        methods.change(100, method("gdg"), method("random"));
        methods.change(400, method("random"), method("gdg"));
        let learned = [50, 100, 250, 400, 450].map(|updates| methods.learned(updates, true));
        assert_eq!(learned, [50, 100, 100, 100, 150]);
        assert!(methods.is_sound());
    }

    #[test]
    fn evaluations_belong_to_the_method_that_they_were_made_of() {
        let mut methods = Methods::default();
        assert!(methods.is_current(0) && methods.is_current(100));
        methods.change(100, method("gdg"), method("random"));
        assert_eq!([0, 100, 101].map(|updates| methods.is_current(updates)), [false, false, true]);
        methods.change(400, method("random"), method("gdg"));
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
