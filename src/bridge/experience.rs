//! Bridge candidates, and what trajectories show about the ways between them.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use super::settings::BridgeSettings;
use crate::env::Spec;
use crate::store::{Store, StoreError};

/// Steps between candidates of which no trajectory went from one to the other in time.
pub const NEVER: u16 = u16::MAX;

/// Candidates ever named by a run, at most.
const MOST_NAMES: u32 = 1 << 31;

/// Candidates farther apart than this share of the edge cut-off could hardly be joined by edges. (The fastest agents
/// move a goal radius a step.)
const WIDEST_SPACING: f32 = 0.45;

/// Candidates spread over all states seen, and the fewest steps in which a trajectory went from near one to near
/// another.
///
/// Candidates persist: a state farther than the spacing from all of them becomes one; when there would be too many (or
/// on large maps: many too many), the spacing grows and those that are now too close retire (farthest-point sampling on
/// a stream). *Near* a candidate is within a quarter of the spacing, but never more than the goal radius (what the
/// environment itself calls being there) nor less than half of it: straight-line nearness reaches across thin walls and
/// touching corners.
#[derive(Clone, Debug)]
pub struct Experience {
    spec: Spec,
    /// Candidates wanted, and the most there may be.
    wanted: usize,
    most: usize,
    /// Spacing beyond which there are rather more candidates than wanted.
    widest: f32,
    window: usize,
    spacing: f32,
    /// `(candidates, state_dim)`.
    states: Vec<f32>,
    /// `(candidates, goal_dim)`.
    points: Vec<f32>,
    /// Fewest steps from row to column, `(most, most)`.
    observed: Vec<u16>,
    /// What each candidate is called for as long as it lives: places among the candidates change when some retire.
    names: Vec<u32>,
    /// The next candidate's name.
    next_name: u32,
    /// What became of walks from one candidate to another, by their names.
    practice: BTreeMap<(u32, u32), Practice>,
    /// Each agent's recent visits: step within the episode, candidate.
    visits: Vec<VecDeque<(u32, u32)>>,
    /// Steps of each agent's episode so far.
    clocks: Vec<u32>,
}

/// What became of walks from one candidate to another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Practice {
    /// Walks that arrived in time.
    pub arrived: u16,
    /// Walks in a row that did not.
    pub failed: u16,
}

/// Everything an [`Experience`] knows, as plain numbers, for checkpoints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExperienceState {
    /// Least distance between candidates.
    pub spacing: f32,
    /// `(candidates, state_dim)`.
    pub states: Vec<f32>,
    /// Fewest steps from row to column, `(candidates, candidates)`.
    pub observed: Vec<u16>,
    /// Each agent's clock, number of visits, and visits.
    pub visits: Vec<u32>,
    /// The candidates' names, and behind them the next one's.
    pub names: Vec<u32>,
    /// From, to (by name), arrived, failed: four numbers each.
    pub practice: Vec<u32>,
}

impl ExperienceState {
    /// Writes the state to `store`, its names beginning with `prefix`.
    pub fn write(self, store: &mut Store, prefix: &str) {
        store.put(format!("{prefix}.spacing"), vec![self.spacing]);
        store.put(format!("{prefix}.states"), self.states);
        store.put(format!("{prefix}.observed"), self.observed);
        store.put(format!("{prefix}.visits"), self.visits);
        store.put(format!("{prefix}.names"), self.names);
        store.put(format!("{prefix}.practice"), self.practice);
    }

    /// Reads what [`Self::write`] wrote.
    ///
    /// # Errors
    /// That a part is missing or of another type.
    pub fn read(store: &Store, prefix: &str) -> Result<Self, StoreError> {
        Ok(Self {
            spacing: store.f32(&format!("{prefix}.spacing"))?.first().copied().unwrap_or_default(),
            states: store.f32(&format!("{prefix}.states"))?.to_vec(),
            observed: store.u16(&format!("{prefix}.observed"))?.to_vec(),
            visits: store.u32(&format!("{prefix}.visits"))?.to_vec(),
            names: store.u32(&format!("{prefix}.names"))?.to_vec(),
            practice: store.u32(&format!("{prefix}.practice"))?.to_vec(),
        })
    }
}

