//! A figure's files: data as CSV, drawings as SVG and PNG, and the same for the terminal.

use miette::Report;

use super::MethodRuns;
use super::catalogue::Figure;
use super::curves::{Panel, panels};
use super::maps::rows;
use super::panel::{MapPanel, draw};
use crate::experiment::folder::Folder;
use crate::experiment::measure::{Measured, Walked};
use crate::experiment::plot::csv_of;
use crate::figure::Format;

/// What a figure shows.
pub struct Drawn {
    /// Charts, if it shows curves.
    pub panels: Vec<Panel>,
    /// Maps, a row per method.
    pub maps: Vec<Vec<MapPanel>>,
}

impl Drawn {
    /// Draws a figure and writes its data and drawings into `folder`.
    pub fn write(figure: &Figure, methods: &[MethodRuns], folder: &Folder) -> Result<Self, Report> {
        let name = figure.name;
        let drawn = Self { panels: panels(figure, methods), maps: rows(figure, methods) };
        let Self { panels, maps } = &drawn;
        let csv = if panels.is_empty() { walks_csv(methods)? } else { curves_csv(panels)? };
        folder.write(&format!("data/{name}.csv"), &csv)?;
        let sheet = draw(figure.title, panels, maps);
        for format in [Format::Svg, Format::Png] {
            let file = format!("figures/{name}.{}", format.extension());
            folder.write(&file, &format.encode(&sheet)?)?;
        }
        Ok(drawn)
    }

    pub fn for_terminal(&self, figure: &Figure) -> String {
        let heading = format!("\n{}: {}\n", figure.name, figure.title);
        let charts = super::terminal::charts(&self.panels);
        let map = |panel: &MapPanel| {
            let MapPanel { title, caption, text, .. } = panel;
            if text.is_empty() { String::new() } else { format!("\n{title} ({caption})\n{text}") }
        };
        // The first row is our default; more would be pages of text.
        let maps: String = self.maps.first().into_iter().flatten().map(map).collect();
        heading + &charts + &maps
    }
}

/// Returns a line per value: measure, method, seed, place on the horizontal axis, value.
fn curves_csv(panels: &[Panel]) -> Result<Vec<u8>, Report> {
    let mut lines = Vec::new();
    for panel in panels {
        for curve in &panel.curves {
            for (seed, points) in &curve.seeds {
                let line = |(x, value): &(f64, f64)| {
                    (panel.measure, curve.entry.name, *seed, *x as u64, *value)
                };
                lines.extend(points.iter().map(line));
            }
        }
    }
    csv_of(&["measure", "method", "seed", panels[0].labels[0], "value"], lines)
}

/// Returns what was measured at the end of the first job of each method, and its seed.
fn measured(methods: &[MethodRuns]) -> impl Iterator<Item = (&MethodRuns, u64, &Measured)> {
    methods.iter().filter_map(|method| {
        let result = method.results.first()?;
        Some((method, result.seed, result.measured.as_ref()?))
    })
}

fn walks_csv(methods: &[MethodRuns]) -> Result<Vec<u8>, Report> {
    let mut lines = Vec::new();
    for (method, seed, measured) in measured(methods) {
        let walks = measured.walks.iter().chain(measured.bridge.iter().map(|bridge| &bridge.walk));
        for Walked { distance, reached, path, .. } in walks {
            let line = |(step, [x, y]): (usize, &[f32; 2])| {
                (method.entry.name, seed, *distance, *reached, step, *x, *y)
            };
            lines.extend(path.iter().enumerate().map(line));
        }
    }
    csv_of(&["method", "seed", "distance", "reached", "step", "x", "y"], lines)
}
