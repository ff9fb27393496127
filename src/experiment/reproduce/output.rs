//! A figure's files: data as JSON and CSV, drawings as SVG and PNG, and the same for the terminal.

use std::collections::BTreeMap;

use miette::{IntoDiagnostic, Report};
use serde::Serialize;
use serde_json::{Value, json};

use super::curves::{Panel, Point, panels};
use super::draw::Drawing;
use super::figures::Figure;
use super::maps::rows;
use super::panel::MapPanel;
use super::{MethodResults, curves};
use crate::experiment::folder::Folder;
use crate::experiment::measure::Measured;
use crate::figure::Format;
use gdg::map::builtin;

/// A figure, drawn.
pub struct Drawn {
    figure: &'static Figure,
    /// Charts, if it shows curves.
    pub panels: Vec<Panel>,
    /// Maps, a row per method, or paths in space.
    pub maps: Vec<Vec<MapPanel>>,
    data: Value,
    csv: Vec<u8>,
    /// Paths in space, if it shows them beside curves.
    paths: Option<Vec<u8>>,
    /// The drawing in each format.
    drawings: [(Format, Vec<u8>); 2],
}

impl Drawn {
    /// Draws a figure.
    ///
    /// # Errors
    /// It cannot be encoded.
    pub fn new(figure: &'static Figure, methods: &[MethodResults]) -> Result<Self, Report> {
        let (panels, maps) = (panels(figure, methods), rows(figure, methods));
        let (data, csv) = if panels.is_empty() {
            (measured_json(methods)?, measured_csv(methods)?)
        } else {
            (curves_json(&panels, methods, !maps.is_empty())?, curves_csv(&panels)?)
        };
        let paths =
            (!panels.is_empty() && !maps.is_empty()).then(|| positions_csv(methods)).transpose()?;
        let sheet = Drawing { title: figure.title, panels: &panels, maps: &maps }.draw();
        let drawn = |format: Format| Ok::<_, Report>((format, format.encode(&sheet)?));
        let drawings = [drawn(Format::Svg)?, drawn(Format::Png)?];
        Ok(Self { figure, panels, maps, data, csv, paths, drawings })
    }

    /// Writes data and drawings into `folder`; `arguments` made them.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn write(&self, folder: &Folder, arguments: &str) -> Result<(), Report> {
        let name = self.figure.name;
        let data = json!({
            "figure": name,
            "title": self.figure.title,
            (if builtin(self.figure.world).is_some() { "map" } else { "world" }): self.figure.world,
            "command": format!("gdg-tui {arguments}"),
            "version": env!("CARGO_PKG_VERSION"),
            "data": self.data,
        });
        // Paths and distances of all cells are long lists of numbers.
        let json = if self.maps.is_empty() {
            serde_json::to_string_pretty(&data)
        } else {
            serde_json::to_string(&data)
        };
        let json = json.into_diagnostic()? + "\n";
        folder.write(&format!("data/{name}.json"), json.as_bytes())?;
        folder.write(&format!("data/{name}.csv"), &self.csv)?;
        self.paths
            .iter()
            .try_for_each(|paths| folder.write(&format!("data/{}", paths_file(name)), paths))?;
        self.drawings.iter().try_for_each(|(format, bytes)| {
            folder.write(&format!("figures/{name}.{}", format.extension()), bytes)
        })
    }

    /// Returns the figure as text for the terminal.
    pub fn for_terminal(&self) -> String {
        let heading = format!("\n{}: {}\n", self.figure.name, self.figure.title);
        #[cfg(feature = "tui")]
        let charts = super::terminal::charts(&self.panels);
        #[cfg(not(feature = "tui"))]
        let charts = String::new();
        let map = |panel: &MapPanel| {
            let MapPanel { title, caption, text, .. } = panel;
            if text.is_empty() { String::new() } else { format!("\n{title} ({caption})\n{text}") }
        };
        // The first row is our default; more would be pages of text.
        let maps: String = self.maps.first().into_iter().flatten().map(map).collect();
        heading + &charts + &maps
    }
}

/// Returns the name of a figure's file with paths in space.
pub fn paths_file(figure: &str) -> String {
    format!("{figure}-paths.csv")
}