impl Experience {
    /// No candidates yet, for `agents` agents.
    pub fn new(spec: &Spec, agents: usize, settings: &BridgeSettings) -> Self {
        Self {
            spec: spec.clone(),
            wanted: settings.candidates,
            most: settings.most_candidates(),
            widest: WIDEST_SPACING * settings.edge_cutoff_steps * spec.goal_radius,
            window: settings.window_steps(),
            spacing: settings.candidate_spacing * spec.goal_radius,
            states: Vec::new(),
            points: Vec::new(),
            observed: vec![NEVER; settings.most_candidates().pow(2)],
            names: Vec::new(),
            next_name: 0,
            practice: BTreeMap::new(),
            visits: vec![VecDeque::new(); agents],
            clocks: vec![0; agents],
        }
    }

    /// A copy of what is known now, without the agents' visits: what graphs are built of and share.
    #[must_use]
    pub fn known(&self) -> Arc<Self> {
        Arc::new(Self { visits: Vec::new(), clocks: Vec::new(), ..self.clone() })
    }

    /// Goes on as `fresh`, but that names go on: practice of old is not taken for that of new candidates.
    pub fn begin_again(&mut self, fresh: Self) {
        *self = Self { next_name: self.next_name, ..fresh };
    }

    /// How many candidates there are.
    pub fn len(&self) -> usize {
        self.states.len() / self.spec.state_dim()
    }

