//! Curves as a figure, and as a table (CSV).

use super::ExportError;
use crate::figure::{Chart, Curve, MILLIMETRE, Page, Point, Range, Sheet, colour};
use crate::tui::screen::Screen;
use gdg::engine::Snapshot;
use gdg::train::Evaluation;

/// Width of the figure.
const WIDTH: f32 = 130.0 * MILLIMETRE;

/// A curve's name and its points: updates done by a learner, and values.
type Series = (&'static str, Vec<(u64, f64)>);

/// Draws success with coverage, errors and the critic's loss, one below the other and over the same
/// updates.
pub fn figure(screen: &Screen, title: &str) -> Sheet {
    let snapshot = &screen.snapshot;
    let loss = snapshot.curve.iter().map(|point| (point.updates, f64::from(point.losses[0])));
    let coverage = snapshot.coverage().into_iter();
    let success = [
        series("planned", snapshot, |e| e.planned.as_ref()?.success),
        series("greedy", snapshot, |e| e.greedy.success),
        ("explored", learned(snapshot, coverage)),
    ];
    let errors = [
        series("of D", snapshot, |e| Some(e.distance_error?.mape)),
        series("via graph", snapshot, |e| Some(e.distance_error?.graph?.mape)),
    ];
    let losses = [("critic", learned(snapshot, loss))];
    let last = snapshot.learned(snapshot.counters.updates).max(1) as f64;
    let chart = |label: &str, series: &[Series]| {
        let values = series.iter().flat_map(|(_, points)| points).map(|(_, value)| *value);
        let is_known = |(_, (_, points)): &(usize, &Series)| !points.is_empty();
        let curve = |(i, (name, points)): (usize, &Series)| Curve {
            name: (*name).to_owned(),
            colour: colour(i),
            marker: i,
            points: points.iter().map(|(x, value)| Point::single(*x as f64, *value)).collect(),
        };
        Chart {
            title: String::new(),
            labels: ["updates", label].map(str::to_owned),
            x: [0.0, last],
            y: if series.len() == 3 { Range::SHARE } else { Range::of_errors(values) },
            curves: series.iter().enumerate().filter(is_known).map(curve).collect(),
        }
    };
    let charts = [
        chart("success rate, share explored", &success),
        chart("relative error of D", &errors),
        chart("loss of D", &losses),
    ];
    Page { title, has_heading: true, charts: &charts, width: WIDTH, columns: 1 }.draw()
}

fn learned(snapshot: &Snapshot, points: impl Iterator<Item = (u64, f64)>) -> Vec<(u64, f64)> {
    points.map(|(updates, value)| (snapshot.learned(updates), value)).collect()
}

fn series(
    name: &'static str,
    snapshot: &Snapshot,
    value: impl Fn(&Evaluation) -> Option<f64>,
) -> Series {
    // Leave out what other methods reached.
    let own =
        |at: u64| snapshot.methods.name(at).is_none_or(|name| name == snapshot.run.method.name());
    let evaluations = snapshot.evaluations.iter().filter(|(at, _)| own(*at));
    (name, learned(snapshot, evaluations.filter_map(|(at, e)| Some((*at, value(e)?)))))
}

/// Writes one line per evaluation and per point of the curves of losses and coverage, in order,
/// with the method at the end: updates are those done by a learner.
pub fn csv(screen: &Screen) -> Result<Vec<u8>, ExportError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let distances =
        screen.snapshot.evaluations.first().map_or(&[][..], |(_, e)| &e.greedy.by_distance);
    let mut head = vec!["updates".to_owned()];
    head.extend(["critic_loss", "model_loss", "actor_loss"].map(str::to_owned));
    head.extend(["coverage", "greedy", "planned", "error", "error_of_graph"].map(str::to_owned));
    for kind in ["greedy", "planned"] {
        head.extend(distances.iter().enumerate().map(|(i, d)| match d.distance() {
            Some((distance, unit)) => format!("{kind}_at_{distance:.0}_{}", unit.name()),
            None => format!("{kind}_of_group_{}", i + 1),
        }));
    }
    let width = head.len();
    head.push("method".to_owned());
    let snapshot = &screen.snapshot;
    let updates_and_method = |updates: u64| {
        let method = snapshot
            .methods
            .name(updates)
            .map_or_else(|| screen.run().method.name(), str::to_owned);
        (snapshot.learned(updates).to_string(), method)
    };
    let mut lines: Vec<(u64, Vec<String>)> = Vec::new();
    for point in screen.snapshot.curve.iter() {
        let (updates, method) = updates_and_method(point.updates);
        let mut line = vec![updates];
        line.extend(point.losses.iter().map(f32::to_string));
        line.push(point.coverage.map_or(String::new(), |share| share.to_string()));
        line.resize(width, String::new());
        line.push(method);
        lines.push((point.updates, line));
    }
    for (updates, e) in screen.snapshot.evaluations.iter() {
        let (learned, method) = updates_and_method(*updates);
        let mut line = vec![learned, String::new(), String::new(), String::new()];
        let number = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
        line.push(number(e.coverage));
        line.push(number(e.greedy.success));
        line.push(number(e.planned.as_ref().and_then(|s| s.success)));
        line.push(number(e.distance_error.map(|e| e.mape)));
        line.push(number(e.distance_error.and_then(|e| Some(e.graph?.mape))));
        line.extend(e.greedy.by_distance.iter().map(|d| number(d.success)));
        line.extend(e.planned.iter().flat_map(|s| &s.by_distance).map(|d| number(d.success)));
        line.resize(width, String::new());
        line.push(method);
        lines.push((*updates, line));
    }
    lines.sort_by_key(|(updates, _)| *updates);
    writer.write_record(&head)?;
    lines.iter().try_for_each(|(_, line)| writer.write_record(line))?;
    writer.into_inner().map_err(|e| e.into_error().into())
}
