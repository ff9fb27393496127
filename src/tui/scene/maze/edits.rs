//! The undo and redo history, kept as differences between maps.

use std::collections::VecDeque;
use std::sync::Arc;

use gdg::map::{Cell, Grid};

/// Maximum size of all edits together. Beyond it the oldest are dropped.
const MAX_BYTES: usize = 256 << 20;

/// A change of the current map into another.
enum Step {
    /// Runs of cells (first, end), row-major, that change from floor to wall or back; and starts
    /// and goals if they differ.
    Difference { runs: Vec<[u32; 2]>, marks: Option<Box<[Vec<Cell>; 2]>> },
    /// The other map, if its size or name differs or the differences would take more memory.
    Whole(Arc<Grid>),
}

impl Step {
    fn between(from: &Grid, to: &Arc<Grid>) -> Self {
        let shape = |map: &Grid| (map.width(), map.height(), map.name().to_owned());
        let runs = runs(from.free(), to.free());
        if shape(from) != shape(to) || size_of_val(&*runs) > to.free().len() {
            return Self::Whole(to.clone());
        }
        let differ = (from.starts(), from.goals()) != (to.starts(), to.goals());
        Self::Difference {
            runs,
            marks: differ.then(|| Box::new([to.starts().to_vec(), to.goals().to_vec()])),
        }
    }

    fn apply(&self, from: &Grid) -> Option<Arc<Grid>> {
        let (runs, marks) = match self {
            Self::Difference { runs, marks } => (runs, marks),
            Self::Whole(to) => return Some(to.clone()),
        };
        let cells = runs.iter().flat_map(|[first, end]| *first..*end);
        let cells = cells.map(|i| from.cell(i as usize));
        let to = from.with_cells(cells.map(|cell| (cell, !from.is_free(cell))))?;
        Some(Arc::new(match marks.as_deref() {
            Some([starts, goals]) => to.with_marks(starts.clone(), goals.clone()),
            None => to,
        }))
    }

    fn bytes(&self) -> usize {
        let of_marks = |starts: &[Cell], goals: &[Cell]| size_of_val(starts) + size_of_val(goals);
        size_of::<Self>()
            + match self {
                Self::Difference { runs, marks } => {
                    size_of_val(&**runs)
                        + marks.as_ref().map_or(0, |marks| of_marks(&marks[0], &marks[1]))
                }
                Self::Whole(map) => map.free().len() + of_marks(map.starts(), map.goals()),
            }
    }
}

/// Returns the runs of indices at which `a` and `b` differ.
fn runs(a: &[bool], b: &[bool]) -> Vec<[u32; 2]> {
    let mut runs: Vec<[u32; 2]> = Vec::new();
    for i in a.iter().zip(b).enumerate().filter(|(_, (a, b))| a != b).map(|(i, _)| i as u32) {
        match runs.last_mut() {
            Some(run) if run[1] == i => run[1] = i + 1,
            _ => runs.push([i, i + 1]),
        }
    }
    runs
}

/// How one map becomes another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edit {
    /// By a new edit.
    New,
    /// By undoing the latest one.
    Undo,
    /// By redoing the one that was undone last.
    Redo,
}

/// The edits of a map.
#[derive(Default)]
pub struct Edits {
    /// Undo steps, latest edit last.
    back: VecDeque<Step>,
    /// Redo steps, earliest edit last.
    forward: Vec<Step>,
    bytes: usize,
    /// Whether old edits have been dropped.
    pub has_dropped: bool,
}

impl Edits {
    /// Enters that `before` has become `after`. Drops the oldest edits if all together become too
    /// large.
    pub fn record(&mut self, edit: Edit, before: &Arc<Grid>, after: &Arc<Grid>) {
        match edit {
            Edit::New => self.record_within(MAX_BYTES, before, after),
            Edit::Undo => {
                let step = self.back.pop_back();
                let step = self.inverse(step, before, after);
                self.forward.push(step);
            }
            Edit::Redo => {
                let step = self.forward.pop();
                let step = self.inverse(step, before, after);
                self.back.push_back(step);
            }
        }
    }

    fn record_within(&mut self, max_bytes: usize, before: &Arc<Grid>, after: &Grid) {
        let dropped: usize = self.forward.drain(..).map(|step| step.bytes()).sum();
        let step = Step::between(after, before);
        self.bytes = self.bytes - dropped + step.bytes();
        self.back.push_back(step);
        while self.bytes > max_bytes && self.back.len() > 1 {
            self.bytes -= self.back.pop_front().map_or(0, |oldest| oldest.bytes());
            self.has_dropped = true;
        }
    }

