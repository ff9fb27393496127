//! Curves as a figure, and as a table (CSV).

use super::ExportError;
use crate::figure::{Chart, Curve, MILLIMETRE, Page, Point, Sheet, colour, round_top};
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
            top: if series.len() == 3 { 1.0 } else { round_top(values) },
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

fn number(value: Option<impl ToString>) -> String {
    value.map_or(String::new(), |value| value.to_string())
}

/// Returns one line per evaluation and per point of the curves of losses and coverage, in order,
/// with the method at the end: updates are those done by a learner.
pub fn csv(Screen { snapshot, .. }: &Screen) -> Result<Vec<u8>, ExportError> {
    let names =
        "updates critic_loss model_loss actor_loss coverage greedy planned error error_of_graph";
    let distances = snapshot.evaluations.first().map_or(&[][..], |(_, e)| &e.greedy.by_distance);
    let group = |kind: &str, i: usize| match distances[i].distance() {
        Some((distance, unit)) => format!("{kind}_at_{distance:.0}_{}", unit.name()),
        None => format!("{kind}_of_group_{}", i + 1),
    };
    let groups =
        ["greedy", "planned"].map(|kind| (0..distances.len()).map(move |i| group(kind, i)));
    let mut head: Vec<String> = names.split(' ').map(str::to_owned).collect();
    head.extend(groups.into_iter().flatten().chain(["method".to_owned()]));
    let line = |updates: u64, values: Vec<String>| {
        let method = snapshot.methods.name(updates).map(str::to_owned);
        let mut line = vec![snapshot.learned(updates).to_string()];
        line.extend(values);
        line.resize(head.len() - 1, String::new());
        line.push(method.unwrap_or_else(|| snapshot.run.method.name()));
        (updates, line)
    };
    let points = snapshot.curve.iter().map(|point| {
        let losses = point.losses.iter().map(f32::to_string);
        line(point.updates, losses.chain([number(point.coverage)]).collect())
    });
    let evaluations = snapshot.evaluations.iter().map(|(updates, e)| {
        let error = e.distance_error;
        let graph = error.and_then(|error| Some(error.graph?.mape));
        let planned = e.planned.as_ref();
        let values = [None, None, None, e.coverage, e.greedy.success]
            .into_iter()
            .chain([planned.and_then(|score| score.success), error.map(|e| e.mape), graph])
            .chain(e.greedy.by_distance.iter().map(|group| group.success))
            .chain(planned.iter().flat_map(|score| &score.by_distance).map(|group| group.success));
        line(*updates, values.map(number).collect())
    });
    let mut lines: Vec<(u64, Vec<String>)> = points.chain(evaluations).collect();
    lines.sort_by_key(|(updates, _)| *updates);
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(&head)?;
    lines.iter().try_for_each(|(_, line)| writer.write_record(line))?;
    writer.into_inner().map_err(|e| e.into_error().into())
}
