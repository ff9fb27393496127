//! Figures 1, 3, 4 and 6: curves of several methods, each over several seeds.

use std::collections::BTreeMap;

use super::MethodResults;
use super::figures::{Figure, Shows};
use super::methods::Entry;
use crate::experiment::job::JobResult;
use crate::experiment::plan::{Length, Plan};
use gdg::train::{Evaluation, Score, TaskOutcome};

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

    /// Returns the shares as per cent.
    pub fn in_percent(&self) -> Self {
        let values = self.values.iter().map(|(seed, value)| (*seed, 100.0 * value)).collect();
        Self { x: self.x, values }
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
    let steps = |outcome: &TaskOutcome| outcome.left_steps.map(f64::from);
    let straight = |outcome: &TaskOutcome| outcome.left_straight.map(f64::from);
    match figure.shows {
        Shows::Success | Shows::CompleteSuccess | Shows::CompleteSuccessAndGripPath => {
            vec![Panel {
                measure: "success",
                labels: [over.label(), "success rate"],
                top: Some(1.0),
                curves: curves(methods, |method, result| {
                    training(over, &method.plan, result, &success)
                }),
            }]
        }
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
                curves: curves(methods, |method, result| {
                    training(over, &method.plan, result, &left(steps))
                }),
            },
            Panel {
                measure: "straight_left",
                labels: [over.label(), "straight line left (cells)"],
                top: None,
                curves: curves(methods, |method, result| {
                    training(over, &method.plan, result, &left(straight))
                }),
            },
        ],
        Shows::Datasets => {
            let of = |measure, label, success: fn(&Evaluation) -> Option<f64>| Panel {
                measure,
                labels: [over.label(), label],
                top: Some(1.0),
                curves: curves(methods, |method, result| {
                    training(over, &method.plan, result, &success)
                }),
            };
            vec![
                of("planned", "success rate, planned", |e| e.planned.as_ref()?.success),
                of("actor_alone", "success rate, actor alone", |e| e.greedy.success),
            ]
        }
        Shows::Bridge | Shows::Paths => Vec::new(),
    }
}

/// What the horizontal axis of training counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    Updates,
    Episodes,
    Steps,
}

impl Axis {
    /// Returns the axis for jobs of these lengths: episodes or steps if any method trains for a
    /// number of them.
    fn of(methods: &[MethodResults]) -> Self {
        let any = |is: fn(Length) -> bool| methods.iter().any(|method| is(method.plan.length));
        if any(|length| matches!(length, Length::Episodes(_))) {
            Self::Episodes
        } else if any(|length| matches!(length, Length::Steps(_))) {
            Self::Steps
        } else {
            Self::Updates
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Updates => "updates",
            Self::Episodes => "episodes",
            Self::Steps => "environment steps",
        }
    }

    /// Whether jobs of this length are evaluated at places of the axis.
    fn counts(self, length: Length) -> bool {
        matches!(
            (self, length),
            (Self::Updates, Length::Updates(_))
                | (Self::Episodes, Length::Episodes(_))
                | (Self::Steps, Length::Steps(_))
        )
    }
}

/// Returns, for each seed, the place on the horizontal axis from which on the curve stays at
/// `value`; `None` if it does not at the end.
pub fn stays_at(curve: &Curve, value: f64) -> BTreeMap<u64, Option<u64>> {
    let mut from = BTreeMap::new();
    for point in &curve.points {
        for (seed, now) in &point.values {
            let since: &mut Option<u64> = from.entry(*seed).or_default();
            *since = if *now >= value { since.or(Some(point.x)) } else { None };
        }
    }
    from
}

/// Returns the least value of each seed.
pub fn least(curve: &Curve) -> Point {
    let mut least = BTreeMap::new();
    for (seed, value) in curve.points.iter().flat_map(|point| &point.values) {
        let of_seed = least.entry(*seed).or_insert(*value);
        *of_seed = value.min(*of_seed);
    }
    Point { x: 0, values: least.into_iter().collect() }
}

/// Returns the result of the map's own task, with planning if the method plans.
fn marked(evaluation: &Evaluation) -> Option<TaskOutcome> {
    let marked = evaluation.marked?;
    Some(marked.planned.unwrap_or(marked.greedy))
}

/// Collects the points of all seeds of every method.
fn curves(
    methods: &[MethodResults],
    points: impl Fn(&MethodResults, &JobResult) -> Vec<(u64, f64)>,
) -> Vec<Curve> {
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
fn training(
    axis: Axis,
    plan: &Plan,
    result: &JobResult,
    of: &dyn Fn(&Evaluation) -> Option<f64>,
) -> Vec<(u64, f64)> {
    let marks = plan.marks();
    let complete = marks.len() == result.evaluations.len();
    let (episodes, env_steps) =
        result.measured.as_ref().map_or((0, 0), |m| (m.episodes, m.env_steps));
    let at = |(i, updates): (usize, u64)| match axis {
        Axis::Updates => updates,
        _ if axis.counts(plan.length) && complete => marks[i],
        // Not counted at each evaluation: they come about equally fast. To two digits, so that
        // seeds with about as many share their points.
        Axis::Episodes => {
            two_digits(updates as f64 / result.updates.max(1) as f64 * episodes as f64)
        }
        Axis::Steps => two_digits(updates as f64 / result.updates.max(1) as f64 * env_steps as f64),
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
    let score = |evaluation: &Evaluation| -> Score {
        evaluation.planned.as_ref().unwrap_or(&evaluation.greedy).clone()
    };
    let Some(score) = result.last().map(score) else { return Vec::new() };
    let of = |d: &gdg::train::DistanceScore| Some((d.distance()?.0.round() as u64, d.success?));
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
    fn a_curve_stays_complete_from_the_last_time_that_it_became_so() {
        let point = |x, one, other| Point { x, values: vec![(1, one), (2, other)] };
        let points = vec![
            point(10, 1.0, 0.2),
            point(20, 0.9, 1.0),
            point(30, 1.0, 1.0),
            point(40, 1.0, 0.8),
        ];
        let curve = Curve { entry: &super::super::methods::DEFAULT, points };
        assert_eq!(stays_at(&curve, 1.0), BTreeMap::from([(1, Some(30)), (2, None)]));
        assert_eq!(least(&curve).values, [(1, 0.9), (2, 0.2)]);
    }

    #[test]
    fn numbers_of_episodes_are_rounded_to_two_digits() {
        assert_eq!([0.2, 7.4, 12.6, 1234.0, 98_765.0].map(two_digits), [0, 7, 13, 1200, 99_000]);
    }
}
