//! Candidates as plain numbers, for checkpoints.

use std::sync::Arc;

use super::paths::DOUBT_PASSES;
use super::{Candidates, KnownPaths, Path, UNOBSERVED, Visit, WalkRecord};
use crate::bridge::hops::HopOutcomes;
use crate::bridge::settings::MAX_FACTOR;
use crate::learn::GoalIndex;
use crate::store::{Store, StoreError};

/// Upper bound on the candidate ids that a run may assign.
const MAX_ID: u32 = 1 << 31;

/// Added to the candidate of a visit whose agent was at the candidate itself. Indices are smaller
/// than ids.
const EXACT: u32 = MAX_ID;

/// Full state of [`Candidates`], as plain numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CandidatesState {
    /// Minimum distance between candidates; older formats have a second, unused number.
    pub spacing: Vec<f32>,
    /// `(candidates, state_dim)`.
    pub states: Vec<f32>,
    /// The candidates' ids, followed by the next id to assign.
    pub ids: Vec<u32>,
    /// End of each candidate's range in `to` and `steps`.
    pub ends: Vec<u32>,
    /// Index of the candidate that each observed path leads to.
    pub to: Vec<u32>,
    /// Fewest steps of each observed path.
    pub steps: Vec<u16>,
    /// The same of trajectories that began at its start itself; empty in older formats.
    pub from_start: Vec<u16>,
    /// The same of trajectories that ended at its end itself; empty in older formats.
    pub to_end: Vec<u16>,
    /// Number of trajectories that have shown it, as far as it is counted; empty in older formats.
    pub passes: Vec<u16>,
    /// Four numbers per pair: from and to (ids), arrived, failed.
    pub practice: Vec<u32>,
    /// Each agent's clock, number of visits, and visits.
    pub visits: Vec<u32>,
    /// Discounted numbers of arrivals and failures, by D; empty in older formats.
    pub hops: Vec<f32>,
    /// 1 if space has turned out to be open, 0 otherwise; empty in older formats.
    pub is_open: Vec<u32>,
}

impl CandidatesState {
    /// Writes the state to `store` under names that start with `prefix`.
    pub fn write(self, store: &mut Store, prefix: &str) {
        store.put(format!("{prefix}.spacing"), self.spacing);
        store.put(format!("{prefix}.states"), self.states);
        store.put(format!("{prefix}.names"), self.ids);
        store.put(format!("{prefix}.observed.ends"), self.ends);
        store.put(format!("{prefix}.observed.to"), self.to);
        store.put(format!("{prefix}.observed.steps"), self.steps);
        store.put(format!("{prefix}.observed.from_start"), self.from_start);
        store.put(format!("{prefix}.observed.to_end"), self.to_end);
        store.put(format!("{prefix}.observed.passes"), self.passes);
        store.put(format!("{prefix}.practice"), self.practice);
        store.put(format!("{prefix}.visits"), self.visits);
        store.put(format!("{prefix}.hops"), self.hops);
        store.put(format!("{prefix}.open"), self.is_open);
    }

    /// Reads the state that [`Self::write`] wrote.
    ///
    /// # Errors
    /// Returns an error if a part is missing or has the wrong type.
    pub fn read(store: &Store, prefix: &str) -> Result<Self, StoreError> {
        let ids = store.u32(&format!("{prefix}.names"))?.to_vec();
        let (dense, hops) = (format!("{prefix}.observed"), format!("{prefix}.hops"));
        let is_open = format!("{prefix}.open");
        let (ends, to, steps) = if store.has(&dense) {
            // Older formats hold a dense table of all pairs.
            to_sparse(store.u16(&dense)?, ids.len().saturating_sub(1))
        } else {
            (
                store.u32(&format!("{prefix}.observed.ends"))?.to_vec(),
                store.u32(&format!("{prefix}.observed.to"))?.to_vec(),
                store.u16(&format!("{prefix}.observed.steps"))?.to_vec(),
            )
        };
        let newer = |part: &str| {
            let name = format!("{prefix}.observed.{part}");
            if store.has(&name) { store.u16(&name).map(<[u16]>::to_vec) } else { Ok(Vec::new()) }
        };
        Ok(Self {
            from_start: newer("from_start")?,
            to_end: newer("to_end")?,
            passes: newer("passes")?,
            spacing: store.f32(&format!("{prefix}.spacing"))?.to_vec(),
            states: store.f32(&format!("{prefix}.states"))?.to_vec(),
            ids,
            ends,
            to,
            steps,
            practice: store.u32(&format!("{prefix}.practice"))?.to_vec(),
            visits: store.u32(&format!("{prefix}.visits"))?.to_vec(),
            hops: if store.has(&hops) { store.f32(&hops)?.to_vec() } else { Vec::new() },
            is_open: if store.has(&is_open) { store.u32(&is_open)?.to_vec() } else { Vec::new() },
        })
    }
}

