//! Figures 3, 4 and 6: curves of several methods, each over several seeds.

use super::MethodResults;
use super::figures::{Figure, Shows};
use super::methods::Entry;
use crate::experiment::job::JobResult;
use crate::experiment::plan::{Length, Plan};
use crate::train::{Evaluation, Score, TaskOutcome};

/// A chart: one measure of all methods.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Name of the measure in data.
    pub measure: &'static str,
    /// Labels of the axes.
    pub labels: [&'static str; 2],
    /// Upper end of the vertical axis, if it is fixed.
    pub top: Option<f64>,
    /// A curve per method.
    pub curves: Vec<Curve>,
}

/// A method's curve.
#[derive(Clone, Debug)]
pub struct Curve {
    /// The method.
    pub entry: &'static Entry,
    /// Points from left to right.
    pub points: Vec<Point>,
}

/// The values of several seeds at one place of the horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Updates, episodes or steps.
    pub x: u64,
    /// Seed and value.
    pub values: Vec<(u64, f64)>,
}

impl Point {
    /// Returns the mean over the seeds.
    pub fn mean(&self) -> f64 {
        self.values.iter().map(|(_, value)| value).sum::<f64>() / self.values.len() as f64
    }

    /// Returns the smallest and the largest value of any seed.
    pub fn range(&self) -> (f64, f64) {
        let values = || self.values.iter().map(|(_, value)| *value);
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    }
}

/// Returns the charts of a figure; none if it shows maps.
pub fn panels(figure: &Figure, methods: &[MethodResults]) -> Vec<Panel> {
    let over = Axis::of(methods);
    let success = |e: &Evaluation| e.success_rate();
    let left = |of: fn(&TaskOutcome) -> Option<f64>| move |e: &Evaluation| of(&marked(e)?);
    let steps = |outcome: &TaskOutcome| (outcome.left_steps != u32::MAX).then(|| f64::from(outcome.left_steps));
    let straight = |outcome: &TaskOutcome| outcome.left_straight.map(f64::from);
    match figure.shows {
        Shows::Success => vec![Panel {
            measure: "success",
            labels: [over.label(), "success rate"],
            top: Some(1.0),
            curves: curves(methods, |method, result| training(over, &method.plan, result, &success)),
        }],
        Shows::SuccessByDistance => vec![Panel {
            measure: "success",
            labels: ["steps from start to goal", "success rate"],
            top: Some(1.0),
            curves: curves(methods, |_, result| by_distance(result)),
        }],
        Shows::DistanceLeft => vec![
            Panel {
                measure: "steps_left",
                labels: [over.label(), "steps left to the goal"],
                top: None,
                curves: curves(methods, |method, result| training(over, &method.plan, result, &left(steps))),
            },
            Panel {
                measure: "straight_left",
                labels: [over.label(), "straight line left (cells)"],
                top: None,
                curves: curves(methods, |method, result| training(over, &method.plan, result, &left(straight))),
            },
        ],
        Shows::Bridge | Shows::Paths => Vec::new(),
    }
}

/// What the horizontal axis of training counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    Updates,
    Episodes,
}

impl Axis {
    /// Returns the axis for jobs of these lengths: episodes if any method trains for a number of them.
    fn of(methods: &[MethodResults]) -> Self {
        let by_episodes = methods.iter().any(|method| matches!(method.plan.length, Length::Episodes(_)));
        if by_episodes { Self::Episodes } else { Self::Updates }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Updates => "updates",
            Self::Episodes => "episodes",
        }
    }
}

/// Returns the result of the map's own task, with planning if the method plans.
fn marked(evaluation: &Evaluation) -> Option<TaskOutcome> {
    let marked = evaluation.marked?;
    Some(marked.planned.unwrap_or(marked.greedy))
}

/// Collects the points of all seeds of every method.
fn curves(methods: &[MethodResults], points: impl Fn(&MethodResults, &JobResult) -> Vec<(u64, f64)>) -> Vec<Curve> {
    let curve = |method: &MethodResults| {
        let mut all: Vec<Point> = Vec::new();
        for result in &method.results {
            for (x, value) in points(method, result) {
                match all.binary_search_by_key(&x, |point| point.x) {
                    Ok(i) => all[i].values.push((result.seed, value)),
                    Err(i) => all.insert(i, Point { x, values: vec![(result.seed, value)] }),
                }
            }
        }
        Curve { entry: method.entry, points: all }
    };
    methods.iter().map(curve).collect()
}

/// Returns a measure at every evaluation.
fn training(axis: Axis, plan: &Plan, result: &JobResult, of: &dyn Fn(&Evaluation) -> Option<f64>) -> Vec<(u64, f64)> {
    let marks = plan.marks();
    let complete = marks.len() == result.evaluations.len();
    let episodes = result.measured.as_ref().map_or(0, |measured| measured.episodes);
    let at = |(i, updates): (usize, u64)| match (axis, plan.length) {
        (Axis::Updates, _) => updates,
        (Axis::Episodes, Length::Episodes(_)) if complete => marks[i],
        // Not counted at each evaluation: they come about equally fast.
        (Axis::Episodes, _) => {
            let share = updates as f64 / result.updates.max(1) as f64;
            // To two digits, so that seeds with about as many episodes share their points.
            two_digits(share * episodes as f64)
        }
    };
    let evaluations = result.evaluations.iter().enumerate();
    evaluations.filter_map(|(i, e)| Some((at((i, e.updates)), of(&e.evaluation)?))).collect()
}

/// Rounds to two significant digits.
fn two_digits(value: f64) -> u64 {
    let unit = 10f64.powf((value.max(1.0).log10().floor() - 1.0).max(0.0));
    ((value / unit).round() * unit) as u64
}

/// Returns the success rate at each distance in the last evaluation.
fn by_distance(result: &JobResult) -> Vec<(u64, f64)> {
    let score =
        |evaluation: &Evaluation| -> Score { evaluation.planned.as_ref().unwrap_or(&evaluation.greedy).clone() };
    let Some(score) = result.last().map(score) else { return Vec::new() };
    let of = |d: &crate::train::DistanceScore| Some((d.distance_steps?.round() as u64, d.success?));
    score.by_distance.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_has_the_mean_and_the_range_of_its_seeds() {
        let point = Point { x: 5, values: vec![(1, 0.25), (2, 0.5), (3, 0.75)] };
        assert_eq!((point.mean(), point.range()), (0.5, (0.25, 0.75)));
    }

    #[test]
    fn numbers_of_episodes_are_rounded_to_two_digits() {
        assert_eq!([0.2, 7.4, 12.6, 1234.0, 98_765.0].map(two_digits), [0, 7, 13, 1200, 99_000]);
    }
}
