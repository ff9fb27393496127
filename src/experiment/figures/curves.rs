//! Figures 1, 3, 4 and 6: curves of several methods, each over several seeds.

use super::MethodRuns;
use super::catalogue::{Figure, Shows};
use crate::experiment::plot::{Axis, Line, Points};
use crate::experiment::spec::JobResult;
use crate::figure::{Chart, Range};
use gdg::train::{DistanceScore, Evaluation, TaskOutcome};

pub struct Panel {
    pub labels: [&'static str; 2],
    /// Upper end of the vertical axis, if it is fixed.
    pub top: Option<f64>,
    pub lines: Vec<Line>,
}

impl Panel {
    pub fn chart(&self) -> Chart {
        let points = || self.lines.iter().flat_map(|line| line.seeds.values().flatten());
        let x = [0.0, points().map(|point| point.0).fold(1.0, f64::max)];
        Chart {
            title: String::new(),
            labels: self.labels.map(str::to_owned),
            x,
            y: match self.top {
                Some(high) => Range { high, ..Range::SHARE },
                None => Range::from_zero(points().map(|point| point.1)),
            },
            curves: self.lines.iter().map(|line| line.curve(x)).collect(),
        }
    }
}

pub fn last(line: &Line) -> Vec<f64> {
    line.seeds.values().filter_map(|points| Some(points.last()?.1)).collect()
}

/// Returns the charts of a figure, if it shows curves. Methods are compared over what they were
/// allowed to experience, or, where that is the same recorded data, over updates.
pub fn panels(figure: &Figure, methods: &[MethodRuns]) -> Vec<Panel> {
    let over = if figure.shows == Shows::Datasets { Axis::Updates } else { Axis::Steps };
    let panel = |chart: &str, labels, top, points: &dyn Fn(&JobResult) -> Points| {
        let line = |(marker, method): (usize, &MethodRuns)| Line {
            chart: chart.to_owned(),
            name: method.entry.title.to_owned(),
            colour: method.entry.colour,
            marker,
            seeds: method.results.iter().map(|result| (result.seed, points(result))).collect(),
        };
        Panel { labels, top, lines: methods.iter().enumerate().map(line).collect() }
    };
    let training = |chart, label, top, of: fn(&Evaluation) -> Option<f64>| {
        let points = |result: &JobResult| -> Points {
            let all = result.evaluations.iter();
            all.filter_map(|at| Some((over.of(at), of(&at.evaluation)?))).collect()
        };
        panel(chart, [over.label(), label], top, &points)
    };
    match figure.shows {
        Shows::Success => {
            vec![training("success", "success rate", Some(1.0), Evaluation::success_rate)]
        }
        Shows::SuccessByDistance => {
            let labels = ["steps from start to goal", "success rate"];
            vec![panel("success", labels, Some(1.0), &by_distance)]
        }
        Shows::DistanceLeft => vec![
            training("steps left", "steps left to the goal", None, |e| {
                marked(e)?.left_steps.map(f64::from)
            }),
            training("straight line left", "straight line left (cells)", None, |e| {
                marked(e)?.left_straight.map(f64::from)
            }),
        ],
        Shows::Datasets => vec![
            training("planned", "success rate, planned", Some(1.0), |e| {
                e.planned.as_ref()?.success
            }),
            training("actor alone", "success rate, actor alone", Some(1.0), |e| e.greedy.success),
        ],
        Shows::Bridge | Shows::Paths => Vec::new(),
    }
}

fn marked(evaluation: &Evaluation) -> Option<TaskOutcome> {
    let marked = evaluation.marked?;
    Some(marked.planned.unwrap_or(marked.greedy))
}

fn by_distance(result: &JobResult) -> Points {
    let Some(last) = result.last() else { return Vec::new() };
    let score = last.planned.as_ref().unwrap_or(&last.greedy);
    let of = |d: &DistanceScore| Some((d.distance()?.0.round(), d.success?));
    score.by_distance.iter().filter_map(of).collect()
}