/// Converts a dense table of all pairs of `n` candidates to `ends`, `to` and `steps`.
fn to_sparse(table: &[u16], n: usize) -> (Vec<u32>, Vec<u32>, Vec<u16>) {
    let (mut ends, mut to, mut steps) = (Vec::new(), Vec::new(), Vec::new());
    for (from, row) in table.chunks_exact(n.max(1)).enumerate() {
        for (other, observed) in
            row.iter().enumerate().filter(|(other, steps)| *other != from && **steps != UNOBSERVED)
        {
            to.push(other as u32);
            steps.push(*observed);
        }
        ends.push(to.len() as u32);
    }
    (ends, to, steps)
}

impl Candidates {
    /// Returns the full state, for a checkpoint.
    pub fn state(&self) -> CandidatesState {
        let mut state = CandidatesState {
            spacing: vec![self.spacing],
            is_open: vec![u32::from(self.is_open)],
            hops: self.hops.state(),
            ..CandidatesState::default()
        };
        state.states.clone_from(&self.states);
        state.ids.clone_from(&self.ids);
        state.ids.push(self.next_id);
        for (id, paths) in self.ids.iter().zip(&self.paths) {
            for path in &paths.observed {
                let [from_start, to_end] = path.exact;
                state.to.push(path.to);
                state.steps.push(path.fewest);
                state.from_start.push(from_start);
                state.to_end.push(to_end);
                state.passes.push(path.passes.into());
            }
            state.ends.push(state.to.len() as u32);
            let numbers = |(to, p): (&u32, &WalkRecord)| {
                [*id, *to, u32::from(p.arrived), u32::from(p.failed)]
            };
            state.practice.extend(paths.practice.iter().flat_map(numbers));
        }
        for (clock, own) in self.clocks.iter().zip(&self.visits) {
            state.visits.extend([*clock, own.len() as u32]);
            let numbers = |visit: &Visit| {
                let exact = if visit.exact { EXACT } else { 0 };
                [visit.step, visit.candidate | exact]
            };
            state.visits.extend(own.iter().flat_map(numbers));
        }
        state
    }

