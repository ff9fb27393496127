//! Curves as a drawing (SVG) and as a table (CSV).

use plotters::coord::Shift;
use plotters::prelude::*;

use super::ExportError;
use crate::tui::screen::Screen;
use gdg::engine::Snapshot;
use gdg::train::{CurvePoint, Evaluation};

/// Size of the drawing.
const SIZE: (u32, u32) = (960, 720);

/// A line's name and its (updates, value) points.
type Series = (String, Vec<(f64, f64)>);

/// Draws success with coverage, errors and losses, one below the other.
pub fn svg(screen: &Screen) -> Result<Vec<u8>, ExportError> {
    let mut drawing = String::new();
    {
        let root = SVGBackend::with_string(&mut drawing, SIZE).into_drawing_area();
        let draw = || -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
            root.fill(&WHITE)?;
            let parts = root.split_evenly((3, 1));
            chart(&parts[0], "success and coverage", &success(&screen.snapshot), Some(1.0))?;
            chart(&parts[1], "relative error of D", &errors(&screen.snapshot), None)?;
            chart(&parts[2], "loss of D (log10)", &[losses(screen)], None)?;
            root.present()
        };
        draw()?;
    }
    Ok(drawing.into_bytes())
}

fn chart(
    area: &DrawingArea<SVGBackend, Shift>,
    title: &str,
    series: &[Series],
    max: Option<f64>,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let points = || series.iter().flat_map(|(_, points)| points.iter());
    let last = points().map(|p| p.0).fold(1.0, f64::max);
    let low = points().map(|p| p.1).fold(0.0, f64::min);
    let high = max.unwrap_or_else(|| points().map(|p| p.1).fold(low + 1e-3, f64::max));
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16))
        .margin(8)
        .x_label_area_size(28)
        .y_label_area_size(44)
        .build_cartesian_2d(0.0..last, low..high)?;
    chart.configure_mesh().x_desc("updates").draw()?;
    for (i, (name, points)) in series.iter().enumerate() {
        let colour = Palette99::pick(i).to_rgba();
        chart
            .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))?
            .label(name.as_str())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()
}

fn series(name: &str, snapshot: &Snapshot, value: impl Fn(&Evaluation) -> Option<f64>) -> Series {
    // Leave out what other methods reached.
    let own =
        |at: u64| snapshot.methods.name(at).is_none_or(|name| name == snapshot.run.method.name());
    let evaluations = snapshot.evaluations.iter().filter(|(at, _)| own(*at));
    let points = evaluations.filter_map(|(at, e)| Some((snapshot.learned(*at) as f64, value(e)?)));
    (name.to_owned(), points.collect())
}

fn success(snapshot: &Snapshot) -> Vec<Series> {
    let planned = series("planned", snapshot, |e| e.planned.as_ref()?.success);
    let greedy = series("greedy", snapshot, |e| e.greedy.success);
    let coverage =
        snapshot.coverage().into_iter().map(|(at, share)| (snapshot.learned(at) as f64, share));
    vec![planned, greedy, ("coverage".to_owned(), coverage.collect())]
}

fn errors(snapshot: &Snapshot) -> Vec<Series> {
    let learned = series("learned", snapshot, |e| Some(e.distance_error?.mape));
    let composed = series("via graph", snapshot, |e| Some(e.distance_error?.graph?.mape));
    vec![learned, composed]
}

fn losses(screen: &Screen) -> Series {
    let snapshot = &screen.snapshot;
    let loss = |p: &CurvePoint| {
        (snapshot.learned(p.updates) as f64, f64::from(p.losses[0].max(1e-9)).log10())
    };
    let points = snapshot.curve.iter().map(loss);
    ("critic".to_owned(), points.collect())
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
