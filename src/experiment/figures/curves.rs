//! Figures 1, 3, 4 and 6: curves of several methods, each over several seeds.

use std::collections::BTreeMap;

use super::MethodRuns;
use super::catalogue::{Entry, Figure, Shows};
use crate::experiment::plan::{Length, Plan};
use crate::experiment::plot::{Points, mean};
use crate::experiment::spec::JobResult;
use crate::figure::Point;
use gdg::train::{DistanceScore, Evaluation, TaskOutcome};

/// A chart: one measure of all methods.
pub struct Panel {
    /// Name of the measure in data.
    pub measure: &'static str,
    pub labels: [&'static str; 2],
    /// Upper end of the vertical axis, if it is fixed.
    pub top: Option<f64>,
    pub curves: Vec<Curve>,
}

/// A method's curve.
pub struct Curve {
    pub entry: &'static Entry,
    pub seeds: BTreeMap<u64, Points>,
}

impl Panel {
    pub fn curve_of(&self, method: &MethodRuns) -> Option<&Curve> {
        self.curves.iter().find(|curve| curve.entry.name == method.entry.name)
    }
}

impl Curve {
    pub fn means(&self) -> Vec<Point> {
        mean(&self.seeds, [0.0, f64::INFINITY])
    }

    pub fn last(&self) -> Vec<f64> {
        self.seeds.values().filter_map(|points| Some(points.last()?.1)).collect()
    }

    pub fn least(&self) -> Vec<f64> {
        let least = |points: &Points| points.iter().map(|(_, value)| *value).reduce(f64::min);
        self.seeds.values().filter_map(least).collect()
    }

    /// Returns, for each seed, the place on the horizontal axis from which on the curve stays at
    /// `value`; `None` if it does not at the end.
    pub fn stays_at(&self, value: f64) -> Vec<Option<f64>> {
        let since = |points: &Points| {
            let from = points.iter().rposition(|(_, now)| *now < value).map_or(0, |i| i + 1);
            points.get(from).map(|(x, _)| *x)
        };
        self.seeds.values().map(since).collect()
    }
}

pub fn panels(figure: &Figure, methods: &[MethodRuns]) -> Vec<Panel> {
    let over = axis(methods);
    let curves = |points: &dyn Fn(&MethodRuns, &JobResult) -> Points| {
        let curve = |method: &MethodRuns| {
            let seeds = method.results.iter().map(|result| (result.seed, points(method, result)));
            Curve { entry: method.entry, seeds: seeds.collect() }
        };
        methods.iter().map(curve).collect::<Vec<_>>()
    };
    let training = |measure, label, top, of: &dyn Fn(&Evaluation) -> Option<f64>| Panel {
        measure,
        labels: [over.unit(), label],
        top,
        curves: curves(&|method, result| training(over, method.plan(), result, of)),
    };
    let left = |of: fn(&TaskOutcome) -> Option<f64>| move |e: &Evaluation| of(&marked(e)?);
    match figure.shows {
        Shows::Success | Shows::CompleteSuccess => {
            vec![training("success", "success rate", Some(1.0), &Evaluation::success_rate)]
        }
        Shows::SuccessByDistance => vec![Panel {
            measure: "success",
            labels: ["steps from start to goal", "success rate"],
            top: Some(1.0),
            curves: curves(&|_, result| by_distance(result)),
        }],
        Shows::DistanceLeft => {
            let steps = left(|outcome| outcome.left_steps.map(f64::from));
            let straight = left(|outcome| outcome.left_straight.map(f64::from));
            vec![
                training("steps_left", "steps left to the goal", None, &steps),
                training("straight_left", "straight line left (cells)", None, &straight),
            ]
        }
        Shows::Datasets => {
            let planned = |e: &Evaluation| e.planned.as_ref()?.success;
            let alone = |e: &Evaluation| e.greedy.success;
            vec![
                training("planned", "success rate, planned", Some(1.0), &planned),
                training("actor_alone", "success rate, actor alone", Some(1.0), &alone),
            ]
        }
        Shows::Bridge | Shows::Paths => Vec::new(),
    }
}

/// Returns a length in the unit of the horizontal axis: episodes or steps if any method trains for
/// a number of them.
fn axis(methods: &[MethodRuns]) -> Length {
    let rank = |length: &Length| match length {
        Length::Episodes(_) => 2,
        Length::Steps(_) => 1,
        Length::Updates(_) => 0,
    };
    let lengths = methods.iter().map(|method| method.plan().length);
    lengths.max_by_key(rank).unwrap_or(Length::Updates(0))
}

fn marked(evaluation: &Evaluation) -> Option<TaskOutcome> {
    let marked = evaluation.marked?;
    Some(marked.planned.unwrap_or(marked.greedy))
}

/// Returns a measure at every evaluation, over the unit of `axis`.
fn training(
    axis: Length,
    plan: &Plan,
    result: &JobResult,
    of: &dyn Fn(&Evaluation) -> Option<f64>,
) -> Points {
    let marks = plan.marks();
    let is_marked = axis.unit() == plan.length.unit() && marks.len() == result.evaluations.len();
    let (episodes, env_steps) =
        result.measured.as_ref().map_or((0, 0), |m| (m.episodes, m.env_steps));
    // Not counted at each evaluation: they come about equally fast.
    let about = |updates: u64, all: u64| {
        (updates as f64 / result.updates.max(1) as f64 * all as f64).round()
    };
    let at = |i: usize, updates: u64| match axis {
        Length::Updates(_) => updates as f64,
        _ if is_marked => marks[i] as f64,
        Length::Episodes(_) => about(updates, episodes),
        Length::Steps(_) => about(updates, env_steps),
    };
    let evaluations = result.evaluations.iter().enumerate();
    evaluations.filter_map(|(i, e)| Some((at(i, e.updates), of(&e.evaluation)?))).collect()
}

fn by_distance(result: &JobResult) -> Points {
    let Some(last) = result.last() else { return Vec::new() };
    let score = last.planned.as_ref().unwrap_or(&last.greedy);
    let of = |d: &DistanceScore| Some((d.distance()?.0.round(), d.success?));
    score.by_distance.iter().filter_map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_stays_complete_from_the_last_time_that_it_became_so() {
        let points = |values: [f64; 4]| [10.0, 20.0, 30.0, 40.0].into_iter().zip(values).collect();
        let seeds = [(1, points([1.0, 0.9, 1.0, 1.0])), (2, points([0.2, 1.0, 1.0, 0.8]))];
        let curve = Curve { entry: &super::super::catalogue::DEFAULT, seeds: seeds.into() };
        assert_eq!(curve.stays_at(1.0), [Some(30.0), None]);
        assert_eq!((curve.least(), curve.last()), (vec![0.9, 0.2], vec![1.0, 0.8]));
        assert_eq!(curve.means()[0], Point { x: 10.0, mean: 0.6, low: 0.2, high: 1.0 });
    }
}