    /// Restores the state that [`Self::state`] returned.
    ///
    /// # Errors
    /// Returns an error if `state` was saved with other sizes or holds numbers out of range.
    pub fn restore(&mut self, state: &CandidatesState) -> Result<(), StoreError> {
        let inconsistent =
            || StoreError::inconsistent("the stored bridge candidates do not fit these settings");
        let n = state.states.len() / self.spec.state_dim();
        // Older versions kept more where edges are unverified; newcomers thin them out.
        if n > MAX_FACTOR * self.target_count
            || !state.states.len().is_multiple_of(self.spec.state_dim())
        {
            return Err(inconsistent());
        }
        let ([spacing] | [spacing, _]) = state.spacing[..] else { return Err(inconsistent()) };
        // The spacing never falls below its initial value; from far below, it would take hours to
        // grow.
        let plausible = spacing >= 0.5 * self.least_spacing && spacing.is_finite();
        if !(plausible && state.states.iter().all(|v| v.is_finite())) {
            return Err(StoreError::inconsistent(
                "the stored bridge candidates contain values out of range",
            ));
        }
        let (next_id, ids) = state.ids.split_last().ok_or_else(inconsistent)?;
        let sorted = ids.is_sorted_by(|a, b| a < b) && ids.last().is_none_or(|last| last < next_id);
        if ids.len() != n || !sorted || *next_id > MAX_ID {
            return Err(inconsistent());
        }
        let mut paths = parse_paths(state, n).ok_or_else(inconsistent)?;
        let (practice, []) = state.practice.as_chunks::<4>() else { return Err(inconsistent()) };
        for [from, to, arrived, failed] in practice {
            let row = ids.binary_search(from).map_err(|_| inconsistent())?;
            let practice = WalkRecord { arrived: *arrived as u16, failed: *failed as u16 };
            paths[row].practice.insert(*to, practice);
        }
        if !state.hops.is_empty() {
            self.hops = HopOutcomes::from_state(&state.hops).ok_or_else(inconsistent)?;
        }
        self.restore_visits(&state.visits, n).ok_or_else(inconsistent)?;
        (self.spacing, self.is_open) =
            (spacing, state.is_open.first().is_some_and(|open| *open != 0));
        self.states.clone_from(&state.states);
        let mut places = GoalIndex::new(&self.spec);
        state
            .states
            .chunks_exact(self.spec.state_dim())
            .for_each(|state| places.push(&self.achieved(state)));
        self.goal_index = Arc::new(places);
        self.ids = ids.to_vec();
        self.next_id = *next_id;
        self.paths = paths.into_iter().map(Arc::new).collect();
        Ok(())
    }

    /// Restores the agents' visits to `n` candidates; returns `None` if they are inconsistent.
    fn restore_visits(&mut self, numbers: &[u32], n: usize) -> Option<()> {
        let mut numbers = numbers.iter().copied();
        let mut next = || numbers.next();
        for (clock, visits) in self.clocks.iter_mut().zip(&mut self.visits) {
            *clock = next()?;
            let count = next()?;
            visits.clear();
            let mut before = 0;
            for _ in 0..count {
                let (step, number) = (next()?, next()?);
                let (candidate, exact) = (number & !EXACT, number & EXACT != 0);
                if candidate as usize >= n || step < before || step >= *clock {
                    return None;
                }
                before = step;
                visits.push_back(Visit { step, candidate, exact });
            }
        }
        Some(())
    }
}

/// Returns the observed paths from each of `n` candidates, or `None` unless each list leads to
/// other candidates in ascending order.
fn parse_paths(state: &CandidatesState, n: usize) -> Option<Vec<KnownPaths>> {
    let whole =
        state.ends.len() == n && state.ends.is_sorted() && state.to.len() == state.steps.len();
    if !whole || state.ends.last().map_or(0, |end| *end as usize) != state.to.len() {
        return None;
    }
    // In older formats, no path is in doubt.
    let column = |numbers: &[u16], all: u16| {
        if numbers.is_empty() { vec![all; state.to.len()] } else { numbers.to_vec() }
    };
    let (from_start, to_end) = (column(&state.from_start, 0), column(&state.to_end, 0));
    let passes = column(&state.passes, DOUBT_PASSES.into());
    if [&from_start, &to_end, &passes].iter().any(|numbers| numbers.len() != state.to.len()) {
        return None;
    }
    let path = |i: usize| Path {
        to: state.to[i],
        fewest: state.steps[i],
        exact: [from_start[i], to_end[i]],
        passes: passes[i].min(DOUBT_PASSES.into()) as u8,
    };
    let mut first = 0;
    let row = |(from, end): (usize, &u32)| {
        let own = std::mem::replace(&mut first, *end as usize)..*end as usize;
        let observed: Vec<Path> = own.map(path).collect();
        let others = observed.iter().all(|path| (path.to as usize) < n && path.to as usize != from);
        let sound = others && observed.is_sorted_by(|a, b| a.to < b.to);
        sound.then(|| KnownPaths { observed, ..KnownPaths::default() })
    };
    state.ends.iter().enumerate().map(row).collect()
}