/// Describes a method, for data files.
fn about(method: &MethodResults) -> Value {
    json!({
        "name": method.entry.name,
        "title": method.entry.title,
        "method": method.entry.method().name(),
        "preset": method.entry.preset,
        "settings": method.results.first().map(|result| result.settings.clone()),
        "plan": method.plan,
        "jobs": method.results.iter().map(|result| result.name.as_str()).collect::<Vec<_>>(),
    })
}

/// Returns the curves and, if asked for, what was measured at the end.
fn curves_json(
    panels: &[Panel],
    methods: &[MethodResults],
    with_measured: bool,
) -> Result<Value, Report> {
    let point = |point: &Point| {
        let (least, most) = point.range();
        let seeds: BTreeMap<String, f64> =
            point.values.iter().map(|(s, value)| (s.to_string(), *value)).collect();
        json!({"x": point.x, "mean": point.mean(), "min": least, "max": most, "seeds": seeds})
    };
    let curve = |curve: &curves::Curve| json!({"method": curve.entry.name, "points": curve.points.iter().map(point).collect::<Vec<_>>()});
    let panel = |panel: &Panel| {
        let curves: Vec<Value> = panel.curves.iter().map(curve).collect();
        json!({"measure": panel.measure, "x": panel.labels[0], "y": panel.labels[1], "curves": curves})
    };
    let methods = if with_measured {
        serde_json::to_value(measured(methods)).into_diagnostic()?
    } else {
        methods.iter().map(about).collect()
    };
    Ok(json!({ "methods": methods, "panels": panels.iter().map(panel).collect::<Vec<_>>() }))
}

/// Writes a line per value: measure, method, seed, place on the horizontal axis, value.
fn curves_csv(panels: &[Panel]) -> Result<Vec<u8>, Report> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(["measure", "method", "seed", panels[0].labels[0], "value"])
        .into_diagnostic()?;
    for panel in panels {
        for curve in &panel.curves {
            for point in &curve.points {
                for (seed, value) in &point.values {
                    let line = (panel.measure, curve.entry.name, seed, point.x, value);
                    writer.serialize(line).into_diagnostic()?;
                }
            }
        }
    }
    writer.into_inner().into_diagnostic()
}

/// A method and what was measured at the end of its job.
#[derive(Serialize)]
struct MeasuredMethod<'a> {
    #[serde(flatten)]
    about: Value,
    seed: u64,
    measured: &'a Measured,
}

fn measured(methods: &[MethodResults]) -> Vec<MeasuredMethod<'_>> {
    let mut found = Vec::new();
    for method in methods {
        if let Some(result) = method.results.first()
            && let Some(measured) = &result.measured
        {
            found.push(MeasuredMethod { about: about(method), seed: result.seed, measured });
        }
    }
    found
}

fn measured_json(methods: &[MethodResults]) -> Result<Value, Report> {
    Ok(json!({ "methods": serde_json::to_value(measured(methods)).into_diagnostic()? }))
}

/// Writes a line per step of every walk.
fn measured_csv(methods: &[MethodResults]) -> Result<Vec<u8>, Report> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(["method", "seed", "distance", "reached", "step", "x", "y"])
        .into_diagnostic()?;
    for (method, MeasuredMethod { seed, measured, .. }) in methods.iter().zip(measured(methods)) {
        let walks = measured.walks.iter().chain(measured.bridge.iter().map(|bridge| &bridge.walk));
        for walk in walks {
            for (step, [x, y]) in walk.path.iter().enumerate() {
                let line = (method.entry.name, seed, walk.distance, walk.reached, step, x, y);
                writer.serialize(line).into_diagnostic()?;
            }
        }
    }
    writer.into_inner().into_diagnostic()
}

/// Writes a line per step of every walk in space.
fn positions_csv(methods: &[MethodResults]) -> Result<Vec<u8>, Report> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["method", "seed", "reached", "step", "x", "y", "z"]).into_diagnostic()?;
    for (method, MeasuredMethod { seed, measured, .. }) in methods.iter().zip(measured(methods)) {
        if let Some(walk) = &measured.long_walk {
            for (step, position) in walk.path.iter().enumerate() {
                let line = (method.entry.name, seed, walk.reached, step, position);
                writer.serialize(line).into_diagnostic()?;
            }
        }
    }
    writer.into_inner().into_diagnostic()
}