    /// Whether there is no candidate.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
    }

    /// The candidates' states, `(candidates, state_dim)`.
    pub fn states(&self) -> &[f32] {
        &self.states
    }

    /// The candidates as goals, `(candidates, goal_dim)`.
    pub fn points(&self) -> &[f32] {
        &self.points
    }

    /// Fewest steps in which a trajectory went from near `from` to near `to`, [`NEVER`] if none did.
    pub fn observed(&self, from: usize, to: usize) -> u16 {
        if from == to { 0 } else { self.observed[from * self.most + to] }
    }

    /// The name of candidate `i`: it stays the same while others retire.
    pub fn name(&self, i: usize) -> u32 {
        self.names[i]
    }

    /// What became of walks from candidate `from` to candidate `to`.
    pub fn practice(&self, from: usize, to: usize) -> Practice {
        self.practice.get(&(self.names[from], self.names[to])).copied().unwrap_or_default()
    }

    /// Takes note that a walk from one candidate to another, by their names, arrived or did not.
    pub fn practise(&mut self, (from, to): (u32, u32), arrived: bool) {
        let alive = |name: &u32| self.names.binary_search(name).is_ok();
        if from == to || !alive(&from) || !alive(&to) {
            return;
        }
        let practice = self.practice.entry((from, to)).or_default();
        if arrived {
            *practice = Practice { arrived: practice.arrived.saturating_add(1), failed: 0 };
        } else {
            practice.failed = practice.failed.saturating_add(1);
        }
    }

    /// Least distance between candidates, in the environment's unit of length.
    pub fn spacing(&self) -> f32 {
        self.spacing
    }

    /// Within this distance of a candidate an agent is said to be there.
    fn near_radius(&self) -> f32 {
        (self.spacing / 4.0).clamp(0.5 * self.spec.goal_radius, self.spec.goal_radius)
    }

    /// Takes note of the next state of `agent`'s episode.
    pub fn visit(&mut self, agent: usize, state: &[f32]) {
        let (nearest, distance) = self.nearest(state);
        let mut near = (distance < self.near_radius()).then_some(nearest);
        if distance > self.spacing {
            near = self.add(state);
        }
        let clock = self.clocks[agent];
        self.clocks[agent] += 1;
        let visits = &mut self.visits[agent];
        while visits.front().is_some_and(|(step, _)| clock - step > self.window as u32) {
            visits.pop_front();
        }
        let Some(to) = near else { return };
        for (step, from) in visits.iter() {
            let fewest = &mut self.observed[*from as usize * self.most + to];
            *fewest = (*fewest).min((clock - step) as u16);
        }
        visits.push_back((clock, to as u32));
    }

    /// Ends `agent`'s episode: what comes next did not follow from what was before.
    pub fn end_episode(&mut self, agent: usize) {
        self.visits[agent].clear();
        self.clocks[agent] = 0;
    }

    /// The candidate nearest to `state` and its distance; infinite without candidates.
    fn nearest(&self, state: &[f32]) -> (usize, f32) {
        let mut best = (0, f32::INFINITY);
        for (i, point) in self.points.chunks_exact(self.spec.goal_dim()).enumerate() {
            let squared: f32 = self.spec.achieved(state).zip(point).map(|(a, p)| (a - p) * (a - p)).sum();
            if squared < best.1 {
                best = (i, squared);
            }
        }
        (best.0, best.1.sqrt())
    }

    /// Makes `state` a candidate, thinning the others where there is no room; `None` where it then came too close.
    fn add(&mut self, state: &[f32]) -> Option<usize> {
        while self.len() >= self.wanted && (self.spacing < self.widest || self.len() >= self.most) {
            self.spacing *= 1.1;
            self.thin();
            if self.nearest(state).1 <= self.spacing {
                return None;
            }
        }
        self.states.extend(state);
        self.points.extend(self.spec.achieved(state));
        self.names.push(self.next_name);
        self.next_name += 1;
        Some(self.len() - 1)
    }

    /// Retires candidates closer than the spacing to an older one.
    fn thin(&mut self) {
        let (s, g) = (self.spec.state_dim(), self.spec.goal_dim());
        let mut kept: Vec<usize> = Vec::new();
        for i in 0..self.len() {
            let state = &self.states[i * s..(i + 1) * s];
            if kept.iter().all(|k| self.spec.goal_distance(state, &self.points[k * g..(k + 1) * g]) > self.spacing) {
                kept.push(i);
            }
        }
        let mut new_index = vec![None; self.len()];
        for (new, old) in kept.iter().enumerate() {
            new_index[*old] = Some(new as u32);
            // Rows and columns only ever move towards the start.
            for (new_to, old_to) in kept.iter().enumerate() {
                self.observed[new * self.most + new_to] = self.observed[old * self.most + old_to];
            }
        }
        for row in 0..self.most {
            let from = if row < kept.len() { kept.len() } else { 0 };
            self.observed[row * self.most + from..(row + 1) * self.most].fill(NEVER);
        }
        self.states = kept.iter().flat_map(|i| self.states[i * s..(i + 1) * s].to_vec()).collect();
        self.points = kept.iter().flat_map(|i| self.points[i * g..(i + 1) * g].to_vec()).collect();
        self.names = kept.iter().map(|i| self.names[*i]).collect();
        let Self { names, practice, .. } = self;
        let alive = |name: &u32| names.binary_search(name).is_ok();
        practice.retain(|(from, to), _| alive(from) && alive(to));
        for visits in &mut self.visits {
            let renamed = visits.iter().filter_map(|(step, i)| new_index[*i as usize].map(|i| (*step, i)));
            *visits = renamed.collect();
        }
    }

    /// Everything it knows, for a checkpoint.
    pub fn state(&self) -> ExperienceState {
        let n = self.len();
        let rows = (0..n).flat_map(|i| self.observed[i * self.most..i * self.most + n].iter().copied());
        let mut visits = Vec::new();
        for (clock, own) in self.clocks.iter().zip(&self.visits) {
            visits.extend([*clock, own.len() as u32]);
            visits.extend(own.iter().flat_map(|(step, i)| [*step, *i]));
        }
        let mut names = self.names.clone();
        names.push(self.next_name);
        let practice = self.practice.iter();
        let practice = practice.flat_map(|((from, to), p)| [*from, *to, u32::from(p.arrived), u32::from(p.failed)]);
        ExperienceState {
            spacing: self.spacing,
            states: self.states.clone(),
            observed: rows.collect(),
            visits,
            names,
            practice: practice.collect(),
        }
    }

    /// Takes up what [`Self::state`] gave.
    ///
    /// # Errors
    /// Where the state was not saved from one of these sizes.
    pub fn restore(&mut self, state: &ExperienceState) -> Result<(), StoreError> {
        let misfit = || StoreError::misfit("the stored bridge candidates do not fit these settings");
        let n = state.states.len() / self.spec.state_dim();
        if n > self.most || state.observed.len() != n * n || !state.states.len().is_multiple_of(self.spec.state_dim()) {
            return Err(misfit());
        }
        let sound = state.spacing > 0.0 && state.spacing.is_finite() && state.states.iter().all(|v| v.is_finite());
        if !sound {
            return Err(StoreError::misfit("the stored bridge candidates hold numbers that are out of range"));
        }
        self.spacing = state.spacing;
        self.states.clone_from(&state.states);
        self.points = state.states.chunks_exact(self.spec.state_dim()).flat_map(|s| self.spec.achieved(s)).collect();
        self.observed.fill(NEVER);
        for (i, row) in state.observed.chunks_exact(n.max(1)).enumerate() {
            self.observed[i * self.most..i * self.most + n].copy_from_slice(row);
        }
        let (next_name, names) = state.names.split_last().ok_or_else(misfit)?;
        let sorted = names.is_sorted_by(|a, b| a < b) && names.last().is_none_or(|last| last < next_name);
        let (practice, []) = state.practice.as_chunks::<4>() else { return Err(misfit()) };
        // Names are given one after the other, and not so many that they could run out.
        if names.len() != n || !sorted || *next_name > MOST_NAMES {
            return Err(misfit());
        }
        self.names = names.to_vec();
        self.next_name = *next_name;
        let entry = |[from, to, arrived, failed]: &[u32; 4]| {
            ((*from, *to), Practice { arrived: *arrived as u16, failed: *failed as u16 })
        };
        self.practice = practice.iter().map(entry).collect();
        let mut numbers = state.visits.iter().copied();
        let mut next = || numbers.next().ok_or_else(misfit);
        for (clock, visits) in self.clocks.iter_mut().zip(&mut self.visits) {
            *clock = next()?;
            let count = next()?;
            visits.clear();
            let mut before = 0;
            for _ in 0..count {
                let (step, candidate) = (next()?, next()?);
                if candidate as usize >= n || step < before || step >= *clock {
                    return Err(misfit());
                }
                before = step;
                visits.push_back((step, candidate));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Points on a line of a hundred goal radii, and settings for so many candidates.
    pub fn line(candidates: usize) -> (Spec, BridgeSettings) {
        let spec = Spec {
            state_centre: vec![50.0, 0.5],
            state_half_range: vec![50.0; 2],
            change_scale: vec![1.0; 2],
            achieved: vec![0, 1],
            action_dim: 2,
            goal_radius: 1.0,
            goals_are_positions: true,
        };
        (spec, BridgeSettings { candidates, ..BridgeSettings::default() })
    }

    /// Walks one agent along the line from 0 to `end`, half a length a step.
    fn walk(experience: &mut Experience, end: f32) {
        let mut at = 0.0;
        while at <= end {
            experience.visit(0, &[at, 0.5]);
            at += 0.5;
        }
        experience.end_episode(0);
    }

    #[test]
    fn practice_counts_failures_in_a_row_and_arrivals_forgive_them() {
        let (spec, settings) = line(10);
        let mut experience = Experience::new(&spec, 1, &settings);
        walk(&mut experience, 12.0);
        let hop = (experience.name(0), experience.name(1));
        experience.practise(hop, false);
        experience.practise(hop, false);
        assert_eq!(experience.practice(0, 1), Practice { arrived: 0, failed: 2 });
        assert_eq!(experience.practice(1, 0), Practice::default(), "the other direction is another edge");
        experience.practise(hop, true);
        assert_eq!(experience.practice(0, 1), Practice { arrived: 1, failed: 0 });
        experience.practise((hop.0, 12_345), true);
        experience.practise((hop.0, hop.0), true);
        assert_eq!(experience.state().practice.len(), 4, "of candidates that are gone nothing is kept");
    }

    #[test]
    fn practice_follows_candidates_when_others_retire() {
        let (spec, settings) = line(10);
        let mut experience = Experience::new(&spec, 1, &settings);
        walk(&mut experience, 15.0);
        let before: Vec<(u32, f32)> =
            (0..experience.len()).map(|i| (experience.name(i), experience.points()[2 * i])).collect();
        for (a, _) in &before {
            before.iter().for_each(|(b, _)| experience.practise((*a, *b), true));
        }
        // So far out that the line holds more candidates than wanted, and some have to go.
        walk(&mut experience, 60.0);
        let place = |name: u32, e: &Experience| (0..e.len()).find(|i| e.name(*i) == name);
        let (kept, gone): (Vec<_>, Vec<_>) = before.iter().partition(|(name, _)| place(*name, &experience).is_some());
        assert!(kept.len() > 1 && !gone.is_empty(), "{} stayed, {} retired", kept.len(), gone.len());
        for (name, point) in &kept {
            let i = place(*name, &experience).unwrap_or_default();
            assert_eq!(experience.points()[2 * i], *point);
            for (other, _) in kept.iter().filter(|(other, _)| other != name) {
                let j = place(*other, &experience).unwrap_or_default();
                assert_eq!(experience.practice(i, j).arrived, 1);
            }
        }
        assert_eq!(experience.state().practice.len(), 4 * kept.len() * (kept.len() - 1));
        let mut restored = Experience::new(&spec, 1, &settings);
        restored.restore(&experience.state()).expect("its own state");
        assert_eq!(restored.state(), experience.state());
    }
}