    /// Returns the map before the latest edit of `map`.
    pub fn undone(&self, map: &Grid) -> Option<Arc<Grid>> {
        self.back.back()?.apply(map)
    }

    /// Returns the map before the latest undo.
    pub fn redone(&self, map: &Grid) -> Option<Arc<Grid>> {
        self.forward.last()?.apply(map)
    }

    /// Replaces a step that has been taken by the one that leads back.
    fn inverse(&mut self, taken: Option<Step>, before: &Arc<Grid>, after: &Grid) -> Step {
        let back = Step::between(after, before);
        self.bytes = self.bytes + back.bytes() - taken.map_or(0, |step| step.bytes());
        back
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn undo(edits: &mut Edits, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let before = edits.undone(map)?;
        edits.record(Edit::Undo, map, &before);
        Some(before)
    }

    fn redo(edits: &mut Edits, map: &Arc<Grid>) -> Option<Arc<Grid>> {
        let after = edits.redone(map)?;
        edits.record(Edit::Redo, map, &after);
        Some(after)
    }

    /// Returns a random edit of `map`.
    fn edited(map: &Grid, rng: &mut ChaCha8Rng) -> Grid {
        let mut cell =
            || Cell::new(rng.random_range(0..map.width()), rng.random_range(0..map.height()));
        let cells: Vec<Cell> = (0..5).map(|_| cell()).collect();
        let free = rng.random();
        match rng.random_range(0..4) {
            0 => map.with_marks(cells[..2].to_vec(), cells[2..].to_vec()),
            1 => map.resized(rng.random_range(20..40), 30).expect("floor"),
            2 => map.clone().named("another"),
            _ => map.with_cells(cells.into_iter().map(|cell| (cell, free))).expect("floor"),
        }
    }

    #[test]
    fn every_edit_can_be_undone_and_redone() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut edits, mut maps) = (Edits::default(), vec![Arc::new(Grid::empty("map", 30, 30))]);
        for _ in 0..200 {
            let now = maps[maps.len() - 1].clone();
            let next = edited(&now, &mut rng);
            let next = Arc::new(next);
            edits.record(Edit::New, &now, &next);
            maps.push(next);
        }
        let last = maps.len() - 1;
        for i in (0..last).rev() {
            assert_eq!(undo(&mut edits, &maps[i + 1]).as_ref(), Some(&maps[i]));
        }
        assert!(undo(&mut edits, &maps[0]).is_none() && !edits.has_dropped);
        for i in 0..last {
            assert_eq!(redo(&mut edits, &maps[i]).as_ref(), Some(&maps[i + 1]));
        }
        assert!(redo(&mut edits, &maps[last]).is_none());
        let kept = edits.back.iter().map(Step::bytes).sum::<usize>();
        assert_eq!(kept, edits.bytes);
    }

    #[test]
    fn small_edits_of_large_maps_take_little_memory() {
        let mut now = Arc::new(Grid::empty("map", 1024, 1024));
        let mut edits = Edits::default();
        for i in 0..300 {
            let next = now.with_cells((0..500).map(|x| (Cell::new(x, i), false))).expect("floor");
            let next = Arc::new(next);
            edits.record(Edit::New, &now, &next);
            now = next;
        }
        assert!(edits.bytes < 100_000 && !edits.has_dropped, "{}", edits.bytes);
    }

    #[test]
    fn the_oldest_edits_are_dropped_when_all_become_too_large() {
        let maps: Vec<_> =
            (0..4).map(|i| Arc::new(Grid::empty(&i.to_string(), 100, 100))).collect();
        let mut edits = Edits::default();
        maps.windows(2).for_each(|pair| edits.record_within(25_000, &pair[0], &pair[1]));
        assert!(edits.has_dropped && edits.bytes <= 25_000, "{}", edits.bytes);
        assert_eq!(undo(&mut edits, &maps[3]).as_ref(), Some(&maps[2]));
        assert_eq!(undo(&mut edits, &maps[2]).as_ref(), Some(&maps[1]));
        assert!(undo(&mut edits, &maps[1]).is_none());
        // One alone is kept, whatever its size.
        edits.record_within(1, &maps[0], &maps[1]);
        assert_eq!(undo(&mut edits, &maps[1]).as_ref(), Some(&maps[0]));
    }
}
